//! The drills flown, as a table for people.

use std::fmt::Write as _;
use std::ops::Range;

use control::Config;

use super::drill::DrillResult;
use super::list::drills;
use crate::flight::SilError;

/// The drills of some seeds under some gains as a table: what happens, the rule, the craft's
/// response in each flight; and whether all are as expected. Of several seeds, the flights of the
/// first and whatever is not as expected, and how far the craft drifted at most in all.
///
/// # Errors
/// A plan that cannot be flown.
pub fn table(seeds: Range<u64>, config: &Config) -> Result<(String, bool), SilError> {
    let (mut text, mut all) = (String::new(), true);
    for drill in drills() {
        let _ = writeln!(text, "{} [{:?}]", drill.name, drill.rule);
        let (mut drift_m, mut speed_m_s, mut count) = (0.0_f64, 0.0_f64, 0);
        for seed in seeds.clone() {
            for result in drill.fly(seed, config)? {
                all &= result.holds;
                drift_m = drift_m.max(result.drift_m);
                speed_m_s = speed_m_s.max(result.speed_m_s);
                count += 1;
                if seed == seeds.start || !result.holds {
                    text += &line(&result);
                }
            }
        }
        if seeds.end - seeds.start > 1 {
            let _ = writeln!(
                text,
                "  {count} flights, drift at most {drift_m:.2} m of {:.2} m, blind at up to {speed_m_s:.2} m/s up or down",
                drill.within_m
            );
        }
    }
    Ok((text, all))
}

fn line(result: &DrillResult) -> String {
    let went: Vec<String> = result
        .states
        .iter()
        .zip(&result.reasons)
        .map(|((state, at_s), reasons)| {
            let reasons: Vec<String> = reasons.iter().map(|reason| format!("{reason:?}")).collect();
            let reasons = if reasons.is_empty() { "all good".into() } else { reasons.join(" ") };
            format!("{state:?} {at_s:.2} s ({reasons})")
        })
        .collect();
    let went = if went.is_empty() { "flies on".to_owned() } else { went.join(", ") };
    let flagged = result.flagged_s.map_or("not flagged".to_owned(), |s| format!("flagged {s:.2} s"));
    let named = result.failed_motor.map_or(String::new(), |motor| format!(", motor {} named", motor + 1));
    let verdict =
        if result.holds { String::new() } else { format!("  NOT AS EXPECTED (seed {})", result.seed) };
    format!(
        "  {:8} {flagged:15} {went}{named}; drift {:.2} m, blind at up to {:.2} m/s{verdict}\n",
        result.flight, result.drift_m, result.speed_m_s
    )
}
