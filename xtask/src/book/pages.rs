//! The pages of a book: links between them, and whether the table of contents names each.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use pulldown_cmark::{Event, Tag, TagEnd};

use crate::base::markdown::{events, links, path_of, resolved};

/// The table of contents.
pub(crate) const SUMMARY: &str = "SUMMARY.md";

/// All files below the book's sources: text of pages, nothing of pictures.
pub(crate) struct Sources {
    pub(crate) pages: BTreeMap<String, String>,
    files: BTreeSet<String>,
}

impl Sources {
    /// Reads a folder and those inside it.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let mut sources = Self { pages: BTreeMap::new(), files: BTreeSet::new() };
        sources.take(folder, "")?;
        Ok(sources)
    }

    fn take(&mut self, folder: &Path, before: &str) -> Result<()> {
        let unreadable = || format!("cannot read {}", folder.display());
        for entry in std::fs::read_dir(folder).with_context(unreadable)? {
            let path = entry.with_context(unreadable)?.path();
            let name = format!("{before}{}", path.file_name().unwrap_or_default().to_string_lossy());
            if path.is_dir() {
                self.take(&path, &format!("{name}/"))?;
                continue;
            }
            if name.ends_with(".md") {
                let text = std::fs::read_to_string(&path);
                self.pages
                    .insert(name.clone(), text.with_context(|| format!("cannot read {}", path.display()))?);
            }
            self.files.insert(name);
        }
        Ok(())
    }

    /// Links that lead nowhere, and pages that the table of contents leaves out.
    pub(crate) fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        for (page, text) in &self.pages {
            problems.extend(links(text).iter().filter_map(|link| self.broken(page, link)));
        }
        let contents = self.pages.get(SUMMARY).map_or("", String::as_str);
        let named: BTreeSet<String> =
            links(contents).iter().filter_map(|link| resolved(SUMMARY, path_of(link))).collect();
        for page in self.pages.keys().filter(|page| *page != SUMMARY && !named.contains(*page)) {
            problems.push(format!("{page}: {SUMMARY} does not name it, so it is not in the book"));
        }
        problems
    }

    /// What is wrong with a link, if anything.
    fn broken(&self, page: &str, link: &str) -> Option<String> {
        let path = path_of(link);
        let target = if path.is_empty() { Some(page.to_owned()) } else { resolved(page, path) };
        let Some(target) = target.filter(|target| self.files.contains(target)) else {
            return Some(format!("{page}: the link to {link} leads nowhere in the book"));
        };
        let (_, heading) = link.split_once('#')?;
        let there = self.pages.get(&target).is_some_and(|text| headings(text).contains(heading));
        (!there).then(|| format!("{page}: the link to {link} names no heading of {target}"))
    }
}

/// The names by which a page's headings can be linked to, as mdBook makes them.
fn headings(text: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let mut open: Option<(Option<String>, String)> = None;
    for event in events(text) {
        match (event, &mut open) {
            (Event::Start(Tag::Heading { id, .. }), _) => {
                open = Some((id.map(|id| id.into_string()), String::new()));
            }
            (Event::Text(part) | Event::Code(part), Some((_, heading))) => *heading += &part,
            (Event::End(TagEnd::Heading(_)), Some((id, heading))) => {
                let name = id.take().unwrap_or_else(|| name_of(heading));
                let more = (1..).map(|count| format!("{name}-{count}"));
                let free = std::iter::once(name.clone()).chain(more).find(|name| !names.contains(name));
                names.extend(free);
                open = None;
            }
            _ => {}
        }
    }
    names
}

/// `What to fly: two flights` is `what-to-fly-two-flights`.
fn name_of(heading: &str) -> String {
    let kept = heading.trim().chars().filter_map(|c| {
        if c.is_alphanumeric() || c == '_' || c == '-' {
            Some(c.to_lowercase().to_string())
        } else {
            c.is_whitespace().then(|| "-".to_owned())
        }
    });
    kept.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Problems of a book with these files.
    fn problems(files: &[(&str, &str)]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Sources::read(folder.path()).unwrap().problems()
    }

    const CONTENTS: (&str, &str) = ("SUMMARY.md", "# Summary\n\n- [A](a.md)\n  - [B](effects/b.md)\n");

    #[test]
    fn links_lead_to_pages_pictures_and_headings() {
        let a = "# The `a` file: one\n\n[b](effects/b.md#units) ![p](p.svg) [here](#the-a-file-one) [web](https://x.org)";
        let b = "## Units\n\n## Units\n\n## Other {#own}\n\n[a](../a.md) [second](#units-1) [own](#own)";
        assert_eq!(problems(&[CONTENTS, ("a.md", a), ("effects/b.md", b), ("p.svg", "")]), [""; 0]);
    }

    #[test]
    fn a_link_that_leads_nowhere_is_named() {
        for (text, expected) in [
            ("[x](c.md)", "a.md: the link to c.md leads nowhere in the book"),
            ("[x](../a.md)", "a.md: the link to ../a.md leads nowhere in the book"),
            ("![x](effects/p.svg)", "a.md: the link to effects/p.svg leads nowhere in the book"),
            (
                "[x](effects/b.md#gone)",
                "a.md: the link to effects/b.md#gone names no heading of effects/b.md",
            ),
        ] {
            assert_eq!(problems(&[CONTENTS, ("a.md", text), ("effects/b.md", "")]), [expected]);
        }
    }

    #[test]
    fn every_page_is_in_the_table_of_contents() {
        let files = [CONTENTS, ("a.md", ""), ("effects/b.md", ""), ("c.md", "")];
        assert_eq!(problems(&files), ["c.md: SUMMARY.md does not name it, so it is not in the book"]);
        assert_eq!(problems(&files[..2]), ["SUMMARY.md: the link to effects/b.md leads nowhere in the book"]);
    }
}
