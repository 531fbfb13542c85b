//! Why an STM32F4 was reset: the flags of its register RCC_CSR (ST RM0090, 7.3.21).

use proto::Ending;

/// Flags of RCC_CSR.
const BROWN_OUT: u32 = 1 << 25;
const PIN: u32 = 1 << 26;
const POWER_ON: u32 = 1 << 27;
const SOFTWARE: u32 = 1 << 28;
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
const WINDOW_WATCHDOG: u32 = 1 << 30;

/// What the flags of RCC_CSR say. Every reset pulls the pin too, and switching the power on is a brown-out as well: the flag that fewer
/// resets set counts.
pub const fn last_end(flags: u32) -> Ending {
    if flags & (INDEPENDENT_WATCHDOG | WINDOW_WATCHDOG) != 0 {
        Ending::Watchdog
    } else if flags & SOFTWARE != 0 {
        Ending::Software
    } else if flags & POWER_ON != 0 {
        Ending::PowerOff
    } else if flags & BROWN_OUT != 0 {
        Ending::BrownOut
    } else if flags & PIN != 0 {
        Ending::ResetPin
    } else {
        Ending::Unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What each reset leaves in the register; at power-on that is its reset value, 0x0E00_0000.
    #[test]
    fn each_reset_is_told_from_the_others() {
        for (flags, ending) in [
            (0x0E00_0000, Ending::PowerOff),
            (0x0600_0000, Ending::BrownOut),
            (0x0400_0000, Ending::ResetPin),
            (0x1400_0000, Ending::Software),
            (0x2400_0000, Ending::Watchdog),
            (0x4400_0000, Ending::Watchdog),
            (0x8400_0000, Ending::ResetPin),
            (0x0000_0003, Ending::Unknown),
        ] {
            assert_eq!(last_end(flags), ending, "{flags:#010x}");
        }
    }
}
