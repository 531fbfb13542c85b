//! Controller and craft in a closed loop, one tick at a time.

use control::{Pose, Readings};
use pattern::Excitation;

use super::error::SilError;
use super::plan::FlightPlan;
use super::recording::{Recording, Row, Truth};
use super::script::Start;
use crate::craft::{Delay, Faults, SimulatedCraft};
use crate::flight_computer::{FlightComputer, FlightComputerError, InProcess};

/// Controller and craft in lockstep, to be stepped one tick at a time.
#[derive(Debug, Clone)]
pub struct ClosedLoop<'a, L> {
    pub(super) plan: &'a FlightPlan,
    link: L,
    pub(super) craft: SimulatedCraft,
    start: Start,
    delay: Delay<([f32; 3], [f32; 3])>,
    excitation: Option<Excitation>,
    faults: Faults,
    /// What was answered last, in a flight with faults: what the motors go on doing while the loop stalls.
    answered: Option<proto::Outcome>,
    tick: u32,
}

impl<'a> ClosedLoop<'a, InProcess> {
    /// The start of `plan` with the controller in this process.
    ///
    /// # Errors
    /// A plan or configuration that cannot be flown.
    pub fn in_process(plan: &'a FlightPlan) -> Result<Self, SilError> {
        let disarmed = plan.on_the_floor;
        Self::new(
            plan,
            if disarmed { InProcess::disarmed(&plan.config)? } else { InProcess::new(&plan.config)? },
        )
    }
}

impl<'a, L: FlightComputer> ClosedLoop<'a, L> {
    /// The start of `plan` with the controller behind `link`, which must be fresh and built from
    /// the plan's configuration.
    ///
    /// # Errors
    /// A plan or configuration that cannot be flown.
    pub fn new(plan: &'a FlightPlan, link: L) -> Result<Self, SilError> {
        plan.check()?;
        let [low, high] = plan.config.command_range;
        // The thesis' amplitudes are for a range of 1000 us.
        let excitation = Excitation::new(plan.seed, plan.config.sample_time_s, (high - low) / 1000.0);
        Ok(Self {
            link,
            craft: plan.craft()?,
            start: plan.start(),
            delay: Delay::new(plan.delay_samples),
            excitation: plan.excitation.then_some(excitation),
            faults: Faults::default(),
            answered: None,
            tick: 0,
            plan,
        })
    }

    /// One tick, and what was seen, commanded and done in it.
    ///
    /// # Errors
    /// What goes wrong on the link; never in process.
    #[inline]
    pub fn step(&mut self) -> Result<Row, FlightComputerError> {
        let Decided { row, motors, battery_v } = self.decide()?;
        self.craft.advance(&motors, battery_v);
        self.settle();
        Ok(row)
    }

    /// What comes before the craft advances in a tick.
    #[inline(always)]
    pub(super) fn decide(&mut self) -> Result<Decided, FlightComputerError> {
        let battery_v = self.craft.voltage_v();
        let sensed = self.craft.sense(battery_v);
        let (position_m, attitude_rad) = self.delay.push((sensed.position_m, sensed.attitude_rad));
        let time_s = self.time_s();
        let mut command = self.plan.script.command(&self.start, time_s);
        if let Some(excitation) = &mut self.excitation {
            command.injection = excitation.next_sample();
        }
        let mut readings = Readings {
            time_us: self.plan.clock_us.wrapping_add((time_s * 1e6).round() as u32),
            pose: Some(Pose { position_m, attitude_rad }),
            pose_age_us: 0,
            gyro_rad_s: sensed.gyro_rad_s,
            battery_v: sensed.battery_v,
            command: Some(command),
            request: None,
            outputs_ready: true,
        };
        let can_fail = !self.plan.faults.is_empty();
        let stalled = can_fail && self.faults.distort(&self.plan.faults, time_s, &mut readings);
        let outcome = match self.answered {
            Some(answered) if stalled => answered,
            _ => self.link.tick(self.tick, &readings)?,
        };
        let proto::Outcome { output, supervision } = outcome;
        let mut motors = output.pwm;
        if can_fail {
            self.answered = Some(outcome);
            motors = self.faults.motors(&self.plan.faults, time_s, motors, self.plan.config.command_range);
        }
        let truth = Truth::new(&self.craft.state, battery_v);
        let row = Row { truth, sensed, position_command_m: command.position_m, output, supervision };
        Ok(Decided { row, motors, battery_v })
    }

    /// What comes after it.
    #[inline(always)]
    pub(super) fn settle(&mut self) {
        if let Some(roll_rad) = Faults::hangs(&self.plan.faults, self.time_s()) {
            self.craft.hang(roll_rad);
        }
        if let Some(floor_m) = self.plan.floor_m {
            self.craft.stop_at(floor_m);
        }
        self.tick += 1;
    }

    #[inline(always)]
    fn time_s(&self) -> f64 {
        f64::from(self.tick) * self.plan.config.sample_time_s
    }
}

/// What a tick does to the craft.
pub(super) struct Decided {
    pub(super) row: Row,
    /// What the motors get, command units.
    pub(super) motors: [f32; 4],
    /// At the battery's terminals, V.
    pub(super) battery_v: f64,
}

/// Flies `plan` in this process.
///
/// # Errors
/// A plan or configuration that cannot be flown.
pub fn fly(plan: &FlightPlan) -> Result<Recording, SilError> {
    record(&mut ClosedLoop::in_process(plan)?)
}

/// Flies `plan` in this process; besides what was recorded, the motor, 0 to 3, that the craft says has failed.
///
/// # Errors
/// A plan or configuration that cannot be flown.
pub(crate) fn fly_and_ask(plan: &FlightPlan) -> Result<(Recording, Option<u8>), SilError> {
    let mut flight = ClosedLoop::in_process(plan)?;
    Ok((record(&mut flight)?, flight.link.failed_motor()))
}

/// Flies `plan` with the controller behind `link`, as [`ClosedLoop::new`] wants it.
///
/// # Errors
/// A plan or configuration that cannot be flown, or what goes wrong on the link.
pub fn fly_over(plan: &FlightPlan, link: impl FlightComputer) -> Result<Recording, SilError> {
    record(&mut ClosedLoop::new(plan, link)?)
}

fn record<L: FlightComputer>(flight: &mut ClosedLoop<'_, L>) -> Result<Recording, SilError> {
    let plan = flight.plan;
    let count = plan.ticks() as usize + 1;
    let mut rows = Vec::with_capacity(count);
    while rows.len() < count && flight.craft.is_there() {
        rows.push(flight.step()?);
    }
    if let Some(undefined) = flight.craft.fault.take() {
        let time_s = rows.len() as f64 * plan.config.sample_time_s;
        return Err(SilError::Undefined { undefined, time_s });
    }
    Ok(Recording { complete: rows.len() == count, rows, period_s: plan.config.sample_time_s })
}

#[cfg(test)]
mod tests {
    use super::super::script::{Script, Waypoint};
    use super::*;
    use flights::{Column, Flight};
    use model::Model;

    #[test]
    fn equal_plans_give_equal_bits_and_seeds_differ() {
        let plan = |seed| FlightPlan::identification(Model::thesis(), seed, 5.0);
        let one = fly(&plan(1)).unwrap();
        assert_eq!(one, fly(&plan(1)).unwrap());
        assert_ne!(one, fly(&plan(2)).unwrap());
    }

    #[test]
    fn impossible_plans_are_refused_by_name() {
        type Edit = fn(&mut FlightPlan);
        let edits: [(Edit, &str); 5] = [
            (|p| p.duration_s = f64::NAN, "duration_s"),
            (|p| p.duration_s = 0.0, "duration_s"),
            (|p| p.substeps = Some(0), "substeps"),
            (|p| p.start_m[1] = f64::INFINITY, "start_m"),
            (|p| p.config.sample_time_s = -0.01, "sample_time_s"),
        ];
        for (edit, field) in edits {
            let mut plan = FlightPlan::thesis();
            edit(&mut plan);
            let error = fly(&plan).unwrap_err().to_string();
            assert!(error.contains(field), "{field}: {error}");
            assert_eq!(error.lines().count(), 1);
        }
    }

    #[test]
    fn yaw_runs_on_through_a_turn() {
        let mut plan = FlightPlan::thesis();
        plan.script = Script::Waypoints {
            list: (0..9)
                .map(|k| Waypoint {
                    from_s: f64::from(k),
                    position_m: [0.0, 0.0, -1.0],
                    yaw_rad: f64::from(k) * 0.8,
                })
                .collect(),
            repeat_s: None,
        };
        let yaw: Vec<f64> = fly(&plan).unwrap().euler_rad().iter().map(|e| e[2]).collect();
        assert!(yaw.windows(2).all(|w| (w[1] - w[0]).abs() < 0.1));
        assert!((yaw.last().unwrap() - 6.4).abs() < 0.3, "{:?}", yaw.last());
    }

    #[test]
    fn a_flight_file_reads_back() {
        let recording = fly(&FlightPlan::identification(Model::thesis(), 3, 3.0)).unwrap();
        let flight = recording.to_flight("f.csv", true);
        let back = Flight::parse(flight.to_csv().as_bytes(), std::path::Path::new("f.csv")).unwrap();
        assert_eq!(back, flight);
        assert_eq!(back.len(), 301);
        assert_eq!(back.column(Column::T).unwrap()[29], 0.29);
        assert!(recording.to_flight("f.csv", false).column(Column::Omega1).is_none());
    }
}
