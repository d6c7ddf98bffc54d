//! The files of crates, and which file imports which.

use proc_macro2::{Ident, TokenStream};
use quote::ToTokens;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use syn::parse::{ParseStream, Parser};
use syn::visit::{self, Visit};
use syn::{Attribute, Meta, UseTree, Visibility};

/// The crates that ARCHITECTURE.md names, each with its folder. `hybank` is divided into rooms, the modules
/// at its top; the other crates are rooms themselves.
pub(crate) const CRATES: [(&str, &str); 5] = [
    ("hybank", "src"),
    ("hybank_linalg", "linalg/src"),
    ("hybank_runtime", "runtime/src"),
    ("hybank_ibr", "ibr/src"),
    ("hybank_cli", "cli/src"),
];

/// A path from the crate on: `hybank`, `design`, `fir`.
type Names = Vec<String>;

#[derive(Clone)]
pub(crate) struct File {
    pub(crate) path: PathBuf,
    pub(crate) module: Names,
    pub(crate) syntax: syn::File,
}

#[derive(Default)]
pub(crate) struct Imports {
    pub(crate) files: Vec<File>,
    /// The file of each module.
    modules: HashMap<Names, usize>,
    /// What `use` brings into modules: the module with the name there, or with `*`, and what it stands for.
    used: HashMap<Names, Vec<Names>>,
    /// The paths that stand in each file.
    paths: BTreeSet<(usize, Names)>,
}

impl Imports {
    /// Reads the crates that are in this folder.
    pub(crate) fn read(root: &Path) -> Result<Imports, String> {
        let mut imports = Imports::default();
        for (name, folder) in CRATES {
            let [library, program] = ["lib.rs", "main.rs"].map(|file| root.join(folder).join(file));
            if let Some(path) = [library, program].iter().find(|path| path.is_file()) {
                imports.read_file(path, vec![name.to_owned()])?;
            }
        }
        Ok(imports)
    }

    /// Reads a file and the files of its `mod` lines.
    fn read_file(&mut self, path: &Path, module: Names) -> Result<(), String> {
        let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let source = std::fs::read_to_string(path).map_err(|error| wrong(&error))?;
        let syntax = syn::parse_file(&source).map_err(|error| wrong(&error))?;
        let file = self.files.len();
        self.modules.insert(module.clone(), file);
        let mut reader = Reader { file, module: module.clone(), children: Vec::new(), imports: self };
        reader.visit_file(&syntax);
        let children = reader.children;
        self.files.push(File { path: path.to_owned(), module: module.clone(), syntax });
        let is_root = ["mod.rs", "lib.rs", "main.rs"].iter().any(|root| path.ends_with(root));
        let folder = if is_root { path.with_file_name("") } else { path.with_extension("") };
        for child in children {
            let below = folder.join(child[module.len()..].iter().collect::<PathBuf>());
            let flat = below.with_extension("rs");
            self.read_file(&if flat.is_file() { flat } else { below.join("mod.rs") }, child)?;
        }
        Ok(())
    }

    /// All pairs of a file and another one that it imports from.
    pub(crate) fn arrows(&self) -> BTreeSet<(usize, usize)> {
        let from =
            |(from, path): &(usize, Names)| self.reached(path).into_iter().map(|to| (*from, to)).collect();
        let arrows = self.paths.iter().flat_map(|path| -> Vec<(usize, usize)> { from(path) });
        arrows.filter(|(from, to)| from != to).collect()
    }

    /// The files that a path may lead to. A name that nothing tells stands in its module or behind any `*`
    /// there; names of other crates stay in the file that writes them.
    fn reached(&self, path: &[String]) -> BTreeSet<usize> {
        // `use` may lead in circles, and with each turn to a longer path.
        const LONGEST: usize = 24;
        let (mut open, mut seen, mut files) = (vec![path.to_vec()], HashSet::new(), BTreeSet::new());
        while let Some(path) = open.pop() {
            let depth = (1..=path.len()).rev().find(|&depth| self.modules.contains_key(&path[..depth]));
            let Some(depth) = depth.filter(|_| path.len() < LONGEST && seen.insert(path.clone())) else {
                continue;
            };
            let (module, rest) = path.split_at(depth);
            let used = |name: &str| self.used.get(&[module, &[name.to_owned()]].concat());
            let known = rest.first().and_then(|name| used(name));
            if known.is_none() {
                files.insert(self.modules[module]);
            }
            let behind = |target: &Names| [target, &rest[usize::from(known.is_some())..]].concat();
            open.extend(known.or_else(|| used("*")).into_iter().flatten().map(behind));
        }
        files
    }
}

/// Walks the syntax of one file.
struct Reader<'a> {
    file: usize,
    module: Names,
    /// Modules in files of their own.
    children: Vec<Names>,
    imports: &'a mut Imports,
}

impl Reader<'_> {
    /// The path with one more name, of a path that begins in this module.
    fn step(&self, path: &[String], name: &Ident) -> Names {
        match name.to_string().as_str() {
            "self" => path.to_vec(),
            "super" => path[..path.len().saturating_sub(1)].to_vec(),
            "crate" => path[..1].to_vec(),
            name if path == self.module && CRATES.iter().any(|it| it.0 == name) => vec![name.to_owned()],
            name => [path, &[name.to_owned()]].concat(),
        }
    }

    fn use_tree(&mut self, stem: &[String], tree: &UseTree) {
        let (path, name) = match tree {
            UseTree::Path(tree) => return self.use_tree(&self.step(stem, &tree.ident), &tree.tree),
            UseTree::Group(group) => return group.items.iter().for_each(|tree| self.use_tree(stem, tree)),
            UseTree::Glob(_) => (stem.to_vec(), Some("*".to_owned())),
            UseTree::Rename(tree) => (self.step(stem, &tree.ident), Some(tree.rename.to_string())),
            UseTree::Name(tree) => (self.step(stem, &tree.ident), None),
        };
        let name = name.or_else(|| path.last().cloned());
        let name = self.module.iter().cloned().chain(name).collect();
        self.imports.used.entry(name).or_default().push(path.clone());
        self.imports.paths.insert((self.file, path));
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
            self.imports.modules.insert(self.module.clone(), self.file);
            visit::visit_item_mod(self, item);
        } else {
            self.children.push(self.module.clone());
        }
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.use_tree(&self.module.clone(), &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names = path.segments.iter().map(|segment| &segment.ident);
        let path_from_crate = names.fold(self.module.clone(), |path, name| self.step(&path, name));
        self.imports.paths.insert((self.file, path_from_crate));
        visit::visit_path(self, path);
    }

    /// All that may be a path in what a macro is given, whatever it makes of it.
    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        let text = call.tokens.to_string().replace(" :: ", "::");
        let words = text.split(|letter: char| !letter.is_alphanumeric() && !['_', ':'].contains(&letter));
        for word in words.filter(|word| word.contains("::")) {
            if let Ok(path) = syn::parse_str(word.trim_end_matches(':')) {
                Reader {
                    file: self.file,
                    module: self.module.clone(),
                    children: Vec::new(),
                    imports: self.imports,
                }
                .visit_path(&path);
            }
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
    head(item).0.iter().any(is_test)
}

/// What an item or a field begins with.
pub(crate) fn head(syntax: &impl ToTokens) -> (Vec<Attribute>, Visibility) {
    let head = |input: ParseStream| {
        let head = (Attribute::parse_outer(input)?, input.parse()?);
        input.parse::<TokenStream>().map(|_| head)
    };
    head.parse2(syntax.to_token_stream()).unwrap_or((Vec::new(), Visibility::Inherited))
}
