//! What may be wrong with the imports, one line each.

use crate::imports::{CRATES, File, Imports};
use petgraph::{algo::tarjan_scc, graphmap::DiGraphMap};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The arrows allowed from each room, read from the first block of code below "Who may import whom": one or
/// more statements `rooms -> rooms` a line, two spaces apart. What stands in parentheses is left out.
pub(crate) fn allowed(text: &str) -> Result<BTreeMap<String, BTreeSet<String>>, String> {
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

/// Every fault of the workspace in this folder, but for its public interfaces.
pub(crate) fn faults(root: &Path, imports: Imports) -> Result<Vec<String>, String> {
    let rules = std::fs::read_to_string(root.join("ARCHITECTURE.md")).map_err(|error| error.to_string())?;
    let checks = Checks { root, rules: allowed(&rules)?, arrows: imports.arrows(), files: imports.files };
    Ok([checks.unnamed(), checks.forbidden(), checks.circles()].concat())
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
