//! The law on the processors of the craft, emulated by QEMU: equal `Readings` have to give equal
//! bits.
//!
//! - [`Emulated`] speaks to a lockstep program over its standard input and output, which for the
//!   bare Cortex-M4F are its emulated serial port: stuffed frames of readings one way, of outcomes
//!   the other. The configuration is laid into the chip's memory, or handed to the ARM Linux
//!   program as a file: an image of [`craft::image`]. A recording of readings goes the same way;
//!   then the digests of its ticks come back.
//! - [`Udp`] speaks to the craft computer's own program (`com lockstep`) as a ground station would:
//!   packets in datagrams.
//!
//! Deliberately absent: building the programs (`cargo xtask sil --on` does), and time: the emulated
//! processor is slower, and the loop waits for it.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use control::{Config, Readings};
use craft::convert;
use craft::image::{MAX_IMAGE_LEN, encode};
use proto::{
    Deframer, MAX_FRAME_LEN, MAX_PACKET_LEN, MAX_STREAM_LEN, Message, Opener, Outcome, Role, Sealer, enframe,
};
use tempfile::TempPath;

use super::in_process::{FlightComputer, FlightComputerError};

/// How long an answer may take: an emulator on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(60);
/// Where the emulated board's program looks for an image and a recording:
/// `firmware/mcu/src/mps2.rs`.
const IMAGE_ADDRESS: u32 = 0x2100_0000;
const RECORDING_ADDRESS: u32 = 0x2100_1000;
/// Libraries of ARM Linux programs, where Debian and Ubuntu put them.
const ARM_LIBRARIES: &str = "/usr/arm-linux-gnueabihf";

/// A processor that is not this machine's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processor {
    /// Cortex-A with Linux, as on the thesis' COM: programs run in `qemu-arm`.
    Armv7,
    /// Bare Cortex-M4F: programs run in `qemu-system-arm` as its board mps2-an386.
    CortexM4,
}

impl Processor {
    /// Its name in commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Armv7 => "armv7",
            Self::CortexM4 => "cortex-m4",
        }
    }

    /// The processor of this name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Armv7, Self::CortexM4].into_iter().find(|processor| processor.name() == name)
    }

    /// What starts the lockstep program with a configuration and, perhaps, a recording.
    fn lockstep(self, program: &Path, image: &Path, recording: Option<&Path>) -> Command {
        match self {
            Self::Armv7 => {
                let mut command = linux(program);
                command.arg(image).args(recording);
                command
            }
            Self::CortexM4 => {
                let mut command = Command::new("qemu-system-arm");
                command.args(["-machine", "mps2-an386", "-cpu", "cortex-m4", "-display", "none"]);
                command.args(["-monitor", "none", "-serial", "stdio"]);
                // A program that cannot go on ends the emulator.
                command.args(["-semihosting-config", "enable=on,target=native"]);
                let files = [Some((image, IMAGE_ADDRESS)), recording.map(|file| (file, RECORDING_ADDRESS))];
                for (file, address) in files.into_iter().flatten() {
                    let file = file.display();
                    command.args(["-device", &format!("loader,file={file},addr={address:#x},force-raw=on")]);
                }
                command.arg("-kernel").arg(program);
                command
            }
        }
    }
}

/// An ARM Linux program.
fn linux(program: &Path) -> Command {
    let mut command = Command::new("qemu-arm");
    command.args(["-L", ARM_LIBRARIES]).arg(program);
    command
}

/// A lockstep program in an emulator.
#[derive(Debug)]
pub struct Emulated {
    peer: Peer,
    input: ChildStdin,
    answers: Receiver<Vec<u8>>,
    /// They go when it does.
    _files: Vec<TempPath>,
}

/// A child process that does not outlive its owner.
#[derive(Debug)]
struct Peer(Child);

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Peer {
    fn spawn(command: &mut Command) -> Result<Self, FlightComputerError> {
        let name = command.get_program().to_string_lossy().into_owned();
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        child.map(Self).map_err(|reason| FlightComputerError::Start { program: name, reason })
    }

    /// Why it does not answer.
    fn explain(&mut self) -> FlightComputerError {
        // The end of its output comes a moment before its own.
        for _ in 0..100 {
            if let Ok(Some(status)) = self.0.try_wait() {
                return FlightComputerError::PeerGone { status: status.to_string() };
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        FlightComputerError::Silent { seconds: PATIENCE.as_secs() }
    }
}

impl Emulated {
    /// Starts the lockstep program at `program` on `processor`, with a fresh autopilot of a craft
    /// in the air.
    ///
    /// # Errors
    /// An emulator that is not there, or a configuration that cannot be handed over.
    pub fn start(processor: Processor, program: &Path, config: &Config) -> Result<Self, FlightComputerError> {
        let image = file_with(&image_of(config)?)?;
        Self::run(&mut processor.lockstep(program, &image, None), vec![image])
    }

    /// Has the lockstep program tick through a recording; the digests of its `count` ticks.
    ///
    /// # Errors
    /// As [`Emulated::start`], or a program that ends too early.
    pub fn replay(
        processor: Processor,
        program: &Path,
        config: &Config,
        recording: &[u8],
        count: usize,
    ) -> Result<Vec<u64>, FlightComputerError> {
        let (image, recording) = (file_with(&image_of(config)?)?, file_with(recording)?);
        let mut command = processor.lockstep(program, &image, Some(&recording));
        let mut program = Self::run(&mut command, vec![image, recording])?;
        let digest = |bytes: Vec<u8>| {
            let digest: Result<[u8; 8], _> = bytes.try_into();
            digest.map(u64::from_le_bytes).map_err(|_| proto::Error::Malformed.into())
        };
        (0..count).map(|_| program.next().and_then(digest)).collect()
    }

    fn run(command: &mut Command, files: Vec<TempPath>) -> Result<Self, FlightComputerError> {
        let mut peer = Peer::spawn(command)?;
        let failed = || FlightComputerError::Configure { reason: ErrorKind::BrokenPipe.into() };
        let input = peer.0.stdin.take().ok_or_else(failed)?;
        let output = peer.0.stdout.take().ok_or_else(failed)?;
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            let mut deframer = Deframer::new();
            for byte in BufReader::new(output).bytes().map_while(Result::ok) {
                if let Some(answer) = deframer.push(byte)
                    && sender.send(answer.to_vec()).is_err()
                {
                    return;
                }
            }
        });
        Ok(Self { peer, input, answers, _files: files })
    }

    /// Its next answer.
    fn next(&mut self) -> Result<Vec<u8>, FlightComputerError> {
        self.answers.recv_timeout(PATIENCE).map_err(|_| self.peer.explain())
    }
}

impl FlightComputer for Emulated {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<Outcome, FlightComputerError> {
        let (mut frame, mut stream) = ([0; MAX_FRAME_LEN], [0; MAX_STREAM_LEN]);
        let frame = proto::encode(&Message::Readings(convert::readings_message(tick, readings)), &mut frame)?;
        let bytes = enframe(frame, &mut stream).ok_or(proto::Error::BufferTooShort)?;
        let written = self.input.write_all(bytes).and_then(|()| self.input.flush());
        written.map_err(|_| self.peer.explain())?;
        match proto::decode(&self.next()?)? {
            Message::Outcome(outcome) if outcome.output.tick == tick => Ok(outcome),
            other => Err(FlightComputerError::WrongAnswer { expected: tick, found: format!("{other:?}") }),
        }
    }
}

/// The image of a configuration that is not from a file and has no hash.
fn image_of(config: &Config) -> Result<Vec<u8>, FlightComputerError> {
    let image = encode(config, &[0; 32], &mut [0; MAX_IMAGE_LEN]).map(<[u8]>::to_vec);
    image.ok_or_else(|| FlightComputerError::Configure { reason: ErrorKind::InvalidData.into() })
}

/// A file that goes with the value.
fn file_with(bytes: &[u8]) -> Result<TempPath, FlightComputerError> {
    let failed = |reason| FlightComputerError::Configure { reason };
    let mut file = tempfile::NamedTempFile::new().map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    Ok(file.into_temp_path())
}

/// The craft computer's program, asked over UDP.
#[derive(Debug)]
pub struct Udp {
    peer: Peer,
    socket: UdpSocket,
    sealer: Sealer,
    opener: Opener,
}

/// After this long without an answer the same tick is asked again: a datagram can be lost.
const ASK_AGAIN: Duration = Duration::from_millis(500);

impl Udp {
    /// Starts `program` (the craft computer's, for ARM Linux) in `qemu-arm` and waits until it
    /// listens.
    ///
    /// # Errors
    /// A program that does not start, or that does not say where it listens.
    pub fn start(program: &Path, config: &Config) -> Result<Self, FlightComputerError> {
        Self::run(linux(program).arg("lockstep"), config)
    }

    fn run(command: &mut Command, config: &Config) -> Result<Self, FlightComputerError> {
        let failed = |reason| FlightComputerError::Configure { reason };
        let mut peer = Peer::spawn(command)?;
        let mut line = serde_json::to_string(config).map_err(|error| failed(error.into()))?;
        line.push('\n');
        if let Some(stdin) = &mut peer.0.stdin {
            stdin.write_all(line.as_bytes()).map_err(failed)?;
        }
        let mut said = String::new();
        if let Some(stdout) = peer.0.stdout.take() {
            BufReader::new(stdout).read_line(&mut said).map_err(failed)?;
        }
        let address: SocketAddr = match said.trim().parse() {
            Ok(address) => address,
            Err(_) if said.is_empty() => return Err(peer.explain()),
            Err(_) => return Err(FlightComputerError::WrongAnswer { expected: 0, found: said }),
        };
        let socket = UdpSocket::bind("127.0.0.1:0").map_err(failed)?;
        socket.connect(address).map_err(failed)?;
        socket.set_read_timeout(Some(ASK_AGAIN)).map_err(failed)?;
        let (sealer, opener) = (Sealer::new(Role::Ground, 0), Opener::new(Role::Craft, 0));
        Ok(Self { peer, socket, sealer, opener })
    }
}

impl FlightComputer for Udp {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<Outcome, FlightComputerError> {
        let question = Message::Readings(convert::readings_message(tick, readings));
        let (mut packet, started) = ([0; MAX_PACKET_LEN], Instant::now());
        while started.elapsed() < PATIENCE {
            let Ok((_, bytes)) = self.sealer.seal(&question, &mut packet) else { break };
            if self.socket.send(bytes).is_err() {
                break;
            }
            let mut buffer = [0; MAX_PACKET_LEN + 1];
            while let Ok(length) = self.socket.recv(&mut buffer) {
                match self.opener.unseal(&buffer[..length]) {
                    Ok((_, Message::Outcome(outcome))) if outcome.output.tick == tick => return Ok(outcome),
                    // The second answer to a question that was asked twice.
                    Ok((_, Message::Outcome(outcome))) if outcome.output.tick.wrapping_add(1) == tick => {}
                    other => {
                        return Err(FlightComputerError::WrongAnswer {
                            expected: tick,
                            found: format!("{other:?}"),
                        });
                    }
                }
            }
        }
        Err(self.peer.explain())
    }
}

/// How to fly with the law on an emulated processor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Emulation {
    /// Which.
    pub processor: Processor,
    /// Its program: the craft computer's for [`Processor::Armv7`], the lockstep program for
    /// [`Processor::CortexM4`].
    pub program: PathBuf,
}

impl Emulation {
    /// A link to a fresh program.
    ///
    /// # Errors
    /// As [`Emulated::start`], [`Udp::start`].
    pub fn link(&self, config: &Config) -> Result<Box<dyn FlightComputer>, FlightComputerError> {
        Ok(match self.processor {
            Processor::Armv7 => Box::new(Udp::start(&self.program, config)?),
            Processor::CortexM4 => Box::new(Emulated::start(self.processor, &self.program, config)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use craft::Lockstep;

    fn readings() -> Readings {
        Readings {
            time_us: 0,
            pose: None,
            pose_age_us: 0,
            gyro_rad_s: None,
            battery_v: 11.1,
            command: None,
            request: None,
            outputs_ready: true,
        }
    }

    #[test]
    fn processors_have_the_names_of_the_commands() {
        assert_eq!(Processor::named("armv7"), Some(Processor::Armv7));
        assert_eq!(Processor::named("cortex-m4"), Some(Processor::CortexM4));
        assert_eq!(Processor::named("host"), None);
    }

    /// A program that ends at once is named by its end, one that is not there by its name; nothing
    /// waits a minute.
    #[test]
    fn a_program_that_does_not_answer_is_explained() {
        let mut gone = Emulated::run(&mut Command::new("false"), Vec::new()).unwrap();
        let error = gone.tick(0, &readings()).unwrap_err();
        assert!(matches!(error, FlightComputerError::PeerGone { .. }), "{error}");
        let none = Emulated::run(&mut Command::new("no-such-emulator"), Vec::new()).unwrap_err().to_string();
        assert!(none.contains("no-such-emulator"), "{none}");
        let silent = Udp::run(&mut Command::new("false"), &Config::thesis()).unwrap_err();
        assert!(
            matches!(silent, FlightComputerError::PeerGone { .. } | FlightComputerError::Configure { .. }),
            "{silent}"
        );
    }

    /// A craft over UDP that hears every second question only, and answers some twice.
    #[test]
    fn a_lost_datagram_is_sent_again_and_a_second_answer_does_no_harm() {
        let craft = UdpSocket::bind("127.0.0.1:0").unwrap();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(craft.local_addr().unwrap()).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let server = std::thread::spawn(move || {
            let mut law = Lockstep::new(&Config::thesis()).unwrap();
            let (mut sealer, mut opener) = (Sealer::new(Role::Craft, 0), Opener::new(Role::Ground, 0));
            let mut heard = 0;
            for _ in 0..6 {
                let mut buffer = [0; MAX_PACKET_LEN];
                let (length, from) = craft.recv_from(&mut buffer).unwrap();
                let (_, message) = opener.unseal(&buffer[..length]).unwrap();
                heard += 1;
                if heard % 2 == 0 {
                    let outcome = Message::Outcome(law.answer(&message).unwrap());
                    for _ in 0..2 {
                        let (_, packet) = sealer.seal(&outcome, &mut buffer).unwrap();
                        craft.send_to(packet, from).unwrap();
                    }
                }
            }
        });
        let peer = Peer::spawn(&mut Command::new("cat")).unwrap();
        let (sealer, opener) = (Sealer::new(Role::Ground, 0), Opener::new(Role::Craft, 0));
        let mut link = Udp { peer, socket, sealer, opener };
        for tick in 0..3 {
            assert_eq!(link.tick(tick, &readings()).unwrap().output.tick, tick);
        }
        server.join().unwrap();
    }
}
