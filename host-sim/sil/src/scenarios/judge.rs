//! Whether a flight fulfils its scenario, gathered tick by tick: its rows need not be kept for that.

use design::analysis::{StepMetrics, step_metrics};

use super::scenario::{Course, PATTERN_LEG_S, RequirementCheck, Scenario, step_of};
use crate::flight::{FlightPlan, Follower, Row, Script, StepCommand};

/// Overshoot beyond which control counts as lost, per cent (as in the reference).
const LOST_OVERSHOOT_PERCENT: f64 = 50.0;

/// Looks at a flight from its first tick to its last.
#[derive(Debug, Clone)]
pub struct Judge<'a> {
    scenario: Scenario,
    plan: &'a FlightPlan,
    /// The step, the value that it starts from, and its tick.
    step: Option<(StepCommand, f64, usize)>,
    follower: Follower,
    response: Vec<f64>,
    course: Course,
    ticks: usize,
    saturated_ticks: usize,
    upright: bool,
}

/// What came of a flight of a scenario.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The response divided by the step, from the step on; empty without a step.
    pub response: Vec<f64>,
    /// Its numbers; `None` without a step.
    pub metrics: Option<StepMetrics>,
    /// More than 50 % overshoot, upside down, or not finite.
    pub lost_control: bool,
    /// Ticks with a motor command at an end of its range.
    pub saturated_ticks: usize,
    /// Requirements.
    pub checks: Vec<RequirementCheck>,
}

impl Judged {
    /// Whether control was kept and every requirement holds.
    pub fn pass(&self) -> bool {
        passes(self.lost_control, &self.checks)
    }
}

/// Whether control was kept and every requirement holds.
pub(super) fn passes(lost_control: bool, checks: &[RequirementCheck]) -> bool {
    !lost_control && checks.iter().all(|check| check.holds)
}

impl<'a> Judge<'a> {
    /// Of a flight that begins.
    pub fn new(scenario: Scenario, plan: &'a FlightPlan) -> Self {
        let period_s = plan.config.sample_time_s;
        let step = step_of(plan).map(|(step, base)| (step, base, (step.at_s / period_s).round() as usize));
        let count = step.map_or(0, |(_, _, first)| (plan.ticks() as usize + 1).saturating_sub(first));
        Self {
            scenario,
            plan,
            step,
            follower: Follower::default(),
            response: Vec::with_capacity(count),
            course: Course { margin_m: f64::INFINITY, angle_rad: 0.0, height_m: 0.0, miss_m: 0.0 },
            ticks: 0,
            saturated_ticks: 0,
            upright: true,
        }
    }

    /// Its next tick.
    #[inline]
    pub fn tick(&mut self, row: &Row) {
        if let Some((step, base, first)) = self.step {
            let value = self.follower.value(step.axis, &row.truth);
            if self.ticks >= first {
                self.response.push((value - base) / step.size);
            }
        }
        // What is required of a step is told by its response alone.
        if self.response.is_empty() || self.scenario.stepped().is_none() {
            self.course.margin_m = self.course.margin_m.min(row.cage_margin_m());
        }
        match self.scenario {
            Scenario::Hover => self.hover(row),
            Scenario::Pattern => self.pattern(row),
            _ => {}
        }
        self.saturated_ticks += usize::from(row.is_saturated(self.plan.config.command_range));
        self.upright &= row.truth.upright() > 0.0;
        self.ticks += 1;
    }

    fn hover(&mut self, row: &Row) {
        let [_, _, z_m] = self.plan.start_m;
        let angles = self.follower.euler_rad(&row.truth);
        let Course { angle_rad, height_m, .. } = &mut self.course;
        *angle_rad = angles.into_iter().fold(*angle_rad, |most, angle| most.max(angle.abs()));
        *height_m = height_m.max((f64::from(row.truth.position_m[2]) - z_m).abs());
    }

    /// The way-point is to be reached by the end of its leg.
    fn pattern(&mut self, row: &Row) {
        let Script::Waypoints { list, .. } = &self.plan.script else { return };
        let leg_ticks = ((PATTERN_LEG_S / self.plan.config.sample_time_s).round() as usize).max(1);
        let flown = self.ticks + 1;
        if !flown.is_multiple_of(leg_ticks) {
            return;
        }
        let Some(waypoint) = list.iter().cycle().nth(flown / leg_ticks - 1) else { return };
        let miss = |(at, wanted): (f32, f64)| (f64::from(at) - wanted).powi(2);
        let miss_m = row.truth.position_m.into_iter().zip(waypoint.position_m).map(miss).sum::<f64>().sqrt();
        self.course.miss_m = self.course.miss_m.max(miss_m);
    }

    /// The end: what came of it. `complete`: its state stayed finite, and it did not crash.
    pub fn end(self, complete: bool) -> Judged {
        let period_s = self.plan.config.sample_time_s;
        let metrics = (!self.response.is_empty()).then(|| step_metrics(&self.response, period_s));
        let within = metrics.is_none_or(|m| m.overshoot_percent <= LOST_OVERSHOOT_PERCENT);
        Judged {
            lost_control: !(complete && self.upright && within),
            saturated_ticks: self.saturated_ticks,
            checks: self.scenario.checks(self.plan, &self.course, metrics.as_ref()),
            response: self.response,
            metrics,
        }
    }
}
