//! One control period, from measurement and command to motor commands.
//!
//! Order of a tick (thesis chapter 5; every item is tested against recorded closed-loop runs, see
//! `tests/thesis_law.rs`):
//! 1. inputs are checked ([`input_checks`](crate::inputs::input_checks)); measurements are used as
//!    they come, their delay is the world's;
//! 2. Euler rates, body rates and vertical velocity are estimated;
//! 3. in position mode the outer loop makes roll and pitch commands of the position command;
//! 4. prefilters make references of commands, and errors follow (yaw the short way round);
//! 5. roll, pitch and yaw loops give angular accelerations;
//! 6. the altitude loop gives the thrust: `T = hover - PID(z)`;
//! 7. the inverse mixing matrix gives squared rotor speeds (negative ones become 0), the motor map
//!    commands at the measured voltage; injection is added; the range clamps. What was refused is
//!    for the next tick's integrators to know.
//!
//! Filters start in the steady state of their first input, integrators and cancellers at rest.
//! During cut-off the motors idle, the estimators run on, and the loops start anew at its end.
//!
//! The hand-tuned law (thesis 4.2.2) has the same order; in step 7 the sign matrix (4.5) gives
//! commands directly.
//!
//! A configuration can ask for two things that the thesis does not have: the thrust divided by
//! `cos(phi) cos(theta)` in step 6 (up to twice), and in step 7, where a motor is asked for more
//! than it has, roll and pitch before thrust before yaw. With the second goes a tilt reduction:
//! while roll and pitch take nearly all that the motors have (held against the moment of fast
//! sideways flight, say), a falling fraction of the commanded tilt is flown; afterwards it grows
//! back.
//!
//! Not here: arming, failsafes, clock checks (the [`Autopilot`](crate::Autopilot) has them), and a
//! limit of the thrust.

use crate::allocation::desaturation::Desaturated;
use crate::allocation::mixer::{Directions, Mixer, Refused, are_finite, are_positive, rotor_speeds};
use crate::allocation::motor_map::{CommandRange, MotorMap};
use crate::config::error::ConfigError;
use crate::config::gains::{Config, Law, Saturation};
use crate::config::range_check::RangeCheck;
use crate::inputs::input_checks::{Bounds, Faults, HeldInputs};
use crate::inputs::readings::{Command, Measurement, Mode};
use crate::law::altitude::{AltitudeLoop, AltitudeLoopState};
use crate::law::attitude::{AngleLoop, AngleLoopState};
use crate::law::estimator::{Estimates, Estimator, EstimatorState};
use crate::law::position::{PositionLaw, PositionState};
use crate::law::terms::{Terms, Tick};

/// The immutable part: what [`Config`] was built into.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Laws {
    bounds: Bounds,
    landing_bounds: Bounds,
    estimator: Estimator,
    position: PositionLaw,
    roll: AngleLoop,
    pitch: AngleLoop,
    yaw: AngleLoop,
    altitude: AltitudeLoop,
    mixer: Mixer,
    /// Absent in the hand-tuned law: the mixer gives commands directly.
    motor_map: Option<MotorMap>,
    range: CommandRange,
    /// Roll and pitch before thrust before yaw, where a motor is at its end.
    attitude_first: bool,
    tilt_compensation: bool,
    /// By how much the fraction of the commanded tilt that is flown falls in a nearly saturated
    /// period, and grows in another.
    tilt_reduction: f32,
    tilt_recovery: f32,
}

impl Laws {
    /// Where positions may be commanded.
    #[inline]
    fn bounds(&self, lands: bool) -> &Bounds {
        if lands { &self.landing_bounds } else { &self.bounds }
    }
}

/// Memory of the inner loops, from the first tick after the start or a cut-off.
#[derive(Debug, Clone, Copy, PartialEq)]
struct InnerState {
    roll: AngleLoopState,
    pitch: AngleLoopState,
    yaw: AngleLoopState,
    altitude: AltitudeLoopState,
    refused: Refused,
    /// Fraction of the commanded tilt that is flown.
    tilt_fraction: f32,
}

/// All that survives a tick. What is `None` starts with its next input.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Memory {
    /// Whether there has been a good measurement.
    started: bool,
    inputs: HeldInputs,
    estimator: Option<EstimatorState>,
    position: Option<PositionState>,
    inner: Option<InnerState>,
    pwm: [f32; 4],
    faults: Faults,
}

impl Memory {
    fn new(idle: f32) -> Self {
        Self {
            started: false,
            inputs: HeldInputs::default(),
            estimator: None,
            position: None,
            inner: None,
            pwm: [idle; 4],
            faults: Faults::default(),
        }
    }
}

/// How far below the box a landing may command, m: a floor may be lower than it was thought, and a
/// craft that stands on it is to carry itself less and less.
pub(crate) const LANDING_DEPTH_M: f32 = 1.0;

/// What a tick is to do.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Guided<'a> {
    pub(crate) mode: Mode,
    pub(crate) cut_off: bool,
    /// Heights below the box may be commanded.
    pub(crate) lands: bool,
    /// The craft stands on something: its integrators stay as they are (with anti-windup), as if the
    /// motors refused everything.
    pub(crate) stands: bool,
    /// Absent: the values of the last one are kept.
    pub(crate) command: Option<&'a Command>,
    /// The command is known to be finite.
    pub(crate) finite: bool,
}

/// The controller: an immutable law and a small memory. Copying it is taking a snapshot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controller {
    laws: Laws,
    memory: Memory,
}

impl Controller {
    /// Checks the configuration and builds the law for its sample time.
    ///
    /// # Errors
    /// The first parameter that is not finite or out of range, by name.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        config.check()?;
        let (period_s, anti_windup) = (config.sample_time_s, config.anti_windup);
        let (loops, hover, mixer, motor_map) = match &config.law {
            Law::ModelBased(law) => {
                (law.loops, law.hover_thrust_n, Mixer::new(&law.mixing)?, Some(MotorMap::new(&law.motor_map)))
            }
            Law::HandTuned(law) => (law.loops, law.hover_command, Mixer::signs(), None),
        };
        let rule = config.estimation.gain_rule;
        let attitude_first = config.saturation == Saturation::AttitudeFirst;
        if attitude_first {
            RangeCheck { group: "mixing" }.within("thrust of a rotor", mixer.least_thrust(), 1e-9, 1e12)?;
        }
        let laws = Laws {
            bounds: Bounds::new(&config.position_limits),
            landing_bounds: Bounds::new(&config.position_limits).deeper(LANDING_DEPTH_M),
            estimator: Estimator::new(&config.estimation, period_s),
            position: PositionLaw::new(&loops.x, &loops.y, rule, period_s, anti_windup),
            roll: AngleLoop::new(&loops.roll, period_s, anti_windup),
            pitch: AngleLoop::new(&loops.pitch, period_s, anti_windup),
            yaw: AngleLoop::new(&loops.yaw, period_s, anti_windup),
            altitude: AltitudeLoop::new(&loops.altitude, hover, period_s, anti_windup),
            mixer,
            motor_map,
            range: CommandRange::new(config.command_range),
            attitude_first,
            tilt_compensation: config.tilt_compensation,
            tilt_reduction: (TILT_REDUCTION_PER_S * period_s) as f32,
            tilt_recovery: (TILT_RECOVERY_PER_S * period_s) as f32,
        };
        Ok(Self { memory: Memory::new(laws.range.idle()), laws })
    }

    /// Forgets everything: integrators at zero, filters start at their next input, fault counts at
    /// zero.
    pub fn reset(&mut self) {
        self.memory = Memory::new(self.laws.range.idle());
    }

    /// This law, with the faults that another one has counted.
    pub(crate) fn with_faults_of(mut self, other: &Self) -> Self {
        self.memory.faults = other.memory.faults;
        self
    }

    /// The altitude loop's reference is this height from now on, inertial z in m, with no way to
    /// go.
    pub(crate) fn settle_height(&mut self, z_m: f32) {
        if let Some(inner) = &mut self.memory.inner {
            self.laws.altitude.settle(&mut inner.altitude, z_m);
        }
    }

    /// The altitude loop gives so much thrust where there is neither error nor rate, N (or command
    /// units).
    pub(crate) fn carry_with(&mut self, thrust: f32) {
        if let Some(inner) = &mut self.memory.inner {
            self.laws.altitude.carry(&mut inner.altitude, thrust);
        }
    }

    /// The thrust of a tick's motor commands at its voltage, N (or command units): not what was asked for where a motor is at an end.
    /// The rotors' lag is not in it.
    #[cold]
    pub(crate) fn given_thrust(&self, Tick { pwm, terms, .. }: &Tick) -> f32 {
        let squared = |map: &MotorMap| pwm.map(|command| map.squared_speed(command, terms.battery_v));
        self.laws.mixer.thrust(self.laws.motor_map.as_ref().map_or(*pwm, squared))
    }

    /// The next attitude and the next z are off by so much, rad and m, by no motion: the rates go on
    /// as they were.
    #[cold]
    pub(crate) fn leap(&mut self, turned_rad: [f32; 3], down_m: f32) {
        let Self { laws, memory } = self;
        if let Some(state) = &mut memory.estimator {
            laws.estimator.leap(state, turned_rad, down_m);
        }
    }

    /// One control period. Total: any bits in any input give finite motor commands inside the
    /// range.
    pub fn tick(&mut self, measurement: &Measurement, command: &Command) -> Tick {
        let mut outcome = Tick::default();
        let Command { mode, cut_off, .. } = *command;
        let guided =
            Guided { mode, cut_off, lands: false, stands: false, command: Some(command), finite: false };
        self.tick_into(measurement, false, &guided, &mut outcome);
        outcome
    }

    /// [`Controller::tick`] into a place that is there already: copying an outcome is a fifth of
    /// the cost of a tick.
    ///
    /// `checked`: the detectors have checked position and attitude already.
    #[inline]
    pub(crate) fn tick_into(
        &mut self,
        measurement: &Measurement,
        checked: bool,
        guided: &Guided<'_>,
        outcome: &mut Tick,
    ) {
        let Self { laws, memory } = self;
        let Guided { mode, cut_off, lands, stands, command, finite } = *guided;
        memory.faults.internal.note(false);
        let wants_gyro = laws.estimator.uses_gyro();
        let all_good = if checked {
            memory.inputs.measure_checked(measurement, wants_gyro, &mut memory.faults)
        } else {
            memory.inputs.measure(measurement, wants_gyro, &mut memory.faults)
        };
        if !memory.started {
            if !all_good {
                outcome.terms = Terms::default();
                return idle(laws, memory, outcome);
            }
            memory.inputs.hold_here();
            memory.started = true;
        }
        match command {
            Some(command) => memory.inputs.command(command, finite, laws.bounds(lands), &mut memory.faults),
            None => memory.faults.command.note(false),
        }
        // Each term is written where it belongs as it comes: a copy of all of them would cost as much as three loops.
        let terms = &mut outcome.terms;
        (terms.position_m, terms.attitude_rad) = (memory.inputs.position_m, memory.inputs.attitude_rad);
        let upright = estimate(laws, memory, measurement.gyro_rad_s.is_some(), terms);
        if cut_off {
            return idle(laws, memory, outcome);
        }
        outer_loop(laws, memory, mode, stands, terms);
        inner_loops(laws, memory, upright, stands, terms);
        let motors = allocate(laws, memory, terms);
        terms.rotor_speed_rad_s = motors.rotor_speed_rad_s;
        (outcome.pwm, outcome.refused, outcome.faults) = (memory.pwm, motors.refused, memory.faults);
    }
}

/// Motors at idle; the loops start anew after it. Of the terms those of the estimators are kept.
#[cold]
fn idle(laws: &Laws, memory: &mut Memory, outcome: &mut Tick) {
    (memory.position, memory.inner) = (None, None);
    memory.pwm = [laws.range.idle(); 4];
    let Terms {
        position_m, attitude_rad, battery_v, euler_rates_rad_s, body_rates_rad_s, z_rate_m_s, ..
    } = outcome.terms;
    let terms = Terms {
        position_m,
        attitude_rad,
        battery_v,
        euler_rates_rad_s,
        body_rates_rad_s,
        z_rate_m_s,
        ..Terms::default()
    };
    *outcome = Tick { pwm: memory.pwm, terms, refused: Refused::default(), faults: memory.faults };
}

/// Step 2: rates and voltage. Gives `cos(phi) cos(theta)`.
#[inline]
fn estimate(laws: &Laws, memory: &mut Memory, gyro_came: bool, terms: &mut Terms) -> f32 {
    let HeldInputs { position_m: [_, _, z_m], attitude_rad, gyro_rad_s, battery_v, .. } = memory.inputs;
    let state = memory
        .estimator
        .get_or_insert_with(|| laws.estimator.start(attitude_rad, z_m, battery_v, gyro_rad_s));
    let Estimates { euler_rates_rad_s, body_rates_rad_s, z_rate_m_s, battery_v, upright } =
        laws.estimator.step(state, attitude_rad, z_m, battery_v, gyro_came.then_some(gyro_rad_s));
    (terms.euler_rates_rad_s, terms.body_rates_rad_s) = (euler_rates_rad_s, body_rates_rad_s);
    (terms.z_rate_m_s, terms.battery_v) = (z_rate_m_s, battery_v);
    upright
}

/// Step 3: roll, pitch and yaw commands.
#[inline]
fn outer_loop(laws: &Laws, memory: &mut Memory, mode: Mode, stands: bool, terms: &mut Terms) {
    let inputs = &memory.inputs;
    let [roll, pitch] = match mode {
        Mode::Attitude => {
            (memory.position, terms.outer) = (None, None);
            inputs.attitude_command_rad
        }
        Mode::Position => {
            let ([x, y, _], [_, _, yaw]) = (inputs.position_m, inputs.attitude_rad);
            let state = memory.position.get_or_insert_with(|| laws.position.start([x, y]));
            let refused = if stands { Directions::BOTH } else { Directions::NONE };
            let (tilt, outer) = laws.position.step(state, inputs.position_command_m, [x, y], yaw, refused);
            terms.outer = Some(outer);
            tilt
        }
    };
    terms.attitude_command_rad = [roll, pitch, inputs.yaw_command_rad];
}

/// Steps 4 to 6: thrust and angular accelerations.
#[inline]
fn inner_loops(laws: &Laws, memory: &mut Memory, upright: f32, stands: bool, terms: &mut Terms) {
    let HeldInputs { position_m: [_, _, z], attitude_rad: [phi, theta, psi], z_command_m, .. } =
        memory.inputs;
    let ([roll_command, pitch_command, yaw_command], [p, q, r]) =
        (terms.attitude_command_rad, terms.body_rates_rad_s);
    let state = memory.inner.get_or_insert_with(|| InnerState {
        roll: laws.roll.start(roll_command),
        pitch: laws.pitch.start(pitch_command),
        yaw: laws.yaw.start(yaw_command),
        altitude: laws.altitude.start(z_command_m),
        refused: Refused::default(),
        tilt_fraction: 1.0,
    });
    let refused = if stands { &Refused::ALL } else { &state.refused };
    let (roll_command, pitch_command) =
        (state.tilt_fraction * roll_command, state.tilt_fraction * pitch_command);
    let roll = laws.roll.step_tilt(&mut state.roll, roll_command, phi, p, refused.roll);
    terms.roll = roll.terms;
    let pitch = laws.pitch.step_tilt(&mut state.pitch, pitch_command, theta, q, refused.pitch);
    terms.pitch = pitch.terms;
    let yaw = laws.yaw.step_yaw(&mut state.yaw, yaw_command, psi, r, refused.yaw);
    terms.yaw = yaw.terms;
    terms.attitude_reference_rad = [roll.reference, pitch.reference, yaw.reference];
    terms.attitude_error_rad = [roll.error, pitch.error, yaw.error];
    terms.torque = [roll.terms.output, pitch.terms.output, yaw.terms.output];
    let (altitude, mut thrust) =
        laws.altitude.step(&mut state.altitude, z_command_m, z, terms.z_rate_m_s, refused.thrust);
    terms.z_command_m = z_command_m;
    (terms.z_reference_m, terms.z_error_m, terms.altitude) =
        (altitude.reference, altitude.error, altitude.terms);
    if laws.tilt_compensation {
        // What is not a number stays one, for the end of the tick to see.
        thrust /= if upright > LEAST_UPRIGHT { upright } else { LEAST_UPRIGHT };
    }
    terms.thrust = thrust;
}

/// How fast the tilt is reduced while the motors are nearly saturated, fractions of the command per
/// s: slowly, because a craft that needs all it has to hold against a moment cannot be turned back
/// fast. A hard manoeuvre of a second costs 5 %.
const TILT_REDUCTION_PER_S: f64 = 0.05;
/// How fast the full tilt comes back, fractions of the command per s.
const TILT_RECOVERY_PER_S: f64 = 0.02;

/// Beyond 60 degrees of tilt the thrust is not raised further: it is at most doubled.
const LEAST_UPRIGHT: f32 = 0.5;

/// What became of the inner loops' demands; the motor commands themselves are in memory.
struct Motors {
    rotor_speed_rad_s: Option<[f32; 4]>,
    refused: Refused,
}

/// Step 7: motor commands, and what they refuse.
#[inline]
fn allocate(laws: &Laws, memory: &mut Memory, terms: &Terms) -> Motors {
    let mixed = laws.mixer.mix(terms.thrust, terms.torque);
    // Before the square roots, which make 0 of a NaN.
    if !are_positive(mixed) && !are_finite(mixed) {
        return internal_fault(memory);
    }
    let (rotor_speed_rad_s, wanted) = commands(laws, memory, mixed, terms.battery_v);
    let (motors, nearly_saturated) = if are_positive(mixed) && laws.range.surely_holds(wanted) {
        memory.pwm = wanted;
        (Motors { rotor_speed_rad_s, refused: Refused::default() }, false)
    } else {
        at_an_end(laws, memory, terms, (mixed, rotor_speed_rad_s, wanted))
    };
    if let Some(inner) = &mut memory.inner {
        inner.refused = motors.refused;
        if nearly_saturated {
            inner.tilt_fraction = (inner.tilt_fraction - laws.tilt_reduction).max(0.0);
        } else if inner.tilt_fraction < 1.0 {
            inner.tilt_fraction = (inner.tilt_fraction + laws.tilt_recovery).min(1.0);
        }
    }
    motors
}

/// Rotor speeds in rad/s where the law knows any, and motor commands, injection included, on either
/// side of their range.
#[inline]
fn commands(laws: &Laws, memory: &Memory, mixed: [f32; 4], battery_v: f32) -> (Option<[f32; 4]>, [f32; 4]) {
    let (rotor_speed_rad_s, mut wanted) = match &laws.motor_map {
        Some(map) => {
            let speeds = rotor_speeds(mixed);
            (Some(speeds), map.commands(speeds, battery_v))
        }
        None => (None, mixed),
    };
    for (command, injection) in wanted.iter_mut().zip(memory.inputs.injection) {
        *command += injection;
    }
    (rotor_speed_rad_s, wanted)
}

/// Step 7 where some motor may be at an end. Also whether roll and pitch take nearly all there is.
#[cold]
fn at_an_end(
    laws: &Laws,
    memory: &mut Memory,
    terms: &Terms,
    (mixed, rotor_speed_rad_s, wanted): ([f32; 4], Option<[f32; 4]>, [f32; 4]),
) -> (Motors, bool) {
    memory.pwm = wanted.map(|command| laws.range.clamp(command));
    let no_rotor_backwards = rotor_speed_rad_s.is_none() || mixed.iter().all(|w2| *w2 >= 0.0);
    if no_rotor_backwards && memory.pwm == wanted {
        (Motors { rotor_speed_rad_s, refused: Refused::default() }, false)
    } else if laws.attitude_first {
        desaturate(laws, memory, terms)
    } else {
        (Motors { rotor_speed_rad_s, refused: refusal(laws, mixed, wanted) }, false)
    }
}

/// Step 7 where some motor is at an end, and roll and pitch come first. The injection is never
/// reduced. Also whether roll and pitch take nearly all there is.
#[cold]
fn desaturate(laws: &Laws, memory: &mut Memory, terms: &Terms) -> (Motors, bool) {
    let ends = laws.range.ends().map(|end| {
        memory.inputs.injection.map(|injection| match &laws.motor_map {
            Some(map) => map.squared_speed(end - injection, terms.battery_v),
            None => end - injection,
        })
    });
    let [low, high] = ends;
    let Desaturated { mixed, refused, nearly_saturated } =
        laws.mixer.desaturate(terms.thrust, terms.torque, low, high);
    let (rotor_speed_rad_s, wanted) = commands(laws, memory, mixed, terms.battery_v);
    // What rounding leaves outside.
    memory.pwm = wanted.map(|command| laws.range.clamp(command));
    (Motors { rotor_speed_rad_s, refused }, nearly_saturated)
}

/// What is refused when some motor is at an end.
#[cold]
fn refusal(laws: &Laws, mixed: [f32; 4], wanted: [f32; 4]) -> Refused {
    let mut ends = wanted.map(|command| laws.range.at_end(command));
    if laws.motor_map.is_some() {
        for (end, squared_speed) in ends.iter_mut().zip(mixed) {
            end.low |= squared_speed < 0.0;
        }
    }
    laws.mixer.refused(ends)
}

/// After an overflow in memory or gains: starts anew with the next tick, and repeats the last
/// commands in this one.
#[cold]
fn internal_fault(memory: &mut Memory) -> Motors {
    memory.faults.internal.note(true);
    (memory.estimator, memory.position, memory.inner) = (None, None, None);
    Motors { rotor_speed_rad_s: None, refused: Refused::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::GyroFusion;
    use crate::law::pid::PidTerms;
    use crate::law::terms::OuterTerms;

    const HOVER: Measurement = Measurement {
        position_m: [0.0, 0.0, -1.0],
        attitude_rad: [0.0; 3],
        gyro_rad_s: None,
        battery_v: 11.1,
    };
    const STAY: Command = Command {
        mode: Mode::Attitude,
        attitude_rad: [0.0; 2],
        yaw_rad: 0.0,
        z_m: -1.0,
        position_m: [0.0; 2],
        cut_off: false,
        injection: [0.0; 4],
    };

    fn thesis() -> Controller {
        Controller::new(&Config::thesis()).unwrap()
    }

    /// Nothing of what stood in an outcome before is left, whatever the tick does.
    #[test]
    fn every_term_is_written_in_every_tick() {
        let (three, pid) = ([7.0; 3], PidTerms { p: 7.0, i: 7.0, d: 7.0, output: 7.0 });
        let outer =
            OuterTerms { reference_m: [7.0; 2], error_m: [7.0; 2], velocity_m_s: [7.0; 2], x: pid, y: pid };
        let terms = Terms {
            position_m: three,
            attitude_rad: three,
            battery_v: 7.0,
            euler_rates_rad_s: three,
            body_rates_rad_s: three,
            z_rate_m_s: 7.0,
            outer: Some(outer),
            attitude_command_rad: three,
            z_command_m: 7.0,
            attitude_reference_rad: three,
            z_reference_m: 7.0,
            attitude_error_rad: three,
            z_error_m: 7.0,
            roll: pid,
            pitch: pid,
            yaw: pid,
            altitude: pid,
            thrust: 7.0,
            torque: three,
            rotor_speed_rad_s: Some([7.0; 4]),
        };
        for config in [Config::thesis(), Config::thesis_hand_tuned()] {
            let mut controller = Controller::new(&config).unwrap();
            let nowhere = Measurement { position_m: [f32::NAN; 3], ..HOVER };
            let tilted = Measurement { attitude_rad: [0.1, -0.1, 0.3], ..HOVER };
            for (measurement, mode, cut_off) in [
                (nowhere, Mode::Attitude, false),
                (HOVER, Mode::Attitude, true),
                (tilted, Mode::Position, false),
                (HOVER, Mode::Attitude, false),
            ] {
                let command = Command { mode, cut_off, ..STAY };
                let guided = Guided {
                    mode,
                    cut_off,
                    lands: false,
                    stands: false,
                    command: Some(&command),
                    finite: true,
                };
                let mut over = Tick { terms, refused: Refused::ALL, pwm: [7.0; 4], ..Tick::default() };
                let mut copy = controller;
                copy.tick_into(&measurement, false, &guided, &mut over);
                assert_eq!(over, controller.tick(&measurement, &command), "{mode:?} {cut_off}");
            }
        }
    }

    /// What is measured is told with the motors at idle too, and nothing else.
    #[test]
    fn at_idle_the_terms_of_the_estimators_are_told() {
        let mut controller = thesis();
        let moved = |k: u8| {
            let k = f32::from(k);
            Measurement {
                position_m: [0.02 * k, -0.03 * k, -1.0 - 0.01 * k],
                attitude_rad: [0.002 * k, -0.003 * k, 0.004 * k],
                battery_v: 11.9,
                ..HOVER
            }
        };
        for k in 0..9 {
            controller.tick(&moved(k), &STAY);
        }
        let [flying, idle] = [false, true].map(|cut_off| {
            let mut copy = controller;
            copy.tick(&moved(9), &Command { cut_off, ..STAY }).terms
        });
        assert_eq!(flying.position_m, moved(9).position_m);
        assert!(flying.attitude_rad.iter().all(|angle| *angle != 0.0), "{flying:?}");
        assert!(flying.battery_v > 11.1 && flying.z_rate_m_s < 0.0, "{flying:?}");
        for rates in [flying.euler_rates_rad_s, flying.body_rates_rad_s] {
            assert!(rates[0] > 0.0 && rates[1] < 0.0 && rates[2] > 0.0, "{rates:?}");
        }
        let estimated = Terms {
            position_m: flying.position_m,
            attitude_rad: flying.attitude_rad,
            battery_v: flying.battery_v,
            euler_rates_rad_s: flying.euler_rates_rad_s,
            body_rates_rad_s: flying.body_rates_rad_s,
            z_rate_m_s: flying.z_rate_m_s,
            ..Terms::default()
        };
        assert_eq!(idle, estimated);
    }

    /// Hover commands of the printed matrix and map at 11.1 V (reference numbers, 2 decimals; f32
    /// holds 1700 to 1.2e-4).
    #[test]
    fn hover_is_hover() {
        let mut controller = thesis();
        for _ in 0..if cfg!(miri) { 100 } else { 1000 } {
            let tick = controller.tick(&HOVER, &STAY);
            for (got, want) in tick.pwm.into_iter().zip([1682.71, 1711.94, 1711.05, 1741.89]) {
                assert!((got - want).abs() < 0.006, "{got} {want}");
            }
            assert_eq!((tick.refused, tick.faults), (Refused::default(), Faults::default()));
        }
    }

    /// What the altitude loop is told to carry the craft with is what it gives from then on, where
    /// there is nothing to correct.
    #[test]
    fn what_carries_the_craft_is_given_from_then_on() {
        let with = |thrust: f32| {
            let mut controller = thesis();
            let hover = controller.tick(&HOVER, &STAY).pwm;
            controller.carry_with(thrust);
            let after = [controller.tick(&HOVER, &STAY), controller.tick(&HOVER, &STAY)];
            (hover, after.map(|tick| tick.pwm))
        };
        let (hover, [weak, then]) = with(3.0);
        let (_, [strong, _]) = with(5.0);
        for motor in 0..4 {
            assert!(weak[motor] + 1.0 < strong[motor], "{weak:?} {strong:?}");
            assert!((weak[motor] - hover[motor]).abs() > 1.0, "{weak:?} {hover:?}");
            assert!((then[motor] - weak[motor]).abs() < 0.01, "{then:?} {weak:?}");
        }
    }

    /// The craft's answer to each command and disturbance, by the signs of the conventions, in both
    /// laws.
    #[test]
    fn directions() {
        for config in [Config::thesis(), Config::thesis_hand_tuned()] {
            let more = |measurement: &Measurement, command: &Command| {
                let mut controller = Controller::new(&config).unwrap();
                let hover = controller.tick(&HOVER, &STAY).pwm;
                let mut now = hover;
                for _ in 0..5 {
                    now = controller.tick(measurement, command).pwm;
                }
                let change: [f32; 4] = core::array::from_fn(|i| now[i] - hover[i]);
                change.map(|x| x > 0.0)
            };
            let left = [true, false, false, true];
            let front = [true, true, false, false];
            let ccw = [true, false, true, false];
            assert_eq!(more(&HOVER, &Command { attitude_rad: [0.1, 0.0], ..STAY }), left, "roll right");
            assert_eq!(more(&HOVER, &Command { attitude_rad: [0.0, 0.1], ..STAY }), front, "pitch up");
            assert_eq!(more(&HOVER, &Command { yaw_rad: 0.1, ..STAY }), ccw, "yaw right");
            assert_eq!(more(&HOVER, &Command { z_m: -1.2, ..STAY }), [true; 4], "climb");
            assert_eq!(
                more(&Measurement { attitude_rad: [-0.1, 0.0, 0.0], ..HOVER }, &STAY),
                left,
                "rolled left"
            );
        }
    }

    #[test]
    fn nothing_flies_before_the_first_good_measurement() {
        let mut controller = thesis();
        let blind = Measurement { position_m: [f32::NAN; 3], ..HOVER };
        for k in 1..=5 {
            let tick = controller.tick(&blind, &STAY);
            assert_eq!(tick.pwm, [1000.0; 4]);
            assert_eq!(tick.faults.measurement.count, k);
        }
        assert!(controller.tick(&HOVER, &STAY).pwm[0] > 1600.0);
    }

    #[test]
    fn a_bad_sample_is_held_and_counted() {
        let mut controller = thesis();
        controller.tick(&HOVER, &STAY);
        let before = controller.tick(&HOVER, &STAY).pwm;
        let bad = Measurement { attitude_rad: [f32::NAN, 0.0, f32::INFINITY], battery_v: f32::NAN, ..HOVER };
        let tick = controller.tick(&bad, &STAY);
        assert_eq!(tick.pwm, before);
        assert!(tick.faults.measurement.now && tick.faults.battery.now && !tick.faults.command.now);
        let bad = Command { z_m: f32::NAN, ..STAY };
        let tick = controller.tick(&HOVER, &bad);
        assert_eq!(tick.terms.z_command_m, -1.0);
        assert!(tick.faults.command.now && !tick.faults.measurement.now);
        assert_eq!((tick.faults.measurement.count, tick.faults.battery.count), (1, 1));
    }

    #[test]
    fn cut_off_idles_and_forgets_the_integrals() {
        let mut controller = thesis();
        let low = Measurement { position_m: [0.0, 0.0, -0.8], ..HOVER };
        let mut wound_up = 0.0;
        for _ in 0..200 {
            wound_up = controller.tick(&low, &STAY).terms.altitude.i;
        }
        assert!(wound_up < -0.3, "0.2 m for 2 s: {wound_up}");
        let tick = controller.tick(&low, &Command { cut_off: true, injection: [50.0; 4], ..STAY });
        assert_eq!(tick.pwm, [1000.0; 4], "idle, injection or not");
        let after = controller.tick(&low, &STAY).terms.altitude.i;
        assert!((after + 0.002).abs() < 1e-5, "one tick of 0.2 m: {after}");
    }

    #[test]
    fn injection_is_added_behind_the_map_and_clamped() {
        let mut controller = thesis();
        let plain = controller.tick(&HOVER, &STAY).pwm;
        let tick = controller.tick(&HOVER, &Command { injection: [10.0, -20.0, 0.0, 1e9], ..STAY });
        // Hover repeats to the rounding of 1700 us.
        assert!((tick.pwm[0] - plain[0] - 10.0).abs() < 1e-3);
        assert!((tick.pwm[1] - plain[1] + 20.0).abs() < 1e-3);
        assert_eq!(tick.pwm[3], 2000.0);
        // Motor 4 (rear left) at its upper end: it has no more for thrust, roll right and pitch
        // down.
        assert!(tick.refused.thrust.high() && tick.refused.roll.high() && tick.refused.pitch.low());
        assert!(!tick.refused.thrust.low() && !tick.refused.roll.low() && !tick.refused.pitch.high());
    }

    /// What the motors give is what was asked for, as long as they have it; at their end, with 2000 us at 11.1 V, four rotors of
    /// 860.52 rad/s (reference numbers) with the first row of K. The printed map is 0.04 rad/s off its inverse.
    #[test]
    fn the_given_thrust_is_that_of_the_motor_commands() {
        let mut controller = thesis();
        let tick = controller.tick(&HOVER, &Command { attitude_rad: [0.05, -0.03], z_m: -1.1, ..STAY });
        assert!(!tick.refused.any());
        let given_n = controller.given_thrust(&tick);
        assert!((given_n - tick.terms.thrust).abs() < 1e-3, "{given_n} N of {}", tick.terms.thrust);
        let deep = Measurement { position_m: [0.0, 0.0, 0.5], ..HOVER };
        let mut full = Tick::default();
        (0..30).for_each(|_| full = controller.tick(&deep, &STAY));
        assert_eq!(full.pwm, [2000.0; 4]);
        let [per_square, ..] =
            crate::allocation::mixer::inverse(&crate::thesis::THESIS_INVERSE_MIXING).unwrap();
        let want_n = per_square.iter().sum::<f64>() * 860.52 * 860.52;
        let given_n = f64::from(controller.given_thrust(&full));
        assert!((given_n / want_n - 1.0).abs() < 2e-4, "{given_n} N for {want_n}");
        assert!(full.terms.thrust > 25.0 && want_n < 22.5, "{} {want_n}", full.terms.thrust);
    }

    /// A law in command units gives the mean of its commands.
    #[test]
    fn the_given_thrust_of_a_law_in_command_units_is_a_command() {
        let mut controller = Controller::new(&Config::thesis_hand_tuned()).unwrap();
        let tick = controller.tick(&HOVER, &Command { attitude_rad: [0.02, 0.01], ..STAY });
        assert!(!tick.refused.any());
        let given = controller.given_thrust(&tick);
        assert!((given - tick.terms.thrust).abs() < 1e-3, "{given} for {}", tick.terms.thrust);
    }

    /// Saturation flows backwards: with the rotors at their end the integral stands, without
    /// anti-windup it runs.
    #[test]
    fn refused_thrust_stops_the_altitude_integral() {
        let deep = Measurement { position_m: [0.0, 0.0, 0.0], ..HOVER };
        for (anti_windup, stands) in [(true, true), (false, false)] {
            let mut controller = Controller::new(&Config { anti_windup, ..Config::thesis() }).unwrap();
            let command = Command { z_m: -2.0, ..STAY };
            let early = (0..10).map(|_| controller.tick(&deep, &command)).last().unwrap();
            assert!(early.refused.thrust.high(), "18 N/m * 2 m is more than there is");
            let late = (0..100).map(|_| controller.tick(&deep, &command)).last().unwrap();
            assert_eq!(late.terms.altitude.i == early.terms.altitude.i, stands);
            let high = Measurement { position_m: [0.0, 0.0, -3.0], ..HOVER };
            let back = (0..50).map(|_| controller.tick(&high, &command)).last().unwrap();
            assert!(back.terms.altitude.i > late.terms.altitude.i, "unwinds");
        }
    }

    /// Every integral stays as it is while the craft stands on something, and goes on after it; without
    /// anti-windup it runs.
    #[test]
    fn a_craft_that_stands_integrates_nothing() {
        let off = Measurement { attitude_rad: [0.1, -0.1, 0.1], position_m: [0.2, -0.2, -1.02], ..HOVER };
        let command = Command { mode: Mode::Position, ..STAY };
        for anti_windup in [true, false] {
            let mut controller = Controller::new(&Config { anti_windup, ..Config::thesis() }).unwrap();
            let mut integrals = |stands: bool| {
                let mut outcome = Tick::default();
                let guided = Guided {
                    mode: command.mode,
                    cut_off: false,
                    lands: false,
                    stands,
                    command: Some(&command),
                    finite: false,
                };
                controller.tick_into(&off, false, &guided, &mut outcome);
                let Terms { roll, pitch, yaw, altitude, outer, .. } = outcome.terms;
                let OuterTerms { x, y, .. } = outer.unwrap();
                [roll, pitch, yaw, altitude, x, y].map(|terms| terms.i)
            };
            let before = (0..10).map(|_| integrals(false)).last().unwrap();
            let standing = (0..100).map(|_| integrals(true)).last().unwrap();
            let after = integrals(false);
            for loop_ in 0..6 {
                assert_eq!(standing[loop_] == before[loop_], anti_windup, "{loop_}: {standing:?} {before:?}");
                assert_ne!(after[loop_], standing[loop_], "{loop_}");
            }
        }
    }

    #[test]
    fn switching_to_position_mode_starts_where_the_craft_is() {
        let mut controller = thesis();
        let there = Measurement { position_m: [1.0, -0.5, -1.0], ..HOVER };
        let tick = controller.tick(&there, &STAY);
        assert_eq!(tick.terms.outer, None);
        let command = Command { mode: Mode::Position, position_m: [0.0, 0.0], ..STAY };
        let outer = controller.tick(&there, &command).terms.outer.unwrap();
        // One tick at 0.5 m/s towards the command.
        assert!((outer.reference_m[0] - 0.995).abs() < 1e-6 && (outer.reference_m[1] + 0.495).abs() < 1e-6);
        for _ in 0..100 {
            controller.tick(&there, &command);
        }
        controller.tick(&there, &STAY);
        let again = controller.tick(&there, &command).terms.outer.unwrap();
        assert_eq!(again, outer, "the outer loop starts anew");
    }

    #[test]
    fn a_snapshot_flies_on_alike() {
        let mut one = thesis();
        for k in 0..50 {
            one.tick(&Measurement { attitude_rad: [0.001 * k as f32, 0.0, 0.0], ..HOVER }, &STAY);
        }
        let mut other = one;
        for k in 0..50 {
            let measurement = Measurement { attitude_rad: [0.0, 0.001 * k as f32, 0.02], ..HOVER };
            assert_eq!(one.tick(&measurement, &STAY), other.tick(&measurement, &STAY));
        }
    }

    #[test]
    fn corrupted_memory_is_thrown_away() {
        let mut controller = thesis();
        let before = controller.tick(&HOVER, &STAY).pwm;
        controller.memory.estimator =
            Some(controller.laws.estimator.start([f32::NAN; 3], -1.0, 11.1, [0.0; 3]));
        let tick = controller.tick(&HOVER, &STAY);
        assert_eq!((tick.pwm, tick.faults.internal.count), (before, 1), "the last commands once more");
        let tick = controller.tick(&HOVER, &STAY);
        assert_eq!((tick.faults.internal.now, tick.faults.internal.count), (false, 1));
        for (got, want) in tick.pwm.into_iter().zip(before) {
            assert!((got - want).abs() < 1e-3, "flies on");
        }
    }

    #[test]
    fn a_gyro_that_is_wanted_and_missing_is_a_fault() {
        let mut config = Config::thesis();
        config.estimation.gyro =
            Some(GyroFusion { corner_rad_s: 5.0, complement: crate::config::gains::Complement::Exact });
        let mut controller = Controller::new(&config).unwrap();
        assert!(controller.tick(&HOVER, &STAY).faults.measurement.now);
        let turning = Measurement { gyro_rad_s: Some([0.2, 0.0, 0.0]), ..HOVER };
        let tick = controller.tick(&turning, &STAY);
        assert!(!tick.faults.measurement.now);
        // The high-pass lets the jump through: nearly all of it.
        assert!((tick.terms.body_rates_rad_s[0] - 0.2).abs() < 1e-3, "{:?}", tick.terms.body_rates_rad_s);
    }

    /// Ten seconds of flight of the same step at several rates: the laws are built for their
    /// period, the results agree.
    #[test]
    fn the_sample_time_is_a_parameter() {
        let integral_after_a_second = |rate_hz: u16| {
            let config = Config { sample_time_s: 1.0 / f64::from(rate_hz), ..Config::thesis() };
            let mut controller = Controller::new(&config).unwrap();
            controller.tick(&HOVER, &STAY);
            let command = Command { yaw_rad: 0.1, ..STAY };
            (0..rate_hz).map(|_| controller.tick(&HOVER, &command).terms.yaw).last().unwrap()
        };
        // Prefilter 4/(s+4): e(1 s) = 0.1 (1 - exp(-4)), integral 0.1 (1 - (1 - exp(-4)) / 4).
        let (p, i) = (15.0 * 0.098_168, 0.1 * (1.0 - 0.981_684 / 4.0));
        for rate_hz in [100, 250, 1000].into_iter().take(if cfg!(miri) { 1 } else { 3 }) {
            let terms = integral_after_a_second(rate_hz);
            // Backward Euler and the prefilter's sample of delay: within one period of the slope.
            let tolerance = 0.12 / f32::from(rate_hz);
            assert!(
                (terms.p - p).abs() < tolerance && (terms.i - i).abs() < tolerance,
                "{rate_hz} Hz: {terms:?}"
            );
        }
    }

    /// Yaw held at the branch cut of the angle: noise to either side moves no motor by much.
    #[test]
    fn heading_south_is_no_special_place() {
        let mut controller = thesis();
        let pi = core::f32::consts::PI;
        let command = Command { yaw_rad: pi, ..STAY };
        let south = |noise: f32| Measurement {
            attitude_rad: [0.0, 0.0, crate::dsp::trig::wrap_angle(pi + noise)],
            ..HOVER
        };
        let hover = controller.tick(&south(0.0), &command).pwm;
        for k in 0..100 {
            let tick = controller.tick(&south(if k % 2 == 0 { 1e-4 } else { -1e-4 }), &command);
            for (got, want) in tick.pwm.into_iter().zip(hover) {
                // 2e-4 rad in 0.01 s is 0.02 rad/s; times 0.6 of the estimator at half the rate and
                // 5 rad/s^2 per rad/s.
                assert!((got - want).abs() < 3.0, "{k}: {got} {want}");
            }
        }
    }

    #[test]
    fn after_a_reset_it_is_as_new() {
        let mut controller = thesis();
        let low = Measurement { position_m: [0.3, 0.0, -0.8], ..HOVER };
        for _ in 0..50 {
            controller.tick(&low, &Command { mode: Mode::Position, ..STAY });
        }
        assert_ne!(controller, thesis());
        controller.reset();
        assert_eq!(controller, thesis());
    }

    #[test]
    fn a_settled_height_is_the_reference_at_once() {
        let mut controller = thesis();
        controller.tick(&HOVER, &STAY);
        controller.settle_height(-1.5);
        let reference_m = controller.tick(&HOVER, &Command { z_m: -1.5, ..STAY }).terms.z_reference_m;
        assert!((reference_m + 1.5).abs() < 1e-6, "{reference_m}");
    }

    /// A craft that climbs and turns, and is seen elsewhere: its rates are what they would have been, on either branch of the yaw.
    #[test]
    fn a_leap_is_no_motion() {
        let (mut stays, mut leaps) = (thesis(), thesis());
        for k in 0..40 {
            let tick = k as f32;
            let at = |[roll, pitch, yaw]: [f32; 3], z_m: f32| Measurement {
                position_m: [0.0, 0.0, -1.0 - 0.003 * tick + z_m],
                attitude_rad: [
                    0.002 * tick + roll,
                    pitch - 0.001 * tick,
                    crate::dsp::trig::wrap_angle(3.0 + 0.004 * tick + yaw),
                ],
                ..HOVER
            };
            let (turned_rad, down_m) = ([0.1, -0.2, 0.3], -0.5);
            if k == 20 {
                leaps.leap(turned_rad, down_m);
            }
            let seen = if k < 20 { at([0.0; 3], 0.0) } else { at(turned_rad, down_m) };
            let want = stays.tick(&at([0.0; 3], 0.0), &STAY).terms;
            let got = leaps.tick(&seen, &STAY).terms;
            let rates = |terms: &Terms| {
                let [roll, pitch, yaw] = terms.euler_rates_rad_s;
                [roll, pitch, yaw, terms.z_rate_m_s]
            };
            for (got, want) in rates(&got).into_iter().zip(rates(&want)) {
                assert!((got - want).abs() < 2e-4, "{k}: {got} {want}");
            }
        }
        let mut new = thesis();
        new.leap([0.1; 3], 0.1);
        assert_eq!(new, thesis(), "nothing to move");
    }

    /// The weight is carried at every tilt up to 60 degrees, and twice the weight at most.
    #[test]
    fn a_tilted_craft_gets_its_weight_along_the_vertical() {
        let config = Config { tilt_compensation: true, ..Config::thesis() };
        for [roll, pitch] in [[0.0, 0.0], [0.3, 0.0], [-0.5, 0.4], [0.9, -0.5], [1.2, 0.0], [3.0, 0.0]] {
            let tilted = Measurement { attitude_rad: [roll, pitch, 0.3], ..HOVER };
            let command = Command { yaw_rad: 0.3, ..STAY };
            let thrust = Controller::new(&config).unwrap().tick(&tilted, &command).terms.thrust;
            let upright = libm::cos(f64::from(roll)) * libm::cos(f64::from(pitch));
            let want = 11.9093 / upright.max(0.5);
            assert!((f64::from(thrust) / want - 1.0).abs() < 1e-5, "{roll} {pitch}: {thrust} {want}");
        }
    }

    /// At 8.5 V a rotor that stands still is commanded 1051 us (the map's numbers), which is no end of
    /// the range: that it cannot turn backwards is refused all the same. 3 N and 40 rad/s^2 of roll.
    #[test]
    fn a_rotor_that_would_turn_backwards_refuses() {
        let high = Measurement { position_m: [0.0, 0.0, -1.5], battery_v: 8.5, ..HOVER };
        let tick = thesis().tick(&high, &Command { attitude_rad: [1.1, 0.0], ..STAY });
        assert!(tick.pwm.iter().all(|pwm| *pwm > 1040.0 && *pwm < 1900.0), "{:?}", tick.pwm);
        let Refused { thrust, roll, .. } = tick.refused;
        assert!(roll == Directions::HIGH && thrust == Directions::LOW, "{:?}", tick.refused);
        assert!(!thesis().tick(&Measurement { battery_v: 8.5, ..HOVER }, &STAY).refused.any());
    }

    /// No thrust, and a second rotor that is to turn backwards: the first gives all that it is asked for.
    #[test]
    fn a_rotor_that_is_to_stand_still_refuses_nothing() {
        let mut config = Config::thesis();
        let Law::ModelBased(law) = &mut config.law else { panic!("the model-based law") };
        law.hover_thrust_n = 9.0;
        (law.loops.altitude.ki, law.loops.altitude.kd) = (0.0, 0.0);
        law.loops.altitude.prefilter_rad_s = None;
        law.mixing = crate::config::gains::Mixing::Inverse([
            [3e4, 0.0, 0.0, 0.0],
            [0.0, -1e3, 0.0, 0.0],
            [3e4, 1e3, 1e3, 0.0],
            [3e4, 1e3, 0.0, 1e3],
        ]);
        let mut controller = Controller::new(&config).unwrap();
        // 18 N/m at half a metre.
        let high = Measurement { position_m: [0.0, 0.0, -1.5], battery_v: 8.5, ..HOVER };
        let tick = controller.tick(&high, &Command { attitude_rad: [1.1, 0.0], ..STAY });
        assert_eq!((tick.terms.thrust, tick.terms.rotor_speed_rad_s.unwrap()[0]), (0.0, 0.0));
        assert!(tick.refused.roll.high() && !tick.refused.thrust.low(), "{:?}", tick.refused);
    }

    /// Every law with roll and pitch first.
    fn attitude_first(config: Config) -> Controller {
        Controller::new(&Config { saturation: Saturation::AttitudeFirst, ..config }).unwrap()
    }

    fn tilt_fraction(controller: &Controller) -> f32 {
        controller.memory.inner.unwrap().tilt_fraction
    }

    /// 0.05 a second while the motors are nearly saturated, 0.02 a second back.
    #[test]
    fn the_commanded_tilt_falls_while_motors_are_at_their_ends_and_grows_back() {
        let mut controller = attitude_first(Config::thesis());
        let over = Measurement { attitude_rad: [-3.0, 0.0, 0.0], ..HOVER };
        for k in 1..=100 {
            controller.tick(&over, &STAY);
            let want = 1.0 - 5e-4 * k as f32;
            assert!((tilt_fraction(&controller) - want).abs() < 1e-5, "{k}: {}", tilt_fraction(&controller));
        }
        let mut calm = attitude_first(Config::thesis());
        calm.tick(&HOVER, &STAY);
        calm.memory.inner.iter_mut().for_each(|inner| inner.tilt_fraction = 0.95);
        for k in 1..=300 {
            calm.tick(&HOVER, &STAY);
            let want = (0.95 + 2e-4 * k as f32).min(1.0);
            assert!((tilt_fraction(&calm) - want).abs() < 2e-5, "{k}: {}", tilt_fraction(&calm));
        }
        controller.memory.inner.iter_mut().for_each(|inner| inner.tilt_fraction = 2e-3);
        for _ in 0..10 {
            controller.tick(&over, &STAY);
        }
        assert_eq!(tilt_fraction(&controller), 0.0, "and never beyond");
    }

    /// 69 rad/s^2 of roll is nine tenths of what the motors have at any thrust, but at 11 N none of them
    /// is at an end: nothing is refused, and the whole tilt is flown; also where the range begins below 0, whose commands are compared
    /// one by one.
    #[test]
    fn motors_inside_their_range_reduce_no_tilt() {
        for low in [Config::thesis().command_range[0], -1.0] {
            let mut controller = attitude_first(Config { command_range: [low, 2000.0], ..Config::thesis() });
            let high = Measurement { position_m: [0.0, 0.0, -1.05], ..HOVER };
            let tick = controller.tick(&high, &Command { attitude_rad: [1.9, 0.0], ..STAY });
            let [roll, ..] = tick.terms.torque;
            assert!(
                (62.0..72.0).contains(&roll) && tick.pwm.iter().all(|x| *x > 1000.0 && *x < 2000.0),
                "{tick:?}"
            );
            assert_eq!((tilt_fraction(&controller), tick.refused.any()), (1.0, false));
        }
    }

    /// A climb asks for more than there is: the first motor that has no more is at its end, injection and
    /// all, whatever the injection.
    #[test]
    fn an_injection_takes_its_part_of_the_range() {
        for config in [Config::thesis(), Config::thesis_hand_tuned()] {
            for injection in [-50.0, 0.0, 50.0] {
                let mut controller = attitude_first(config);
                let command = Command { z_m: -2.0, injection: [injection; 4], ..STAY };
                let deep = Measurement { position_m: [0.0, 0.0, 0.0], ..HOVER };
                let tick = controller.tick(&deep, &command);
                let most = tick.pwm.into_iter().fold(0.0, f32::max);
                assert!((most - 2000.0).abs() < 0.1 && tick.refused.thrust.high(), "{injection}: {tick:?}");
                let command = Command { z_m: 0.0, injection: [injection; 4], ..STAY };
                let high = Measurement { position_m: [0.0, 0.0, -2.0], ..HOVER };
                let tick = attitude_first(config).tick(&high, &command);
                let least = tick.pwm.into_iter().fold(f32::MAX, f32::min);
                assert!(
                    (1000.0..1100.0).contains(&least) && tick.refused.thrust.low(),
                    "{injection}: {tick:?}"
                );
            }
        }
    }

    /// Numbers of 1e21, as the greatest gains and matrix entries that the checks let pass can make them.
    #[test]
    fn great_numbers_are_numbers() {
        for place in 0..4 {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut four = [1e21, 2e21, 3e21, -1e21];
                assert!(are_finite(four));
                four[place] = bad;
                assert!(!are_finite(four), "{four:?}");
            }
            assert!(!are_finite([f32::INFINITY; 4]) && !are_finite([f32::NEG_INFINITY; 4]));
        }
    }
}
