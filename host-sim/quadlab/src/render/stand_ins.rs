//! Effects that were refused because of what they leave, although the error falls much with them.

use diagnosis::StandIn;
use report::number::percent;

use crate::render::grid::{Grid, number, text};

/// What each takes of the axis that it takes most of, and why it was not added.
pub(crate) fn table(all: &[StandIn]) -> Grid {
    let mut table = Grid::new(
        "Not added, although the error falls: each may be there, beside something unknown",
        [text("effect"), text("axis"), number("squared error falls by", "%"), text("why it was not added")],
    );
    for StandIn { effect, axis, drop_percent, reason } in all {
        table.push([effect.to_string(), axis.name().into(), percent(*drop_percent), reason.to_string()]);
    }
    table
}

#[cfg(test)]
mod tests {
    use diagnosis::Reason;
    use model::{Axis, Effect};

    use super::*;

    #[test]
    fn a_row_says_what_the_effect_takes_and_why_it_was_refused() {
        let refused = StandIn {
            effect: Effect::FlappingMoment,
            axis: Axis::P,
            drop_percent: 94.2,
            reason: Reason::AboveNoise { axis: Axis::P },
        };
        let text = table(&[refused]).to_text();
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(" flapping-moment p 94.2 probably a stand-in for another effect"), "{text}");
        assert!(words.ends_with("the residual of p is still well above the sensors' noise"), "{text}");
        assert!(!table(&[]).has_rows());
    }
}
