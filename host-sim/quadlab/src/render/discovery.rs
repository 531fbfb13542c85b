//! What was discovered, in words and as a document.

use diagnosis::{Discovery, DiscoveryVerdict, Proposal, Unexplained};
use model::Effect;
use report::number::{p_equation, percent};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::colour;
use crate::cli::effect_names::listed;
use crate::render::tables;

/// The conclusion, and each proposal.
pub(crate) fn answer(discovery: &Discovery) -> String {
    let mut text = colour::lead(&tables::paragraph(&conclusion(discovery)));
    for proposal in &discovery.proposals {
        text.push('\n');
        text.push_str(&proposal_text(proposal));
    }
    text
}

/// What the search ends with, in a paragraph.
pub(crate) fn conclusion(discovery: &Discovery) -> String {
    let known = match &discovery.known[..] {
        [] => "Known effects added first: none.".to_owned(),
        known => format!("Known effects added first: {}.", listed(known)),
    };
    let chance = p_equation(discovery.search_p_value);
    let answer = match (discovery.verdict, discovery.proposals.first()) {
        (_, Some(best)) => format!(
            "Proposed: {} It explains {} of the held-out residual beyond noise ({}).",
            best.sentence,
            share(best.share_of_structure_percent),
            p_equation(best.p_value)
        ),
        (DiscoveryVerdict::Nothing, None) if discovery.search_p_value < 0.01 => {
            "Nothing is proposed: the residual of the held-out flights is noise, and the best form of the training flights \
             does not predict it."
                .to_owned()
        }
        (DiscoveryVerdict::Nothing, None) => format!(
            "Nothing is proposed: the residual is noise, and the best form is no better than chance ({chance}; the limit is 0.01)."
        ),
        (_, None) => {
            let best = discovery.refused.as_ref();
            let best = best.map_or_else(String::new, |why| format!(" The best form was refused: {why}."));
            format!(
                "Nothing is proposed: something is left, but no formula predicts it on other flights (not-a-formula). Turbulence, lost \
                 data or someone touching the craft leave such residuals.{best} Next: repeat a pattern in still air, with at least \
                 three flights to fit on and two to judge by."
            )
        }
    };
    format!("{answer} {known}")
}

/// A share that is as good as all is not told to the last digit.
fn share(percent_of_all: f64) -> String {
    if percent_of_all > 99.0 { "over 99 %".into() } else { format!("{} %", percent(percent_of_all)) }
}

fn proposal_text(proposal: &Proposal) -> String {
    let mut lines = vec![format!("{}: {}", proposal.id, proposal.formula)];
    for c in proposal.coefficients.iter().chain(&proposal.constants) {
        lines.push(format!("  {} = {}", c.name, report::number::with_error(c.value, c.std_error, &c.unit)));
    }
    let drops: Vec<String> =
        proposal.drop_percent.iter().map(|(axis, drop)| format!("{axis} {} %", percent(*drop))).collect();
    let flights: Vec<String> = proposal
        .flights
        .iter()
        .map(|own| format!("{} {} %", own.flight, percent(own.drop_percent)))
        .collect();
    lines.push(format!(
        "  Held-out squared error, noise included, falls: {}; on {} of {} flights: {}.",
        drops.join(", "),
        proposal.flights_improved[0],
        proposal.flights_improved[1],
        flights.join(", ")
    ));
    lines.push(format!(
        "  Leave-one-out: improves {} of {} training flights.",
        proposal.splits[0], proposal.splits[1]
    ));
    lines.extend(proposal.physics.map(|physics| format!("  Consistent with: {physics}.")));
    lines.push(match &proposal.rivals[..] {
        [] => "  No form in other quantities explains these flights about as well.".into(),
        rivals => format!("  These flights cannot distinguish it from: {}.", rivals.join("; ")),
    });
    lines.push(format!("  To confirm: {}.", proposal.excite));
    lines.join("\n") + "\n"
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    proposals: &'a [Proposal],
    verdict: DiscoveryVerdict,
    known: &'a [Effect],
    unexplained: &'a [Unexplained],
    search_p_value: f64,
}

pub(crate) fn document(discovery: &Discovery) -> Document<'_> {
    Document {
        proposals: &discovery.proposals,
        verdict: discovery.verdict,
        known: &discovery.known,
        unexplained: &discovery.left,
        search_p_value: discovery.search_p_value,
    }
}
