//! Effects that no catalogue has are said to be unknown, and what is told of them leads to their
//! cause.
#![forbid(unsafe_code)]

use diagnosis::workflow::{self, FlightSets, Reading, Silent};
use diagnosis::{Dependence, Diagnosis, Options, Verdict};
use model::Effect;
use stories::world::{OUTSIDE, Pattern, Sensors, Size, Style, World};

fn diagnosed(id: &str, strength: f64, size: Size, seed: u64) -> Diagnosis {
    diagnosed_by(&World::new(size, seed).with(id, strength).unwrap(), &Sensors::default())
}

fn diagnosed_by(world: &World, sensors: &Sensors) -> Diagnosis {
    let fly = |pattern: Pattern| world.fly(pattern, 24.0, sensors, 0).expect("the pilot copes");
    let (train, validate) = (Pattern::TRAIN.map(fly), Pattern::VALIDATE.map(fly));
    let vehicle = &world.vehicle;
    let mut sets = FlightSets::from_flights(&train, &validate, vehicle, Reading::default(), &Silent).unwrap();
    let basic = workflow::identify(vehicle, &[], &mut sets, None, &Silent).unwrap().model;
    workflow::diagnose(&basic, &[], &mut sets, &Options::default(), &Silent).unwrap()
}

fn depends_on(diagnosis: &Diagnosis) -> Vec<Dependence> {
    diagnosis.unexplained.iter().map(|left| left.depends_on).collect()
}

/// A wake that follows the rotors late makes them look quicker than they are. What is left tells:
/// the right lag leaves nothing that follows what was before, and it is found where a lag is what
/// was hidden.
#[test]
fn a_late_wake_is_no_quick_rotor() {
    for (size, seed) in [(Size::F330, 4), (Size::Small, 5)] {
        println!("{size:?}, seed {seed}");
        let wake = diagnosed("inflow", 1.0, size, seed);
        assert_eq!(wake.verdict, Verdict::Unexplained, "{}", wake.summary);
        assert!(depends_on(&wake).contains(&Dependence::Past), "{}", wake.summary);

        let lag = diagnosed("motor-lag", 0.75, size, seed);
        assert_eq!(lag.best(), Some(Effect::MotorLag), "{}", lag.summary);
        assert_eq!(depends_on(&lag), [], "{}", lag.summary);
    }
}

/// A pilot who answers the noise of the gyro gives the yaw a past: without a look at low frequency, a fifth to a quarter of its error
/// follows the accelerations of the last half second.
#[test]
fn noise_that_the_pilot_answers_is_nothing_that_answers_late() {
    for (size, style, noise, seed) in [
        (Size::F330, Style::Gentle, 0.8, 429_409),
        (Size::Small, Style::Gentle, 0.8, 771_660),
        (Size::Small, Style::Usual, 2.0, 858_544),
    ] {
        println!("{size:?}, {style:?}, seed {seed}");
        let sensors = Sensors { are_flown_by: true, ..Sensors::noisy(noise) };
        let diagnosis = diagnosed_by(&World::new(size, seed).flown(style), &sensors);
        assert_eq!(depends_on(&diagnosis), [], "{}", diagnosis.summary);
        assert_eq!(diagnosis.verdict, Verdict::Adequate, "{}", diagnosis.summary);
    }
}

/// None of them gets a name, but for one that flights of half a minute cannot tell from thrust that
/// is not quite quadratic.
#[test]
fn what_no_catalogue_has_gets_no_name() {
    let mut named = Vec::new();
    for (k, seedling) in OUTSIDE.iter().enumerate().filter(|(_, s)| s.id != "bungee") {
        let seed = 40 + k as u64;
        let diagnosis = diagnosed(seedling.id, 1.2, Size::ALL[k % 2], seed);
        println!("{}, seed {seed}: {}", seedling.id, diagnosis.summary);
        if diagnosis.verdict != Verdict::Unexplained {
            named.push((seedling.id, diagnosis.summary));
        }
    }
    assert!(named.is_empty(), "{named:?}");
}
