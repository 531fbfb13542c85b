//! Flight-seconds of a campaign in a second of processor time: 2,000 flights over everything that is not known, as `quadlab campaign run`
//! flies them, in a fresh process. Noise, gusts, late poses, dead time, faults, the supervisor and what is made of each flight count.

use cpu_time::ProcessTime;

const DEFINITION: &str = r#"
name = "all"
seed = 1
draws = 500
scenarios = ["tour", "x-1"]

[unknown]
mass_kg = [-0.12, 0.12]
center_of_mass_m = [-0.004, 0.004]
thrust_loss = [-0.03, 0.05]
rotor_lag_s = [-0.008, 0.008]
dead_time_s = [0.0, 0.006]
wind_m_s = { mean = 0.0, deviation = 0.5 }
wind_shear_per_s = [-0.3, 0.3]
gust_m_s = [0.0, 0.5]
battery_v = [-0.6, 0.5]
battery_sag_v = [0.0, 0.3]
delay_samples = [1, 3]
noise = [0.5, 2.0]
start_m = [-0.5, 0.5]
start_yaw_rad = [-3.0, 3.0]
fault = 0.2
"#;
/// Lengths of a tour and of a step, s.
const LENGTHS_S: [f64; 2] = [15.0, 41.0];

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("campaign.toml");
    std::fs::write(&path, DEFINITION).expect("a file in it");
    let definition = campaign::Definition::read(&path).expect("the definition is right");
    let plan = campaign::Plan::new(&definition, &path, Some(1)).expect("it can be planned");
    let start = ProcessTime::now();
    campaign::run_shard(&plan, &path, 0, folder.path(), &|_, _| {}).expect("it can be flown");
    let cpu_s = start.elapsed().as_secs_f64();
    let (table, _) = campaign::merge(&plan, folder.path(), "").expect("it was flown to the end");
    let flight_s = flown_s(&table);
    println!(r#"{{"work":"flight-seconds of a campaign","amount":{flight_s},"cpu_s":{cpu_s}}}"#);
}

/// Flights of a table together, s; one that was lost ended there.
fn flown_s(table: &campaign::Table) -> f64 {
    let scenarios = table.text("scenario").expect("a column of the parts");
    let lost = table.real("lost_after_s").expect("a column of the parts");
    let [tour_s, step_s] = LENGTHS_S;
    let one = |(scenario, lost_s): (&String, &f64)| match scenario.as_str() {
        _ if lost_s.is_finite() => *lost_s,
        "tour" => tour_s,
        _ => step_s,
    };
    scenarios.iter().zip(lost).map(one).sum()
}
