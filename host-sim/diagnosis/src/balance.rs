//! What has changed in the steady balance of the rotors?
//!
//! In slow flight the rotors' moments add to zero and their thrust to the weight. A weaker motor must run faster, a shifted
//! mass loads the rotors on its side: both show in how the rotors share the thrust ([`sysid::fit::balance`]), however poor the
//! clocks and however little was excited. The shares of new flights are held against their scatter between the flights of the
//! model: four numbers, one for each equation of the balance.

use model::{Axis, BalanceRecord, Effect, Model};
use nalgebra::{DMatrix, DVector, Matrix4xX, Vector4};
use sysid::fit::balance::{Rotors, Window, windows};
use sysid::prepare::Prepared;
use sysid::residuals;
use sysid::statistics::{deviations_of, squares_p_value, wald_p_value};

use crate::beginning::{Share, since};
use crate::change::Change;
use crate::criteria::{Asked, Evidence, SIGNIFICANCE, TIE, weigh};
use crate::finding::{AxisDrop, CoefficientFigures, EffectFinding, Since};
use crate::reason::Reason;
use crate::search::PENALTY;

/// The axes that the four equations belong to.
const AXES: [Axis; 4] = [Axis::W, Axis::P, Axis::Q, Axis::R];
/// Of the scatter's degrees of freedom in roll, pitch and yaw, those that count: flights of one charge of the battery share
/// more than a flight of its own would.
const INDEPENDENT: f64 = 0.5;
/// What the shares of a craft scatter by from flight to flight before any of its flights is known, and how many degrees of
/// freedom that is worth. Of nine sets of flights of six real crafts, roll, pitch and yaw scatter by 0.001 to 0.026 (one pitch by
/// 0.056), root mean square 0.012; the handful of flights behind a model may happen to agree.
const USUAL_SCATTER: f64 = 0.01;
const USUAL_FREEDOM: f64 = 4.0;
/// Least noise of a window: commands are logged to six digits at best.
const LEAST_NOISE: f64 = 1e-6;
/// Step of a derivative, part of an ordinary magnitude. The shares are smooth.
const STEP: f64 = 1e-4;

/// What happens to a rotor's reaction torque where its thrust falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Torque {
    /// It stays: an eroded blade, a motor mount that has tilted.
    Stays,
    /// It falls alike: a cut propeller, a worn motor.
    FallsAlike,
}

/// One way in which the balance can have changed.
#[derive(Debug, Clone)]
struct Hypothesis {
    /// One change, or several together.
    changes: Vec<Change>,
    torque: Torque,
}

/// A hypothesis fitted to new flights.
#[derive(Debug, Clone)]
struct Fitted {
    hypothesis: Hypothesis,
    /// The shift that it makes of each equation, a column for each coefficient.
    columns: Matrix4xX<f64>,
    value: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Logarithm of the likelihood ratio to "nothing has changed", less a penalty for each coefficient.
    score: f64,
    p_value: f64,
}

/// How far flights are from the balance of a model's own.
struct Shift {
    /// Lift, roll, pitch, yaw.
    value: Vector4<f64>,
    /// Standard deviations of the shift for an unchanged craft.
    deviation: Vector4<f64>,
}

impl Shift {
    fn weighed(&self) -> Vector4<f64> {
        self.value.component_div(&self.deviation)
    }
}

/// The balance of new flights beside that of a model's own.
pub(crate) struct Balance<'a> {
    model: &'a Model,
    record: &'a BalanceRecord,
    shift: Shift,
    /// Of single flights.
    of_flights: Vec<Shift>,
    /// Each flight's name and windows.
    windows: &'a [Flown],
    rotor_squared: [f64; 4],
    /// Degrees of freedom of the scatter.
    freedom: f64,
}

/// The name of a flight and its windows.
type Flown = (String, Vec<Window>);

/// What the balance says.
pub(crate) struct Answer {
    /// The evidence for each change that acts on the balance.
    pub(crate) findings: Vec<(Change, EffectFinding)>,
    /// Chance of a shift as large as that in an unchanged craft.
    pub(crate) p_value: f64,
    /// The equation that is shifted most, by its axis, and its share of the weighed squares, percent.
    pub(crate) most: (Axis, f64),
    /// Loss of thrust of a single motor that would have stood out, part of its thrust.
    pub(crate) visible_loss: f64,
    /// When the change began that is named, where it has a beginning.
    pub(crate) since: Option<Since>,
}

/// What the balance says of flights in their order: of all together, and where these show nothing, of the last ones. Nothing where
/// the model has no record of its flights' balance, or no new flight is a window long.
pub(crate) fn answer(model: &Model, flights: &[&Prepared], changes: &[Change]) -> Option<Answer> {
    let record = model.fit.as_ref()?.balance.as_ref()?;
    let windows = flown(model, record, flights);
    let all = Balance::new(model, record, &windows)?;
    let whole = all.examine(changes, (1, &all));
    if whole.names_one() {
        return Some(whole);
    }
    let last = (1..windows.len()).filter_map(|first| {
        let balance = Balance::new(model, record, &windows[first..])?;
        Some(balance.examine(changes, (flights.len(), &all)))
    });
    let least = |answer: &Answer| answer.findings.first().map_or(1.0, |(_, finding)| finding.p_value);
    let named = last.filter(Answer::names_one).min_by(|a, b| least(a).total_cmp(&least(b)));
    Some(named.unwrap_or(whole))
}

impl Answer {
    /// Whether a change is supported.
    fn names_one(&self) -> bool {
        self.findings.iter().any(|(_, finding)| finding.supported)
    }
}

/// The windows of flights that are at least one long, by their difference in voltage from the record's.
fn flown(model: &Model, record: &BalanceRecord, flights: &[&Prepared]) -> Vec<Flown> {
    let of_flight =
        |flight: &&Prepared| (flight.name.clone(), windows(flight, model, &residuals(flight, model)));
    let mut all: Vec<Flown> = flights.iter().map(of_flight).collect();
    all.retain(|(_, windows)| !windows.is_empty());
    let own = all.iter_mut().flat_map(|(_, windows)| windows);
    own.for_each(|window| window.condition[0] -= record.battery_v);
    all
}

impl<'a> Balance<'a> {
    /// Nothing without flights.
    fn new(model: &'a Model, record: &'a BalanceRecord, windows: &'a [Flown]) -> Option<Self> {
        let together: Vec<Window> = windows.iter().flat_map(|(_, windows)| windows).copied().collect();
        let count = together.len() as f64;
        if together.is_empty() {
            return None;
        }
        let of_rotor = |i: usize| together.iter().map(|window| window.rotor_squared[i]).sum::<f64>() / count;
        Some(Self {
            model,
            record,
            shift: shift(record, &together),
            of_flights: windows.iter().map(|(_, windows)| shift(record, windows)).collect(),
            windows,
            rotor_squared: std::array::from_fn(of_rotor),
            freedom: freedom(record),
        })
    }

    /// Weighs every one of `changes` that acts on the balance, in one of so many `tries`; `all` flights say when it began.
    fn examine(&self, changes: &[Change], (tries, all): (usize, &Self)) -> Answer {
        let single: Vec<Hypothesis> = changes.iter().flat_map(|change| singles(*change)).collect();
        let candidates = tries * single.len().max(1);
        let mut best_of: Vec<Fitted> = Vec::new();
        for fitted in single.into_iter().filter_map(|hypothesis| self.fit(hypothesis)) {
            match best_of.iter_mut().find(|other| other.hypothesis.changes == fitted.hypothesis.changes) {
                Some(other) if other.score >= fitted.score => {}
                Some(other) => *other = fitted,
                None => best_of.push(fitted),
            }
        }
        best_of.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut findings: Vec<(Change, EffectFinding)> = best_of
            .iter()
            .map(|fitted| (fitted.hypothesis.changes[0], self.finding(fitted, candidates)))
            .collect();
        self.mark_rivals(&best_of, &mut findings, changes);
        let named = findings.iter().position(|(_, finding)| finding.supported);
        let weighed = self.shift.weighed();
        Answer {
            since: named.and_then(|best| all.since(&best_of[best])),
            findings,
            p_value: squares_p_value(weighed.norm_squared(), 4, self.freedom),
            most: (AXES[weighed.iamax()], 100.0 * weighed.amax().powi(2) / weighed.norm_squared()),
            visible_loss: self.visible_loss(candidates),
        }
    }

    /// When a change began, from how much of it each window shows.
    fn since(&self, fitted: &Fitted) -> Option<Since> {
        let whole: Vector4<f64> = &fitted.columns * &fitted.value;
        let rows = self.record.rows();
        let between = Vector4::from_fn(|k, _| between(self.record, k));
        // Each equation counts by what a window of another flight tells of it.
        let variance = |k: usize| rows[k].within.max(LEAST_NOISE).powi(2) + between[k].powi(2);
        let weight = Vector4::from_fn(|k, _| whole[k] / variance(k));
        let weight = weight / weight.dot(&whole);
        let share = |window: &Window| Share {
            time_s: window.time_s,
            share: weight.dot(&shift(self.record, std::slice::from_ref(window)).value),
            weight: 1.0,
        };
        let shares: Vec<(String, Vec<Share>)> = self
            .windows
            .iter()
            .map(|(name, windows)| (name.clone(), windows.iter().map(share).collect()))
            .collect();
        since(&shares, weight.component_mul(&between).norm())
    }

    /// The shift that a change by one makes of each equation, a column for each coefficient.
    fn columns(&self, hypothesis: &Hypothesis) -> Option<Matrix4xX<f64>> {
        let shares = |model: &Model, squared: &[f64; 4]| {
            let (lift, [roll, pitch, yaw]) = Rotors::new(model).shares(squared);
            Vector4::new(lift, roll, pitch, yaw)
        };
        let here = shares(self.model, &self.rotor_squared);
        let mut columns: Vec<Vector4<f64>> = Vec::new();
        for change in &hypothesis.changes {
            let info = change.effect.info();
            let places = change.coefficients();
            for (i, k) in places.iter().enumerate() {
                let step = STEP * info.coefficients[*k].typical;
                let mut size = vec![0.0; places.len()];
                size[i] = step;
                let mut changed = self.model.clone();
                change.add(&mut changed, &size);
                let mut slope = (shares(&changed, &self.rotor_squared) - here) / step;
                if let (Torque::FallsAlike, Some(motor)) = (hypothesis.torque, change.motor) {
                    let mut slower = self.rotor_squared;
                    slower[usize::from(motor) - 1] *= 1.0 - step;
                    slope[3] = (shares(self.model, &slower)[3] - here[3]) / step;
                }
                slope[0] /= here[0];
                // What the commands would do to an unchanged craft is what the changed one had to make up for.
                columns.push(-slope);
            }
        }
        (!columns.is_empty()).then(|| Matrix4xX::from_columns(&columns))
    }

    /// Fits a hypothesis to all flights.
    fn fit(&self, hypothesis: Hypothesis) -> Option<Fitted> {
        let columns = self.columns(&hypothesis)?;
        self.fit_to(&self.shift, hypothesis, columns)
    }

    fn fit_to(&self, shift: &Shift, hypothesis: Hypothesis, columns: Matrix4xX<f64>) -> Option<Fitted> {
        let weighed = Matrix4xX::from_fn(columns.ncols(), |r, c| columns[(r, c)] / shift.deviation[r]);
        let covariance = (weighed.transpose() * &weighed).cholesky()?.inverse();
        let target = shift.weighed();
        let value = &covariance * (weighed.transpose() * target);
        let left = (target - &weighed * &value).norm_squared();
        let count = value.len() as f64;
        let likelihood = 0.5
            * (self.freedom + 4.0)
            * ((self.freedom + target.norm_squared()) / (self.freedom + left)).ln();
        let score = likelihood - PENALTY * count - unusual(&hypothesis, &value);
        let p_value = wald_p_value(&value, covariance.clone(), self.freedom + count);
        Some(Fitted { hypothesis, columns, value, covariance, score, p_value })
    }

    fn finding(&self, fitted: &Fitted, candidates: usize) -> EffectFinding {
        let change = fitted.hypothesis.changes[0];
        let flights = self.of_flights.len();
        let mut finding = EffectFinding::unsupported(change.effect, flights, Reason::LikeChance);
        finding.motor = change.motor;
        let errors: Vec<f64> = fitted.covariance.diagonal().iter().map(|v| v.sqrt()).collect();
        let figures = change.coefficients().into_iter().enumerate().map(|(i, k)| {
            CoefficientFigures::of_change((change.effect, k), fitted.value[i], errors[i], self.model)
        });
        finding.coefficients = figures.collect();
        // What seldom happens needs as much more evidence.
        let seldom = unusual(&fitted.hypothesis, &fitted.value).exp();
        finding.p_value = (fitted.p_value * candidates as f64 * seldom).min(1.0);
        finding.gain = fitted.score;
        self.hold_out(fitted, &mut finding);
        let evidence = Evidence {
            asked: Asked::Changed,
            finding: &finding,
            std_errors: errors,
            leaning: None,
            has_rotor_map: self.model.vehicle.has_rotor_map(),
        };
        let (supported, reason) = weigh(&evidence);
        let percent = finding.drop_percent;
        finding.supported = supported;
        finding.reason =
            if supported { Reason::BalanceShifted { percent, rivals: Vec::new() } } else { reason };
        finding
    }

    /// Writes into a finding what it takes away from the shift of each flight, as it was estimated from the others. A single
    /// flight can only be judged by itself; the scatter between the model's flights then guards against chance.
    fn hold_out(&self, fitted: &Fitted, finding: &mut EffectFinding) {
        let (mut before, mut after) = (Vector4::zeros(), Vector4::zeros());
        let deviation = self.shift.deviation;
        for (index, shift) in self.of_flights.iter().enumerate() {
            let others: Vec<&Shift> =
                self.of_flights.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, s)| s).collect();
            let mean = others.iter().map(|s| s.value).sum::<Vector4<f64>>() / others.len().max(1) as f64;
            let rest = Shift { value: if others.is_empty() { shift.value } else { mean }, deviation };
            let (hypothesis, columns) = (fitted.hypothesis.clone(), fitted.columns.clone());
            let Some(refitted) = self.fit_to(&rest, hypothesis, columns) else { continue };
            let left: Vector4<f64> = shift.value - refitted.columns * refitted.value;
            let (without, with) = (shift.value.component_div(&deviation), left.component_div(&deviation));
            before += without.component_mul(&without);
            after += with.component_mul(&with);
            finding.flights_improved[0] += usize::from(with.norm_squared() < without.norm_squared());
        }
        for (k, axis) in AXES.into_iter().enumerate() {
            finding.axes.insert(axis.name(), AxisDrop::new(before[k], after[k]));
        }
        let total = before.sum();
        finding.drop_percent = if total > 0.0 { 100.0 * (1.0 - after.sum() / total) } else { 0.0 };
    }

    /// What explains the shift nearly as well as the best cannot be told from it: single changes, and two at once.
    fn mark_rivals(&self, all: &[Fitted], findings: &mut [(Change, EffectFinding)], changes: &[Change]) {
        let Some(first) = findings.iter().position(|(_, finding)| finding.supported) else { return };
        let best = findings[first].0;
        let is_near = |fitted: &Fitted| fitted.score > all[first].score - TIE;
        let mut rivals: Vec<Change> = Vec::new();
        for ((change, finding), fitted) in findings.iter_mut().zip(all) {
            if *change == best {
                continue;
            }
            if is_near(fitted) {
                rivals.push(*change);
                finding.refuse(Reason::RivalOf { best });
                finding.confounded_with.push(best.effect);
            } else if finding.supported {
                finding.refuse(Reason::ExplainedBy { other: best });
            }
        }
        // The best with something beside it is no rival of the best.
        let others = pairs(changes).into_iter().filter(|pair| !pair.changes.contains(&best));
        for pair in others.filter_map(|pair| self.fit(pair)) {
            if is_near(&pair) && pair.p_value < SIGNIFICANCE {
                rivals.extend(pair.hypothesis.changes);
            }
        }
        rivals.sort_by_key(|rival| (rival.effect.id(), rival.motor));
        rivals.dedup();
        let finding = &mut findings[first].1;
        finding.confounded_with = rivals.iter().map(|rival| rival.effect).collect();
        finding.confounded_with.dedup();
        finding.reason = Reason::BalanceShifted { percent: finding.drop_percent, rivals };
    }

    /// The loss of a motor that is significant half of the time; of the four motors, that which shows least.
    fn visible_loss(&self, candidates: usize) -> f64 {
        let deviations = deviations_of(SIGNIFICANCE / candidates as f64, self.freedom);
        let error = |motor: u8| {
            let change = Change { effect: Effect::MotorEfficiency, motor: Some(motor) };
            let hypothesis = Hypothesis { changes: vec![change], torque: Torque::FallsAlike };
            self.fit(hypothesis).map_or(f64::INFINITY, |fitted| fitted.covariance[(0, 0)].sqrt())
        };
        deviations * (1..=4).map(error).fold(0.0, f64::max)
    }
}

/// How far the mean of some windows is from the record.
fn shift(record: &BalanceRecord, windows: &[Window]) -> Shift {
    let count = windows.len() as f64;
    let rows = record.rows();
    let (mut value, mut deviation) = (Vector4::zeros(), Vector4::zeros());
    for (k, row) in rows.into_iter().enumerate() {
        let condition = windows.iter().map(|window| window.condition[k]).sum::<f64>() / count;
        let balance = windows.iter().map(|window| window.balance[k]).sum::<f64>() / count;
        value[k] = balance - row.mean - row.slope * condition;
        let [mean, both, slope] = row.covariance;
        let of_record = mean + 2.0 * both * condition + slope * condition * condition;
        // New flights share the trim of their day: several of them scatter no less than one.
        let variance = between(record, k).powi(2) + row.within * row.within / count + of_record.max(0.0);
        let known_worse = if k == 0 { lift_known_worse(record) } else { 1.0 };
        deviation[k] = (known_worse * variance.sqrt()).max(LEAST_NOISE);
    }
    Shift { value, deviation }
}

/// The scatter of lift is known from one equation with a slope, and that of the moments from three: how much wider its interval is.
fn lift_known_worse(record: &BalanceRecord) -> f64 {
    let flights = record.flights as f64;
    let own = (INDEPENDENT * (flights - 2.0)).max(1.0);
    deviations_of(SIGNIFICANCE, own) / deviations_of(SIGNIFICANCE, freedom(record))
}

/// Degrees of freedom of the scatter of one equation of the moments.
fn own_freedom(record: &BalanceRecord) -> f64 {
    INDEPENDENT * (record.flights as f64 - 1.0).max(1.0)
}

/// Degrees of freedom of the moments' scatter, all three together.
fn freedom(record: &BalanceRecord) -> f64 {
    3.0 * own_freedom(record) + USUAL_FREEDOM
}

/// Standard deviation of an equation between flights, that of the record and the usual one weighed by what each is known from.
fn between(record: &BalanceRecord, equation: usize) -> f64 {
    let seen = record.rows()[equation].between;
    if equation == 0 {
        // Lift scatters by 0.003 to 0.044, most where the battery's voltage stands in for rotor speeds.
        return seen.max(USUAL_SCATTER);
    }
    let own = own_freedom(record);
    let squares = own * seen.powi(2) + USUAL_FREEDOM * USUAL_SCATTER.powi(2);
    (squares / (own + USUAL_FREEDOM)).sqrt()
}

/// The hypotheses of one change; none where it does not act on the balance.
fn singles(change: Change) -> Vec<Hypothesis> {
    if !change.effect.info().acts_on_balance() {
        return Vec::new();
    }
    let all: &[Torque] =
        if change.motor.is_some() { &[Torque::Stays, Torque::FallsAlike] } else { &[Torque::Stays] };
    all.iter().map(|torque| Hypothesis { changes: vec![change], torque: *torque }).collect()
}

/// Two changes at once: a weight at the side, which shifts the centre of mass as well, and two weak motors.
fn pairs(changes: &[Change]) -> Vec<Hypothesis> {
    let acting: Vec<Change> = changes.iter().copied().filter(|c| c.effect.info().acts_on_balance()).collect();
    let mut all = Vec::new();
    for (index, first) in acting.iter().enumerate() {
        for second in &acting[index + 1..] {
            if first.motor.is_some() == second.motor.is_some() {
                all.push(Hypothesis { changes: vec![*first, *second], torque: Torque::FallsAlike });
            }
        }
    }
    all
}

/// What a hypothesis loses because it seldom happens: a motor that gives more than it did counts 20 to 1.
fn unusual(hypothesis: &Hypothesis, value: &DVector<f64>) -> f64 {
    let gives_more = |(change, value): (&Change, &f64)| change.motor.is_some() && *value < 0.0;
    if hypothesis.changes.iter().zip(value).any(gives_more) { TIE } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use model::FitRecord;
    use sysid::Residuals;

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// The true model with the balance of six flights on record.
    fn known() -> Model {
        let flights = prepared(&truth(), 60..66, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let mut model = truth();
        let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, &model)).collect();
        let balance = sysid::fit::balance::record(&model, flights.iter().copied().zip(&left));
        assert!(balance.is_some());
        model.fit = Some(FitRecord { balance, ..FitRecord::default() });
        model
    }

    fn answer(true_craft: &Model) -> Answer {
        let known = known();
        let flights = prepared(true_craft, 70..72, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let record = known.fit.as_ref().unwrap().balance.as_ref().unwrap();
        let windows = flown(&known, record, &flights);
        let balance = Balance::new(&known, record, &windows).unwrap();
        balance.examine(&Change::all(&known), (1, &balance))
    }

    fn changed(effect: Effect, values: &[f64]) -> Model {
        let mut model = truth();
        model.set(effect, values);
        model
    }

    #[test]
    fn a_weak_motor_is_named_with_its_loss() {
        let answer = answer(&changed(Effect::MotorEfficiency, &[0.0, 0.0, 0.0, 0.1]));
        let (best, finding) = &answer.findings[0];
        assert!(finding.supported, "{}", finding.reason);
        assert_eq!((best.effect, best.motor), (Effect::MotorEfficiency, Some(4)), "{}", finding.reason);
        let loss = &finding.coefficients[0];
        assert!((loss.value - 0.1).abs() < 3.0 * loss.std_error + 0.01, "{loss:?}");
    }

    #[test]
    fn a_shifted_mass_is_named_with_its_place() {
        let answer = answer(&changed(Effect::ComOffset, &[0.004, 0.007]));
        let (best, finding) = &answer.findings[0];
        assert!(finding.supported && best.effect == Effect::ComOffset, "{best}: {}", finding.reason);
        for (found, truth) in finding.coefficients.iter().zip([0.004, 0.007]) {
            assert!((found.value - truth).abs() < 3.0 * found.std_error + 0.0005, "{found:?}");
        }
    }

    #[test]
    fn an_unchanged_craft_keeps_its_balance_and_what_would_show_is_told() {
        let answer = answer(&truth());
        assert!(answer.findings.iter().all(|(_, finding)| !finding.supported));
        assert!(answer.p_value > 0.01, "{}", answer.p_value);
        assert!(answer.visible_loss > 0.0 && answer.visible_loss < 0.2, "{}", answer.visible_loss);
    }

    /// Two flights of six are too few to move the mean of all.
    #[test]
    fn a_motor_that_weakens_in_the_last_flights_is_named_with_when() {
        let known = known();
        let mut flights = prepared(&truth(), 74..78, 8.0, &ORDINARY);
        flights.extend(prepared(
            &changed(Effect::MotorEfficiency, &[0.0, 0.15, 0.0, 0.0]),
            78..80,
            8.0,
            &ORDINARY,
        ));
        let flights: Vec<&Prepared> = flights.iter().collect();
        let answer = super::answer(&known, &flights, &Change::all(&known)).unwrap();
        let (best, finding) = &answer.findings[0];
        assert!(finding.supported && best.motor == Some(2), "{best}: {}", finding.reason);
        let since = answer.since.unwrap();
        assert_eq!(since.flight, flights[4].name, "{since:?}");
    }

    #[test]
    fn without_a_record_there_is_no_balance_to_compare_with() {
        let flights = prepared(&truth(), 70..71, 8.0, &ORDINARY);
        assert!(super::answer(&truth(), &[&flights[0]], &Change::all(&truth())).is_none());
    }

    #[test]
    fn a_motor_that_gives_more_is_less_likely_than_one_that_gives_less() {
        let motor = |k| Change { effect: Effect::MotorEfficiency, motor: Some(k) };
        let hypothesis = |changes: Vec<Change>| Hypothesis { changes, torque: Torque::Stays };
        assert_eq!(unusual(&hypothesis(vec![motor(1)]), &DVector::from_vec(vec![-0.1])), TIE);
        assert_eq!(unusual(&hypothesis(vec![motor(1)]), &DVector::from_vec(vec![0.1])), 0.0);
        let mass = Change { effect: Effect::MassChange, motor: None };
        assert_eq!(unusual(&hypothesis(vec![mass]), &DVector::from_vec(vec![-0.1])), 0.0);
    }
}
