//! Every path that the code of a file names, with the module it stands in.

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{ExprCall, ImplItem, Item, ItemMod, ItemUse, Macro, MetaList, Path, Stmt, TraitItem, Visibility};

use super::attributes::{for_tests, of_impl_item, of_item, of_statement, of_trait_item};
use super::tree::{Name, Tree, imported, is_re_export, plain};

/// How a path is named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// In code.
    Code,
    /// By a `use` that stays inside the module.
    Import,
    /// By a `use` that others can go through.
    ReExport,
    /// By a `use` of everything there.
    Glob,
}

/// A path as it stands in the source.
pub(crate) struct Named {
    pub(crate) module: usize,
    pub(crate) segments: Vec<String>,
    pub(crate) line: usize,
    pub(crate) kind: Kind,
}

/// All paths of a file, apart from those in code for tests.
pub(crate) fn named(tree: &Tree, file: usize) -> Vec<Named> {
    let source = &tree.files[file];
    let mut reader = Reader { tree, module: source.module, found: Vec::new() };
    reader.visit_file(&source.syntax);
    reader.found
}

struct Reader<'a> {
    tree: &'a Tree,
    module: usize,
    found: Vec<Named>,
}

impl Reader<'_> {
    fn take(&mut self, segments: Vec<String>, line: usize, kind: Kind) {
        self.found.push(Named { module: self.module, segments, line, kind });
    }

    fn take_path(&mut self, path: &Path) {
        if path.leading_colon.is_none()
            && let Some(first) = path.segments.first()
        {
            let line = first.ident.span().start().line;
            let segments = path.segments.iter().map(|segment| plain(&segment.ident)).collect();
            self.take(segments, line, Kind::Code);
        }
    }

    /// Paths among tokens: the parser does not look into macros.
    fn scan(&mut self, tokens: TokenStream) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < trees.len() {
            match &trees[at] {
                TokenTree::Group(group) => self.scan(group.stream()),
                TokenTree::Ident(first) if begins_a_path(&trees[..at]) => {
                    let (segments, end) = path_at(&trees, at);
                    let called = matches!(trees.get(end), Some(TokenTree::Group(_)));
                    if segments.len() > 1 || called || is_type_like(&segments[0]) {
                        self.take(segments, first.span().start().line, Kind::Code);
                    }
                    at = end;
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
    }
}

/// A lower-case name alone may be a variable; a type, trait or constant is none.
fn is_type_like(name: &str) -> bool {
    name.starts_with(char::is_uppercase)
}

fn is_colon(tree: Option<&TokenTree>) -> bool {
    matches!(tree, Some(TokenTree::Punct(mark)) if mark.as_char() == ':')
}

/// Is the next identifier neither a field or method (`a.b`) nor the middle of a path (`<T>::b`)?
fn begins_a_path(before: &[TokenTree]) -> bool {
    let last = before.last();
    let after_dot = matches!(last, Some(TokenTree::Punct(mark)) if mark.as_char() == '.');
    // `..b` is the end of a range.
    let after_range = after_dot
        && matches!(before.iter().nth_back(1), Some(TokenTree::Punct(mark)) if mark.as_char() == '.');
    let inside = is_colon(last) && is_colon(before.iter().nth_back(1));
    (!after_dot || after_range) && !inside
}

/// The segments of the path that begins at `start`, and where it ends.
fn path_at(trees: &[TokenTree], start: usize) -> (Vec<String>, usize) {
    let mut segments = Vec::new();
    let mut at = start;
    while let Some(TokenTree::Ident(ident)) = trees.get(at) {
        segments.push(plain(ident));
        at += 1;
        let goes_on = is_colon(trees.get(at))
            && is_colon(trees.get(at + 1))
            && matches!(trees.get(at + 2), Some(TokenTree::Ident(_)));
        if !goes_on {
            break;
        }
        at += 2;
    }
    (segments, at)
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !for_tests(of_item(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        if !for_tests(of_impl_item(item)) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_trait_item(&mut self, item: &'ast TraitItem) {
        if !for_tests(of_trait_item(item)) {
            visit::visit_trait_item(self, item);
        }
    }

    fn visit_stmt(&mut self, statement: &'ast Stmt) {
        if !for_tests(of_statement(statement)) {
            visit::visit_stmt(self, statement);
        }
    }

    fn visit_item_mod(&mut self, child: &'ast ItemMod) {
        let name = plain(&child.ident);
        let below = self.tree.modules[self.module]
            .names
            .get(&name)
            .into_iter()
            .flatten()
            .find_map(|name| if let Name::Module(below) = name { Some(*below) } else { None });
        let above = self.module;
        self.module = below.unwrap_or(above);
        visit::visit_item_mod(self, child);
        self.module = above;
    }

    fn visit_item_use(&mut self, import: &'ast ItemUse) {
        let kind = if is_re_export(import) { Kind::ReExport } else { Kind::Import };
        for one in imported(import) {
            let kind = if one.name.is_some() || kind == Kind::ReExport { kind } else { Kind::Glob };
            self.take(one.path, one.line, kind);
        }
    }

    fn visit_path(&mut self, path: &'ast Path) {
        if path.segments.len() > 1 || path.get_ident().is_some_and(|name| is_type_like(&name.to_string())) {
            self.take_path(path);
        }
        visit::visit_path(self, path);
    }

    fn visit_expr_call(&mut self, call: &'ast ExprCall) {
        if let syn::Expr::Path(function) = &*call.func
            && function.qself.is_none()
        {
            self.take_path(&function.path);
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_macro(&mut self, called: &'ast Macro) {
        self.take_path(&called.path);
        self.scan(called.tokens.clone());
    }

    fn visit_meta_list(&mut self, list: &'ast MetaList) {
        self.scan(list.tokens.clone());
    }

    /// `pub(in a::b)` uses nothing.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}
}
