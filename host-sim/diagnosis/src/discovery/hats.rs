//! Every piecewise straight shape over one variable at once: ways to act times hats of the variable, as rows made white.

use std::borrow::Cow;
use std::ops::Range;

use model::{LagId, Sample, Sink};
use nalgebra::DMatrix;
use sysid::fit::terms::Terms;
use sysid::fit::times_hats::{EvenHats, QuantitySignal, TermSignals};

use crate::discovery::center::Center;
use crate::discovery::form::Form;
use crate::discovery::problem::{Problem, White};
use crate::discovery::variables::Variable;

/// Forms that hats of a variable are tried with, by amplitude: each is a parameter.
pub(crate) struct Bases<'a> {
    pub(crate) forms: Vec<Form>,
    variables: &'a [Variable],
    /// What they multiply in each flight, formed once; nothing where whole columns are wanted.
    signals: Option<Vec<TermSignals>>,
}

/// Variables that are formed once, by flight; nothing for those that each rotor has of its own.
pub(crate) struct Quantities(Vec<Option<Vec<QuantitySignal>>>);

/// Rows of forms times hats, made white, for each axis.
pub(crate) struct HatRows {
    axes: [HatsOfAxis; 6],
    hats: usize,
}

/// For each parameter that acts on the axis, and each hat, a row; a column for each row of the flights.
struct HatsOfAxis {
    parameters: Vec<usize>,
    values: DMatrix<f64>,
}

impl Quantities {
    /// Those of the flights of a problem.
    pub(crate) fn new(problem: &Problem<'_>, variables: &[Variable]) -> Self {
        let mut all: Vec<Option<Vec<QuantitySignal>>> = variables.iter().map(|_| None).collect();
        let (looking_back, present): (Vec<usize>, Vec<usize>) = (0..variables.len())
            .filter(|index| variables[*index].is_searched() && !variables[*index].is_own())
            .partition(|index| variables[*index].lag_s().is_some());
        // A sample has room for a few lags only.
        for some in looking_back.chunks(1).chain([&present[..]]) {
            let of = |sample: &Sample, values: &mut [f64]| {
                for (value, index) in values.iter_mut().zip(some) {
                    *value = variables[*index].of_rotor(sample, 0);
                }
            };
            let lags: Vec<LagId> = some.iter().flat_map(|index| variables[*index].lags()).collect();
            for flight in problem.prepared() {
                let signals = flight.quantity_signals(some.len(), &lags, problem.model, of);
                for (index, signal) in some.iter().zip(signals) {
                    all[*index].get_or_insert_default().push(signal);
                }
            }
        }
        Self(all)
    }

    /// Only a distance, of that number among the variables, from a center.
    pub(crate) fn from_center(problem: &Problem<'_>, center: Center, distance: usize) -> Self {
        let of = |sample: &Sample, values: &mut [f64]| {
            values.fill(center.distance_m(&sample.input.position_ned_m));
        };
        let of_flight = |flight: &sysid::Prepared| flight.quantity_signals(1, &[], problem.model, of);
        let mut all: Vec<Option<Vec<QuantitySignal>>> = (0..distance).map(|_| None).collect();
        all.push(Some(problem.prepared().flat_map(of_flight).collect()));
        Self(all)
    }
}

impl<'a> Bases<'a> {
    /// Of the flights of a problem.
    pub(crate) fn new(problem: &Problem<'_>, forms: Vec<Form>, variables: &'a [Variable]) -> Self {
        let mut bases = Self { forms, variables, signals: None };
        // What each rotor has of its own asks for hats of its own.
        if !bases.forms.iter().any(|form| form.channel.is_each_rotor()) {
            let of_flight = |flight: &sysid::Prepared| flight.term_signals(&bases, problem.model);
            bases.signals = problem.prepared().map(of_flight).collect();
        }
        bases
    }

    /// The forms that one shape more of a variable means something to, which may be none.
    fn taking(&self, variable: usize) -> Option<Self> {
        let takes = |form: &&Form| form.takes(&self.variables[variable]);
        let forms: Vec<Form> = self.forms.iter().filter(takes).cloned().collect();
        (!forms.is_empty()).then_some(Self { forms, variables: self.variables, signals: None })
    }
}

impl Terms for Bases<'_> {
    fn count(&self) -> usize {
        self.forms.iter().map(|form| form.channel.amplitudes()).sum()
    }

    fn lags(&self) -> Vec<LagId> {
        self.forms.iter().flat_map(|form| form.lags(self.variables)).collect()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let mut first = 0;
        for form in &self.forms {
            form.channel.add(sample, form.at(self.variables, sample), first, sink);
            first += form.channel.amplitudes();
        }
    }
}

/// Bases times hats of a variable, for whole columns.
struct TimesHats<'a> {
    bases: &'a Bases<'a>,
    variable: &'a Variable,
    hats: EvenHats,
}

impl Terms for TimesHats<'_> {
    fn count(&self) -> usize {
        self.bases.count() * self.hats.count
    }

    fn lags(&self) -> Vec<LagId> {
        self.variable.lags().chain(self.bases.lags()).collect()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let places_of = |base: &Form| {
            let of = |rotor: usize| self.hats.place(base.value_of(self.variable, sample, rotor));
            if self.variable.is_own() { std::array::from_fn(of) } else { [of(0); 4] }
        };
        let shared = self.bases.forms.first().filter(|_| !self.variable.is_distance()).map(places_of);
        let mut first = 0;
        for base in &self.bases.forms {
            let places = shared.unwrap_or_else(|| places_of(base));
            let scale = base.at(self.bases.variables, sample);
            for hat in 0..self.hats.count {
                let at = |rotor: usize| scale[rotor] * (1.0 - (places[rotor] - hat as f64).abs()).max(0.0);
                let mut of_hat = OfHat { sink, hats: self.hats.count, hat };
                base.channel.add(sample, std::array::from_fn(at), first, &mut of_hat);
            }
            first += base.channel.amplitudes();
        }
    }
}

/// A sink of the parameters of one hat.
struct OfHat<'a, S> {
    sink: &'a mut S,
    hats: usize,
    hat: usize,
}

impl<S: Sink> Sink for OfHat<'_, S> {
    fn add(&mut self, axis: model::Axis, parameter: usize, value: f64) {
        self.sink.add(axis, parameter * self.hats + self.hat, value);
    }
}

impl HatRows {
    /// Of bases times hats of a variable; nothing where it means nothing to any of them. The bases are those that it means something to.
    pub(crate) fn new<'a>(
        problem: &Problem<'_>,
        bases: &'a Bases<'_>,
        quantities: &Quantities,
        variable: usize,
        hats: EvenHats,
    ) -> Option<(Cow<'a, [Form]>, Self)> {
        let taking = bases.taking(variable)?;
        if let (true, Some(signals), Some(quantity)) =
            (taking.forms.len() == bases.forms.len(), &bases.signals, &quantities.0[variable])
        {
            return Some((Cow::Borrowed(&bases.forms), Self::formed(problem, signals, quantity, hats)));
        }
        let terms = TimesHats { bases: &taking, variable: &bases.variables[variable], hats };
        let rows = Self::of_columns(&problem.columns(&terms), problem.rows, hats.count);
        Some((Cow::Owned(taking.forms), rows))
    }

    /// From what was formed once.
    fn formed(
        problem: &Problem<'_>,
        signals: &[TermSignals],
        quantity: &[QuantitySignal],
        hats: EvenHats,
    ) -> Self {
        let parameters = signals.first().map(TermSignals::parameters_by_axis).unwrap_or_default();
        let widths = parameters.each_ref().map(|of_axis| of_axis.len() * hats.count);
        let mut rows: [Vec<f64>; 6] = widths.map(|width| Vec::with_capacity(width * problem.rows));
        for (flight, (signals, quantity)) in signals.iter().zip(quantity).enumerate() {
            let firsts = rows.each_ref().map(Vec::len);
            signals.append_times_hats(quantity, &hats, &mut rows);
            for (axis, (rows, first)) in rows.iter_mut().zip(firsts).enumerate() {
                problem.whiten_rows(flight, axis, &mut rows[first..], widths[axis]);
            }
        }
        let mut parameters = parameters.into_iter();
        let axes = rows.map(|values| {
            let parameters = parameters.next().unwrap_or_default();
            let width = parameters.len() * hats.count;
            let rows = if width == 0 { 0 } else { problem.rows };
            HatsOfAxis { parameters, values: DMatrix::from_vec(width, rows, values) }
        });
        Self { axes, hats: hats.count }
    }

    /// From white columns: of each parameter, with every hat.
    fn of_columns(columns: &[White], rows: usize, hats: usize) -> Self {
        let axes = std::array::from_fn(|axis| {
            let acts = |of_parameter: &&[White]| of_parameter.iter().any(|column| column[axis].is_some());
            let (parameters, acting): (Vec<usize>, Vec<&[White]>) =
                columns.chunks_exact(hats).enumerate().filter(|(_, chunk)| acts(chunk)).unzip();
            let mut values = DMatrix::zeros(acting.len() * hats, rows);
            for (place, column) in acting.into_iter().flatten().enumerate() {
                if let Some(column) = &column[axis] {
                    values.row_mut(place).iter_mut().zip(column).for_each(|(value, own)| *value = *own);
                }
            }
            HatsOfAxis { parameters, values }
        });
        Self { axes, hats }
    }
}

/// Cross products of rows with what they are held against, on each axis.
pub(crate) struct CrossProducts<'a> {
    rows: &'a HatRows,
    against: [DMatrix<f64>; 6],
}

/// Cross products of the hats of one form.
pub(crate) struct Products {
    /// Of the hats with each other.
    pub(crate) gram: DMatrix<f64>,
    /// Of the hats with what they are held against.
    pub(crate) against: DMatrix<f64>,
}

impl<'a> CrossProducts<'a> {
    /// With columns of each axis.
    pub(crate) fn new(rows: &'a HatRows, against: &[DMatrix<f64>; 6]) -> Self {
        let of_axis = |axis: usize| &rows.axes[axis].values * &against[axis];
        let empty = |axis: usize| DMatrix::zeros(0, against[axis].ncols());
        let has = |axis: usize| !rows.axes[axis].parameters.is_empty();
        Self {
            rows,
            against: std::array::from_fn(|axis| if has(axis) { of_axis(axis) } else { empty(axis) }),
        }
    }

    /// Of the parameters of one form, hat by hat.
    pub(crate) fn of(&self, parameters: &Range<usize>) -> Products {
        let hats = self.rows.hats;
        let size = parameters.len() * hats;
        let mut gram = DMatrix::zeros(size, size);
        let mut with = DMatrix::zeros(size, self.against[0].ncols());
        for (axis, against) in self.rows.axes.iter().zip(&self.against) {
            let own = |parameter: &&usize| parameters.contains(parameter);
            let Some(first) = axis.parameters.iter().position(|parameter| own(&parameter)) else { continue };
            let width = axis.parameters.iter().filter(own).count() * hats;
            let to = (axis.parameters[first] - parameters.start) * hats;
            let rows = axis.values.rows(first * hats, width);
            let mut block = gram.view_mut((to, to), (width, width));
            // Not by `tr_mul`: that multiplies without blocks.
            block.gemm(1.0, &rows, &rows.transpose(), 1.0);
            let mut block = with.rows_mut(to, width);
            block += against.rows(first * hats, width);
        }
        Products { gram, against: with }
    }
}
