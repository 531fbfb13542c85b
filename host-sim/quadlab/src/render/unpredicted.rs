//! Why a table of open-loop predictions has `-` in the place of a number.

use sysid::compare::Comparison;

/// A line below a table of all predicted quantities, or nothing where every number is known.
pub(crate) fn footnote<'a>(comparisons: impl IntoIterator<Item = &'a Comparison>) -> String {
    let all: Vec<&Comparison> = comparisons.into_iter().collect();
    let lacks_rotation = all.iter().any(|comparison| comparison.horizons.fifty.attitude_rad.is_nan());
    let rotation = if lacks_rotation {
        "  (- for attitude and rate: a model without rotation does not predict them)\n"
    } else {
        ""
    };
    of_position(all) + rotation
}

/// A line below a table of predicted positions.
pub(crate) fn of_position<'a>(comparisons: impl IntoIterator<Item = &'a Comparison>) -> String {
    let diverges = comparisons.into_iter().any(|comparison| comparison.horizons.fifty.position_m.is_nan());
    if diverges {
        "  (- for position: a prediction did not stay finite, so there is no mean error)\n".into()
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use sysid::compare::HorizonError;

    use super::*;

    #[test]
    fn only_what_is_not_known_is_explained() {
        let with = |fifty: HorizonError| {
            let mut comparison = sysid::compare::compare(&model::Model::thesis(), &[]);
            comparison.horizons.fifty = fifty;
            footnote([&comparison])
        };
        let known = HorizonError::default();
        assert_eq!(with(known), "");
        let said = with(HorizonError { attitude_rad: f64::NAN, ..known });
        assert!(said.contains("attitude") && !said.contains("position"), "{said}");
        let said = with(HorizonError { position_m: f64::NAN, ..known });
        assert!(said.contains("position") && !said.contains("attitude"), "{said}");
    }
}
