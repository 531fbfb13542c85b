//! A craft on a bench: the real program with a folder in place of `/sys/class/pwm`, a pseudo
//! terminal in place of the IMU's line, and a ground station that speaks `proto` over UDP. (A story
//! flies it against the plant, with this file.)
#![allow(dead_code, reason = "each program of tests uses what it needs")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use com::clock::monotonic_ms;
use control::Config;
use proto::imu_frame::{self, ImuFrame, MAX_STUFFED_LEN};
use proto::{
    Answer, CraftEnd, Ending, GroundEnd, Heard, ImuSample, Key, MAX_PACKET_LEN, Message, Pose, Refused,
    Request, State, Telemetry, TimedPose,
};
use serial2::SerialPort;

/// Whatever happens on a busy machine happens in this time.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

pub(crate) const IDLE_NS: u32 = 1_000_000;

/// Files and devices of a craft.
pub(crate) struct Bench {
    pub(crate) folder: tempfile::TempDir,
    /// The IMU board's end of its line.
    pub(crate) board: SerialPort,
    // Held open: a terminal without anybody on it hangs up.
    _line: SerialPort,
}

impl Bench {
    /// With `law` in the gains file, and `more` behind the configuration.
    pub(crate) fn new(law: &Config, more: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (board, line) = SerialPort::pair().unwrap();
        let port = rustix::termios::ttyname(line.as_fd(), Vec::new()).unwrap().into_string().unwrap();
        for channel in 0..4 {
            let channel = at.join(format!("pwm/pwmchip0/pwm{channel}"));
            fs::create_dir_all(&channel).unwrap();
            for (name, value) in
                [("period", "0"), ("duty_cycle", "0"), ("polarity", "normal"), ("enable", "0")]
            {
                fs::write(channel.join(name), format!("{value}\n")).unwrap();
            }
        }
        let vehicle =
            "name = 'F330 (thesis)'\n[motors]\ncommand_unit = 'us'\ncommand_range = [1000.0, 2000.0]\n";
        fs::write(at.join("vehicle.toml"), vehicle).unwrap();
        // The tests kill the guardian; the machine's own watchdog is to be left out of it.
        let guardian = if more.contains("[guardian]") { "" } else { "[guardian]\nwatchdog = 'none'\n" };
        let config = format!(
            "[files]\nvehicle = 'vehicle.toml'\ngains = 'gains.toml'\n\
             [link]\nlisten = '127.0.0.1:0'\n[imu]\nport = '{port}'\n\
             [pwm]\nroot = 'pwm'\nperiod_ns = 2500000\n\
             outputs = ['pwmchip0/0', 'pwmchip0/1', 'pwmchip0/2', 'pwmchip0/3']\n{more}\n{guardian}"
        );
        fs::write(at.join("com.toml"), config).unwrap();
        let bench = Self { folder, board, _line: line };
        bench.write_gains(law);
        bench
    }

    pub(crate) fn write_gains(&self, law: &Config) {
        let gains = format!("{}\n[provenance]\nvehicle = 'F330 (thesis)'\n", toml::to_string(law).unwrap());
        fs::write(self.path("gains.toml"), gains).unwrap();
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Lengths of the four pulses, ns, as the files say.
    pub(crate) fn pulses_ns(&self) -> [u32; 4] {
        std::array::from_fn(|channel| {
            let path = self.path(&format!("pwm/pwmchip0/pwm{channel}/duty_cycle"));
            let text = fs::read_to_string(path).unwrap();
            text.lines().next().unwrap().parse().unwrap()
        })
    }

    pub(crate) fn is_idle(&self) -> bool {
        // Half a 65535th of the period.
        self.pulses_ns().iter().all(|pulse_ns| pulse_ns.abs_diff(IDLE_NS) <= 20)
    }

    /// How long it takes until the pulses are idle.
    pub(crate) fn time_to_idle(&self, since: Instant) -> Duration {
        while !self.is_idle() {
            assert!(since.elapsed() < PATIENCE, "never idle: {:?}", self.pulses_ns());
            thread::sleep(Duration::from_micros(100));
        }
        since.elapsed()
    }

    /// A frame of the IMU board goes over its line.
    pub(crate) fn send_imu(&self, sequence: u16, gyro_rad_s: [f32; 3], battery_v: f32) {
        let sample = ImuSample { gyro_rad_s, attitude_rad: None, acceleration_m_s2: None };
        let frame = ImuFrame { sequence, board_us: 0, sample, battery_v: Some(battery_v), current_a: None };
        self.board.write_all(imu_frame::encode(&frame, &mut [0; MAX_STUFFED_LEN]).unwrap()).unwrap();
    }
}

/// The program, running.
pub(crate) struct Program {
    pub(crate) child: Child,
    lines: Receiver<String>,
    pub(crate) seen: Vec<String>,
}

impl Program {
    pub(crate) fn start(program: &Path, bench: &Bench, set: impl FnOnce(&mut Command)) -> Self {
        let mut command = Command::new(program);
        command.arg("run").arg(bench.path("com.toml")).stderr(Stdio::piped()).stdin(Stdio::null());
        set(&mut command);
        let mut child = command.spawn().unwrap();
        let (sender, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { child, lines, seen: Vec::new() }
    }

    /// The first line, from the last one looked at on, that holds this.
    pub(crate) fn wait_for(&mut self, text: &str) -> String {
        let started = Instant::now();
        loop {
            let left = PATIENCE.saturating_sub(started.elapsed());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    self.seen.push(line.clone());
                    if line.contains(text) {
                        return line;
                    }
                }
                Err(why) => panic!("no line with {text:?} ({why}) in {:#?}", self.seen),
            }
        }
    }

    /// All lines of a program that ends by itself.
    pub(crate) fn all_lines(&mut self) -> &[String] {
        self.seen.extend(self.lines.iter());
        &self.seen
    }

    pub(crate) fn address(&mut self) -> SocketAddr {
        self.wait_for("listening on ").rsplit(' ').next().unwrap().parse().unwrap()
    }

    /// The loop's process.
    pub(crate) fn loop_pid(&self) -> u32 {
        let id = self.child.id();
        let children = fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap();
        children.split_whitespace().next().unwrap().parse().unwrap()
    }

    /// The exit status, once it has ended.
    pub(crate) fn ended(&mut self) -> Option<i32> {
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.code();
            }
            assert!(started.elapsed() < PATIENCE, "still running: {:#?}", self.seen);
            thread::sleep(Duration::from_millis(2));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Compiles a C file, named from its crate's folder on, to a library that can be loaded before the system's.
pub(crate) fn compile(crate_folder: &str, source: &str, library: &Path) {
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]).arg(library).arg(Path::new(crate_folder).join(source));
    assert!(compiler.status().unwrap().success(), "the C compiler that Rust links with");
}

/// Whether nothing else runs on this machine, as at night: no lateness is forgiven then.
pub(crate) fn is_alone() -> bool {
    std::env::var_os("QUADLAB_ALONE").is_some()
}

/// A signal to a process, by the tool that people use.
pub(crate) fn signal(name: &str, process: u32) {
    let status = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status();
    assert!(status.unwrap().success(), "kill -{name} {process}");
}

/// A ground station.
pub(crate) struct Ground {
    socket: UdpSocket,
    end: GroundEnd,
    frame: u32,
    /// All packets so far, hellos too.
    pub(crate) said: Vec<Vec<u8>>,
    /// The last of each.
    pub(crate) telemetry: Option<Telemetry>,
    pub(crate) answers: Vec<Answer>,
    /// How the craft says that it ended before it was started.
    pub(crate) last_end: Option<Ending>,
}

/// Packets that are right in all but their tags: whoever made them has another key.
pub(crate) fn forgeries(message: &Message, key: [u8; 32]) -> Vec<Vec<u8>> {
    let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN], [0; MAX_PACKET_LEN]);
    let mut ground = GroundEnd::new(5, Some(Key::new(key)), random());
    let mut craft = CraftEnd::new(5, Some(Key::new(key)), random());
    let hello = ground.greet(monotonic_ms(), &mut buffer).unwrap();
    let Ok(Heard::Hello(challenge)) = craft.hear(monotonic_ms(), None, hello, &mut reply) else { panic!() };
    ground.hear(monotonic_ms(), challenge).unwrap();
    (0..64).map(|_| ground.seal(monotonic_ms(), message, &mut buffer).unwrap().1.to_vec()).collect()
}

fn random() -> [u8; 32] {
    proto_files::random().unwrap()
}

pub(crate) const IDLE: proto::Command = proto::Command { z_m: -1.0, ..proto::Command::IDLE };

impl Ground {
    pub(crate) fn new(craft: SocketAddr) -> Self {
        Self::with(craft, GroundEnd::new(0, None, random()))
    }

    /// With a key, for link 5.
    pub(crate) fn keyed(craft: SocketAddr, key: [u8; 32]) -> Self {
        Self::with(craft, GroundEnd::new(5, Some(Key::new(key)), random()))
    }

    fn with(craft: SocketAddr, end: GroundEnd) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(craft).unwrap();
        Self { socket, end, frame: 0, said: Vec::new(), telemetry: None, answers: Vec::new(), last_end: None }
    }

    /// Says it if there is a session, and hello if there is none.
    pub(crate) fn say(&mut self, message: &Message) -> Option<u64> {
        let mut buffer = [0; MAX_PACKET_LEN];
        if let Some(hello) = self.end.greet(monotonic_ms(), &mut buffer) {
            // A craft that is gone refuses; whoever waits for it notices.
            let _ = self.socket.send(hello);
            self.said.push(hello.to_vec());
        }
        let (number, packet) = self.end.seal(monotonic_ms(), message, &mut buffer).ok()?;
        let _ = self.socket.send(packet);
        self.said.push(packet.to_vec());
        Some(number)
    }

    pub(crate) fn send_raw(&self, bytes: &[u8]) {
        let _ = self.socket.send(bytes);
    }

    /// A pose and a command, as of one frame of the tracker.
    pub(crate) fn send(&mut self, pose: Pose, command: proto::Command) {
        self.frame += 1;
        let (frame, ground_us) = (self.frame, self.frame * 10_000);
        self.say(&Message::Pose(TimedPose { frame, ground_us, pose }));
        self.say(&Message::Command(command));
    }

    pub(crate) fn request(&mut self, request: Request) -> Option<u64> {
        self.say(&Message::Request(request))
    }

    /// The next telemetry, if it comes in this time.
    pub(crate) fn hear(&mut self, at_most: Duration) -> Option<Telemetry> {
        self.socket.set_read_timeout(Some(at_most)).unwrap();
        let mut buffer = [0; MAX_PACKET_LEN];
        loop {
            let length = self.socket.recv(&mut buffer).ok()?;
            let heard = self.end.hear(monotonic_ms(), &buffer[..length]);
            // It has waited here while the test did something else.
            if matches!(heard, Err(Refused::Old { .. })) {
                continue;
            }
            match heard.unwrap() {
                Some((_, Message::Telemetry(telemetry))) => {
                    self.telemetry = Some(telemetry);
                    return self.telemetry;
                }
                Some((_, Message::Answer(answer))) => self.answers.push(answer),
                Some((_, Message::LastEnd(ending))) => self.last_end = Some(ending),
                _ => {}
            }
        }
    }

    pub(crate) fn state(&self) -> State {
        self.telemetry.map_or(State::Disarmed, |telemetry| telemetry.supervision.state)
    }
}

/// The thesis' law with a supervisor that forgives a test machine which stands still for a second.
pub(crate) fn patient_law() -> Config {
    let mut law = Config::thesis();
    let supervision = &mut law.supervision;
    (supervision.timing.jump_s, supervision.timing.overrun_s) = (5.0, 60.0);
    (supervision.link.hold_after_s, supervision.link.land_after_s) = (5.0, 6.0);
    let pose = &mut supervision.pose;
    (pose.coast_s, pose.land_after_s, pose.cut_after_s) = (3.0, 4.0, 5.0);
    (supervision.imu.missing_ticks, supervision.imu.cut_after_s) = (500, 6.0);
    // It is held, so one motor is at its end before the others.
    supervision.motor.for_s = 60.0;
    law
}

/// A craft that somebody holds: it is told to climb and does not, so its motors go up.
pub(crate) struct Held {
    pub(crate) ground: Ground,
    ticks: u16,
}

impl Held {
    pub(crate) fn new(ground: Ground) -> Self {
        Self { ground, ticks: 0 }
    }

    /// One tick of the craft: what the sensors say, and the craft's telemetry.
    pub(crate) fn tick(&mut self, bench: &Bench, command: proto::Command) {
        self.ticks = self.ticks.wrapping_add(1);
        // Sensors that stand still are taken for stuck ones.
        let dither = 1e-2 * f32::from(self.ticks % 7);
        bench.send_imu(self.ticks, [dither, 0.0, -dither], 11.8);
        let position_m = [0.1 * dither, 0.0, -0.05];
        self.ground.send(Pose { position_m, attitude_rad: [0.0; 3] }, command);
        self.ground.hear(Duration::from_millis(10));
    }

    /// Ticks until this holds.
    pub(crate) fn until(
        &mut self,
        bench: &Bench,
        command: proto::Command,
        what: &str,
        holds: impl Fn(&Self) -> bool,
    ) {
        let started = Instant::now();
        while !holds(self) {
            assert!(started.elapsed() < PATIENCE, "never {what}: {:?}", self.ground.telemetry);
            self.tick(bench, command);
        }
    }

    /// Arms and takes off.
    pub(crate) fn take_off(&mut self, bench: &Bench) {
        let ready = control::Preflight::ALL.bits();
        self.until(bench, IDLE, "ready", |held| {
            held.ground.telemetry.is_some_and(|telemetry| telemetry.supervision.preflight == ready)
        });
        assert!(bench.is_idle(), "a craft that is disarmed has idle motors");
        self.ground.request(Request::Arm);
        self.until(bench, IDLE, "armed", |held| held.ground.state() == State::Armed);
        assert!(bench.is_idle(), "a craft that is armed has idle motors");
        let climb = proto::Command { cut_off: false, ..IDLE };
        self.until(bench, climb, "flying", |held| held.ground.state() == State::Flying && !bench.is_idle());
    }
}
