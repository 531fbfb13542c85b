//! The quantities residuals are judged by: where does the model fail, and on what does what is left depend?

use crate::prepare::Conditions;

/// A quantity measured in flight, over the rows of one flight.
#[derive(Debug, Clone)]
pub struct Condition {
    /// Name for people, files and JSON.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Value at each row.
    pub values: Vec<f64>,
}

impl Conditions {
    /// All quantities, in a fixed order.
    pub fn all(&self) -> Vec<Condition> {
        let [x, y, z] = &self.position_ned_m;
        let [u, v, w] = &self.velocity_m_s;
        let [p, q, r] = &self.rate_rad_s;
        let [phi, theta, psi] = &self.euler_rad;
        let start = self.time_s.first().copied().unwrap_or(0.0);
        let condition = |name, unit, values: Vec<f64>| Condition { name, unit, values };
        vec![
            condition("height", "m", z.iter().map(|z| -z).collect()),
            condition("speed", "m/s", (0..u.len()).map(|k| u[k].hypot(v[k])).collect()),
            condition("forward speed", "m/s", u.clone()),
            condition("sideward speed", "m/s", v.clone()),
            condition("sink rate", "m/s", w.clone()),
            condition("roll rate", "rad/s", p.clone()),
            condition("pitch rate", "rad/s", q.clone()),
            condition("yaw rate", "rad/s", r.clone()),
            condition("roll", "rad", phi.clone()),
            condition("pitch", "rad", theta.clone()),
            condition("yaw", "rad", psi.clone()),
            condition("north position", "m", x.clone()),
            condition("east position", "m", y.clone()),
            condition("rotor speed", "rad/s", self.mean_rotor_rad_s.clone()),
            condition("battery voltage", "V", self.battery_v.clone()),
            condition("time", "s", self.time_s.iter().map(|t| t - start).collect()),
        ]
    }
}
