//! The drills flown, as a table for people.

use std::fmt::Write as _;

use super::drill::DrillResult;
use super::list::drills;
use crate::flight::SilError;

/// The drills of one seed as a table: what happens, the rule, the craft's response in each flight;
/// and whether all are as expected.
///
/// # Errors
/// A plan that cannot be flown.
pub fn table(seed: u64) -> Result<(String, bool), SilError> {
    let (mut text, mut all) = (String::new(), true);
    for drill in drills() {
        let _ = writeln!(text, "{} [{:?}]", drill.name, drill.rule);
        for result in drill.fly(seed)? {
            all &= result.holds;
            text += &line(&result);
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
    let verdict = if result.holds { "" } else { "  NOT AS EXPECTED" };
    format!("  {:8} {flagged:15} {went}; drift {:.2} m{verdict}\n", result.flight, result.drift_m)
}
