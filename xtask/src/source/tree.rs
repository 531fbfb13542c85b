//! The modules of a crate: the file each lies in, and the names that each declares.
//!
//! A crate is read from its root file as the compiler does: `mod a;` leads to `a.rs` or `a/mod.rs`, or to where
//! `#[path]` says. What is there for tests alone is left out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use anyhow::{Context, Result, bail};
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, ItemMod, ItemUse, Lit, Meta, UseTree, Visibility};

use super::attributes::{for_tests, of_item};

/// One file of a crate.
pub(crate) struct SourceFile {
    /// From the workspace's top folder, with `/` between its parts.
    pub(crate) path: String,
    /// Folder as seen from the crate's root file: `.` beside it.
    pub(crate) folder: String,
    pub(crate) text: String,
    pub(crate) syntax: Rc<syn::File>,
    /// The module that is this file.
    pub(crate) module: usize,
}

/// What a name stands for in a module.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Name {
    /// A type, function, constant or macro of this file.
    Item(usize),
    /// A child module.
    Module(usize),
    /// Whatever this path leads to.
    Import(Vec<String>),
}

/// A module: a file, or a block inside one.
pub(crate) struct Module {
    pub(crate) file: usize,
    pub(crate) parent: Option<usize>,
    pub(crate) names: BTreeMap<String, Vec<Name>>,
    /// Paths whose names are all taken in: `use a::*`.
    pub(crate) globs: Vec<Vec<String>>,
}

impl Module {
    /// Does it declare something itself, apart from modules and imports?
    pub(crate) fn has_items(&self) -> bool {
        self.names.values().flatten().any(|name| matches!(name, Name::Item(_)))
    }
}

/// A crate's files and modules; the first of each is the root.
pub(crate) struct Tree {
    pub(crate) files: Vec<SourceFile>,
    pub(crate) modules: Vec<Module>,
}

/// One name that a `use` brings in.
pub(crate) struct Imported {
    pub(crate) path: Vec<String>,
    /// The name it gets here; nothing for `*`.
    pub(crate) name: Option<String>,
    pub(crate) line: usize,
}

impl Tree {
    /// Reads a crate from its root file; paths are given from `top`.
    pub(crate) fn read(top: &Path, root: &Path) -> Result<Self> {
        let folder = root.parent().unwrap_or(root);
        let mut reader = Reader { top, folder, tree: Self { files: Vec::new(), modules: Vec::new() } };
        reader.file(root, None, folder)?;
        Ok(reader.tree)
    }

    /// Is `module` below `ancestor`?
    pub(crate) fn is_below(&self, module: usize, ancestor: usize) -> bool {
        let parents = std::iter::successors(self.modules[module].parent, |at| self.modules[*at].parent);
        parents.into_iter().any(|parent| parent == ancestor)
    }
}

struct Reader<'a> {
    top: &'a Path,
    /// The folder of the root file.
    folder: &'a Path,
    tree: Tree,
}

impl Reader<'_> {
    /// Reads a file as a module whose children lie in `children`.
    fn file(&mut self, path: &Path, parent: Option<usize>, children: &Path) -> Result<usize> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let place = slashes(path.strip_prefix(self.top).unwrap_or(path));
        let syntax = syn::parse_file(&text).map_err(|error| {
            anyhow::anyhow!("{place}:{}: not readable as Rust: {error}", error.span().start().line)
        })?;
        let syntax = Rc::new(syntax);
        let file = self.tree.files.len();
        let module = self.module(file, parent);
        self.tree.files.push(SourceFile {
            path: place,
            folder: folder_from(self.folder, path),
            text,
            syntax: Rc::clone(&syntax),
            module,
        });
        self.items(module, &syntax.items, children)?;
        Ok(module)
    }

    fn module(&mut self, file: usize, parent: Option<usize>) -> usize {
        self.tree.modules.push(Module { file, parent, names: BTreeMap::new(), globs: Vec::new() });
        self.tree.modules.len() - 1
    }

    fn items(&mut self, module: usize, items: &[Item], children: &Path) -> Result<()> {
        for item in items.iter().filter(|item| !for_tests(of_item(item))) {
            match item {
                Item::Mod(child) => self.child(module, child, children)?,
                Item::Use(import) => self.import(module, import),
                Item::Macro(declared) => {
                    let exported = declared.attrs.iter().any(|one| one.path().is_ident("macro_export"));
                    let home = if exported { 0 } else { module };
                    let file = self.tree.modules[module].file;
                    if let Some(name) = &declared.ident {
                        self.declare(home, name.to_string(), Name::Item(file));
                    }
                }
                other => {
                    self.local_imports(module, other);
                    let file = self.tree.modules[module].file;
                    if let Some(name) = name_of(other) {
                        self.declare(module, name, Name::Item(file));
                    }
                }
            }
        }
        Ok(())
    }

    fn declare(&mut self, module: usize, name: String, meaning: Name) {
        self.tree.modules[module].names.entry(name).or_default().push(meaning);
    }

    fn import(&mut self, module: usize, import: &ItemUse) {
        for one in imported(import) {
            match one.name {
                Some(name) => self.declare(module, name, Name::Import(one.path)),
                None => self.tree.modules[module].globs.push(one.path),
            }
        }
    }

    /// Imports inside the bodies of functions count for the module: a wider reach than they have.
    fn local_imports(&mut self, module: usize, item: &Item) {
        let mut local = LocalImports(Vec::new());
        local.visit_item(item);
        for import in local.0 {
            self.import(module, import);
        }
    }

    fn child(&mut self, parent: usize, child: &ItemMod, children: &Path) -> Result<()> {
        let name = plain(&child.ident);
        let below = children.join(&name);
        let module = if let Some((_, items)) = &child.content {
            let module = self.module(self.tree.modules[parent].file, Some(parent));
            self.items(module, items, &below)?;
            module
        } else {
            let (path, folder) = self.place(parent, &child.attrs, &name, children)?;
            self.file(&path, Some(parent), &folder)?
        };
        self.declare(parent, name, Name::Module(module));
        Ok(())
    }

    /// The file of a module, and the folder of its children.
    fn place(
        &self,
        parent: usize,
        attributes: &[Attribute],
        name: &str,
        children: &Path,
    ) -> Result<(PathBuf, PathBuf)> {
        let parent_file = &self.tree.files[self.tree.modules[parent].file].path;
        if let Some(path) = attributes.iter().find_map(path_attribute) {
            let folder = self.top.join(parent_file).parent().unwrap_or(self.top).to_path_buf();
            let path = folder.join(path);
            let below = path.parent().unwrap_or(self.top).to_path_buf();
            return Ok((path, below));
        }
        let below = children.join(name);
        for path in [children.join(format!("{name}.rs")), below.join("mod.rs")] {
            if path.is_file() {
                return Ok((path, below));
            }
        }
        bail!("{parent_file}: `mod {name};` has no file {name}.rs or {name}/mod.rs in {}", children.display())
    }
}

/// Every `use` inside an item, apart from those for tests.
struct LocalImports<'a>(Vec<&'a ItemUse>);

impl<'a> Visit<'a> for LocalImports<'a> {
    fn visit_item(&mut self, item: &'a Item) {
        if !for_tests(of_item(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, import: &'a ItemUse) {
        self.0.push(import);
    }
}

/// `#[path = "..."]`.
fn path_attribute(attribute: &Attribute) -> Option<String> {
    let Meta::NameValue(pair) = &attribute.meta else { return None };
    let Expr::Lit(literal) = &pair.value else { return None };
    match &literal.lit {
        Lit::Str(text) if pair.path.is_ident("path") => Some(text.value()),
        _ => None,
    }
}

fn name_of(item: &Item) -> Option<String> {
    let ident = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::TraitAlias(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(plain(ident))
}

/// An identifier without `r#`.
pub(crate) fn plain(ident: &proc_macro2::Ident) -> String {
    let text = ident.to_string();
    text.strip_prefix("r#").unwrap_or(&text).to_owned()
}

/// Can anybody outside the module name what this `use` brings in?
pub(crate) fn is_re_export(import: &ItemUse) -> bool {
    !matches!(import.vis, Visibility::Inherited)
}

/// Every name that a `use` brings in. A path that begins with `::` leads to another crate.
pub(crate) fn imported(import: &ItemUse) -> Vec<Imported> {
    let mut found = Vec::new();
    if import.leading_colon.is_none() {
        flatten(&import.tree, &mut Vec::new(), &mut found);
    }
    found
}

fn flatten(tree: &UseTree, before: &mut Vec<String>, found: &mut Vec<Imported>) {
    let mut take = |ident: &proc_macro2::Ident, name: Option<String>| {
        let mut path = before.clone();
        if ident != "self" || path.is_empty() {
            path.push(plain(ident));
        }
        let name = name.or_else(|| path.last().cloned());
        found.push(Imported { path, name, line: ident.span().start().line });
    };
    match tree {
        UseTree::Path(path) => {
            before.push(plain(&path.ident));
            flatten(&path.tree, before, found);
            before.pop();
        }
        UseTree::Name(name) => take(&name.ident, None),
        UseTree::Rename(rename) => take(&rename.ident, Some(plain(&rename.rename))),
        UseTree::Glob(star) => {
            let line = star.star_token.spans[0].start().line;
            found.push(Imported { path: before.clone(), name: None, line });
        }
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, found)),
    }
}

fn folder_from(root: &Path, path: &Path) -> String {
    let folder = path.parent().unwrap_or(path);
    let inside = slashes(folder.strip_prefix(root).unwrap_or(folder));
    if inside.is_empty() { ".".to_owned() } else { inside }
}

fn slashes(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}
