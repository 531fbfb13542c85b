//! The greatest tilt that a craft can hold: a held tilt makes it slide until the air holds it back,
//! and then every motor must still be inside its range.
//!
//! Each steady slide is an equilibrium of the model ([`crate::plant::equilibrium`]) at a speed over
//! ground; the greatest speed with all rotors between the ends of the motor map bounds tilt and
//! speed. On the thesis' craft it is not the thrust that ends first but a moment: the air rolls a
//! craft that slides sideways, by 3.78 rad/s^2 for each m/s, and four motors can hold only so much
//! against it.
//!
//! Not here: how long a steeper tilt lasts before that speed is reached, which is flown (crate
//! `sil`).

use model::{Model, Plant};
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::Result;
use crate::plant::Slide;

/// First step of the speed, m/s.
const STEP_M_S: f64 = 1.0;
/// Greatest speed that is tried, m/s: no flight cage is that long, and no model of drag holds
/// there.
const FASTEST_M_S: f64 = 60.0;
/// Battery of a model that does not say at which voltage it was made: the thesis', V.
const THESIS_BATTERY_V: f64 = 11.1;

/// A direction to slide in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Roll to the right.
    Right,
    /// Roll to the left.
    Left,
    /// Nose down.
    Forward,
    /// Nose up.
    Back,
}

impl Direction {
    /// All directions.
    pub const ALL: [Self; 4] = [Self::Right, Self::Left, Self::Forward, Self::Back];

    /// The word for it in text and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Left => "left",
            Self::Forward => "forward",
            Self::Back => "back",
        }
    }

    /// Velocity over ground at this speed with the nose to the north, m/s.
    fn velocity_ned_m_s(self, speed_m_s: f64) -> [f64; 3] {
        match self {
            Self::Right => [0.0, speed_m_s, 0.0],
            Self::Left => [0.0, -speed_m_s, 0.0],
            Self::Forward => [speed_m_s, 0.0, 0.0],
            Self::Back => [-speed_m_s, 0.0, 0.0],
        }
    }
}

/// The fastest steady slide in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SteadyTilt {
    /// Which way.
    pub direction: Direction,
    /// Angle between the body's and the inertial z axis, degrees.
    pub tilt_deg: f64,
    /// Speed over ground, m/s.
    pub speed_m_s: f64,
    /// The motor that is at an end of its range there, 1 to 4; absent: the speed is the greatest
    /// that is looked at, or there is no equilibrium beyond.
    pub motor: Option<usize>,
    /// Battery voltage, V.
    pub battery_v: f64,
}

impl SteadyTilt {
    /// What ends it, in words.
    pub fn limited_by(&self) -> String {
        match self.motor {
            Some(motor) => format!("motor {motor}"),
            None if self.speed_m_s >= FASTEST_M_S => {
                format!("not limited up to {FASTEST_M_S} m/s, the fastest that is tried")
            }
            None => "no equilibrium at higher speeds".into(),
        }
    }
}

/// A note where tilts were reached at speeds that the flights of the model never had.
pub(crate) fn extrapolated(model: &Model, tilts: &[SteadyTilt]) -> Option<String> {
    let flown_m_s = model.fit.as_ref()?.flown_speed_m_s?;
    let fastest_m_s = tilts.iter().map(|tilt| tilt.speed_m_s).fold(0.0, f64::max);
    (fastest_m_s > flown_m_s).then(|| {
        format!(
            "the greatest tilts are held at up to {fastest_m_s:.1} m/s, but the flights of the model were hardly ever faster than \
             {flown_m_s:.1} m/s: its drag is extrapolated"
        )
    })
}

/// The greatest tilts that can be held; empty for a model whose motors cannot be commanded.
///
/// # Errors
/// A model that cannot hover.
pub fn steady_tilts(model: &Model) -> Result<Vec<SteadyTilt>> {
    if !(model.vehicle.can_map_commands() && model.vehicle.has_rotor_map()) {
        return Ok(Vec::new());
    }
    let battery_v = Some(model.reference.battery_v).filter(|v| *v > 0.0).unwrap_or(THESIS_BATTERY_V);
    let plant = Plant::new(model);
    let ends = model.vehicle.motors.command_range.map(|end| plant.commanded_rad_s(&[end; 4], battery_v));
    let (slide, hover) = Slide::new(model, battery_v)?;
    let beyond = |rotor: &[f64; 4]| (0..4).find(|&k| !(ends[0][k]..=ends[1][k]).contains(&rotor[k]));
    let greatest = |direction: Direction| {
        let mut lean = hover;
        let (mut good, mut bad) = (0.0, FASTEST_M_S);
        let mut motor = None;
        let mut step_m_s = STEP_M_S;
        // Faster by a step, each found from the one before; where a motor is at its end, by smaller
        // steps.
        while step_m_s > 1e-3 && good < FASTEST_M_S {
            let next = f64::min(good + step_m_s, bad);
            match slide.at(direction.velocity_ned_m_s(next), &lean) {
                Some((further, rotor)) if beyond(&rotor).is_none() => (lean, good) = (further, next),
                found => {
                    motor = found.and_then(|(_, rotor)| beyond(&rotor)).map(|k| k + 1);
                    (bad, step_m_s) = (next, 0.5 * step_m_s);
                }
            }
        }
        SteadyTilt {
            direction,
            tilt_deg: (lean[0].cos() * lean[1].cos()).clamp(-1.0, 1.0).acos().to_degrees(),
            speed_m_s: good,
            motor,
            battery_v,
        }
    };
    Ok(Direction::ALL.map(greatest).to_vec())
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::plant::{TrimTarget, equilibrium};

    #[test]
    fn a_bound_of_the_search_is_no_limit_and_speeds_that_were_never_flown_are_extrapolated() {
        let tilt = |speed_m_s: f64, motor| SteadyTilt {
            direction: Direction::Right,
            tilt_deg: 50.0,
            speed_m_s,
            motor,
            battery_v: 11.1,
        };
        assert_eq!(tilt(9.0, Some(2)).limited_by(), "motor 2");
        assert!(tilt(FASTEST_M_S, None).limited_by().starts_with("not limited up to 60 m/s"));
        assert_eq!(tilt(9.0, None).limited_by(), "no equilibrium at higher speeds");
        let mut model = Model::thesis();
        assert_eq!(extrapolated(&model, &[tilt(60.0, None)]), None, "a model that does not say");
        model.fit = Some(model::FitRecord { flown_speed_m_s: Some(3.0), ..model::FitRecord::default() });
        assert_eq!(extrapolated(&model, &[tilt(2.9, Some(1))]), None);
        assert!(
            extrapolated(&model, &[tilt(60.0, None)]).unwrap().contains("hardly ever faster than 3.0 m/s")
        );
    }

    /// Against the force balance by hand: without moments from the air, equal rotors and equal drag
    /// D along all axes, the thrust T = 4 k w^2 at the greatest rotor speed carries m g and holds D
    /// v, so v = sqrt(T^2 - (m g)^2) / D and the tilt is atan(D v / (m g)).
    #[test]
    fn thrust_alone_ends_the_slide_of_a_simple_craft() {
        let mut model = Model::thesis();
        model
            .terms
            .retain(|t| [Effect::Thrust, Effect::RotorMoments, Effect::LinearDrag].contains(&t.effect));
        model.set(Effect::RotorMoments, &[0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.3, -0.3, 0.3, -0.3]);
        let drag = 0.6;
        model.set(Effect::LinearDrag, &[-drag; 3]);
        let vehicle = &model.vehicle;
        let weight = vehicle.mass * vehicle.gravity;
        let hover = equilibrium(&model, &TrimTarget::default()).unwrap();
        let per_square = weight / hover.rotor_rad_s.iter().map(|w| w * w).sum::<f64>();
        let fastest = Plant::new(&model).commanded_rad_s(&[2000.0; 4], 11.1)[0];
        let thrust = 4.0 * per_square * fastest * fastest;
        let speed = (thrust * thrust - weight * weight).sqrt() / drag;
        let tilts = steady_tilts(&model).unwrap();
        assert_eq!(tilts.len(), 4);
        for tilt in tilts {
            // Speeds are found to a millimetre a second.
            assert!((tilt.speed_m_s - speed).abs() < 2e-3, "{tilt:?} {speed}");
            assert!((tilt.tilt_deg - (drag * speed / weight).atan().to_degrees()).abs() < 0.01, "{tilt:?}");
            assert!(tilt.motor.is_some());
        }
    }

    /// The thesis' craft: reference section 6 says that a held roll slides at v = g sin(phi)/0.2211
    /// and needs 3.78 v of roll, which ends the motors; sideways that comes before nose down, where
    /// the air's moment is 2.754 u.
    #[test]
    fn the_air_rolls_the_thesis_craft_before_its_thrust_ends() {
        let tilts = steady_tilts(&Model::thesis()).unwrap();
        let of = |direction| *tilts.iter().find(|t| t.direction == direction).unwrap();
        let right = of(Direction::Right);
        // Drag along the body's v holds g sin(phi); what drag along w adds is a twentieth.
        let slide = 9.81 * right.tilt_deg.to_radians().sin() / 0.2211;
        assert!(
            (right.speed_m_s * right.tilt_deg.to_radians().cos() / slide - 1.0).abs() < 0.05,
            "{right:?} {slide}"
        );
        assert!(right.tilt_deg > 15.0 && right.tilt_deg < 30.0, "{right:?}");
        assert!(of(Direction::Forward).speed_m_s > right.speed_m_s, "{tilts:?}");
    }
}
