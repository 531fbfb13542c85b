//! The simulated craft: plant, battery and sensors behind the four motor commands.

use control::Measurement;
use model::user_effects::Undefined;
use model::{Battery, DelayLine, Hold, Holds, Plant, State, Substeps, Surroundings, frames, user_effects};
use nalgebra::Vector3;

use super::gusts::{GustModel, Gusts};
use super::sensors::Sensors;

/// A craft with any coordinate or rate beyond this counts as lost.
const GONE: f64 = 1e4;

/// A craft in flight.
#[derive(Debug, Clone)]
pub struct SimulatedCraft {
    plant: Plant,
    substeps: Substeps,
    /// Present if the model has a dead time between command and rotor.
    dead_time: Option<DelayLine>,
    battery: Battery,
    sensors: Sensors,
    /// Present in air that is not still.
    gusts: Option<Gusts>,
    period_s: f64,
    /// Ticks so far, and in which of them the battery was put in.
    tick: u32,
    battery_since: u32,
    /// Voltage of the tick before, V.
    last_v: f64,
    /// Whether the model has effects of users, whose formulas may have no value.
    has_formulas: bool,
    /// Place of the time among the further columns that formulas name, where one does.
    time_place: Option<usize>,
    /// The formula that had none.
    pub fault: Option<Undefined>,
    /// Where it is and how it moves.
    pub state: State,
}

impl SimulatedCraft {
    /// A craft in `state`, advanced in ticks of `period_s` that are cut into `substeps` integration
    /// steps.
    pub fn new(
        plant: Plant,
        battery: Battery,
        sensors: Sensors,
        state: State,
        period_s: f64,
        substeps: u32,
    ) -> Self {
        let last_v = battery.voltage_v(0.0, &state.rotor_rad_s);
        let dead_time = (plant.adjustments().dead_time_s() > 0.0).then(|| {
            DelayLine::new(&plant, period_s, substeps, plant.command_for(&state.rotor_rad_s, last_v))
        });
        let substeps = plant.substeps(period_s, substeps);
        let has_formulas = plant.has_user_effects();
        let is_time = |name: &&str| *name == user_effects::TIME_COLUMN;
        let time_place = user_effects::columns().iter().position(is_time).filter(|_| has_formulas);
        let (tick, battery_since, fault) = (0, 0, None);
        Self {
            plant,
            substeps,
            dead_time,
            battery,
            sensors,
            gusts: None,
            period_s,
            tick,
            battery_since,
            last_v,
            has_formulas,
            time_place,
            fault,
            state,
        }
    }

    /// In gusts of this seed.
    pub fn with_gusts(self, gusts: Option<GustModel>, seed: u64) -> Self {
        let period_s = self.period_s;
        Self { gusts: gusts.map(|gusts| Gusts::new(gusts, period_s, seed)), ..self }
    }

    /// Voltage at the battery's terminals now, V.
    #[inline]
    pub fn voltage_v(&self) -> f64 {
        let since = self.tick.wrapping_sub(self.battery_since);
        self.battery.voltage_v(f64::from(since) * self.period_s, &self.state.rotor_rad_s)
    }

    /// A battery as full as the first was is put in.
    pub fn change_battery(&mut self) {
        self.battery_since = self.tick;
        self.last_v = self.voltage_v();
    }

    /// What the sensors measure now. To be called once a tick: each call draws new noise.
    #[inline(always)]
    pub fn sense(&mut self, voltage_v: f64) -> Measurement {
        self.sensors.sense(&self.state, voltage_v)
    }

    /// One tick with motor commands held, in command units.
    #[inline]
    pub fn advance(&mut self, pwm: &[f32; 4], voltage_v: f64) {
        let before = self.has_formulas.then_some(self.state);
        let command = pwm.map(f64::from);
        let around = self.enter_tick(voltage_v);
        match &mut self.dead_time {
            None => {
                let commanded = self.plant.commanded_rad_s(&command, around.battery_v);
                self.plant.step(&mut self.state, &commanded, around, &self.substeps);
            }
            Some(line) => line.step(&self.plant, &mut self.state, &command, &around),
        }
        self.end_tick();
        if let Some(before) = before.filter(|_| !self.state.is_finite()) {
            let commanded = self.plant.commanded_rad_s(&command, around.battery_v);
            self.fault = self.plant.undefined_in_step(&before, &commanded, around, &self.substeps);
        }
    }

    /// Begins a tick whose steps somebody else takes: what the rotors are commanded in it. [`Self::end_tick`] ends it.
    #[inline]
    pub(super) fn begin_tick(&mut self, pwm: &[f32; 4], voltage_v: f64) -> Holds {
        let command = pwm.map(f64::from);
        let battery_v = self.enter_tick(voltage_v).battery_v;
        match &mut self.dead_time {
            None => {
                let commanded_rad_s = self.plant.commanded_rad_s(&command, battery_v);
                [Some(Hold { commanded_rad_s, substeps: self.substeps }), None]
            }
            Some(line) => line.holds(&self.plant, &command, battery_v),
        }
    }

    /// What surrounds the craft over the tick that begins. It goes on with the air, if that moves, until [`Self::end_tick`].
    #[inline]
    fn enter_tick(&mut self, voltage_v: f64) -> Surroundings {
        // The battery acts on the motors all the time: over the tick, the voltage in its middle.
        // Held as it was at the start, a sag would come half a tick late.
        let middle_v = voltage_v + 0.5 * (voltage_v - self.last_v);
        self.last_v = voltage_v;
        let around = self.surroundings(middle_v);
        if let Some(gusts) = &mut self.gusts {
            gusts.enter(&mut self.state);
        }
        around
    }

    /// What comes after the steps of a tick.
    #[inline]
    pub(super) fn end_tick(&mut self) {
        if let Some(gusts) = &self.gusts {
            gusts.leave(&mut self.state, self.period_s);
        }
        self.tick = self.tick.wrapping_add(1);
    }

    /// What moves it.
    pub(super) fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The battery, and the time in the middle of the tick, since the first.
    #[inline]
    fn surroundings(&self, battery_v: f64) -> Surroundings {
        let mut around = Surroundings::from(battery_v);
        if let Some(place) = self.time_place {
            around.further[place] = (f64::from(self.tick) + 0.5) * self.period_s;
        }
        around
    }

    /// Something holds the craft: where it is, and more and more at this roll.
    pub fn hang(&mut self, roll_rad: f64) {
        // It gives way over some 0.1 s: a jump of the attitude is another fault.
        let give = 1.0 - (-self.period_s / 0.05).exp();
        let state = &mut self.state;
        let euler = frames::euler_from_quaternion(&state.attitude);
        let toward = Vector3::new(roll_rad, 0.0, euler.z) - euler;
        state.attitude = frames::quaternion_from_euler(euler + give * toward);
        state.rate_rad_s = give / self.period_s * Vector3::new(toward.x, toward.y, 0.0);
        state.velocity_m_s = Vector3::zeros();
    }

    /// A floor at this inertial z stops whatever comes down: no bounce, no sliding, legs that stand
    /// level. Returns whether the craft stands on it.
    pub fn stop_at(&mut self, floor_m: f64) -> bool {
        let state = &mut self.state;
        if state.position_ned_m.z < floor_m {
            return false;
        }
        let yaw_rad = frames::euler_from_quaternion(&state.attitude).z;
        state.position_ned_m.z = floor_m;
        // What pushes up leaves the floor by its own acceleration in the next period.
        let up_m_s = frames::dcm_from_quaternion(&state.attitude).tr_mul(&state.velocity_m_s).z.min(0.0);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.0, 0.0, yaw_rad));
        state.velocity_m_s = Vector3::new(0.0, 0.0, up_m_s);
        state.rate_rad_s = Vector3::zeros();
        true
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

#[cfg(test)]
mod tests {
    use super::*;
    use model::{Effect, Model};

    /// Commands are microseconds; rotors start where 1500 us hold them.
    fn rotor_after(delay_s: f64, ticks: u32) -> f64 {
        let mut model = Model::thesis();
        if delay_s > 0.0 {
            model.set(Effect::InputDelay, &[delay_s]);
        }
        let plant = Plant::new(&model);
        let start = plant.commanded_rad_s(&[1500.0; 4], 11.1);
        let state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), start);
        let sensors = Sensors::new(&model, None, 0.01, 0);
        let mut craft = SimulatedCraft::new(plant, Battery::constant(11.1), sensors, state, 0.01, 4);
        for _ in 0..ticks {
            let voltage_v = craft.voltage_v();
            craft.advance(&[1600.0; 4], voltage_v);
        }
        craft.state.rotor_rad_s[0] - start[0]
    }

    #[test]
    fn a_dead_time_shifts_the_rotors_by_itself() {
        assert_eq!(rotor_after(0.02, 2), 0.0, "nothing yet after two ticks");
        assert!(rotor_after(0.0, 2) > 10.0, "without dead time the rotor moves at once");
        // 0.7850 rad/s a microsecond (4.11), first-order lag of 21.5 rad/s.
        let closed_form = |time_s: f64| 78.50 * (1.0 - (-21.5 * time_s).exp());
        assert!((rotor_after(0.02, 5) - closed_form(0.03)).abs() < 1e-9);
        assert!((rotor_after(0.025, 5) - closed_form(0.025)).abs() < 1e-9);
    }

    /// A push that grows with the time adds a velocity that grows with its square, k t^2 / 2, but for a little drag.
    #[test]
    fn formulas_see_the_time_since_the_first_tick() {
        let text = "[[effect]]\nid = \"push\"\nacceleration.north = \"k * time\"\n\
                    coefficient = [{name = \"k\", unit = \"m/s^3\", possible = [-1.0, 1.0], typical = 0.01}]\n";
        let [user] = model::effects::draft(text, std::path::Path::new("push.toml")).unwrap()[..] else {
            panic!("one effect")
        };
        let after = |k: f64, delay_s: f64| {
            let mut model = Model::thesis();
            if delay_s > 0.0 {
                model.set(Effect::InputDelay, &[delay_s]);
            }
            model.set(Effect::User(user), &[k]);
            let plant = Plant::new(&model);
            let state = State::at_rest(Vector3::zeros(), plant.commanded_rad_s(&[1500.0; 4], 11.1));
            let sensors = Sensors::new(&model, None, 0.01, 0);
            let mut craft = SimulatedCraft::new(plant, Battery::constant(11.1), sensors, state, 0.01, 4);
            (0..20).for_each(|_| craft.advance(&[1500.0; 4], 11.1));
            craft.state.velocity_m_s
        };
        for delay_s in [0.0, 0.015] {
            let added = (after(1.0, delay_s) - after(0.0, delay_s)).norm();
            assert!((added / (0.5 * 0.2 * 0.2) - 1.0).abs() < 0.05, "{added}");
        }
    }

    #[test]
    fn a_craft_that_is_not_finite_is_gone() {
        let model = Model::thesis();
        let craft = |edit: fn(&mut State)| {
            let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
            edit(&mut state);
            let sensors = Sensors::new(&model, None, 0.01, 0);
            SimulatedCraft::new(Plant::new(&model), Battery::constant(11.1), sensors, state, 0.01, 4)
                .is_there()
        };
        assert!(craft(|_| {}));
        assert!(!craft(|s| s.position_ned_m.y = f64::NAN));
        assert!(!craft(|s| s.velocity_m_s.x = f64::INFINITY));
        assert!(!craft(|s| s.rate_rad_s.z = 2e4));
        assert!(!craft(|s| s.attitude[2] = f64::NAN));
    }
}
