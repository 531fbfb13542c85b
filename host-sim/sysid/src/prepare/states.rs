//! The states of a craft over a prepared flight, at its samples and between them, and which samples give rows.

use std::iter::StepBy;
use std::ops::Range;

use model::{Adjustments, Pendulum, SampleInput, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::prepare::prepared::Prepared;
use crate::prepare::stretch::{RotorTrack, Stretch, vector};

/// Longest time between the rows of a fit, s.
const FIT_ROW_PERIOD_S: f64 = 0.03;

/// Samples of a stretch that are filtered together, and how a load swings at each of them: hanging still, where there is nothing.
pub struct Part {
    /// Samples of the stretch.
    pub samples: Range<usize>,
    /// How the load hangs at each of them.
    pub swings: Vec<Pendulum>,
}

impl Part {
    /// A whole stretch without a load.
    pub fn whole(stretch: &Stretch) -> Self {
        Self { samples: 0..stretch.time_s.len(), swings: Vec::new() }
    }
}

/// The states of a stretch.
pub struct States<'a> {
    stretch: &'a Stretch,
    /// From the tracked attitude to the body's, where they differ.
    untilt: Option<Matrix3<f64>>,
    lever_m: Vector3<f64>,
    rotor: [RotorTrack; 4],
    period_s: f64,
}

impl States<'_> {
    /// How many samples there are.
    #[allow(clippy::len_without_is_empty, reason = "a flight has samples")]
    pub fn len(&self) -> usize {
        self.stretch.time_s.len()
    }

    /// Inertial to body at a sample.
    #[inline]
    pub fn dcm(&self, k: usize) -> Matrix3<f64> {
        let tracked = &self.stretch.dcm[k];
        self.untilt.map_or(*tracked, |untilt| untilt * tracked)
    }

    /// At a sample, but for the accelerations.
    #[inline]
    fn without_acceleration(&self, k: usize) -> SampleInput {
        let stretch = self.stretch;
        let dcm = self.dcm(k);
        let rate = vector(&stretch.rate_rad_s, k);
        let mut velocity = dcm * vector(&stretch.velocity_ned_m_s, k);
        let mut position = vector(&stretch.position_ned_m, k);
        if self.lever_m != Vector3::zeros() {
            velocity -= rate.cross(&self.lever_m);
            position -= dcm.tr_mul(&self.lever_m);
        }
        SampleInput {
            position_ned_m: position,
            dcm,
            velocity_m_s: velocity,
            rate_rad_s: rate,
            angular_acceleration_rad_s2: Vector3::zeros(),
            rotor_rad_s: self.rotor.each_ref().map(|r| r.speed_rad_s[k]),
            rotor_acceleration_rad_s2: [0.0; 4],
            battery_v: stretch.battery_v[k],
            pendulum: Pendulum::default(),
        }
    }

    /// At a sample.
    pub fn at(&self, k: usize) -> SampleInput {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.len() - 1));
        let rate = &self.stretch.rate_rad_s;
        let turned = vector(rate, after) - vector(rate, before);
        SampleInput {
            angular_acceleration_rad_s2: turned / ((after - before).max(1) as f64 * self.period_s),
            ..self.without_acceleration(k)
        }
    }

    /// Hands over the mean states between neighbouring samples of a part, one fewer.
    pub fn for_each_between(&self, part: &Part, mut take: impl FnMut(SampleInput)) {
        let per_period = 1.0 / self.period_s;
        let first = part.samples.start;
        let mut a = self.without_acceleration(first);
        for k in first + 1..part.samples.end {
            let b = self.without_acceleration(k);
            take(SampleInput {
                position_ned_m: 0.5 * (a.position_ned_m + b.position_ned_m),
                // The mean of two attitudes a hundredth of a radian apart is a rotation to a part in 10^5.
                dcm: 0.5 * (a.dcm + b.dcm),
                velocity_m_s: 0.5 * (a.velocity_m_s + b.velocity_m_s),
                rate_rad_s: 0.5 * (a.rate_rad_s + b.rate_rad_s),
                angular_acceleration_rad_s2: per_period * (b.rate_rad_s - a.rate_rad_s),
                rotor_rad_s: self.rotor.each_ref().map(|r| r.mean_rad_s[k - 1]),
                rotor_acceleration_rad_s2: std::array::from_fn(|i| {
                    per_period * (b.rotor_rad_s[i] - a.rotor_rad_s[i])
                }),
                battery_v: 0.5 * (a.battery_v + b.battery_v),
                pendulum: match part.swings.get(k - 1 - first..=k - first) {
                    Some([before, after]) => before.middle(after),
                    _ => Pendulum::default(),
                },
            });
            a = b;
        }
    }
}

impl Prepared {
    /// Samples from one row of a fit to the next.
    pub fn fit_stride(&self) -> usize {
        // A quotient that is whole but for rounding is whole.
        (FIT_ROW_PERIOD_S / self.period_s + 1e-6).max(1.0) as usize
    }

    /// The samples of a stretch at which there are rows.
    pub(crate) fn row_samples(&self, stretch: &Stretch, stride: usize) -> StepBy<Range<usize>> {
        (self.margin..stretch.time_s.len() - self.margin).step_by(stride)
    }

    /// Of the rows at every sample, those at which a fit has rows.
    pub fn row_samples_of_conditions(&self) -> Vec<usize> {
        let stride = self.fit_stride();
        let mut first = 0;
        let mut all = Vec::new();
        for stretch in &self.stretches {
            let rows = stretch.time_s.len() - 2 * self.margin;
            all.extend((first..first + rows).step_by(stride));
            first += rows;
        }
        all
    }

    /// Rows at which stretches begin: neighbours across these are not neighbours in time.
    pub fn starts_of_rows(&self, stride: usize) -> Vec<usize> {
        let mut next = 0;
        let start = |stretch| {
            let start = next;
            next += self.row_samples(stretch, stride).len();
            start
        };
        self.stretches.iter().map(start).collect()
    }

    /// The states of a stretch under `adjust`; a load hangs still.
    pub fn states<'a>(&self, stretch: &'a Stretch, vehicle: &Vehicle, adjust: &Adjustments) -> States<'a> {
        States {
            stretch,
            untilt: Some(adjust.true_dcm(&Matrix3::identity())).filter(|m| *m != Matrix3::identity()),
            lever_m: Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m(),
            rotor: stretch.rotors(vehicle, adjust, self.period_s, self.rotor_late_s()),
            period_s: self.period_s,
        }
    }
}
