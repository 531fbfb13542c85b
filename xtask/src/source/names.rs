//! What a path means: the file that declares the thing at its end, through imports and re-exports.

use std::collections::{BTreeMap, BTreeSet};

use super::graph::Graph;
use super::paths::{Kind, Named, named};
use super::tree::{Name, Tree};

/// What a path leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Found {
    Module(usize),
    /// Something that this file declares.
    Item(usize),
}

impl Found {
    /// What a name declares here, without following an import.
    fn at_once(name: &Name) -> Option<Self> {
        match name {
            Name::Item(file) => Some(Self::Item(*file)),
            Name::Module(module) => Some(Self::Module(*module)),
            Name::Import(_) => None,
        }
    }
}

/// Names that are being looked up, so that two modules which take in all of each other end.
type Seen = BTreeSet<(usize, String)>;

/// Which file of a crate uses which: an arrow from a file to the one that declares what it names.
///
/// A re-export of what lies below is no arrow: the parent only says what can be seen of its children. A module by itself
/// is none either; what is used through it is.
pub(crate) fn arrows(tree: &Tree) -> Graph {
    let mut arrows: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for file in 0..tree.files.len() {
        for path in named(tree, file) {
            for target in targets(tree, &path).into_iter().filter(|target| *target != file) {
                let line = arrows.entry((file, target)).or_insert(path.line);
                *line = path.line.min(*line);
            }
        }
    }
    Graph::new(tree.files.iter().map(|file| file.path.clone()).collect(), arrows)
}

/// Files that a path is an arrow to.
fn targets(tree: &Tree, path: &Named) -> BTreeSet<usize> {
    let found = walk(tree, path.module, &path.segments, &mut Seen::new());
    let files = found.into_iter().filter_map(|found| match found {
        Found::Item(file) => Some(file),
        Found::Module(module) => {
            let module = &tree.modules[module];
            (path.kind == Kind::Glob && module.has_items()).then_some(module.file)
        }
    });
    let shows_a_child =
        |file: &usize| path.kind == Kind::ReExport && tree.is_below(tree.files[*file].module, path.module);
    files.filter(|file| !shows_a_child(file)).collect()
}

/// Follows a path from a module.
fn walk(tree: &Tree, module: usize, segments: &[String], seen: &mut Seen) -> BTreeSet<Found> {
    let mut at = module;
    let mut rest = segments;
    while let Some((first, after)) = rest.split_first() {
        match (first.as_str(), tree.modules[at].parent) {
            ("crate", _) => at = 0,
            ("self", _) => {}
            ("super", Some(parent)) => at = parent,
            ("super" | "Self", _) => return BTreeSet::new(),
            _ => return follow(tree, at, first, after, seen),
        }
        rest = after;
    }
    BTreeSet::from([Found::Module(at)])
}

/// Looks up a name in a module and follows the rest of the path from there.
fn follow(tree: &Tree, module: usize, name: &str, rest: &[String], seen: &mut Seen) -> BTreeSet<Found> {
    let mut ends = BTreeSet::new();
    let all = look_up(tree, module, name, seen);
    let has_module = all.iter().any(|found| matches!(found, Found::Module(_)));
    for found in all {
        match (found, rest.split_first()) {
            // A path that goes on leads through the module, not through a function of that name.
            (Found::Item(_), Some(_)) if has_module => {}
            (Found::Module(inside), Some((next, after))) => {
                ends.extend(follow(tree, inside, next, after, seen));
            }
            // What follows an item is one of its variants or functions.
            _ => drop(ends.insert(found)),
        }
    }
    ends
}

fn look_up(tree: &Tree, module: usize, name: &str, seen: &mut Seen) -> BTreeSet<Found> {
    let here = &tree.modules[module];
    let meanings = here.names.get(name).map_or(&[][..], Vec::as_slice);
    let mut found: BTreeSet<Found> = meanings.iter().filter_map(Found::at_once).collect();
    if !seen.insert((module, name.to_owned())) {
        return found;
    }
    for meaning in meanings {
        if let Name::Import(path) = meaning {
            found.extend(walk(tree, module, path, seen));
        }
    }
    if meanings.is_empty() {
        for place in here.globs.iter().flat_map(|path| walk(tree, module, path, seen)).collect::<Vec<_>>() {
            if let Found::Module(inside) = place {
                found.extend(look_up(tree, inside, name, seen));
            }
        }
    }
    seen.remove(&(module, name.to_owned()));
    found
}
