//! Rules about files: none in a circle, folders use each other one way, none too long.

use std::collections::BTreeSet;

use anyhow::Result;

use super::crates::{Crate, crates};
use super::folders;
use super::known::{self, Entry, Kind, Violation};
use crate::base::workspace::Workspace;
use crate::source::lengths;

/// Lines of a file outside of `#[cfg(test)]`.
const LONGEST_FILE: usize = 500;
/// Lines of a function, from its signature to its last bracket.
const LONGEST_FUNCTION: usize = 60;

/// Everything that is not as it should be, known or not.
pub(crate) fn violations(workspace: &Workspace) -> Result<Vec<Violation>> {
    Ok(violations_of(&crates(workspace)?))
}

fn violations_of(crates: &[Crate]) -> Vec<Violation> {
    let mut found: BTreeSet<Violation> = BTreeSet::new();
    for one in crates {
        found.extend(circles(one));
        found.extend(too_long(one));
    }
    found.extend(folders::violations(crates));
    found.into_iter().collect()
}

/// The problems of some kinds that the list does not know, and what is in the list without need.
pub(crate) fn check(workspace: &Workspace, kinds: &[Kind]) -> Result<Vec<String>> {
    let found: Vec<Violation> = violations(workspace)?
        .into_iter()
        .filter(|violation| kinds.contains(&violation.entry.kind))
        .collect();
    Ok(known::compare(kinds, &found, &known::read()?))
}

fn circles(one: &Crate) -> Vec<Violation> {
    let graph = &one.graph;
    let circles = graph.circles().into_iter().map(|circle| {
        let mut subject: Vec<String> = circle.members.iter().map(|file| graph.nodes[*file].clone()).collect();
        subject.sort();
        let message = format!(
            "{}: files in a circle ({} in all: `cargo xtask levels {}`); move what both need into a file below them, or \
             hand it over as an argument",
            graph.shown(&circle.shortest),
            subject.len(),
            one.package,
        );
        Violation { entry: Entry { kind: Kind::Circle, subject, lines: 0 }, message }
    });
    circles.collect()
}

fn too_long(one: &Crate) -> Vec<Violation> {
    let mut found = Vec::new();
    for file in &one.tree.files {
        let path = &file.path;
        let lengths = lengths(&file.text, &file.syntax);
        if lengths.lines > LONGEST_FILE {
            let lines = lengths.lines;
            let message = format!(
                "{path}:1: {lines} lines outside of tests, {LONGEST_FILE} at most; divide the file by what its parts are about"
            );
            found.push(Violation {
                entry: Entry { kind: Kind::LongFile, subject: vec![path.clone()], lines },
                message,
            });
        }
        for function in lengths.functions.into_iter().filter(|function| function.lines > LONGEST_FUNCTION) {
            let message = format!(
                "{path}:{}: `{}` has {} lines, {LONGEST_FUNCTION} at most; take a part of it out into a function with a name",
                function.line, function.name, function.lines
            );
            let subject = vec![path.clone(), function.name];
            found.push(Violation {
                entry: Entry { kind: Kind::LongFunction, subject, lines: function.lines },
                message,
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crate with these files, its root `src/lib.rs`.
    fn read(files: &[(&str, &str)]) -> Crate {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join("src").join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Crate::read("small", folder.path(), &folder.path().join("src/lib.rs")).unwrap()
    }

    /// Its circles, as lists of files.
    fn loops(files: &[(&str, &str)]) -> Vec<String> {
        circles(&read(files)).into_iter().map(|violation| violation.entry.subject.join(" ")).collect()
    }

    const ROOT: (&str, &str) = ("lib.rs", "mod a;\nmod b;\npub use a::A;\n");

    #[test]
    fn two_files_that_use_each_other_are_named_with_their_loop() {
        let files = [
            ROOT,
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "\n\npub struct B;\nimpl B { fn f() -> Option<crate::a::A> { None } }"),
        ];
        let found = circles(&read(&files));
        assert_eq!(found.len(), 1);
        assert!(found[0].message.starts_with("src/a.rs:1 -> src/b.rs:4 -> src/a.rs: "), "{found:?}");
        assert_eq!(found[0].entry.to_string(), "circle src/a.rs src/b.rs");
    }

    #[test]
    fn an_arrow_goes_through_a_re_export_to_the_file_that_declares() {
        let b = "use crate::A;\npub struct B(Option<A>);";
        assert_eq!(
            loops(&[ROOT, ("a.rs", "use crate::b::B;\npub struct A(B);"), ("b.rs", b)]),
            ["src/a.rs src/b.rs"]
        );
        // The root re-exports, and b uses it: nothing leads back to b.
        assert_eq!(loops(&[ROOT, ("a.rs", "pub struct A;"), ("b.rs", b)]), [""; 0]);
        let renamed = ("lib.rs", "mod a;\nmod b;\nmod names { pub use crate::a::A as Better; }");
        let b = "use crate::names::Better;\npub struct B(Option<Better>);";
        assert_eq!(loops(&[renamed, ("a.rs", "use crate::b::*;\npub struct A(B);"), ("b.rs", b)]).len(), 1);
    }

    #[test]
    fn a_path_that_goes_on_leads_through_the_module_not_the_function_of_that_name() {
        let files = [
            ("lib.rs", "pub mod fit;\npub use fit::fit;"),
            ("fit/mod.rs", "mod high;\nmod low;\npub use high::fit;"),
            ("fit/high.rs", "use crate::fit::low::low;\npub fn fit() { low() }"),
            ("fit/low.rs", "use crate::fit::low::low as same;\npub fn low() { same() }"),
        ];
        assert_eq!(loops(&files), [""; 0]);
    }

    #[test]
    fn paths_in_macros_attributes_and_bodies_count() {
        for back in [
            "pub fn b() { println!(\"{}\", crate::a::a()); }",
            "pub fn b() -> Vec<f64> { vec![0.0, super::a::a()] }",
            "pub fn b() { let _ = (1..super::a::a(), 2); }",
            "macro_rules! m { () => { $crate::a::a() } }\npub fn b() {}",
            "#[derive(Parser)]\npub struct C { #[arg(value_parser = crate::a::a)] d: u8 }\npub fn b() {}",
            "pub fn b() { use crate::a; a::a(); }",
            "pub fn b() { <crate::a::A as Default>::default(); }",
        ] {
            let files = [ROOT, ("a.rs", "pub struct A;\npub fn a() { crate::b::b() }"), ("b.rs", back)];
            assert_eq!(loops(&files), ["src/a.rs src/b.rs"], "{back}");
        }
    }

    #[test]
    fn words_tests_and_other_crates_are_no_arrows() {
        for back in [
            "// crate::a::a()\n/// [`crate::a::a`]\npub fn b() -> &'static str { \"crate::a::a()\" }",
            "pub fn b() {}\n#[cfg(test)]\nmod tests {\n    use crate::a::a;\n}",
            "pub fn b() {}\n#[cfg(test)]\nuse crate::a::a;",
            "pub struct B;\nimpl B {\n    #[cfg(test)]\n    fn t() { crate::a::a() }\n}\npub fn b() {}",
            "pub fn b() { other::a::a(); ::a::a(); }",
            "pub(in crate::a) fn b() {}",
            "pub fn b(a: f64) -> f64 { a + a.a() }",
        ] {
            let files = [ROOT, ("a.rs", "pub struct A;\npub fn a() { crate::b::b() }"), ("b.rs", back)];
            assert_eq!(loops(&files), [""; 0], "{back}");
        }
    }

    #[test]
    fn a_parent_that_shows_its_children_is_no_arrow_but_one_that_calls_them_is() {
        let child = ("a.rs", "pub struct A;\npub fn a() { super::help() }");
        let b = ("b.rs", "");
        let shows = ("lib.rs", "mod a;\nmod b;\npub use a::A;\npub use a::*;\nfn help() {}");
        assert_eq!(loops(&[shows, child, b]), [""; 0]);
        for calls in [
            "pub fn go() { a::a() }",
            "use a::a;\npub fn go() { a() }",
            "pub use a::a;\npub fn go() { a() }",
            "pub use a::A;\nconst N: Option<A> = None;",
        ] {
            let root = format!("mod a;\nmod b;\nfn help() {{}}\n{calls}");
            assert_eq!(loops(&[("lib.rs", &root), child, b]), ["src/a.rs src/lib.rs"], "{calls}");
        }
    }

    #[test]
    fn folders_and_paths_of_modules_are_found() {
        let files = [
            ("lib.rs", "mod fit;\n#[path = \"odd/name.rs\"]\nmod other;"),
            ("fit/mod.rs", "mod rows;\npub mod deep { pub mod inner; }\npub use rows::Row;"),
            ("fit/rows.rs", "use super::deep::inner::Inner;\npub struct Row(Inner);"),
            ("fit/deep/inner.rs", "use crate::fit::Row;\npub struct Inner(Option<Row>);"),
            ("odd/name.rs", ""),
        ];
        assert_eq!(loops(&files), ["src/fit/deep/inner.rs src/fit/rows.rs"]);
        let folders: Vec<String> = read(&files).tree.files.into_iter().map(|file| file.folder).collect();
        assert_eq!(folders, [".", "fit", "fit", "fit/deep", "odd"]);
    }

    #[test]
    fn a_module_without_a_file_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("lib.rs");
        std::fs::write(&root, "mod gone;").unwrap();
        let error = Crate::read("small", folder.path(), &root).err().expect("there is no such file");
        assert!(error.to_string().contains("lib.rs: `mod gone;` has no file gone.rs"), "{error}");
        std::fs::write(&root, "\nfn 1() {}").unwrap();
        let error = Crate::read("small", folder.path(), &root).err().expect("this is no Rust");
        assert!(error.to_string().starts_with("lib.rs:2: not readable as Rust"), "{error}");
    }

    #[test]
    fn long_files_and_functions_are_named_with_their_lines() {
        let lines = |count: usize| "    f();\n".repeat(count);
        let exactly = format!("fn f() {{\n{}}}\n", lines(LONGEST_FUNCTION - 2));
        assert!(too_long(&read(&[("lib.rs", &exactly)])).is_empty());
        let longer = format!("\n\nfn f() {{\n{}}}\n", lines(LONGEST_FUNCTION - 1));
        let found = too_long(&read(&[("lib.rs", &longer)]));
        assert_eq!(found.len(), 1);
        assert!(found[0].message.starts_with("src/lib.rs:3: `f` has 61 lines, 60 at most"), "{found:?}");
        let file = "const A: u8 = 0;\n".repeat(LONGEST_FILE);
        assert!(too_long(&read(&[("lib.rs", &file)])).is_empty());
        let found = too_long(&read(&[("lib.rs", &format!("//! Docs.\n{file}"))]));
        assert_eq!(found[0].entry.to_string(), "long-file src/lib.rs 501");
    }
}
