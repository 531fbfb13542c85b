//! House rules of dependencies: chosen once in the root manifest, and one version of each.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use toml::{Table, Value};

use crate::base::workspace::Workspace;

/// Manifest tables that hold dependencies.
const TABLES: [&str; 3] = ["dependencies", "dev-dependencies", "build-dependencies"];

/// Checks every member's manifest, and the versions that cargo chose.
pub(crate) fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let mut problems = Vec::new();
    for member in workspace.members() {
        let path = member.manifest_path.as_std_path();
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let manifest = text.parse().with_context(|| format!("{} is not TOML", path.display()))?;
        let place = format!("{}/Cargo.toml", workspace.folder_of(member));
        problems.extend(own_versions(&place, &manifest));
    }
    problems.extend(several_versions(&direct_versions(workspace)));
    Ok(problems)
}

/// Dependencies that a member declares by itself instead of through the workspace.
fn own_versions(place: &str, manifest: &Table) -> Vec<String> {
    let mut holders = vec![manifest];
    if let Some(Value::Table(targets)) = manifest.get("target") {
        holders.extend(targets.values().filter_map(Value::as_table));
    }
    let mut problems = Vec::new();
    for holder in holders {
        for table in TABLES.iter().filter_map(|name| holder.get(*name)?.as_table()) {
            for name in table.iter().filter(|(_, value)| !is_inherited(value)).map(|(name, _)| name) {
                problems.push(format!(
                    "{place}: {name} is declared here; put it into [workspace.dependencies] of the root \
                     manifest and write `{name}.workspace = true`"
                ));
            }
        }
    }
    problems
}

fn is_inherited(dependency: &Value) -> bool {
    dependency.get("workspace").and_then(Value::as_bool) == Some(true)
}

/// Versions of each package that a member uses directly, by package name.
fn direct_versions(workspace: &Workspace) -> BTreeMap<String, BTreeSet<String>> {
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let metadata = &workspace.metadata;
    let nodes = metadata.resolve.iter().flat_map(|resolve| &resolve.nodes);
    for node in nodes.filter(|node| metadata.workspace_members.contains(&node.id)) {
        for used in node.deps.iter().map(|used| &metadata[&used.pkg]) {
            versions.entry(used.name.to_string()).or_default().insert(used.version.to_string());
        }
    }
    versions
}

fn several_versions(versions: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let several = versions.iter().filter(|(_, versions)| versions.len() > 1);
    several
        .map(|(name, versions)| {
            let versions = versions.iter().cloned().collect::<Vec<_>>().join(" and ");
            format!("{name} is used in versions {versions}: choose one in [workspace.dependencies]")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(manifest: &str) -> Vec<String> {
        own_versions("a/Cargo.toml", &manifest.parse().expect("a manifest"))
    }

    #[test]
    fn a_version_number_in_a_member_is_found_in_every_table() {
        let manifest = r#"
            [dependencies]
            good.workspace = true
            fine = { workspace = true, features = ["std"] }
            plain = "1.0"
            [dev-dependencies]
            tabled = { version = "2", features = ["x"] }
            [build-dependencies]
            elsewhere = { path = "../elsewhere" }
            [target.'cfg(unix)'.dependencies]
            platform = "3"
        "#;
        let found = problems(manifest);
        for name in ["plain", "tabled", "elsewhere", "platform"] {
            assert!(
                found.iter().any(|line| line.contains(&format!(": {name} is declared"))),
                "{name}: {found:?}"
            );
        }
        assert_eq!(found.len(), 4, "{found:?}");
    }

    #[test]
    fn a_manifest_without_dependencies_is_fine() {
        assert_eq!(problems("[package]\nname = \"a\""), [""; 0]);
    }

    #[test]
    fn two_versions_of_one_package_are_a_problem() {
        let versions = |list: &[&str]| list.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
        let table = BTreeMap::from([
            ("one".to_owned(), versions(&["1.0.0"])),
            ("two".to_owned(), versions(&["1.0.0", "2.0.0"])),
        ]);
        let found = several_versions(&table);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("two is used in versions 1.0.0 and 2.0.0"), "{found:?}");
    }
}
