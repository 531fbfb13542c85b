//! The simulated laboratory of `quadlab ground --simulated`, in real time on a thread of its own.
//!
//! It speaks as a real one does: the craft's packets over UDP, and the tracker's frames in Vicon's
//! format. On a machine that is too busy, time in it waits for the ground station and catches up
//! later, so that the craft does not fall for it.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ::ground::mocap::frames::{Axes, Frames, xyz_from_rotation};
use ::ground::mocap::vicon_stream::{Block, Object};
use ::ground::mocap::{MocapError, Vicon};
use sil::{FlightPlan, Laboratory, Radio};

const FRAMES: Frames = Frames::with_axes(Axes::Z_UP);
/// The laboratory catches up with a machine that stood still for up to this long.
const STALL: Duration = Duration::from_millis(100);
/// How long simulated time waits for a ground station that has connected before.
const WAIT: Duration = Duration::from_millis(250);

/// The laboratory while it runs.
pub(crate) struct Simulated {
    /// Where the craft's program listens.
    pub(crate) craft: SocketAddr,
    tracker: UdpSocket,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Simulated {
    /// The craft of a plan on the floor, under its law, with its sensors and battery.
    pub(crate) fn start(plan: &FlightPlan, clock_skew: f64) -> anyhow::Result<Self> {
        let lab = Laboratory::new(plan, clock_skew)?;
        let radio = Radio::open()?;
        let craft = radio.address()?;
        let tracker = UdpSocket::bind(("127.0.0.1", 0))?;
        let over = Arc::new(AtomicBool::new(false));
        let (sender, stop) = (tracker.try_clone()?, Arc::clone(&over));
        let thread = Some(std::thread::spawn(move || serve(lab, radio, &sender, &stop)));
        Ok(Self { craft, tracker, over, thread })
    }

    /// A receiver of the laboratory's tracker.
    pub(crate) fn tracker(&self) -> Result<Vicon, MocapError> {
        let here = [127, 0, 0, 1].into();
        let vicon = Vicon::listen(SocketAddr::new(here, 0), Some(here), None, FRAMES)?;
        self.tracker.connect(vicon.address()?)?;
        Ok(vicon)
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.over.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn serve(mut lab: Laboratory, mut radio: Radio, tracker: &UdpSocket, over: &AtomicBool) {
    let period = Duration::from_secs_f64(lab.period_s());
    let mut next = Instant::now();
    let mut frame = 0_u32;
    let mut waits = false;
    while !over.load(Ordering::SeqCst) {
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        radio.receive(&mut lab);
        let pose = lab.tick();
        radio.send(&mut lab);
        let seen = proto::Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad };
        let (position_m, rotation) = FRAMES.seen(&seen);
        let quad = Object {
            name: "quad".into(),
            translation_mm: position_m.map(|m| m * 1e3),
            rotation_rad: xyz_from_rotation(&rotation),
        };
        // Nobody may be listening yet, or any more.
        let _ = tracker.send(&Block { frame, objects: vec![quad] }.to_bytes());
        frame = frame.wrapping_add(1);
        let sent = Instant::now();
        let mut answered = radio.receive(&mut lab) > 0;
        while waits && !answered && sent.elapsed() < WAIT {
            std::thread::sleep(Duration::from_micros(200));
            answered = radio.receive(&mut lab) > 0;
        }
        waits = answered;
        next += period;
        if next + STALL < Instant::now() {
            next = Instant::now() + period;
        }
    }
}
