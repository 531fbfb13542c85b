//! The page's files, in the program itself: no request leaves the machine.

use std::borrow::Cow;
use std::sync::LazyLock;

#[derive(rust_embed::Embed)]
#[folder = "src/lab/page"]
struct Page;

/// Plotly's script, as the crate `plotly` has it.
static PLOTLY: LazyLock<String> = LazyLock::new(|| {
    let tags = plotly::Plot::offline_js_sources();
    let script = tags.split_once('>').map_or("", |(_, rest)| rest);
    script.split_once("</script>").map_or("", |(script, _)| script).to_owned()
});

/// The bytes of a file of the page, and their kind.
pub(super) fn file(name: &str) -> Option<(Cow<'static, [u8]>, &'static str)> {
    if name == "plotly.min.js" {
        return Some((Cow::Borrowed(PLOTLY.as_bytes()), "text/javascript; charset=utf-8"));
    }
    let kind = match name.rsplit_once('.')?.1 {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        _ => return None,
    };
    Some((Page::get(name)?.data, kind))
}

#[cfg(test)]
mod tests {
    use super::file;

    #[test]
    fn the_page_and_its_library_are_in_the_program() {
        let (page, kind) = file("index.html").unwrap();
        assert!(kind.starts_with("text/html") && page.starts_with(b"<!doctype html>"));
        let (plotly, _) = file("plotly.min.js").unwrap();
        let plotly = std::str::from_utf8(&plotly).unwrap();
        assert!(plotly.contains("plotly.js v") && !plotly.contains("</script"), "{}", &plotly[..80]);
        assert!(file("../mod.rs").is_none() && file("").is_none() && file("no.js").is_none());
    }
}
