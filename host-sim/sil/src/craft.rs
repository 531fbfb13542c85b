//! The simulated craft: plant, battery and sensors behind the four motor commands.

use control::Measurement;
use model::{Battery, Plant, State, Substeps};

use crate::sensors::Sensors;

/// Beyond this any coordinate or rate counts as a craft that is gone (the bound of the reference simulation).
const GONE: f64 = 1e4;

/// A craft in flight.
#[derive(Debug, Clone)]
pub struct Craft {
    plant: Plant,
    substeps: Substeps,
    battery: Battery,
    sensors: Sensors,
    period_s: f64,
    tick: u32,
    /// Where it is and how it moves.
    pub state: State,
}

impl Craft {
    /// A craft in `state`, advanced in ticks of `period_s` that are cut into `substeps` integration steps.
    pub fn new(
        plant: Plant,
        battery: Battery,
        sensors: Sensors,
        state: State,
        period_s: f64,
        substeps: u32,
    ) -> Self {
        let substeps = plant.substeps(period_s, substeps);
        Self { plant, substeps, battery, sensors, period_s, tick: 0, state }
    }

    /// Voltage at the battery's terminals now, V.
    #[inline]
    pub fn voltage_v(&self) -> f64 {
        self.battery.voltage_v(f64::from(self.tick) * self.period_s, &self.state.rotor_rad_s)
    }

    /// What the sensors say now. Once a tick: noise goes on with every call.
    #[inline]
    pub fn sense(&mut self, voltage_v: f64) -> Measurement {
        self.sensors.sense(&self.state, voltage_v)
    }

    /// One tick with motor commands held, in command units.
    #[inline]
    pub fn advance(&mut self, pwm: &[f32; 4], voltage_v: f64) {
        let commanded = self.plant.commanded_rad_s(&pwm.map(f64::from), voltage_v);
        self.plant.step(&mut self.state, &commanded, voltage_v, &self.substeps);
        self.tick += 1;
    }

    /// Whether the simulation can go on.
    #[inline]
    pub fn is_there(&self) -> bool {
        let s = &self.state;
        // A sum of squares is finite and small only if every part is.
        let all =
            s.position_ned_m.norm_squared() + s.velocity_m_s.norm_squared() + s.rate_rad_s.norm_squared();
        all < GONE * GONE && s.attitude.norm_squared().is_finite()
    }
}
