//! The controller against closed-loop runs of the thesis' law that another program recorded
//! (`golden/README.md`).
//!
//! Open loop on purpose: the recorded measurements go in, the recorded commands must come out. An
//! error of the law cannot hide behind the feedback, and none of our plant is involved.
//!
//! Tolerance: 1e-4 of each signal's range in the run. The controller computes in f32 (6e-8) on
//! inputs rounded to f32; the rate estimators multiply those roundings by 30, the lag canceller's
//! slow pole (0.9979) adds up about 500 of them, and together that is a few 1e-5 of the range. A
//! wrong gain, sign, order of operations or one tick of delay is 1e-2 or more
//! (`the_tolerance_is_tight_enough` checks the smallest of those).

use control::filter::GainRule;
use control::gains::{Law, VelocityEstimator};
use control::{Command, Config, Controller, Measurement, Mode, Tick};

const TOLERANCE: f64 = 1e-4;

struct Run {
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Run {
    fn read(text: &str) -> Self {
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let rows = lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
        Self { header, rows }
    }

    fn column(&self, name: &str) -> impl Iterator<Item = f64> {
        let index = self.header.iter().position(|h| h == name).unwrap_or_else(|| panic!("no column {name}"));
        self.rows.iter().map(move |row| row[index])
    }

    fn range(&self, name: &str) -> f64 {
        let (low, high) =
            self.column(name).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    }

    /// Feeds the recorded measurements and commands to a controller.
    fn fly(&self, config: &Config, mode: Mode) -> Vec<Tick> {
        let mut controller = Controller::new(config).unwrap();
        let columns = ["x", "y", "z", "phi", "theta", "psi", "vbat"];
        let commands = ["cmd_phi", "cmd_theta", "cmd_psi", "cmd_z", "cmd_x", "cmd_y"];
        let index = |name: &&str| self.header.iter().position(|h| h == name).unwrap();
        let measured: Vec<usize> = columns.iter().map(index).collect();
        let commanded: Vec<usize> = commands.iter().map(index).collect();
        self.rows
            .iter()
            .map(|row| {
                let m = |k: usize| row[measured[k]] as f32;
                let c = |k: usize| row[commanded[k]] as f32;
                let measurement = Measurement {
                    position_m: [m(0), m(1), m(2)],
                    attitude_rad: [m(3), m(4), m(5)],
                    gyro_rad_s: None,
                    battery_v: m(6),
                };
                let command = Command {
                    mode,
                    attitude_rad: [c(0), c(1)],
                    yaw_rad: c(2),
                    z_m: c(3),
                    position_m: [c(4), c(5)],
                    ..Command::default()
                };
                controller.tick(&measurement, &command)
            })
            .collect()
    }

    /// The largest difference of a signal, as a share of its range in the run (or of `floor`, if it
    /// hardly moves).
    fn worst(&self, ticks: &[Tick], name: &str, floor: f64, signal: impl Fn(&Tick) -> f32) -> f64 {
        let scale = self.range(name).max(floor);
        self.column(name)
            .zip(ticks)
            .map(|(want, tick)| (f64::from(signal(tick)) - want).abs() / scale)
            .fold(0.0, f64::max)
    }

    /// Every recorded signal's name and largest difference. The floors are about a tenth of what
    /// the signal does in the pattern, so that an axis that stands still is not compared with its
    /// own rounding: z near -1 m is held to 6e-8 m in f32, which is a few 1e-6 m/s behind the
    /// estimator's gain of 30 whatever is done with it.
    fn differences(&self, ticks: &[Tick]) -> Vec<(&'static str, f64)> {
        let mut all = Vec::new();
        let mut add = |name, floor, signal: &dyn Fn(&Tick) -> f32| {
            all.push((name, self.worst(ticks, name, floor, signal)));
        };
        add("p", 0.1, &|t| t.terms.body_rates_rad_s[0]);
        add("q", 0.1, &|t| t.terms.body_rates_rad_s[1]);
        add("r", 0.1, &|t| t.terms.body_rates_rad_s[2]);
        add("z_rate", 0.1, &|t| t.terms.z_rate_m_s);
        add("phi_c", 0.01, &|t| t.terms.attitude_command_rad[0]);
        add("theta_c", 0.01, &|t| t.terms.attitude_command_rad[1]);
        add("e_phi", 0.01, &|t| t.terms.attitude_error_rad[0]);
        add("e_theta", 0.01, &|t| t.terms.attitude_error_rad[1]);
        add("e_psi", 0.01, &|t| t.terms.attitude_error_rad[2]);
        add("e_z", 0.05, &|t| t.terms.z_error_m);
        add("thrust", 1.0, &|t| t.terms.thrust);
        add("tau_phi", 1.0, &|t| t.terms.torque[0]);
        add("tau_theta", 1.0, &|t| t.terms.torque[1]);
        add("tau_psi", 1.0, &|t| t.terms.torque[2]);
        add("pwm1", 20.0, &|t| t.pwm[0]);
        add("pwm2", 20.0, &|t| t.pwm[1]);
        add("pwm3", 20.0, &|t| t.pwm[2]);
        add("pwm4", 20.0, &|t| t.pwm[3]);
        all
    }
}

fn check(text: &str, config: &Config, mode: Mode) {
    let run = Run::read(text);
    assert!(run.rows.len() > 200);
    let ticks = run.fly(config, mode);
    for (name, worst) in run.differences(&ticks) {
        println!("{name:>8}: {worst:.2e} of its range");
        assert!(worst < TOLERANCE, "{name}: {worst:.2e} of its range");
    }
    let last = ticks.last().unwrap();
    assert_eq!(last.faults, control::Faults::default());
    assert!(ticks.iter().all(|tick| !tick.refused.any()));
}

fn with_estimator(velocity: VelocityEstimator, gain_rule: GainRule) -> Config {
    let mut config = Config::thesis();
    config.estimation.velocity = velocity;
    config.estimation.gain_rule = gain_rule;
    config
}

const PATTERN: &str = include_str!("golden/pattern.csv");

#[test]
fn roll_of_ten_degrees() {
    check(include_str!("golden/roll_10.csv"), &Config::thesis(), Mode::Attitude);
}

#[test]
fn one_metre_along_x() {
    check(include_str!("golden/x_1.csv"), &Config::thesis(), Mode::Position);
}

#[test]
fn all_axes_at_once() {
    check(PATTERN, &Config::thesis(), Mode::Position);
}

#[test]
fn slope_matched_filters() {
    let config = with_estimator(VelocityEstimator::CRITICAL_150, GainRule::Slope);
    check(include_str!("golden/pattern_slope.csv"), &config, Mode::Position);
}

#[test]
fn the_estimator_as_printed() {
    let config = with_estimator(VelocityEstimator::PRINTED_75, GainRule::Matlab);
    check(include_str!("golden/pattern_printed75.csv"), &config, Mode::Position);
}

/// The law of the identification flights, with this crate's gains for it. Its outputs are in
/// microseconds, so its floors (1 us of thrust and torque) are stricter still.
#[test]
fn the_hand_tuned_law() {
    check(include_str!("golden/hand_tuned.csv"), &Config::thesis_hand_tuned(), Mode::Position);
}

/// The smallest mistakes that were ever made with this law are far outside the tolerance.
#[test]
#[cfg_attr(miri, ignore = "flies what other tests have flown, to weigh their tolerance")]
fn the_tolerance_is_tight_enough() {
    let run = Run::read(PATTERN);
    let loops = |change: fn(&mut control::gains::Loops)| {
        let mut config = Config::thesis();
        let Law::ModelBased(law) = &mut config.law else { unreachable!() };
        change(&mut law.loops);
        config
    };
    let mistakes = [
        ("wrong pole of the canceller", loops(|l| l.roll.canceller.as_mut().unwrap().pole_rad_s = 0.2211)),
        ("slope rule", with_estimator(VelocityEstimator::CRITICAL_150, GainRule::Slope)),
        ("no integral of position", loops(|l| l.x.ki = 0.0)),
        ("yaw prefilter of roll", loops(|l| l.yaw.prefilter_rad_s = Some(5.0))),
    ];
    for (name, config) in mistakes {
        let ticks = run.fly(&config, Mode::Position);
        let worst = run.differences(&ticks).into_iter().map(|(_, worst)| worst).fold(0.0, f64::max);
        assert!(worst > 10.0 * TOLERANCE, "{name}: {worst:.2e}");
    }
}
