//! The model was good once: what has changed since?
//!
//! The model's parameters stay; the residual of new flights is explained by one change at a time: a heavier craft, a weak
//! motor, a wind, a shifted battery (`change_fit.rs`), and what adds to the best of them (`change_rivals.rs`). The same standard of evidence as in [`diagnose`](crate::diagnose): each change is
//! estimated on all new flights but one and validated on that one (blocks of time where there is a single flight).
//!
//! A real craft differs a little from flight to flight (trim, battery seat, tracker calibration). How much, is known
//! from the flights the model was made from: the model file holds how far each change's estimate scatters between them.
//! A change must stand out from that scatter, not only from the noise. What no change accounts for is looked for by the errors of
//! those flights, too (`change_structure.rs`).

use model::Model;

use crate::balance;
use crate::change::Change;
use crate::change_conclusion::{OfRows, conclude};
use crate::change_examined::examine;
use crate::change_model_error::widen;
use crate::change_rivals::mark_rivals;
use crate::change_structure::structure_left;
use crate::change_together::Together;
use crate::criteria::rank_of_change;
use crate::dependence::Dependence;
use crate::finding::{Diagnosis, EffectFinding, Unexplained};
use crate::observer::Observer;
use crate::onset::onset;
use crate::reason::Reason;
use crate::search_error::{SearchError, Steps};
use sysid::FitError;
use sysid::prepare::Prepared;

/// Names those of `changes` that explain new flights, with the model's parameters as they are.
pub fn changed(
    model: &Model,
    changes: &[Change],
    flights: &[&Prepared],
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    if flights.is_empty() {
        return Err(FitError::NoFlights.into());
    }
    let mut findings: Vec<(Change, EffectFinding)> = Vec::new();
    let mut steps = Steps::new(observer, changes.len());
    for &change in changes {
        steps.next(&format!("trying {change}"))?;
        findings.push((change, examine(model, change, flights, changes.len()).finding));
    }
    let score = |f: &EffectFinding| rank_of_change(f.gain, f.coefficients.len());
    findings.sort_by(|a, b| b.1.supported.cmp(&a.1.supported).then(score(&b.1).total_cmp(&score(&a.1))));
    let mut together = mark_rivals(model, &mut findings, flights, (changes, observer))?;
    let mut left = structure_left(together.as_ref().map_or(model, |with| &with.model), flights);
    let named = findings.iter_mut().map(|(_, finding)| finding).find(|finding| finding.supported);
    let refused = named.and_then(|finding| stands_in(finding, &left).map(|why| (finding, why)));
    if let Some((finding, why)) = refused {
        finding.refuse(why);
        together = None;
        left = structure_left(model, flights);
    }
    for (change, finding) in findings.iter_mut().filter(|(_, finding)| finding.supported) {
        widen(model, *change, finding, flights);
    }
    let together = together.unwrap_or_else(|| Together::none(model));
    let others = together.without_best(model, flights);
    let named = findings.iter().find(|(_, finding)| finding.supported);
    let began = named.and_then(|(change, finding)| onset(&others, (*change, finding), flights));
    let Together { changes: happened, model: with, revealed, .. } = together;
    let rows = OfRows { findings, began, happened, with, revealed, left };
    Ok(conclude(model, rows, balance::answer(model, flights, changes)))
}

/// Why the best change is none: bursts are left of an axis that are more of its error than the change takes away anywhere. Another
/// craft overhead presses this one down again and again, and drags a little air along all the time.
fn stands_in(finding: &EffectFinding, left: &[Unexplained]) -> Option<Reason> {
    let takes_percent = finding.largest_drop_percent();
    let of_whole = |u: &Unexplained| {
        let taken_percent = finding.axes.get(u.axis.name()).map_or(0.0, |axis| axis.drop_percent);
        u.share_percent * (1.0 - 0.01 * taken_percent)
    };
    let bursts = left.iter().find(|u| u.depends_on == Dependence::Bursts && of_whole(u) > takes_percent)?;
    let Unexplained { axis, depends_on, share_percent: left_percent, .. } = *bursts;
    Some(Reason::LeavesMore { takes_percent, left_percent, axis, depends_on })
}

#[cfg(test)]
mod tests {
    use model::{Axis, Effect};

    use super::*;
    use crate::finding::AxisDrop;
    use crate::observer::Silent;
    use crate::testing::truth;

    fn finding(effect: Effect, motor: Option<u8>, gain: f64) -> (Change, EffectFinding) {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        (finding.gain, finding.p_value) = (gain, 0.0);
        (Change { effect, motor }, finding)
    }

    #[test]
    fn no_flight_tells_of_no_change() {
        assert_eq!(changed(&truth(), &[], &[], &Silent).err(), Some(FitError::NoFlights.into()));
    }

    /// Bursts that are 90 % of p are more than a wind takes of u, unless that is more: and what is left of u counts as the part of all of it.
    #[test]
    fn bursts_beyond_what_a_change_takes_refuse_it() {
        let burst = |axis, share_percent| Unexplained {
            axis,
            depends_on: Dependence::Bursts,
            share_percent,
            p_value: 0.0,
        };
        let wind = |percent: f64| {
            let mut wind = finding(Effect::SteadyWind, None, 1.0).1;
            wind.axes.insert("u", AxisDrop::new(100.0, 100.0 - percent));
            wind
        };
        assert!(stands_in(&wind(20.0), &[burst(Axis::P, 90.0)]).is_some());
        assert!(stands_in(&wind(95.0), &[burst(Axis::P, 90.0)]).is_none());
        assert!(stands_in(&wind(60.0), &[burst(Axis::U, 90.0)]).is_none());
        let slow = Unexplained { depends_on: Dependence::SlowChanges, ..burst(Axis::P, 90.0) };
        assert!(stands_in(&wind(20.0), &[slow]).is_none());
    }
}
