//! Errors of a spec: the location in the file and the problem.

use std::fmt;
use std::ops::Range;

use super::FilterProblem;
use crate::messages::{Location, Number, Quoted};
use crate::quantity::QuantityError;

/// The error of a spec that cannot be used: the file, the location in it, and the problem.
///
/// Displays as `file:line:column: path: problem` with the offending line below.
#[derive(Debug, Clone, PartialEq)]
pub struct SpecError {
    inner: Box<Inner>,
}

#[derive(Debug, Clone, PartialEq)]
struct Inner {
    file: String,
    path: String,
    location: Option<Location>,
    problem: SpecProblem,
    overridden: bool,
}

/// A problem with its path and location.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub(crate) path: String,
    pub(crate) span: Option<Range<usize>>,
    /// Boxed to keep the result of every reading function small.
    pub(crate) problem: Box<SpecProblem>,
    /// The value is an override: `path` is its key, and the location in the document does not apply.
    pub(crate) overridden: bool,
}

impl Fault {
    /// A problem with the value that overrides the document's `key`.
    pub(crate) fn overriding(key: &'static str, problem: SpecProblem) -> Self {
        Self { path: key.to_owned(), span: None, problem: Box::new(problem), overridden: true }
    }
}

/// The rule that a spec violates, with the offending value and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecProblem {
    /// The text is not TOML (or JSON) at all.
    #[error("{}", Quoted(.message))]
    Syntax {
        /// The parser's message.
        message: String,
    },
    /// A measurement that cannot be read or modelled.
    #[error("{message}")]
    Measurement {
        /// File, reason and remedy.
        message: String,
    },
    /// A key that no table of this kind has.
    #[error(
        "unknown key \"{}\"{}{}; the keys here are {}",
        Quoted(.key),
        suggestion(.nearest),
        elsewhere(.homes),
        .known.join(", ")
    )]
    UnknownKey {
        /// The key as written.
        key: String,
        /// The tables that have this very key.
        homes: Vec<&'static str>,
        /// A known key with a similar spelling.
        nearest: Option<&'static str>,
        /// All known keys.
        known: Vec<&'static str>,
    },
    /// A required key is missing.
    #[error("the key {key} is missing; {remedy}")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// What to write.
        remedy: &'static str,
    },
    /// A value of the wrong type.
    #[error("expected {expected}, found {found}")]
    WrongType {
        /// The expected type.
        expected: &'static str,
        /// The type found.
        found: &'static str,
    },
    /// A name that is not on the list.
    #[error("unknown {what} \"{}\"{}; choose one of {}", Quoted(.name), suggestion(.nearest), .known.join(", "))]
    UnknownName {
        /// What the name stands for.
        what: &'static str,
        /// The name as written.
        name: String,
        /// A known name with a similar spelling.
        nearest: Option<&'static str>,
        /// All known names.
        known: Vec<&'static str>,
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
    /// A list of values to fit that cannot be.
    #[error("{message}")]
    Fit {
        /// The rule and the remedy.
        message: String,
    },
    /// One table where there is one for each converter.
    #[error(
        "[{key}] is a single table, and each converter has one of its own; head each with two brackets, [[{key}]]"
    )]
    SingleTable {
        /// The key of the tables.
        key: &'static str,
    },
    /// A filter table without any filter.
    #[error(
        "the filter is empty; give num and den, or poles and gain, or a, b and c, or family and cutoff, or cascade"
    )]
    EmptyFilter,
    /// A sample rate in no simple ratio to the fast rate.
    #[error(
        "a rate of {} Hz is in no simple ratio to the fast rate of {} Hz, so that the instants of the samples \
         do not repeat; a rate near it is {}", Number(*.rate), Number(*.fast), rates(.near)
    )]
    Rate {
        /// The offending rate.
        rate: f64,
        /// The fast rate.
        fast: f64,
        /// A rate near it.
        near: Vec<f64>,
    },
    /// Sample rates whose frames are too long.
    #[error(
        "the rates make frames of {ratio} fast samples, with {} samples of the converters; {rule}; rates near these \
         with short frames are {}", list(.samples), rates(.near)
    )]
    Frame {
        /// Fast samples per frame.
        ratio: u64,
        /// Samples of each converter per frame.
        samples: Vec<u64>,
        /// The limit and other remedies.
        rule: String,
        /// Rates near these, in hertz.
        near: Vec<f64>,
    },
    /// A text that is not the quantity it should be.
    #[error(transparent)]
    Quantity(#[from] QuantityError),
    /// A filter that violates a rule for filters.
    #[error(transparent)]
    Filter(#[from] FilterProblem),
}

/// A problem of a table, and the key that causes it.
#[derive(Debug)]
pub(super) struct KeyProblem {
    pub(super) key: &'static str,
    pub(super) problem: SpecProblem,
}

impl From<KeyProblem> for SpecProblem {
    fn from(of_key: KeyProblem) -> Self {
        of_key.problem
    }
}

pub(super) fn blame(key: &'static str, checked: Result<(), SpecProblem>) -> Result<(), KeyProblem> {
    checked.map_err(|problem| KeyProblem { key, problem })
}

fn list(samples: &[u64]) -> String {
    samples.iter().map(u64::to_string).collect::<Vec<_>>().join(" and ")
}

fn rates(near: &[f64]) -> String {
    near.iter().map(|rate| format!("{} Hz", Number(*rate))).collect::<Vec<_>>().join(" and ")
}

fn suggestion(nearest: &Option<&'static str>) -> String {
    nearest.map(|key| format!(", did you mean \"{key}\"?")).unwrap_or_default()
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
pub(crate) fn shown_path(path: &str) -> String {
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

impl SpecError {
    /// A problem with the span of `text` that it is about.
    pub(super) fn new(
        file: &str,
        text: &str,
        span: Option<Range<usize>>,
        path: String,
        problem: SpecProblem,
    ) -> Self {
        let fault = Fault { path, span, problem: Box::new(problem), overridden: false };
        Self::of(file, text, fault)
    }

    /// A fault that was found in `text`.
    pub(super) fn of(file: &str, text: &str, fault: Fault) -> Self {
        let Fault { path, span, problem, overridden } = fault;
        let location = span.map(|span| Location::find(text, span));
        Self {
            inner: Box::new(Inner { file: file.to_owned(), path, location, problem: *problem, overridden }),
        }
    }

    /// The key, such as `fraction_bits`, if the problem is a value that overrides the one in the file.
    pub fn overridden(&self) -> Option<&str> {
        self.inner.overridden.then_some(self.inner.path.as_str())
    }

    /// The file name as it was given.
    pub fn file(&self) -> &str {
        &self.inner.file
    }

    /// The path of keys to the value, such as `channel[1].filter.den`; empty for the whole file.
    pub fn path(&self) -> &str {
        &self.inner.path
    }

    /// Line and column.
    pub fn location(&self) -> Option<&Location> {
        self.inner.location.as_ref()
    }

    /// The rule that is violated.
    pub fn problem(&self) -> &SpecProblem {
        &self.inner.problem
    }
}

impl std::error::Error for SpecError {}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Inner { file, path, location, problem, overridden } = &*self.inner;
        let file = Quoted(file);
        if *overridden {
            return write!(f, "{file}: the {path} that overrides the file's: {problem}");
        }
        write!(f, "{file}:")?;
        if let Some(location) = location {
            write!(f, "{}:{}:", location.line, location.column)?;
        }
        if !path.is_empty() {
            write!(f, " {}:", Quoted(shown_path(path)))?;
        }
        write!(f, " {problem}")?;
        location.as_ref().map_or(Ok(()), |location| write!(f, "\n{location}"))
    }
}
