//! What comes from others: held to `deny.toml` and to the list of what flies, and written down for each program that does.
//!
//! `cargo deny` checks licences, bans and sources from what is on this machine. Advisories come from a database on the network: where it
//! cannot be had, that part is skipped aloud. `cargo xtask sbom` writes the bill of materials (CycloneDX) of each program that flies: what
//! `cargo cyclonedx` knows of every package, less those that are not linked into it, which is what `cargo tree` says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::base::process::{cargo, output_of, shown, succeeds};
use crate::base::tools::CARGO_CYCLONEDX;
use crate::base::workspace::{self, Workspace};
use crate::checks::flying::{self, PROGRAMS, Program};
use crate::step::{Outcome, command_holds, listed};

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the bills of materials, one for each program that flies
    #[arg(long, value_name = "DIR", default_value = "target/sbom")]
    out: PathBuf,
}

/// Licences, bans and sources: from what is here, without a network. Packages of other targets, which nothing has been built for yet, are
/// fetched where that can be done; what is still missing is told by the check.
pub(crate) fn check_licences(_: &Workspace) -> Result<Outcome> {
    let mut fetch = cargo(["fetch", "--locked", "--quiet"]);
    fetch.output().with_context(|| format!("cannot start `{}`", shown(&fetch)))?;
    let what = ["licenses", "bans", "sources"];
    command_holds(cargo([&["deny", "--offline", "--log-level", "error", "check"], &what[..]].concat()))
}

/// Known faults of dependencies, where their database can be had.
pub(crate) fn advisories(_: &Workspace) -> Result<Outcome> {
    let mut fetch = cargo(["deny", "--log-level", "off", "fetch", "db"]);
    let fetched = fetch.output().with_context(|| format!("cannot start `{}`", shown(&fetch)))?;
    if !fetched.status.success() {
        let why = "the database of advisories cannot be fetched: run it where github.com can be reached";
        return Ok(Outcome::Skipped(why.to_owned()));
    }
    command_holds(cargo(["deny", "--log-level", "error", "check", "--disable-fetch", "advisories"]))
}

/// Packages with their versions, by what is linked into each program that flies.
fn reached(program: &Program) -> Result<BTreeMap<String, BTreeSet<String>>> {
    let Program { package, target, features } = program;
    let mut tree = cargo(["tree", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}"]);
    tree.args(["--package", package, "--target", target, "--features", features]);
    let text = output_of(&mut tree).with_context(|| format!("`{}` fails", shown(&tree)))?;
    let mut packages: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if let (Some(name), Some(version)) = (words.next(), words.next()) {
            packages.entry(name.to_owned()).or_default().insert(version.trim_start_matches('v').to_owned());
        }
    }
    Ok(packages)
}

/// The check of what flies.
pub(crate) fn check_flying(_: &Workspace) -> Result<Outcome> {
    let mut all = BTreeMap::new();
    for program in &PROGRAMS {
        all.insert(program.package, reached(program)?.into_keys().collect::<BTreeSet<_>>());
    }
    let counts: Vec<String> =
        all.iter().map(|(program, packages)| format!("{program}: {} packages", packages.len())).collect();
    Ok(listed(&counts.join(", "), &flying::check(&all)))
}

/// `cargo xtask sbom`.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    ensure!(
        CARGO_CYCLONEDX.found().is_some(),
        "{} is not installed: {}",
        CARGO_CYCLONEDX.name,
        CARGO_CYCLONEDX.install
    );
    for (path, packages) in write(workspace, &options.out)? {
        println!("{}: {packages} packages", path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// The night's part: they can be made.
pub(crate) fn sbom(workspace: &Workspace) -> Result<Outcome> {
    let written = write(workspace, &workspace::root().join("target/sbom"))?;
    Ok(listed(&format!("{} bills of materials in target/sbom", written.len()), &[]))
}

/// Writes the bill of each program that flies; how many packages each names.
fn write(workspace: &Workspace, out: &Path) -> Result<Vec<(PathBuf, usize)>> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let mut written = Vec::new();
    for program in &PROGRAMS {
        let mut bill = bill(workspace, program)?;
        let linked = reached(program)?;
        let packages = cut_down(&mut bill, program.package, &linked)?;
        let path = out.join(format!("{}.cdx.json", program.package));
        let text = format!("{bill:#}\n");
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        written.push((path, packages));
    }
    Ok(written)
}

/// The name under which `cargo cyclonedx` leaves a bill beside every manifest.
const LEFT: &str = "sbom-being-made";

/// What `cargo cyclonedx` says of a program.
fn bill(workspace: &Workspace, program: &Program) -> Result<Value> {
    let Program { package, target, features } = program;
    let member = workspace.members().into_iter().find(|member| member.name.as_str() == *package);
    let manifest = &member.with_context(|| format!("there is no package {package}"))?.manifest_path;
    let mut command =
        cargo(["cyclonedx", "--quiet", "--format", "json", "--spec-version", "1.5", "--no-build-deps"]);
    command.args(["--override-filename", LEFT, "--target", target, "--features", features]);
    command.arg("--manifest-path").arg(manifest);
    let made = succeeds(&mut command)?;
    let text = std::fs::read_to_string(manifest.with_file_name(format!("{LEFT}.json")));
    for member in workspace.members() {
        let left = member.manifest_path.with_file_name(format!("{LEFT}.json"));
        if left.exists() {
            std::fs::remove_file(&left).with_context(|| format!("cannot remove {left}"))?;
        }
    }
    ensure!(made, "`{}` failed", shown(&command));
    let text = text.with_context(|| format!("`{}` left no bill of materials", shown(&command)))?;
    let root = workspace.metadata.workspace_root.as_str();
    let mut bill: Value =
        serde_json::from_str(&text.replace(root, "")).context("cargo cyclonedx wrote no JSON")?;
    // When and by which random number it was made: the same sources give the same bill.
    bill.as_object_mut().and_then(|bill| bill.remove("serialNumber"));
    bill["metadata"].as_object_mut().and_then(|metadata| metadata.remove("timestamp"));
    Ok(bill)
}

/// Leaves in a bill what is linked into the program; fails where something that is linked is not in it. How many packages there are.
fn cut_down(bill: &mut Value, package: &str, linked: &BTreeMap<String, BTreeSet<String>>) -> Result<usize> {
    let is_linked = |component: &Value| {
        let [name, version] = ["name", "version"].map(|key| component[key].as_str().unwrap_or_default());
        linked.get(name).is_some_and(|versions| versions.contains(version))
    };
    let components = bill["components"].as_array_mut().context("the bill of materials has no components")?;
    components.retain(is_linked);
    let components = bill["components"].as_array().map_or(&[][..], Vec::as_slice);
    let named: BTreeSet<&str> =
        components.iter().filter_map(|component| component["name"].as_str()).chain([package]).collect();
    let lacking: Vec<&String> = linked.keys().filter(|name| !named.contains(name.as_str())).collect();
    ensure!(lacking.is_empty(), "the bill of materials of {package} lacks {lacking:?}");
    let count = components.len();
    let kept: BTreeSet<String> = components
        .iter()
        .filter_map(|component| component["bom-ref"].as_str())
        .chain(bill["metadata"]["component"]["bom-ref"].as_str())
        .map(ToOwned::to_owned)
        .collect();
    let is_kept = |name: &Value| name.as_str().is_some_and(|name| kept.contains(name));
    if let Some(dependencies) = bill["dependencies"].as_array_mut() {
        dependencies.retain(|dependency| is_kept(&dependency["ref"]));
        for dependency in dependencies {
            if let Some(on) = dependency["dependsOn"].as_array_mut() {
                on.retain(is_kept);
            }
        }
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn of(names: &[(&str, &str)]) -> BTreeMap<String, BTreeSet<String>> {
        names
            .iter()
            .map(|(name, version)| (name.to_string(), BTreeSet::from([version.to_string()])))
            .collect()
    }

    #[test]
    fn a_bill_names_what_is_linked_and_nothing_else() {
        let component =
            |name: &str, version: &str| json!({ "name": name, "version": version, "bom-ref": name });
        let bill = json!({
            "metadata": { "component": { "bom-ref": "com" } },
            "components": [component("libm", "1.0.0"), component("glam", "2.0.0")],
            "dependencies": [{ "ref": "com", "dependsOn": ["libm", "glam"] }, { "ref": "glam" }],
        });
        let mut cut = bill.clone();
        assert_eq!(cut_down(&mut cut, "com", &of(&[("com", "0.1.0"), ("libm", "1.0.0")])).unwrap(), 1);
        assert_eq!(cut["components"], json!([component("libm", "1.0.0")]));
        assert_eq!(cut["dependencies"], json!([{ "ref": "com", "dependsOn": ["libm"] }]));
        for lacking in [of(&[("libm", "1.0.1")]), of(&[("libm", "1.0.0"), ("serde", "1.0.0")])] {
            assert!(cut_down(&mut bill.clone(), "com", &lacking).is_err(), "{lacking:?}");
        }
    }
}
