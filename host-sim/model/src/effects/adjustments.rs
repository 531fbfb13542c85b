//! What the adjusting effects of a model change, all together.

use nalgebra::{Matrix3, Vector3};

use crate::effects::Adjustments;
use crate::effects::adjusting::Adjusting;
use crate::effects::slung_load::cable::SlungLoad;
use crate::sample::{AtRotor, Constants, Sample, SampleInput};
use crate::vehicle::{RotorMap, Vehicle};

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
        let change = self.speed_change_rad_s(battery_v);
        if change == 0.0 { speed_rad_s } else { (speed_rad_s + change).max(0.0) }
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

    /// The body's attitude behind a tracked one (both inertial to body).
    pub fn true_dcm(&self, measured: &Matrix3<f64>) -> Matrix3<f64> {
        self.tilt().map_or(*measured, |tilt| tilt.transpose() * measured)
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
        Constants::new(vehicle, self.extra_mass_kg(), com_offset_m, self.changes_thrust())
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
