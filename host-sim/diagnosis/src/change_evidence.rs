//! Why is a change named, or why not? Every change that an effect can be, one for each motor where it is a motor's, held to
//! the same criteria as in a search for changes.

use model::{Effect, Model};
use report::number::p_equation;
use schemars::JsonSchema;
use serde::Serialize;

use crate::balance;
use crate::change::Change;
use crate::change_conclusion::sizes;
use crate::change_examined::{Examined, examine};
use crate::evidence::{
    CoefficientEvidence, Criterion, FlightDrop, WhyError, coefficients, criteria, flights,
};
use crate::finding::{Diagnosis, EffectFinding};
use crate::options::Options;
use crate::reason::joined;
use sysid::prepare::Prepared;

/// The evidence for and against one change by itself.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ChangeEvidence {
    /// The motor, for a change of one motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// Whether every criterion is met by itself.
    pub supported: bool,
    /// In a sentence.
    pub summary: String,
    /// Each criterion.
    pub criteria: Vec<Criterion>,
    /// Each flight, by a change that was estimated from the others.
    pub flights: Vec<FlightDrop>,
    /// Coefficients.
    pub coefficients: Vec<CoefficientEvidence>,
    /// What the steady balance of the rotors says of it, where it acts on that and the model knows the balance of its flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub balance: Option<BalanceEvidence>,
}

/// The evidence of the steady balance for and against a change.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BalanceEvidence {
    /// Whether it suffices.
    pub supported: bool,
    /// In a sentence.
    pub summary: String,
    /// Chance of such a shift in an unchanged craft, corrected for the number of candidates.
    pub p_value: f64,
    /// Part of the squared shift that it takes away on flights it was not estimated from, percent.
    pub drop_percent: f64,
    /// Coefficients.
    pub coefficients: Vec<CoefficientEvidence>,
}

/// The evidence for and against the changes that an effect can be.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct WhyChanged {
    /// The effect.
    pub effect: Effect,
    /// Each change that it can be: one, or one for each motor.
    pub changes: Vec<ChangeEvidence>,
    /// The effect of the change that a diagnosis names, where it names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<Effect>,
    /// What a diagnosis says.
    pub diagnosis: String,
    /// What to fly to see it.
    pub to_see_it: &'static str,
}

/// Examines the changes that `effect` can be, beside what a diagnosis of the same flights says.
pub fn why_changed(
    model: &Model,
    (effect, diagnosis): (Effect, Diagnosis),
    flown: &[&Prepared],
    options: &Options,
) -> Result<WhyChanged, WhyError> {
    let (changes, asked) = changes_of(model, effect, options)?;
    let balance = balance::answer(model, flown, &changes);
    let evidence = |change: &Change| {
        let of_balance =
            balance.iter().flat_map(|answer| &answer.findings).find(|(other, _)| other == change);
        let examined = examine(model, *change, flown, changes.len());
        let balance = of_balance.map(|(_, finding)| in_balance(finding));
        ChangeEvidence { balance, ..of_change(*change, &examined, &diagnosis, flown) }
    };
    Ok(WhyChanged {
        effect,
        changes: asked.iter().map(evidence).collect(),
        found: diagnosis.best(),
        diagnosis: diagnosis.summary,
        to_see_it: effect.info().excitation,
    })
}

/// The changes that are tried, and those of them that `effect` can be, of which there is one at least.
pub(crate) fn changes_of(
    model: &Model,
    effect: Effect,
    options: &Options,
) -> Result<(Vec<Change>, Vec<Change>), WhyError> {
    let changes = options.changes_with(effect, model);
    let asked: Vec<Change> = changes.iter().copied().filter(|change| change.effect == effect).collect();
    if asked.is_empty() {
        let mut tried: Vec<Effect> = changes.iter().map(|change| change.effect).collect();
        tried.dedup();
        return Err(WhyError::NoChange { effect, tried: joined(&tried, ", ") });
    }
    Ok((changes, asked))
}

fn of_change(
    change: Change,
    examined: &Examined,
    diagnosis: &Diagnosis,
    flown: &[&Prepared],
) -> ChangeEvidence {
    let same = |f: &&EffectFinding| f.effect == change.effect && f.motor == change.motor;
    let finding = &examined.finding;
    let is_estimated = !finding.coefficients.is_empty();
    let residuals = examined.residuals.as_ref();
    ChangeEvidence {
        motor: change.motor,
        supported: finding.supported,
        summary: summary(change, finding, diagnosis.effects.iter().find(same)),
        criteria: if is_estimated { criteria(&examined.evidence()) } else { Vec::new() },
        flights: residuals.map_or_else(Vec::new, |[without, with]| flights((without, with), flown)),
        coefficients: coefficients(finding),
        balance: None,
    }
}

fn in_balance(finding: &EffectFinding) -> BalanceEvidence {
    let is = match finding.supported {
        true => format!("is supported ({})", p_equation(finding.p_value)),
        false => "is not supported".into(),
    };
    BalanceEvidence {
        supported: finding.supported,
        summary: format!(
            "By the steady balance of the rotors it {is}, with {}: {}.",
            sizes(finding),
            finding.reason
        ),
        p_value: finding.p_value,
        drop_percent: finding.drop_percent,
        coefficients: coefficients(finding),
    }
}

/// What is found of it by itself, and what becomes of it beside all others.
fn summary(change: Change, alone: &EffectFinding, ranked: Option<&EffectFinding>) -> String {
    if !alone.supported {
        return format!("{change} is not supported: {}.", alone.reason);
    }
    let what = format!("{change} is supported by itself: {}.", alone.reason);
    match ranked {
        Some(ranked) if ranked.supported => format!("{what} The diagnosis finds it as well."),
        Some(ranked) => format!("{what} The diagnosis does not name it: {}.", ranked.reason),
        None => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::Reason;
    use model::Axis;

    #[test]
    fn the_balance_says_what_it_found_and_how_likely_it_is_by_chance() {
        let mut finding =
            EffectFinding::unsupported(Effect::MotorEfficiency, 2, Reason::WithinScatter { p_value: 0.2 });
        (finding.p_value, finding.motor) = (0.2, Some(4));
        let (name, unit) = ("thrust_loss_4", "1");
        finding.coefficients = vec![crate::CoefficientFigures {
            name,
            value: 0.0412,
            std_error: 0.03,
            unit,
            possible: (-1.0, 1.0),
        }];
        let found = in_balance(&finding);
        assert!(!found.supported);
        assert!(
            found.summary.starts_with(
                "By the steady balance of the rotors it is not supported, with thrust_loss_4 = 0.041 ± 0.030: "
            ),
            "{}",
            found.summary
        );
    }

    #[test]
    fn what_is_supported_by_itself_and_not_named_says_why() {
        let weak = Change { effect: Effect::MotorEfficiency, motor: Some(2) };
        let heavy = Change { effect: Effect::MassChange, motor: None };
        let like_chance = EffectFinding::unsupported(weak.effect, 5, Reason::LikeChance);
        let chance = "is not supported: its coefficients do not differ significantly from zero.";
        assert_eq!(summary(weak, &like_chance, None), format!("motor-efficiency of motor 2 {chance}"));

        let mut alone = like_chance;
        alone.supported = true;
        alone.reason = Reason::Changed { axes: &[Axis::W], percent: 12.0, rivals: Vec::new() };
        let mut ranked = alone.clone();
        assert!(summary(weak, &alone, Some(&ranked)).ends_with("The diagnosis finds it as well."));
        ranked.refuse(Reason::ExplainedBy { other: heavy });
        let said = summary(weak, &alone, Some(&ranked));
        assert!(said.contains("of motor 2 is supported by itself: the rms error of w"), "{said}");
        assert!(
            said.ends_with("does not name it: adds nothing once mass-change is accounted for."),
            "{said}"
        );
    }
}
