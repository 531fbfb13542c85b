//! QEMU's mps2-an386, a Cortex-M4F with serial ports and tick. Its motors are four numbers in memory.
//! It has no sensors, unless a [`simulator`](crate::simulator) speaks on the second serial port.
//!
//! It has no source of chance either: each start has the same "random" bytes, so what was recorded
//! of an earlier emulation can be played to a later one. It is for tests and simulation.
//!
//! Addresses and interrupts: Arm DAI 0386 (application note AN386) and the Cortex-M System Design
//! Kit's UART (Arm DDI 0479). UART0 is QEMU's first serial port, UART1 its second.
#![allow(unsafe_code, reason = "registers are addresses, and handlers are the chip's to call")]

use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};

use control::Config;
use cortex_m::Peripherals;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SCB, SYST};
use cortex_m_rt::exception;
use embedded_hal::pwm::SetDutyCycle;
use proto::{Deframer, Ending, ImuSample, MAX_STREAM_LEN, enframe};

use crate::board::Board;
use crate::esc::{Escs, IDLE_US, duty};
use crate::ring::{Ring, Serial};
use crate::simulator::{Request, Sample};
use crate::systick::Systick;

/// The core's clock, Hz.
pub const CLOCK_HZ: u32 = 25_000_000;

/// The wire to the ground.
const LINK: usize = 0x4000_4000;
/// The simulator.
const SIMULATOR: usize = 0x4000_5000;
/// Registers of a UART, behind its address.
const DATA: usize = 0;
const STATE: usize = 4;
const CTRL: usize = 8;
const INTERRUPT: usize = 12;
const BAUD_DIVIDER: usize = 16;

const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const TX_ENABLE: u32 = 1;
const RX_ENABLE: u32 = 2;
const RX_INTERRUPT: u32 = 8;

/// Where QEMU may lay a gains image (`-device loader`): the board's 16 MB of slow memory, which no
/// program here uses.
pub const IMAGE: usize = 0x2100_0000;
/// Where QEMU may lay a recording of readings.
pub const RECORDING: usize = 0x2100_1000;
const SLOW_MEMORY_END: usize = 0x2200_0000;

/// Counts of a frame of the simulated motors; as the STM32's timer.
const FRAME_COUNTS: u16 = 52_500;

static RECEIVED: Ring<2048> = Ring::new();
static TO_SEND: Ring<2048> = Ring::new();
/// What the simulator has sent.
static SIMULATED: Ring<256> = Ring::new();
/// It has sent something: from then on it is asked.
static SIMULATOR_SPEAKS: AtomicBool = AtomicBool::new(false);
/// Bytes that have come over the wire, modulo 2^32.
static LINK_BYTES: AtomicU32 = AtomicU32::new(0);
/// The motors' pulses, in counts of a frame.
static MOTORS: [AtomicU16; 4] = [const { AtomicU16::new(0) }; 4];

/// An interrupt of the board by its number.
#[derive(Debug, Clone, Copy)]
struct Line(u16);

const LINK_RECEIVED: Line = Line(0);
const SIMULATOR_RECEIVED: Line = Line(2);

// SAFETY: the number is one of the board's lines and does not change.
unsafe impl InterruptNumber for Line {
    fn number(self) -> u16 {
        self.0
    }
}

fn read(address: usize) -> u32 {
    // SAFETY: called with registers of this board's UART only, which reading does no harm to beyond
    // taking a byte.
    unsafe { core::ptr::read_volatile(address as *const u32) }
}

fn write(address: usize, value: u32) {
    // SAFETY: called with registers of this board's UART only; none of them reaches memory.
    unsafe { core::ptr::write_volatile(address as *mut u32, value) }
}

/// A motor output that is a number in memory.
#[derive(Debug)]
pub struct Motor(&'static AtomicU16);

impl embedded_hal::pwm::ErrorType for Motor {
    type Error = core::convert::Infallible;
}

impl SetDutyCycle for Motor {
    fn max_duty_cycle(&self) -> u16 {
        FRAME_COUNTS
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Self::Error> {
        self.0.store(duty, Ordering::Relaxed);
        Ok(())
    }
}

/// The emulated board.
#[derive(Debug)]
pub struct Mps2 {
    link: Serial<'static, 2048, 2048>,
    escs: Escs<Motor>,
    /// None if it has been given away already.
    clock: Option<Systick>,
    deframer: Deframer,
    /// What the simulator's sensors measured.
    sample: Option<Sample>,
    commands: [f32; 4],
}

/// Why it was started: the emulated board keeps no record.
pub fn last_end() -> Ending {
    Ending::Unknown
}

/// Sets the board up: motors at idle, link open, tick running.
pub fn boot(config: &Config) -> Mps2 {
    let escs = Escs::new(MOTORS.each_ref().map(Motor), config.command_range);
    for uart in [LINK, SIMULATOR] {
        write(uart + BAUD_DIVIDER, 16);
        write(uart + CTRL, TX_ENABLE | RX_ENABLE | RX_INTERRUPT);
    }
    let clock = Peripherals::take().map(|mut core| {
        Systick::start(&mut core.SYST, SystClkSource::Core, CLOCK_HZ / 1_000_000, config.sample_time_s)
    });
    // SAFETY: everything the handler touches is there.
    unsafe {
        NVIC::unmask(LINK_RECEIVED);
        NVIC::unmask(SIMULATOR_RECEIVED);
    }
    let link = Serial { received: &RECEIVED, to_send: &TO_SEND, start: send };
    let [idle, _] = config.command_range;
    let commands = [idle as f32; 4];
    Mps2 { link, escs, clock, deframer: Deframer::new(), sample: None, commands }
}

/// Sends everything: QEMU takes a byte at once.
fn send() {
    while let Some(byte) = TO_SEND.pop() {
        put(LINK, byte);
    }
}

/// Sends a byte.
fn put(uart: usize, byte: u8) {
    while read(uart + STATE) & TX_FULL != 0 {}
    write(uart + DATA, u32::from(byte));
}

/// All interrupts of the board; only those of bytes that have come are on.
#[exception]
unsafe fn DefaultHandler(_line: i16) {
    receive(LINK, |byte| {
        RECEIVED.push(&[byte]);
        LINK_BYTES.fetch_add(1, Ordering::Relaxed);
    });
    receive(SIMULATOR, |byte| {
        SIMULATED.push(&[byte]);
        SIMULATOR_SPEAKS.store(true, Ordering::Relaxed);
    });
}

/// The timer that time is counted with.
fn timer() -> SYST {
    // SAFETY: after the start only the main loop touches it, from here.
    unsafe { Peripherals::steal() }.SYST
}

/// Takes what has come.
fn receive(uart: usize, take: impl Fn(u8)) {
    write(uart + INTERRUPT, 2);
    while read(uart + STATE) & RX_FULL != 0 {
        take(read(uart + DATA) as u8);
    }
}

impl Mps2 {
    /// Asks the simulator, and waits for its answer and for what the ground sent before it; the time
    /// goes on only while there is something to do.
    fn ask(&mut self) {
        let (time_us, commands) = (self.now_us(), self.commands);
        if let Some(bytes) = enframe(&Request { time_us, commands }.to_bytes(), &mut [0; MAX_STREAM_LEN]) {
            bytes.iter().for_each(|byte| put(SIMULATOR, *byte));
        }
        let mut answer: Option<Sample> = None;
        loop {
            while let (None, Some(byte)) = (answer, SIMULATED.pop()) {
                answer = self.deframer.push(byte).and_then(Sample::from_bytes);
            }
            let missing = |answer: Sample| answer.link_bytes != LINK_BYTES.load(Ordering::Relaxed);
            if answer.is_some_and(|answer| !missing(answer)) {
                break;
            }
            // As in `wait`: nothing slips in between the look and the sleep.
            cortex_m::interrupt::free(|_| {
                if SIMULATED.is_empty() && answer.is_none_or(missing) {
                    let mut timer = timer();
                    timer.disable_counter();
                    cortex_m::asm::wfi();
                    timer.enable_counter();
                }
            });
        }
        self.sample = answer;
    }
}

impl Board for Mps2 {
    type Link = Serial<'static, 2048, 2048>;

    fn link(&mut self) -> &mut Self::Link {
        &mut self.link
    }

    fn now_us(&mut self) -> u32 {
        self.clock.map_or(0, Systick::now_us)
    }

    fn wait(&mut self) {
        // With interrupts held back nothing slips in between the look and the sleep; a pending one
        // ends the sleep all the same.
        cortex_m::interrupt::free(|_| {
            if RECEIVED.is_empty() {
                cortex_m::asm::wfi();
            }
        });
    }

    fn imu(&mut self) -> Option<ImuSample> {
        if SIMULATOR_SPEAKS.load(Ordering::Relaxed) {
            self.ask();
        }
        let gyro_rad_s = self.sample?.gyro_rad_s;
        Some(ImuSample { gyro_rad_s, attitude_rad: None, acceleration_m_s2: None })
    }

    fn battery_v(&mut self) -> f32 {
        self.sample.map_or(f32::NAN, |sample| sample.battery_v)
    }

    fn current_a(&mut self) -> Option<f32> {
        None
    }

    fn drive(&mut self, commands: &[f32; 4]) -> bool {
        self.commands = *commands;
        self.escs.drive(commands)
    }

    fn random(&mut self) -> Option<[u8; 32]> {
        Some(*b"QEMU's board has no random bytes")
    }

    fn feed_watchdog(&mut self) {}
}

/// The memory where a gains image may lie.
pub fn image() -> &'static [u8] {
    // SAFETY: the board has memory there; nothing writes to it while a program runs.
    unsafe { core::slice::from_raw_parts(IMAGE as *const u8, RECORDING - IMAGE) }
}

/// The memory where a recording may lie.
pub fn recording() -> &'static [u8] {
    // SAFETY: as above.
    unsafe { core::slice::from_raw_parts(RECORDING as *const u8, SLOW_MEMORY_END - RECORDING) }
}

/// After a panic: motors idle, then a reset. (Without a watchdog to wait for, it is asked for at
/// once.)
pub fn emergency() -> ! {
    for motor in &MOTORS {
        motor.store(duty(IDLE_US, FRAME_COUNTS), Ordering::Relaxed);
    }
    SCB::sys_reset()
}

/// Ends QEMU with a failure: a program that only tests run has nothing to save.
pub fn fail() -> ! {
    loop {
        cortex_m_semihosting::debug::exit(cortex_m_semihosting::debug::EXIT_FAILURE);
    }
}
