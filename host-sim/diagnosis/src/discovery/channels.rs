//! Ways in which a scalar can act on a craft: along an axis, along the thrust, against the air, on one rotor.

use model::{Axis, Effect, Model, Plant, Sample, Sink, State};
use nalgebra::Vector3;

use crate::discovery::center::{About, Center, NEAREST};

/// A way in which a scalar acts on the six rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Channel {
    /// A force along, or a moment about, a body axis.
    Body(Axis),
    /// A force along north, east or down.
    Earth(usize),
    /// A horizontal force of any direction in the room.
    Horizontal,
    /// A force towards a point or an axis, or around it.
    Center(Center),
    /// A part of the thrust of all rotors.
    Thrust,
    /// A part of the thrust of one rotor: its force and its moments.
    Rotor(usize, RotorLever),
    /// The same with its moments and its force apart: the model's other rotors may stand in for a part of either.
    RotorApart(usize, RotorLever),
    /// A part of the thrust of every rotor, by what each has of its own: their forces and their moments.
    EachRotor([RotorLever; 4]),
    /// Drag against all of the motion through the air.
    Drag,
    /// Drag against the forward and sideward motion through the air.
    HorizontalDrag,
    /// Damping of roll and pitch alike: what a part of it shows by itself, the model's own damping takes.
    TiltDamping,
}

/// What a rotor's thrust does to the rows for each square of its speed, as the model has it: m, 1 and 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RotorLever {
    pub(crate) lift: f64,
    pub(crate) roll: f64,
    pub(crate) pitch: f64,
}

/// One row of a channel's formula: what stands before and after the amplitude times the shape.
pub(crate) struct RowText {
    pub(crate) row: &'static str,
    pub(crate) before: String,
    pub(crate) after: &'static str,
    /// Which amplitude.
    pub(crate) amplitude: usize,
    /// Which rotor's own, where each has its own.
    pub(crate) rotor: Option<usize>,
}

const EARTH: [&str; 3] = ["north", "east", "down"];
const OMEGA: [&str; 4] = ["omega1", "omega2", "omega3", "omega4"];

impl Channel {
    /// All that a model has room for, but for those that are wider than another one ([`Self::wider`]).
    pub(crate) fn all(model: &Model) -> Vec<Self> {
        let has_rotation = sysid::has_rotation(model);
        let mut all: Vec<Self> =
            model::AXES.into_iter().filter(|axis| axis.is_force() || has_rotation).map(Self::Body).collect();
        all.extend([Self::Earth(0), Self::Earth(1), Self::Earth(2), Self::Thrust]);
        all.extend([Self::Drag, Self::HorizontalDrag]);
        all.extend(has_rotation.then_some(Self::TiltDamping));
        if has_rotation && model.vehicle.has_rotor_map() {
            let levers = levers(model);
            all.extend(levers.into_iter().enumerate().map(|(k, lever)| Self::Rotor(k, lever)));
            all.push(Self::EachRotor(levers));
        }
        all
    }

    /// The same with the levers of a model's rotors; nothing where it has none.
    pub(crate) fn with_levers_of(self, model: &Model) -> Option<Self> {
        match self {
            Self::Rotor(k, _) => Some(Self::Rotor(k, levers(model)[k])),
            Self::RotorApart(k, _) => Some(Self::RotorApart(k, levers(model)[k])),
            Self::EachRotor(_) => Some(Self::EachRotor(levers(model))),
            _ => None,
        }
    }

    /// A way to act with this one as a part of it.
    pub(crate) const fn wider(self) -> Option<Self> {
        match self {
            Self::Earth(0 | 1) => Some(Self::Horizontal),
            Self::Rotor(k, lever) => Some(Self::RotorApart(k, lever)),
            _ => None,
        }
    }

    /// Ways to act, none of them with parameters of its own, that it is a weighted sum of.
    pub(crate) fn parts(self) -> Vec<Self> {
        match self {
            Self::Center(_) => (0..3).map(Self::Earth).collect(),
            Self::EachRotor(levers) => {
                levers.into_iter().enumerate().map(|(k, own)| Self::Rotor(k, own)).collect()
            }
            _ => vec![self],
        }
    }

    /// What it acts about.
    #[inline]
    pub(crate) const fn center(self) -> Option<Center> {
        match self {
            Self::Center(center) => Some(center),
            _ => None,
        }
    }

    /// Whether it is the same way to act, about whatever center.
    pub(crate) fn is_like(self, other: Self) -> bool {
        match (self, other) {
            (Self::Center(own), Self::Center(other)) => own.about == other.about,
            _ => self == other,
        }
    }

    /// Whether each rotor acts by its own.
    pub(crate) const fn is_each_rotor(self) -> bool {
        matches!(self, Self::EachRotor(_))
    }

    /// Independent amplitudes.
    pub(crate) const fn amplitudes(self) -> usize {
        match self {
            Self::Horizontal | Self::RotorApart(..) => 2,
            _ => 1,
        }
    }

    /// Adds what each amplitude multiplies when the scalar is `values`, one for each rotor, which differ where each acts by its own;
    /// parameters count from `first` in steps of one for each amplitude.
    #[inline]
    pub(crate) fn add(self, sample: &Sample, values: [f64; 4], first: usize, sink: &mut impl Sink) {
        let value = values[0];
        let mut forces = |parameter: usize, force: Vector3<f64>| {
            for (axis, along) in [Axis::U, Axis::V, Axis::W].into_iter().zip(force.iter()) {
                sink.add(axis, parameter, *along);
            }
        };
        let per_mass = value / sample.mass_kg();
        match self {
            Self::Body(axis) if axis.is_force() => sink.add(axis, first, per_mass),
            Self::Body(axis) => sink.add(axis, first, value),
            Self::Earth(k) => forces(first, sample.input.dcm.column(k) * per_mass),
            Self::Horizontal => {
                forces(first, sample.input.dcm.column(0) * per_mass);
                forces(first + 1, sample.input.dcm.column(1) * per_mass);
            }
            Self::Center(center) => forces(
                first,
                sample.input.dcm * center.direction_from(&sample.input.position_ned_m) * per_mass,
            ),
            Self::Thrust => sink.add(Axis::W, first, -value * sample.thrust_m_s2()),
            Self::Drag => forces(first, sample.air_velocity_m_s * -per_mass),
            Self::HorizontalDrag => {
                sink.add(Axis::U, first, -per_mass * sample.air_velocity_m_s.x);
                sink.add(Axis::V, first, -per_mass * sample.air_velocity_m_s.y);
            }
            Self::TiltDamping => {
                sink.add(Axis::P, first, -value * sample.input.rate_rad_s.x);
                sink.add(Axis::Q, first, -value * sample.input.rate_rad_s.y);
            }
            Self::Rotor(k, lever) | Self::RotorApart(k, lever) => {
                let square = sample.rotor_thrust_rad2_s2[k] * value;
                sink.add(Axis::W, first + self.amplitudes() - 1, -lever.lift * square);
                sink.add(Axis::P, first, lever.roll * square);
                sink.add(Axis::Q, first, lever.pitch * square);
            }
            Self::EachRotor(levers) => {
                let squares = sample.rotor_thrust_rad2_s2;
                let sum = |of: fn(&RotorLever) -> f64| -> f64 {
                    (0..4).map(|k| of(&levers[k]) * squares[k] * values[k]).sum()
                };
                sink.add(Axis::W, first, -sum(|lever| lever.lift));
                sink.add(Axis::P, first, sum(|lever| lever.roll));
                sink.add(Axis::Q, first, sum(|lever| lever.pitch));
            }
        }
    }

    /// Whether it pushes along directions of the room, whatever the heading.
    pub(crate) fn is_fixed_to_room(self) -> bool {
        matches!(self, Self::Earth(0 | 1) | Self::Horizontal)
    }

    /// The axes that it acts on.
    pub(crate) fn axes(self) -> &'static [Axis] {
        const FORCES: [Axis; 3] = [Axis::U, Axis::V, Axis::W];
        match self {
            Self::Body(Axis::U) => &[Axis::U],
            Self::Body(Axis::V) => &[Axis::V],
            Self::Body(Axis::W) | Self::Thrust => &[Axis::W],
            Self::Body(Axis::P) => &[Axis::P],
            Self::Body(Axis::Q) => &[Axis::Q],
            Self::Body(Axis::R) => &[Axis::R],
            Self::HorizontalDrag => &[Axis::U, Axis::V],
            Self::TiltDamping => &[Axis::P, Axis::Q],
            Self::Rotor(..) | Self::RotorApart(..) | Self::EachRotor(_) => &[Axis::W, Axis::P, Axis::Q],
            Self::Earth(_) | Self::Horizontal | Self::Center(_) | Self::Drag => &FORCES,
        }
    }

    /// Its rows as formulas: what stands before amplitude and shape, and what after. `center` names the numbers that say where its center
    /// is.
    pub(crate) fn rows(self, center: &[String]) -> Vec<RowText> {
        let row = |row: &'static str, before: &str, after: &'static str| RowText {
            row,
            before: before.into(),
            after,
            amplitude: 0,
            rotor: None,
        };
        let per_mass = " / mass";
        match self {
            Self::Body(axis) if axis.is_force() => vec![row(axis.name(), "", per_mass)],
            Self::Body(axis) => vec![row(axis.name(), "", "")],
            Self::Earth(k) => vec![row(EARTH[k], "", per_mass)],
            Self::Horizontal => {
                vec![row("north", "", per_mass), RowText { amplitude: 1, ..row("east", "", per_mass) }]
            }
            Self::Center(own) => {
                let directions = own.about.direction(center).into_iter();
                directions.map(|(axis, part)| row(axis, &format!("{part} * "), per_mass)).collect()
            }
            Self::Thrust => vec![row("w", "-thrust * ", "")],
            // Each acts against a motion, on the axis of that.
            Self::Drag | Self::HorizontalDrag | Self::TiltDamping => {
                let after = if self == Self::TiltDamping { "" } else { per_mass };
                self.quantities().iter().map(|axis| row(axis, &format!("-{axis} * "), after)).collect()
            }
            Self::Rotor(k, _) | Self::RotorApart(k, _) => {
                let [mut force, roll, pitch] = rows_of_rotor(k);
                force.amplitude = self.amplitudes() - 1;
                vec![force, roll, pitch]
            }
            Self::EachRotor(_) => {
                (0..4).flat_map(|k| rows_of_rotor(k).map(|row| RowText { rotor: Some(k), ..row })).collect()
            }
        }
    }

    /// Constants in its formulas: name, unit and value.
    pub(crate) fn constants(self) -> Vec<(String, &'static str, f64)> {
        match self {
            Self::Rotor(k, lever) | Self::RotorApart(k, lever) => constants_of_rotor(k, &lever).into(),
            Self::EachRotor(levers) => {
                levers.iter().enumerate().flat_map(|(k, lever)| constants_of_rotor(k, lever)).collect()
            }
            Self::Center(_) => vec![(NEAREST.0.into(), NEAREST.1, NEAREST.2)],
            _ => Vec::new(),
        }
    }

    /// Names of the amplitudes in formulas.
    pub(crate) const fn amplitude_names(self) -> &'static [&'static str] {
        match self {
            Self::Horizontal => &["north_k", "east_k"],
            Self::RotorApart(..) => &["k", "lift_k"],
            _ => &["k"],
        }
    }

    /// Unit of an amplitude over that of the shape.
    pub(crate) const fn unit(self) -> &'static str {
        match self {
            Self::Body(Axis::P | Axis::Q | Axis::R) => "rad/s^2",
            Self::Body(_) | Self::Earth(_) | Self::Horizontal | Self::Center(_) => "N",
            Self::Thrust | Self::Rotor(..) | Self::RotorApart(..) | Self::EachRotor(_) => "1",
            Self::Drag | Self::HorizontalDrag => "N s/m",
            Self::TiltDamping => "1/s",
        }
    }

    /// Measured quantities that it acts with.
    pub(crate) const fn quantities(self) -> &'static [&'static str] {
        match self {
            Self::Drag => &["u", "v", "w"],
            Self::HorizontalDrag => &["u", "v"],
            Self::TiltDamping => &["p", "q"],
            Self::Center(center) => center.about.quantities(),
            _ => &[],
        }
    }

    /// For people.
    pub(crate) fn meaning(self) -> String {
        match self {
            Self::Body(Axis::U) => "A force forward or backward".into(),
            Self::Body(Axis::V) => "A force to the right or left".into(),
            Self::Body(Axis::W) => "A force along the rotors' axis".into(),
            Self::Body(Axis::P) => "A roll acceleration".into(),
            Self::Body(Axis::Q) => "A pitch acceleration".into(),
            Self::Body(Axis::R) => "A yaw acceleration".into(),
            Self::Earth(0) => "A force along north".into(),
            Self::Earth(1) => "A force along east".into(),
            Self::Earth(_) => "A vertical force".into(),
            Self::Horizontal => "A horizontal force".into(),
            Self::Center(center) => match center.about {
                About::Point | About::Axis => format!("A force towards or away from {}", center.called()),
                About::Around => format!("A force around {}", center.called()),
            },
            Self::Thrust => "A change of the thrust".into(),
            Self::Rotor(k, _) | Self::RotorApart(k, _) => {
                format!("A change of the thrust of motor {}", k + 1)
            }
            Self::EachRotor(_) => "A change of the thrust of each rotor".into(),
            Self::Drag => "A change of the drag".into(),
            Self::HorizontalDrag => "A change of the horizontal drag".into(),
            Self::TiltDamping => "A change of the damping of roll and pitch".into(),
        }
    }
}

/// Force, roll and pitch of a rotor as formulas.
fn rows_of_rotor(k: usize) -> [RowText; 3] {
    [("w", "-lift"), ("p", "roll"), ("q", "pitch")].map(|(row, lever)| {
        let before = format!("{lever}{} * {}^2 * ", k + 1, OMEGA[k]);
        RowText { row, before, after: "", amplitude: 0, rotor: None }
    })
}

fn constants_of_rotor(k: usize, lever: &RotorLever) -> [(String, &'static str, f64); 3] {
    [("lift", "m", lever.lift), ("roll", "1", lever.roll), ("pitch", "1", lever.pitch)]
        .map(|(name, unit, value)| (format!("{name}{}", k + 1), unit, value))
}

/// What the catalogue's effects in a model say that each rotor does for each square of its speed, by the accelerations at rest with
/// one that turns about as fast as in hover.
fn levers(model: &Model) -> [RotorLever; 4] {
    const FIRST_RAD_S: f64 = 100.0;
    let mut own = model.clone();
    own.terms.retain(|term| !matches!(term.effect, Effect::User(_)));
    let plant = Plant::new(&own);
    let by = |rotors: [f64; 4]| {
        let state = State::at_rest(Vector3::zeros(), rotors);
        plant.accelerations(&plant.sample_of(&plant.input(&state, &rotors, model.reference.battery_v)))
    };
    let still = by([0.0; 4]);
    let lift = still[Axis::W.index()] - by([FIRST_RAD_S; 4])[Axis::W.index()];
    let hover_rad_s = FIRST_RAD_S * (model.vehicle.gravity / lift).sqrt();
    let speed_rad_s = if hover_rad_s.is_finite() && hover_rad_s > 0.0 { hover_rad_s } else { FIRST_RAD_S };
    std::array::from_fn(|k| {
        let mut rotors = [0.0; 4];
        rotors[k] = speed_rad_s;
        let turning = by(rotors);
        let of = |axis: Axis| (turning[axis.index()] - still[axis.index()]) / (speed_rad_s * speed_rad_s);
        RotorLever { lift: -of(Axis::W), roll: of(Axis::P), pitch: of(Axis::Q) }
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
    use std::path::Path;

    use nalgebra::Vector4;

    use super::*;
    use crate::testing::truth;

    /// What is added on each axis that is acted on, with these amplitudes.
    struct Added<'a>(&'a [f64], [Option<f64>; 6]);

    impl Sink for Added<'_> {
        fn add(&mut self, axis: Axis, parameter: usize, value: f64) {
            *self.1[axis.index()].get_or_insert_default() += self.0[parameter] * value;
        }
    }

    /// Lying on the right side, a craft has the ground to its right; heading east, north to its left; nose up, the ground behind.
    #[test]
    fn a_force_in_the_room_acts_along_the_body_axis_that_points_there() {
        let plant = Plant::new(&truth());
        for (turned, earth, expected) in [
            (1, 2, [0.0, 1.0, 0.0]),
            (3, 0, [0.0, -1.0, 0.0]),
            (3, 1, [1.0, 0.0, 0.0]),
            (2, 2, [-1.0, 0.0, 0.0]),
        ] {
            let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
            state.attitude = Vector4::zeros();
            (state.attitude[0], state.attitude[turned]) = (FRAC_1_SQRT_2, FRAC_1_SQRT_2);
            let input = plant.input(&state, &[600.0; 4], 11.5);
            let mut added = Added(&[1.0], [None; 6]);
            // As many newtons as the craft has kilograms.
            Channel::Earth(earth).add(&plant.sample_of(&input), [1.214; 4], 0, &mut added);
            for (found, expected) in added.1.into_iter().zip(expected) {
                assert!((found.unwrap() - expected).abs() < 1e-12, "{turned} {earth}: {:?}", added.1);
            }
            assert_eq!(added.1[3..], [None; 3]);
        }
    }

    /// Thesis (2.6) and (2.7) with its beta of 4.100726391e-4 kg m, 1.214 kg and arms of 0.167 m. Left rotors roll to the right, front ones
    /// pitch up.
    #[test]
    fn a_rotors_levers_are_those_of_the_equations_of_motion() {
        const BETA_KG_M: f64 = 4.100_726_391e-4;
        let model = truth();
        let values = |effect| model.term(effect).unwrap().values();
        let (lift, moments) = (values(Effect::Thrust)[0] * BETA_KG_M / 1.214, values(Effect::RotorMoments));
        let arm = SQRT_2 * 0.167 * BETA_KG_M;
        let (sides, ahead) = ([1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]);
        for (k, own) in levers(&model).into_iter().enumerate() {
            let expected = [lift, arm * sides[k] * moments[k], arm * ahead[k] * moments[4 + k]];
            for (found, expected) in [own.lift, own.roll, own.pitch].into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-8, "{k}: {own:?}, {expected}");
            }
        }
    }

    /// Read as an effect of users, which checks the units, the rows do to a craft in motion what the way to act adds. Where each rotor acts
    /// by its own, its speed stands for that.
    #[test]
    fn every_way_to_act_is_what_its_formula_says() {
        let model = truth();
        let all: Vec<Channel> = Channel::all(&model);
        for channel in all.iter().copied().chain(all.iter().filter_map(|channel| channel.wider())) {
            let (names, amplitudes) = (channel.amplitude_names(), &[0.7, -0.4][..channel.amplitudes()]);
            let mut rows = std::collections::BTreeMap::<&str, Vec<String>>::new();
            for RowText { row, before, after, amplitude, rotor } in channel.rows(&[]) {
                let own = rotor.map_or(String::new(), |k| format!(" * {}", OMEGA[k]));
                rows.entry(row).or_default().push(format!("({before}{}{own}{after})", names[amplitude]));
            }
            let each = channel.is_each_rotor();
            let unit = if each { "s" } else { channel.unit() };
            let rows: String = rows
                .iter()
                .map(|(row, sum)| format!("acceleration.{row} = \"{}\"\n", sum.join(" + ")))
                .collect();
            let coefficient = |name| {
                format!("{{ name = \"{name}\", unit = \"{unit}\", possible = [-1.0, 1.0], typical = 1.0 }}, ")
            };
            let coefficients: String = names.iter().map(coefficient).collect();
            let constant = |(name, unit, value): (String, &str, f64)| {
                format!("{{ name = \"{name}\", unit = \"{unit}\", value = {value:?} }}, ")
            };
            let constants: String = channel.constants().into_iter().map(constant).collect();
            let text = format!(
                "[[effect]]\nid = \"way\"\n{rows}coefficient = [{coefficients}]\nconstant = [{constants}]\n"
            );
            let [user] = model::effects::draft(&text, Path::new("test")).unwrap()[..] else {
                panic!("{text}")
            };
            let mut with = model.clone();
            with.set(Effect::User(user), amplitudes);
            let rotors = [620.0, 590.0, 655.0, 610.0];
            let mut state = State::at_rest(Vector3::new(0.3, -0.5, -1.2), rotors);
            state.attitude = Vector4::new(0.8, 0.2, -0.1, 0.5).normalize();
            (state.velocity_m_s, state.rate_rad_s) =
                (Vector3::new(1.1, -0.6, 0.4), Vector3::new(0.5, -0.3, 0.8));
            let by = |model: &Model| {
                let plant = Plant::new(model);
                plant.accelerations(&plant.sample_of(&plant.input(&state, &rotors, 11.5)))
            };
            let (with, without, plant) = (by(&with), by(&model), Plant::new(&model));
            let input = plant.input(&state, &rotors, 11.5);
            let mut added = Added(amplitudes, [None; 6]);
            channel.add(&plant.sample_of(&input), if each { rotors } else { [1.0; 4] }, 0, &mut added);
            let axes = model::AXES.into_iter().filter(|axis| added.1[axis.index()].is_some());
            assert_eq!(axes.collect::<Vec<_>>(), channel.axes());
            for (axis, expected) in added.1.into_iter().enumerate() {
                let found = with[axis] - without[axis];
                // Differences of accelerations of some hundred rad/s^2.
                assert!(
                    (found - expected.unwrap_or(0.0)).abs() < 1e-9,
                    "{channel:?} {axis}: {found}, {expected:?}"
                );
            }
        }
    }
}
