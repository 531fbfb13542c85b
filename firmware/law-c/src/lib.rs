//! The flight law for programs in C, and for Simulink's C Caller block: the same code that flies, as a static library.
//!
//! `include/quadlab_law.h` declares what is here. It is the [`Controller`] alone, without the supervisor around it: no arming, no
//! failsafes, no limits of how old a measurement may be. Gains come as an image ([`craft::image`]), which `quadlab export --to c` writes
//! as a header. Nothing allocates, and nothing panics: every function is total for whatever the pointers point to, as long as they point
//! to memory of the declared size or are null.
#![cfg_attr(target_os = "none", no_std)]
#![allow(unsafe_code, reason = "callers in C hand over pointers")]

use core::mem::{align_of, size_of};
use core::slice;

use control::controller::Controller;
use control::readings::{Command, Measurement, Mode};

/// Words of 8 bytes that a law takes, as the header says.
pub const LAW_WORDS: usize = 256;
/// In the first word of a law that has been started.
const STARTED: u64 = u64::from_le_bytes(*b"quadlab\x01");

/// A law in the caller's memory: `quadlab_law` of the header.
#[repr(C, align(8))]
pub struct Law {
    started: u64,
    controller: Controller,
}

const _: () = assert!(size_of::<Law>() <= 8 * LAW_WORDS && align_of::<Law>() <= 8);

/// What comes in with a tick: `quadlab_inputs` of the header.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Inputs {
    /// Tracked point, inertial NED, m.
    pub position_m: [f32; 3],
    /// Roll, pitch, yaw, rad.
    pub attitude_rad: [f32; 3],
    /// p, q, r, rad/s; NaN where there is no gyro.
    pub gyro_rad_s: [f32; 3],
    /// V.
    pub battery_v: f32,
    /// 0: attitude is commanded; anything else: position.
    pub position_mode: u32,
    /// Roll and pitch, rad; of attitude mode.
    pub attitude_command_rad: [f32; 2],
    /// rad.
    pub yaw_command_rad: f32,
    /// Inertial z, m, down positive.
    pub z_command_m: f32,
    /// Inertial x and y, m; of position mode.
    pub position_command_m: [f32; 2],
    /// 0: fly; anything else: motors at idle, integrators at zero.
    pub cut_off: u32,
    /// Added to each motor command, command units.
    pub injection: [f32; 4],
}

impl Inputs {
    fn measurement(&self) -> Measurement {
        let has_gyro = self.gyro_rad_s.iter().all(|rate| rate.is_finite());
        Measurement {
            position_m: self.position_m,
            attitude_rad: self.attitude_rad,
            gyro_rad_s: has_gyro.then_some(self.gyro_rad_s),
            battery_v: self.battery_v,
        }
    }

    fn command(&self) -> Command {
        Command {
            mode: if self.position_mode == 0 { Mode::Attitude } else { Mode::Position },
            attitude_rad: self.attitude_command_rad,
            yaw_rad: self.yaw_command_rad,
            z_m: self.z_command_m,
            position_m: self.position_command_m,
            cut_off: self.cut_off != 0,
            injection: self.injection,
        }
    }
}

/// It is done.
pub const DONE: i32 = 0;
/// A pointer is null.
pub const NULL: i32 = 1;
/// The gains are no image, a damaged one, or one of another version.
pub const NO_IMAGE: i32 = 2;
/// The gains cannot be flown.
pub const NOT_FLYABLE: i32 = 3;
/// The law was not started.
pub const NOT_STARTED: i32 = 4;

/// Starts a law with gains; whatever was in its memory is gone.
///
/// # Safety
/// `law` is null or points to `LAW_WORDS` words, aligned to 8 bytes; `gains` is null or points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quadlab_law_start(law: *mut Law, gains: *const u8, length: usize) -> i32 {
    if law.is_null() || gains.is_null() {
        return NULL;
    }
    // SAFETY: the caller gives as many bytes as it says; the first word of the law is within its memory.
    let image = unsafe {
        (&raw mut (*law).started).write(0);
        slice::from_raw_parts(gains, length)
    };
    let Ok((config, _)) = craft::image::decode(image) else { return NO_IMAGE };
    let Ok(controller) = Controller::new(&config) else { return NOT_FLYABLE };
    // SAFETY: a law fits into the memory that the header gives it, which is asserted above.
    unsafe { law.write(Law { started: STARTED, controller }) };
    DONE
}

/// The law in a caller's memory, if it was started.
///
/// # Safety
/// As of [`quadlab_law_start`], and nobody else uses the law meanwhile.
unsafe fn started<'a>(law: *mut Law) -> Result<&'a mut Law, i32> {
    if law.is_null() {
        return Err(NULL);
    }
    // SAFETY: the first word may be read; the rest is a law if and only if that word says so.
    unsafe { if (&raw const (*law).started).read() == STARTED { Ok(&mut *law) } else { Err(NOT_STARTED) } }
}

/// Puts the law back to its start: estimators and integrators begin anew with the next tick.
///
/// # Safety
/// As of [`quadlab_law_start`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quadlab_law_reset(law: *mut Law) -> i32 {
    // SAFETY: the caller's promise.
    match unsafe { started(law) } {
        Ok(law) => {
            law.controller.reset();
            DONE
        }
        Err(why) => why,
    }
}

/// One control period: motor commands of what was measured and is asked for. Where it is not `DONE` the commands are zeros.
///
/// # Safety
/// As of [`quadlab_law_start`]; `inputs` is null or points to [`Inputs`], `commands` is null or points to four numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quadlab_law_tick(law: *mut Law, inputs: *const Inputs, commands: *mut f32) -> i32 {
    if commands.is_null() {
        return NULL;
    }
    // SAFETY: the caller's promise; a null pointer is `None`.
    let (law, inputs) = unsafe { (started(law), inputs.as_ref()) };
    let (pwm, outcome) = match (law, inputs) {
        (Ok(law), Some(inputs)) => (law.controller.tick(&inputs.measurement(), &inputs.command()).pwm, DONE),
        (Err(why), _) => ([0.0; 4], why),
        (_, None) => ([0.0; 4], NULL),
    };
    // SAFETY: there is room for four numbers.
    unsafe { commands.cast::<[f32; 4]>().write_unaligned(pwm) };
    outcome
}

/// Nothing in here panics; a program for a chip needs this to link.
#[cfg(all(target_os = "none", not(test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
