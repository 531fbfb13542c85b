//! What is drawn for one flight of a campaign.

use control::Config;
use control::supervision_limits::Fence;
use design::check::CoefficientErrors;
use model::Model;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sha2::{Digest, Sha256};
use sil::endurance::{Deviations, drawn_fault};
use sil::{Fault, FlightPlan, GustModel, NoiseModel, Scenario, Script, Settings};

use crate::definition::{Samples, Spread, Unknown, limits};

/// How long a tour is, s: a fault comes after 2 to 8 s, and a landing takes 6 s.
const TOUR_S: f64 = 15.0;
/// Height at which a tour starts, m.
const TOUR_HEIGHT_M: f64 = 1.0;
/// Correlation time of gusts, s.
const GUST_S: f64 = 0.5;
/// Age of the poses where it is known, samples (thesis 5.5).
const USUAL_DELAY: u32 = 2;

/// A number that was drawn, by its name; the name ends with the unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// What it is in the model and the scenario.
    pub usual: f64,
}

/// What was drawn for a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// Every number that is not known, in the order of the definition.
    pub inputs: Vec<Input>,
    /// What goes wrong.
    pub fault: Option<Fault>,
    /// Seed of its tour, its noise and its gusts.
    pub seed: u64,
    model: Model,
    gusts: Option<GustModel>,
}

/// What flies in a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flies {
    /// A tour of the cage that differs from draw to draw.
    Tour,
    /// A named flight.
    Scenario(Scenario),
}

impl Flies {
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        if name == "tour" {
            return Ok(Self::Tour);
        }
        name.parse().map(Self::Scenario).map_err(|why: String| format!("{name}: {why}; or tour"))
    }
}

/// Numbers that nothing but the campaign's seed, the draw and their purpose decides.
fn generator(seed: u64, draw: u64, purpose: &str) -> Pcg64 {
    Pcg64::seed_from_u64(hashed(seed, draw, purpose))
}

fn hashed(seed: u64, draw: u64, purpose: &str) -> u64 {
    let mut hash = Sha256::new();
    hash.update(seed.to_le_bytes());
    hash.update(draw.to_le_bytes());
    hash.update(purpose.as_bytes());
    let digest = hash.finalize();
    u64::from_le_bytes(std::array::from_fn(|k| digest[k]))
}

/// Parts of the unknown quantities that are drawn each by itself, with their names.
pub(crate) fn parts(quantity: &'static str) -> &'static [&'static str] {
    match quantity {
        "mass_kg" => &["mass_kg"],
        "center_of_mass_m" => &["center_forward_m", "center_right_m"],
        "thrust_loss" => &["thrust_loss_1", "thrust_loss_2", "thrust_loss_3", "thrust_loss_4"],
        "rotor_lag_s" => &["rotor_lag_s"],
        "dead_time_s" => &["dead_time_s"],
        "wind_m_s" => &["wind_north_m_s", "wind_east_m_s"],
        "wind_shear_per_s" => &["wind_shear_north_per_s", "wind_shear_east_per_s"],
        "gust_m_s" => &["gust_m_s"],
        "battery_v" => &["battery_v"],
        "battery_sag_v" => &["battery_sag_v"],
        "noise" => &["noise"],
        "start_m" => &["start_north_m", "start_east_m"],
        "start_yaw_rad" => &["start_yaw_rad"],
        _ => &[],
    }
}

/// Name of the age of the poses.
pub(crate) const DELAY: &str = "delay_samples";

/// What a number is in the model and the scenario.
fn usual(name: &str) -> f64 {
    match name {
        "noise" => 1.0,
        DELAY => USUAL_DELAY.into(),
        _ => 0.0,
    }
}

/// Tries for a number within its ends: at most nine of ten are outside of them.
const TRIES: usize = 1000;

/// A number with a spread, between two ends.
fn one(spread: Spread, [least, most]: [f64; 2], own: &mut Pcg64) -> f64 {
    match spread {
        Spread::Range([low, high]) => (low + (high - low) * own.random::<f64>()).clamp(least, most),
        Spread::Normal(normal) => {
            let mut drawn = (0..TRIES).map(|_| {
                let unit: f64 = StandardNormal.sample(own);
                normal.mean + normal.deviation * unit
            });
            // What lies outside is drawn again: set to the end, it would heap up there.
            drawn.find(|value| (least..=most).contains(value)).unwrap_or(normal.mean)
        }
    }
}

/// The coefficients of a model that have an error, by name.
fn uncertain(model: &Model) -> impl Iterator<Item = (String, f64)> {
    model.terms.iter().flat_map(|term| {
        let info = term.effect.info();
        let both = term.coefficients.iter().zip(info.coefficients);
        let known = both.filter(|(own, _)| own.std_error.is_some_and(|error| error > 0.0));
        known.map(|(own, coefficient)| (format!("{}.{}", info.id, coefficient.name), own.value))
    })
}

impl Drawn {
    /// What is drawn for a draw of a campaign about a model.
    pub(crate) fn new(seed: u64, draw: u64, unknown: &Unknown, model: &Model) -> Self {
        let mut inputs = Vec::new();
        for (quantity, spread) in unknown.spreads() {
            for part in parts(quantity) {
                let Some(spread) = spread else { continue };
                let value = one(spread, limits(quantity, model), &mut generator(seed, draw, part));
                inputs.push(Input { name: (*part).to_owned(), value, usual: usual(part) });
            }
        }
        if let Some(Samples::Range([fewest, most])) = unknown.delay_samples {
            let value = generator(seed, draw, DELAY).random_range(fewest..=most);
            inputs.push(Input { name: DELAY.to_owned(), value: value.into(), usual: usual(DELAY) });
        }
        if let Some(errors) = CoefficientErrors::of(model).filter(|_| unknown.coefficients) {
            let drawn = errors.draw(model, &mut generator(seed, draw, "coefficients"));
            let both = uncertain(model).zip(uncertain(&drawn));
            let input = |((name, usual), (_, value))| Input { name, value, usual };
            inputs.extend(both.map(input));
        }
        let mut own = generator(seed, draw, "fault");
        let fault = own.random_bool(unknown.fault).then(|| drawn_fault(&mut own));
        Self::of(inputs, fault, hashed(seed, draw, "flight"), model)
    }

    /// A craft and its air by their numbers.
    fn of(inputs: Vec<Input>, fault: Option<Fault>, seed: u64, model: &Model) -> Self {
        let mut drawn = Self { inputs, fault, seed, model: model.clone(), gusts: None };
        for term in &mut drawn.model.terms {
            let info = term.effect.info();
            for (coefficient, own) in term.coefficients.iter_mut().zip(info.coefficients) {
                let name = format!("{}.{}", info.id, own.name);
                let value = drawn.inputs.iter().find(|input| input.name == name).map(|input| input.value);
                coefficient.value = value.unwrap_or(coefficient.value);
            }
        }
        let deviations = drawn.deviations();
        deviations.shift(&mut drawn.model);
        let gust_m_s = drawn.value("gust_m_s").unwrap_or(0.0);
        drawn.gusts = (gust_m_s > 0.0).then_some(GustModel { deviation_m_s: gust_m_s, time_s: GUST_S });
        drawn
    }

    /// The same with other numbers or without its fault, about the model of the plan.
    pub(crate) fn changed(&self, change: impl Fn(&Input) -> f64, with_fault: bool, model: &Model) -> Self {
        let changed = |input: &Input| Input { value: change(input), ..input.clone() };
        let inputs = self.inputs.iter().map(changed).collect();
        Self::of(inputs, self.fault.filter(|_| with_fault), self.seed, model)
    }

    /// A number by its name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.inputs.iter().find(|input| input.name == name).map(|input| input.value)
    }

    fn deviations(&self) -> Deviations {
        let value = |name| self.value(name).unwrap_or(0.0);
        Deviations {
            extra_mass_kg: value("mass_kg"),
            off_centre_m: ["center_forward_m", "center_right_m"].map(value),
            thrust_loss: ["thrust_loss_1", "thrust_loss_2", "thrust_loss_3", "thrust_loss_4"].map(value),
            slower_rotors_s: value("rotor_lag_s"),
            dead_time_s: value("dead_time_s"),
            wind_m_s: ["wind_north_m_s", "wind_east_m_s"].map(value),
            shear_per_s: ["wind_shear_north_per_s", "wind_shear_east_per_s"].map(value),
        }
    }

    /// The flight under gains.
    pub(crate) fn plan(&self, flies: Flies, config: &Config) -> FlightPlan {
        let noise = NoiseModel::default().times(self.value("noise").unwrap_or(1.0));
        let delay_samples = self.value(DELAY).map_or(USUAL_DELAY, |samples| samples as u32) as usize;
        let mut plan = match flies {
            Flies::Tour => self.tour(config),
            Flies::Scenario(scenario) => {
                let settings = Settings {
                    model: Some(self.model.clone()),
                    config: Some(*config),
                    noise: Some(noise),
                    seed: self.seed,
                    ..Settings::default()
                };
                let mut plan = scenario.plan(&settings);
                // Level is not at rest where the air moves: the craft goes with it. It is the campaign that decides, or calm draws
                // alone would have walls to be lost at.
                let is_held = matches!(scenario, Scenario::Hover | Scenario::Yaw30 | Scenario::Climb);
                let air = ["wind_m_s", "wind_shear_per_s", "gust_m_s"];
                if is_held && air.iter().flat_map(|key| parts(key)).any(|name| self.value(name).is_some()) {
                    plan.config.supervision.fence = Fence::NONE;
                }
                plan
            }
        };
        // Steps are the reference's flights with a constant voltage; here every flight has a battery that falls and sags.
        plan.battery = FlightPlan::identification(self.model.clone(), self.seed, TOUR_S).battery;
        plan.battery.full_v += self.value("battery_v").unwrap_or(0.0);
        plan.battery.hover_sag_v += self.value("battery_sag_v").unwrap_or(0.0);
        FlightPlan {
            noise: Some(noise),
            delay_samples,
            gusts: self.gusts,
            faults: self.fault.into_iter().collect(),
            ..plan
        }
    }

    /// A tour of the cage over a floor.
    fn tour(&self, config: &Config) -> FlightPlan {
        let value = |name| self.value(name).unwrap_or(0.0);
        FlightPlan {
            script: Script::tour(self.seed, TOUR_S),
            excitation: false,
            start_m: [value("start_north_m"), value("start_east_m"), -TOUR_HEIGHT_M],
            start_yaw_rad: value("start_yaw_rad"),
            floor_m: Some(0.0),
            config: *config,
            ..FlightPlan::identification(self.model.clone(), self.seed, TOUR_S)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal::Normal;

    fn unknown() -> Unknown {
        Unknown {
            mass_kg: Some(Spread::Range([-0.1, 0.3])),
            wind_m_s: Some(Spread::Normal(Normal { mean: 0.5, deviation: 0.2 })),
            delay_samples: Some(Samples::Range([1, 3])),
            fault: 0.5,
            ..Unknown::default()
        }
    }

    /// Means of 4000 draws lie within four of their standard errors.
    #[test]
    fn draws_have_the_spread_that_they_were_given() {
        let model = Model::thesis();
        let all: Vec<Drawn> = (0..4000).map(|draw| Drawn::new(3, draw, &unknown(), &model)).collect();
        let mean = |name: &str| all.iter().map(|drawn| drawn.value(name).unwrap()).sum::<f64>() / 4000.0;
        assert!((mean("mass_kg") - 0.1).abs() < 4.0 * 0.4 / 12_f64.sqrt() / 63.0);
        assert!((mean("wind_east_m_s") - 0.5).abs() < 4.0 * 0.2 / 63.0);
        assert!((mean("delay_samples") - 2.0).abs() < 4.0 * 0.82 / 63.0);
        let faults = all.iter().filter(|drawn| drawn.fault.is_some()).count();
        assert!((faults as f64 - 2000.0).abs() < 4.0 * 32.0, "{faults}");
    }

    /// What else is unknown changes no number, and neither does how many draws there are.
    #[test]
    fn a_number_is_decided_by_seed_draw_and_name_alone() {
        let model = Model::thesis();
        let alone = Unknown { mass_kg: unknown().mass_kg, ..Unknown::default() };
        for draw in [0, 1, 4711] {
            let [with, without] = [&unknown(), &alone].map(|unknown| Drawn::new(9, draw, unknown, &model));
            assert_eq!(with.value("mass_kg"), without.value("mass_kg"));
            assert_eq!(with.seed, without.seed);
            assert_eq!(without.inputs.len(), 1);
        }
        let of = |seed, draw| Drawn::new(seed, draw, &alone, &model).value("mass_kg");
        assert!(of(1, 1) != of(1, 2) && of(1, 1) != of(2, 1));
    }

    /// The mean square of 2000 draws of a coefficient is that of its error to four standard errors.
    #[test]
    fn coefficients_are_drawn_by_their_errors_and_reach_the_flight() {
        let mut model = Model::thesis();
        model.terms[0].coefficients[0].std_error = Some(0.02);
        let unknown = Unknown { coefficients: true, ..Unknown::default() };
        let all: Vec<Drawn> = (0..2000).map(|draw| Drawn::new(5, draw, &unknown, &model)).collect();
        let square =
            all.iter().map(|drawn| (drawn.inputs[0].value - drawn.inputs[0].usual).powi(2)).sum::<f64>();
        assert!((square / 2000.0 / 4e-4 - 1.0).abs() < 4.0 * (2.0_f64 / 2000.0).sqrt(), "{square}");
        assert_eq!(all[7].inputs.len(), 1);
        let flown = all[7].plan(Flies::Tour, &Config::thesis()).model.terms[0].coefficients[0].value;
        assert_eq!(flown, all[7].inputs[0].value);
        let back = all[7].changed(|input| input.usual, true, &model);
        assert_eq!(back.model.terms[0].coefficients[0].value, model.terms[0].coefficients[0].value);
    }

    /// Half a normal distribution: its mean is sqrt(2 / pi) of the deviation, to four standard errors of 4000 draws, and none is 0.
    #[test]
    fn a_normal_distribution_is_truncated_where_it_cannot_be_simulated() {
        let model = Model::thesis();
        let unknown = Unknown {
            dead_time_s: Some(Spread::Normal(Normal { mean: 0.0, deviation: 0.02 })),
            ..Unknown::default()
        };
        let all: Vec<f64> =
            (0..4000).map(|draw| Drawn::new(7, draw, &unknown, &model).inputs[0].value).collect();
        assert!(all.iter().all(|value| *value > 0.0 && *value < 0.5));
        let mean = all.iter().sum::<f64>() / 4000.0;
        let expected = 0.02 * (2.0 / std::f64::consts::PI).sqrt();
        assert!(
            (mean - expected).abs() < 4.0 * 0.02 * (1.0 - 2.0 / std::f64::consts::PI).sqrt() / 63.0,
            "{mean}"
        );
    }

    /// Calm draws and windy ones of a campaign fly in the same room, also where a number is set back to its nominal value.
    #[test]
    fn the_fence_is_that_of_the_campaign() {
        let (model, config) = (Model::thesis(), Config::thesis());
        let fence = |unknown: &Unknown, flies: Scenario, change: fn(&Input) -> f64| {
            let drawn = Drawn::new(1, 1, unknown, &model).changed(change, false, &model);
            drawn.plan(Flies::Scenario(flies), &config).config.supervision.fence
        };
        let range = |high| Some(Spread::Range([0.0, high]));
        for moving in [
            Unknown { gust_m_s: range(0.5), ..Unknown::default() },
            Unknown { wind_m_s: range(0.5), ..Unknown::default() },
            Unknown { wind_shear_per_s: range(0.5), ..Unknown::default() },
        ] {
            for flies in [Scenario::Hover, Scenario::Yaw30, Scenario::Climb] {
                assert!(fence(&moving, flies, |input| input.value) == Fence::NONE, "{moving:?}");
                assert!(fence(&moving, flies, |input| input.usual) == Fence::NONE, "{moving:?}, nominal");
            }
            assert!(fence(&moving, Scenario::X1, |input| input.value) != Fence::NONE);
        }
        let calm = Unknown { mass_kg: range(0.1), ..Unknown::default() };
        assert!(fence(&calm, Scenario::Hover, |input| input.value) != Fence::NONE);
    }

    #[test]
    fn what_is_drawn_reaches_the_flight() {
        let unknown = Unknown {
            gust_m_s: Some(Spread::Range([0.5, 0.5])),
            battery_v: Some(Spread::Range([-0.7, -0.7])),
            start_m: Some(Spread::Range([0.2, 0.2])),
            ..unknown()
        };
        let drawn = Drawn::new(1, 1, &unknown, &Model::thesis());
        let config = Config::thesis();
        let tour = drawn.plan(Flies::Tour, &config);
        assert_eq!(tour.gusts.unwrap().deviation_m_s, 0.5);
        assert_eq!(tour.start_m[..2], [0.2, 0.2]);
        assert_eq!(tour.delay_samples, drawn.value("delay_samples").unwrap() as usize);
        let hover = drawn.plan(Flies::Scenario(Scenario::Hover), &config);
        assert!(hover.config.supervision.fence == Fence::NONE && hover.noise.is_some());
        let usual = FlightPlan::identification(Model::thesis(), 1, 1.0).battery;
        assert!((hover.battery.full_v - (usual.full_v - 0.7)).abs() < 1e-12);
        assert_eq!(
            (hover.battery.hover_sag_v, hover.battery.hover_speed_rad_s),
            (usual.hover_sag_v, usual.hover_speed_rad_s)
        );
        let mass = hover.model.term(model::Effect::MassChange).unwrap().coefficients[0].value;
        assert_eq!(Some(mass), drawn.value("mass_kg"));
    }
}
