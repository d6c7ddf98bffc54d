//! The files of crates, and which file imports which.

use quote::ToTokens;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Meta, Token, UseTree, Visibility};

#[derive(Clone)]
pub(crate) struct File {
    pub(crate) path: PathBuf,
    /// Names from the crate's on: `hybank`, `design`, `fir`.
    pub(crate) module: Vec<String>,
    pub(crate) syntax: syn::File,
}

/// A path as written in a module of a file. `use path::*` imports the module itself.
struct Import {
    file: usize,
    module: Vec<String>,
    path: Vec<String>,
    is_glob: bool,
}

#[derive(Default)]
struct Module {
    file: usize,
    /// The names that `use` brought in, with the path of each.
    used: HashMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
}

#[derive(Default)]
pub(crate) struct Imports {
    pub(crate) files: Vec<File>,
    modules: HashMap<Vec<String>, Module>,
    imports: Vec<Import>,
}

impl Imports {
    /// Reads a file and the files of its `mod` lines.
    pub(crate) fn read(&mut self, path: &Path, module: Vec<String>) -> Result<(), String> {
        let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let source = std::fs::read_to_string(path).map_err(|error| wrong(&error))?;
        let syntax = syn::parse_file(&source).map_err(|error| wrong(&error))?;
        let file = self.files.len();
        let mut reader = Reader { file, module: module.clone(), children: Vec::new(), imports: self };
        reader.here();
        reader.visit_file(&syntax);
        let children = reader.children;
        self.files.push(File { path: path.to_owned(), module: module.clone(), syntax });
        let is_root = ["mod.rs", "lib.rs", "main.rs"].iter().any(|root| path.ends_with(root));
        let folder = if is_root { path.with_file_name("") } else { path.with_extension("") };
        for child in children {
            let below = folder.join(child[module.len()..].iter().collect::<PathBuf>());
            let flat = below.with_extension("rs");
            self.read(&if flat.is_file() { flat } else { below.join("mod.rs") }, child)?;
        }
        Ok(())
    }

    /// All pairs of a file and another one that it imports from.
    pub(crate) fn arrows(&self) -> BTreeSet<(usize, usize)> {
        let arrow = |import: &Import| {
            let (module, item) = self.resolve(&import.module, &import.path, 0)?;
            // The name of a module is no import yet: what is reached through it is.
            let to = self.modules[&module].file;
            (import.file != to && (item.is_some() || import.is_glob)).then_some((import.file, to))
        };
        self.imports.iter().filter_map(arrow).collect()
    }

    /// The module to which a path leads that stands in a module, and what the path names inside it; `None`
    /// outside of the crates read.
    fn resolve(
        &self,
        module: &[String],
        path: &[String],
        depth: usize,
    ) -> Option<(Vec<String>, Option<String>)> {
        // Names that `use` brings in may lead in circles.
        const DEEPEST: usize = 24;
        let (first, rest) = path.split_first().filter(|_| depth < DEEPEST)?;
        let start = match first.as_str() {
            "crate" => (module[..1].to_vec(), None),
            "self" => (module.to_vec(), None),
            "super" => (module[..module.len() - 1].to_vec(), None),
            _ => self.named(module, first, depth).or_else(|| {
                self.modules.contains_key(std::slice::from_ref(first)).then(|| (vec![first.clone()], None))
            })?,
        };
        Some(rest.iter().fold(start, |(path, item), name| match name.as_str() {
            _ if item.is_some() => (path, item),
            "super" => (path[..path.len() - 1].to_vec(), None),
            "self" => (path, None),
            _ => self.named(&path, name, depth).unwrap_or_else(|| (path, Some(name.clone()))),
        }))
    }

    /// What a name in a module leads to: a module below, or what `use` brought in.
    fn named(&self, module: &[String], name: &String, depth: usize) -> Option<(Vec<String>, Option<String>)> {
        let child = [module, std::slice::from_ref(name)].concat();
        if self.modules.contains_key(&child) {
            return Some((child, None));
        }
        let Module { used, globs, .. } = self.modules.get(module)?;
        if let Some(target) = used.get(name) {
            // `use x;` of another crate leads to itself.
            return if target == std::slice::from_ref(name) {
                None
            } else {
                self.resolve(module, target, depth + 1)
            };
        }
        globs.iter().find_map(|glob| match self.resolve(module, glob, depth + 1)? {
            (inside, None) if inside != module => self.named(&inside, name, depth + 1),
            _ => None,
        })
    }
}

/// Walks the syntax of one file.
struct Reader<'a> {
    file: usize,
    module: Vec<String>,
    /// Modules in files of their own.
    children: Vec<Vec<String>>,
    imports: &'a mut Imports,
}

impl Reader<'_> {
    fn here(&mut self) -> &mut Module {
        let module = self.imports.modules.entry(self.module.clone()).or_default();
        module.file = self.file;
        module
    }

    fn import(&mut self, path: Vec<String>, is_glob: bool) {
        self.imports.imports.push(Import { file: self.file, module: self.module.clone(), path, is_glob });
    }

    fn use_tree(&mut self, stem: &[String], tree: &UseTree) {
        let below = |name: &syn::Ident| match name.to_string() {
            name if name == "self" => stem.to_vec(),
            name => [stem, &[name]].concat(),
        };
        let (path, name) = match tree {
            UseTree::Path(tree) => return self.use_tree(&below(&tree.ident), &tree.tree),
            UseTree::Group(group) => return group.items.iter().for_each(|tree| self.use_tree(stem, tree)),
            UseTree::Glob(_) => {
                self.here().globs.push(stem.to_vec());
                return self.import(stem.to_vec(), true);
            }
            UseTree::Rename(tree) => (below(&tree.ident), tree.rename.to_string()),
            UseTree::Name(tree) => (below(&tree.ident), below(&tree.ident).pop().unwrap_or_default()),
        };
        self.here().used.insert(name, path.clone());
        self.import(path, false);
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        if !is_test(item) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast syn::ImplItem) {
        if !is_test(item) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.module.push(item.ident.to_string());
        if item.content.is_some() {
            self.here();
            visit::visit_item_mod(self, item);
        } else {
            self.children.push(self.module.clone());
        }
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.use_tree(&[], &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            self.import(path.segments.iter().map(|segment| segment.ident.to_string()).collect(), false);
        }
        visit::visit_path(self, path);
    }

    /// The arguments of macros like `format!` are expressions.
    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        if let Ok(arguments) = call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated) {
            arguments.iter().for_each(|argument| self.visit_expr(argument));
        }
    }
}

/// Whether it stands under `#[cfg(test)]` or `#[cfg(all(test, ..))]`, but not `any` or `not`.
pub(crate) fn is_test(item: &impl ToTokens) -> bool {
    let is_test = |attribute: &Attribute| {
        let Meta::List(list) = &attribute.meta else { return false };
        let text = list.tokens.to_string();
        list.path.is_ident("cfg") && text.contains("test") && !text.contains("any") && !text.contains("not")
    };
    head(item).attributes.iter().any(is_test)
}

/// What an item or a field begins with.
pub(crate) struct Head {
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) visibility: Visibility,
}

impl Parse for Head {
    fn parse(input: ParseStream) -> syn::Result<Head> {
        let head = Head { attributes: Attribute::parse_outer(input)?, visibility: input.parse()? };
        input.parse::<proc_macro2::TokenStream>().map(|_| head)
    }
}

pub(crate) fn head(syntax: &impl ToTokens) -> Head {
    let nothing = |_| Head { attributes: Vec::new(), visibility: Visibility::Inherited };
    syn::parse2(syntax.to_token_stream()).unwrap_or_else(nothing)
}
