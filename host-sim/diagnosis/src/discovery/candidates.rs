//! From what a model leaves to the few forms that are worth fitting exactly.

use model::Model;
use rayon::prelude::*;
use sysid::prepare::Prepared;

use crate::discovery::against::Against;
use crate::discovery::center::{Center, Flown};
use crate::discovery::channels::Channel;
use crate::discovery::chosen::Grid;
use crate::discovery::form::Form;
use crate::discovery::hats::{Bases, InRoom, Quantities};
use crate::discovery::phases::{chance_of, of_random_phases};
use crate::discovery::problem::Problem;
use crate::discovery::refine::{Refined, refine};
use crate::discovery::search::{Found, Scored, cost, over_variable};
use crate::discovery::shapes::Family;
use crate::discovery::variables::Variable;
use crate::observer::{Observer, Progress};

/// Chance of a search's result in residuals of random phases below which it counts.
const SIGNIFICANT: f64 = 0.01;
/// Residuals of random phases.
const RANDOM_PHASES: usize = 30;
/// Seed of their phases.
const SEED: u64 = 18;
/// Knots over a variable.
const KNOTS: usize = 17;
/// Knots over time: what happens once is short in a long flight.
const KNOTS_OF_TIME: usize = 33;
/// Forms of one shape that a second shape is tried with.
const BASES: usize = 6;
/// Forms of one shape, and of two, that are fitted exactly, ...
const REFINED: usize = 8;
/// ... where they take this part of what the best one of as many shapes takes.
const WORTHWHILE: f64 = 0.5;
/// Variables between two words of progress.
const SIDE_BY_SIDE: usize = 8;
/// Forms that are tried over relatives of their variables, ...
const TUNED: usize = 3;
/// ... besides any simpler one that is worth this part of the best: what it lacks may be a finer bearing, where others bend a second
/// shape for it.
const SIMPLER: f64 = 0.9;
/// Nearest relatives of a variable that a form is tried over, ...
const NEAREST: usize = 2;
/// ... so many times from where it got.
const STEPS_AMONG_RELATIVES: usize = 4;

/// What a search of all forms finds.
#[derive(Debug)]
pub(crate) struct Candidates {
    /// Forms fitted exactly, best first by flights left out; none where chance finds as much.
    pub(crate) refined: Vec<Refined>,
    /// Chance that a search of residuals of random phases finds one of such worth.
    pub(crate) p_value: f64,
}

impl Candidates {
    /// Whether the search found more than chance does.
    pub(crate) fn are_significant(&self) -> bool {
        self.p_value < SIGNIFICANT
    }
}

/// Searches all forms on training flights.
pub(crate) fn candidates(
    flights: &[&Prepared],
    model: &Model,
    variables: &[Variable],
    observer: &dyn Observer,
) -> Candidates {
    let problem = Problem::new(flights, model);
    let others = of_random_phases(&problem, RANDOM_PHASES, SEED);
    let against = Against::new(&problem, &others);
    let bases: Vec<Form> =
        Channel::all(model).into_iter().map(|channel| Form { channel, factors: Vec::new() }).collect();
    let quantities = Quantities::new(&problem, variables);
    let search = Search { problem: &problem, variables, quantities: &quantities, observer };
    let every: Vec<usize> = (0..variables.len()).filter(|index| variables[*index].is_searched()).collect();
    // A second shape of what is remembered would look back at more than there is room for.
    let present: Vec<usize> =
        every.iter().copied().filter(|index| variables[*index].lag_s().is_none()).collect();
    let steps = every.len() + present.len() + 1;
    let mut found: Vec<Scored> = Vec::new();
    let mut by_chance = vec![f64::NEG_INFINITY; RANDOM_PHASES];
    let over_all = search.over(&every, (&against, bases), knots_of, [0, steps]);
    for one in over_all.into_iter().chain(search.about_centers(&against, [every.len(), steps])) {
        found.extend(one.best);
        by_chance.iter_mut().zip(one.by_chance).for_each(|(most, one)| *most = most.max(one));
    }
    sort(&mut found, problem.rows);
    let p_value = found.first().map_or(1.0, |best| chance_of(best.worth(problem.rows), &by_chance));
    let without_forms = Candidates { refined: Vec::new(), p_value };
    if !without_forms.are_significant() {
        return without_forms;
    }
    let mut forms: Vec<Form> = worthwhile(&found);
    let bases: Vec<Form> = distinct(&found, BASES).into_iter().map(|scored| scored.form).collect();
    forms.extend(wider(&forms));
    let only = Against::new(&problem, &[]);
    let mut products: Vec<Scored> = Vec::new();
    for one in search.over(&present, (&only, bases), |_| KNOTS, [every.len() + 1, steps]) {
        let is_product = |scored: &Scored| scored.form.variables().len() == scored.form.factors.len();
        products.extend(one.best.into_iter().filter(is_product));
    }
    sort(&mut products, problem.rows);
    forms.extend(worthwhile(&products));
    let mut refined: Vec<Refined> =
        forms.par_iter().filter_map(|form| refine(&problem, form, variables)).collect();
    let worth = |one: &Refined| one.gain_left_out - cost(one.form.count(variables), problem.rows);
    let best_first = |one: &Refined, other: &Refined| worth(other).total_cmp(&worth(one));
    refined.sort_by(best_first);
    let tuned = to_be_tuned(&refined, variables);
    let wanted = refined.par_iter_mut().zip(tuned).filter(|(_, is_tuned)| *is_tuned);
    wanted.for_each(|(one, _)| tune(&problem, one, variables));
    refined.sort_by(best_first);
    Candidates { refined, p_value }
}

/// Where forms are tried.
struct Search<'a> {
    problem: &'a Problem<'a>,
    variables: &'a [Variable],
    quantities: &'a Quantities,
    observer: &'a dyn Observer,
}

impl Search<'_> {
    /// What forces about centers find over the distance from these, side by side, as one step.
    fn about_centers(&self, against: &Against, [step, steps]: [usize; 2]) -> Vec<Found> {
        self.observer.progress(Progress { activity: "trying forms", steps: Some((step, steps)) });
        let in_room = InRoom::new(self.problem);
        let about = |alike: &[Center]| {
            let [center, ..] = alike else { return None };
            let distance = Variable::distance_from(self.variables, *center)?;
            let span = self.variables[distance].flown().distances(*center);
            let bases = [Bases::about((self.problem, in_room.as_ref()), alike, self.variables)];
            let quantities = Quantities::from_center(in_room.as_ref(), *center, distance);
            let over = (self.variables, distance);
            Some(over_variable(self.problem, against, (&bases, &quantities), over, (span, KNOTS)))
        };
        let flown = self.variables.iter().find(|variable| variable.is_distance()).map(Variable::flown);
        let centers = flown.map(Flown::centers).unwrap_or_default();
        let alike = |one: &Center, other: &Center| one.shares_distance(*other);
        let groups: Vec<&[Center]> = centers.chunk_by(alike).collect();
        groups.into_par_iter().filter_map(about).collect()
    }

    /// What bases find over some variables, side by side, in the order of these; this is the `first`th step of so many.
    fn over(
        &self,
        indices: &[usize],
        (against, bases): (&Against, Vec<Form>),
        knots: impl Fn(&Variable) -> usize + Sync,
        [first, steps]: [usize; 2],
    ) -> Vec<Found> {
        let mut all = Vec::with_capacity(indices.len());
        let (of_each_rotor, others): (Vec<Form>, Vec<Form>) =
            bases.into_iter().partition(|form| form.channel.is_each_rotor());
        let bases = [others, of_each_rotor].map(|forms| Bases::new(self.problem, forms, self.variables));
        for some in indices.chunks(SIDE_BY_SIDE) {
            let progress = Progress { activity: "trying forms", steps: Some((first + all.len(), steps)) };
            self.observer.progress(progress);
            let over = |index: &usize| {
                let over = (self.variables, *index);
                let knots = knots(&self.variables[*index]);
                let hats = (self.variables[*index].span, knots);
                over_variable(self.problem, against, (&bases, self.quantities), over, hats)
            };
            all.par_extend(some.par_iter().map(over));
        }
        all
    }
}

/// Which of the forms, best first, are tried over relatives of their variables.
fn to_be_tuned(refined: &[Refined], variables: &[Variable]) -> Vec<bool> {
    let best = refined.first().map_or(0.0, |best| best.gain_left_out);
    let mut simplest = usize::MAX;
    let is_tuned = |(place, one): (usize, &Refined)| {
        let numbers = one.form.count(variables);
        let is_simpler = numbers < simplest && one.gain_left_out >= SIMPLER * best;
        simplest = simplest.min(numbers);
        place < TUNED || is_simpler
    };
    refined.iter().enumerate().map(is_tuned).collect()
}

/// Goes over to relatives of the variables of a form as long as it is worth more with them, the rough ones first.
fn tune(problem: &Problem<'_>, best: &mut Refined, variables: &[Variable]) {
    for grid in [Grid::Rough, Grid::Fine] {
        for factor in 0..best.form.factors.len() {
            // On the way to where it gets, each is tried once.
            let mut tried = vec![best.form.factors[factor].variable];
            for _ in 0..STEPS_AMONG_RELATIVES {
                let own = &variables[best.form.factors[factor].variable];
                let mut near = own.relatives(variables, grid);
                near.truncate(NEAREST);
                near.retain(|relative| !tried.contains(relative));
                tried.extend(&near);
                let Some(better) = best_relative(problem, best, (factor, variables), near) else { break };
                *best = better;
            }
        }
    }
}

/// A form with one of some relatives of the variable of a factor, if it is worth more with that.
fn best_relative(
    problem: &Problem<'_>,
    best: &Refined,
    (factor, variables): (usize, &[Variable]),
    relatives: Vec<usize>,
) -> Option<Refined> {
    let with = |variable: usize| {
        let mut form = best.form.clone();
        form.factors[factor].variable = variable;
        refine(problem, &form, variables)
    };
    let refined = relatives.into_iter().filter_map(with);
    let better = refined.max_by(|one, other| one.gain_left_out.total_cmp(&other.gain_left_out))?;
    (better.gain_left_out > best.gain_left_out).then_some(better)
}

/// The best form with a way to act that has a wider one, with that. Waves along two directions seldom have their crests together: two
/// terms have crests of their own.
fn wider(forms: &[Form]) -> Option<Form> {
    let is_wave = |form: &Form| form.factors.iter().any(|factor| factor.shape.family == Family::Wave);
    let mut others = forms.iter().filter(|form| !is_wave(form));
    others.find_map(|form| Some(Form { channel: form.channel.wider()?, ..form.clone() }))
}

fn knots_of(variable: &Variable) -> usize {
    if variable.name == model::user_effects::TIME_COLUMN { KNOTS_OF_TIME } else { KNOTS }
}

fn sort(found: &mut [Scored], rows: usize) {
    found.sort_by(|one, other| other.worth(rows).total_cmp(&one.worth(rows)));
}

/// The forms that are fitted exactly.
fn worthwhile(found: &[Scored]) -> Vec<Form> {
    let enough = found.first().map_or(0.0, |best| WORTHWHILE * best.gain);
    let kept = distinct(found, REFINED).into_iter().filter(|scored| scored.gain >= enough);
    kept.map(|scored| scored.form).collect()
}

/// The best: of each way to act three at most, two of them over the same variables.
fn distinct(found: &[Scored], most: usize) -> Vec<Scored> {
    let mut kept: Vec<Scored> = Vec::new();
    for one in found {
        let alike = kept.iter().filter(|other| other.form.channel.is_like(one.form.channel));
        let same = alike.clone().filter(|other| other.form.variables() == one.form.variables());
        if alike.count() < 3 && same.count() < 2 {
            kept.push(one.clone());
        }
        if kept.len() == most {
            break;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use model::{Axis, Effect};

    use super::*;
    use crate::discovery::form::Factor;
    use crate::discovery::shapes::{Shape, Span};
    use crate::observer::Silent;
    use crate::testing::{ORDINARY, prepared, truth};

    fn form(channel: Channel, families: &[(usize, Family)]) -> Form {
        let factor = |(variable, family): &(usize, Family)| Factor {
            variable: *variable,
            shape: Shape { family: *family, parameters: [0.5; 2] },
        };
        Form { channel, factors: families.iter().map(factor).collect() }
    }

    fn scored(axis: Axis, variable: usize, gain: f64) -> Scored {
        Scored { form: form(Channel::Body(axis), &[(variable, Family::Square)]), count: 2, gain }
    }

    /// Along w: 100, 99 and 98 over one variable, of which the third is one too many, 97 over another, and a fourth, 96, which is one too
    /// many of its way to act. About p, 40 is less than half of the best.
    #[test]
    fn few_forms_of_each_way_to_act_are_fitted() {
        let along_w = [(0, 100.0), (0, 99.0), (0, 98.0), (1, 97.0), (2, 96.0)];
        let mut found: Vec<Scored> = along_w.map(|(variable, gain)| scored(Axis::W, variable, gain)).into();
        found.extend([(Axis::Q, 50.0), (Axis::P, 40.0)].map(|(axis, gain)| scored(axis, 0, gain)));
        let gains = |kept: Vec<Scored>| kept.iter().map(|one| one.gain).collect::<Vec<f64>>();
        assert_eq!(gains(distinct(&found, 8)), [100.0, 99.0, 97.0, 50.0, 40.0]);
        assert_eq!(gains(distinct(&found, 2)), [100.0, 99.0]);
        let fitted = worthwhile(&found);
        assert_eq!((fitted.len(), fitted[3].channel), (4, Channel::Body(Axis::Q)));
    }

    /// With its amplitude, a square has 1 number, a hinge 2, and each of the others 3. Behind the first three, the square is simpler
    /// than all before it; with less than 0.9 of the best gain it is not worth it.
    #[test]
    fn the_best_three_and_simpler_ones_that_gain_about_as_much_are_tuned() {
        let variables = [Variable::made_up("height", "m", Span { low: 0.0, high: 1.0 })];
        let tuned = |gain_of_square: f64| {
            let refined = |(family, gain_left_out)| Refined {
                form: form(Channel::Body(Axis::W), &[(0, family)]),
                amplitudes: vec![1.0],
                gain_left_out,
                improved: 2,
            };
            let last = [(Family::Square, gain_of_square), (Family::Cube, gain_of_square)];
            let all = [
                (Family::Bump, 100.0),
                (Family::Wave, 99.0),
                (Family::HingeAbove, 98.0),
                (Family::Step, 97.0),
            ];
            to_be_tuned(&all.into_iter().chain(last).map(refined).collect::<Vec<_>>(), &variables)
        };
        assert_eq!(tuned(91.0), [true, true, true, false, true, false]);
        assert_eq!(tuned(89.0), [true, true, true, false, false, false]);
    }

    /// A spring of 0.8 N/m pulls to the place of take-off along north: what it takes, in variances of the noise, says how well it is known.
    /// In the same flights without it, there is no form.
    #[test]
    fn a_spring_along_north_is_found_and_nothing_where_there_is_none() {
        let text = "[[effect]]\nid = \"spring\"\nacceleration.north = \"k * north / mass\"\n\
                    coefficient = [{ name = \"k\", unit = \"N/m\", possible = [-9.0, 9.0], typical = 1.0 }]\n";
        let [spring] = model::effects::draft(text, Path::new("test")).unwrap()[..] else {
            panic!("one effect")
        };
        let mut world = truth();
        world.set(Effect::User(spring), &[-0.8]);
        let found = |world: &Model| {
            let flights = prepared(world, 50..53, 8.0, &ORDINARY);
            let flights: Vec<&Prepared> = flights.iter().collect();
            let mut variables = Variable::all(&flights, &truth());
            variables.retain(|variable| ["north", "vbat"].contains(&variable.name));
            (candidates(&flights, &truth(), &variables, &Silent), variables)
        };
        let (of_spring, variables) = found(&world);
        assert!(of_spring.are_significant(), "{}", of_spring.p_value);
        let [best, ..] = &of_spring.refined[..] else { panic!("no form") };
        let factor = best.form.factors[0];
        assert_eq!((best.form.channel, best.form.factors.len()), (Channel::Earth(0), 1));
        assert_eq!((variables[factor.variable].name, factor.shape.family), ("north", Family::Proportional));
        let error = 0.8 / best.gain_left_out.sqrt();
        assert!((best.amplitudes[0] + 0.8).abs() < 4.0 * error && error < 0.05, "{best:?}");
        let (of_nothing, _) = found(&truth());
        assert!(!of_nothing.are_significant() && of_nothing.refined.is_empty(), "{}", of_nothing.p_value);
    }

    /// Waves along north and east seldom have their crests together.
    #[test]
    fn the_first_form_but_a_wave_is_tried_with_a_wider_way_to_act() {
        let wave = form(Channel::Earth(0), &[(0, Family::Wave)]);
        let along_w = form(Channel::Body(Axis::W), &[(0, Family::Bump)]);
        let bump = form(Channel::Earth(1), &[(1, Family::Bump)]);
        let found = wider(&[wave.clone(), along_w.clone(), bump.clone()]);
        assert_eq!(found, Some(Form { channel: Channel::Horizontal, ..bump }));
        assert_eq!(wider(&[wave, along_w]), None);
    }
}
