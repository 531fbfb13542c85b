//! What an effect says of itself, and how it hands over its columns.

use crate::axis::Axis;
use crate::rotor_quantity::RotorQuantity;
use crate::vehicle::Vehicle;

/// A coefficient's value with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value, in the unit of the effect's coefficient.
    pub value: f64,
    /// Standard error in the same unit; absent where the value was not fitted (printed, assumed).
    pub std_error: Option<f64>,
}

/// The sign that a coefficient of the basic model must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// Positive.
    Positive,
    /// Negative.
    Negative,
    /// That of this rotor's reaction torque, counted from 0.
    OfSpin(usize),
}

/// One coefficient of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// Name in files and JSON, after the thesis where it has one.
    pub name: &'static str,
    /// Unit, where rotor speeds are real rad/s. That of a model's coefficient is [`Self::unit_for`] its rotors.
    pub unit: &'static str,
    /// Unit where commands stand in for rotor speeds, if another: "cmd" is that of a command.
    pub unit_in_commands: Option<&'static str>,
    /// Smallest and largest physically possible value. Judged only where rotor speeds are real rad/s.
    pub possible: (f64, f64),
    /// An ordinary magnitude, the scale of search steps for effects of kind [`Kind::Adjusting`].
    pub typical: f64,
    /// Standard deviation about zero of what is known before any flight, for coefficients that only mean something
    /// together with another one (the height offset of a ground effect that may not be there).
    pub prior: Option<f64>,
    /// The sign that it must have, where geometry or physics leave no choice.
    pub sign: Option<Sign>,
    /// Whether it is counted in rotor speeds, which are commands near 1 where the motor map is unknown.
    pub in_rotor_speed: bool,
    /// Step of the difference that stands for a derivative, where it cannot be a small part of the typical value.
    pub derivative_step: Option<f64>,
    /// Largest possible magnitude in lengths of the craft's arms, for a place on the craft.
    pub most_arms: Option<f64>,
}

impl Coefficient {
    /// An ordinary coefficient.
    pub const fn new(name: &'static str, unit: &'static str, possible: (f64, f64), typical: f64) -> Self {
        Self {
            name,
            unit,
            unit_in_commands: None,
            possible,
            typical,
            prior: None,
            sign: None,
            in_rotor_speed: false,
            derivative_step: None,
            most_arms: None,
        }
    }

    /// With [`Coefficient::most_arms`].
    pub const fn within_arms(self, most: f64) -> Self {
        Self { most_arms: Some(most), ..self }
    }

    /// Smallest and largest possible value for a craft with such arms.
    pub fn possible_for(&self, arm_length_m: f64) -> (f64, f64) {
        let ((low, high), most) =
            (self.possible, self.most_arms.map_or(f64::INFINITY, |most| most * arm_length_m));
        (low.max(-most), high.min(most))
    }

    /// With a [`Coefficient::prior`].
    pub const fn known_to(self, deviation: f64) -> Self {
        Self { prior: Some(deviation), ..self }
    }

    /// With a [`Coefficient::sign`].
    pub const fn signed(self, sign: Sign) -> Self {
        Self { sign: Some(sign), ..self }
    }

    /// Counted in rotor speeds.
    pub const fn in_rotor_speed(self) -> Self {
        Self { in_rotor_speed: true, ..self }
    }

    /// With a [`Coefficient::derivative_step`].
    pub const fn stepped_by(self, step: f64) -> Self {
        Self { derivative_step: Some(step), ..self }
    }

    /// With a [`Coefficient::unit_in_commands`].
    pub const fn in_commands(self, unit: &'static str) -> Self {
        Self { unit_in_commands: Some(unit), ..self }
    }

    /// Its unit in a model with such rotors ([`crate::Model::rotor_quantity`]).
    pub fn unit_for(&self, rotors: RotorQuantity) -> &'static str {
        rotors.choose(self.unit, self.unit_in_commands)
    }

    /// Ordinary magnitude for a vehicle with or without a motor map.
    pub fn ordinary(&self, has_rotor_map: bool) -> f64 {
        if self.in_rotor_speed && !has_rotor_map { 0.05 } else { self.typical }
    }

    /// +1 or -1, where the sign must be that, for rotors that spin so ([`crate::Spin::yaw_sign`]).
    pub fn expected_sign(&self, spin: &[f64; 4]) -> Option<f64> {
        self.sign.map(|sign| match sign {
            Sign::Positive => 1.0,
            Sign::Negative => -1.0,
            Sign::OfSpin(rotor) => spin[rotor],
        })
    }
}

/// How an effect enters the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Part of the basic model (4.3): always there.
    Basic,
    /// Linear in its coefficients: each is a column of the regression and a term of the plant.
    Linear,
    /// Changes what the other terms see (wind, thrust near the floor, rotor speed, tracked point). Its regression
    /// columns are the derivatives of the residual with respect to its coefficients.
    Adjusting,
}

/// Which question an effect can answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// What does the model lack?
    Structure,
    /// Either: it may have been overlooked, or come about.
    Both,
    /// What changed since the model was good? A fit of everything absorbs it: a heavier craft has a smaller thrust
    /// coefficient, a shifted centre of mass other rotor moments.
    Change,
}

/// What is special about fitting, simulating or judging an effect. An ordinary effect has [`Special::NOTHING`].
#[derive(Debug, Clone, Copy)]
pub struct Special {
    /// Part of the thesis' model (tables 4.2 to 4.12), which most flights are simulated with: such a plant is integrated
    /// without a branch.
    pub of_thesis: bool,
    /// Passes in which the angular accelerations that its own columns look at are solved for. One: it looks at none.
    pub passes: usize,
    /// Adjusting, and takes so long (it divides at each rotor) that craft side by side without it leave it out.
    pub is_slow: bool,
    /// Adjusting, and yet adds accelerations of its own, which no column shows.
    pub adds_accelerations: bool,
    /// Hangs a load under the craft, whose pendulum no log shows.
    pub hangs_load: bool,
    /// Where a fit that knows nothing of it starts: values of the coefficients that make its shape (a length, a
    /// frequency), none for those that least squares give once the shape is known. Nothing where it can start at zero.
    pub starts: fn() -> Vec<Vec<Option<f64>>>,
    /// Fitted beside the clocks of rotors and motion while they are aligned: left out, it would pass for an offset.
    pub aligned_with: bool,
    /// Says how rotors answer to commands, and nothing else.
    pub of_actuators: bool,
    /// Pushes along directions of the room, whatever the heading: flights at one heading cannot tell it from what is fixed to the craft.
    pub fixed_to_room: bool,
    /// Brakes: a coefficient above zero would accelerate the craft.
    pub brakes: bool,
    /// Seen better in accelerations, sample by sample, than in predictions over many samples.
    pub seen_by_the_sample: bool,
    /// Flights that leave it undetermined are worth a warning.
    pub must_be_determined: bool,
    /// Coefficients of each rotor, one rotor after the other, of which a change frees those of one; 0 where coefficients are the whole craft's.
    pub per_rotor: usize,
    /// Pulls towards a point that something must hold: its coefficients are a stiffness, then that times the place of the point.
    pub is_anchored: bool,
    /// Effects that act as they were never seen to once it has come about: in a wind, drag at airspeeds that were not flown before.
    /// As a change, it is fitted together with them.
    pub reveals: &'static [&'static str],
    /// Whether it can have come about since a model of this vehicle was good.
    pub can_come_about: fn(&Vehicle) -> bool,
    /// What its estimates must meet besides being significant and possible.
    pub requirement: Option<Requirement>,
}

/// A rule of an effect's own: estimates that miss it are not this effect.
#[derive(Debug, Clone, Copy)]
pub struct Requirement {
    /// What is asked, for people.
    pub question: &'static str,
    /// Unit of the figures.
    pub unit: &'static str,
    /// What was found, and the least that is needed.
    pub figures: fn(&[Estimate]) -> (f64, f64),
    /// Why estimates that miss it are not this effect, for people.
    pub objection: &'static str,
}

impl Special {
    /// What an ordinary effect declares.
    pub const NOTHING: Self = Self {
        of_thesis: false,
        passes: 1,
        is_slow: false,
        adds_accelerations: false,
        hangs_load: false,
        starts: Vec::new,
        aligned_with: false,
        of_actuators: false,
        fixed_to_room: false,
        brakes: false,
        seen_by_the_sample: false,
        must_be_determined: false,
        per_rotor: 0,
        is_anchored: false,
        reveals: &[],
        can_come_about: |_| true,
        requirement: None,
    };
}

/// What an effect says of itself.
#[derive(Debug, Clone, Copy)]
pub struct EffectInfo {
    /// The word for it in commands, files, JSON and pages.
    pub id: &'static str,
    /// One sentence for people.
    pub sentence: &'static str,
    /// The equation, LaTeX.
    pub equation: &'static str,
    /// Where the equation is from.
    pub source: Option<&'static str>,
    /// How it enters the equations.
    pub kind: Kind,
    /// Which question it can answer.
    pub question: Question,
    /// Rows it acts on.
    pub axes: &'static [Axis],
    /// Names of the measured quantities ([`crate::Quantity::named`]) that it acts through: one for each of `axes`, or
    /// one for all.
    pub through: &'static [&'static str],
    /// Its coefficients, in order.
    pub coefficients: &'static [Coefficient],
    /// The manoeuvre that shows it.
    pub excitation: &'static str,
    /// Effects that look alike, each with the manoeuvre that separates the two.
    pub confused_with: &'static [(&'static str, &'static str)],
    /// What is special about it.
    pub special: Special,
}

impl EffectInfo {
    /// Name of the measured quantity that it acts through in a row; none for a row that it does not act on.
    pub fn acts_through(&self, axis: Axis) -> Option<&'static str> {
        let place = self.axes.iter().position(|own| *own == axis)?;
        self.through.get(place).or(self.through.first()).copied()
    }

    /// Whether it is a change of the craft that shows in how its rotors share the work in steady flight.
    pub fn acts_on_balance(&self) -> bool {
        self.question == Question::Change && self.through.contains(&"thrust")
    }

    /// Whether a coefficient is counted in rotor speeds: without a motor map, its possible range means nothing.
    pub fn is_in_rotor_speed(&self) -> bool {
        self.coefficients.iter().any(|c| c.in_rotor_speed)
    }
}

/// Takes the entries of an effect's columns at one sample.
///
/// The same `columns` function of an effect feeds the regression (a sink that stores entries) and the plant (a sink
/// that multiplies by the coefficients and sums): an effect has one definition.
pub trait Sink {
    /// Coefficient `coefficient` (index within the effect) contributes `value` per unit to the row `axis`.
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64);
}

/// A sink for several effects, one after the other.
pub(crate) trait PlacedSink: Sink {
    /// What follows is of the effect at this place in the catalogue.
    fn begin(&mut self, place: usize);
}
