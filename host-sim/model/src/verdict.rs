//! What flights say of a model, for its translation and its rotation by themselves.
//!
//! The rows u v w and p q r are told apart because flights often determine one and not the other: forces show in every
//! manoeuvre, moments only where clocks are good and motors are excited one by one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::axis::{AXES, Axis};

/// The conclusion of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A known effect is missing.
    MissingEffect,
    /// No effect is supported and the residual shows no structure. Said only of what is modelled and identified.
    Adequate,
    /// The residual shows structure that no known effect accounts for.
    Unexplained,
    /// The flights do not determine the model, or not the answer.
    NotIdentified,
}

/// Axes that are judged together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Group {
    /// The force rows u v w.
    Translation,
    /// The moment rows p q r.
    Rotation,
}

/// Both groups in order.
pub const GROUPS: [Group; 2] = [Group::Translation, Group::Rotation];

impl Group {
    /// The group of an axis.
    pub const fn of(axis: Axis) -> Self {
        if axis.is_force() { Self::Translation } else { Self::Rotation }
    }

    /// Its axes in order.
    pub fn axes(self) -> impl Iterator<Item = Axis> {
        AXES.into_iter().filter(move |axis| Self::of(*axis) == self)
    }

    /// The word for it in files, JSON and sentences.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Translation => "translation",
            Self::Rotation => "rotation",
        }
    }
}

impl std::fmt::Display for Group {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// One value for each group; a table with the keys `translation` and `rotation` in files and JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerGroup<T> {
    /// Of u v w.
    pub translation: T,
    /// Of p q r.
    pub rotation: T,
}

impl<T> PerGroup<T> {
    /// Calls `f` for each group in order.
    pub fn from_fn(mut f: impl FnMut(Group) -> T) -> Self {
        Self { translation: f(Group::Translation), rotation: f(Group::Rotation) }
    }
}

impl<T> std::ops::Index<Group> for PerGroup<T> {
    type Output = T;
    fn index(&self, group: Group) -> &T {
        match group {
            Group::Translation => &self.translation,
            Group::Rotation => &self.rotation,
        }
    }
}

/// Why flights do not determine a model, or a part of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotIdentified {
    /// The part.
    pub group: Group,
    /// The axis, where one alone is meant; otherwise all of the group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<Axis>,
    /// Why, with its figures.
    pub reason: String,
    /// What to fly, or to log, to determine it.
    pub fly: String,
    /// Whether effects that were found all the same stand: the log is too poor for what is left to mean anything, and not for an
    /// error that falls.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub leaves_findings: bool,
}

impl NotIdentified {
    /// Of one axis.
    pub fn of_axis(axis: Axis, reason: String, fly: impl Into<String>) -> Self {
        Self { group: Group::of(axis), axis: Some(axis), reason, fly: fly.into(), leaves_findings: false }
    }

    /// Of all axes of a group.
    pub fn of_group(group: Group, reason: String, fly: impl Into<String>) -> Self {
        Self { group, axis: None, reason, fly: fly.into(), leaves_findings: false }
    }

    /// Whether an axis is among those that are meant.
    pub fn is_about(&self, axis: Axis) -> bool {
        self.axis.map_or(self.group == Group::of(axis), |own| own == axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_is_in_one_group_and_forces_come_first() {
        assert_eq!(Group::Translation.axes().collect::<Vec<_>>(), [Axis::U, Axis::V, Axis::W]);
        assert_eq!(Group::Rotation.axes().collect::<Vec<_>>(), [Axis::P, Axis::Q, Axis::R]);
        let names = PerGroup::from_fn(Group::name);
        for group in GROUPS {
            assert_eq!(names[group], group.to_string());
        }
    }

    /// Files and JSON hold them; the words are the contract's.
    #[test]
    fn verdicts_are_words_with_hyphens() {
        let written = |a, b| toml::to_string(&PerGroup { translation: a, rotation: b }).unwrap();
        let first = written(Verdict::Adequate, Verdict::NotIdentified);
        assert_eq!(first, "translation = \"adequate\"\nrotation = \"not-identified\"\n");
        let second = written(Verdict::MissingEffect, Verdict::Unexplained);
        assert_eq!(second, "translation = \"missing-effect\"\nrotation = \"unexplained\"\n");
    }

    #[test]
    fn a_reason_without_an_axis_is_about_all_axes_of_its_group() {
        let all = NotIdentified::of_group(Group::Rotation, String::new(), "");
        assert!(all.is_about(Axis::P) && all.is_about(Axis::R) && !all.is_about(Axis::W));
        let one = NotIdentified::of_axis(Axis::W, String::new(), "");
        assert!(one.is_about(Axis::W) && !one.is_about(Axis::U) && one.group == Group::Translation);
    }
}
