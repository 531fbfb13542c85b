//! What people see: lines for a log ([`Plain`]), or a picture of now in the terminal ([`Live`])
//! with keys to fly by.
//!
//! The picture is a pure function of a [`Snapshot`] ([`draw`]); names of faults and checks are the
//! flight law's own.

use std::io::Write;
use std::sync::mpsc::Sender;
use std::time::Duration;

use control::Conditions;
use control::Preflight;
use proto::{Mode, State, Telemetry};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};
use ratatui::{DefaultTerminal, Frame};

use crate::link::Pace;
use crate::recording::Level;
use crate::run::{Input, View};
use crate::station::{Notice, PilotRequest, SILENCE_S, Snapshot};

/// Keys and what they do, in the order they are shown.
const KEYS: [(char, &str, Input); 8] = [
    ('a', "arm", Input::Request(PilotRequest::Arm)),
    ('t', "take off", Input::Request(PilotRequest::TakeOff)),
    ('p', "pattern", Input::Request(PilotRequest::Pattern)),
    ('l', "land", Input::Request(PilotRequest::Land)),
    ('D', "disarm", Input::Request(PilotRequest::Disarm)),
    ('Y', "yes", Input::Request(PilotRequest::Confirm)),
    (' ', "CUT", Input::Request(PilotRequest::Cut)),
    ('q', "quit", Input::Quit),
];

/// What a key does. Disarming in the air is a fall, so it takes the upper case, and then another key.
pub fn key(pressed: char) -> Option<Input> {
    KEYS.iter().find(|(letter, ..)| *letter == pressed).map(|(_, _, input)| *input)
}

/// `[  12.3 s] warning: words`
fn line(notice: &Notice) -> String {
    let word = match notice.level {
        Level::Info => "",
        Level::Warning => "warning: ",
        Level::Error => "ERROR: ",
    };
    format!("[{:7.1} s] {word}{}", notice.at_us as f64 * 1e-6, notice.text)
}

/// A line for each thing that happens, and one about the link every five seconds.
#[derive(Debug)]
pub struct Plain<W> {
    out: W,
    next_status_us: u64,
}

/// Between two lines about the link, us.
const STATUS_US: u64 = 5_000_000;

impl<W: Write> Plain<W> {
    /// Lines to `out`.
    pub fn new(out: W) -> Self {
        Self { out, next_status_us: STATUS_US }
    }
}

impl<W: Write + Send> View for Plain<W> {
    fn notice(&mut self, notice: &Notice) {
        // A reader that has left has seen enough; the flight goes on.
        let _ = writeln!(self.out, "{}", line(notice));
    }

    fn show(&mut self, now: &Snapshot) {
        if now.now_us >= self.next_status_us {
            self.next_status_us = now.now_us + STATUS_US;
            let notice = Notice { at_us: now.now_us, level: Level::Info, text: status(now) };
            let _ = writeln!(self.out, "{}", line(&notice));
        }
    }
}

/// Craft and link in one line.
fn status(now: &Snapshot) -> String {
    let Some((telemetry, _)) = &now.telemetry else { return "the craft is not connected yet".into() };
    let [x, y, z] = telemetry.tracked.position_m;
    let craft = format!(
        "{:?} at x {x:.2} y {y:.2} height {:.2} m, {:.2} V",
        telemetry.supervision.state, -z, telemetry.battery_v
    );
    match &now.link {
        Some(link) => format!(
            "{craft}; {:.1} ms one way, lost {:.1} % up {:.1} % down, clock {:+.2} %, poses {:.0} Hz",
            link.one_way_s * 1e3,
            link.lost_up * 100.0,
            link.lost_down * 100.0,
            link.skew * 100.0,
            link.pose_hz
        ),
        None => craft,
    }
}

/// The terminal as a picture. It is put back when this goes.
#[derive(Debug)]
pub struct Live {
    terminal: DefaultTerminal,
}

impl Live {
    /// Takes the terminal over; keys go to `inputs` from a thread of their own.
    ///
    /// # Errors
    /// Output that is not a terminal.
    pub fn start(inputs: Sender<Input>) -> std::io::Result<Self> {
        let terminal = ratatui::try_init()?;
        std::thread::spawn(move || read_keys(&inputs));
        Ok(Self { terminal })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

impl View for Live {
    fn notice(&mut self, _: &Notice) {}

    fn show(&mut self, snapshot: &Snapshot) {
        // A terminal that has gone is no reason to stop flying.
        let _ = self.terminal.draw(|frame| draw(frame, snapshot));
    }
}

/// Reads keys until nobody listens. In raw mode Ctrl-C is a key.
fn read_keys(inputs: &Sender<Input>) {
    loop {
        if !event::poll(Duration::from_millis(200)).unwrap_or(false) {
            continue;
        }
        let Ok(Event::Key(pressed)) = event::read() else { continue };
        if pressed.kind != KeyEventKind::Press {
            continue;
        }
        let input = match pressed.code {
            KeyCode::Char('c') if pressed.modifiers.contains(KeyModifiers::CONTROL) => Some(Input::Quit),
            KeyCode::Char(letter) => key(letter),
            KeyCode::Esc => Some(Input::Quit),
            _ => None,
        };
        if let Some(input) = input
            && inputs.send(input).is_err()
        {
            return;
        }
    }
}

fn colour(level: Level) -> Color {
    match level {
        Level::Info => Color::Reset,
        Level::Warning => Color::Yellow,
        Level::Error => Color::Red,
    }
}

fn good(good: bool) -> Style {
    Style::new().fg(if good { Color::Green } else { Color::Red })
}

/// The whole picture.
pub fn draw(frame: &mut Frame<'_>, now: &Snapshot) {
    let [head, middle, faults, lines, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(9),
        Constraint::Length(4),
        Constraint::Min(3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let [craft, link] = Layout::horizontal([Constraint::Percentage(50); 2]).areas(middle);
    frame.render_widget(Paragraph::new(headline(now)), head);
    frame.render_widget(Paragraph::new(craft_lines(now)).block(Block::bordered().title(" craft ")), craft);
    frame.render_widget(Paragraph::new(link_lines(now)).block(Block::bordered().title(" link ")), link);
    frame.render_widget(
        Paragraph::new(fault_lines(now)).block(Block::bordered().title(" faults and checks ")),
        faults,
    );
    log(frame, now, lines);
    let help: Vec<String> = KEYS
        .iter()
        .map(|(letter, what, _)| match letter {
            ' ' => format!("space {what}"),
            other => format!("{other} {what}"),
        })
        .collect();
    frame.render_widget(Paragraph::new(help.join("   ")), keys);
}

fn headline(now: &Snapshot) -> Line<'static> {
    let state = match &now.telemetry {
        Some((telemetry, at_us)) => {
            let silent = now.now_us.saturating_sub(*at_us) as f64 * 1e-6 > SILENCE_S;
            let state = telemetry.supervision.state;
            let colour = match state {
                _ if silent => Color::Red,
                State::Disarmed => Color::Gray,
                State::Armed => Color::Yellow,
                State::Flying => Color::Green,
                State::Hold | State::Land => Color::Yellow,
                State::Cut => Color::Red,
            };
            let word = if silent { "LOST, last state" } else { "" };
            Span::styled(
                format!(" {word} {state:?} "),
                Style::new().fg(Color::Black).bg(colour).add_modifier(Modifier::BOLD),
            )
        }
        None => Span::styled(" no craft yet ", Style::new().fg(Color::Black).bg(Color::Gray)),
    };
    let recording = now.recording.as_ref().map_or("not recording".into(), |file| format!("recording {file}"));
    Line::from(vec![state, Span::raw(format!("  {}   {recording}", now.doing))])
}

fn craft_lines(now: &Snapshot) -> Vec<Line<'static>> {
    let Some((telemetry, _)) = &now.telemetry else { return Vec::new() };
    let Telemetry { tracked, mode, pwm, battery_v, current_a, refused, .. } = telemetry;
    let [x, y, z] = tracked.position_m;
    let [roll, pitch, yaw] = tracked.attitude_rad.map(f32::to_degrees);
    let mode = match mode {
        Mode::Attitude => "attitude",
        Mode::Position => "position",
    };
    let current = current_a.map_or(String::new(), |a| format!("  {a:.1} A"));
    let motors = pwm.map(|pwm| format!("{pwm:.0}")).join(" ");
    let limits = if refused.any() { "   at their limits" } else { "" };
    vec![
        Line::from(format!("battery   {battery_v:.2} V{current}")),
        Line::from(format!("mode      {mode}")),
        Line::from(format!("place     x {x:+.3}  y {y:+.3}  height {:+.3} m", -z)),
        Line::from(format!("attitude  roll {roll:+.1}  pitch {pitch:+.1}  yaw {yaw:+.1} deg")),
        Line::from(format!("motors    {motors}{limits}")),
        Line::from(format!("tick      {}", telemetry.tick)),
    ]
}

fn link_lines(now: &Snapshot) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if let Some(link) = &now.link {
        let loss = link.lost_up.max(link.lost_down);
        lines.push(Line::from(format!(
            "delay     {:.1} ms one way (network {:.1} ms)",
            link.one_way_s * 1e3,
            link.least_one_way_s * 1e3
        )));
        lines.push(Line::styled(
            format!("lost      {:.1} % up, {:.1} % down", link.lost_up * 100.0, link.lost_down * 100.0),
            good(loss < 0.05),
        ));
        let (word, style) = match now.pace {
            Pace::Unknown => ("not known yet", Style::new()),
            Pace::Good => ("good", good(true)),
            Pace::Fast => ("RUNS FAST", good(false)),
            Pace::Slow => ("RUNS SLOW", good(false)),
        };
        lines.push(Line::styled(
            format!("clock     {word}, {:+.3} % +- {:.3} %", link.skew * 100.0, link.skew_std_error * 100.0),
            style,
        ));
        lines.push(Line::from(format!("ticks     {:.1} Hz", link.tick_hz)));
        lines.push(Line::styled(format!("poses     {:.0} Hz", link.pose_hz), good(link.pose_hz > 20.0)));
    }
    let tracker = &now.tracker;
    lines.push(Line::from(format!(
        "tracker   {} seen, {} not, {} refused",
        tracker.seen, tracker.not_seen, tracker.refused
    )));
    lines.push(Line::from(format!(
        "packets   {} received, {} refused",
        now.statistics.accepted, now.statistics.refused
    )));
    lines
}

fn fault_lines(now: &Snapshot) -> Vec<Line<'static>> {
    let Some((telemetry, _)) = &now.telemetry else { return Vec::new() };
    let supervision = &telemetry.supervision;
    let raised: Vec<_> = Conditions::from_bits(supervision.conditions)
        .iter()
        .filter(|condition| !condition.is_asked_for())
        .map(|condition| condition.name())
        .collect();
    let faults = match raised.as_slice() {
        [] => Line::styled("no faults", good(true)),
        names => Line::styled(names.join(", "), good(false)),
    };
    let checks = if supervision.state == State::Disarmed {
        let missing: Vec<_> = Preflight::from_bits(supervision.preflight).missing().collect();
        match missing.as_slice() {
            [] => Line::styled("ready to arm", good(true)),
            names => Line::styled(format!("not ready: {}", names.join(", ")), Style::new().fg(Color::Yellow)),
        }
    } else {
        let counters = &telemetry.counters;
        Line::from(format!(
            "late ticks {}, clock leaps {}, poses refused {}, IMU refused {}, commands refused {}",
            counters.overruns,
            counters.clock_jumps,
            counters.poses_refused,
            counters.imu_refused,
            counters.commands_refused
        ))
    };
    vec![faults, checks]
}

fn log(frame: &mut Frame<'_>, now: &Snapshot, area: Rect) {
    let room = usize::from(area.height.saturating_sub(2));
    let last = now.notices.iter().skip(now.notices.len().saturating_sub(room));
    let lines: Vec<Line<'_>> =
        last.map(|notice| Line::styled(line(notice), Style::new().fg(colour(notice.level)))).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(" log ")), area);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::LinkRecord;
    use crate::station::Tracker;
    use control::Condition;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn snapshot() -> Snapshot {
        let telemetry: Telemetry = serde_json::from_value(serde_json::json!({
            "tick": 7, "craft_us": 1, "ground_us": 1,
            "supervision": {
                "state": "Flying", "preflight": 0,
                "conditions": Condition::BatteryLow.bit() | Condition::PoseLate.bit() | Condition::FlightRequested.bit(),
            },
            "mode": "Position", "attitude_command_rad": [0, 0, 0], "z_command_m": -1.0,
            "tracked": { "position_m": [0.5, -0.25, -1.5], "attitude_rad": [0.1, 0.0, 0.0] },
            "tracked_rates_rad_s": [0, 0, 0], "imu": null, "thrust": 1.0, "torque": [0, 0, 0],
            "pwm": [1500.0, 1501.0, 1502.0, 1503.0],
            "refused": { "thrust": [false, false], "roll": [true, false], "pitch": [false, false], "yaw": [false, false] },
            "battery_v": 10.5, "current_a": null,
            "counters": {
                "jitter_us": 0, "overruns": 0, "clock_jumps": 0, "poses_refused": 3, "imu_refused": 0,
                "commands_refused": 0, "faults": 0, "packets_lost": 0, "packets_refused": 0,
            },
        }))
        .unwrap();
        Snapshot {
            now_us: 12_300_000,
            telemetry: Some((telemetry, 12_299_000)),
            identity: None,
            link: Some(LinkRecord {
                one_way_s: 0.0065,
                least_one_way_s: 0.002,
                skew: 0.0118,
                skew_std_error: 0.0002,
                tick_hz: 101.2,
                lost_down: 0.02,
                lost_up: 0.0,
                pose_hz: 100.0,
            }),
            pace: Pace::Fast,
            tracker: Tracker { seen: 1200, not_seen: 4, ..Tracker::default() },
            statistics: proto::Statistics { accepted: 1234, refused: 5, lost: 6 },
            doing: "pattern".into(),
            notices: vec![Notice { at_us: 12_000_000, level: Level::Warning, text: "battery low".into() }],
            recording: Some("flight.mcap.part".into()),
        }
    }

    fn picture(snapshot: &Snapshot, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, snapshot)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn a_picture_says_what_matters() {
        let text = picture(&snapshot(), 110, 30);
        for words in [
            "Flying",
            "pattern",
            "flight.mcap.part",
            "10.50 V",
            "height +1.500 m",
            "roll +5.7",
            "1500 1501 1502 1503",
            "at their limits",
            "6.5 ms one way",
            "RUNS FAST, +1.180 %",
            "101.2 Hz",
            "0.0 % up, 2.0 % down",
            "pose late, battery low",
            "poses refused 3",
            "1200 seen, 4 not",
            "warning: battery low",
            "space CUT",
            "D disarm",
        ] {
            assert!(text.contains(words), "{words}\n{text}");
        }
        assert!(!text.contains("flight requested"), "what was asked for is no fault");
    }

    #[test]
    fn on_the_floor_it_says_what_is_missing_for_arming() {
        let mut now = snapshot();
        let (telemetry, _) = now.telemetry.as_mut().unwrap();
        telemetry.supervision = proto::Supervision {
            state: State::Disarmed,
            conditions: 0,
            preflight: Preflight::ALL.bits() & !Preflight::POSE,
        };
        let text = picture(&now, 110, 30);
        assert!(text.contains("no faults") && text.contains("not ready: pose"), "{text}");
        now.now_us += 5_000_000;
        assert!(picture(&now, 110, 30).contains("LOST, last state Disarmed"));
        now.telemetry = None;
        now.link = None;
        assert!(picture(&now, 110, 30).contains("no craft yet"));
    }

    #[test]
    fn no_terminal_is_too_small() {
        for (width, height) in [(1, 1), (3, 40), (200, 2), (20, 10), (80, 24)] {
            let _ = picture(&snapshot(), width, height);
        }
    }

    #[test]
    fn keys_do_what_they_say() {
        assert_eq!(key(' '), Some(Input::Request(PilotRequest::Cut)));
        assert_eq!(key('l'), Some(Input::Request(PilotRequest::Land)));
        assert_eq!((key('d'), key('D')), (None, Some(Input::Request(PilotRequest::Disarm))));
        assert_eq!((key('y'), key('Y')), (None, Some(Input::Request(PilotRequest::Confirm))));
        assert_eq!(key('x'), None);
    }

    #[test]
    fn lines_are_for_people_and_for_grep() {
        let mut out = Vec::new();
        let mut plain = Plain::new(&mut out);
        plain.notice(&snapshot().notices[0]);
        plain.show(&snapshot());
        plain.show(&snapshot());
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "[   12.0 s] warning: battery low");
        assert!(
            lines[1].contains("Flying at x 0.50 y -0.25 height 1.50 m, 10.50 V; 6.5 ms one way"),
            "{text}"
        );
        assert_eq!(lines.len(), 2, "the status comes every five seconds only");
    }
}
