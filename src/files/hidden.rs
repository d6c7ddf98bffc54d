//! Names of unfinished files, and the unfinished files that killed runs have left.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Characters of the target's name in that of the unfinished file, so that this is not too long for the
/// file system.
const NAME_PART: usize = 48;
/// Characters of the name of the host in it.
const HOST_PART: usize = 16;

/// An unfinished file whose process does not run on this host.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Leftover {
    /// The file.
    pub path: PathBuf,
    /// The process that wrote it.
    pub process: u32,
    /// The host of that process, as in the name of the file; `None` for this one.
    pub host: Option<String>,
}

/// The file, whose it is, and what to do. Of the processes of another host nothing is known.
impl fmt::Display for Leftover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (path, process) = (self.path.display(), self.process);
        write!(f, "{path}: an unfinished output of process {process}")?;
        match &self.host {
            None => write!(f, ", which no longer runs; remove it"),
            Some(host) => write!(f, " on the host {host}; remove it if that run has ended"),
        }
    }
}

/// The name of this host, in letters and digits: other hosts may write to the same folder.
static HOST: LazyLock<String> = LazyLock::new(|| {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    name.trim().chars().take(HOST_PART).map(letter).collect()
});

/// `.NAME.`, the beginning of the names of all unfinished files of `target`.
fn beginning(target: &Path) -> Option<String> {
    let name = target.file_name()?.to_string_lossy();
    Some(format!(".{}.", name.chars().take(NAME_PART).collect::<String>()))
}

/// `.NAME.HOST-PROCESS-NUMBER.part` beside `target`.
pub(super) fn beside(target: &Path, process: u32, number: u32) -> Option<PathBuf> {
    Some(target.with_file_name(format!("{}{}-{process}-{number}.part", beginning(target)?, *HOST)))
}

/// The unfinished files beside `targets` whose processes do not run on this host: such a run was killed
/// before it could remove them, or it is that of another host. An output may be a link; then its folder is
/// that of the file it leads to.
pub fn leftovers(targets: &[&Path]) -> Vec<Leftover> {
    let mut searches: Vec<(PathBuf, BTreeSet<String>)> = Vec::new();
    for target in targets {
        let end = target.is_symlink().then(|| target.canonicalize().ok()).flatten();
        let target = end.unwrap_or_else(|| target.to_path_buf());
        let Some(name) = beginning(&target) else { continue };
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        match searches.iter_mut().find(|(known, _)| known == folder) {
            Some((_, names)) => drop(names.insert(name)),
            None => searches.push((folder.to_owned(), BTreeSet::from([name]))),
        }
    }
    let found = searches.iter().flat_map(|(folder, names)| in_folder(folder, names));
    found.collect::<BTreeSet<_>>().into_iter().collect()
}

fn in_folder(folder: &Path, names: &BTreeSet<String>) -> Vec<Leftover> {
    let leftover = |name: String| {
        let (beginning, host, process) = writer(&name)?;
        let host = (host != *HOST).then(|| host.to_owned());
        (names.contains(beginning) && (host.is_some() || !is_running(process))).then(|| Leftover {
            path: folder.join(&name),
            process,
            host,
        })
    };
    names_in(folder).into_iter().filter_map(leftover).collect()
}

/// The names in a folder. One that cannot be listed is no reason to stop: this is only for a notice.
#[cfg(target_os = "linux")]
fn names_in(folder: &Path) -> Vec<String> {
    use rustix::fs::{Dir, Mode, OFlags, open};
    // `std::fs::ReadDir` panics where a folder cannot be closed.
    let folder = open(folder, OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty());
    let Ok(entries) = folder.and_then(Dir::new) else { return Vec::new() };
    let name = |entry: rustix::fs::DirEntry| Some(entry.file_name().to_str().ok()?.to_owned());
    entries.flatten().filter_map(name).collect()
}

/// Elsewhere it is unknown which process still runs, so no file is called a leftover.
#[cfg(not(target_os = "linux"))]
fn names_in(_: &Path) -> Vec<String> {
    Vec::new()
}

/// Splits the name of an unfinished file into `.NAME.` and the host and the process that wrote it.
fn writer(name: &str) -> Option<(&str, &str, u32)> {
    let (rest, number) = name.strip_suffix(".part")?.rsplit_once('-')?;
    let (rest, process) = rest.rsplit_once('-')?;
    let start = rest.rfind('.')? + 1;
    number.parse::<u32>().ok()?;
    Some((&name[..start], &rest[start..], process.parse().ok()?))
}

fn is_running(process: u32) -> bool {
    // Without /proc nothing is known, and a file that may still be written is not called a leftover.
    !Path::new("/proc/self").exists() || Path::new("/proc").join(process.to_string()).exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart() {
        for target in ["out.wav", "a-b.7-1.part", &"x".repeat(250)] {
            let path = beside(Path::new(target), 4321, 7).unwrap();
            let want = beginning(Path::new(target)).unwrap();
            assert_eq!(writer(path.to_str().unwrap()), Some((want.as_str(), HOST.as_str(), 4321)));
        }
        for name in
            [".out.wav.h-12.part", ".out.wav.h-12-0", "h-12-0.part", ".out.h-x-0.part", ".out.h-12-x.part"]
        {
            assert_eq!(writer(name), None, "{name}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn only_files_of_dead_processes_and_of_the_same_output_are_leftovers() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        // Above the largest number that Linux gives to a process.
        let dead = (1 << 22) + 1;
        let stale = beside(&path("out"), dead, 0).unwrap();
        for file in [
            stale.clone(),
            beside(&path("other"), dead, 0).unwrap(),
            beside(&path("out"), std::process::id(), 0).unwrap(),
            path(".out.part"),
        ] {
            std::fs::write(file, "").unwrap();
        }
        let mine = Leftover { path: stale, process: dead, host: None };
        assert_eq!(leftovers(&[&path("out"), &path("none/out")]), std::slice::from_ref(&mine));
        assert!(mine.to_string().ends_with("which no longer runs; remove it"));
        // A process of another host may run: its number says nothing here.
        let theirs = path(&format!(".out.elsewhere-{dead}-0.part"));
        std::fs::write(&theirs, "").unwrap();
        let found = leftovers(&[&path("out")]);
        let said: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert!(found.len() == 2 && found.contains(&mine));
        assert!(said.iter().any(|s| s.ends_with("on the host elsewhere; remove it if that run has ended")));
    }
}
