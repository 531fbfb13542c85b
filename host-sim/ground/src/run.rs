//! The station at work: sockets, threads and the clock around [`Station`].
//!
//! One thread waits for the craft, one for the tracker, one for the keyboard; all of them hand what
//! they heard to the loop, which owns the station, wakes up at once when something comes, and
//! otherwise when something is due. So a pose goes on its way within some 50 us of its arrival, and
//! nothing polls. The loop itself waits for nobody: what people see goes through a thread of its own
//! (a terminal may stand still, and its output may go to a disk that does), as the recording does.
//!
//! Ctrl-C (or a request to end) lands a flying craft and ends when it is down; a second one ends at
//! once, and the craft's own supervisor holds and lands it. The recording is whole either way.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver as Inbox, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::time::{Duration, Instant};

use crate::mission::Progress;
use crate::mocap::{MocapReceiver, TrackerEvent};
use crate::recording::Level;
use crate::station::{Notice, PilotRequest, Snapshot, Station};

/// How long a thread waits before it looks whether all is over.
const LOOK: Duration = Duration::from_millis(50);
/// Between two pictures of a view.
const FRAME: Duration = Duration::from_millis(100);
/// How much waits to be shown. A view that stands still for longer misses what comes then; the recording has the lines.
const TO_SHOW: usize = 1000;
/// A craft that was asked to land is waited for this long, s.
const LANDING_S: f64 = 60.0;
/// A craft that has fallen silent is not waited for longer than this, s.
const LOST_S: f64 = 10.0;

/// What the pilot does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// A request of the pilot.
    Request(PilotRequest),
    /// The end: landing first if the craft flies.
    Quit,
}

/// Shows people what happens, from a thread of its own.
pub trait View: Send {
    /// There is a new line.
    fn notice(&mut self, notice: &Notice);
    /// How things are now, ten times a second.
    fn show(&mut self, snapshot: &Snapshot);
}

/// Something that happened outside.
enum Event {
    Packet(Vec<u8>),
    Tracker(TrackerEvent),
    TrackerFailed(String),
    Input(Input),
}

/// Something to show.
enum Shown {
    Notice(Notice),
    Picture(Box<Snapshot>),
}

/// What ends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunUntil {
    /// The pilot or Ctrl-C.
    Interrupted,
    /// The end of the mission, too.
    MissionOver,
}

/// How it ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunResult {
    /// Everything asked for was done, and nothing was wrong.
    pub well: bool,
    /// Why not.
    pub why: Option<String>,
}

/// Set by Ctrl-C and requests to end: how often.
static INTERRUPTS: AtomicU32 = AtomicU32::new(0);

/// Counts Ctrl-C and requests to end instead of dying of them. For programs; once.
///
/// # Errors
/// Somebody else has done so before.
pub fn catch_interrupts() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        INTERRUPTS.fetch_add(1, Ordering::SeqCst);
    })
}

/// Runs a station over `socket`, which is connected to the craft, with this tracker. `inputs` is
/// where the keyboard's thread puts what people do. Time zero of the ground's clock is `start`.
///
/// # Errors
/// A socket that cannot be set up.
pub fn run(
    station: &mut Station,
    socket: UdpSocket,
    tracker: Option<Box<dyn MocapReceiver>>,
    inputs: Option<Inbox<Input>>,
    view: &mut dyn View,
    until: RunUntil,
    start: Instant,
) -> std::io::Result<RunResult> {
    let (sender, events) = channel();
    let (to_show, shown) = sync_channel(TO_SHOW);
    let over = Arc::new(AtomicBool::new(false));
    socket.set_read_timeout(Some(LOOK))?;
    let listening = socket.try_clone()?;
    let ended = std::thread::scope(|scope| {
        let (to_loop, stop) = (sender.clone(), Arc::clone(&over));
        scope.spawn(move || hear_craft(&listening, &to_loop, &stop));
        if let Some(tracker) = tracker {
            let (to_loop, stop) = (sender.clone(), Arc::clone(&over));
            scope.spawn(move || hear_tracker(tracker, &to_loop, &stop));
        }
        if let Some(inputs) = inputs {
            let (to_loop, stop) = (sender, Arc::clone(&over));
            scope.spawn(move || hear_people(&inputs, &to_loop, &stop));
        }
        scope.spawn(move || show_people(view, &shown));
        let ended =
            Loop { station, socket: &socket, events, to_show, until, start, leaving: None, noted: 0 }.run();
        over.store(true, Ordering::SeqCst);
        ended
    });
    Ok(ended)
}

fn hear_craft(socket: &UdpSocket, to_loop: &Sender<Event>, over: &AtomicBool) {
    let mut buffer = [0; 2048];
    while !over.load(Ordering::SeqCst) {
        match socket.recv(&mut buffer) {
            Ok(length) => {
                if to_loop.send(Event::Packet(buffer[..length].to_vec())).is_err() {
                    return;
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            // The craft's port is closed (ICMP): its program is not running.
            Err(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

fn hear_tracker(mut tracker: Box<dyn MocapReceiver>, to_loop: &Sender<Event>, over: &AtomicBool) {
    while !over.load(Ordering::SeqCst) {
        let (event, last) = match tracker.next(LOOK) {
            Ok(TrackerEvent::Nothing) => continue,
            Ok(TrackerEvent::End) => (Event::Tracker(TrackerEvent::End), true),
            Ok(heard) => (Event::Tracker(heard), false),
            Err(error) => (Event::TrackerFailed(error.to_string()), true),
        };
        if to_loop.send(event).is_err() || last {
            return;
        }
    }
}

fn hear_people(inputs: &Inbox<Input>, to_loop: &Sender<Event>, over: &AtomicBool) {
    while !over.load(Ordering::SeqCst) {
        match inputs.recv_timeout(LOOK) {
            Ok(input) => {
                if to_loop.send(Event::Input(input)).is_err() {
                    return;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Shows what there is to show; of several pictures the newest.
fn show_people(view: &mut dyn View, shown: &Inbox<Shown>) {
    while let Ok(first) = shown.recv() {
        let mut newest = None;
        for next in std::iter::once(first).chain(shown.try_iter()) {
            match next {
                Shown::Notice(notice) => view.notice(&notice),
                Shown::Picture(snapshot) => newest = Some(snapshot),
            }
        }
        if let Some(snapshot) = newest {
            view.show(&snapshot);
        }
    }
}

struct Loop<'a> {
    station: &'a mut Station,
    socket: &'a UdpSocket,
    events: Inbox<Event>,
    to_show: SyncSender<Shown>,
    until: RunUntil,
    start: Instant,
    /// Since when the craft is being landed to leave, us, and why.
    leaving: Option<(u64, Option<String>)>,
    /// Interrupts that have been seen to.
    noted: u32,
}

impl Loop<'_> {
    fn now_us(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    fn run(mut self) -> RunResult {
        let mut next_picture = Instant::now();
        loop {
            let now_us = self.now_us();
            self.station.poll(now_us);
            self.flush();
            if let Some(ended) = self.is_over(now_us) {
                self.show();
                return ended;
            }
            if Instant::now() >= next_picture {
                self.show();
                next_picture = Instant::now() + FRAME;
            }
            let due = Duration::from_micros(self.station.next_due_us().saturating_sub(self.now_us()));
            let picture = next_picture.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(due.min(picture)) {
                Ok(event) => self.take(event),
                Err(RecvTimeoutError::Timeout) => {}
                // The threads live as long as this does; without any of them time goes on all the
                // same.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(due.min(picture)),
            }
        }
    }

    fn take(&mut self, event: Event) {
        let now_us = self.now_us();
        match event {
            Event::Packet(packet) => self.station.on_packet(now_us, &packet),
            Event::Tracker(heard) => self.station.on_tracker(now_us, heard),
            Event::TrackerFailed(why) => self.station.tell(now_us, Level::Error, why),
            Event::Input(Input::Request(request)) => {
                self.leaving = None;
                self.station.on_pilot_request(now_us, request);
            }
            Event::Input(Input::Quit) => self.leave(now_us, None),
        }
        self.flush();
    }

    /// Sends packets. A craft whose port is closed is reported by its silence.
    fn flush(&mut self) {
        for packet in self.station.take_packets() {
            let _ = self.socket.send(&packet);
        }
    }

    fn show(&mut self) {
        for notice in self.station.take_notices() {
            let _ = self.to_show.try_send(Shown::Notice(notice));
        }
        let snapshot = self.station.snapshot(self.now_us());
        let _ = self.to_show.try_send(Shown::Picture(Box::new(snapshot)));
    }

    /// Lands a flying craft, to end when it is down.
    fn leave(&mut self, now_us: u64, why: Option<String>) {
        if self.leaving.is_none() {
            self.leaving = Some((now_us, why));
            if self.station.is_flying() {
                self.station.tell(now_us, Level::Info, "landing before the end".into());
                self.station.on_pilot_request(now_us, PilotRequest::Land);
            }
        }
    }

    fn is_over(&mut self, now_us: u64) -> Option<RunResult> {
        let interrupts = INTERRUPTS.load(Ordering::SeqCst);
        if interrupts > self.noted {
            self.noted = interrupts;
            if self.leaving.is_some() || interrupts > 1 {
                let why = Some("ended by Ctrl-C while the craft was still flying".to_owned());
                return Some(RunResult { well: false, why: why.filter(|_| self.station.is_flying()) });
            }
            self.leave(now_us, Some("ended by Ctrl-C".into()));
        }
        if self.until == RunUntil::MissionOver && self.leaving.is_none() {
            match self.station.progress().clone() {
                Progress::Failed(why) => self.leave(now_us, Some(why)),
                Progress::Done => self.leave(now_us, None),
                Progress::Going if self.silent(now_us, LOST_S) => {
                    self.leave(now_us, Some("the craft has fallen silent".into()));
                }
                Progress::Going => {}
            }
        }
        let (since_us, why) = self.leaving.clone()?;
        let waited_s = now_us.saturating_sub(since_us) as f64 * 1e-6;
        if self.station.is_flying() && waited_s < LANDING_S && !self.silent(now_us, LOST_S) {
            return None;
        }
        let why = match (why, self.station.is_flying(), self.station.is_faulty()) {
            (Some(why), ..) => Some(why),
            (None, true, _) => Some("the craft was still flying at the end".into()),
            (None, false, true) => Some("something went wrong during the flight, see above".into()),
            (None, false, false) => None,
        };
        Some(RunResult { well: why.is_none(), why })
    }

    /// Has nothing come from the craft for so long?
    fn silent(&self, now_us: u64, limit_s: f64) -> bool {
        self.station.silence_s(now_us).unwrap_or(now_us as f64 * 1e-6) > limit_s
    }
}

/// A socket to the craft.
///
/// # Errors
/// What the system says.
pub fn connect(craft: SocketAddr) -> std::io::Result<UdpSocket> {
    let any: SocketAddr = if craft.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0_u16; 8], 0).into() };
    let socket = UdpSocket::bind(any)?;
    // Packets of anybody else do not come in.
    socket.connect(craft)?;
    Ok(socket)
}
