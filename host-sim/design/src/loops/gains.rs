//! Where the gains of a loop stand in a configuration.

use control::gains::{Config, InnerLoop, Law, Loops, PositionLoop};

use super::name::LoopName;

/// The gains of the loops.
pub fn loops_of(config: &Config) -> &Loops {
    match &config.law {
        Law::ModelBased(law) => &law.loops,
        Law::HandTuned(law) => &law.loops,
    }
}

/// The gains of the loops, to change.
pub fn loops_of_mut(config: &mut Config) -> &mut Loops {
    match &mut config.law {
        Law::ModelBased(law) => &mut law.loops,
        Law::HandTuned(law) => &mut law.loops,
    }
}

/// The gains of an inner loop.
pub fn inner_gains(loops: &Loops, name: LoopName) -> &InnerLoop {
    match name.inner() {
        LoopName::Roll | LoopName::Y => &loops.roll,
        LoopName::Pitch | LoopName::X => &loops.pitch,
        LoopName::Yaw => &loops.yaw,
        LoopName::Z => &loops.altitude,
    }
}

/// The gains of an inner loop, to change.
pub fn inner_gains_mut(loops: &mut Loops, name: LoopName) -> &mut InnerLoop {
    match name.inner() {
        LoopName::Roll | LoopName::Y => &mut loops.roll,
        LoopName::Pitch | LoopName::X => &mut loops.pitch,
        LoopName::Yaw => &mut loops.yaw,
        LoopName::Z => &mut loops.altitude,
    }
}

/// The gains of an outer loop.
pub fn outer_gains(loops: &Loops, name: LoopName) -> Option<&PositionLoop> {
    match name {
        LoopName::X => Some(&loops.x),
        LoopName::Y => Some(&loops.y),
        _ => None,
    }
}

/// One of the three gains of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gain {
    /// Velocity feedback, with the velocity loop alone: (5.25), (5.29).
    Velocity,
    /// Proportional, with the velocity loop closed and no integral: (5.27), (5.30).
    Proportional,
    /// Integral, with the rest closed: (5.28), (5.31).
    Integral,
}

/// All gains, in the order in which the design finds them.
pub const GAINS: [Gain; 3] = [Gain::Velocity, Gain::Proportional, Gain::Integral];

impl Gain {
    /// Its symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Velocity => "Kd",
            Self::Proportional => "Kp",
            Self::Integral => "Ki",
        }
    }
}

/// The value that a configuration gives a gain of a loop.
pub fn gain_of(config: &Config, name: LoopName, gain: Gain) -> f64 {
    let mut config = *config;
    *gain_mut(&mut config, name, gain)
}

/// A gain of a loop, to change.
pub fn gain_mut(config: &mut Config, name: LoopName, gain: Gain) -> &mut f64 {
    let loops = loops_of_mut(config);
    let [kd, kp, ki] = match name {
        LoopName::X => [&mut loops.x.kd, &mut loops.x.kp, &mut loops.x.ki],
        LoopName::Y => [&mut loops.y.kd, &mut loops.y.kp, &mut loops.y.ki],
        _ => {
            let inner = inner_gains_mut(loops, name);
            [&mut inner.kd, &mut inner.kp, &mut inner.ki]
        }
    };
    match gain {
        Gain::Velocity => kd,
        Gain::Proportional => kp,
        Gain::Integral => ki,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::name::LOOPS;

    /// Tables 5.1 and 5.2: Kd, Kp, Ki of roll (10, 100, 100) and yaw (5.5, 15, 1).
    #[test]
    fn gains_are_those_of_the_thesis_tables() {
        let config = Config::thesis();
        let of = |name| GAINS.map(|gain| gain_of(&config, name, gain));
        assert_eq!(of(LoopName::Roll), [10.0, 100.0, 100.0]);
        assert_eq!(gain_of(&config, LoopName::Yaw, Gain::Proportional), 15.0);
    }

    /// Each of the eighteen is a place of its own.
    #[test]
    fn a_gain_that_is_set_is_that_gain_and_no_other() {
        let every = || LOOPS.into_iter().flat_map(|name| GAINS.map(|gain| (name, gain)));
        for (name, gain) in every() {
            let mut config = Config::thesis();
            *gain_mut(&mut config, name, gain) = 77.0;
            let changed: Vec<_> =
                every().filter(|&(name, gain)| gain_of(&config, name, gain) == 77.0).collect();
            assert_eq!(changed, [(name, gain)]);
        }
    }
}
