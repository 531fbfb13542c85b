//! A load swings on a cable under the craft. The equations are in `cable.rs`.

pub(crate) mod cable;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use cable::SlungLoad;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "slung-load",
    sentence: "A load swings on a cable under the craft.",
    equation: r"\dot{\mathbf n} = \boldsymbol\omega \times \mathbf n, \quad \dot{\boldsymbol\omega} = -\frac{\mathbf n \times \mathbf f}{L} - 2 \zeta \omega_0 \boldsymbol\omega, \quad \mathbf f \to \mathbf f + \mathbf n \frac{m_l}{m + m_l} (L |\boldsymbol\omega|^2 - \mathbf n \cdot \mathbf f)",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V, Axis::W],
    through: &["u", "v", "thrust"],
    coefficients: &[
        Coefficient::new("load_mass", "kg", (0.0, 100.0), 0.05),
        // Without a load, a length means nothing; what is known of it is hardly more than what is possible.
        Coefficient::new("cable_length", "m", (0.08, 10.0), 0.4).known_to(30.0),
        // Air and the cable's own stiffness damp a swing by some percent. With a half, 3 % are left after one swing: that is no load that
        // swings, but something that follows the motion.
        Coefficient::new("damping_ratio", "1", (0.0, 0.5), 0.05).known_to(0.1),
    ],
    excitation: "start, stop and reverse quickly, so that the load swings, then hover until the swing has died away",
    confused_with: &[
        ("mass-change", "start and stop quickly: only a hanging load keeps swinging"),
        ("tether", "stop quickly in free space: a load keeps swinging, a tether comes to rest"),
    ],
    special: Special { adds_accelerations: true, hangs_load: true, starts, ..Special::NOTHING },
};

/// Lengths from which a fit starts, m: a quarter apart, an eighth in frequency, which is as wide as the resonance of a
/// swing with the damping that they start with.
const STARTING_LENGTHS_M: [f64; 17] = [
    0.098, 0.122, 0.153, 0.191, 0.238, 0.298, 0.373, 0.466, 0.582, 0.728, 0.91, 1.14, 1.42, 1.78, 2.22, 2.78,
    3.47,
];
/// Damping ratio from which a fit starts.
const STARTING_DAMPING: f64 = 0.06;

fn starts() -> Vec<Vec<Option<f64>>> {
    STARTING_LENGTHS_M.iter().map(|length_m| vec![None, Some(*length_m), Some(STARTING_DAMPING)]).collect()
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    load: Option<SlungLoad>,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { load: Some(SlungLoad { mass_kg: c[0], cable_length_m: c[1], damping_ratio: c[2] }) }
    }
}

impl Adjusting for Adjustment {
    fn load(&self) -> Option<SlungLoad> {
        self.load
    }
}
