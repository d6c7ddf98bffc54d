//! Time and memory, and how they are written.

use std::fmt;

/// Time and memory that a design needs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Seconds on one core.
    pub seconds: f64,
    /// Bytes at the peak.
    pub bytes: f64,
}

impl Effort {
    /// One step after the other; the memory of the first one is free again.
    pub(super) fn then(self, next: Self) -> Self {
        Self { seconds: self.seconds + next.seconds, bytes: self.bytes.max(next.bytes) }
    }

    /// So many times the same step.
    pub(super) fn times(self, count: f64) -> Self {
        Self { seconds: self.seconds * count, ..self }
    }

    /// So many of the same kind, all of them kept.
    pub(super) fn each(self, count: f64) -> Self {
        Self { seconds: self.seconds * count, bytes: self.bytes * count }
    }

    /// Both at the same time.
    pub(super) fn with(self, other: Self) -> Self {
        Self { seconds: self.seconds + other.seconds, bytes: self.bytes + other.bytes }
    }
}

impl fmt::Display for Effort {
    /// "35 minutes and 8.7 GB", to two digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {}", Rounded(self.seconds, &TIMES), Rounded(self.bytes, &MEMORIES))
    }
}

const TIMES: [(f64, &str); 5] =
    [(1e-3, "ms"), (1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86_400.0, "days")];
const MEMORIES: [(f64, &str); 4] = [(1e6, "MB"), (1e9, "GB"), (1e12, "TB"), (1e15, "PB")];

/// A quantity to two digits, in the largest of the units of which there are at least one and a half.
pub(in crate::design) struct Rounded<'a>(f64, &'a [(f64, &'static str)]);

impl Rounded<'_> {
    /// So many bytes.
    pub(in crate::design) fn memory(bytes: f64) -> Self {
        Rounded(bytes, &MEMORIES)
    }
}

impl fmt::Display for Rounded<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, units) = self;
        let (size, name) = units.iter().rev().find(|(size, _)| *value >= 1.5 * size).unwrap_or(&units[0]);
        let number = value / size;
        let decimals = usize::from(number < 9.95);
        write!(f, "{number:.decimals$} {name}")
    }
}
