//! Every piecewise straight shape over one variable at once: ways to act times hats of the variable, as rows made white.

use std::borrow::Cow;
use std::ops::Range;

use model::{LagId, Sample, Sink};
use nalgebra::{DMatrix, Vector3};
use sysid::fit::even_hats::EvenHats;
use sysid::fit::terms::Terms;
use sysid::fit::times_hats::{QuantitySignal, SomeRows, TermSignals};

use crate::discovery::against::Against;
use crate::discovery::center::Center;
use crate::discovery::channels::Channel;
use crate::discovery::form::{Form, FormedOnce};
use crate::discovery::problem::{Problem, White};
use crate::discovery::products::{Columns, products};
use crate::discovery::variables::Variable;
use crate::discovery::whitening;

/// Forms that hats of a variable are tried with, by amplitude: each is a parameter.
pub(crate) struct Bases<'a> {
    pub(crate) forms: Vec<Form>,
    variables: &'a [Variable],
    /// What they multiply in each flight, formed once; nothing where whole columns are wanted.
    signals: Option<Vec<TermSignals>>,
}

/// Variables that are formed once, by flight; nothing for those that each rotor has of its own, which ask for hats of their own.
pub(crate) struct Quantities(Vec<Option<Vec<QuantitySignal>>>);

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
    pub(crate) fn from_center(in_room: Option<&InRoom>, center: Center, distance: usize) -> Self {
        let from = |place: &[f64]| center.distance_m(&Vector3::from_row_slice(place));
        let of = |in_room: &InRoom| {
            in_room.0.iter().map(|(_, place)| QuantitySignal::of(place, from)).collect::<Vec<_>>()
        };
        Self((0..distance).map(|_| None).chain([in_room.map(of)]).collect())
    }
}

/// What all forces about centers are made of, in each flight: forces along north, east and down, and the place.
pub(crate) struct InRoom(Vec<(TermSignals, Vec<QuantitySignal>)>);

impl InRoom {
    /// Nothing where whole columns are wanted.
    pub(crate) fn new(problem: &Problem<'_>) -> Option<Self> {
        let place = |sample: &Sample, values: &mut [f64]| {
            values.copy_from_slice(sample.input.position_ned_m.as_slice());
        };
        let along_earth = FormedOnce((0..3).map(Channel::Earth).collect());
        let of_flight = |flight: &sysid::Prepared| {
            let forces = flight.term_signals(&along_earth, problem.model)?;
            Some((forces, flight.quantity_signals(3, &[], problem.model, place)))
        };
        problem.prepared().map(of_flight).collect::<Option<_>>().map(Self)
    }

    /// Forces about centers.
    fn forces(&self, centers: &[Center]) -> Vec<TermSignals> {
        let directions = |place: &[f64], weights: &mut [f64]| {
            for (own, center) in weights.chunks_exact_mut(3).zip(centers) {
                own.copy_from_slice(center.direction_from(&Vector3::from_row_slice(place)).as_slice());
            }
        };
        self.0.iter().map(|(forces, place)| forces.recombined(place, centers.len(), directions)).collect()
    }
}

impl<'a> Bases<'a> {
    /// Of the flights of a problem.
    pub(crate) fn new(problem: &Problem<'_>, forms: Vec<Form>, variables: &'a [Variable]) -> Self {
        let bases = Self { forms, variables, signals: None };
        let of_flight = |flight: &sysid::Prepared| flight.term_signals(&bases, problem.model);
        let signals = problem.prepared().map(of_flight).collect();
        Self { signals, ..bases }
    }

    /// Forces about centers that are nothing but that.
    pub(crate) fn about(
        (problem, in_room): (&Problem<'_>, Option<&InRoom>),
        centers: &[Center],
        variables: &'a [Variable],
    ) -> Self {
        let form = |center: &Center| Form { channel: Channel::Center(*center), factors: Vec::new() };
        let forms: Vec<Form> = centers.iter().map(form).collect();
        match in_room {
            Some(in_room) => Self { forms, variables, signals: Some(in_room.forces(centers)) },
            None => Self::new(problem, forms, variables),
        }
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

/// Rows that are formed at a time: so many stay in a processor's cache.
const ROWS_AT_ONCE: usize = 128;

/// Cross products of bases times hats of a variable, as rows made white, with each other and with what they are held against.
pub(crate) struct CrossProducts {
    axes: [OfAxis; 6],
    hats: usize,
    /// Parameters of each form.
    parameters: Vec<Range<usize>>,
}

/// Those on one axis.
struct OfAxis {
    /// Hats of each parameter.
    hats: usize,
    /// The forms that act on it.
    forms: Vec<OfForm>,
    /// A column for each parameter that acts on the axis, and each hat.
    against: DMatrix<f32>,
}

struct OfForm {
    form: usize,
    /// Those of the axis' parameters that are its own, ...
    parameters: Range<usize>,
    /// ... and the first of them among all of its own.
    first: usize,
    /// Of its columns with each other.
    gram: DMatrix<f32>,
}

/// Cross products of the hats of one form.
pub(crate) struct Products {
    /// Of the hats with each other.
    pub(crate) gram: DMatrix<f64>,
    /// Of the hats with what they are held against.
    pub(crate) against: DMatrix<f64>,
}

impl CrossProducts {
    /// Nothing where the variable means nothing to any of the bases. The forms are those that it means something to.
    pub(crate) fn new<'a>(
        (problem, against): (&Problem<'_>, &Against),
        bases: &'a Bases<'_>,
        (quantities, variable): (&Quantities, usize),
        hats: EvenHats,
    ) -> Option<(Cow<'a, [Form]>, Self)> {
        let taking = bases.taking(variable)?;
        if let (true, Some(signals), Some(quantity)) =
            (taking.forms.len() == bases.forms.len(), &bases.signals, &quantities.0[variable])
        {
            let parameters = signals.first().map(TermSignals::parameters_by_axis).unwrap_or_default();
            let mut products = Self::empty(&bases.forms, &parameters, hats.count, against);
            products.add_formed((problem, against), signals, quantity, hats);
            return Some((Cow::Borrowed(&bases.forms), products));
        }
        let terms = TimesHats { bases: &taking, variable: &bases.variables[variable], hats };
        let columns = problem.columns(&terms);
        let acts = |of_parameter: &[White], axis: usize| of_parameter.iter().any(|own| own[axis].is_some());
        let acting = |axis: usize| {
            let by_parameter = columns.chunks_exact(hats.count).enumerate();
            by_parameter.filter(|(_, own)| acts(own, axis)).map(|(parameter, _)| parameter).collect()
        };
        let parameters: [Vec<usize>; 6] = std::array::from_fn(acting);
        let mut products = Self::empty(&taking.forms, &parameters, hats.count, against);
        for (axis, parameters) in parameters.iter().enumerate() {
            let own: Vec<&White> =
                parameters.iter().flat_map(|k| &columns[k * hats.count..(k + 1) * hats.count]).collect();
            let mut rows = DMatrix::zeros(own.len(), problem.rows);
            for (place, column) in own.iter().enumerate() {
                if let Some(column) = &column[axis] {
                    rows.row_mut(place).iter_mut().zip(column).for_each(|(value, own)| *value = *own as f32);
                }
            }
            let some = rows.as_slice().chunks((own.len() * ROWS_AT_ONCE).max(1));
            for (first, rows) in (0..).step_by(ROWS_AT_ONCE).zip(some) {
                products.axes[axis].add((rows, &(0..hats.count)), (against, axis), first);
            }
        }
        Some((Cow::Owned(taking.forms), products))
    }

    /// With nothing in it yet; `parameters` are those that act on each axis.
    fn empty(forms: &[Form], parameters: &[Vec<usize>; 6], hats: usize, against: &Against) -> Self {
        let mut next = 0;
        let ranges: Vec<Range<usize>> = forms
            .iter()
            .map(|form| {
                let first = next;
                next += form.channel.amplitudes();
                first..next
            })
            .collect();
        let axes = std::array::from_fn(|axis| {
            let own = &parameters[axis];
            let of_form = |(form, range): (usize, &Range<usize>)| {
                let first = own.iter().position(|parameter| range.contains(parameter))?;
                let count = own.iter().filter(|parameter| range.contains(parameter)).count();
                Some(OfForm {
                    form,
                    parameters: first..first + count,
                    first: own[first] - range.start,
                    gram: DMatrix::zeros(count * hats, count * hats),
                })
            };
            OfAxis {
                hats,
                forms: ranges.iter().enumerate().filter_map(of_form).collect(),
                against: DMatrix::zeros(against.count(axis), own.len() * hats),
            }
        });
        Self { axes, hats, parameters: ranges }
    }

    /// Adds rows from what was formed once.
    fn add_formed(
        &mut self,
        (problem, against): (&Problem<'_>, &Against),
        signals: &[TermSignals],
        quantity: &[QuantitySignal],
        hats: EvenHats,
    ) {
        let parameters = self.axes.each_ref().map(|axis| axis.against.ncols() / self.hats);
        // Those of a part of a flight, behind those before that they are predicted from.
        let mut rows: [Vec<f32>; 6] = Default::default();
        for ((flight, range), (signals, quantity)) in
            problem.ranges().enumerate().zip(signals.iter().zip(quantity))
        {
            let mut parts = signals.times_hats(quantity, hats);
            let mut first = 0;
            while let Some(SomeRows { past, count, hats }) =
                parts.next_rows([ROWS_AT_ONCE, whitening::ORDER], &mut rows)
            {
                for (axis, (rows, parameters)) in rows.iter_mut().zip(parameters).enumerate() {
                    let width = parameters * hats.len();
                    problem.whiten_rows((flight, axis), (&mut *rows, width), (past, first));
                    let behind = (&rows[past * width..], &hats);
                    self.axes[axis].add(behind, (against, axis), range.start + first);
                }
                first += count;
            }
        }
    }

    /// Those of one form, hat by hat.
    pub(crate) fn of(&self, form: usize, against: &Against) -> Products {
        let size = self.parameters[form].len() * self.hats;
        let mut gram = DMatrix::zeros(size, size);
        let mut with = DMatrix::zeros(size, against.taken + against.residuals);
        for (axis, of_basis) in self.axes.iter().zip(&against.of_basis) {
            let Some(own) = axis.forms.iter().find(|own| own.form == form) else { continue };
            let (first, width) = (own.first * self.hats, own.parameters.len() * self.hats);
            let mut block = gram.view_mut((first, first), (width, width));
            block.zip_apply(&own.gram, |sum, own| *sum += f64::from(own));
            let places = of_basis.iter().copied().chain(against.taken..against.taken + against.residuals);
            let columns = axis.against.columns(own.parameters.start * self.hats, width);
            for (row, place) in columns.row_iter().zip(places) {
                let mut sum = with.view_mut((first, place), (width, 1));
                sum.iter_mut().zip(row.iter()).for_each(|(sum, own)| *sum += f64::from(*own));
            }
        }
        Products { gram, against: with }
    }
}

impl OfAxis {
    /// Adds rows of some hats, one value after the other, the first of them row `first` of all.
    fn add(
        &mut self,
        (rows, hats): (&[f32], &Range<usize>),
        (against, axis): (&Against, usize),
        first: usize,
    ) {
        let width = self.against.ncols() / self.hats * hats.len();
        if width == 0 {
            return;
        }
        let all = Columns { rows, width, first: 0, count: width };
        let sums = products(all, against.rows(axis, first..first + rows.len() / width));
        for parameter in 0..width / hats.len() {
            let mut own = self.against.columns_mut(parameter * self.hats + hats.start, hats.len());
            own += sums.columns(parameter * hats.len(), hats.len());
        }
        for form in &mut self.forms {
            let (start, count) = (form.parameters.start * hats.len(), form.parameters.len() * hats.len());
            let columns = Columns { first: start, count, ..all };
            let sums = products(columns, columns);
            let size = (hats.len(), hats.len());
            let own = 0..form.parameters.len();
            for (row, column) in own.clone().flat_map(|row| own.clone().map(move |column| (row, column))) {
                let at = |k: usize| k * self.hats + hats.start;
                let mut own = form.gram.view_mut((at(row), at(column)), size);
                own += sums.view((row * hats.len(), column * hats.len()), size);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use sysid::Prepared;

    use super::*;
    use crate::discovery::center::About;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Rows some at a time, from what is formed once, and whole columns: the same products.
    #[test]
    fn products_of_rows_some_at_a_time_are_those_of_whole_columns() {
        let model = truth();
        let flights = prepared(&model, 30..32, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        assert!(problem.rows > 2 * ROWS_AT_ONCE);
        let against = Against::new(&problem, &[]);
        let variables = Variable::all(&flights, &model);
        let center = |about| Center { about, place_ned_m: [0.3, -0.2, -0.9] };
        let centers = [About::Axis, About::Around].map(center);
        let in_room = InRoom::new(&problem);
        let distance = Variable::distance_from(&variables, centers[0]).unwrap();
        let height = variables.iter().position(|variable| variable.name == "height").unwrap();
        let ways = Channel::all(&model).into_iter().chain([Channel::Horizontal]);
        let forms: Vec<Form> = ways
            .filter(|channel| !channel.is_each_rotor())
            .map(|channel| Form { channel, factors: Vec::new() })
            .collect();
        let cases = [
            (Bases::new(&problem, forms, &variables), Quantities::new(&problem, &variables), height),
            (
                Bases::about((&problem, in_room.as_ref()), &centers, &variables),
                Quantities::from_center(in_room.as_ref(), centers[0], distance),
                distance,
            ),
        ];
        for (bases, quantities, variable) in cases {
            let span = match variable {
                own if own == distance => variables[own].flown().distances(centers[0]),
                own => variables[own].span,
            };
            let hats = EvenHats { ends: [span.low, span.high], count: 9 };
            let products = |bases: &Bases<'_>| {
                let over = (&quantities, variable);
                let (forms, products) = CrossProducts::new((&problem, &against), bases, over, hats).unwrap();
                (0..forms.len()).map(|form| products.of(form, &against)).collect::<Vec<_>>()
            };
            assert!(bases.signals.is_some());
            let columns = Bases { signals: None, forms: bases.forms.clone(), variables: &variables };
            for (some, whole) in products(&bases).iter().zip(products(&columns)) {
                assert!((&some.gram - &whole.gram).amax() < 1e-6 * whole.gram.amax());
                assert!((&some.against - &whole.against).amax() < 1e-6 * whole.gram.amax().sqrt());
            }
        }
    }
}
