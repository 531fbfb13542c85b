//! The loop: messages and sensors in, a tick of the [`Craft`], motor commands and messages out.
//!
//! On its thread nothing waits, nothing is allocated and no file is read or written but the four
//! pulse lengths, which are the outputs themselves (a test counts allocations). Beside it are the
//! threads of the IMU's line, of the battery's converter, and of the log.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, sleep};
use std::time::Duration;

use control::State;
use craft::{Craft, Inputs};

use crate::battery::Battery;
use crate::clock::{Beat, Ticker};
use crate::config::{BatterySource, Setup};
use crate::error::{Error, Result, log, system};
use crate::guardian::{Heart, Sign};
use crate::imu::Imu;
use crate::link::{Link, Notice};
use crate::pwm::{Idled, Motors, Output};
use crate::realtime;

/// How many events may wait to be logged; the rest are not logged.
const WAITING: usize = 64;
/// The log's thread looks for events this often.
const LOG_EVERY: Duration = Duration::from_millis(20);
/// A refused packet is logged at most this often, us; all are counted.
const REFUSAL_EVERY_US: u32 = 1_000_000;

/// Something that happened in the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The craft went to another state.
    State(State),
    /// Something about a packet.
    Notice(Notice),
    /// An output could not be written, or could be again.
    Outputs(bool),
    /// This motor (0 to 3) gives less than it is told.
    Motor(u8),
}

/// All that the loop's thread touches.
#[derive(Debug)]
pub struct FlightLoop<C> {
    craft: Craft,
    link: Link,
    imu: Imu,
    battery: Battery,
    /// Voltage comes with the IMU's frames.
    battery_by_imu: bool,
    motors: Motors<C>,
    outputs_ready: bool,
    failed_motor: Option<u8>,
    state: State,
    /// When a refused packet was handed to the log last, on the monotonic clock.
    refusal_us: Option<u32>,
    events: SyncSender<Event>,
}

impl<C: Output> FlightLoop<C> {
    /// Opens what the setup names; the outputs are open already.
    ///
    /// # Errors
    /// The first thing that cannot be opened.
    pub fn open(setup: &Setup, motors: Motors<C>) -> Result<(Self, Receiver<Event>)> {
        let craft =
            Craft::new(&setup.law, craft_setup(setup)).map_err(|error| Error::Other(error.to_string()))?;
        let link = Link::open(&setup.link)?;
        let (port, baud) = setup.imu.clone();
        let imu = Imu::open(port, baud, setup.priority)?;
        let battery = match &setup.battery {
            BatterySource::Imu => Battery::default(),
            BatterySource::Converter { path, volt_per_count } => {
                Battery::from_converter(path.clone(), *volt_per_count)?
            }
        };
        let (events, log) = sync_channel(WAITING);
        let flight = Self {
            craft,
            link,
            imu,
            battery,
            battery_by_imu: setup.battery == BatterySource::Imu,
            motors,
            outputs_ready: true,
            failed_motor: None,
            state: State::Disarmed,
            refusal_us: None,
            events,
        };
        Ok((flight, log))
    }

    /// The link.
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// What the craft is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// One tick.
    pub fn tick(&mut self, beat: Beat) {
        let Self { craft, link, imu, battery, motors, refusal_us, events, .. } = self;
        // Seldom already here: a flood must not take the places of what else there is to log.
        link.receive(craft, |notice| {
            if refusal_us.is_none_or(|at_us| beat.time_us.wrapping_sub(at_us) >= REFUSAL_EVERY_US) {
                *refusal_us = Some(beat.time_us);
                report(events, Event::Notice(notice));
            }
        });
        let frame = imu.newest();
        if let Some(voltage_v) = frame.and_then(|frame| frame.battery_v).filter(|_| self.battery_by_imu) {
            battery.store(voltage_v);
        }
        let flight = craft.tick(&Inputs {
            time_us: beat.time_us,
            imu: frame.map(|frame| frame.sample),
            battery_v: battery.voltage_v(),
            current_a: frame.and_then(|frame| frame.current_a),
            outputs_ready: self.outputs_ready,
            lateness_us: beat.late_us,
        });
        let (pwm, state) = (flight.tick.pwm, flight.state);
        let written =
            if state.motors_idle() { motors.idle() == Idled::Pulses } else { motors.set(&pwm).is_ok() };
        if written != self.outputs_ready {
            self.outputs_ready = written;
            report(events, Event::Outputs(written));
        }
        if state != self.state {
            self.state = state;
            report(events, Event::State(state));
        }
        let failed_motor = craft.failed_motor();
        if failed_motor != self.failed_motor {
            self.failed_motor = failed_motor;
            failed_motor.into_iter().for_each(|motor| report(events, Event::Motor(motor)));
        }
        link.send(craft);
    }

    /// All motors to idle.
    pub fn idle(&mut self) {
        self.motors.idle();
    }
}

/// What the ground learns about this program and its craft.
fn craft_setup(setup: &Setup) -> craft::Setup {
    craft::Setup {
        vehicle_sha256: setup.vehicle_sha256,
        program: program_version(),
        telemetry_every: setup.link.telemetry_every,
        last_end: setup.ended,
    }
}

/// Version of this program: major, minor, patch.
pub fn program_version() -> [u16; 3] {
    let mut numbers = env!("CARGO_PKG_VERSION").split('.').map(|number| number.parse().unwrap_or(0));
    std::array::from_fn(|_| numbers.next().unwrap_or(0))
}

/// Hands an event to the log; never waits for it.
fn report(events: &SyncSender<Event>, event: Event) {
    let _ = events.try_send(event);
}

/// The life of the loop's process.
///
/// # Errors
/// What cannot be opened, or [`Error::Orphaned`].
pub fn fly<C: Output>(setup: &Setup, motors: Motors<C>, mut heart: Heart) -> Result<()> {
    let (mut flight, events) = FlightLoop::open(setup, motors)?;
    let log_events = move || print(&events);
    thread::Builder::new()
        .name("log".into())
        .spawn(log_events)
        .map_err(system("start the thread of the log"))?;
    log(&format!("listening on {}", flight.link().address()));
    for line in realtime::ask_for(setup.priority) {
        log(&line);
    }
    let mut ticker = Ticker::start(setup.period_ns());
    loop {
        let beat = ticker.wait();
        flight.tick(beat);
        match heart.beat() {
            Sign::Go => {}
            order => {
                flight.idle();
                return if order == Sign::Stop { Ok(()) } else { Err(Error::Orphaned) };
            }
        }
    }
}

/// Prints events for ever. (It polls instead of waiting: a thread that waits takes a lock that the
/// loop might have to wait for.)
fn print(events: &Receiver<Event>) {
    loop {
        for event in events.try_iter() {
            match event {
                Event::State(state) => log(&format!("state: {state:?}").to_lowercase()),
                Event::Motor(motor) => {
                    log(&format!(
                        "motor {} gives less than it is told: look at it before the next flight",
                        motor + 1
                    ));
                }
                Event::Outputs(true) => log("the outputs can be written again"),
                Event::Outputs(false) => log("an output cannot be written"),
                Event::Notice(notice) => log(&sentence(notice)),
            }
        }
        sleep(LOG_EVERY);
    }
}

fn sentence(notice: Notice) -> String {
    match notice {
        Notice::Refused(from, refused) => format!("from {from}: {refused}"),
        Notice::Stranger(from) => proto::NotAdmitted { peer: from.ip() }.to_string(),
    }
}
