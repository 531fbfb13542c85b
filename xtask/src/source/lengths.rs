//! Lengths of files and functions, without what is there for tests alone.

use std::collections::BTreeSet;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{
    Block, ImplItem, ImplItemFn, Item, ItemFn, ItemImpl, ItemTrait, Signature, TraitItem, TraitItemFn,
};

use super::attributes::{for_tests, of_impl_item, of_item, of_trait_item};

/// A function and the lines from its signature to its last bracket.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Function {
    /// With the type in front: `Flash::run`.
    pub(crate) name: String,
    pub(crate) line: usize,
    pub(crate) lines: usize,
}

/// What a file is long of.
pub(crate) struct Lengths {
    /// Lines outside of `#[cfg(test)]`, comments among them.
    pub(crate) lines: usize,
    pub(crate) functions: Vec<Function>,
}

/// Measures a file.
pub(crate) fn lengths(text: &str, syntax: &syn::File) -> Lengths {
    let mut ruler = Ruler::default();
    ruler.visit_file(syntax);
    let lines = text.lines().count() - ruler.for_tests.len();
    Lengths { lines, functions: ruler.functions }
}

#[derive(Default)]
struct Ruler {
    /// Lines that belong to tests.
    for_tests: BTreeSet<usize>,
    functions: Vec<Function>,
    /// The type or trait around.
    owner: Option<String>,
}

impl Ruler {
    fn function(&mut self, signature: &Signature, block: &Block) {
        let line = signature.span().start().line;
        let lines = block.brace_token.span.close().end().line + 1 - line;
        let name = signature.ident.to_string();
        let name = self.owner.as_ref().map_or_else(|| name.clone(), |owner| format!("{owner}::{name}"));
        self.functions.push(Function { name, line, lines });
    }

    /// Notes the lines of something for tests.
    fn leave_out(&mut self, what: &impl Spanned) {
        self.for_tests.extend(what.span().start().line..=what.span().end().line);
    }

    fn inside(&mut self, owner: String, look: impl FnOnce(&mut Self)) {
        let around = self.owner.replace(owner);
        look(self);
        self.owner = around;
    }
}

/// The last name of a type: `Flash` of `crate::flash::Flash<T>`.
fn type_name(ty: &syn::Type) -> String {
    match ty {
        syn::Type::Path(path) => path.path.segments.last().map(|last| last.ident.to_string()),
        syn::Type::Reference(reference) => Some(type_name(&reference.elem)),
        _ => None,
    }
    .unwrap_or_default()
}

impl<'ast> Visit<'ast> for Ruler {
    fn visit_item(&mut self, item: &'ast Item) {
        if for_tests(of_item(item)) {
            self.leave_out(item);
        } else {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        if for_tests(of_impl_item(item)) {
            self.leave_out(item);
        } else {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_trait_item(&mut self, item: &'ast TraitItem) {
        if for_tests(of_trait_item(item)) {
            self.leave_out(item);
        } else {
            visit::visit_trait_item(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast ItemImpl) {
        self.inside(type_name(&item.self_ty), |ruler| visit::visit_item_impl(ruler, item));
    }

    fn visit_item_trait(&mut self, item: &'ast ItemTrait) {
        self.inside(item.ident.to_string(), |ruler| visit::visit_item_trait(ruler, item));
    }

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        self.function(&item.sig, &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        self.function(&item.sig, &item.block);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast TraitItemFn) {
        if let Some(block) = &item.default {
            self.function(&item.sig, block);
        }
        visit::visit_trait_item_fn(self, item);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Lengths {
        lengths(text, &syn::parse_file(text).unwrap())
    }

    #[test]
    fn tests_do_not_count() {
        let code = "//! Docs.\n\nfn f() {\n    let a = 1;\n}\n";
        assert_eq!(of(code).lines, 5);
        let with_tests =
            format!("{code}#[cfg(test)]\nmod tests {{\n    #[test]\n    fn t() {{\n    }}\n}}\n");
        assert_eq!(of(&with_tests).lines, 5);
        assert_eq!(of(&with_tests).functions.len(), 1);
        let method = "struct A;\nimpl A {\n    #[cfg(test)]\n    fn t() {\n    }\n    fn f() {}\n}\n";
        assert_eq!(of(method).lines, 4);
    }

    #[test]
    fn functions_are_measured_from_signature_to_bracket() {
        let text = "/// Docs.\n#[inline]\npub fn f(\n    a: f64,\n) {\n    fn inner() {}\n}\n\
                    impl<T> A<T> {\n    const fn g() {\n    }\n}\ntrait B {\n    fn h() {}\n    fn i();\n}\n";
        let found: Vec<_> = of(text).functions.into_iter().map(|f| (f.name, f.line, f.lines)).collect();
        let expected = [("f", 3, 5), ("inner", 6, 1), ("A::g", 9, 2), ("B::h", 13, 1)];
        assert_eq!(found, expected.map(|(name, line, lines)| (name.to_owned(), line, lines)));
    }
}
