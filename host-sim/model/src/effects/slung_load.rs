//! A load on a cable under the craft swings and pulls: a pendulum, driven by where the craft goes. The equations are in
//! `host-sim/model/src/load.rs`.

use crate::load::Load;
use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "slung-load",
    sentence: "A load swings on a cable under the craft.",
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V, Axis::W],
    coefficients: &[
        Coefficient { name: "load_mass", unit: "kg", possible: (0.0, 100.0), typical: 0.05, prior: None },
        // Without a load, a length means nothing; what is known of it is hardly more than what is possible.
        Coefficient {
            name: "cable_length",
            unit: "m",
            possible: (0.08, 10.0),
            typical: 0.4,
            prior: Some(30.0),
        },
        // Air and the cable's own stiffness damp a swing by some percent.
        Coefficient { name: "damping_ratio", unit: "1", possible: (0.0, 1.0), typical: 0.05, prior: Some(0.1) },
    ],
    excitation: "start, stop and reverse quickly, so that the load swings, then hover and let it swing out",
    confused_with: &[
        ("mass-change", "start and stop quickly: only a load that hangs goes on swinging"),
        ("tether", "stop quickly in the open: a load swings on, a tether comes to rest"),
    ],
};

/// Lengths from which a fit starts, m: a quarter apart, an eighth in frequency, which is as wide as the resonance of a
/// swing with the damping that they start with.
pub(super) const STARTING_LENGTHS_M: [f64; 17] = [
    0.098, 0.122, 0.153, 0.191, 0.238, 0.298, 0.373, 0.466, 0.582, 0.728, 0.91, 1.14, 1.42, 1.78, 2.22, 2.78, 3.47,
];
/// Damping ratio from which a fit starts.
pub(super) const STARTING_DAMPING: f64 = 0.06;

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.load = Some(Load { mass_kg: c[0], cable_length_m: c[1], damping_ratio: c[2] });
}
