//! What a search about the base model cannot see of what it lacks, and one about what was found can.

use model::Effect;
use sysid::fit::linearise::step_scale;

use crate::finding::supported;
use crate::held_out::{Validated, fit_and_validate};
use crate::reason::joined;
use crate::search::{Chosen, PENALTY, Scored, Search, differs_by_chance};
use crate::search_error::{SearchError, Steps};

impl Search<'_> {
    /// What was chosen, and beside it the best of what shows on no base model, exactly fitted, where more than noise is `left`.
    pub(crate) fn with_hidden(
        &self,
        chosen: Chosen,
        left: &[bool; 6],
        refused: &[Effect],
    ) -> Result<Chosen, SearchError> {
        let set = supported(&chosen.findings);
        let from = chosen.validated.as_ref().unwrap_or(&self.base);
        let out = [set.as_slice(), refused].concat();
        let mut hidden = self.hidden(left, &out);
        // By itself on top of the base model each has been fitted already.
        hidden.retain(|members| chosen.validated.is_some() || members.len() > 1);
        let mut best: Option<Scored> = None;
        let mut steps = Steps::new(self.observer, hidden.len());
        for members in hidden {
            steps.next(&format!("trying {} beside the others", joined(&members, " and ")))?;
            let Some(with) = self.joined(from, &members) else { continue };
            let count: usize = members.iter().map(|effect| effect.info().coefficients.len()).sum();
            let score = self.screen.gain(&from.held_out, &with.held_out) - PENALTY * count as f64;
            let by_chance = |effect: &Effect| differs_by_chance(&with.fit, *effect, self.train);
            if score > best.as_ref().map_or(0.0, |b| b.0) && !members.iter().any(by_chance) {
                best = Some((score, members, with));
            }
        }
        let Some((_, members, with)) = best else { return Ok(chosen) };
        let (findings, validated) = self.prune([set, members.clone()].concat(), Some(with))?;
        let kept = supported(&findings);
        let is_seen = members.iter().all(|effect| kept.contains(effect));
        Ok(if is_seen { Chosen { findings, validated } } else { chosen })
    }

    /// The best model with more effects. What is nothing without what it reveals has no way to go from zero: the fit also starts at an
    /// ordinary value of each sign of each of its coefficients.
    fn joined(&self, from: &Validated, members: &[Effect]) -> Option<Validated> {
        let model = &from.fit.model;
        let effects = [model.effects().as_slice(), members].concat();
        let (effect, count) = (members[0], members[0].info().coefficients.len());
        let ordinary = |(k, sign): (usize, f64)| {
            let mut values = vec![0.0; count];
            values[k] = sign * step_scale(model.vehicle.has_rotor_map(), effect, k);
            let mut start = model.clone();
            start.set(effect, &values);
            fit_and_validate(&start, &effects, self.train, self.validate)
        };
        let ways = (0..count).flat_map(|k| [(k, 1.0), (k, -1.0)]).filter(|_| members.len() > 1);
        let fits = std::iter::once(self.more(from, members)).chain(ways.map(ordinary)).flatten();
        let gain = |with: &Validated| self.screen.gain(&from.held_out, &with.held_out);
        fits.max_by(|one, other| gain(one).total_cmp(&gain(other)))
    }

    /// What a search about the base model does not see for what it lacks: a load's swing under a cable that pulls harder; a wind
    /// and the drag that grows in it, of which neither is anything without the other where another force passes for the wind.
    fn hidden(&self, left: &[bool; 6], out: &[Effect]) -> Vec<Vec<Effect>> {
        let is_asked = |effect: &Effect| {
            !out.contains(effect) && effect.info().axes.iter().any(|axis| left[axis.index()])
        };
        let alone = self.searched.iter().copied().filter(is_asked).map(|effect| vec![effect]);
        let asked: Vec<Effect> = self.screen.candidates.iter().copied().filter(is_asked).collect();
        let revealed = |effect: &Effect| {
            let by = *effect;
            by.reveals().filter(|other| asked.contains(other)).map(move |other| vec![by, other])
        };
        alone.chain(asked.iter().flat_map(revealed)).collect()
    }
}

#[cfg(test)]
mod tests {
    use model::Kind;
    use sysid::prepare::Prepared;

    use super::*;
    use crate::finding::EffectFinding;
    use crate::observer::Silent;
    use crate::reason::Reason;
    use crate::testing::{ORDINARY, prepared, truth};

    /// What joins a tether that was found in flights with further effects; `left` on the horizontal axes.
    fn beside_a_tether(further: &[(Effect, &[f64])], candidates: &[Effect], left: bool) -> Vec<Effect> {
        let mut world = truth();
        world.set(Effect::Tether, &[0.5, 0.0, 0.0, -0.5]);
        further.iter().for_each(|(effect, values)| world.set(*effect, values));
        let flights = prepared(&world, 40..45, 12.0, &ORDINARY);
        let all: Vec<&Prepared> = flights.iter().collect();
        let (train, validate) = all.split_at(3);
        world.terms.retain(|term| term.effect.info().kind == Kind::Basic);
        let candidates = [candidates, &[Effect::Tether]].concat();
        let search = Search::new(&world, candidates, train, validate, &Silent).unwrap();
        let mut tether = EffectFinding::unsupported(Effect::Tether, 2, Reason::LikeChance);
        tether.supported = true;
        let validated = search.more(&search.base, &[Effect::Tether]).unwrap();
        let chosen = Chosen { findings: vec![tether], validated: Some(validated) };
        let chosen = search.with_hidden(chosen, &[left, left, false, false, false, false], &[]).unwrap();
        supported(&chosen.findings)
    }

    const WIND_AND_DRAG: [Effect; 2] = [Effect::SteadyWind, Effect::QuadraticDrag];

    #[test]
    fn a_wind_and_the_drag_that_grows_in_it_join_what_passed_for_the_wind() {
        let further: [(Effect, &[f64]); 2] =
            [(Effect::SteadyWind, &[2.0, 1.0]), (Effect::QuadraticDrag, &[-0.3; 2])];
        let [wind, drag] = WIND_AND_DRAG;
        assert_eq!(beside_a_tether(&further, &WIND_AND_DRAG, true), [Effect::Tether, wind, drag]);
        assert_eq!(beside_a_tether(&further, &WIND_AND_DRAG, false), [Effect::Tether]);
    }

    #[test]
    fn a_load_joins_the_cable_that_it_swings_under() {
        let load: [(Effect, &[f64]); 1] = [(Effect::SlungLoad, &[0.05, 0.4, 0.05])];
        let found = beside_a_tether(&load, &[Effect::SlungLoad], true);
        assert_eq!(found, [Effect::Tether, Effect::SlungLoad]);
    }

    #[test]
    fn nothing_joins_a_complete_model() {
        let candidates = [Effect::SteadyWind, Effect::QuadraticDrag, Effect::SlungLoad];
        assert_eq!(beside_a_tether(&[], &candidates, true), [Effect::Tether]);
    }
}
