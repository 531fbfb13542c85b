//! Licences of everything that is linked in: the project is MIT or Apache-2.0, and may be built into
//! closed firmware, so whatever asks for more than notices (or, MPL-2.0, for the changed files) stays out.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use anyhow::{Context, Result};
use cargo_metadata::PackageId;
use spdx::{Expression, Licensee, ParseMode};

use crate::base::workspace::Workspace;

/// What a dependency may be licensed under.
const ALLOWED: &[&str] = &[
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "MPL-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Checks the licence of every package in the lock file, of our own crates too.
pub(crate) fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let allowed = allowed_licences()?;
    let users = users_of_packages(workspace);
    let mut problems = Vec::new();
    for package in &workspace.metadata.packages {
        if let Some(objection) = objection(&allowed, package.license.as_deref()) {
            let path = path_to(&package.id, &users, &workspace.metadata.workspace_members);
            let names: Vec<&str> = path.iter().map(|id| workspace.metadata[*id].name.as_str()).collect();
            problems.push(format!(
                "{} {}: {objection}; pulled in by {}",
                package.name,
                package.version,
                names.join(" -> ")
            ));
        }
    }
    Ok(problems)
}

fn allowed_licences() -> Result<Vec<Licensee>> {
    ALLOWED
        .iter()
        .map(|text| Licensee::parse(text).with_context(|| format!("{text} is not an SPDX licence")))
        .collect()
}

/// What is wrong with a manifest's `license` field, if anything. `A/B`, the way before SPDX, means `A OR B`.
fn objection(allowed: &[Licensee], field: Option<&str>) -> Option<String> {
    let Some(text) = field else {
        return Some("names no licence in its manifest".to_owned());
    };
    let Ok(expression) = Expression::parse_mode(text, ParseMode::LAX) else {
        return Some(format!("licence {text:?} is not an SPDX expression"));
    };
    let accepted = expression.evaluate(|asked| allowed.iter().any(|licence| licence.satisfies(asked)));
    (!accepted).then(|| format!("licence {text} is not among those allowed in xtask/src/checks/licences.rs"))
}

/// Who uses a package, for every package.
type Users<'a> = BTreeMap<&'a PackageId, BTreeSet<&'a PackageId>>;

fn users_of_packages(workspace: &Workspace) -> Users<'_> {
    let mut users = Users::new();
    for node in workspace.metadata.resolve.iter().flat_map(|resolve| &resolve.nodes) {
        for used in &node.deps {
            users.entry(&used.pkg).or_default().insert(&node.id);
        }
    }
    users
}

/// The shortest way from one of our crates to a package.
fn path_to<'a>(package: &'a PackageId, users: &Users<'a>, members: &[PackageId]) -> Vec<&'a PackageId> {
    let mut waiting = VecDeque::from([vec![package]]);
    let mut seen = BTreeSet::from([package]);
    while let Some(path) = waiting.pop_front() {
        let Some(&first) = path.first() else { continue };
        if members.contains(first) {
            return path;
        }
        for &user in users.get(first).into_iter().flatten() {
            if seen.insert(user) {
                waiting.push_back([&[user], path.as_slice()].concat());
            }
        }
    }
    vec![package]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objection_to(field: &str) -> Option<String> {
        objection(&allowed_licences().expect("the list is SPDX"), Some(field))
    }

    #[test]
    fn permissive_licences_pass_in_every_spelling() {
        for field in [
            "MIT",
            "MIT OR Apache-2.0",
            "MIT/Apache-2.0",
            "Apache-2.0/MIT",
            "Unlicense/MIT",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR Apache-2.0 OR MIT",
            "Apache-2.0 WITH LLVM-exception",
            "MIT OR GPL-3.0-only",
            "0BSD OR MIT OR Apache-2.0",
        ] {
            assert_eq!(objection_to(field), None, "{field}");
        }
    }

    #[test]
    fn what_asks_for_more_is_refused() {
        for field in [
            "AGPL-3.0-or-later",
            "AGPL-3.0",
            "GPL-2.0",
            "LGPL-3.0-only",
            "MIT AND AGPL-3.0-only",
            "MIT AND GPL-2.0/ISC AND GPL-2.0",
            "SSPL-1.0",
            "MIT WITH Classpath-exception-2.0",
            "GPL-3.0/AGPL-3.0",
            "nonsense",
            "",
        ] {
            assert!(objection_to(field).is_some(), "{field}");
        }
    }

    #[test]
    fn no_licence_at_all_is_refused() {
        assert!(objection(&allowed_licences().expect("the list is SPDX"), None).is_some());
    }

    #[test]
    fn the_path_starts_at_our_crate_and_is_the_shortest() {
        let id = |name: &str| PackageId { repr: name.to_owned() };
        let (ours, near, far, bad) = (id("ours"), id("near"), id("far"), id("bad"));
        // ours -> near -> bad, and ours -> near -> far -> bad
        let users = Users::from([
            (&bad, BTreeSet::from([&far, &near])),
            (&far, BTreeSet::from([&near])),
            (&near, BTreeSet::from([&ours])),
        ]);
        assert_eq!(path_to(&bad, &users, std::slice::from_ref(&ours)), [&ours, &near, &bad]);
    }
}
