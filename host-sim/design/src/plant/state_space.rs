//! Linear systems in state space, and networks of them.
//!
//! Loops are put together from state-space blocks rather than from polynomials: at 100 Hz the poles
//! of all slow filters crowd near z = 1, where the roots of a polynomial of degree 12 lose half
//! their digits and eigenvalues do not. One type serves both time domains; `period_s` says which.
//!
//! Not here: anything about quadcopters.

use nalgebra::{Complex, DMatrix, DVector};

use crate::error::{DesignError, Result};

/// `x' = A x + B u` (or `x[k+1]` of it), `y = C x + D u`.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// States by states.
    pub a: DMatrix<f64>,
    /// States by inputs.
    pub b: DMatrix<f64>,
    /// Outputs by states.
    pub c: DMatrix<f64>,
    /// Outputs by inputs.
    pub d: DMatrix<f64>,
    /// Sample time in s; absent: continuous time.
    pub period_s: Option<f64>,
}

impl StateSpace {
    /// A constant gain.
    pub fn gain(gain: f64, period_s: Option<f64>) -> Self {
        Self {
            a: DMatrix::zeros(0, 0),
            b: DMatrix::zeros(0, 1),
            c: DMatrix::zeros(1, 0),
            d: DMatrix::from_element(1, 1, gain),
            period_s,
        }
    }

    /// A proper transfer function with coefficients in descending powers of s (or z), in
    /// controllable canonical form. The numerator may be shorter than the denominator.
    pub fn transfer(numerator: &[f64], denominator: &[f64], period_s: Option<f64>) -> Self {
        let order = denominator.len() - 1;
        let lead = denominator[0];
        // Ascending, padded to the denominator's length.
        let numerator: Vec<f64> = std::iter::repeat_n(0.0, denominator.len() - numerator.len())
            .chain(numerator.iter().copied())
            .rev()
            .map(|x| x / lead)
            .collect();
        let denominator: Vec<f64> = denominator.iter().rev().map(|x| x / lead).collect();
        let direct = numerator[order];
        let mut a = DMatrix::zeros(order, order);
        let mut b = DMatrix::zeros(order, 1);
        for i in 0..order {
            if i + 1 < order {
                a[(i, i + 1)] = 1.0;
            }
            a[(order - 1, i)] = -denominator[i];
        }
        if order > 0 {
            b[(order - 1, 0)] = 1.0;
        }
        let c = DMatrix::from_fn(1, order, |_, i| numerator[i] - direct * denominator[i]);
        Self { a, b, c, d: DMatrix::from_element(1, 1, direct), period_s }
    }

    /// A delay of whole samples.
    pub fn delay(samples: usize, period_s: f64) -> Self {
        let mut denominator = vec![0.0; samples + 1];
        denominator[0] = 1.0;
        Self::transfer(&[1.0], &denominator, Some(period_s))
    }

    /// Number of states.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// Poles: eigenvalues of A, those nearest to instability first.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>> {
        let mut poles = eigenvalues(&self.a)?;
        let badness = |p: &Complex<f64>| if self.period_s.is_some() { p.norm() } else { p.re };
        poles.sort_by(|p, q| badness(q).total_cmp(&badness(p)).then(q.im.total_cmp(&p.im)));
        Ok(poles)
    }

    /// Whether every pole is strictly stable.
    pub fn is_stable(&self) -> Result<bool> {
        let inside = |p: &Complex<f64>| if self.period_s.is_some() { p.norm() < 1.0 } else { p.re < 0.0 };
        Ok(self.poles()?.iter().all(inside))
    }

    /// Response at a frequency in rad/s from one input to one output; not finite on a pole.
    pub fn response(&self, frequency_rad_s: f64, output: usize, input: usize) -> Complex<f64> {
        self.at(point(self.period_s, frequency_rad_s), output, input)
    }

    /// The transfer function from one input to one output at a point of the plane of s (or z); not
    /// finite on a pole.
    pub fn at(&self, point: Complex<f64>, output: usize, input: usize) -> Complex<f64> {
        let direct = Complex::new(self.d[(output, input)], 0.0);
        if self.order() == 0 {
            return direct;
        }
        let matrix = DMatrix::from_fn(self.order(), self.order(), |i, j| {
            let diagonal = if i == j { point } else { Complex::new(0.0, 0.0) };
            diagonal - self.a[(i, j)]
        });
        let column = DVector::from_fn(self.order(), |i, _| Complex::new(self.b[(i, input)], 0.0));
        match matrix.lu().solve(&column) {
            Some(state) => {
                direct
                    + state.iter().zip(self.c.row(output).iter()).map(|(x, c)| x * *c).sum::<Complex<f64>>()
            }
            None => Complex::new(f64::INFINITY, 0.0),
        }
    }

    /// This path made ready for many frequencies: a response then costs the order, not its cube.
    ///
    /// With c (zI - A)^-1 b = det(zI - A + b c) / det(zI - A) - 1, all that is needed are the
    /// eigenvalues of A and of A - b c. Eigenvalues of a delay are poor one by one, but their
    /// products are those of a matrix as near to A as rounding.
    pub fn sweep(&self, output: usize, input: usize) -> Result<Sweep> {
        let b = self.b.column(input).into_owned();
        let c = self.c.row(output).into_owned();
        // Of equal size, so that neither drowns in A nor A in them.
        let size = (b.norm() * c.norm()).max(f64::MIN_POSITIVE);
        Ok(Sweep {
            poles: eigenvalues(&self.a)?,
            closed: eigenvalues(&(&self.a - &b * &c / size))?,
            size,
            direct: self.d[(output, input)],
            period_s: self.period_s,
        })
    }

    /// Samples of the output at multiples of `step_s` for inputs held over each step; the first is
    /// at rest.
    ///
    /// A sampled system is stepped as it is and `step_s` must be its period; a continuous one is
    /// discretised exactly.
    pub fn simulate(&self, step_s: f64, input: impl Fn(usize) -> f64, count: usize) -> Result<Vec<f64>> {
        let system = if self.period_s.is_some() { self.clone() } else { self.sampled(step_s, 0.0)? };
        let mut state = DVector::zeros(system.order());
        let mut outputs = Vec::with_capacity(count);
        for k in 0..count {
            let u = input(k);
            outputs.push((&system.c * &state)[0] + system.d[(0, 0)] * u);
            state = &system.a * state + system.b.column(0) * u;
        }
        Ok(outputs)
    }

    /// What a sampler sees of a continuous system whose inputs are held over each period
    /// (zero-order hold) and come `input_delay_s` late. Exact, by the matrix exponential.
    pub fn sampled(&self, period_s: f64, input_delay_s: f64) -> Result<Self> {
        let order = self.order();
        let inputs = self.b.ncols();
        let hold = |time_s: f64| -> (DMatrix<f64>, DMatrix<f64>) {
            let mut whole = DMatrix::zeros(order + inputs, order + inputs);
            whole.view_mut((0, 0), (order, order)).copy_from(&(&self.a * time_s));
            whole.view_mut((0, order), (order, inputs)).copy_from(&(&self.b * time_s));
            let exponential = whole.exp();
            (
                exponential.view((0, 0), (order, order)).into_owned(),
                exponential.view((0, order), (order, inputs)).into_owned(),
            )
        };
        let whole_periods = (input_delay_s / period_s + 1e-9).floor();
        let late_s = (input_delay_s - whole_periods * period_s).max(0.0);
        let (transition, full) = hold(period_s);
        let plain = if late_s < 1e-9 * period_s {
            Self { a: transition, b: full, c: self.c.clone(), d: self.d.clone(), period_s: Some(period_s) }
        } else {
            if self.d.iter().any(|d| *d != 0.0) {
                return Err(DesignError::Numerics("the dead time of a system with direct feedthrough"));
            }
            // The old command acts for `late_s`, then the new one: a state more for each input
            // remembers the old one.
            let (rest, new) = hold(period_s - late_s);
            let (_, old) = hold(late_s);
            let old = rest * old;
            let mut a = DMatrix::zeros(order + inputs, order + inputs);
            a.view_mut((0, 0), (order, order)).copy_from(&transition);
            a.view_mut((0, order), (order, inputs)).copy_from(&old);
            let mut b = DMatrix::zeros(order + inputs, inputs);
            b.view_mut((0, 0), (order, inputs)).copy_from(&new);
            b.view_mut((order, 0), (inputs, inputs)).fill_with_identity();
            Self {
                a,
                b,
                c: self.c.clone().insert_columns(order, inputs, 0.0),
                d: self.d.clone(),
                period_s: Some(period_s),
            }
        };
        if plain.a.iter().chain(plain.b.iter()).any(|x| !x.is_finite()) {
            return Err(DesignError::Numerics("the matrix exponential"));
        }
        if whole_periods == 0.0 {
            return Ok(plain);
        }
        let mut network = Network::new(Some(period_s));
        let late = network.add(plain);
        let entries = (0..inputs).map(|k| {
            let wait = network.add(Self::delay(whole_periods as usize, period_s));
            network.link(wait.output(0), late.input(k), 1.0);
            vec![(wait.input(0), 1.0)]
        });
        let entries: Vec<_> = entries.collect();
        let outputs: Vec<_> = (0..self.c.nrows()).map(|k| vec![(late.output(k), 1.0)]).collect();
        network.close(&entries, &outputs)
    }

    /// This system's first output into the first input of `next`.
    pub fn then(&self, next: &Self) -> Result<Self> {
        let mut network = Network::new(self.period_s);
        let (first, second) = (network.add(self.clone()), network.add(next.clone()));
        network.link(first.output(0), second.input(0), 1.0);
        let outputs: Vec<_> = (0..next.c.nrows()).map(|k| vec![(second.output(k), 1.0)]).collect();
        network.close(&[vec![(first.input(0), 1.0)]], &outputs)
    }
}

/// The point of the plane of s (or z) that a frequency in rad/s stands for.
fn point(period_s: Option<f64>, frequency_rad_s: f64) -> Complex<f64> {
    match period_s {
        None => Complex::new(0.0, frequency_rad_s),
        Some(period_s) => Complex::from_polar(1.0, frequency_rad_s * period_s),
    }
}

/// One path through a system, to be evaluated at many frequencies.
#[derive(Debug, Clone)]
pub struct Sweep {
    poles: Vec<Complex<f64>>,
    /// Poles with the path's output, over its size, taken off its input.
    closed: Vec<Complex<f64>>,
    size: f64,
    direct: f64,
    period_s: Option<f64>,
}

impl Sweep {
    /// The response at a frequency in rad/s; not finite on a pole.
    pub fn response(&self, frequency_rad_s: f64) -> Complex<f64> {
        let at = point(self.period_s, frequency_rad_s);
        let ratio: Complex<f64> =
            self.closed.iter().zip(&self.poles).map(|(closed, pole)| (at - closed) / (at - pole)).product();
        (ratio - 1.0) * self.size + self.direct
    }
}

/// Eigenvalues of a real matrix, after balancing.
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>> {
    if matrix.nrows() == 0 {
        return Ok(Vec::new());
    }
    if matrix.iter().any(|x| !x.is_finite()) {
        return Err(DesignError::Numerics("eigenvalues"));
    }
    let mut balanced = matrix.clone();
    nalgebra::linalg::balancing::balance_parlett_reinsch(&mut balanced);
    // The iteration converges in a few steps an eigenvalue, or not at all.
    let schur = nalgebra::linalg::Schur::try_new(balanced, f64::EPSILON, 1000 * matrix.nrows())
        .ok_or(DesignError::Numerics("eigenvalues"))?;
    Ok(schur.complex_eigenvalues().iter().copied().collect())
}

/// A block of a [`Network`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    first_input: usize,
    first_output: usize,
}

/// An input of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Input(usize);

/// An output of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output(usize);

impl Block {
    /// Its input of this index.
    pub fn input(self, index: usize) -> Input {
        Input(self.first_input + index)
    }

    /// Its output of this index.
    pub fn output(self, index: usize) -> Output {
        Output(self.first_output + index)
    }
}

/// Blocks and the signals between them. Signals that meet at an input add up.
#[derive(Debug, Clone)]
pub struct Network {
    period_s: Option<f64>,
    blocks: Vec<StateSpace>,
    inputs: usize,
    outputs: usize,
    links: Vec<(Output, Input, f64)>,
}

impl Network {
    /// A network without blocks, in continuous time or with a sample time in s.
    pub fn new(period_s: Option<f64>) -> Self {
        Self { period_s, blocks: Vec::new(), inputs: 0, outputs: 0, links: Vec::new() }
    }

    /// Sample time in s; absent: continuous time.
    pub fn period_s(&self) -> Option<f64> {
        self.period_s
    }

    /// Adds a block.
    pub fn add(&mut self, system: StateSpace) -> Block {
        debug_assert!(system.period_s == self.period_s || system.order() == 0);
        let block = Block { first_input: self.inputs, first_output: self.outputs };
        self.inputs += system.b.ncols();
        self.outputs += system.c.nrows();
        self.blocks.push(system);
        block
    }

    /// Leads an output to an input with a gain.
    pub fn link(&mut self, from: Output, to: Input, gain: f64) {
        self.links.push((from, to, gain));
    }

    /// The whole as one system: each input of it is a sum of block inputs, each output a sum of
    /// block outputs.
    pub fn close(&self, inputs: &[Vec<(Input, f64)>], outputs: &[Vec<(Output, f64)>]) -> Result<StateSpace> {
        let order: usize = self.blocks.iter().map(StateSpace::order).sum();
        let (mut a, mut b) = (DMatrix::zeros(order, order), DMatrix::zeros(order, self.inputs));
        let (mut c, mut d) = (DMatrix::zeros(self.outputs, order), DMatrix::zeros(self.outputs, self.inputs));
        let (mut state, mut input, mut output) = (0, 0, 0);
        for block in &self.blocks {
            let (n, m, p) = (block.order(), block.b.ncols(), block.c.nrows());
            a.view_mut((state, state), (n, n)).copy_from(&block.a);
            b.view_mut((state, input), (n, m)).copy_from(&block.b);
            c.view_mut((output, state), (p, n)).copy_from(&block.c);
            d.view_mut((output, input), (p, m)).copy_from(&block.d);
            (state, input, output) = (state + n, input + m, output + p);
        }
        let mut feedback = DMatrix::zeros(self.inputs, self.outputs);
        for (from, to, gain) in &self.links {
            feedback[(to.0, from.0)] += gain;
        }
        let mut entry = DMatrix::zeros(self.inputs, inputs.len());
        for (column, parts) in inputs.iter().enumerate() {
            for (to, gain) in parts {
                entry[(to.0, column)] += gain;
            }
        }
        let mut exit = DMatrix::zeros(outputs.len(), self.outputs);
        for (row, parts) in outputs.iter().enumerate() {
            for (from, gain) in parts {
                exit[(row, from.0)] += gain;
            }
        }
        // u = F y + E r and y = C x + D u, so u = (I - F D)^-1 (F C x + E r).
        let loops = (DMatrix::identity(self.inputs, self.inputs) - &feedback * &d)
            .try_inverse()
            .ok_or(DesignError::Numerics("an algebraic loop"))?;
        let (from_state, from_entry) = (&loops * &feedback * &c, &loops * entry);
        Ok(StateSpace {
            a: &a + &b * &from_state,
            b: &b * &from_entry,
            c: &exit * (&c + &d * from_state),
            d: &exit * &d * from_entry,
            period_s: self.period_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transfer_function_responds_as_its_fraction() {
        let system = StateSpace::transfer(&[2.0, 3.0, 5.0], &[2.0, 7.0, 11.0, 13.0], None);
        for w in [0.1, 1.0, 30.0] {
            let s = Complex::new(0.0, w);
            let want = (s * s * 2.0 + s * 3.0 + 5.0) / (s * s * s * 2.0 + s * s * 7.0 + s * 11.0 + 13.0);
            // Rounding of a 3 x 3 solve.
            assert!((system.response(w, 0, 0) - want).norm() < 1e-14 * want.norm().max(1.0), "{w}");
        }
        let biproper = StateSpace::transfer(&[3.0, 1.0], &[1.0, 4.0], None);
        assert!((biproper.response(0.0, 0, 0).re - 0.25).abs() < 1e-15);
    }

    /// A sweep is another way to the same number: against the plain solve, on a delay (which no
    /// eigenvectors span), a filter and a resonance in a row.
    #[test]
    fn a_sweep_gives_the_response() {
        let period = Some(0.01);
        let resonance = StateSpace::transfer(&[0.1, 0.2], &[1.0, -1.9, 0.95], period);
        let row = StateSpace::delay(4, 0.01).then(&resonance).unwrap();
        let row = row.then(&StateSpace::transfer(&[1.0, -0.3], &[1.0, -0.8], period)).unwrap();
        let sweep = row.sweep(0, 0).unwrap();
        for w in [0.02, 1.0, 20.0, 314.0] {
            let (fast, plain) = (sweep.response(w), row.response(w, 0, 0));
            // The resonance at 0.22 lies near z = 1, so that rounding grows by a thousand.
            assert!((fast - plain).norm() < 1e-11 * plain.norm(), "{w}: {fast} {plain}");
        }
    }

    #[test]
    fn feedback_of_an_integrator_is_a_lag() {
        let mut network = Network::new(None);
        let integrator = network.add(StateSpace::transfer(&[1.0], &[1.0, 0.0], None));
        let gain = network.add(StateSpace::gain(4.0, None));
        network.link(integrator.output(0), gain.input(0), -1.0);
        network.link(gain.output(0), integrator.input(0), 1.0);
        let closed =
            network.close(&[vec![(gain.input(0), 1.0)]], &[vec![(integrator.output(0), 1.0)]]).unwrap();
        assert_eq!(closed.poles().unwrap(), [Complex::new(-4.0, 0.0)]);
        let step = closed.simulate(0.1, |_| 1.0, 11).unwrap();
        // The closed form at 1 s; rounding of the exponential.
        assert!((step[10] - (1.0 - (-4.0_f64).exp())).abs() < 1e-14);
    }

    /// A double integrator behind a hold and a dead time of 1.3 periods, against its closed form:
    /// after the command has stood for t - 0.013 s the output is half the square of that.
    #[test]
    fn dead_time_between_samples_is_exact() {
        let plant = StateSpace::transfer(&[1.0], &[1.0, 0.0, 0.0], None);
        let sampled = plant.sampled(0.01, 0.013).unwrap();
        let response = sampled.simulate(0.01, |_| 1.0, 6).unwrap();
        for (k, value) in response.iter().enumerate() {
            let t = (0.01 * k as f64 - 0.013).max(0.0);
            assert!((value - 0.5 * t * t).abs() < 1e-16, "{k}: {value}");
        }
    }

    #[test]
    fn a_delay_shifts_by_whole_samples() {
        for samples in [0, 1, 3] {
            let response = StateSpace::delay(samples, 0.01).simulate(0.01, |k| k as f64 + 1.0, 6).unwrap();
            for (k, value) in response.iter().enumerate() {
                let want = if k >= samples { (k - samples) as f64 + 1.0 } else { 0.0 };
                assert_eq!(*value, want, "{samples} {k}");
            }
        }
    }

    #[test]
    fn an_algebraic_loop_is_an_error() {
        let mut network = Network::new(None);
        let gain = network.add(StateSpace::gain(1.0, None));
        network.link(gain.output(0), gain.input(0), 1.0);
        assert!(network.close(&[vec![(gain.input(0), 1.0)]], &[vec![(gain.output(0), 1.0)]]).is_err());
    }
}
