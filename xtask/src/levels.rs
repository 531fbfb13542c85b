//! `cargo xtask levels`: which file stands on which, and what goes in circles.

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::base::workspace::Workspace;
use crate::checks::crates::{Crate, crates};
use crate::source::Graph;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only these crates, by the names of their packages; by default all
    #[arg(value_name = "CRATE")]
    crates: Vec<String>,
    /// With each file, print the files that it uses
    #[arg(long)]
    arrows: bool,
}

/// Prints it.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let names: BTreeSet<String> = workspace.members().iter().map(|member| member.name.to_string()).collect();
    if let Some(unknown) = options.crates.iter().find(|name| !names.contains(*name)) {
        let names: Vec<String> = names.into_iter().collect();
        bail!("there is no crate {unknown}; there are {}", names.join(", "));
    }
    let wanted = |one: &Crate| options.crates.is_empty() || options.crates.contains(&one.package);
    for one in crates(workspace)?.iter().filter(|one| wanted(one)) {
        print!("{}", described(one, options.arrows));
    }
    Ok(ExitCode::SUCCESS)
}

/// Folders and what each uses, when there are several.
fn folders(one: &Crate) -> String {
    let files = &one.tree.files;
    let mut used: BTreeMap<&str, BTreeSet<&str>> =
        files.iter().map(|file| (file.folder.as_str(), BTreeSet::new())).collect();
    for (from, to) in one.graph.arrows.keys().map(|(from, to)| (&files[*from], &files[*to])) {
        if from.folder != to.folder {
            used.entry(&from.folder).or_default().insert(&to.folder);
        }
    }
    let mut text = String::new();
    for (folder, others) in used.iter().filter(|_| used.len() > 1) {
        let others: Vec<&str> = others.iter().copied().collect();
        let others = if others.is_empty() { "no other".to_owned() } else { others.join(", ") };
        text += &format!("  folder {folder} uses {others}\n");
    }
    text
}

/// Highest level first, then the folders and the circles.
fn described(one: &Crate, arrows: bool) -> String {
    let Graph { nodes, .. } = &one.graph;
    let levels = one.graph.levels();
    let circles = one.graph.circles();
    let circle_of = |file: usize| circles.iter().position(|circle| circle.members.contains(&file));
    let highest = levels.iter().copied().max().unwrap_or(0);
    let mut text = format!("{}, {}: {} files in {highest} levels\n", one.package, nodes[0], nodes.len());
    for level in (1..=highest).rev() {
        for file in (0..nodes.len()).filter(|file| levels[*file] == level) {
            let mark = circle_of(file).map_or(String::new(), |circle| format!("  (circle {})", circle + 1));
            text += &format!("  {level:3}  {}{mark}\n", nodes[file]);
            if arrows {
                for used in one.graph.used_by(file) {
                    text +=
                        &format!("         -> {} (line {})\n", nodes[used], one.graph.arrows[&(file, used)]);
                }
            }
        }
    }
    text += &folders(one);
    for (number, circle) in circles.iter().enumerate() {
        let shortest = one.graph.shown(&circle.shortest);
        text += &format!("  circle {} of {} files: {shortest}\n", number + 1, circle.members.len());
    }
    text
}
