//! Refused documents: the location in the file and the problem.

use std::fmt;

use crate::messages::{Location, Number, Quoted};

/// A document that was refused: its file (empty for what is in memory), the place in it, and the problem.
///
/// Displays as `file:line:column: path: problem`, with the offending line below where it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    inner: Box<Inner>,
}

#[derive(Debug, Clone, PartialEq)]
struct Inner {
    file: String,
    path: String,
    location: Option<Location>,
    overridden: bool,
    problem: SpecProblem,
}

/// A spec that was refused.
pub type SpecError = Refusal;

/// The rule that a spec violates, with the offending value and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecProblem {
    /// A text that is not TOML, or a value that is not of its kind.
    #[error("{message}")]
    Value {
        /// What is wrong.
        message: String,
    },
    /// A key that no table of this kind has, or a name that is not on the list.
    #[error(
        "unknown {what} \"{}\"{}{}; the {what}s here are {}",
        Quoted(.name),
        suggestion(.nearest),
        elsewhere(.homes),
        .known.join(", ")
    )]
    Unknown {
        /// "key" or "name".
        what: &'static str,
        /// As it is written.
        name: String,
        /// A known one with a similar spelling.
        nearest: Option<String>,
        /// The tables that have this very key.
        homes: Vec<&'static str>,
        /// All known ones.
        known: Vec<String>,
    },
    /// A required key is missing.
    #[error("the key {key} is missing; {remedy}")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// What to write.
        remedy: &'static str,
    },
    /// Two keys that exclude each other.
    #[error("both {first} and {second} are given; {remedy}")]
    Conflict {
        /// One of the two.
        first: &'static str,
        /// The other.
        second: &'static str,
        /// Which one to remove.
        remedy: &'static str,
    },
    /// A number outside its range.
    #[error("{} {unit} is out of range: {rule}", Number(*.value))]
    Range {
        /// The offending value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// The rule and the remedy.
        rule: String,
    },
    /// A key that the chosen method does not read.
    #[error("{key} has no meaning for the method {method}; remove it or choose the method {remedy}")]
    NeedlessKey {
        /// The key.
        key: &'static str,
        /// Name of the method.
        method: &'static str,
        /// Names of methods that read the key.
        remedy: &'static str,
    },
}

/// Says at which path of keys a value breaks a rule.
pub trait At<T> {
    /// The same with the path in the error.
    fn at(self, path: &str) -> Result<T, SpecError>;
}

impl<T> At<T> for Result<T, SpecProblem> {
    fn at(self, path: &str) -> Result<T, SpecError> {
        self.map_err(|problem| Refusal::new(path, problem))
    }
}

/// A value that breaks a rule in words.
pub fn refused(path: &str, rule: impl Into<String>) -> SpecError {
    Refusal::new(path, SpecProblem::Value { message: rule.into() })
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|key| format!(", did you mean \"{key}\"?")).unwrap_or_default()
}

/// Where a key would be right.
fn elsewhere(homes: &[&str]) -> String {
    match homes {
        [] => String::new(),
        [one] => format!(", which belongs {one}"),
        [more @ .., last] => format!(", which belongs {} or {last}", more.join(", ")),
    }
}

/// A path of keys as people read it: channels count from 1, `channel[0].delay` is `channel 1.delay`.
fn shown_path(path: &str) -> String {
    path.split('.')
        .map(|part| channel_from_one(part).unwrap_or_else(|| part.to_owned()))
        .collect::<Vec<_>>()
        .join(".")
}

fn channel_from_one(part: &str) -> Option<String> {
    let (list, rest) = part.split_once('[')?;
    let (index, rest) = rest.split_once(']')?;
    let index: usize = index.parse().ok()?;
    matches!(list, "channel" | "channels").then(|| format!("channel {}{rest}", index + 1))
}

impl Refusal {
    /// A problem with the value at a path of keys.
    pub(crate) fn new(path: impl Into<String>, problem: SpecProblem) -> Self {
        let (file, path) = (String::new(), path.into());
        Self { inner: Box::new(Inner { file, path, location: None, overridden: false, problem }) }
    }

    /// The same problem, of a part of the value at `outer`.
    pub(crate) fn inside(mut self, outer: &str) -> Self {
        let parts = [outer, &self.inner.path].into_iter().filter(|part| !part.is_empty());
        self.inner.path = parts.collect::<Vec<_>>().join(".");
        self
    }

    /// The same problem, of the document of this name.
    pub(crate) fn in_file(mut self, file: &str) -> Self {
        self.inner.file = file.to_owned();
        self
    }

    /// The same problem, at a known location.
    pub(crate) fn located(mut self, location: Option<Location>) -> Self {
        self.inner.location = location;
        self
    }

    /// The same problem, of the value that overrides that of the file.
    pub(super) fn of_override(mut self, key: &str) -> Self {
        (self.inner.path, self.inner.overridden) = (key.to_owned(), true);
        self
    }

    /// The same with the tables that have an unknown key.
    pub(super) fn with_homes(mut self, tables_with: fn(&str) -> Vec<&'static str>) -> Self {
        if let SpecProblem::Unknown { what: "key", name, homes, .. } = &mut self.inner.problem {
            *homes = tables_with(name);
        }
        self
    }

    /// The key, such as `fraction_bits`, if the problem is a value that overrides the one in the file.
    pub fn overridden(&self) -> Option<&str> {
        self.inner.overridden.then_some(self.inner.path.as_str())
    }

    /// The path of keys to the value, such as `channel[1].filter.den`; empty for the whole document.
    pub fn path(&self) -> &str {
        &self.inner.path
    }

    /// Line and column, where they are known.
    pub fn location(&self) -> Option<&Location> {
        self.inner.location.as_ref()
    }

    /// The rule that is violated.
    pub fn problem(&self) -> &SpecProblem {
        &self.inner.problem
    }
}

impl std::error::Error for Refusal {}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Inner { file, path, location, overridden, problem } = &*self.inner;
        if *overridden {
            return write!(f, "{}: the {path} that overrides the file's: {problem}", Quoted(file));
        }
        let mut place = Quoted(file).to_string();
        if let Some(Location { line, column, .. }) = location {
            place += &format!(":{line}:{column}");
        }
        for part in [place, Quoted(shown_path(path)).to_string()] {
            if !part.is_empty() {
                write!(f, "{part}: ")?;
            }
        }
        write!(f, "{problem}")?;
        location.as_ref().map_or(Ok(()), |location| write!(f, "\n{location}"))
    }
}
