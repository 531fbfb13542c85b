//! From what a model leaves to the few forms that are worth fitting exactly.

use model::Model;
use sysid::prepare::Prepared;

use crate::discovery::channels::Channel;
use crate::discovery::form::Form;
use crate::discovery::phases::{chance_of, of_random_phases};
use crate::discovery::problem::Problem;
use crate::discovery::refine::{Refined, refine};
use crate::discovery::search::{Against, Scored, cost, over_variable};
use crate::discovery::variables::Variable;
use crate::observer::{Observer, Progress};

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
/// Forms of one shape, and of two, that are fitted exactly.
const REFINED: usize = 8;

/// What a search of all forms finds.
#[derive(Debug)]
pub(crate) struct Candidates {
    /// Forms fitted exactly, best first by flights left out.
    pub(crate) refined: Vec<Refined>,
    /// Chance that a search of residuals of random phases finds one of such worth.
    pub(crate) p_value: f64,
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
    let mut found: Vec<Scored> = Vec::new();
    let mut by_chance = vec![f64::NEG_INFINITY; RANDOM_PHASES];
    let steps = 2 * variables.len();
    for variable in 0..variables.len() {
        observer.progress(Progress { activity: "trying forms", steps: Some((variable, steps)) });
        let one =
            over_variable(&problem, &against, (&bases, variables, variable), knots_of(&variables[variable]));
        found.extend(one.best);
        by_chance.iter_mut().zip(one.by_chance).for_each(|(most, one)| *most = most.max(one));
    }
    sort(&mut found, problem.rows);
    let p_value = found.first().map_or(1.0, |best| chance_of(best.worth(problem.rows), &by_chance));
    let mut forms: Vec<Form> = distinct(&found, REFINED).into_iter().map(|scored| scored.form).collect();
    let bases: Vec<Form> = distinct(&found, BASES).into_iter().map(|scored| scored.form).collect();
    forms.extend(wider(&forms));
    let only = Against::new(&problem, &[]);
    let mut products: Vec<Scored> = Vec::new();
    for variable in 0..variables.len() {
        observer.progress(Progress {
            activity: "trying forms",
            steps: Some((variables.len() + variable, steps)),
        });
        let one = over_variable(&problem, &only, (&bases, variables, variable), KNOTS);
        products.extend(
            one.best.into_iter().filter(|scored| scored.form.variables().len() == scored.form.factors.len()),
        );
    }
    sort(&mut products, problem.rows);
    forms.extend(distinct(&products, REFINED).into_iter().map(|scored| scored.form));
    let mut refined: Vec<Refined> =
        forms.iter().filter_map(|form| refine(&problem, form, variables)).collect();
    let worth = |one: &Refined| one.gain_left_out - cost(one.form.count(), problem.rows);
    refined.sort_by(|one, other| worth(other).total_cmp(&worth(one)));
    Candidates { refined, p_value }
}

/// The best form with a way to act that has a wider one, with that.
fn wider(forms: &[Form]) -> Option<Form> {
    forms.iter().find_map(|form| Some(Form { channel: form.channel.wider()?, ..form.clone() }))
}

fn knots_of(variable: &Variable) -> usize {
    if variable.name == model::user_effects::TIME_COLUMN { KNOTS_OF_TIME } else { KNOTS }
}

fn sort(found: &mut [Scored], rows: usize) {
    found.sort_by(|one, other| other.worth(rows).total_cmp(&one.worth(rows)));
}

/// The best: of each way to act three at most, two of them over the same variables.
fn distinct(found: &[Scored], most: usize) -> Vec<Scored> {
    let mut kept: Vec<Scored> = Vec::new();
    for one in found {
        let alike = kept.iter().filter(|other| other.form.channel == one.form.channel);
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
