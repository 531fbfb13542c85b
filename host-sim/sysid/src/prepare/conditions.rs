//! The quantities residuals are judged by: where does the model fail, and on what does what is left depend?

use model::{Adjustments, RotorQuantity, Vehicle};

use crate::prepare::prepared::Prepared;

/// What is known at the rows besides the regression, to judge residuals by.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Position NED, m.
    pub position_ned_m: [Vec<f64>; 3],
    /// Body velocity, m/s.
    pub velocity_m_s: [Vec<f64>; 3],
    /// Body rates, rad/s.
    pub rate_rad_s: [Vec<f64>; 3],
    /// Phi, theta, psi, rad.
    pub euler_rad: [Vec<f64>; 3],
    /// Mean rotor speed, rad/s, or mean command where commands stand in for rotor speeds.
    pub mean_rotor_rad_s: Vec<f64>,
    /// Which of the two.
    pub rotors: RotorQuantity,
    /// Battery voltage, V.
    pub battery_v: Vec<f64>,
}

impl Prepared {
    /// What the residuals can be judged by, at the rows.
    pub fn conditions(&self, vehicle: &Vehicle, adjust: &Adjustments) -> Conditions {
        let rotors = vehicle.rotor_quantity(self.has_rotor_speeds());
        let mut c = Conditions { rotors, ..Conditions::default() };
        for stretch in &self.stretches {
            let states = self.states(stretch, vehicle, adjust);
            let euler_rad = self.smooth(&stretch.euler_rad);
            let rate_rad_s = self.smooth(&stretch.rate_rad_s);
            for k in self.margin..states.len() - self.margin {
                let input = states.at(k);
                c.time_s.push(stretch.time_s[k]);
                for i in 0..3 {
                    c.position_ned_m[i].push(input.position_ned_m[i]);
                    c.velocity_m_s[i].push(input.velocity_m_s[i]);
                    c.rate_rad_s[i].push(rate_rad_s[i][k]);
                    c.euler_rad[i].push(euler_rad[i][k]);
                }
                c.mean_rotor_rad_s.push(input.rotor_rad_s.iter().sum::<f64>() / 4.0);
                c.battery_v.push(input.battery_v);
            }
        }
        c
    }
}

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
            condition("rotor speed", self.rotors.unit(), self.mean_rotor_rad_s.clone()),
            condition("battery voltage", "V", self.battery_v.clone()),
            condition("time", "s", self.time_s.iter().map(|t| t - start).collect()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::prepared;

    fn value(all: &[Condition], name: &str) -> Vec<f64> {
        all.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no {name}")).values.clone()
    }

    #[test]
    fn height_is_up_speed_is_horizontal_and_time_starts_at_the_first_row() {
        let conditions = Conditions {
            time_s: vec![5.0, 5.5],
            position_ned_m: [vec![1.0, 2.0], vec![3.0, 4.0], vec![-0.5, 0.25]],
            velocity_m_s: [vec![3.0, -3.0], vec![4.0, -4.0], vec![12.0, 0.0]],
            ..Conditions::default()
        };
        let all = conditions.all();
        assert_eq!(value(&all, "height"), [0.5, -0.25]);
        assert_eq!(value(&all, "speed"), [5.0, 5.0]);
        assert_eq!(value(&all, "sink rate"), [12.0, 0.0]);
        assert_eq!(value(&all, "time"), [0.0, 0.5]);
        assert_eq!(value(&all, "east position"), [3.0, 4.0]);
    }

    #[test]
    fn without_rows_there_is_every_quantity_without_a_value() {
        let all = Conditions::default().all();
        assert_eq!(all.len(), 16);
        assert!(all.iter().all(|c| c.values.is_empty()));
    }

    #[test]
    fn a_steady_climb_has_a_value_of_every_quantity_at_every_row() {
        let vehicle = Vehicle::thesis();
        let prepared = prepared(400, |t, row| {
            row.position_ned_m = [0.0, 0.0, -0.8 * t];
            row.euler_rad = [0.0, 0.0, 0.5];
        });
        let all = prepared.conditions(&vehicle, &Adjustments::default()).all();
        assert!(prepared.rows() > 300);
        assert!(all.iter().all(|c| c.values.len() == prepared.rows()));
        let near = |name: &str, expected: f64| {
            let values = value(&all, name);
            assert!(values.iter().all(|v| (v - expected).abs() < 1e-9), "{name}: {}", values[0]);
        };
        near("sink rate", -0.8);
        near("speed", 0.0);
        near("yaw", 0.5);
        near("battery voltage", 12.0);
        // The map of the vehicle file, by hand: 0.785 * 1600 + 44.6505 * 12 - 1205.1.
        near("rotor speed", 586.706);
        // Rows begin where both windows of the differentiated position fit.
        let height = value(&all, "height");
        assert!((height[0] - 0.8 * 0.01 * prepared.margin as f64).abs() < 1e-9);
    }
}
