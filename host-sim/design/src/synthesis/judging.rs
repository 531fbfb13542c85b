//! What the steps of the design read off a loop: margins, the overshoot that its damping stands
//! for, its slowest pole.

use super::shortfall::unmet;
use crate::analysis::{Band, Margins, least_damped_seen};
use crate::error::{Criterion, DesignError, Result};
use crate::loops::{ClosedLoop, LoopName};
use crate::plant::StateSpace;

/// Margins of a stable loop, on a coarse grid.
pub(super) fn at_error(closed: &ClosedLoop) -> Result<Margins> {
    let sweep = closed.at_error.sweep(0, 0)?;
    Ok(Margins::of(|w| sweep.response(w), Band::coarse(closed.closed.period_s), true))
}

/// Overshoot by the least damping that a step shows, per cent; absent: the loop is unstable.
pub(super) fn seen_overshoot(closed: &ClosedLoop) -> Result<Option<f64>> {
    if !closed.closed.is_stable()? {
        return Ok(None);
    }
    let mode = least_damped_seen(&closed.closed)?;
    Ok(Some(mode.map_or(0.0, |m| damping_overshoot(m.damping))))
}

/// Overshoot of a second-order system of this damping ratio, per cent: what a root locus shows.
fn damping_overshoot(damping: f64) -> f64 {
    if damping <= 0.0 {
        return 100.0;
    }
    if damping >= 1.0 {
        return 0.0;
    }
    100.0 * (-std::f64::consts::PI * damping / (1.0 - damping * damping).sqrt()).exp()
}

/// Real part of the slowest pole that a velocity gain moves. The channel's own integrator stays at
/// the origin, or close to it where something weak holds the variable (ground effect, a tilted
/// hover): that pole is the proportional gain's to move.
pub(super) fn slowest_moved(velocity_loop: &StateSpace) -> Result<f64> {
    const AT_ORIGIN_RAD_S: f64 = 0.1;
    let mut poles = velocity_loop.poles()?;
    let nearest = (0..poles.len()).min_by(|&i, &j| poles[i].norm().total_cmp(&poles[j].norm()));
    if let Some(nearest) = nearest
        && poles[nearest].norm() < AT_ORIGIN_RAD_S
        && poles[nearest].im == 0.0
    {
        poles.swap_remove(nearest);
    }
    // Two at the origin come out of the eigenvalues a rounding apart, as a pair.
    Ok(poles.iter().filter(|p| p.norm() > 1e-6).map(|p| p.re).fold(f64::NEG_INFINITY, f64::max))
}

/// A loop that no gain makes stable: how fast its worst mode grows at best, 1/s.
pub(super) fn unstable(name: LoopName, what: Criterion, growth: Option<f64>) -> DesignError {
    DesignError::Unmet(unmet(name, what, 0.0, growth.unwrap_or(f64::NAN)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form of a second-order step: a damping of 0.5 overshoots by 16.3 %, one of 0.3 by
    /// 37.2 %.
    #[test]
    fn overshoot_follows_the_damping() {
        assert!((damping_overshoot(0.5) - 16.303).abs() < 1e-3);
        assert!((damping_overshoot(0.3) - 37.233).abs() < 1e-3);
        assert_eq!((damping_overshoot(1.0), damping_overshoot(-0.1)), (0.0, 100.0));
    }

    /// The integrator of the channel is not what a velocity gain moves; a pole of its own at -0.2
    /// is.
    #[test]
    fn the_pole_at_the_origin_is_left_to_the_proportional_gain() {
        let system = StateSpace::transfer(&[1.0], &[1.0, 3.2, 0.6, 0.0], None);
        // s (s + 0.2) (s + 3).
        assert!((slowest_moved(&system).unwrap() + 0.2).abs() < 1e-12);
        let away = StateSpace::transfer(&[1.0], &[1.0, 3.2, 0.6], None);
        assert!((slowest_moved(&away).unwrap() + 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_stabilised_says_how_fast_it_grows() {
        let error = unstable(LoopName::Roll, Criterion::VelocityLoopGrowth, Some(1.5)).to_string();
        assert_eq!(
            error,
            "roll: growth of the velocity loop's worst mode, 1/s: wanted 0, reached 1.5 at best"
        );
    }
}
