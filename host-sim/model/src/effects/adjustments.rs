//! What the adjusting effects of a model change, all together.

use nalgebra::{Matrix3, Vector3};

use crate::effects::Adjustments;
use crate::effects::adjusting::Adjusting;
use crate::effects::slung_load::cable::SlungLoad;
use crate::sample::{AtRotor, Constants, Sample, SampleInput};
use crate::vehicle::{RotorMap, Vehicle};

/// The turn from a tracked attitude to the body's, where a tracker's frame is tilted against the body.
#[derive(Debug, Clone, Copy)]
pub struct Untilt(Option<Matrix3<f64>>);

impl Untilt {
    /// The body's attitude behind a tracked one (both inertial to body).
    #[inline]
    pub fn body(&self, tracked: &Matrix3<f64>) -> Matrix3<f64> {
        self.0.map_or(*tracked, |untilt| untilt * tracked)
    }
}

impl Adjustments {
    fn sum(&self, of: impl Fn(&(dyn Adjusting + 'static)) -> f64) -> f64 {
        self.all().into_iter().map(of).sum()
    }

    /// Whether the air moves over ground.
    pub fn moves_air(&self) -> bool {
        self.all().into_iter().any(Adjusting::changes_air)
    }

    /// Whether a sample is plain: see [`Sample::plain`].
    pub(crate) fn leaves_samples_plain(&self) -> bool {
        !self.moves_air() && !self.changes_thrust() && self.load().is_none()
    }

    /// A load on a cable under the craft.
    pub fn load(&self) -> Option<SlungLoad> {
        self.all().into_iter().find_map(Adjusting::load)
    }

    /// Rotor speed in rad/s after the voltage correction.
    pub fn corrected_speed_rad_s(&self, speed_rad_s: f64, battery_v: f64) -> f64 {
        self.corrected_at(battery_v)(speed_rad_s)
    }

    /// Rotor speeds in rad/s after the correction for a voltage.
    #[inline(always)]
    pub(crate) fn corrected_at(&self, battery_v: f64) -> impl Fn(f64) -> f64 {
        let change = self.speed_change_rad_s(battery_v);
        move |speed_rad_s| if change == 0.0 { speed_rad_s } else { (speed_rad_s + change).max(0.0) }
    }

    /// The motor map after the voltage correction.
    pub fn corrected_map(&self, map: RotorMap) -> RotorMap {
        RotorMap {
            voltage: map.voltage + self.sum(Adjusting::speed_per_volt),
            offset: map.offset + self.speed_change_rad_s(0.0),
            ..map
        }
    }

    fn time_constant_s(&self) -> f64 {
        self.sum(Adjusting::time_constant_s)
    }

    /// Lag of the rotors in rad/s behind the vehicle file's, absent when they follow at once.
    pub fn lag_rad_s(&self, vehicle_lag_rad_s: Option<f64>) -> Option<f64> {
        let change_s = self.time_constant_s();
        if change_s == 0.0 {
            return vehicle_lag_rad_s;
        }
        let time_constant_s = vehicle_lag_rad_s.map_or(0.0, |lag| 1.0 / lag) + change_s;
        // A tenth of a millisecond is at once for a craft of any size.
        (time_constant_s > 1e-4).then(|| 1.0 / time_constant_s)
    }

    /// Dead time between command and rotor, s.
    pub fn dead_time_s(&self) -> f64 {
        self.sum(Adjusting::dead_time_s)
    }

    /// Mass beyond the vehicle file's, kg.
    pub fn extra_mass_kg(&self) -> f64 {
        self.sum(Adjusting::extra_mass_kg)
    }

    /// Tracked point beyond the vehicle file's, body FRD, m.
    pub fn tracked_point_m(&self) -> Vector3<f64> {
        self.all().into_iter().map(Adjusting::tracked_point_m).sum()
    }

    /// Tilt of the tracked attitude against the body, where there is one: measured = true followed by the tilt.
    pub fn tilt(&self) -> Option<Matrix3<f64>> {
        self.all().into_iter().filter_map(Adjusting::tilt).reduce(|first, then| then * first)
    }

    /// The attitude a tracker reports for the body's attitude (both inertial to body).
    pub fn measured_dcm(&self, dcm: &Matrix3<f64>) -> Matrix3<f64> {
        self.tilt().map_or(*dcm, |tilt| tilt * dcm)
    }

    /// The turn from tracked attitudes to those of the body, for many of them.
    pub fn untilt(&self) -> Untilt {
        Untilt(self.tilt().map(|tilt| tilt.transpose()))
    }

    /// Whether a tracker reports the same of a motion under both.
    pub fn track_alike(&self, other: &Self) -> bool {
        self.tracked_point_m() == other.tracked_point_m() && self.tilt() == other.tilt()
    }

    /// Whether a log shows the same states under both: a matter of the rotors and of the tracker.
    pub fn same_states(&self, other: &Self) -> bool {
        let rotors = |a: &Self| {
            let map = RotorMap { command: 1.0, voltage: 0.0, offset: 0.0 };
            (a.corrected_map(map), a.time_constant_s(), a.dead_time_s())
        };
        rotors(self) == rotors(other) && self.track_alike(other)
    }

    /// Constants of a vehicle under these.
    pub(crate) fn constants(&self, vehicle: &Vehicle) -> Constants {
        let com_offset_m = std::array::from_fn(|k| self.sum(|effect| effect.com_offset_m()[k]));
        let torque_change = std::array::from_fn(|k| self.sum(|effect| effect.torque_change()[k]));
        Constants::new(vehicle, self.extra_mass_kg(), com_offset_m, torque_change, self.changes_thrust())
    }

    /// The sample of a state.
    #[inline(always)]
    pub(crate) fn sample<'a>(&self, input: &'a SampleInput, constants: &'a Constants) -> Sample<'a> {
        let mut sample = Sample::plain(input, constants);
        sample.air_velocity_m_s = self.air_velocity_m_s(input);
        if constants.changes_thrust {
            sample.rotor_thrust_rad2_s2 = self.changed_thrust(input, sample.air_velocity_m_s, constants);
        }
        sample
    }

    /// The sample of a state, all in line. Where nothing is `ADJUSTED`, these are to leave samples plain.
    #[inline(always)]
    pub(crate) fn straight_sample<'a, const ADJUSTED: bool>(
        &self,
        input: &'a SampleInput,
        constants: &'a Constants,
    ) -> Sample<'a> {
        let mut sample = Sample::plain(input, constants);
        if ADJUSTED {
            let air_velocity_m_s = self.air_velocity_m_s(input);
            sample.air_velocity_m_s = air_velocity_m_s;
            if constants.changes_thrust {
                let thrust =
                    |rotor| self.thrust_rad2_s2(&AtRotor { rotor, input, air_velocity_m_s, constants });
                sample.rotor_thrust_rad2_s2 = std::array::from_fn(thrust);
            }
        }
        sample
    }

    /// What stands in for the square of each rotor's speed in its thrust, rad^2/s^2.
    ///
    /// Out of line: most plants have none of this.
    #[inline(never)]
    fn changed_thrust(
        &self,
        input: &SampleInput,
        air_velocity_m_s: Vector3<f64>,
        constants: &Constants,
    ) -> [f64; 4] {
        let mut thrust_rad2_s2 = [0.0; 4];
        for (rotor, thrust) in thrust_rad2_s2.iter_mut().enumerate() {
            *thrust = self.thrust_rad2_s2(&AtRotor { rotor, input, air_velocity_m_s, constants });
        }
        thrust_rad2_s2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Kind;
    use crate::effects::CATALOGUE;
    use crate::pendulum::Pendulum;

    fn in_flight() -> SampleInput {
        SampleInput {
            position_ned_m: Vector3::new(0.3, -0.2, -0.2),
            dcm: Matrix3::identity(),
            velocity_m_s: Vector3::new(1.0, 0.5, 0.2),
            rate_rad_s: Vector3::zeros(),
            angular_acceleration_rad_s2: Vector3::zeros(),
            rotor_rad_s: [600.0, 610.0, 620.0, 630.0],
            rotor_acceleration_rad_s2: [0.0; 4],
            battery_v: 11.0,
            pendulum: Pendulum::default(),
            memory: None,
            further: crate::sample::NO_FURTHER,
        }
    }

    /// A model's plant asks for the air and the thrust only where an effect says that it changes them.
    #[test]
    fn an_effect_says_that_it_changes_the_air_or_the_thrust() {
        let (input, vehicle) = (in_flight(), Vehicle::thesis());
        let neutral = Adjustments::default();
        let constants = neutral.constants(&vehicle);
        assert!(neutral.leaves_samples_plain());
        let squares = input.rotor_rad_s.map(|w| w * w);
        let mut changing = 0;
        for effect in CATALOGUE.iter().filter(|effect| effect.info().kind == Kind::Adjusting) {
            let ordinary: Vec<f64> = effect.info().coefficients.iter().map(|c| c.typical).collect();
            let mut adjust = Adjustments::default();
            adjust.take_up(*effect, &ordinary, 11.5);
            assert_ne!(adjust, neutral, "{effect}");
            let air = adjust.air_velocity_m_s(&input);
            assert_eq!(adjust.moves_air(), air != input.velocity_m_s, "{effect}");
            let thrust = adjust.changed_thrust(&input, air, &constants);
            assert_eq!(adjust.changes_thrust(), thrust != squares, "{effect}");
            changing += usize::from(adjust.moves_air() || adjust.changes_thrust());
        }
        assert!(changing >= 5, "wind, ground, lift, linear thrust, worn rotors: {changing}");
    }

    /// Cheeseman and Bennett's formula at a height of one radius, and three factors at once.
    #[test]
    fn factors_of_the_thrust_multiply() {
        let vehicle = Vehicle::thesis();
        let mut input = in_flight();
        input.position_ned_m.z = -vehicle.rotor_radius;
        let mut adjust = Adjustments::default();
        let effect = |id: &str| crate::effects::Effect::from_id(id).unwrap();
        adjust.take_up(effect("ground-effect"), &[1.0, 0.0], 0.0);
        adjust.take_up(effect("motor-efficiency"), &[0.1, 0.0, 0.0, 0.0], 0.0);
        adjust.take_up(effect("translational-lift"), &[0.02], 0.0);
        let constants = adjust.constants(&vehicle);
        let thrust = adjust.sample(&input, &constants).rotor_thrust_rad2_s2;
        let common = 1.25 * 0.02 + 1.0;
        let ground = 1.0 / (1.0 - 1.0 / 16.0);
        for (rotor, loss) in [0.1, 0.0, 0.0, 0.0].into_iter().enumerate() {
            let expected = input.rotor_rad_s[rotor].powi(2) * (1.0 - loss) * common * ground;
            assert!((thrust[rotor] / expected - 1.0).abs() < 1e-12, "{rotor}");
        }
    }
}
