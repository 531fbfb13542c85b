//! What a model says of the fit that gave its coefficients.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::axis::{Axis, PerAxis};
use crate::verdict::{NotIdentified, PerGroup, Verdict};

/// Constants that belong to a fit and are not coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceValues {
    /// Mean battery voltage of the training flights, V: where `battery-voltage` is zero.
    pub battery_v: f64,
    /// Whether all training flights of a vehicle whose motor map is to be identified logged their rotor speeds: then nothing
    /// stands in for them. Never said of a vehicle with a map.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub rotor_speeds_logged: bool,
}

/// Errors of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisError {
    /// Sum of squared errors, (unit of the axis)^2.
    pub sse: f64,
    /// Root mean square error, unit of the axis.
    pub rms: f64,
    /// 1 - sse / (sum of squares about the mean).
    pub r2: f64,
    /// Samples behind it.
    pub samples: u64,
}

/// What a flight was used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FlightRole {
    /// Fitted on.
    Train,
    /// Held out.
    Validate,
}

/// A flight that the fit saw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightRecord {
    /// File name.
    pub name: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// What it was used for.
    pub role: FlightRole,
    /// Samples used.
    pub samples: u64,
    /// Wind of its own, north and east, in m/s, beside which the model was fitted. Absent where the flights were taken to be in one wind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind_m_s: Option<[f64; 2]>,
}

/// The fit that gave the coefficients.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitRecord {
    /// Flights.
    pub flights: Vec<FlightRecord>,
    /// Errors on the training flights.
    pub train: PerAxis<AxisError>,
    /// Errors on the held-out flights.
    pub held_out: PerAxis<AxisError>,
    /// How much the craft differs from flight to flight: what a later change must stand out from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scatter: Vec<ChangeScatter>,
    /// Speed over ground that was hardly ever exceeded (2 % of the time) in the training flights, m/s: at higher airspeeds the
    /// model's drag is extrapolated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flown_speed_m_s: Option<f64>,
    /// How the rotors share the work in steady flight: what a later change of the balance must stand out from. Absent where
    /// there are fewer than two flights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub balance: Option<BalanceRecord>,
    /// How each motor answered its commands, in flights with rotor speeds and a motor map. Empty where fewer than three tell it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motor_answers: Vec<MotorAnswer>,
    /// How the tracker saw the body against the accelerometer. Absent where fewer than four flights tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracker_mount: Option<TrackerMountRecord>,
    /// The constant force that the accelerometer told along the body, its own offset included. Absent where fewer than four flights tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constant_force: Option<ConstantForceRecord>,
    /// Dead time in s that flights of commands show beyond the model's own: their clocks are counted from it. Absent where
    /// rotor speeds were measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotor_delay_s: Option<f64>,
    /// Why the model has no rotation, where the flights did not determine it: force rows are all there is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotation_refused: Vec<String>,
    /// What of the model the flights do not determine; empty where they determine all of it, and in older files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_identified: Vec<NotIdentified>,
    /// The conclusion of the loop that made the model, where one did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdicts: Option<PerGroup<Verdict>>,
    /// What a refinement on open-loop predictions came to, where one was tried.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refinement: Option<RefinementRecord>,
}

/// How a motor answered its commands in the flights of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorAnswer {
    /// Mean speed over what the motor map says.
    pub speed_ratio: f64,
    /// By how much that of a new flight deviates.
    pub speed_ratio_deviation: f64,
    /// Time constant, s. Absent where the commands hardly moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_s: Option<f64>,
    /// By how much that of a new flight deviates, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_deviation_s: Option<f64>,
}

/// A tracked body against the accelerometer in the flights of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerMountRecord {
    /// Turn of the tracked attitude about x and y, the accelerometer's offset over g included, rad.
    pub tilt_rad: [f64; 2],
    /// By how much that of a new flight deviates, rad.
    pub tilt_deviation_rad: [f64; 2],
    /// Tracked point from the accelerometer, body FRD, m. Absent where the craft hardly turned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lever_m: Option<[f64; 3]>,
    /// By how much that of a new flight deviates, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lever_deviation_m: Option<[f64; 3]>,
}

/// A constant specific force along the body in the flights of a fit, as an accelerometer told it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantForceRecord {
    /// Along x and y, the accelerometer's offset included, m/s^2.
    pub force_m_s2: [f64; 2],
    /// By how much that of a new flight deviates, m/s^2.
    pub force_deviation_m_s2: [f64; 2],
}

/// A refinement on open-loop predictions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefinementRecord {
    /// Which coefficients were moved: "moments" or "all".
    pub rows: String,
    /// Whether they were kept.
    pub kept: bool,
    /// Why.
    pub reason: String,
    /// Open-loop error of the held-out flights before, summed over horizons of 1 to 50 samples.
    pub before: OpenLoopSums,
    /// And with the moved coefficients.
    pub after: OpenLoopSums,
}

/// Mean norms of open-loop errors, summed over horizons of 1 to 50 samples.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenLoopSums {
    /// m.
    pub position_m: f64,
    /// m/s.
    pub velocity_m_s: f64,
    /// rad.
    pub attitude_rad: f64,
    /// rad/s.
    pub rate_rad_s: f64,
}

/// How far the estimate of a change scatters about zero between the flights a model was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChangeScatter {
    /// Identifier of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub coefficient: String,
    /// Root mean square of the estimates, in the coefficient's unit.
    pub deviation: f64,
    /// Their mean, where it is far from zero: the model lacks something that looks like this change in each of its flights, and
    /// new ones are no different for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
}

/// The steady balance of a craft's rotors over its flights, in shares of the thrust: no scale of the motor map is in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceRecord {
    /// Flights behind it.
    pub flights: u64,
    /// Mean battery voltage of the flights, V.
    pub battery_v: f64,
    /// What the model leaves of the specific force along z, in units of gravity; its slope is by the battery voltage, 1/V.
    pub lift: BalanceRow,
    /// Thrust of the left rotors less that of the right ones, part of the whole; its slope is by the velocity to the right, s/m.
    pub roll: BalanceRow,
    /// Thrust of the front rotors less that of the rear ones, part of the whole; its slope is by the velocity forwards, s/m.
    pub pitch: BalanceRow,
    /// Squared speed of the rotors that yaw the craft right less that of the others, part of the whole.
    pub yaw: BalanceRow,
}

impl BalanceRecord {
    /// Lift, roll, pitch and yaw.
    pub fn rows(&self) -> [&BalanceRow; 4] {
        [&self.lift, &self.roll, &self.pitch, &self.yaw]
    }
}

/// One equation of the balance: a mean over flights with random effects, value = mean + slope * condition + flight's own + noise.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceRow {
    /// Mean over flights, where the condition is zero.
    pub mean: f64,
    /// Slope by the row's condition; zero where it did not vary.
    pub slope: f64,
    /// Variance of the mean, covariance of both, variance of the slope.
    pub covariance: [f64; 3],
    /// Standard deviation between flights.
    pub between: f64,
    /// Standard deviation of a window about its flight.
    pub within: f64,
}

/// An effect that was added, with the held-out error before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HistoryEntry {
    /// The effect's identifier.
    pub effect: String,
    /// Whether the held-out flights supported it.
    pub supported: bool,
    /// Sum of squared errors on the held-out flights before.
    pub sse_before: PerAxis<f64>,
    /// And after.
    pub sse_after: PerAxis<f64>,
}

impl PerAxis<f64> {
    /// Percent by which `after` is below `self`, for each axis; 0 where there was no error.
    pub fn drop_percent(&self, after: &Self) -> Self {
        Self::from_fn(
            |axis: Axis| {
                if self[axis] > 0.0 { 100.0 * (self[axis] - after[axis]) / self[axis] } else { 0.0 }
            },
        )
    }
}
