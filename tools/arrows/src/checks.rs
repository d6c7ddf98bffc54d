//! What may be wrong with the imports, one line each.

use crate::circles::circles;
use crate::house::{Arrow, House, Library};
use crate::rules::Rules;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Libraries of the workspace, each with its folder; `hybank` is divided into rooms, the others are rooms
/// themselves.
const LIBRARIES: [(&str, &str); 5] = [
    ("hybank", "src"),
    ("hybank_audio", "audio/src"),
    ("hybank_linalg", "linalg/src"),
    ("hybank_runtime", "runtime/src"),
    ("hybank_ibr", "ibr/src"),
];
const DIVIDED: &str = "hybank";

pub(crate) struct Survey {
    root: PathBuf,
    house: House,
    arrows: BTreeSet<Arrow>,
    rules: Rules,
}

impl Survey {
    pub(crate) fn new(root: &Path) -> Result<Self, String> {
        let root = root.canonicalize().map_err(|error| format!("{}: {error}", root.display()))?;
        let library = |(name, folder): &(&str, &str)| Library {
            name: (*name).to_owned(),
            root: root.join(folder).join("lib.rs"),
        };
        let libraries: Vec<Library> =
            LIBRARIES.iter().map(library).filter(|library| library.root.is_file()).collect();
        let house = House::read(&libraries)?;
        let text = fs::read_to_string(root.join("ARCHITECTURE.md"));
        let rules = text.map_err(|error| error.to_string()).and_then(|text| Rules::parse(&text));
        let rules = rules.map_err(|error| format!("ARCHITECTURE.md: {error}"))?;
        Ok(Self { arrows: house.arrows(), root, house, rules })
    }

    pub(crate) fn faults(&self) -> Vec<String> {
        [self.unnamed(), self.circles_of_rules(), self.forbidden(), self.circles_of_files()].concat()
    }

    /// Every arrow between rooms with a file that draws it.
    pub(crate) fn list(&self) -> Vec<String> {
        let line = |((from, to), arrow): (&(String, String), &Arrow)| {
            format!("{from} -> {to}    {} imports {}", self.name(arrow.from), self.name(arrow.to))
        };
        self.between_rooms().iter().map(line).collect()
    }

    fn name(&self, file: usize) -> String {
        let path = &self.house.files[file].path;
        path.strip_prefix(&self.root).unwrap_or(path).display().to_string()
    }

    /// A module at the top of `hybank`, or another crate; the root itself only passes on.
    fn room(&self, file: usize) -> Option<String> {
        match self.house.files[file].module.as_slice() {
            [name] if name == DIVIDED => None,
            [name, room, ..] if name == DIVIDED => Some(room.clone()),
            [name, ..] => Some(name.replace('_', "-")),
            [] => None,
        }
    }

    fn between_rooms(&self) -> BTreeMap<(String, String), Arrow> {
        let rooms = |arrow: &Arrow| Some((self.room(arrow.from)?, self.room(arrow.to)?));
        let pairs = self.arrows.iter().rev().filter_map(|arrow| Some((rooms(arrow)?, *arrow)));
        pairs.filter(|((from, to), _)| from != to).collect()
    }

    /// Rooms without a rule, and rules without a room.
    fn unnamed(&self) -> Vec<String> {
        let rooms: BTreeSet<String> =
            (0..self.house.files.len()).filter_map(|file| self.room(file)).collect();
        let without = rooms.iter().filter(|room| !self.rules.knows(room));
        let missing = without.map(|room| format!("ARCHITECTURE.md has no rule for {room}"));
        let unknown = self.rules.rooms().into_iter().filter(|room| !rooms.contains(*room));
        missing
            .chain(unknown.map(|room| format!("ARCHITECTURE.md names {room}, which is not there")))
            .collect()
    }

    fn circles_of_rules(&self) -> Vec<String> {
        let rooms: Vec<&str> = self.rules.rooms().into_iter().collect();
        let place = |room: &str| rooms.binary_search(&room).unwrap_or_default();
        let arrows: Vec<_> =
            self.rules.arrows().into_iter().map(|(from, to)| (place(from), place(to))).collect();
        let name = |room: usize| rooms[room].to_owned();
        circles(rooms.len(), &arrows)
            .iter()
            .map(|circle| format!("ARCHITECTURE.md allows a circle: {}", around(circle, name)))
            .collect()
    }

    fn forbidden(&self) -> Vec<String> {
        let all = self.between_rooms();
        let forbidden = all.iter().filter(|((from, to), _)| !self.rules.allow(from, to));
        forbidden
            .map(|((from, to), arrow)| {
                let (importer, imported) = (self.name(arrow.from), self.name(arrow.to));
                format!("{importer} imports {imported}: ARCHITECTURE.md does not allow {from} -> {to}")
            })
            .collect()
    }

    /// A module and the files below it are one: it may use them, and they its names. Any other circle is a
    /// fault.
    fn circles_of_files(&self) -> Vec<String> {
        let closing: Vec<_> =
            self.arrows.iter().filter(|arrow| !arrow.down).map(|arrow| (arrow.from, arrow.to)).collect();
        circles(self.house.files.len(), &closing)
            .iter()
            .map(|circle| format!("a circle of files: {}", around(circle, |file| self.name(file))))
            .collect()
    }
}

fn around(circle: &[usize], name: impl Fn(usize) -> String) -> String {
    let names: Vec<String> = circle.iter().chain(circle.first()).map(|&node| name(node)).collect();
    names.join(" -> ")
}

#[cfg(test)]
mod tests {
    use super::Survey;
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
        let faults = Survey::new(&folder).unwrap().faults();
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
        assert_eq!(found, ["a circle of files: src/a/x.rs -> src/a/y.rs -> src/a/x.rs"]);
    }

    #[test]
    fn rooms_and_rules_belong_together() {
        let found = faults(&[("src/lib.rs", "pub mod a; pub mod c;"), ("src/a.rs", ""), ("src/c.rs", "")]);
        assert_eq!(
            found,
            ["ARCHITECTURE.md has no rule for c", "ARCHITECTURE.md names b, which is not there"]
        );
    }

    #[test]
    fn this_workspace_keeps_its_arrows() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let faults = Survey::new(&root).unwrap().faults();
        assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
    }
}
