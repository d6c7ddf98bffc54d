//! What may be wrong with the imports, one line each.

use crate::api;
use crate::imports::{File, Imports};
use petgraph::{algo::tarjan_scc, graphmap::DiGraphMap};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The crates that ARCHITECTURE.md names, each with its folder. `hybank` is divided into rooms, the modules
/// at its top; the other crates are rooms themselves.
const CRATES: [(&str, &str); 5] = [
    ("hybank", "src"),
    ("hybank_linalg", "linalg/src"),
    ("hybank_runtime", "runtime/src"),
    ("hybank_ibr", "ibr/src"),
    ("hybank_cli", "cli/src"),
];

/// The arrows allowed from each room, read from the first block of code below "Who may import whom": one or
/// more statements `rooms -> rooms` a line, two spaces apart. What stands in parentheses is left out.
fn allowed(text: &str) -> Result<BTreeMap<String, BTreeSet<String>>, String> {
    let section = text.split_once("## Who may import whom").ok_or("ARCHITECTURE.md has no rules")?.1;
    let block = section.split("```").nth(1).unwrap_or_default().trim_start_matches("text");
    let outside = |part: &str| part.split_once(')').map_or(part, |(_, after)| after).to_owned();
    let block: String = block.split('(').map(outside).collect();
    let rooms = |list: &str| -> BTreeSet<String> {
        let names = list.split(',').map(|room| room.trim().trim_start_matches("hybank::").to_owned());
        names.filter(|room| !matches!(room.as_str(), "nothing" | "")).collect()
    };
    let mut allowed = BTreeMap::<String, BTreeSet<String>>::new();
    for statement in block.lines().flat_map(|line| line.split("  ")).filter(|text| !text.trim().is_empty()) {
        let (from, to) = statement.split_once("->").ok_or(format!("no arrow in `{statement}`"))?;
        rooms(from).into_iter().for_each(|from| allowed.entry(from).or_default().extend(rooms(to)));
    }
    Ok(allowed)
}

/// The crates that are there, and the names of those that are libraries.
fn read(root: &Path) -> Result<(Imports, Vec<&'static str>), String> {
    let (mut imports, mut names) = (Imports::default(), Vec::new());
    for (name, folder) in CRATES {
        let [library, program] = ["lib.rs", "main.rs"].map(|file| root.join(folder).join(file));
        if library.is_file() {
            imports.read(&library, vec![name.to_owned()])?;
            names.push(name);
        } else if program.is_file() {
            imports.read(&program, vec![name.to_owned()])?;
        }
    }
    Ok((imports, names))
}

/// Every fault of the workspace in this folder.
pub(crate) fn faults(root: &Path) -> Result<Vec<String>, String> {
    let rules = std::fs::read_to_string(root.join("ARCHITECTURE.md")).map_err(|error| error.to_string())?;
    let (imports, names) = read(root)?;
    let promised = names.iter().filter_map(|name| difference(root, &imports, name).transpose());
    let promised = promised.collect::<Result<Vec<_>, _>>()?;
    let checks = Checks { root, rules: allowed(&rules)?, arrows: imports.arrows(), files: imports.files };
    Ok([checks.unnamed(), checks.forbidden(), checks.circles(), promised].concat())
}

/// The list of what users of a crate can name.
fn list(root: &Path, name: &str) -> PathBuf {
    root.join("tools/arrows/api").join(name).with_extension("txt")
}

/// What users of a crate can name now.
fn promised(imports: &Imports, name: &str) -> Result<String, String> {
    api::listing(imports.files.iter().filter(|file| file.module[0] == name))
}

/// Writes the lists as the crates are now.
pub(crate) fn accept(root: &Path) -> Result<Vec<String>, String> {
    let (imports, names) = read(root)?;
    for name in names {
        let path = list(root, name);
        std::fs::write(&path, promised(&imports, name)?)
            .map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(Vec::new())
}

/// The first line where the public interface of a crate is not the one of its list.
fn difference(root: &Path, imports: &Imports, name: &str) -> Result<Option<String>, String> {
    let Ok(listed) = std::fs::read_to_string(list(root, name)) else { return Ok(None) };
    let found = promised(imports, name)?;
    let line = listed.lines().zip(found.lines()).take_while(|(listed, found)| listed == found).count();
    let [was, is] = [&listed, &found].map(|text| text.lines().nth(line).unwrap_or("nothing more").trim());
    let remedy = "if that is meant, `cargo run -p arrows accept`";
    let fault = format!("{name}: its public interface is not the listed one; {remedy}\n- {was}\n+ {is}");
    Ok((listed != found).then_some(fault))
}

struct Checks<'a> {
    root: &'a Path,
    rules: BTreeMap<String, BTreeSet<String>>,
    files: Vec<File>,
    arrows: BTreeSet<(usize, usize)>,
}

impl Checks<'_> {
    fn name(&self, file: usize) -> String {
        let path = &self.files[file].path;
        path.strip_prefix(self.root).unwrap_or(path).display().to_string()
    }

    /// The root of `hybank` is in no room: it only passes on.
    fn room(&self, file: usize) -> Option<String> {
        match self.files[file].module.as_slice() {
            [name, rest @ ..] if name == CRATES[0].0 => rest.first().cloned(),
            module => module.first().map(|name| name.replace('_', "-")),
        }
    }

    fn unnamed(&self) -> Vec<String> {
        let rooms: BTreeSet<String> = (0..self.files.len()).filter_map(|file| self.room(file)).collect();
        let named: BTreeSet<String> = self.rules.keys().cloned().collect();
        let differ = rooms.symmetric_difference(&named);
        differ.map(|room| format!("{room} is not both a room and a rule of ARCHITECTURE.md")).collect()
    }

    fn forbidden(&self) -> Vec<String> {
        let fault = |&(from, to): &(usize, usize)| {
            let (importer, imported) = (self.room(from)?, self.room(to)?);
            let may = |rooms: &BTreeSet<String>| rooms.contains(&imported) || rooms.contains("everything");
            let is_allowed = importer == imported || self.rules.get(&importer).is_some_and(may);
            let rule = format!("ARCHITECTURE.md does not allow {importer} -> {imported}");
            (!is_allowed).then(|| format!("{} imports {}: {rule}", self.name(from), self.name(to)))
        };
        self.arrows.iter().filter_map(fault).collect()
    }

    fn circles(&self) -> Vec<String> {
        let rules = self.rules.iter().flat_map(|(from, to)| to.iter().map(move |to| (&**from, &**to)));
        let rules = circles(rules).into_iter().map(|rooms| rooms.join(", "));
        // A module and the files below it are one: it may use them, and they its names.
        let module = |file: usize| &self.files[file].module;
        let arrows = self.arrows.iter().copied().filter(|&(from, to)| !module(to).starts_with(module(from)));
        let files =
            circles(arrows).into_iter().map(|files| files.into_iter().map(|file| self.name(file)).collect());
        let files = files.map(|names: Vec<String>| names.join(", "));
        rules.chain(files).map(|names| format!("these import each other in a circle: {names}")).collect()
    }
}

/// Groups of nodes that reach each other.
fn circles<T: Copy + Ord + std::hash::Hash>(arrows: impl IntoIterator<Item = (T, T)>) -> Vec<Vec<T>> {
    let groups = tarjan_scc(&DiGraphMap::<T, ()>::from_edges(arrows));
    groups.into_iter().filter(|group| group.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::allowed;
    use std::fs;
    use std::path::Path;

    /// A workspace of so many files, with the rules `a -> b`, `b -> nothing`.
    fn faults(files: &[(&str, &str)]) -> Vec<String> {
        let name =
            format!("arrows-{}-{}", std::process::id(), files.iter().map(|f| f.1.len()).sum::<usize>());
        let folder = std::env::temp_dir().join(name);
        let rules = "## Who may import whom\n```text\na -> b   b -> nothing\n```\n";
        for (path, text) in
            [("ARCHITECTURE.md", rules), ("src/lib.rs", "pub mod a; pub mod b;")].iter().chain(files)
        {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let faults = super::faults(&folder).unwrap();
        fs::remove_dir_all(folder).unwrap();
        faults
    }

    #[test]
    fn arrows_that_run_up_are_found_however_they_are_written() {
        assert!(faults(&[("src/a.rs", "use crate::b::B;"), ("src/b.rs", "pub struct B;")]).is_empty());
        let a = ("src/a.rs", "pub struct A;");
        for b in [
            "use crate::a::A;",
            "use super::a::A as Other;",
            "use super::*; fn f(_: a::A) {}",
            "fn f() -> crate::a::A { todo!() }",
            "use crate::{a::{self}}; fn f() -> a::A { todo!() }",
            "mod inner { use super::super::a::A; }",
            "pub use crate::a::*;",
        ] {
            let found = faults(&[a, ("src/b.rs", b)]);
            assert_eq!(found, ["src/b.rs imports src/a.rs: ARCHITECTURE.md does not allow b -> a"], "{b}");
        }
    }

    #[test]
    fn circles_are_found_through_names_that_are_passed_on() {
        let found = faults(&[
            ("src/a/mod.rs", "mod x; mod y; pub use x::X; use y::Y;"),
            ("src/a/x.rs", "use super::y::Y; pub struct X;"),
            ("src/a/y.rs", "use super::X; pub struct Y;"),
            ("src/b.rs", ""),
        ]);
        assert_eq!(found, ["these import each other in a circle: src/a/y.rs, src/a/x.rs"]);
    }

    #[test]
    fn rooms_and_rules_belong_together() {
        let found = faults(&[("src/lib.rs", "pub mod a; pub mod c;"), ("src/a.rs", ""), ("src/c.rs", "")]);
        assert_eq!(
            found,
            ["b", "c"].map(|room| format!("{room} is not both a room and a rule of ARCHITECTURE.md"))
        );
    }

    #[test]
    fn what_users_can_name_is_compared_with_its_list() {
        let a =
            "pub mod c { pub use super::d::*; pub struct S { pub x: u8, y: u8 } }\nmod d; pub use d::E as F;";
        let d = "/// E\n#[must_use] #[derive(Debug)] #[non_exhaustive] pub enum E { A, B { n: u8 } } struct P;\n\
            impl E { pub fn f(\n&self,\nmut n: u8,\n) -> u8 { n } fn g() {} }\nimpl Clone for E {} impl Clone for P {}";
        let b = "pub(crate) fn no() {} #[doc(hidden)] pub fn hidden() {} #[cfg(test)] pub fn test() {}\n\
            pub trait T { const C: u8; fn f(&self) -> u8 { 1 } }\nm! { /// Of a macro.\n M, \"s\" }";
        let want = "\
// hybank
pub mod a;
pub mod b;

// hybank::a
pub mod c {
    pub use super::d::*;
    pub struct S {
        pub x: u8,
        _private: (),
    }
}
pub use d::E as F;

// hybank::a::d
#[derive(Debug)]
#[non_exhaustive]
pub enum E {
    A,
    B { n: u8 },
}
impl E {
    pub fn f(&self, n: u8) -> u8 {}
}
impl Clone for E {}

// hybank::b
pub trait T {
    const C: u8;
    fn f(&self) -> u8 {}
}
m! { M , \"s\" }
";
        let found = |listed: &str| {
            let files = ["src/a.rs", "src/a/d.rs", "src/b.rs", "tools/arrows/api/hybank.txt"];
            faults(&[(files[0], a), (files[1], d), (files[2], b), (files[3], listed)])
        };
        assert_eq!(found(want), [""; 0]);
        for (was, line) in [("pub x: u8,", "pub z: u8,"), ("m! { M", "pub fn gone() {}\nm! { M")] {
            let found = found(&want.replace(was, line));
            let [fault] = &*found else { panic!("{found:?}") };
            assert!(fault.contains("cargo run -p arrows accept"), "{fault}");
            let line = line.lines().next().unwrap();
            assert!(fault.contains(&format!("\n- {line}\n+ {}", &was[..6])), "{fault}");
        }
    }

    #[test]
    fn this_workspace_keeps_its_arrows() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let faults = super::faults(&root).unwrap();
        assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
    }

    #[test]
    fn statements_are_read() {
        let text = "## Who may import whom\n\n```text\na -> everything\nb, c -> d (as, such), e    \
            d -> nothing\ne -> nothing  b-f -> hybank::d\n```\n";
        let rules = allowed(text).unwrap();
        let named: Vec<&str> = rules["b"].iter().map(String::as_str).collect();
        assert_eq!((named, rules["b-f"].len(), rules.len()), (vec!["d", "e"], 1, 6));
        assert!(allowed("nothing").is_err());
        assert!(allowed("## Who may import whom\n```text\na b\n```").unwrap_err().contains("a b"));
    }
}
