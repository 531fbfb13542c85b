//! Flights from the floor to the floor: idle rotors, a ramp of thrust, a climb to where the pattern
//! begins; at the end the pattern slows down, the craft sinks, touches and stands again.
//!
//! The floor holds what stands on it: no sliding, no tipping, no bouncing.

use nalgebra::{Rotation3, Vector3};

use super::body::{Body, LANDING_GEAR, STEP_S};
use super::craft::Craft;

/// Thrust grows from idling to hovering in this time, and falls in half of it, s.
const RAMP_S: f64 = 1.0;
/// Duration of the climb and of the descent, s.
const CLIMB_S: f64 = 2.5;
/// The pattern comes to rest within this time, s.
const STOP_S: f64 = 2.0;
/// Time between the planned touch and the real one, at most, s.
const TOUCH_S: f64 = 1.5;
/// A craft that touches with one leg comes level within this time, s.
const LEVEL_S: f64 = 0.05;
/// The pilot aims so far below the floor, m: a craft that only reaches it would hang above.
const PRESS_M: f64 = 0.1;
/// Idling rotors, part of hover speed.
const IDLE: f64 = 0.3;

/// Where to be: position NED in m and yaw in rad.
pub(super) type Place = (Vector3<f64>, f64);

/// From 0 to 1 with two continuous derivatives.
pub(super) fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

/// How a pattern is reached from the floor and left again. Its times count from the pattern's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ends {
    /// Down coordinate of the centre of mass of a craft that stands, m.
    standing_z_m: f64,
    pattern_s: f64,
}

impl Ends {
    pub(super) fn new(craft: &Craft, pattern_s: f64) -> Self {
        Self { standing_z_m: craft.ground_offset_m - LANDING_GEAR * craft.rotor_radius_m, pattern_s }
    }

    /// The place of the whole flight from that of the pattern alone.
    pub(super) fn place(&self, time_s: f64, pattern: impl Fn(f64) -> Place) -> Place {
        let over = (time_s - self.pattern_s).clamp(0.0, STOP_S);
        let slowed_s = time_s.min(self.pattern_s) + over - over * over / (2.0 * STOP_S);
        let (mut place, yaw) = pattern(slowed_s);
        let landed = smooth((time_s - self.pattern_s - STOP_S) / CLIMB_S);
        let up = smooth(1.0 + time_s / CLIMB_S) * (1.0 - landed);
        place.z = self.standing_z_m + (place.z - self.standing_z_m) * up + PRESS_M * landed;
        (place, yaw)
    }

    /// Whether the floor is near, by plan.
    fn is_low(&self, time_s: f64) -> bool {
        time_s < 0.0 || time_s > self.pattern_s + STOP_S
    }
}

/// A craft between floor and floor.
#[derive(Debug, Clone)]
pub(super) struct Standing {
    ends: Ends,
    standing_s: f64,
    /// When it touched after the flight, and the commands of that moment.
    landed: Option<(f64, [f64; 4])>,
    touches: bool,
}

impl Standing {
    /// Stands for `standing_s` before and after.
    pub(super) fn new(ends: Ends, standing_s: f64) -> Self {
        Self { ends, standing_s, landed: None, touches: true }
    }

    /// Length of the log, s.
    pub(super) fn total_s(&self) -> f64 {
        self.pattern_time_s(0.0).abs() + self.ends.pattern_s + STOP_S + CLIMB_S + TOUCH_S + self.standing_s
    }

    /// Time of the pattern at a time of the log, s.
    fn pattern_time_s(&self, time_s: f64) -> f64 {
        time_s - self.standing_s - RAMP_S - CLIMB_S
    }

    /// A craft that idles on the floor below `start`.
    pub(super) fn body(&self, craft: &Craft, start: Vector3<f64>) -> Body {
        let place = Vector3::new(start.x, start.y, self.ends.standing_z_m);
        let mut body = Body::hovering(craft, place);
        body.rotor_rad_s = [IDLE * craft.hover_rad_s(); 4];
        body.battery_v = craft.battery.voltage_v(0.0, &body.rotor_rad_s);
        body.set_rate_rad_s(craft, Vector3::zeros());
        body
    }

    /// Whether the pilot need not be asked if all is well.
    pub(super) fn is_low(&self, time_s: f64) -> bool {
        self.ends.is_low(self.pattern_time_s(time_s))
    }

    /// Commands at a tick; `fly` gives those of the pilot at a time of the pattern.
    pub(super) fn command(
        &mut self,
        time_s: f64,
        craft: &Craft,
        fly: impl FnOnce(f64) -> [f64; 4],
    ) -> [f64; 4] {
        let [low, high] = craft.command_range();
        let idle = craft.map.command_for(IDLE * craft.hover_rad_s(), craft.hover_v()).clamp(low, high);
        let between = |flying: [f64; 4], part: f64| flying.map(|c| idle + (c - idle) * part.clamp(0.0, 1.0));
        if let Some((since_s, last)) = self.landed {
            return between(last, 1.0 - (time_s - since_s) / (0.5 * RAMP_S));
        }
        if time_s < self.standing_s {
            return [idle; 4];
        }
        // On the ramp the pilot wants the craft where it is.
        let flying = fly(self.pattern_time_s(time_s).max(-CLIMB_S));
        if self.touches && self.pattern_time_s(time_s) > self.ends.pattern_s {
            self.landed = Some((time_s, flying));
        }
        between(flying, (time_s - self.standing_s) / RAMP_S)
    }

    /// Holds a body that has sunk onto the floor; after the flight it does not take off again.
    pub(super) fn hold(&mut self, craft: &Craft, body: &mut Body) {
        let floor_m = self.ends.standing_z_m;
        let sinks = body.position_ned_m.z >= floor_m && body.velocity_ned_m_s.z >= 0.0;
        self.touches = sinks || self.landed.is_some();
        if self.touches {
            let (roll, pitch, yaw) = body.attitude.euler_angles();
            let keep = (-STEP_S / LEVEL_S).exp();
            body.position_ned_m -= body.velocity_ned_m_s * STEP_S;
            body.position_ned_m.z = floor_m;
            body.velocity_ned_m_s = Vector3::zeros();
            body.attitude = Rotation3::from_euler_angles(keep * roll, keep * pitch, yaw);
            body.set_rate_rad_s(craft, Vector3::new(roll, pitch, 0.0) * (-1.0 / LEVEL_S));
        }
    }
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};

    use crate::world::{Pattern, Sensors, Size, World};

    fn flown(size: Size) -> (World, Flight) {
        let world = World::new(size, 30).standing(3.0);
        let flight = world.fly(Pattern::A, 12.0, &Sensors::noisy(0.0), 0).expect("a calm craft is kept");
        (world, flight)
    }

    #[test]
    fn a_craft_stands_idle_at_both_ends_and_flies_between() {
        for size in Size::ALL {
            let (world, flight) = flown(size);
            let [z, cmd] = [Column::Z, Column::Cmd1].map(|column| flight.required(column));
            let floor_m = -super::LANDING_GEAR * world.craft.rotor_radius_m;
            for rows in [0..300, flight.len() - 250..flight.len()] {
                assert!(z[rows.clone()].iter().all(|z| (z - floor_m).abs() < 1e-9), "{size:?}");
                let [first, .., last] = cmd[rows] else { panic!("some rows") };
                assert_eq!(first, last, "{size:?}: the motors idle");
            }
            let highest = z.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(highest < floor_m - 0.5, "{size:?}: {highest}");
            let hover = world.craft.map.command_for(world.craft.hover_rad_s(), world.craft.hover_v());
            assert!(cmd[0] < hover && cmd[700] > cmd[0], "{size:?}: {} {hover}", cmd[0]);
        }
    }

    #[test]
    fn nothing_jumps_where_the_craft_leaves_the_floor_and_touches_it() {
        let (_, flight) = flown(Size::F330);
        for column in [Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta] {
            let values = flight.required(column);
            let step = values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            // 3 m/s or 4 rad/s at 100 Hz.
            assert!(step < 0.04, "{column:?}: {step}");
        }
    }
}
