//! Pages in Markdown: their links, read with a parser, so that a link in a code block is none.

use pulldown_cmark::{Event, Options, Parser, Tag};

/// What a page consists of.
pub(crate) fn events(text: &str) -> Parser<'_> {
    Parser::new_ext(text, Options::ENABLE_TABLES | Options::ENABLE_HEADING_ATTRIBUTES)
}

/// Targets of links and images, apart from addresses on the web.
pub(crate) fn links(text: &str) -> Vec<String> {
    let targets = events(text).filter_map(|event| match event {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
            Some(dest_url.into_string())
        }
        _ => None,
    });
    targets
        .filter(|target| !path_of(target).split('/').next().is_some_and(|first| first.contains(':')))
        .collect()
}

/// A link without what follows `#` or `?`.
pub(crate) fn path_of(link: &str) -> &str {
    link.split(['#', '?']).next().unwrap_or_default()
}

/// A link's path from the top; nothing when it leads out.
pub(crate) fn resolved(page: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = match path.strip_prefix('/') {
        Some(_) => Vec::new(),
        None => page.split('/').rev().skip(1).collect::<Vec<_>>().into_iter().rev().collect(),
    };
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()?),
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}
