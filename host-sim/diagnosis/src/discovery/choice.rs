//! The simplest of the forms that are worth about the same, and its rivals.

use crate::discovery::form::Form;
use crate::discovery::refine::Refined;
use crate::discovery::variables::Variable;

/// A form is worth about as much as the best where it takes this part of what that takes of flights left out, ...
const ABOUT_AS_MUCH: f64 = 0.97;
/// ... or so many variances of the noise less.
const FEW_VARIANCES: f64 = 6.0;
/// A rival takes this part of what the chosen form takes.
const RIVAL: f64 = 0.85;

/// How complicated a form is: numbers to fit, and quantities beyond the first.
fn complexity(form: &Form, variables: &[Variable]) -> usize {
    form.count(variables) + form.factors.len() - 1
}

/// The forms in the order in which they are to be proposed: first those that are worth about as much as the best on flights left out,
/// the simplest of them first, then the others. Those that are worth nothing there are left out.
pub(crate) fn ranked<'a>(refined: &'a [Refined], variables: &[Variable]) -> Vec<&'a Refined> {
    let mut helping: Vec<&Refined> =
        refined.iter().filter(|one| one.gain_left_out > 0.0 && one.improved > 0).collect();
    let best = helping.iter().map(|one| one.gain_left_out).fold(f64::NEG_INFINITY, f64::max);
    let enough = (ABOUT_AS_MUCH * best).min(best - FEW_VARIANCES);
    helping.sort_by(|one, other| {
        let rank = |one: &Refined| {
            if one.gain_left_out >= enough { complexity(&one.form, variables) } else { usize::MAX }
        };
        rank(one).cmp(&rank(other)).then(other.gain_left_out.total_cmp(&one.gain_left_out))
    });
    helping
}

/// Forms over other quantities that take about as much: these flights do not tell them apart.
pub(crate) fn rivals<'a>(
    refined: &'a [Refined],
    chosen: &Refined,
    variables: &[Variable],
) -> Vec<&'a Refined> {
    let mut found: Vec<&Refined> = Vec::new();
    let own = quantities(&chosen.form, variables);
    for one in refined {
        let theirs = quantities(&one.form, variables);
        // A further factor of the same form is no rival of it.
        let contains = own.iter().all(|name| theirs.contains(name));
        let is_new = !found.iter().any(|other| quantities(&other.form, variables) == theirs);
        if !contains && is_new && one.gain_left_out >= RIVAL * chosen.gain_left_out {
            found.push(one);
        }
    }
    found
}

/// The quantities that a form depends on, those of its way to act among them, sorted.
pub(crate) fn quantities(form: &Form, variables: &[Variable]) -> Vec<&'static str> {
    let of_shapes = form.variables().into_iter().flat_map(|index| variables[index].quantities());
    let mut all: Vec<&'static str> = form.channel.quantities().iter().copied().chain(of_shapes).collect();
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use model::Axis;

    use super::*;
    use crate::discovery::channels::Channel;
    use crate::discovery::form::Factor;
    use crate::discovery::shapes::{Family, Shape, Span};

    fn refined(families: &[(usize, Family)], gain_left_out: f64) -> Refined {
        let factor = |(variable, family): &(usize, Family)| Factor {
            variable: *variable,
            shape: Shape { family: *family, parameters: [0.5, 0.5] },
        };
        Refined {
            form: Form { channel: Channel::Body(Axis::W), factors: families.iter().map(factor).collect() },
            amplitudes: vec![1.0],
            gain_left_out,
            improved: 3,
        }
    }

    #[test]
    fn the_simplest_of_those_that_are_worth_about_the_same_is_chosen() {
        let bump = refined(&[(0, Family::Bump)], 1000.0);
        let product = refined(&[(0, Family::Proportional), (1, Family::Proportional)], 1004.0);
        let straight = refined(&[(0, Family::Proportional)], 990.0);
        let worse = refined(&[(1, Family::Proportional)], 900.0);
        let all = [bump.clone(), product, straight.clone(), worse.clone()];
        let span = Span { low: 0.0, high: 1.0 };
        let variables = ["north", "east"].map(|name| Variable::made_up(name, "m", span));
        assert_eq!(ranked(&all, &variables)[0].form, straight.form);
        assert_eq!(ranked(&[bump.clone(), worse], &variables)[0].form, bump.form);
    }

    #[test]
    fn what_helps_no_other_flight_is_not_chosen() {
        let north = [Variable::made_up("north", "m", Span { low: 0.0, high: 1.0 })];
        assert!(ranked(&[refined(&[(0, Family::Bump)], -3.0)], &north).is_empty());
        assert!(ranked(&[], &north).is_empty());
    }
}
