//! All files of all crates, and which file imports which.

use crate::file::{Import, Parsed, parse};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A library: the name that paths begin with and the file of its root.
#[derive(Debug, Clone)]
pub(crate) struct Library {
    pub(crate) name: String,
    pub(crate) root: PathBuf,
}

#[derive(Debug)]
pub(crate) struct File {
    pub(crate) path: PathBuf,
    /// Names from the crate's on: `["hybank", "design", "fir"]`.
    pub(crate) module: Vec<String>,
    parsed: Parsed,
}

/// What a path leads to.
#[derive(Debug, Clone, PartialEq)]
enum Goal {
    Module(Vec<String>),
    /// Something that stands in this file.
    Item(usize),
}

/// An import: from a file to the file that holds what is imported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Arrow {
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// From a module to a file below it.
    pub(crate) down: bool,
}

#[derive(Debug, Default)]
struct Module {
    file: usize,
    children: HashSet<String>,
    items: HashSet<String>,
    /// What `use` brought in: name and path.
    names: HashMap<String, Vec<String>>,
    /// `use path::*`.
    globs: Vec<Vec<String>>,
}

#[derive(Debug)]
pub(crate) struct House {
    pub(crate) files: Vec<File>,
    modules: BTreeMap<Vec<String>, Module>,
}

impl House {
    /// Reads the libraries from their roots along their `mod` lines.
    pub(crate) fn read(libraries: &[Library]) -> Result<Self, String> {
        let mut house = Self { files: Vec::new(), modules: BTreeMap::new() };
        for library in libraries {
            house.file(&library.root, vec![library.name.clone()])?;
        }
        Ok(house)
    }

    fn file(&mut self, path: &Path, module: Vec<String>) -> Result<(), String> {
        let source = fs::read_to_string(path)
            .map_err(|error| format!("{}: cannot read it: {error}", path.display()))?;
        let parsed = parse(&source);
        let file = self.files.len();
        self.declare(file, &module, &parsed);
        let children = parsed.children.clone();
        self.files.push(File { path: path.to_owned(), module: module.clone(), parsed });
        for child in children {
            let inside = [&module[..], &child.scope].concat();
            let below = below(path, &child.scope);
            let found = match child.file {
                Some(name) => path.with_file_name(name),
                None => [below.join(format!("{}.rs", child.name)), below.join(&child.name).join("mod.rs")]
                    .into_iter()
                    .find(|path| path.is_file())
                    .ok_or_else(|| format!("{}: no file for `mod {}`", path.display(), child.name))?,
            };
            self.file(&found, [inside, vec![child.name]].concat())?;
        }
        Ok(())
    }

    fn declare(&mut self, file: usize, module: &[String], parsed: &Parsed) {
        let place = |scope: &[String]| [module, scope].concat();
        self.modules.entry(module.to_vec()).or_default().file = file;
        for scope in &parsed.inline {
            self.modules.entry(place(scope)).or_default().file = file;
            let (name, outer) = scope.split_last().expect("an inline module has a name");
            self.modules.entry(place(outer)).or_default().children.insert(name.clone());
        }
        for child in &parsed.children {
            self.modules.entry(place(&child.scope)).or_default().children.insert(child.name.clone());
        }
        for (scope, item) in &parsed.items {
            self.modules.entry(place(scope)).or_default().items.insert(item.clone());
        }
        for import in &parsed.imports {
            let Some(name) = &import.name else { continue };
            let module = self.modules.entry(place(&import.scope)).or_default();
            match name.as_str() {
                "*" => module.globs.push(import.path.clone()),
                _ => drop(module.names.insert(name.clone(), import.path.clone())),
            }
        }
    }

    /// All imports between files of the house.
    pub(crate) fn arrows(&self) -> BTreeSet<Arrow> {
        let all = self.files.iter().enumerate();
        all.flat_map(|(from, file)| {
            file.parsed.imports.iter().filter_map(move |import| self.arrow(from, import))
        })
        .collect()
    }

    fn arrow(&self, from: usize, import: &Import) -> Option<Arrow> {
        let module = [&self.files[from].module[..], &import.scope].concat();
        let to = match self.resolve(&module, &import.path, 0)? {
            Goal::Item(file) => file,
            // Names of modules are no imports yet: what is reached through them is. All of a module is one.
            Goal::Module(path) if import.name.as_deref() == Some("*") => self.modules[&path].file,
            Goal::Module(_) => return None,
        };
        let down = self.files[to].module.starts_with(&self.files[from].module);
        (from != to).then_some(Arrow { from, to, down })
    }

    /// Where a path leads that stands in a module; `None` outside of the house.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<Goal> {
        // Names may lead in circles, and names that are brought in may be those of other crates.
        if depth > 24 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let start = match first.as_str() {
            "crate" => Goal::Module(module[..1].to_vec()),
            "self" => Goal::Module(module.to_vec()),
            "super" => Goal::Module(module[..module.len() - 1].to_vec()),
            name => match self.member(module, name, depth) {
                Some(goal) => goal,
                None => Some(vec![name.to_owned()])
                    .filter(|root| self.modules.contains_key(root))
                    .map(Goal::Module)?,
            },
        };
        rest.iter().try_fold(start, |goal, name| match goal {
            Goal::Item(_) => Some(goal),
            Goal::Module(path) if name == "super" => Some(Goal::Module(path[..path.len() - 1].to_vec())),
            Goal::Module(path) if name == "self" => Some(Goal::Module(path)),
            // A name that cannot be seen here was made by a macro of that file.
            Goal::Module(path) => {
                let file = self.modules[&path].file;
                Some(self.member(&path, name, depth).unwrap_or(Goal::Item(file)))
            }
        })
    }

    fn member(&self, path: &[String], name: &str, depth: usize) -> Option<Goal> {
        let module = self.modules.get(path)?;
        if module.children.contains(name) {
            return Some(Goal::Module([path, &[name.to_owned()]].concat()));
        }
        if module.items.contains(name) {
            return Some(Goal::Item(module.file));
        }
        if let Some(target) = module.names.get(name) {
            // `use x::y` of another crate with a module of the same name here leads to itself.
            return if target[0] == name && target.len() == 1 {
                None
            } else {
                self.resolve(path, target, depth + 1)
            };
        }
        module.globs.iter().find_map(|glob| match self.resolve(path, glob, depth + 1)? {
            Goal::Module(inside) if inside != path => self.member(&inside, name, depth + 1),
            _ => None,
        })
    }
}

/// The folder in which the modules of a file lie.
fn below(path: &Path, scope: &[String]) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut below = if stem == "mod" || stem == "lib" { folder.to_owned() } else { folder.join(stem) };
    below.extend(scope);
    below
}
