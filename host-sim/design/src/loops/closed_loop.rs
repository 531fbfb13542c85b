//! The loops of the law that flies, closed around the channels of a linear model.
//!
//! One network serves all loops: plant, delay, velocity estimator, proportional-integral part, canceller, prefilter, and
//! for x and y the position loop around it. What differs between the two views is what a block is made of:
//!
//! - [`View::Continuous`]: as the thesis designs. Roll and pitch have the velocity estimator (5.5); in the yaw and altitude
//!   loops (5.3.2) and around the position loops (5.4) a pure derivative stands for it. No sampling, no delay.
//! - [`View::Sampled`]: as the law flies. The plant is held over each period, every filter is the matched-Z one of crate
//!   `control`, the integrator is backward Euler, the pose comes whole samples late, and so does the rotor command if the
//!   model has a dead time. A gyro, where the law uses one, is not late.
//!
//! Signs: every loop is written so that a positive output moves its variable up. Altitude takes thrust away for z (down),
//! and a positive pitch pushes along -x; both are turned round here, as they are in the law.

use control::filter::{FirstOrder, SecondOrder};
use control::gains::{Complement, Config, Estimation, InnerLoop, Law, Loops, Mixing, PositionLoop};
use control::mixer;
use model::Model;
use nalgebra::{Complex, DMatrix, Matrix4};

use crate::error::{DesignError, Result};
use crate::linear::{
    CANCEL_TOLERANCE, CHANNELS, Channel, ChannelId, Linear, MatrixB, polynomial, sign_matrix,
};
use crate::state_space::{Block, Input, Network, Output, StateSpace};

/// A loop of the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LoopName {
    /// Roll angle.
    Roll,
    /// Pitch angle.
    Pitch,
    /// Yaw angle.
    Yaw,
    /// Altitude (inertial z).
    Z,
    /// Position along x, around pitch.
    X,
    /// Position along y, around roll.
    Y,
}

/// All loops, inner before outer.
pub const LOOPS: [LoopName; 6] =
    [LoopName::Roll, LoopName::Pitch, LoopName::Yaw, LoopName::Z, LoopName::X, LoopName::Y];

impl LoopName {
    /// The word for it in JSON and on pages.
    pub const fn name(self) -> &'static str {
        self.channel().name
    }

    /// The channel from the actuator to what the loop controls.
    pub const fn channel(self) -> ChannelId {
        CHANNELS[self as usize]
    }

    /// The inner loop that an outer one goes around.
    pub const fn inner(self) -> Self {
        match self {
            Self::X => Self::Pitch,
            Self::Y => Self::Roll,
            other => other,
        }
    }

    /// Whether this is a position loop around an attitude loop.
    pub const fn is_outer(self) -> bool {
        matches!(self, Self::X | Self::Y)
    }

    /// Unit of what it controls.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Roll | Self::Pitch | Self::Yaw => "rad",
            Self::Z | Self::X | Self::Y => "m",
        }
    }

    /// +1 where more of the actuator moves the controlled variable up.
    const fn sign(self) -> f64 {
        match self {
            Self::Z | Self::X => -1.0,
            _ => 1.0,
        }
    }
}

impl std::fmt::Display for LoopName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// How the loops are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// As the thesis designs: continuous, without delay.
    Continuous,
    /// As the law flies, with a pose that is this many samples old.
    Sampled {
        /// Age of the pose, samples.
        delay_samples: usize,
    },
}

/// A plant's place between the law's output and what the law measures.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopPlant {
    /// Continuous; one input (the law's output); outputs: controlled variable of the inner loop, its rate, and for an
    /// outer loop position and velocity.
    pub system: StateSpace,
    /// Dead time between command and rotor, s.
    pub input_delay_s: f64,
    /// What was approximated on the way here.
    pub notes: Vec<String>,
}

/// The gains of the loops.
pub fn loops_of(config: &Config) -> &Loops {
    match &config.law {
        Law::ModelBased(law) => &law.loops,
        Law::HandTuned(law) => &law.loops,
    }
}

/// The gains of the loops, to change.
pub fn loops_of_mut(config: &mut Config) -> &mut Loops {
    match &mut config.law {
        Law::ModelBased(law) => &mut law.loops,
        Law::HandTuned(law) => &mut law.loops,
    }
}

/// The gains of an inner loop.
pub fn inner_gains(loops: &Loops, name: LoopName) -> &InnerLoop {
    match name.inner() {
        LoopName::Roll | LoopName::Y => &loops.roll,
        LoopName::Pitch | LoopName::X => &loops.pitch,
        LoopName::Yaw => &loops.yaw,
        LoopName::Z => &loops.altitude,
    }
}

/// The gains of an inner loop, to change.
pub fn inner_gains_mut(loops: &mut Loops, name: LoopName) -> &mut InnerLoop {
    match name.inner() {
        LoopName::Roll | LoopName::Y => &mut loops.roll,
        LoopName::Pitch | LoopName::X => &mut loops.pitch,
        LoopName::Yaw => &mut loops.yaw,
        LoopName::Z => &mut loops.altitude,
    }
}

/// The gains of an outer loop.
pub fn outer_gains(loops: &Loops, name: LoopName) -> Option<&PositionLoop> {
    match name {
        LoopName::X => Some(&loops.x),
        LoopName::Y => Some(&loops.y),
        _ => None,
    }
}

/// What thrust and angular accelerations come of the law's four outputs (thrust, roll, pitch, yaw) about hover at a battery
/// voltage: the law's own mixing and motor map on one side, the model's on the other. The identity where both agree.
pub fn law_effect(model: &Model, linear: &Linear, config: &Config, battery_v: f64) -> Result<Matrix4<f64>> {
    let plant = model::Plant::new(model);
    let rotor = linear.equilibrium.rotor_rad_s;
    let effort_by_speed = Matrix4::from_fn(|i, j| linear.effectiveness[(i, j)] * 2.0 * rotor[j]);
    let numerics = DesignError::Numerics("the law's motor map at hover");
    let speeds_by_output = match &config.law {
        Law::ModelBased(law) => {
            let map = &law.motor_map;
            let (speed, offset) = match map.inverse {
                Some(inverse) => (inverse.speed, inverse.voltage * battery_v + inverse.offset),
                None => (1.0 / map.command, -(map.voltage * battery_v + map.offset) / map.command),
            };
            let flown = |asked: f64| plant.commanded_rad_s(&[speed * asked + offset; 4], battery_v)[0];
            let inverse_mixing = inverse_mixing(&law.mixing)?;
            let mut rows = Matrix4::zeros();
            for i in 0..4 {
                // The map is affine where the motor turns, so two points give it exactly.
                let slope = flown(rotor[i] + 1.0) - flown(rotor[i]);
                let asked = rotor[i] + (rotor[i] - flown(rotor[i])) / slope;
                if !(slope > 0.0 && asked > 0.0) {
                    return Err(numerics);
                }
                for j in 0..4 {
                    rows[(i, j)] = slope * inverse_mixing[i][j] / (2.0 * asked);
                }
            }
            rows
        }
        Law::HandTuned(_) => {
            let command = plant.command_for(&rotor, battery_v);
            let flown = |by: f64| plant.commanded_rad_s(&command.map(|c| c + by), battery_v);
            let (more, less) = (flown(1.0), flown(-1.0));
            let signs = sign_matrix();
            Matrix4::from_fn(|i, j| 0.5 * (more[i] - less[i]) * signs[(i, j)])
        }
    };
    let effect = effort_by_speed * speeds_by_output;
    if effect.iter().all(|x| x.is_finite()) { Ok(effect) } else { Err(numerics) }
}

/// The inverse mixing matrix that a law flies with.
pub(crate) fn inverse_mixing(mixing: &Mixing) -> Result<[[f64; 4]; 4]> {
    let invert = |matrix: &[[f64; 4]; 4]| {
        mixer::inverse(matrix).map_err(|_| DesignError::Numerics("the inverse of the law's mixing matrix"))
    };
    match mixing {
        Mixing::Inverse(inverse) => Ok(*inverse),
        Mixing::Matrix(matrix) => invert(matrix),
        Mixing::Coefficients(coefficients) => invert(&mixer::effectiveness(coefficients)),
    }
}

impl LoopPlant {
    /// The plant of a loop in a linear model, driven by the law through `effect` ([`law_effect`]).
    pub fn new(linear: &Linear, effect: &Matrix4<f64>, name: LoopName, tolerance: f64) -> Result<Self> {
        let b: MatrixB = linear.proper_b() * effect;
        let inner = name.inner().channel();
        let column = b.column(inner.input).into_owned();
        let (angle, mut notes) = uncrossed(linear, &column, inner, tolerance)?;
        let motion = if name.is_outer() {
            let (position, more) = uncrossed(linear, &column, name.channel(), tolerance)?;
            notes.extend(more);
            match one_integrator_more(&angle, &position) {
                true => Self::of_channels(&angle, Some(&position), name)?,
                // Something holds the craft to a place (a tether), or the position's channel is not that of the angle.
                false => alone(linear, &column, name),
            }
        } else {
            Self::of_channels(&angle, None, name)?
        };
        let system = match linear.motor_lag_rad_s {
            Some(lag) => StateSpace::transfer(&[lag], &[1.0, lag], None).then(&motion)?,
            None => motion,
        };
        Ok(Self { system, input_delay_s: linear.input_delay_s, notes })
    }

    /// A plant given by its transfer function from the law's output (before the rotors' lag, rad/s) to the controlled
    /// variable, with a numerator and denominator in descending powers, and that to the velocity, for tests and appendix A.
    pub fn of_transfer(
        numerator: &[f64],
        denominator: &[f64],
        velocity_numerator: Option<&[f64]>,
        motor_lag_rad_s: Option<f64>,
    ) -> Result<Self> {
        let motion = realised(numerator, denominator, velocity_numerator)?;
        let system = match motor_lag_rad_s {
            Some(lag) => StateSpace::transfer(&[lag], &[1.0, lag], None).then(&motion)?,
            None => motion,
        };
        Ok(Self { system, input_delay_s: 0.0, notes: Vec::new() })
    }

    fn of_channels(angle: &Channel, position: Option<&Channel>, name: LoopName) -> Result<StateSpace> {
        let turned = |mut numerator: Vec<f64>, sign: f64| {
            numerator.iter_mut().for_each(|x| *x *= sign);
            numerator
        };
        let inner = turned(angle.numerator(), name.inner().sign());
        let velocity = position.map(|p| turned(p.numerator(), name.sign()));
        let too_direct = |numerator: &[f64]| numerator.len() > angle.poles.len();
        if too_direct(&inner) || velocity.as_ref().is_some_and(|v| v.len() > angle.poles.len() + 1) {
            return Err(DesignError::Channel {
                channel: name.name(),
                reason: "it has as many zeros as poles".into(),
            });
        }
        realised(&inner, &angle.denominator(), velocity.as_deref())
    }

    /// The plant as the law's sampler sees it, or as it is.
    fn in_view(&self, view: View, period_s: f64) -> Result<StateSpace> {
        match view {
            View::Continuous => Ok(self.system.clone()),
            View::Sampled { .. } => self.system.sampled(period_s, self.input_delay_s),
        }
    }
}

/// Outputs: the variable, its rate, and with a velocity numerator position and velocity.
fn realised(numerator: &[f64], denominator: &[f64], velocity: Option<&[f64]>) -> Result<StateSpace> {
    let base = StateSpace::transfer(numerator, denominator, None);
    let rate = (&base.c * &base.a, &base.c * &base.b);
    let mut rows = vec![(base.c.clone(), base.d.clone()), rate];
    if let Some(velocity) = velocity {
        let velocity = StateSpace::transfer(velocity, denominator, None);
        rows.push((velocity.c, velocity.d));
    }
    let mut wide = base.clone();
    wide.c = DMatrix::from_fn(rows.len(), base.order(), |i, j| rows[i].0[(0, j)]);
    wide.d = DMatrix::from_fn(rows.len(), 1, |i, _| rows[i].1[(0, 0)]);
    if velocity.is_none() {
        return Ok(wide);
    }
    let mut network = Network::new(None);
    let motion = network.add(wide);
    let integrator = network.add(StateSpace::transfer(&[1.0], &[1.0, 0.0], None));
    network.link(motion.output(2), integrator.input(0), 1.0);
    let outputs = [motion.output(0), motion.output(1), integrator.output(0), motion.output(2)];
    network.close(&[vec![(motion.input(0), 1.0)]], &outputs.map(|o| vec![(o, 1.0)]))
}

/// Whether the position's poles are the angle's and one integrator.
fn one_integrator_more(angle: &Channel, position: &Channel) -> bool {
    let mut left: Vec<Complex<f64>> = position.poles.clone();
    for pole in &angle.poles {
        let near = |other: &Complex<f64>| (other - pole).norm() <= 1e-6 * pole.norm().max(1.0);
        match left.iter().position(near) {
            Some(at) => drop(left.swap_remove(at)),
            None => return false,
        }
    }
    matches!(left.as_slice(), [last] if last.norm() < 1e-6)
}

/// The channel that the loop of an axis is closed around.
pub fn axis_channel(linear: &Linear, name: LoopName) -> Result<Channel> {
    let id = name.channel();
    let column = linear.proper_b().column(id.input).into_owned();
    Ok(uncrossed(linear, &column, id, CANCEL_TOLERANCE)?.0)
}

/// A channel, and what was approximated. Where other axes leave it poles that no zero takes away (a craft that hovers
/// leaning against wind is coupled in all axes), it is taken by itself: its own loop cannot move those poles, and that
/// the loops hold them together is for [`together`] to say.
fn uncrossed(
    linear: &Linear,
    column: &nalgebra::SVector<f64, 12>,
    id: ChannelId,
    tolerance: f64,
) -> Result<(Channel, Vec<String>)> {
    let (whole, own) =
        (Channel::new(&linear.a, column, id, tolerance)?, Channel::alone(&linear.a, column, id, tolerance)?);
    if whole.poles.len() <= own.poles.len() {
        let notes = cancellation_notes(&whole);
        return Ok((whole, notes));
    }
    let note = format!(
        "{}: taken by itself; at this equilibrium other axes add {} poles to its transfer function, which the loops hold together",
        id.name,
        whole.poles.len() - own.poles.len()
    );
    Ok((own, vec![note]))
}

/// The axis by itself: position, velocity, angle, rate.
fn alone(linear: &Linear, column: &nalgebra::SVector<f64, 12>, name: LoopName) -> StateSpace {
    let kept: [usize; 4] = if name == LoopName::X { [0, 3, 7, 10] } else { [1, 4, 6, 9] };
    let a = DMatrix::from_fn(4, 4, |i, j| linear.a[(kept[i], kept[j])]);
    let b = DMatrix::from_fn(4, 1, |i, _| column[kept[i]]);
    let mut pick = DMatrix::zeros(2, 4);
    pick[(0, 2)] = 1.0;
    pick[(1, 0)] = name.sign();
    let rate = &pick * &a;
    let c = DMatrix::from_fn(4, 4, |i, j| if i % 2 == 0 { pick[(i / 2, j)] } else { rate[(i / 2, j)] });
    StateSpace { a, b, c, d: DMatrix::zeros(4, 1), period_s: None }
}

fn cancellation_notes(channel: &Channel) -> Vec<String> {
    let unstable = channel.cancelled.iter().any(|pair| pair.pole.re > 0.0);
    if !unstable {
        return Vec::new();
    }
    vec![format!(
        "{}: unstable poles that belong to another axis cancel to within {:.2} %; the loop of that axis has to hold them",
        channel.id.name,
        100.0 * channel.cancelled.iter().map(crate::linear::Cancelled::distance).fold(0.0, f64::max)
    )]
}

/// How a rate comes about.
#[derive(Debug, Clone, PartialEq)]
enum Rate {
    /// The plant's own.
    True,
    /// A filter on the measured variable.
    Estimated(StateSpace),
}

/// The blocks of a law in one view.
struct Blocks {
    period_s: Option<f64>,
    delay: StateSpace,
    prefilter: StateSpace,
    proportional_integral: StateSpace,
    canceller: StateSpace,
    rate: Rate,
    /// Low- and high-pass of the complementary filter (4.6).
    fusion: Option<(StateSpace, StateSpace)>,
    kd: f64,
    outer: Option<OuterBlocks>,
}

struct OuterBlocks {
    proportional_integral: StateSpace,
    rate: Rate,
    kd: f64,
}

impl Blocks {
    fn new(config: &Config, name: LoopName, view: View) -> Self {
        let loops = loops_of(config);
        let (gains, outer) = (inner_gains(loops, name), outer_gains(loops, name));
        let (estimation, period_s) = (&config.estimation, config.sample_time_s);
        match view {
            View::Continuous => Self {
                period_s: None,
                delay: StateSpace::gain(1.0, None),
                prefilter: gains.prefilter_rad_s.map_or_else(
                    || StateSpace::gain(1.0, None),
                    |a| StateSpace::transfer(&[a], &[1.0, a], None),
                ),
                proportional_integral: continuous_pi(gains.kp, gains.ki),
                canceller: gains.canceller.map_or_else(
                    || StateSpace::gain(1.0, None),
                    |c| StateSpace::transfer(&[1.0 / c.zero_rad_s, 1.0], &[1.0 / c.pole_rad_s, 1.0], None),
                ),
                rate: match name {
                    LoopName::Roll | LoopName::Pitch => Rate::Estimated(continuous_estimator(estimation)),
                    _ => Rate::True,
                },
                fusion: match name {
                    LoopName::Roll | LoopName::Pitch => estimation.gyro.as_ref().map(|gyro| {
                        let a = gyro.corner_rad_s;
                        (
                            StateSpace::transfer(&[a], &[1.0, a], None),
                            StateSpace::transfer(&[1.0, 0.0], &[1.0, a], None),
                        )
                    }),
                    _ => None,
                },
                kd: gains.kd,
                outer: outer.map(|outer| OuterBlocks {
                    proportional_integral: continuous_pi(outer.kp, outer.ki),
                    rate: Rate::True,
                    kd: outer.kd,
                }),
            },
            View::Sampled { delay_samples } => Self {
                period_s: Some(period_s),
                delay: StateSpace::delay(delay_samples, period_s),
                prefilter: first_order(
                    gains.prefilter_rad_s.map_or(FirstOrder::PASS, |a| FirstOrder::low_pass(a, period_s)),
                    period_s,
                ),
                proportional_integral: sampled_pi(gains.kp, gains.ki, period_s),
                canceller: first_order(
                    gains
                        .canceller
                        .map_or(FirstOrder::PASS, |c| FirstOrder::lag(c.zero_rad_s, c.pole_rad_s, period_s)),
                    period_s,
                ),
                rate: Rate::Estimated(second_order(
                    SecondOrder::velocity_estimator(
                        estimation.velocity.natural_frequency_rad_s,
                        estimation.velocity.damping_ratio,
                        period_s,
                        estimation.gain_rule,
                    ),
                    period_s,
                )),
                // Altitude has no gyro.
                fusion: estimation.gyro.as_ref().filter(|_| name != LoopName::Z).map(|gyro| {
                    let low = FirstOrder::low_pass(gyro.corner_rad_s, period_s);
                    let high = match gyro.complement {
                        Complement::Exact => low.complement(),
                        Complement::MatchedPair => {
                            FirstOrder::high_pass(gyro.corner_rad_s, period_s, estimation.gain_rule)
                        }
                    };
                    (first_order(low, period_s), first_order(high, period_s))
                }),
                kd: gains.kd,
                outer: outer.map(|outer| OuterBlocks {
                    proportional_integral: sampled_pi(outer.kp, outer.ki, period_s),
                    rate: Rate::Estimated(first_order(
                        FirstOrder::derivative(outer.velocity_filter_rad_s, period_s, estimation.gain_rule),
                        period_s,
                    )),
                    kd: outer.kd,
                }),
            },
        }
    }
}

fn continuous_pi(kp: f64, ki: f64) -> StateSpace {
    if ki == 0.0 { StateSpace::gain(kp, None) } else { StateSpace::transfer(&[kp, ki], &[1.0, 0.0], None) }
}

/// `kp + ki Ts z / (z - 1)`: the integral is updated before it is used.
fn sampled_pi(kp: f64, ki: f64, period_s: f64) -> StateSpace {
    let period = Some(period_s);
    if ki == 0.0 {
        return StateSpace::gain(kp, period);
    }
    StateSpace::transfer(&[kp + ki * period_s, -kp], &[1.0, -1.0], period)
}

fn continuous_estimator(estimation: &Estimation) -> StateSpace {
    let (w, zeta) = (estimation.velocity.natural_frequency_rad_s, estimation.velocity.damping_ratio);
    StateSpace::transfer(&[w * w, 0.0], &[1.0, 2.0 * zeta * w, w * w], None)
}

fn first_order(filter: FirstOrder<f64>, period_s: f64) -> StateSpace {
    if filter == FirstOrder::PASS {
        return StateSpace::gain(1.0, Some(period_s));
    }
    StateSpace::transfer(&[filter.b0, filter.b1], &[1.0, filter.a1], Some(period_s))
}

fn second_order(filter: SecondOrder<f64>, period_s: f64) -> StateSpace {
    StateSpace::transfer(&[filter.b0, filter.b1, filter.b2], &[1.0, filter.a1, filter.a2], Some(period_s))
}

/// A loop as systems: closed, and cut open at two places.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoop {
    /// Which.
    pub name: LoopName,
    /// Inputs: reference, disturbance added to the law's output at the actuator. Outputs: controlled variable, law's
    /// output (the angle command of an outer loop).
    pub closed: StateSpace,
    /// What stands before the reference; one for an outer loop, whose rate limit is not linear.
    pub prefilter: StateSpace,
    /// Cut at the error of this loop, velocity feedback and inner loops closed: the loop gain that the thesis judges.
    pub at_error: StateSpace,
    /// Cut at the actuator, everything open: loop gain through the pose, and through the gyro.
    pub at_actuator: StateSpace,
    /// The velocity loop alone, (5.24): closed, without proportional and integral part. Of the inner loop.
    pub velocity_loop: StateSpace,
}

/// Where a loop is cut.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    Nowhere,
    Error,
    Actuator,
}

impl ClosedLoop {
    /// Closes the loop `name` of `config` around `plant`.
    pub fn new(config: &Config, plant: &LoopPlant, name: LoopName, view: View) -> Result<Self> {
        let sampled = plant.in_view(view, config.sample_time_s)?;
        let blocks = Blocks::new(config, name, view);
        let mut still = *config;
        let gains = inner_gains_mut(loops_of_mut(&mut still), name);
        (gains.kp, gains.ki, gains.canceller) = (0.0, 0.0, None);
        let alone = Blocks { outer: None, ..Blocks::new(&still, name, view) };
        Ok(Self {
            name,
            closed: assemble(&sampled, &blocks, Cut::Nowhere)?,
            prefilter: if name.is_outer() {
                StateSpace::gain(1.0, blocks.period_s)
            } else {
                blocks.prefilter.clone()
            },
            at_error: assemble(&sampled, &blocks, Cut::Error)?,
            at_actuator: assemble(&sampled, &blocks, Cut::Actuator)?,
            velocity_loop: assemble(&sampled, &alone, Cut::Nowhere)?,
        })
    }

    /// The loop gain at the error, at a frequency in rad/s.
    pub fn gain_at_error(&self, frequency_rad_s: f64) -> Complex<f64> {
        self.at_error.response(frequency_rad_s, 0, 0)
    }

    /// The loop gain at the actuator, at a frequency in rad/s: through the pose, and through the gyro.
    pub fn gain_at_actuator(&self, frequency_rad_s: f64) -> [Complex<f64>; 2] {
        [0, 1].map(|output| self.at_actuator.response(frequency_rad_s, output, 0))
    }
}

fn assemble(plant: &StateSpace, blocks: &Blocks, cut: Cut) -> Result<StateSpace> {
    let mut net = Network::new(blocks.period_s);
    let plant = net.add(plant.clone());
    let place = Place {
        actuator: plant.input(0),
        controlled: plant.output(0),
        rate: plant.output(1),
        position: blocks.outer.is_some().then(|| [plant.output(2), plant.output(3)]),
    };
    let ends = wire(&mut net, blocks, &place, cut);
    match cut {
        Cut::Nowhere => net.close(
            &[vec![(ends.reference, 1.0)], vec![(place.actuator, 1.0)]],
            &[vec![(ends.controlled, 1.0)], vec![(ends.law_output, 1.0)]],
        ),
        Cut::Error => net.close(&[vec![(ends.reference, 1.0)]], &[vec![(ends.measured, 1.0)]]),
        Cut::Actuator => {
            net.close(&[vec![(place.actuator, 1.0)]], &ends.to_actuator.map(|output| vec![(output, -1.0)]))
        }
    }
}

/// Where the plant meets a loop.
struct Place {
    actuator: Input,
    controlled: Output,
    rate: Output,
    /// Position and velocity, for an outer loop.
    position: Option<[Output; 2]>,
}

/// Adds the law's blocks of one loop to a network and links them to the plant.
fn wire(net: &mut Network, blocks: &Blocks, plant: &Place, cut: Cut) -> Ends {
    let (error, output, gyro_output) = (unit(net), unit(net), unit(net));
    let pi = net.add(blocks.proportional_integral.clone());
    let canceller = net.add(blocks.canceller.clone());
    let measured = net.add(blocks.delay.clone());
    net.link(plant.controlled, measured.input(0), 1.0);
    let cut_here = |outer: bool| cut == Cut::Error && blocks.outer.is_some() == outer;

    // Error, proportional-integral, canceller, output.
    if !cut_here(false) {
        net.link(measured.output(0), error.input(0), -1.0);
    }
    net.link(error.output(0), pi.input(0), 1.0);
    net.link(pi.output(0), canceller.input(0), 1.0);
    net.link(canceller.output(0), output.input(0), 1.0);

    // Velocity feedback; through the gyro, where there is one, by a way of its own.
    let rate = rate_of(net, &blocks.rate, plant.rate, measured.output(0));
    match &blocks.fusion {
        None => net.link(rate, output.input(0), -blocks.kd),
        Some((low, high)) => {
            let (low, high) = (net.add(low.clone()), net.add(high.clone()));
            net.link(rate, low.input(0), 1.0);
            net.link(plant.rate, high.input(0), 1.0);
            net.link(low.output(0), output.input(0), -blocks.kd);
            net.link(high.output(0), gyro_output.input(0), -blocks.kd);
        }
    }
    if cut != Cut::Actuator {
        net.link(output.output(0), plant.actuator, 1.0);
        net.link(gyro_output.output(0), plant.actuator, 1.0);
    }
    let to_actuator = [output.output(0), gyro_output.output(0)];

    // The position loop around it.
    let (Some(outer), Some([position, velocity])) = (&blocks.outer, plant.position) else {
        return Ends {
            reference: error.input(0),
            controlled: plant.controlled,
            measured: measured.output(0),
            law_output: output.output(0),
            to_actuator,
        };
    };
    let prefilter = net.add(blocks.prefilter.clone());
    let late = net.add(blocks.delay.clone());
    let pi = net.add(outer.proportional_integral.clone());
    let (error_m, angle) = (unit(net), unit(net));
    net.link(position, late.input(0), 1.0);
    if !cut_here(true) {
        net.link(late.output(0), error_m.input(0), -1.0);
    }
    net.link(error_m.output(0), pi.input(0), 1.0);
    net.link(pi.output(0), angle.input(0), 1.0);
    let velocity = rate_of(net, &outer.rate, velocity, late.output(0));
    net.link(velocity, angle.input(0), -outer.kd);
    net.link(angle.output(0), prefilter.input(0), 1.0);
    net.link(prefilter.output(0), error.input(0), 1.0);
    Ends {
        reference: error_m.input(0),
        controlled: position,
        measured: late.output(0),
        law_output: angle.output(0),
        to_actuator,
    }
}

/// All loops closed at once around all twelve states: the references of yaw, z, x and y, and what they move. What the loops
/// one by one leave out, how one axis moves another, is in it. (Left out even so: that the law turns rates from Euler's
/// angles to the body's at the angle of the equilibrium, which is some degrees.)
pub fn together(config: &Config, linear: &Linear, effect: &Matrix4<f64>, view: View) -> Result<StateSpace> {
    let mut motion = Network::new(None);
    let b = linear.proper_b() * effect;
    // Outputs of the motion: the twelve states, and with the input's part what they change by. z and x are turned round.
    let turned = |i: usize| if i == 0 || i == 2 { -1.0 } else { 1.0 };
    let c = DMatrix::from_fn(24, 12, |i, j| {
        let state = i % 12;
        turned(state)
            * match (i < 12, state == j) {
                (true, same) => f64::from(same),
                (false, _) => linear.a[(state, j)],
            }
    });
    let body = motion.add(StateSpace {
        a: DMatrix::from_fn(12, 12, |i, j| linear.a[(i, j)]),
        b: DMatrix::from_fn(12, 4, |i, j| b[(i, j)]),
        c,
        d: DMatrix::zeros(24, 4),
        period_s: None,
    });
    let entries: Vec<_> = (0..4)
        .map(|k| match linear.motor_lag_rad_s {
            None => vec![(body.input(k), 1.0)],
            Some(lag) => {
                let rotors = motion.add(StateSpace::transfer(&[lag], &[1.0, lag], None));
                motion.link(rotors.output(0), body.input(k), 1.0);
                vec![(rotors.input(0), 1.0)]
            }
        })
        .collect();
    let outputs: Vec<_> = (0..24).map(|k| vec![(body.output(k), 1.0)]).collect();
    let whole = motion.close(&entries, &outputs)?;
    let plant = LoopPlant { system: whole, input_delay_s: linear.input_delay_s, notes: Vec::new() };
    let mut net = Network::new(match view {
        View::Continuous => None,
        View::Sampled { .. } => Some(config.sample_time_s),
    });
    let plant = net.add(plant.in_view(view, config.sample_time_s)?);
    let (mut references, mut controlled) = (Vec::new(), Vec::new());
    for name in [LoopName::Yaw, LoopName::Z, LoopName::X, LoopName::Y] {
        let inner = name.inner().channel();
        let outer = name.channel().output;
        let place = Place {
            actuator: plant.input(inner.input),
            controlled: plant.output(inner.output),
            rate: plant.output(12 + inner.output),
            position: name.is_outer().then(|| [plant.output(outer), plant.output(12 + outer)]),
        };
        let ends = wire(&mut net, &Blocks::new(config, name, view), &place, Cut::Nowhere);
        references.push(vec![(ends.reference, 1.0)]);
        controlled.push(vec![(ends.controlled, 1.0)]);
    }
    net.close(&references, &controlled)
}

/// Where a loop is entered and left.
struct Ends {
    reference: Input,
    controlled: Output,
    measured: Output,
    law_output: Output,
    /// What goes to the actuator: by the pose, and by the gyro.
    to_actuator: [Output; 2],
}

/// A signal's sum point.
fn unit(net: &mut Network) -> Block {
    net.add(StateSpace::gain(1.0, net.period_s()))
}

fn rate_of(net: &mut Network, rate: &Rate, own: Output, measured: Output) -> Output {
    match rate {
        Rate::True => own,
        Rate::Estimated(filter) => {
            let filter = net.add(filter.clone());
            net.link(measured, filter.input(0), 1.0);
            filter.output(0)
        }
    }
}

/// The plant of an angle loop with its real zero moved to `zero_rad_s` (appendix A): numerator `gain (s + zero)`, denominator as it is.
pub fn with_moved_zero(
    channel: &Channel,
    zero_rad_s: f64,
    motor_lag_rad_s: Option<f64>,
) -> Result<LoopPlant> {
    if channel.zeros.len() != 1 {
        return Err(DesignError::Channel {
            channel: channel.id.name,
            reason: format!("it has {} zeros, not one that could be moved", channel.zeros.len()),
        });
    }
    LoopPlant::of_transfer(
        &[channel.gain, channel.gain * zero_rad_s],
        &polynomial(&channel.poles),
        None,
        motor_lag_rad_s,
    )
}
