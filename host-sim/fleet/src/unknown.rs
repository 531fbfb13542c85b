//! What the flights of a craft do not determine of its model: by the rules of `quadlab identify`, so that both say the same.

use diagnosis::recorded;
use model::{Axis, Effect, FitRecord, Group, Kind, Model, NotIdentified};

use crate::equations::{Columns, Parameter};
use crate::history::Series;
use crate::scatter::mean;

/// What is not identified of a craft.
#[derive(Debug, Clone, Default)]
pub(crate) struct Unknown {
    /// The reasons.
    pub(crate) reasons: Vec<NotIdentified>,
}

impl Unknown {
    /// What a craft's reference says of its own flights.
    pub(crate) fn of_reference(model: &Model) -> Self {
        Self { reasons: recorded(model) }
    }

    /// Adds what the signs of the coefficients say that the flights give one by one: a drag that accelerates is no drag.
    /// Whether that is more.
    pub(crate) fn add_signs(&mut self, reference: &Model, columns: &Columns, series: &[Series]) -> bool {
        let mut found = reference.clone();
        found.fit = Some(FitRecord::default());
        for parameter in &columns.parameters {
            let name = parameter.name();
            let own = series.iter().find(|series| series.name == name).and_then(|own| mean(&own.values));
            let term = found.terms.iter_mut().find(|term| term.effect == parameter.effect);
            let coefficient = term.and_then(|term| term.coefficients.get_mut(parameter.coefficient));
            if let (Some(own), Some(coefficient)) = (own, coefficient) {
                (coefficient.value, coefficient.std_error) = (own.value, Some(own.std_error));
            }
        }
        let before = self.reasons.len();
        for reason in recorded(&found) {
            let is_known = |known: &NotIdentified| {
                known.group == reason.group && (known.axis.is_none() || known.axis == reason.axis)
            };
            if !self.reasons.iter().any(is_known) {
                self.reasons.push(reason);
            }
        }
        self.reasons.len() > before
    }

    /// Whether a coefficient is not known: it acts on axes alone that are not identified.
    pub(crate) fn hides(&self, parameter: &Parameter) -> bool {
        let is_unknown = |axis: &Axis| self.reasons.iter().any(|reason| is_of(reason, *axis));
        axes(parameter).iter().all(is_unknown)
    }

    /// Whether flights are better fitted without a coefficient that is not known. The thrust is still what carries the craft, and where
    /// the log is too poor to tell what is left, what it gives still changes when the craft does.
    pub(crate) fn drops(&self, parameter: &Parameter) -> bool {
        let is_unknown =
            |axis: &Axis| self.reasons.iter().any(|reason| !reason.leaves_findings && is_of(reason, *axis));
        parameter.effect != Effect::Thrust && axes(parameter).iter().all(is_unknown)
    }
}

fn is_of(reason: &NotIdentified, axis: Axis) -> bool {
    reason.axis.map_or_else(|| Group::of(axis) == reason.group, |own| own == axis)
}

/// The axes where a coefficient acts. Basic effects have as many coefficients on each axis as on the others, in its order.
fn axes(parameter: &Parameter) -> &'static [Axis] {
    let info = parameter.effect.info();
    let (axes, coefficients) = (info.axes, info.coefficients.len());
    if info.kind == Kind::Basic && coefficients % axes.len() == 0 {
        let at = parameter.coefficient * axes.len() / coefficients;
        return &axes[at..=at];
    }
    axes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Estimate;
    use crate::history::Kind as Shows;

    fn names(columns: &Columns, is_in: impl Fn(&Parameter) -> bool) -> Vec<String> {
        let basic: Vec<Effect> = Effect::basic().collect();
        let of_basic = columns.parameters.iter().filter(|own| basic.contains(&own.effect));
        of_basic.filter(|own| is_in(own)).map(Parameter::name).collect()
    }

    #[test]
    fn an_axis_hides_its_own_coefficients_and_a_group_all_of_them() {
        let columns = Columns::about(&Model::thesis());
        let u = NotIdentified::of_axis(Axis::U, "no better".into(), "fly");
        let w = NotIdentified::of_axis(Axis::W, "no better".into(), "fly");
        let unknown = Unknown { reasons: vec![u, w] };
        let hidden = names(&columns, |own| unknown.hides(own));
        assert_eq!(hidden, ["thrust.C_T", "linear-drag.C_du", "linear-drag.C_dw"]);
        let dropped = names(&columns, |own| unknown.drops(own));
        assert_eq!(dropped, ["linear-drag.C_du", "linear-drag.C_dw"]);
        let rotation = NotIdentified::of_group(Group::Rotation, "clocks".into(), "log");
        let unknown = Unknown { reasons: vec![rotation] };
        let left = names(&columns, |own| !unknown.hides(own));
        assert_eq!(left, ["thrust.C_T", "linear-drag.C_du", "linear-drag.C_dv", "linear-drag.C_dw"]);
    }

    /// A drag that drives, by ten of its errors; by three it is next to zero.
    #[test]
    fn a_drag_that_drives_leaves_its_axis_unknown() {
        let model = Model::thesis();
        let columns = Columns::about(&model);
        let own = columns.parameters.iter().find(|p| p.effect == Effect::LinearDrag).unwrap();
        let driving = |value| Series {
            name: own.name(),
            kind: Shows::Coefficient,
            unit: "N s/m".into(),
            is_share: false,
            at: vec![0, 1],
            values: vec![Estimate { value, std_error: 0.1 }; 2],
        };
        let told = |value| {
            let mut unknown = Unknown::default();
            let is_more = unknown.add_signs(&model, &columns, &[driving(value)]);
            assert_eq!(is_more, !unknown.reasons.is_empty());
            // What is known already is not said again.
            assert!(!unknown.add_signs(&model, &columns, &[driving(value)]));
            unknown.reasons.iter().map(|reason| reason.axis).collect::<Vec<_>>()
        };
        assert_eq!(told(0.8), [Some(Axis::U)]);
        assert_eq!(told(0.2), []);
        assert_eq!(told(-0.8), []);
    }
}
