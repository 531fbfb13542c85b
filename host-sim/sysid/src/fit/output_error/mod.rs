//! Output-error refinement: coefficients that predict half a second, not the next sample alone.
//!
//! Least squares on accelerations (equation error) is quick and sure, and biased where the rows'
//! signals are: a rate that an estimator has smoothed, a moment that the controller answers within
//! a few samples. Here the model flies open loop from logged states over [`LONGEST_HORIZON`]
//! samples, and the coefficients are moved until the predicted states meet the logged ones (Gauss
//! and Newton's method with Levenberg and Marquardt's damping, from the least-squares start). Only
//! the moment rows are moved unless asked: forces from an accelerometer are better seen sample by
//! sample than through an integral of them.
//!
//! **Loss.** For position, velocity, attitude (rotation vector) and rate at every `HORIZON_STEP`th
//! horizon the norm of the error over its mean at the start of the descent; so all four quantities
//! weigh the same and so does every horizon. A norm, not its square: it is what `sum_1_50` of a
//! comparison reports, and a stretch in which the model is lost (a collision, a gust) does not
//! decide the fit. Towards zero the norm turns into a square (`ROUNDED`); each step solves the
//! reweighted least squares.
//!
//! **What stays.** Inertia ratios and gyroscopic torque are products of rates, which half a second
//! averages away, and `rotor-inertia` acts within samples: least squares on accelerations sees them
//! better, and so they keep its values. Every coefficient stays within its physically possible
//! range.
//!
//! **Nuisance.** Each training flight has a constant moment of its own (trim, a battery's seat).
//! Estimated along and forgotten, the coefficients come nearer to the craft's; left in, they come
//! nearer to what predicts a flight whose constants nobody knows. Which of the two is better for
//! flights that were not fitted depends on the flights, and is decided by them: half of the
//! training flights are refined either way and the other half is predicted, and the other way
//! round. With fewer than `FEWEST_TO_DECIDE` flights the constants are estimated.
//!
//! **Standard errors.** Errors along a rollout are one error seen fifty times, and the smoother
//! spreads noise from one rollout to the next: the formula for white noise would be far too
//! optimistic. They are the jackknife's over blocks of `BLOCK_S`, longer than both (the sandwich of
//! scores with each block's leverage taken out); over whole flights where their constants are left
//! in.
//!
//! **What is refused.** Coefficients of impossible sign, drag or damping that feeds energy in where
//! it did not before, and anything that does not lower the open-loop error of held-out flights.
//!
//! [`LONGEST_HORIZON`]: crate::fit::open_loop::LONGEST_HORIZON

mod decision;
mod descent;
mod error;
mod problem;
mod rollouts;

pub use error::RefineError;
pub use problem::Rows;

use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::open_loop::{HorizonError, open_loop, sum_of_horizons};
use crate::fit::rotation::has_rotation;
use crate::prepare::Prepared;

use decision::{constants, judge};
use problem::Problem;

/// What a refinement came to.
#[derive(Debug, Clone)]
pub struct Refinement {
    /// The refined model; the one given when the refinement was refused.
    pub model: Model,
    /// Figures for people and files.
    pub outcome: RefinementOutcome,
}

/// Whether it helped, and by how much on held-out flights.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RefinementOutcome {
    /// Which coefficients were moved.
    pub rows: Rows,
    /// Whether the refined coefficients were kept.
    pub kept: bool,
    /// Why, one sentence.
    pub reason: String,
    /// Open-loop error of the held-out flights, summed over horizons of 1 to 50 samples, before.
    pub before: HorizonError,
    /// And with the refined coefficients.
    pub after: HorizonError,
    /// Steps taken.
    pub steps: usize,
}

/// Refines the linear coefficients of `model` on training flights and judges the result on held-out
/// ones.
pub fn refine(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    rows: Rows,
) -> Result<Refinement, RefineError> {
    let (refined, steps) = descend(model, train, rows)?;
    let before = sum_of_horizons(&open_loop(model, validate));
    let after = sum_of_horizons(&open_loop(&refined, validate));
    let (kept, reason) = judge(model, &refined, &before, &after);
    let model = if kept { refined } else { model.clone() };
    Ok(Refinement { model, outcome: RefinementOutcome { rows, kept, reason, before, after, steps } })
}

/// The refined coefficients whatever they are, with standard errors.
pub fn refined(model: &Model, train: &[&Prepared], rows: Rows) -> Result<Model, RefineError> {
    Ok(descend(model, train, rows)?.0)
}

fn descend(model: &Model, train: &[&Prepared], rows: Rows) -> Result<(Model, usize), RefineError> {
    if !has_rotation(model) {
        return Err(RefineError::NoRotation);
    }
    let constants = constants(model, train, rows)?;
    Problem::new(model, train, rows, constants)?.descend()
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn flown(model: &Model, seed: u64) -> Prepared {
        Prepared::new(&fly(model, seed, 6.0, &NONE), &model.vehicle).unwrap()
    }

    /// The craft with other dampings of its rates.
    fn damped(values: [f64; 3]) -> Model {
        let mut model = truth();
        model.set(Effect::AngularDamping, &values);
        model
    }

    #[test]
    fn dampings_that_were_wrong_come_back_and_forces_stay() {
        let wrong = damped([-2.0, -2.0, -1.5]);
        let [train, other] = [1, 2].map(|seed| flown(&truth(), seed));
        let Refinement { model, outcome } = refine(&wrong, &[&train], &[&other], Rows::Moments).unwrap();
        assert!(outcome.kept && outcome.steps > 0, "{outcome:?}");
        assert!(outcome.after.rate_rad_s < 0.5 * outcome.before.rate_rad_s, "{outcome:?}");
        let [right, before, after] =
            [&truth(), &wrong, &model].map(|of| of.term(Effect::AngularDamping).unwrap().values());
        for axis in 0..3 {
            let off = |values: &[f64]| (values[axis] - right[axis]).abs();
            // Six seconds tell dampings and motors apart this well.
            assert!(off(&after) < 0.05 * off(&before), "{axis}: {after:?}");
        }
        for effect in [Effect::Thrust, Effect::LinearDrag, Effect::InertiaCoupling, Effect::Gyroscopic] {
            assert_eq!(model.term(effect), wrong.term(effect));
        }
    }

    /// Trained on a craft that another one flies beside: held out is what the model was right about.
    #[test]
    fn what_makes_held_out_flights_worse_is_refused_and_the_model_stays() {
        let model = truth();
        let (train, held_out) = (flown(&damped([-4.0, -4.0, -3.0]), 1), flown(&model, 2));
        let refinement = refine(&model, &[&train], &[&held_out], Rows::Moments).unwrap();
        assert_eq!(refinement.model, model);
        let RefinementOutcome { kept, reason, before, after, .. } = refinement.outcome;
        assert!(!kept && reason.starts_with("did not help"), "{reason}");
        assert!(after.rate_rad_s > before.rate_rad_s, "{before:?} {after:?}");
    }

    #[test]
    fn a_model_of_forces_alone_is_not_refined() {
        let mut model = truth();
        let flight = flown(&model, 1);
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        for rows in [Rows::Moments, Rows::All] {
            assert_eq!(refined(&model, &[&flight], rows), Err(RefineError::NoRotation));
        }
        assert_eq!(refined(&truth(), &[], Rows::Moments), Err(RefineError::TooShort));
    }
}
