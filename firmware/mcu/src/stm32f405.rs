//! An STM32F405 at 168 MHz from a crystal of 8 MHz.
//!
//! | what | where |
//! |---|---|
//! | motors 1 to 4 | PC6, PC7, PC8, PC9 (timer 3), pulses of 1 to 2 ms at 400 Hz |
//! | link | USART1: PA9 sends, PA10 receives; 921,600 baud, 8N1 |
//! | battery | PC2 behind a divider of 11 (10 kOhm over 1 kOhm), 3.3 V analogue supply |
//! | IMU | MPU-6000 on SPI1: PA5 clock, PA6 in, PA7 out, PA4 select |
//! | chance | the hardware's generator (RNG), once at the start; where it fails its own tests nobody is heard |
//! | watchdog | the independent one, 50 ms: five periods |
//!
//! Not tested on hardware: only built, linked and sized. What is above the
//! [`Board`](crate::board::Board) runs in the emulator, bit for bit.
#![allow(unsafe_code, reason = "interrupts and the panic handler reach registers that the main loop owns")]

use control::Config;
use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal_bus::spi::ExclusiveDevice;
use proto::{Ending, ImuSample};
use stm32f4xx_hal::adc::Adc;
use stm32f4xx_hal::adc::config::{AdcConfig, SampleTime};
use stm32f4xx_hal::gpio::{Analog, Output, PC2, Pin};
use stm32f4xx_hal::hal_02::blocking::rng::Read as _;
use stm32f4xx_hal::pac::{self, ADC1, SPI1, TIM3, USART1, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc;
use stm32f4xx_hal::serial::{self, config::Config as SerialConfig};
use stm32f4xx_hal::spi::{self, Spi};
use stm32f4xx_hal::timer::ErasedChannel;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::battery::Divider;
use crate::board::Board;
use crate::esc::{Escs, FRAME_US, IDLE_US, duty};
use crate::imu::Mpu6000;
use crate::reset;
use crate::ring::{Ring, Serial};
use crate::systick::Systick;

/// Counts of the motors' timer a second, and in one frame.
const TIMER_HZ: u32 = 21_000_000;
const FRAME_COUNTS: u32 = TIMER_HZ / 1_000_000 * FRAME_US;

const WATCHDOG_MS: u32 = 50;
const BAUD: u32 = 921_600;
const BATTERY: Divider = Divider { ratio: 11.0, reference_v: 3.3, full: 4095 };

static RECEIVED: Ring<2048> = Ring::new();
static TO_SEND: Ring<2048> = Ring::new();

type ImuBus = ExclusiveDevice<Spi<SPI1>, Pin<'A', 4, Output>, embedded_hal_bus::spi::NoDelay>;

/// The board.
pub struct Stm32f405 {
    link: Serial<'static, 2048, 2048>,
    clock: Systick,
    escs: Escs<ErasedChannel<TIM3>>,
    adc: Adc<ADC1>,
    battery: PC2<Analog>,
    /// None if it did not answer at the start; the preflight checks miss it.
    imu: Option<Mpu6000<ImuBus>>,
    watchdog: IndependentWatchdog,
    random: Option<[u8; 32]>,
}

/// Why the chip was reset. To be asked once: the flags are cleared, or the next reset would add its own to them.
pub fn last_end() -> Ending {
    // SAFETY: at the start nothing else uses the register, and only the bit that clears the flags is written.
    let register = unsafe { &*pac::RCC::ptr() }.csr();
    let flags = register.read().bits();
    register.modify(|_, w| w.rmvf().set_bit());
    reset::last_end(flags)
}

/// Sets the board up: motors at idle first, the watchdog last.
pub fn boot(config: &Config) -> Stm32f405 {
    // Both are given away once, here: `boot` is called once, at the start.
    let (Some(peripherals), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take())
    else {
        emergency()
    };
    let mut rcc = peripherals.RCC.freeze(rcc::Config::hse(8.MHz()).sysclk(168.MHz()).require_pll48clk());
    let port_a = peripherals.GPIOA.split(&mut rcc);
    let port_c = peripherals.GPIOC.split(&mut rcc);

    let (_, (one, two, three, four)) = peripherals.TIM3.pwm::<TIMER_HZ>(FRAME_US.micros(), &mut rcc);
    let mut one = one.with(port_c.pc6);
    let mut two = two.with(port_c.pc7);
    let mut three = three.with(port_c.pc8);
    let mut four = four.with(port_c.pc9);
    let idle = duty(IDLE_US, one.get_max_duty());
    one.set_duty(idle);
    two.set_duty(idle);
    three.set_duty(idle);
    four.set_duty(idle);
    one.enable();
    two.enable();
    three.enable();
    four.enable();
    let outputs = [one.erase(), two.erase(), three.erase(), four.erase()];
    let escs = Escs::new(outputs, config.command_range);

    let mut delay = peripherals.TIM5.delay_us(&mut rcc);
    let bus_pins = (Some(port_a.pa5), Some(port_a.pa6), Some(port_a.pa7));
    let mode = spi::Mode { polarity: spi::Polarity::IdleHigh, phase: spi::Phase::CaptureOnSecondTransition };
    // 1 MHz is the fastest for the chip's settings.
    let bus = Spi::new(peripherals.SPI1, bus_pins, mode, 1.MHz(), &mut rcc);
    let select = port_a.pa4.into_push_pull_output();
    let device = ExclusiveDevice::new_no_delay(bus, select).ok();
    let imu = device.and_then(|device| Mpu6000::new(device, &mut delay).ok());

    let serial_config = SerialConfig::default().baudrate(BAUD.bps());
    let pins = (port_a.pa9, port_a.pa10);
    if let Ok(mut port) = serial::Serial::<USART1, u8>::new(peripherals.USART1, pins, serial_config, &mut rcc)
    {
        port.listen(serial::Event::RxNotEmpty);
        // SAFETY: everything that its handler touches is there.
        unsafe { NVIC::unmask(pac::Interrupt::USART1) };
    }

    let mut bytes = [0; 32];
    let random = peripherals.RNG.constrain(&mut rcc).read(&mut bytes).is_ok().then_some(bytes);
    let adc = Adc::new(peripherals.ADC1, true, AdcConfig::default(), &mut rcc);
    // The core's timer counts the eighth part of 168 MHz.
    let clock = Systick::start(&mut core.SYST, SystClkSource::External, 21, config.sample_time_s);
    let mut watchdog = IndependentWatchdog::new(peripherals.IWDG);
    watchdog.stop_on_debug(&peripherals.DBGMCU, true);
    watchdog.start(WATCHDOG_MS.millis());
    let link = Serial { received: &RECEIVED, to_send: &TO_SEND, start: send };
    Stm32f405 { link, clock, escs, adc, battery: port_c.pc2.into_analog(), imu, watchdog, random }
}

/// Lets the interrupt of an empty transmitter take bytes until there are no more.
fn send() {
    // SAFETY: the only other writer is the handler, which is held back meanwhile.
    cortex_m::interrupt::free(|_| unsafe { (*USART1::ptr()).cr1().modify(|_, w| w.txeie().set_bit()) });
}

#[interrupt]
fn USART1() {
    // SAFETY: reading status and data, writing data, and one bit of control that `send` changes
    // only with interrupts held back.
    let port = unsafe { &*USART1::ptr() };
    let status = port.sr().read();
    // An overrun is cleared by the same reading of the data; its byte is damage that the packet's
    // CRC finds.
    if status.rxne().bit_is_set() || status.ore().bit_is_set() {
        let byte = port.dr().read().dr().bits() as u8;
        if status.rxne().bit_is_set() {
            RECEIVED.push(&[byte]);
        }
    }
    if status.txe().bit_is_set() && port.cr1().read().txeie().bit_is_set() {
        match TO_SEND.pop() {
            // SAFETY: any byte is data.
            Some(byte) => port.dr().write(|w| unsafe { w.dr().bits(u16::from(byte)) }),
            None => port.cr1().modify(|_, w| w.txeie().clear_bit()),
        };
    }
}

impl Board for Stm32f405 {
    type Link = Serial<'static, 2048, 2048>;

    fn link(&mut self) -> &mut Self::Link {
        &mut self.link
    }

    fn now_us(&mut self) -> u32 {
        self.clock.now_us()
    }

    fn wait(&mut self) {
        cortex_m::interrupt::free(|_| {
            if RECEIVED.is_empty() {
                cortex_m::asm::wfi();
            }
        });
    }

    fn imu(&mut self) -> Option<ImuSample> {
        self.imu.as_mut()?.sample().ok()
    }

    fn battery_v(&mut self) -> f32 {
        BATTERY.volts(self.adc.convert(&self.battery, SampleTime::Cycles_480))
    }

    fn current_a(&mut self) -> Option<f32> {
        None
    }

    fn drive(&mut self, commands: &[f32; 4]) -> bool {
        self.escs.drive(commands)
    }

    fn random(&mut self) -> Option<[u8; 32]> {
        self.random
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }
}

/// After a panic: motors idle, and nothing more until the watchdog resets the chip.
pub fn emergency() -> ! {
    cortex_m::interrupt::disable();
    let idle = u32::from(duty(IDLE_US, FRAME_COUNTS as u16));
    // SAFETY: nothing else runs any more.
    let timer = unsafe { &*TIM3::ptr() };
    for channel in 0..4 {
        // SAFETY: any number of counts is a pulse; this one idles.
        timer.ccr(channel).write(|w| unsafe { w.bits(idle) });
    }
    loop {
        cortex_m::asm::nop();
    }
}
