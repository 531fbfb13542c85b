//! What the training flights decide about constants of single flights, and whether refined
//! coefficients are possible and better.

use model::Model;
use report::number::{percent, significant, with_unit};

use super::error::RefineError;
use super::problem::{Constants, Problem, Rows};
use crate::fit::doubts::impossible_signs;
use crate::fit::open_loop::{HorizonError, open_loop_without_trim, sum_of_horizons};
use crate::prepare::Prepared;

/// Training flights from which on they decide whether constants of single flights are estimated
/// along.
const FEWEST_TO_DECIDE: usize = 6;
/// Predictions that a half is judged by start at every so many samples: a tenth of their length, over which they say much the same.
const JUDGED_EVERY: usize = 5;
/// A quantity of held-out flights may grow by this much while the others fall, percent.
const TOLERATED_PERCENT: f64 = 1.0;

/// Decided by how well each half of the training flights is predicted with coefficients of the
/// other half.
pub(super) fn constants(model: &Model, train: &[&Prepared], rows: Rows) -> Result<Constants, RefineError> {
    if train.len() < FEWEST_TO_DECIDE {
        return Ok(Constants::Estimated);
    }
    // Every other one: files of one trajectory are often next to each other.
    let half = |odd: usize| -> Vec<&Prepared> { train.iter().skip(odd).step_by(2).copied().collect() };
    let halves = [half(0), half(1)];
    let mut ratio = 0.0;
    for (fitted, judge) in [(&halves[0], &halves[1]), (&halves[1], &halves[0])] {
        let error = |constants| -> Result<HorizonError, RefineError> {
            let refined = Problem::new(model, fitted, rows, constants)?.descend_roughly()?;
            Ok(sum_of_horizons(&open_loop_without_trim(&refined, judge, JUDGED_EVERY)))
        };
        let (left, estimated) = (error(Constants::Left)?, error(Constants::Estimated)?);
        let quantities: [fn(&HorizonError) -> f64; 4] =
            [|e| e.position_m, |e| e.velocity_m_s, |e| e.attitude_rad, |e| e.rate_rad_s];
        ratio += quantities.iter().map(|of| of(&left) / of(&estimated)).sum::<f64>() / 8.0;
    }
    Ok(if ratio < 1.0 { Constants::Left } else { Constants::Estimated })
}

/// Whether the refined coefficients are possible and better.
pub(super) fn judge(
    model: &Model,
    refined: &Model,
    before: &HorizonError,
    after: &HorizonError,
) -> (bool, String) {
    let known = impossible_signs(model);
    if let Some(doubt) = impossible_signs(refined).into_iter().find(|doubt| !known.contains(doubt)) {
        return (false, format!("refused: {doubt}"));
    }
    if let Some(what) = feeds_energy(model, refined) {
        return (false, format!("refused: {what}"));
    }
    let fall = |name, before: f64, after: f64| (name, 100.0 * (1.0 - after / before));
    let falls = [
        fall("position", before.position_m, after.position_m),
        fall("velocity", before.velocity_m_s, after.velocity_m_s),
        fall("attitude", before.attitude_rad, after.attitude_rad),
        fall("rate", before.rate_rad_s, after.rate_rad_s),
    ];
    let mean = falls.iter().map(|(_, fall)| fall).sum::<f64>() / 4.0;
    let listed: Vec<String> =
        falls.iter().map(|(name, fall)| format!("{name} {} %", percent(*fall))).collect();
    let listed = listed.join(", ");
    let worse = falls.iter().any(|(_, fall)| !(*fall > -TOLERATED_PERCENT));
    if worse || !(mean > 0.0) {
        return (false, format!("did not help: the open-loop error of held-out flights falls by {listed}"));
    }
    (true, format!("the open-loop error of held-out flights falls by {listed}"))
}

/// Damping or drag that brakes before and pushes after, as a sentence.
fn feeds_energy(model: &Model, refined: &Model) -> Option<String> {
    refined.terms.iter().filter(|t| t.effect.info().special.brakes).find_map(|term| {
        let was = &model.term(term.effect)?.coefficients;
        let pairs = term.coefficients.iter().zip(was).zip(term.effect.info().coefficients);
        pairs.into_iter().find_map(|((now, was), info)| {
            let slack = 2.0 * now.std_error.unwrap_or(0.0);
            (now.value > slack && was.value <= 0.0).then(|| {
                let value = with_unit(&significant(now.value, 4), info.unit_for(refined.rotor_quantity()));
                format!("{} = {value} would accelerate the craft", info.name)
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use model::{Effect, Vehicle};

    use super::*;

    const BEFORE: HorizonError =
        HorizonError { position_m: 1.0, velocity_m_s: 2.0, attitude_rad: 0.5, rate_rad_s: 3.0 };

    fn with_drag(x: f64) -> Model {
        let mut model = Model::new(Vehicle::thesis());
        model.set(Effect::LinearDrag, &[x, -0.2, -0.2]);
        model
    }

    fn judged(after: HorizonError) -> (bool, String) {
        judge(&with_drag(-0.2), &with_drag(-0.3), &BEFORE, &after)
    }

    #[test]
    fn falls_are_said_in_percent_of_what_was() {
        let after = HorizonError { position_m: 0.9, velocity_m_s: 1.5, attitude_rad: 0.5, rate_rad_s: 2.4 };
        let (kept, reason) = judged(after);
        assert!(kept, "{reason}");
        let expected = "falls by position 10.0 %, velocity 25.0 %, attitude 0.0 %, rate 20.0 %";
        assert!(reason.ends_with(expected), "{reason}");
    }

    #[test]
    fn one_quantity_may_grow_by_a_percent_and_no_more() {
        let grown =
            |factor: f64| HorizonError { position_m: 0.5, rate_rad_s: factor * BEFORE.rate_rad_s, ..BEFORE };
        assert!(judged(grown(1.005)).0);
        assert!(!judged(grown(1.02)).0);
    }

    #[test]
    fn an_error_that_is_no_number_is_no_help() {
        assert!(!judged(HorizonError { attitude_rad: f64::NAN, ..BEFORE }).0);
    }

    #[test]
    fn drag_that_comes_to_push_is_refused_however_well_it_predicts() {
        let after = HorizonError { position_m: 0.1, velocity_m_s: 0.1, attitude_rad: 0.1, rate_rad_s: 0.1 };
        let (kept, reason) = judge(&with_drag(-0.2), &with_drag(0.1), &BEFORE, &after);
        assert!(!kept && reason.starts_with("refused: "), "{reason}");
    }
}
