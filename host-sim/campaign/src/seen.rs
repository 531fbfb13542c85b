//! What comes of a flight, gathered while it lasts: its rows need not be kept for that.

use control::state_machine::{Action, action};
use control::{Condition, Conditions};
use proto::State;
use sil::endurance::{Crash, Crashed};
use sil::{Judge, Row, time_of_row_s};

use crate::draw::Flies;
use crate::flown::{Flown, Planned, SEPARATOR};

/// What was seen of a flight so far.
pub(crate) struct Seen<'a> {
    planned: &'a Planned,
    /// Whether it fulfils its scenario; nothing of a tour.
    judge: Option<Judge<'a>>,
    ticks: usize,
    /// The first tick upside down.
    tilted: Option<usize>,
    /// Cosine of the greatest tilt.
    upright: f64,
    /// Sum of the squares of the distance from the commanded height, m^2.
    height_error_m2: f64,
    saturated_ticks: usize,
    /// All conditions that the supervisor saw.
    conditions: u32,
    state: Option<State>,
}

impl<'a> Seen<'a> {
    /// Of a flight that begins.
    pub(crate) fn new(planned: &'a Planned) -> Self {
        let judge = match planned.flies {
            Flies::Scenario(scenario) => Some(Judge::new(scenario, &planned.plan)),
            Flies::Tour => None,
        };
        Self {
            planned,
            judge,
            ticks: 0,
            tilted: None,
            upright: 1.0,
            height_error_m2: 0.0,
            saturated_ticks: 0,
            conditions: 0,
            state: None,
        }
    }

    /// Its next tick.
    #[inline(always)]
    pub(crate) fn tick(&mut self, row: &Row) {
        let upright = row.truth.upright();
        if upright <= 0.0 && self.tilted.is_none() {
            self.tilted = Some(self.ticks);
        }
        self.upright = self.upright.min(upright);
        self.height_error_m2 += f64::from(row.truth.position_m[2] - row.output.z_command_m).powi(2);
        self.saturated_ticks += usize::from(row.is_saturated(self.planned.plan.config.command_range));
        self.conditions |= row.supervision.conditions;
        self.state = Some(row.supervision.state);
        if let Some(judge) = &mut self.judge {
            judge.tick(row);
        }
        self.ticks += 1;
    }

    /// What came of it, but for whether anybody could have flown it.
    pub(crate) fn end(self, crash: Crashed) -> Flown {
        let Planned { case, drawn, plan, .. } = self.planned;
        let judged = self.judge.map(|judge| judge.end(crash.is_none()));
        let metrics = judged.as_ref().and_then(|judged| judged.metrics);
        let upside_down = self
            .tilted
            .map(|tick| ("upside down".to_owned(), time_of_row_s(tick, plan.config.sample_time_s)));
        let ticks = self.ticks.max(1) as f64;
        Flown {
            case: *case,
            drawn: drawn.clone(),
            duration_s: plan.duration_s,
            lost: crash.map(|(crash, at_s)| (told(&crash), at_s)).or(upside_down),
            impossible: None,
            ended: self.state.map_or(String::new(), |state| format!("{state:?}").to_lowercase()),
            events: events(self.conditions),
            requirements_hold: judged.map(|judged| judged.pass()),
            overshoot_percent: metrics.map_or(f64::NAN, |metrics| metrics.overshoot_percent),
            rise_s: metrics.and_then(|metrics| metrics.rise_s).unwrap_or(f64::NAN),
            tilt_deg: self.upright.clamp(-1.0, 1.0).acos().to_degrees(),
            height_error_m: (self.height_error_m2 / ticks).sqrt(),
            saturated_percent: 100.0 * self.saturated_ticks as f64 / ticks,
        }
    }
}

/// A crash in words without numbers, so that equal ones can be counted.
fn told(crash: &Crash) -> String {
    match crash {
        Crash::Cut(conditions) => {
            let cuts = |condition: &&Condition| {
                action(control::State::Flying, Conditions::from_bits(condition.bit())) >= Action::Cut
            };
            let names: Vec<&str> = conditions.iter().filter(cuts).map(|condition| condition.name()).collect();
            format!("motors cut: {}", names.join(", "))
        }
        Crash::DisarmedAt(_) => "disarmed in the air".into(),
        Crash::Floor(_) => "hit the floor".into(),
        Crash::Cage(_) => "left the cage".into(),
        Crash::Lost => "not finite".into(),
    }
}

/// The names of conditions.
fn events(conditions: u32) -> String {
    let names: Vec<&str> =
        Conditions::from_bits(conditions).iter().map(|condition| condition.name()).collect();
    names.join(SEPARATOR)
}
