//! The plant of a loop: from the law's output, through rotors and motion, to what the law measures.

use nalgebra::{Complex, DMatrix, Matrix4, SVector};

use super::name::{LoopName, View};
use crate::error::{DesignError, Result};
use crate::plant::{
    CANCEL_TOLERANCE, Cancelled, Channel, ChannelId, Linear, MatrixB, Network, StateSpace, polynomial,
};

/// A plant's place between the law's output and what the law measures.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopPlant {
    /// Continuous; one input (the law's output); outputs: controlled variable of the inner loop,
    /// its rate, and for an outer loop position and velocity.
    pub system: StateSpace,
    /// Dead time between command and rotor, s.
    pub input_delay_s: f64,
    /// What was approximated on the way here.
    pub notes: Vec<String>,
}

impl LoopPlant {
    /// The plant of a loop in a linear model, driven by the law through `effect` ([`law_effect`](super::law_effect)).
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
                // Something holds the craft to a place (a tether), or the position's channel is not
                // that of the angle.
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

    /// A plant given by its transfer function from the law's output (before the rotors' lag, rad/s)
    /// to the controlled variable, with a numerator and denominator in descending powers, and that
    /// to the velocity, for tests and appendix A.
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
    pub(super) fn in_view(&self, view: View, period_s: f64) -> Result<StateSpace> {
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

/// A channel, and what was approximated. Where other axes leave it poles that no zero takes away (a
/// craft that hovers leaning against wind is coupled in all axes), it is taken by itself: its own
/// loop cannot move those poles, and that the loops hold them together is for [`super::together`]
/// to say.
fn uncrossed(
    linear: &Linear,
    column: &SVector<f64, 12>,
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
        "{}: analysed without the other axes; at this equilibrium they add {} poles to its transfer function, which only all loops together control",
        id.name,
        whole.poles.len() - own.poles.len()
    );
    Ok((own, vec![note]))
}

/// The axis by itself: position, velocity, angle, rate.
fn alone(linear: &Linear, column: &SVector<f64, 12>, name: LoopName) -> StateSpace {
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
        "{}: unstable poles of another axis cancel to within {:.2} %; the loop of that axis has to stabilise them",
        channel.id.name,
        100.0 * channel.cancelled.iter().map(Cancelled::distance).fold(0.0, f64::max)
    )]
}

/// The plant of an angle loop with its real zero moved to `zero_rad_s` (appendix A): numerator
/// `gain (s + zero)`, denominator as it is.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 / (s (s + 2)) behind a lag of 20 rad/s, at 4 rad/s; the rate is j w times that.
    #[test]
    fn a_transfer_function_is_followed_by_its_rate() {
        let plant = LoopPlant::of_transfer(&[3.0], &[1.0, 2.0, 0.0], None, Some(20.0)).unwrap();
        let s = Complex::new(0.0, 4.0);
        let wanted = Complex::from(3.0) / (s * (s + 2.0)) * 20.0 / (s + 20.0);
        assert!((plant.system.response(4.0, 0, 0) - wanted).norm() < 1e-12);
        assert!((plant.system.response(4.0, 1, 0) - wanted * s).norm() < 1e-12);
    }

    /// The velocity of an outer loop is the derivative of its position.
    #[test]
    fn an_outer_plant_has_position_and_velocity() {
        let plant = LoopPlant::of_transfer(&[1.0], &[1.0, 2.0, 0.0], Some(&[9.81]), None).unwrap();
        let s = Complex::new(0.0, 0.7);
        let velocity = Complex::from(9.81) / (s * (s + 2.0));
        assert!((plant.system.response(0.7, 3, 0) - velocity).norm() < 1e-12);
        assert!((plant.system.response(0.7, 2, 0) - velocity / s).norm() < 1e-12);
    }

    #[test]
    fn a_zero_is_moved_where_there_is_one() {
        let channel = |zeros: Vec<Complex<f64>>| Channel {
            id: LoopName::Roll.channel(),
            poles: vec![Complex::new(-1.0, 0.0), Complex::new(-2.0, 0.0)],
            zeros,
            gain: 2.0,
            states: Vec::new(),
            cancelled: Vec::new(),
        };
        let plant = with_moved_zero(&channel(vec![Complex::new(-0.2, 0.0)]), 0.5, None).unwrap();
        // 2 (s + 0.5) / ((s + 1) (s + 2)) at rest.
        assert!((plant.system.response(0.0, 0, 0).re - 0.5).abs() < 1e-12);
        let error = with_moved_zero(&channel(Vec::new()), 0.5, None).unwrap_err().to_string();
        assert!(error.contains("roll") && error.contains("0 zeros"), "{error}");
    }
}
