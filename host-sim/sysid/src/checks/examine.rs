//! What is checked of a flight before anything is fitted: faults of the log are found and named, not fitted away.
//!
//! [`examine`] looks at one flight: channels that lie ([`crate::checks::channels`]), axes and signs
//! ([`crate::checks::frames`], [`crate::checks::imu`]), motor order ([`crate::checks::motors`]), clocks ([`crate::checks::clocks`], [`crate::checks::command_clock`]). It hands back the flight
//! with what can be mended mended, and a list of [`Fault`]s. Faults of a vehicle file, of a fit and of a set of flights are
//! in [`crate::checks::vehicle`] and [`crate::checks::overlap`].

use std::borrow::Cow;

use model::Vehicle;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::airborne::{self, Airborne, LeftOut};
use crate::checks::clocks::{self, Clock, Clocks};
use crate::checks::frames::{self, FrameFault};
use crate::checks::under_sampled::Thinning;
use crate::checks::{
    accelerometer, accelerometer_offset, bench, channels, coarse_commands, command_clock, derived_rates,
    gyro, imu, interpolated, leaning_attitude, motors, tracker_tilt, under_sampled,
};
use crate::prepare::{PrepareError, Prepared, StandingGyro};
use flights::{Column, Flight, Mend, StandIn};

/// What kind of fault; the word in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// Tracker and board stamp the same moment differently.
    ClockOffset,
    /// Their clocks run at different paces.
    ClockSkew,
    /// The time between commands and motion changes within the flight.
    WanderingClock,
    /// Wrong axes, signs, orders or units of attitude, rates, position or acceleration, known which.
    WrongFrame,
    /// They contradict each other, not known why.
    InconsistentFrames,
    /// A gyro that is not to scale, not at right angles, drifts, or is rotated against the tracked attitude.
    GyroFault,
    /// An accelerometer that is not to scale, not at right angles, or drifts.
    AccelerometerFault,
    /// A tracker whose vertical is off.
    TiltedTracker,
    /// A tracked attitude and an accelerometer that lean against each other.
    LeaningAttitude,
    /// Motors numbered or spinning otherwise.
    WrongMotors,
    /// Commands at the ends of their range.
    SaturatedCommands,
    /// A stream that repeats its values, a motor that never moves.
    FrozenChannel,
    /// A tracker that jumps.
    TrackerJump,
    /// Gaps, missing values, uneven steps.
    Gaps,
    /// Parts in which the craft stands, is carried or tumbles.
    NotAirborne,
    /// Columns that were interpolated from a lower rate.
    Interpolated,
    /// Rates that were derived from the attitude and smoothed.
    DerivedRates,
    /// Commands that change between two rows of the log.
    UnderSampled,
    /// Motors that answer their commands in another way than in the flights of the model.
    MotorAnswers,
    /// A tracked body that lies in another way against the accelerometer than in the flights of the model.
    TrackerMoved,
    /// Commands that were rounded to coarse steps.
    CoarseCommands,
    /// Columns that were not logged, and what stands in for them.
    NotLogged,
    /// No position, and with it no speed through the air.
    NoPosition,
    /// Flights in winds of their own.
    WindBetweenFlights,
    /// Flights in a wind that wanders.
    WanderingWind,
    /// Mass, geometry or units of the vehicle file against what the fit says.
    ImplausibleVehicle,
    /// Fields of the vehicle file that no one has measured.
    UnmeasuredVehicle,
    /// Flights that are not those of the model's vehicle, or of two vehicles.
    OtherVehicle,
    /// A load that swings too wide to be followed.
    WideSwing,
    /// Too few or too short flights.
    TooFewFlights,
    /// Coefficients that the flights do not determine.
    NotExcited,
    /// Two flights that share samples.
    SharedSamples,
    /// A flight that the model was fitted on.
    FittedOn,
}

impl FaultKind {
    /// The word for it in JSON and on pages.
    pub const fn id(self) -> &'static str {
        match self {
            Self::ClockOffset => "clock-offset",
            Self::ClockSkew => "clock-skew",
            Self::WanderingClock => "wandering-clock",
            Self::WrongFrame => "wrong-frame",
            Self::InconsistentFrames => "inconsistent-frames",
            Self::GyroFault => "gyro-fault",
            Self::AccelerometerFault => "accelerometer-fault",
            Self::TiltedTracker => "tilted-tracker",
            Self::LeaningAttitude => "leaning-attitude",
            Self::WrongMotors => "wrong-motors",
            Self::SaturatedCommands => "saturated-commands",
            Self::FrozenChannel => "frozen-channel",
            Self::TrackerJump => "tracker-jump",
            Self::Gaps => "gaps",
            Self::NotAirborne => "not-airborne",
            Self::Interpolated => "interpolated",
            Self::DerivedRates => "derived-rates",
            Self::UnderSampled => "under-sampled",
            Self::MotorAnswers => "motor-answers",
            Self::TrackerMoved => "tracker-moved",
            Self::CoarseCommands => "coarse-commands",
            Self::NotLogged => "not-logged",
            Self::NoPosition => "no-position",
            Self::WindBetweenFlights => "wind-between-flights",
            Self::WanderingWind => "wandering-wind",
            Self::ImplausibleVehicle => "implausible-vehicle",
            Self::UnmeasuredVehicle => "unmeasured-vehicle",
            Self::OtherVehicle => "other-vehicle",
            Self::WideSwing => "wide-swing",
            Self::TooFewFlights => "too-few-flights",
            Self::NotExcited => "not-excited",
            Self::SharedSamples => "shared-samples",
            Self::FittedOn => "fitted-on",
        }
    }
}

impl Serialize for FaultKind {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

impl JsonSchema for FaultKind {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "FaultKind".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": "string", "description": "Kind of a fault." })
    }
}

/// What is done about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Taken care of; for the record.
    Note,
    /// Conclusions hold with the reservation that it says.
    Warning,
    /// Conclusions would be wrong.
    Refused,
}

/// A fault, for people and programs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Fault {
    /// What kind.
    pub kind: FaultKind,
    /// What is done about it.
    pub severity: Severity,
    /// The flight it is in, if in one.
    pub flight: Option<String>,
    /// What is wrong and how to mend it.
    pub sentence: String,
    /// What mends it, where a map of columns can say that.
    #[serde(skip)]
    pub mend: Option<Mend>,
    /// Where in the flight it is: first and last time of each place, s; none where it is about the flight as a whole.
    #[serde(skip)]
    pub places_s: Vec<[f64; 2]>,
}

impl Fault {
    /// A fault that does not belong to one flight.
    pub fn of_all(kind: FaultKind, severity: Severity, sentence: impl Into<String>) -> Self {
        let sentence = sentence.into();
        Self { kind, severity, flight: None, sentence, mend: None, places_s: Vec::new() }
    }
}

/// A flight that was looked at.
#[derive(Debug, Clone)]
pub struct Examined {
    /// Ready for regression: lies taken out, on one clock.
    pub prepared: Prepared,
    /// What was found, gravest first.
    pub faults: Vec<Fault>,
    /// Its clocks.
    pub clocks: Clocks,
    /// Which parts of the log were taken.
    pub taken: Taken,
    /// What thinning its commands shows, for [`crate::checks::under_sampled::of_flights`].
    pub thinning: Option<Thinning>,
}

/// Which parts of a log to take.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Parts {
    /// Those that are flown.
    #[default]
    Flown,
    /// What lies between these times of the log, s, ends included.
    Given(Vec<[f64; 2]>),
}

/// Which parts of a log were taken.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Taken {
    /// First and last time of each part, s.
    pub parts: Vec<[f64; 2]>,
    /// What was found not to fly, and left out.
    pub left_out: Vec<LeftOut>,
    /// First and last time of the log, s.
    pub span_s: [f64; 2],
}

/// The faults of a flight while they are found.
struct Found {
    flight: String,
    faults: Vec<Fault>,
}

impl Found {
    fn add(&mut self, kind: FaultKind, severity: Severity, sentence: impl Into<String>) {
        self.add_at(kind, severity, sentence, Vec::new());
    }

    fn add_at(
        &mut self,
        kind: FaultKind,
        severity: Severity,
        sentence: impl Into<String>,
        places_s: Vec<[f64; 2]>,
    ) {
        let flight = Some(self.flight.clone());
        self.faults.push(Fault { flight, places_s, ..Fault::of_all(kind, severity, sentence) });
    }
}

/// Examines what is flown of a log, mends what can be mended and prepares it.
pub fn examine(flight: &Flight, vehicle: &Vehicle) -> Result<Examined, PrepareError> {
    examine_parts(flight, vehicle, &Parts::Flown)
}

/// Examines parts of a log, mends what can be mended and prepares them.
pub fn examine_parts(flight: &Flight, vehicle: &Vehicle, parts: &Parts) -> Result<Examined, PrepareError> {
    let mut found = Found { flight: flight.name.clone(), faults: Vec::new() };
    let mut mend = None;
    tell_stand_ins(flight, &mut found);
    let (cut, standing, taken) = take(flight, vehicle, parts)?;
    if let Some(sentence) = airborne::sentence(&taken.left_out) {
        let places_s = taken.left_out.iter().map(|part| [part.from_s, part.to_s]).collect();
        found.add_at(FaultKind::NotAirborne, Severity::Warning, sentence, places_s);
    }
    let flight = cut.as_ref();
    let channels = channels::check(flight, vehicle);
    let masked = tell_channels(channels, &mut found);
    let mut flight = Cow::Borrowed(flight);
    if let Some(masked) = masked {
        flight = Cow::Owned(masked);
    }
    let rewritten = tell_rewritten(&flight, vehicle, &mut found);
    let mut prepared = Prepared::with_standing(&flight, vehicle, standing)?;
    let mut clocks = Clocks::default();
    let mut frame = frames::check(&prepared, vehicle);
    if frame.is_none() {
        let mut flight = flight.into_owned();
        clocks = Clocks::of(&prepared, vehicle.gravity);
        put_on_one_clock(&mut flight, &mut prepared, &mut clocks, (vehicle, standing))?;
        frame = imu_fault(&flight, &prepared, vehicle);
        // An IMU in other axes would be taken for one with another clock.
        if frame.is_none() {
            clocks.position = clocks::of_position(&prepared);
            let mut rest = Clocks { attitude: None, ..clocks };
            put_on_one_clock(&mut flight, &mut prepared, &mut rest, (vehicle, standing))?;
            clocks.aligned |= rest.aligned;
        }
        tell_clocks(&clocks, &mut found);
        if frame.is_none() {
            tell_sensors(&flight, &prepared, vehicle, &mut found);
            take_out_offset(&flight, &mut prepared);
        }
        if let Some(fault) = motors::check(&prepared, vehicle) {
            found.add(FaultKind::WrongMotors, Severity::Refused, fault.sentence);
            mend = fault.mend;
        } else if let Some(pieces) = command_clock::check(&prepared, vehicle) {
            found.add(FaultKind::WanderingClock, Severity::Warning, command_clock::sentence(&pieces));
        }
    }
    if let Some(fault) = frame {
        mend.clone_from(&fault.mend);
        add_frame(fault, &mut found);
    }
    prepared.notes.iter().for_each(|note| found.add(FaultKind::Gaps, Severity::Note, note));
    (prepared.is_interpolated, prepared.has_derived_rates) =
        (rewritten.interpolated, rewritten.derived_rates);
    // Of what is refused there is one at most: motors are looked at in right frames only.
    let mut faults = found.faults;
    faults.iter_mut().filter(|f| f.severity == Severity::Refused).for_each(|f| f.mend.clone_from(&mend));
    faults.sort_by_key(|f| std::cmp::Reverse(f.severity));
    let thinning = under_sampled::thinning(&prepared, vehicle);
    Ok(Examined { prepared, faults, clocks, taken, thinning })
}

/// What is wrong with the accelerometer's axes. Against an attitude that was made of it, nothing is proved.
fn imu_fault(flight: &Flight, prepared: &Prepared, vehicle: &Vehicle) -> Option<FrameFault> {
    if is_circular(flight) { None } else { imu::check(prepared, vehicle) }
}

/// Says what is wrong with gyro, accelerometer and the tracker's vertical. An estimator's attitude is made of them, and has their faults.
fn tell_sensors(flight: &Flight, prepared: &Prepared, vehicle: &Vehicle, found: &mut Found) {
    if prepared.has_logged_velocity || is_circular(flight) {
        return;
    }
    let forces = accelerometer::Comparison::of(prepared, vehicle.gravity);
    let of_forces = |check: fn(_) -> Vec<String>| forces.as_ref().map(check).unwrap_or_default();
    for (kind, faults) in [
        (FaultKind::GyroFault, gyro::check(prepared)),
        (FaultKind::AccelerometerFault, of_forces(accelerometer::check)),
        (FaultKind::TiltedTracker, of_forces(tracker_tilt::check)),
        (FaultKind::LeaningAttitude, of_forces(leaning_attitude::check)),
    ] {
        faults.into_iter().for_each(|fault| found.add(kind, Severity::Warning, fault));
    }
}

/// Takes the accelerometer's offset out. Against an attitude that was made of the gyro, nothing is known of it.
fn take_out_offset(flight: &Flight, prepared: &mut Prepared) {
    if !is_circular(flight) {
        accelerometer_offset::take_out(prepared);
    }
}

/// Whether the attitude was made of the gyro.
fn is_circular(flight: &Flight) -> bool {
    flight.stand_ins().contains(&StandIn::AnglesOfGyro)
}

/// Says which channels lie; the flight without what they say, where that is mended.
fn tell_channels(channels: channels::Channels, found: &mut Found) -> Option<Flight> {
    for (kind, lies) in [
        (FaultKind::FrozenChannel, channels.frozen),
        (FaultKind::TrackerJump, channels.jumps),
        (FaultKind::SaturatedCommands, channels.saturated),
    ] {
        let kept = kind == FaultKind::TrackerJump && channels.jumps_kept;
        let severity = if kept { Severity::Note } else { Severity::Warning };
        lies.into_iter().for_each(|lie| found.add_at(kind, severity, lie.sentence, lie.places_s));
    }
    channels.masked
}

/// What a logger did to the columns, which are not as they were measured.
struct Rewritten {
    interpolated: bool,
    derived_rates: bool,
}

/// Says which columns a logger interpolated, rounded or made of others.
fn tell_rewritten(flight: &Flight, vehicle: &Vehicle, found: &mut Found) -> Rewritten {
    let interpolated = interpolated::check(flight);
    for one in &interpolated {
        found.add(FaultKind::Interpolated, Severity::Warning, one.sentence());
    }
    if let Some(sentence) = coarse_commands::check(flight, vehicle) {
        found.add(FaultKind::CoarseCommands, Severity::Warning, sentence);
    }
    let derived_rates = derived_rates::check(flight);
    let rewritten =
        Rewritten { interpolated: !interpolated.is_empty(), derived_rates: derived_rates.is_some() };
    if let Some(sentence) = derived_rates {
        found.add(FaultKind::DerivedRates, Severity::Warning, sentence);
    }
    rewritten
}

/// Says what was not logged, and what cannot be told without it.
fn tell_stand_ins(flight: &Flight, found: &mut Found) {
    for stand_in in flight.stand_ins() {
        let kind = if stand_in.hides_speed() { FaultKind::NoPosition } else { FaultKind::NotLogged };
        stand_in.sentence().into_iter().for_each(|sentence| found.add(kind, Severity::Warning, sentence));
    }
}

/// The rows that are taken, what the gyro tells where the craft stands, and which parts they are.
fn take<'a>(
    flight: &'a Flight,
    vehicle: &Vehicle,
    parts: &Parts,
) -> Result<(Cow<'a, Flight>, Option<StandingGyro>, Taken), PrepareError> {
    let t = flight.required(Column::T);
    let is_asked = |t: &f64| match parts {
        Parts::Flown => true,
        Parts::Given(parts) => parts.iter().any(|[from, to]| (*from..=*to).contains(t)),
    };
    let asked: Vec<bool> = t.iter().map(is_asked).collect();
    bench::refuse_long_gaps(t, &asked)?;
    bench::refuse_motors_at_rest(flight, vehicle, &asked)?;
    let Airborne { flown, left_out, gyro } = match parts {
        Parts::Flown => airborne::airborne(flight, vehicle),
        Parts::Given(_) => Airborne { flown: asked, ..Airborne::default() },
    };
    let span_s = [t[0], t[t.len() - 1]];
    let mut taken = Taken { parts: Vec::new(), left_out, span_s };
    for (row, _) in flown.iter().enumerate().filter(|(_, flown)| **flown) {
        match taken.parts.last_mut() {
            Some(part) if flown[row - 1] => part[1] = t[row],
            _ => taken.parts.push([t[row]; 2]),
        }
    }
    if flown.iter().all(|flown| *flown) {
        return Ok((Cow::Borrowed(flight), gyro, taken));
    }
    if flown.iter().filter(|flown| **flown).count() < 2 {
        return Err(match airborne::sentence(&taken.left_out) {
            Some(left_out) => PrepareError::NeverFlies { left_out },
            None => PrepareError::NothingTaken { from_s: span_s[0], to_s: span_s[1] },
        });
    }
    Ok((Cow::Owned(flight.with_rows(&flown)), gyro, taken))
}

fn add_frame(fault: FrameFault, found: &mut Found) {
    if fault.named {
        found.add(FaultKind::WrongFrame, Severity::Refused, fault.sentence);
    } else {
        found.add(FaultKind::InconsistentFrames, Severity::Warning, fault.sentence);
    }
}

/// Puts the tracker on one clock with the board, where they differ.
fn put_on_one_clock(
    flight: &mut Flight,
    prepared: &mut Prepared,
    clocks: &mut Clocks,
    (vehicle, standing): (&Vehicle, Option<StandingGyro>),
) -> Result<(), PrepareError> {
    if let Some(correction) = clocks.correction() {
        *flight = clocks::align(flight, &correction);
        *prepared = Prepared::with_standing(flight, vehicle, standing)?;
        clocks.aligned = true;
    }
    Ok(())
}

fn tell_clocks(clocks: &Clocks, found: &mut Found) {
    let mut tell = |clock: Option<Clock>, tracked: &str, onboard: &str| {
        let Some(clock) = clock.filter(|c| c.matters) else { return };
        let kind = if clock.is_skewed() { FaultKind::ClockSkew } else { FaultKind::ClockOffset };
        let said = clock.sentence(tracked, onboard, clocks.board_keeps_time);
        found.add(
            kind,
            Severity::Warning,
            format!("{said}: the flight is put on one clock before the fit; correct the log's clock"),
        );
    };
    tell(clocks.attitude, "phi, theta, psi", "the gyro");
    tell(clocks.position, "x, y, z", "the IMU");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, flight, fly, truth};

    const KINDS: [FaultKind; 27] = [
        FaultKind::GyroFault,
        FaultKind::AccelerometerFault,
        FaultKind::CoarseCommands,
        FaultKind::ClockOffset,
        FaultKind::ClockSkew,
        FaultKind::WanderingClock,
        FaultKind::WrongFrame,
        FaultKind::InconsistentFrames,
        FaultKind::WrongMotors,
        FaultKind::SaturatedCommands,
        FaultKind::FrozenChannel,
        FaultKind::TrackerJump,
        FaultKind::Gaps,
        FaultKind::NotAirborne,
        FaultKind::Interpolated,
        FaultKind::DerivedRates,
        FaultKind::UnderSampled,
        FaultKind::MotorAnswers,
        FaultKind::TrackerMoved,
        FaultKind::WindBetweenFlights,
        FaultKind::WanderingWind,
        FaultKind::ImplausibleVehicle,
        FaultKind::OtherVehicle,
        FaultKind::TooFewFlights,
        FaultKind::NotExcited,
        FaultKind::SharedSamples,
        FaultKind::FittedOn,
    ];

    /// Programs read it: it is the name of the kind in small letters with hyphens.
    #[test]
    fn the_word_for_a_kind_is_its_name() {
        for kind in KINDS {
            let mut word = String::new();
            for letter in format!("{kind:?}").chars() {
                if letter.is_uppercase() && !word.is_empty() {
                    word.push('-');
                }
                word.push(letter.to_ascii_lowercase());
            }
            assert_eq!(kind.id(), word);
        }
    }

    #[test]
    fn a_refusal_is_graver_than_a_warning_and_that_than_a_note() {
        assert!(Severity::Refused > Severity::Warning && Severity::Warning > Severity::Note);
    }

    #[test]
    fn a_good_flight_has_no_fault() {
        let model = truth();
        let examined = examine(&fly(&model, 1, 20.0, &NONE), &model.vehicle).unwrap();
        assert_eq!(examined.faults, []);
        assert!(!examined.clocks.aligned);
    }

    #[test]
    fn the_gravest_fault_comes_first_and_every_fault_names_its_flight() {
        let model = truth();
        let mut flight = fly(&model, 1, 20.0, &NONE);
        // The gyro's yaw has the wrong sign; a moment of the tracker is missing.
        let mut r: Vec<f64> = flight.required(Column::R).iter().map(|r| -r).collect();
        r[500] = f64::NAN;
        flight.replace(Column::R, r);
        let faults = examine(&flight, &model.vehicle).unwrap().faults;
        let told: Vec<(FaultKind, Severity)> = faults.iter().map(|f| (f.kind, f.severity)).collect();
        assert_eq!(
            told,
            [(FaultKind::WrongFrame, Severity::Refused), (FaultKind::Gaps, Severity::Note)],
            "{faults:?}"
        );
        assert!(faults.iter().all(|f| f.flight.as_deref() == Some("flight-1.csv")));
        assert_eq!(faults[1].sentence, "1 single missing values bridged");
        assert!(faults.iter().all(|f| f.places_s.is_empty()), "{faults:?}");
    }

    #[test]
    fn a_tracker_that_is_late_is_put_on_the_boards_clock() {
        let model = truth();
        let mut flight = fly(&model, 2, 20.0, &NONE);
        for column in [Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta, Column::Psi] {
            let mut values = flight.required(column).to_vec();
            values.rotate_right(8);
            let first = values[8];
            values[..8].fill(first);
            flight.replace(column, values);
        }
        let examined = examine(&flight, &model.vehicle).unwrap();
        assert!(examined.clocks.aligned);
        let kinds: Vec<FaultKind> = examined.faults.iter().map(|f| f.kind).collect();
        assert!(kinds.contains(&FaultKind::ClockOffset), "{:?}", examined.faults);
    }

    #[test]
    fn a_flight_shorter_than_the_filters_is_refused_with_what_is_needed() {
        let Err(error) = examine(&flight(40, |_, _| {}), &Vehicle::thesis()) else { panic!("examined") };
        assert_eq!(
            error.to_string(),
            "has 40 samples over 0.39 s; at least 0.91 s without gaps or missing values are needed"
        );
    }
}
