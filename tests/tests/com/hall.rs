//! A laboratory around the craft's program: an access point, a tracker, and a plant that goes by the craft's clock.

use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Output};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ground::mocap::frames::{Axes, Frames, xyz_from_rotation};
use ground::mocap::vicon_stream::{Block, Object};
use proto::{Key, Listener, MAX_PACKET_LEN, Message, Pose, State, Telemetry};
use sil::{FlightPlan, Room};

use crate::PERIOD_S;
use crate::common::{Bench, PATIENCE};

pub(crate) const KEY: [u8; 32] = [0x5a; 32];
pub(crate) const LINK: u16 = 5;

pub(crate) fn write_key(path: &Path) {
    fs::write(path, "5a".repeat(32)).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o600)).unwrap();
}

/// A craft's program that shares a key with the ground.
pub(crate) fn keyed_bench(law: &control::Config) -> Bench {
    let bench = Bench::new(law, "[guardian]\nsilence_s = 2.0\nwatchdog = 'none'\n");
    let config = fs::read_to_string(bench.path("com.toml")).unwrap();
    let link = format!("[link]\nkey = 'key'\nnumber = {LINK}\n");
    fs::write(bench.path("com.toml"), config.replace("[link]\n", &link)).unwrap();
    write_key(&bench.path("key"));
    bench
}

/// What passes between ground and craft, as at an access point: packets go through unchanged, and
/// those of the craft are read.
pub(crate) struct AccessPoint {
    front: UdpSocket,
    back: UdpSocket,
    reader: Listener,
    ground: Arc<Mutex<Option<SocketAddr>>>,
    way_up: Arc<Mutex<WayUp>>,
}

/// Packets on their way to the craft.
#[derive(Debug, Default)]
pub(crate) struct WayUp {
    last: Option<Instant>,
    /// Longest time without one.
    pub(crate) longest_gap: Duration,
}

impl WayUp {
    fn packet(&mut self) {
        let now = Instant::now();
        let gap = self.last.replace(now).map_or(Duration::ZERO, |last| now - last);
        self.longest_gap = self.longest_gap.max(gap);
    }
}

impl AccessPoint {
    pub(crate) fn start(craft: SocketAddr) -> Self {
        let front = UdpSocket::bind("127.0.0.1:0").unwrap();
        let back = UdpSocket::bind("127.0.0.1:0").unwrap();
        back.connect(craft).unwrap();
        back.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let reader = Listener::new(LINK, Some(Key::new(KEY)));
        let ground = Arc::new(Mutex::new(None));
        let way_up = Arc::new(Mutex::new(WayUp::default()));
        let (up, to_craft) = (front.try_clone().unwrap(), back.try_clone().unwrap());
        let (known, seen) = (Arc::clone(&ground), Arc::clone(&way_up));
        // To the end of the test's process.
        std::thread::spawn(move || {
            let mut buffer = [0; 2048];
            loop {
                if let Ok((length, from)) = up.recv_from(&mut buffer) {
                    *known.lock().unwrap() = Some(from);
                    seen.lock().unwrap().packet();
                    let _ = to_craft.send(&buffer[..length]);
                }
            }
        });
        Self { front, back, reader, ground, way_up }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.front.local_addr().unwrap()
    }

    /// The longest time without a packet to the craft since this was asked last.
    pub(crate) fn longest_gap(&self) -> Duration {
        std::mem::take(&mut *self.way_up.lock().unwrap()).longest_gap
    }

    /// Hands the next packet of the craft on; its telemetry, if it is some.
    pub(crate) fn hand_down(&mut self) -> Option<Telemetry> {
        let mut buffer = [0; MAX_PACKET_LEN];
        let length = self.back.recv(&mut buffer).ok()?;
        if let Some(ground) = *self.ground.lock().unwrap() {
            let _ = self.front.send_to(&buffer[..length], ground);
        }
        match self.reader.hear(&buffer[..length]) {
            Some(Message::Telemetry(telemetry)) => Some(telemetry),
            _ => None,
        }
    }
}

/// A laboratory around the craft's program: what it does to the pulses moves the plant, which the
/// IMU board and a tracker see.
pub(crate) struct Hall {
    pub(crate) bench: Bench,
    pub(crate) air: AccessPoint,
    pub(crate) room: Room,
    tracker: UdpSocket,
    frame: u32,
    pub(crate) heard: Option<Telemetry>,
    /// Highest and farthest north, m.
    pub(crate) reached_m: [f64; 2],
}

impl Hall {
    pub(crate) fn open(bench: Bench, craft: SocketAddr, plan: &FlightPlan, vicon: SocketAddr) -> Self {
        let tracker = UdpSocket::bind("127.0.0.1:0").unwrap();
        tracker.connect(vicon).unwrap();
        let room = Room::new(plan, PERIOD_S).unwrap();
        let air = AccessPoint::start(craft);
        Self { bench, air, room, tracker, frame: 0, heard: None, reached_m: [0.0; 2] }
    }

    pub(crate) fn state(&self) -> Option<State> {
        self.heard.map(|telemetry| telemetry.supervision.state)
    }

    /// What happens until the next packet of the craft and with it.
    pub(crate) fn turn(&mut self) {
        let Some(telemetry) = self.air.hand_down() else {
            // A craft that says nothing yet sees its sensors all the same.
            return self.show();
        };
        let before = self.heard.replace(telemetry);
        let passed_us = before.map_or(0, |before| telemetry.craft_us.wrapping_sub(before.craft_us));
        let ticks = (f64::from(passed_us) * 1e-6 / PERIOD_S).round() as u32;
        let pwm = self.bench.pulses_ns().map(|pulse_ns| pulse_ns as f32 / 1000.0);
        let idle = matches!(telemetry.supervision.state, State::Disarmed | State::Armed | State::Cut);
        // A machine that stood still for longer has lost time.
        for _ in 0..ticks.clamp(1, 5) {
            self.room.advance(&pwm, idle);
        }
        let [x, _, z] = self.room.position_m();
        self.reached_m = [self.reached_m[0].max(-z), self.reached_m[1].max(x)];
        self.show();
    }

    /// The sensors tell what they see.
    pub(crate) fn show(&mut self) {
        let frames = Frames::with_axes(Axes::Z_UP);
        let seen = self.room.sense();
        self.bench.send_imu(self.frame as u16, seen.gyro_rad_s.unwrap(), seen.battery_v);
        let pose = Pose { position_m: seen.position_m, attitude_rad: seen.attitude_rad };
        let (position_m, rotation) = frames.seen(&pose);
        let (translation_mm, rotation_rad) = (position_m.map(|m| m * 1e3), xyz_from_rotation(&rotation));
        let quad = Object { name: "quad".into(), translation_mm, rotation_rad };
        // Nobody may be listening yet, or any more.
        let _ = self.tracker.send(&Block { frame: self.frame, objects: vec![quad] }.to_bytes());
        self.frame += 1;
    }

    /// Until a program has ended; what it wrote.
    pub(crate) fn until_ended(&mut self, mut child: Child) -> Output {
        let started = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if started.elapsed() > 4 * PATIENCE {
                let _ = child.kill();
                let output = child.wait_with_output().unwrap();
                panic!("does not end: {}", String::from_utf8_lossy(&output.stderr));
            }
            self.turn();
        }
        child.wait_with_output().unwrap()
    }
}

pub(crate) fn free_udp_address() -> SocketAddr {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}
