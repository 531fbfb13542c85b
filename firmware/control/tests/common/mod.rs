//! What the tests of totality share.

mod cases;

pub(crate) use cases::cases;
use control::Config;
use control::gains::{BatteryFilter, Complement, GyroFusion, Saturation};

/// Every law and option.
pub(crate) fn configs() -> [Config; 5] {
    let mut fused = Config::thesis();
    fused.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact });
    fused.estimation.battery = Some(BatteryFilter { gain: 0.02 });
    let mut plain = Config::thesis();
    plain.anti_windup = false;
    let mut shared = Config::thesis();
    (shared.saturation, shared.tilt_compensation) = (Saturation::AttitudeFirst, true);
    [Config::thesis(), Config::thesis_hand_tuned(), fused, plain, shared]
}
