//! House rules of dependencies: chosen once in the root manifest, one version of each, and lock files that are up to date.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use cargo_metadata::{DependencyKind, Package};
use toml::{Table, Value};

use crate::base::workspace::{Workspace, root};
use crate::checks::tidy::listed_files;

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
    problems.extend(stale_locks(workspace)?);
    Ok(problems)
}

/// Lock files of the folders with fuzz targets, which are workspaces of their own: cargo only looks at them when these are built.
fn stale_locks(workspace: &Workspace) -> Result<Vec<String>> {
    let used: BTreeMap<String, Used> =
        workspace.members().iter().map(|member| (member.name.to_string(), Used::of(member))).collect();
    let mut problems = Vec::new();
    for file in listed_files(&["--cached"])?.iter().filter(|file| file.ends_with("/Cargo.lock")) {
        let text =
            std::fs::read_to_string(root().join(file)).with_context(|| format!("cannot read {file}"))?;
        let lock = text.parse().with_context(|| format!("{file} is not TOML"))?;
        problems.extend(stale_lock(file, &lock, &used));
    }
    Ok(problems)
}

/// Packages that a member uses when somebody else builds it.
struct Used {
    always: BTreeSet<String>,
    with_features: BTreeSet<String>,
}

impl Used {
    fn of(member: &Package) -> Self {
        let used = member.dependencies.iter().filter(|used| used.kind != DependencyKind::Development);
        let names = |optional: bool| {
            used.clone().filter(|used| used.optional == optional).map(|used| used.name.clone()).collect()
        };
        Self { always: names(false), with_features: names(true) }
    }
}

/// Members whose dependencies in a lock file are not those of their manifests.
fn stale_lock(file: &str, lock: &Table, used: &BTreeMap<String, Used>) -> Option<String> {
    let packages = lock.get("package").and_then(Value::as_array)?;
    let is_stale = |package: &&Table| {
        let Some(used) = package.get("name").and_then(Value::as_str).and_then(|name| used.get(name)) else {
            return false;
        };
        let listed = package.get("dependencies").and_then(Value::as_array).into_iter().flatten();
        // A version stands behind the name where there are several.
        let listed: BTreeSet<String> =
            listed.filter_map(|entry| Some(entry.as_str()?.split(' ').next()?.to_owned())).collect();
        let unknown = |name: &&String| !used.always.contains(*name) && !used.with_features.contains(*name);
        !used.always.is_subset(&listed) || listed.iter().any(|name| unknown(&name))
    };
    // What comes from elsewhere has a source.
    let own = packages.iter().filter_map(Value::as_table).filter(|package| !package.contains_key("source"));
    let stale: Vec<&str> = own.filter(is_stale).filter_map(|package| package.get("name")?.as_str()).collect();
    let folder = file.trim_end_matches("/Cargo.lock");
    (!stale.is_empty()).then(|| {
        format!(
            "{file}: not up to date for {}; renew it with `cargo metadata --manifest-path {folder}/Cargo.toml`",
            stale.join(", ")
        )
    })
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
    fn a_lock_file_that_lacks_a_dependency_or_has_one_too_many_is_found() {
        let names = |list: &[&str]| list.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
        let own = Used { always: names(&["needed", "several"]), with_features: names(&["perhaps"]) };
        let used = BTreeMap::from([("own".to_owned(), own)]);
        let found = |dependencies: &str, source: &str| {
            let lock = format!("[[package]]\nname = \"own\"\n{source}dependencies = {dependencies}\n");
            stale_lock("a/fuzz/Cargo.lock", &lock.parse().expect("a lock file"), &used)
        };
        assert_eq!(found(r#"["needed", "several 1.0.0"]"#, ""), None);
        assert_eq!(found(r#"["needed", "perhaps", "several"]"#, ""), None);
        for stale in [r#"["needed"]"#, r#"["gone", "needed", "several"]"#, "[]"] {
            let line = found(stale, "").expect("a problem");
            assert!(line.starts_with("a/fuzz/Cargo.lock: not up to date for own; "), "{line}");
            assert!(line.ends_with("--manifest-path a/fuzz/Cargo.toml`"), "{line}");
            // Another package of that name is none of ours.
            assert_eq!(found(stale, "source = \"registry\"\n"), None);
        }
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
