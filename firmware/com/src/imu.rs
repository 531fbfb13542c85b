//! The IMU board's serial line: a thread reads it and hands frames on, without ever waiting for the
//! loop.

use std::fs::File;
use std::io::{self, Read};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, sleep};
use std::time::Duration;

use nix::sys::termios::{self, BaudRate, ControlFlags, InputFlags, SetArg};
use proto::imu_frame::{ImuFrame, Parser};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Mode, OFlags};
use rustix::time::Timespec;

use crate::error::{Result, access, log};
use crate::realtime;

/// Frames that may wait for the loop: several ticks' worth.
const WAITING: usize = 32;
/// The longest single wait for bytes.
const READ_PATIENCE: Duration = Duration::from_millis(100);
/// How often to try to reopen a line that went away.
const REOPEN_EVERY: Duration = Duration::from_millis(500);

/// The loop's end of the line.
#[derive(Debug)]
pub struct Imu {
    frames: Receiver<ImuFrame>,
    refused: Arc<AtomicU32>,
}

impl Imu {
    /// Opens the line and starts to read it, with a real-time priority of one less than the loop's.
    ///
    /// # Errors
    /// A port that cannot be opened or set.
    pub fn open(port: PathBuf, baud: u32, priority: u8) -> Result<Self> {
        let opened = open(&port, baud)?;
        let (sender, frames) = sync_channel(WAITING);
        let refused = Arc::new(AtomicU32::new(0));
        let counter = Arc::clone(&refused);
        thread::Builder::new()
            .name("imu".into())
            .spawn(move || {
                // The loop has already logged whether this works.
                let _ = realtime::schedule(priority.saturating_sub(1).max(1));
                read(opened, &port, baud, &sender, &counter);
            })
            .map_err(crate::error::system("start the thread of the IMU"))?;
        Ok(Self { frames, refused })
    }

    /// The newest frame that came since the last call. Never waits, never allocates.
    pub fn newest(&self) -> Option<ImuFrame> {
        self.frames.try_iter().last()
    }

    /// Frames that were damaged, so far.
    pub fn refused(&self) -> u32 {
        self.refused.load(Ordering::Relaxed)
    }
}

/// The system's name of a baud rate at which a frame of 34 bytes takes less than a tick.
pub fn rate(baud: u32) -> Option<BaudRate> {
    Some(match baud {
        38_400 => BaudRate::B38400,
        57_600 => BaudRate::B57600,
        115_200 => BaudRate::B115200,
        230_400 => BaudRate::B230400,
        460_800 => BaudRate::B460800,
        921_600 => BaudRate::B921600,
        1_000_000 => BaudRate::B1000000,
        _ => return None,
    })
}

/// 8 data bits, no parity, 1 stop bit, no flow control, no translation of bytes. (By the C
/// library's calls: those of the kernel for any baud rate are unknown to emulators.)
fn open(path: &Path, baud: u32) -> Result<File> {
    let set = |port: &File| -> io::Result<()> {
        let mut settings = termios::tcgetattr(port)?;
        termios::cfmakeraw(&mut settings);
        settings.input_flags.remove(InputFlags::IXOFF | InputFlags::IXANY);
        settings.control_flags.remove(ControlFlags::CSTOPB | ControlFlags::CRTSCTS);
        // Modem lines are not connected.
        settings.control_flags.insert(ControlFlags::CREAD | ControlFlags::CLOCAL);
        let rate = rate(baud).ok_or(io::ErrorKind::InvalidInput)?;
        termios::cfsetspeed(&mut settings, rate)?;
        termios::tcsetattr(port, SetArg::TCSANOW, &settings)?;
        termios::tcflush(port, termios::FlushArg::TCIFLUSH)?;
        Ok(())
    };
    // Without waiting for a carrier, and without becoming the terminal that Ctrl-C comes from.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port =
        rustix::fs::open(path, flags, Mode::empty()).map_err(access(path, "open the IMU's serial port"))?;
    let port = File::from(port);
    set(&port).map_err(access(path, "configure the IMU's serial port; is it a serial port?"))?;
    Ok(port)
}

/// What came over the line.
fn wait_and_read(port: &mut File, bytes: &mut [u8]) -> io::Result<usize> {
    let timeout = Timespec { tv_sec: 0, tv_nsec: READ_PATIENCE.subsec_nanos() as _ };
    let mut ports = [PollFd::from_borrowed_fd(port.as_fd(), PollFlags::IN)];
    if poll(&mut ports, Some(&timeout))? == 0 {
        return Err(io::ErrorKind::WouldBlock.into());
    }
    port.read(bytes)
}

/// Reads to the end of the program.
fn read(mut port: File, path: &Path, baud: u32, frames: &SyncSender<ImuFrame>, refused: &AtomicU32) {
    let mut parser = Parser::default();
    let mut bytes = [0; 256];
    loop {
        match wait_and_read(&mut port, &mut bytes) {
            Ok(length @ 1..) => {
                for frame in bytes.iter().take(length).filter_map(|byte| parser.push(*byte)) {
                    // A loop that is behind takes the next one; an old rate is useless.
                    let _ = frames.try_send(frame);
                }
                refused.store(parser.refused, Ordering::Relaxed);
            }
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
            outcome => {
                let why = outcome.map_or_else(|error| error.to_string(), |_| "end of file".into());
                log(&format!("{}: the IMU's line is gone ({why}); trying again", path.display()));
                port = reopen(path, baud);
            }
        }
    }
}

/// Tries until the port is there again.
fn reopen(path: &Path, baud: u32) -> File {
    loop {
        sleep(REOPEN_EVERY);
        if let Ok(port) = open(path, baud) {
            log(&format!("{}: the IMU's line is back", path.display()));
            return port;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ImuSample;
    use proto::imu_frame::{MAX_STUFFED_LEN, encode};
    use serial2::SerialPort;
    use std::time::Instant;

    fn frame(sequence: u16) -> ImuFrame {
        let gyro_rad_s = [f32::from(sequence) / 800.0, 0.0, -1.0];
        let sample = ImuSample { gyro_rad_s, attitude_rad: Some([0.1, 0.0, 3.0]), acceleration_m_s2: None };
        ImuFrame { sequence, board_us: 0, sample, battery_v: Some(11.1), current_a: None }
    }

    /// Over a pseudo terminal of the kernel, in pieces, with noise between: byte for byte what a
    /// UART would give.
    #[test]
    fn frames_come_through_a_real_terminal() {
        let (board, line) = SerialPort::pair().unwrap();
        let path = std::path::PathBuf::from(pts_name(&line));
        let imu = Imu::open(path, 115_200, 50).unwrap();
        let mut buffer = [0; MAX_STUFFED_LEN];
        for sequence in 0..200 {
            let bytes = encode(&frame(sequence), &mut buffer).unwrap();
            let (head, tail) = bytes.split_at(usize::from(sequence) % bytes.len());
            // 0x0d, 0x11, 0x13 and 0x7f would be eaten or changed by a terminal that is not raw.
            if sequence % 50 == 49 {
                board.write_all(&[0x0d, 0x0a, 0x11, 0x13, 0x7f, 0x03, 0x04, 0]).unwrap();
            }
            board.write_all(head).unwrap();
            board.write_all(tail).unwrap();
            let got = wait_for(&imu);
            assert_eq!(got.sequence, sequence);
            assert!((got.sample.gyro_rad_s[0] - f32::from(sequence) / 800.0).abs() < 1e-6);
        }
        assert_eq!(imu.refused(), 4);
        assert_eq!(imu.newest(), None);
    }

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let message = Imu::open("/dev/no-such-port".into(), 115_200, 50).unwrap_err().to_string();
        assert!(message.contains("/dev/no-such-port") && message.contains("serial port"), "{message}");
    }

    fn wait_for(imu: &Imu) -> ImuFrame {
        let started = Instant::now();
        loop {
            if let Some(frame) = imu.newest() {
                return frame;
            }
            assert!(started.elapsed() < Duration::from_secs(10), "no frame came");
            sleep(Duration::from_micros(200));
        }
    }

    fn pts_name(port: &SerialPort) -> String {
        use std::os::fd::AsFd;
        rustix::termios::ttyname(port.as_fd(), Vec::new()).unwrap().into_string().unwrap()
    }
}
