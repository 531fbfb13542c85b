//! A constant wind, inertial frame, horizontal: every aerodynamic term sees the velocity relative to the moving air.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "m/s", possible: (-30.0, 30.0), typical: 1.0, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "steady-wind",
    sentence: "A steady wind blows: drag follows the speed through the air, not over the ground.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V],
    coefficients: &[coefficient("wind_north"), coefficient("wind_east")],
    excitation: "hover and turn once around in yaw",
    confused_with: &[(
        "attitude-offset",
        "yaw round in hover: wind keeps its direction over the ground, a tilted tracker turns with the craft",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.wind_ned_m_s.x = c[0];
    adjust.wind_ned_m_s.y = c[1];
}
