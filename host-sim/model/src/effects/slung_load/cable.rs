//! A load on a cable under the craft: a pendulum whose pivot flies.
//!
//! With the unit vector n from the craft to the load (inertial), its turning rate w, cable length L, load mass m_l, craft mass
//! m, and f the specific force of everything else on the craft:
//!
//! - the load: `n' = w x n`, `w' = -(n x f) / L - 2 zeta w0 w` with `w0^2 = g / L`. Gravity pulls both alike and drops out.
//! - the cable's pull on the craft, per mass: `n (m_l / (m + m_l)) (L |w|^2 - n.f)`. Sideways this is the swing, below the
//!   craft it is the load's weight and inertia: hanging still, the vertical specific force is divided by `1 + m_l / m`.
//!
//! For small swings the load's place eta and the craft's x obey `eta'' = -w0^2 (eta - x) - 2 zeta w0 (eta' - x')`, and the craft
//! feels `m_l w0^2 (eta - x)`. Driven by where the craft is, the load's own mass does not enter, so `w0^2 = g / L` whatever
//! it weighs; left to itself, a craft gives way, and the two swing against each other at `sqrt(g / L (1 + m_l / m))`.
//!
//! The damping is that of the air on the load: it does not act back on the craft. Deliberately absent: a slack cable, one
//! that hangs from elsewhere than the centre of mass, the load's own turning.

use nalgebra::{Matrix2, Matrix3, Vector3};

use crate::pendulum::Pendulum;

/// A load on a cable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlungLoad {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub cable_length_m: f64,
    /// zeta, of small swings.
    pub damping_ratio: f64,
}

/// Shortest cable, m: a search may ask for none.
const SHORTEST_M: f64 = 0.01;
/// Widest swing at a beginning, part of the cable's length: one beyond it is a fit's wrong step.
const WIDEST: f64 = 0.9;

impl SlungLoad {
    fn length_m(&self) -> f64 {
        self.cable_length_m.max(SHORTEST_M)
    }

    /// w0^2 = g / L, rad^2/s^2.
    pub fn stiffness_rad2_s2(&self, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 / self.length_m()
    }

    /// 2 zeta w0, 1/s.
    fn damping_per_s(&self, gravity_m_s2: f64) -> f64 {
        2.0 * self.damping_ratio * self.stiffness_rad2_s2(gravity_m_s2).sqrt()
    }

    /// The swing's derivative under the specific force of everything but the cable, inertial, m/s^2.
    pub(crate) fn derivative(
        &self,
        pendulum: &Pendulum,
        force_ned_m_s2: Vector3<f64>,
        gravity_m_s2: f64,
    ) -> Pendulum {
        let Pendulum { direction: n, turning_rad_s: w } = pendulum;
        Pendulum {
            direction: w.cross(n),
            turning_rad_s: -n.cross(&force_ned_m_s2) / self.length_m() - w * self.damping_per_s(gravity_m_s2),
        }
    }

    /// What a specific force of everything but the cable becomes, both body, m/s^2.
    pub(crate) fn act(
        &self,
        force_m_s2: Vector3<f64>,
        dcm: &Matrix3<f64>,
        pendulum: &Pendulum,
        per_mass: f64,
    ) -> Vector3<f64> {
        let mass_ratio = self.mass_kg * per_mass;
        let n = dcm * pendulum.direction;
        let centripetal_m_s2 = self.length_m() * pendulum.turning_rad_s.norm_squared();
        force_m_s2 + n * (mass_ratio / (1.0 + mass_ratio) * (centripetal_m_s2 - n.dot(&force_m_s2)))
    }

    /// The swings under a craft at places given every `period_s` (inertial, m). `beginning` is where the load is against the
    /// craft at first and how fast it moves there: north m, m/s, east m, m/s.
    ///
    /// Verlet's method with the cable as a constraint (Ryckaert, Ciccotti and Berendsen 1977): it needs the craft's places
    /// only, no derivative of them. Damping acts on the mean of the velocities before and after, and gravity is a little
    /// less than it is, so that a small swing takes its time to the last digit.
    pub fn driven(
        &self,
        places_m: &[Vector3<f64>],
        beginning: [f64; 4],
        period_s: f64,
        gravity_m_s2: f64,
    ) -> Vec<Pendulum> {
        let [swings] = self.driven_side_by_side([(places_m, beginning)], period_s, gravity_m_s2);
        swings
    }

    /// The same under several ways: each place of a load waits for the one before it, but not for the other ways.
    pub fn driven_side_by_side<const N: usize>(
        &self,
        ways: [(&[Vector3<f64>], [f64; 4]); N],
        period_s: f64,
        gravity_m_s2: f64,
    ) -> [Vec<Pendulum>; N] {
        let (h, length) = (period_s, self.length_m());
        let phase = self.stiffness_rad2_s2(gravity_m_s2).sqrt() * h;
        let fall = Vector3::new(0.0, 0.0, 2.0 * (1.0 - phase.cos()) * length);
        let damping = 0.5 * self.damping_per_s(gravity_m_s2) * h;
        let mut swinging =
            ways.map(|(places_m, [north, north_m_s, east, east_m_s])| {
                // The cable before and now; the craft went on as it goes on over a twentieth of a second.
                let reach = ((0.05 / h).round() as usize).clamp(1, places_m.len().saturating_sub(1).max(1));
                Swinging {
                    places_m,
                    before: self.hanging_at(north - h * north_m_s, east - h * east_m_s),
                    now: self.hanging_at(north, east),
                    way: places_m
                        .get(reach)
                        .map_or_else(Vector3::zeros, |p| (p - places_m[0]) / reach as f64),
                    cables: Vec::with_capacity(places_m.len()),
                }
            });
        let samples = ways.iter().map(|(places_m, _)| places_m.len()).max().unwrap_or(0);
        for k in 0..samples {
            swinging.iter_mut().for_each(|one| one.step(k, (length, damping, &fall)));
        }
        swinging.map(|Swinging { cables, .. }| {
            let turning = |k: usize| {
                let (from, to) = (k.saturating_sub(1), (k + 1).min(cables.len() - 1));
                let rate = (cables[to] - cables[from]) / ((to - from).max(1) as f64 * h);
                cables[k].cross(&rate) / (length * length)
            };
            let hanging = |k: usize| Pendulum { direction: cables[k] / length, turning_rad_s: turning(k) };
            (0..cables.len()).map(hanging).collect()
        })
    }

    /// The cable to a load that hangs so far north and east of the craft, m.
    fn hanging_at(&self, north: f64, east: f64) -> Vector3<f64> {
        let widest = WIDEST * self.length_m();
        let aside = Vector3::new(north, east, 0.0).cap_magnitude(widest);
        let down = (self.length_m().powi(2) - aside.norm_squared()).sqrt();
        Vector3::new(aside.x, aside.y, down)
    }

    /// What offset and velocity of a load that swings a little under a craft that stays where it is become after a time.
    pub fn free_motion(&self, time_s: f64, gravity_m_s2: f64) -> Matrix2<f64> {
        let (stiffness, damping) = (self.stiffness_rad2_s2(gravity_m_s2), self.damping_per_s(gravity_m_s2));
        (Matrix2::new(0.0, 1.0, -stiffness, -damping) * time_s).exp()
    }

    /// Offsets of a load that swings a little under a craft that stays where it is, from an offset of 1 m and from a
    /// velocity of 1 m/s, m.
    pub fn free(&self, samples: usize, period_s: f64, gravity_m_s2: f64) -> Vec<[f64; 2]> {
        let motion = self.free_motion(period_s, gravity_m_s2);
        let mut state = Matrix2::identity();
        std::iter::repeat_with(|| {
            let now = state;
            state = motion * state;
            [now[(0, 0)], now[(0, 1)]]
        })
        .take(samples)
        .collect()
    }
}

/// A load on its way under a craft.
struct Swinging<'a> {
    places_m: &'a [Vector3<f64>],
    /// From the craft to the load, a sample before, m.
    before: Vector3<f64>,
    now: Vector3<f64>,
    /// Of the craft in the last sample, m.
    way: Vector3<f64>,
    /// The cable at each sample until now.
    cables: Vec<Vector3<f64>>,
}

impl Swinging<'_> {
    /// From a sample to the next, if the way goes on so far.
    #[inline]
    fn step(&mut self, k: usize, (length, damping, fall): (f64, f64, &Vector3<f64>)) {
        if k >= self.places_m.len() {
            return;
        }
        self.cables.push(self.now);
        let Some(next_place) = self.places_m.get(k + 1) else { return };
        let next_way = next_place - self.places_m[k];
        // The load less the craft's next place, if the cable let it go.
        let pushed = (self.now - self.before) * (1.0 - damping) + self.way - next_way + fall;
        let free = self.now + pushed / (1.0 + damping);
        let next = on_cable(free, self.now, length);
        (self.before, self.now, self.way) = (self.now, next, next_way);
    }
}

/// Where a load ends that would be at `free`, drawn back along the cable as it was: the nearer place at the cable's length.
fn on_cable(free: Vector3<f64>, cable: Vector3<f64>, length_m: f64) -> Vector3<f64> {
    let (square, along) = (length_m * length_m, free.dot(&cable));
    let inside = along * along - square * (free.norm_squared() - square);
    if inside >= 0.0 && along > 0.0 {
        return free + cable * ((inside.sqrt() - along) / square);
    }
    // Further than a cable's length in one sample: no craft flies so, but a log may jump.
    match free.try_normalize(0.0) {
        Some(direction) => direction * length_m,
        None => cable,
    }
}
