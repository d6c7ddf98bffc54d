//! What a caller who waits for a design sees and says: the step that it is in, its time and memory, and its
//! end before it is complete.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The usual limit: a design whose estimate is longer is refused, and one that takes longer ends with what
/// it has.
pub const TIME_LIMIT: Duration = Duration::from_secs(600);

/// Operations per second of factorisations and products of large real matrices on one core
/// (docs/figures.md).
const OPERATIONS_PER_SECOND: f64 = 1e10;

/// Maximum number of states of an error system whose certificate is searched in 512 bits: some seconds per
/// gamma that is tried.
pub(super) const MAX_LONG_STATES: usize = 96;
/// Maximum number of states of a plant whose filtering Riccati equation is solved with 106 bits; a step then
/// takes tens of milliseconds, and a trial about a second unless a channel is delayed by many periods.
pub(super) const MOST_STATES_AT_106_BITS: usize = 96;
/// The same for 512 bits.
pub(super) const MOST_STATES_AT_512_BITS: usize = 40;

/// Ratio of the ends of a time up to which it is said as one.
const MUCH_THE_SAME: f64 = 1.5;

/// Whether a design is refused when its estimate exceeds a time or the free memory, and ended at that time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Limits {
    /// It is, at [`TIME_LIMIT`].
    #[default]
    Enforced,
    /// It is, at another time.
    Within(Duration),
    /// It runs all the same.
    Off,
}

impl Limits {
    /// The time, if there is a limit.
    pub fn time(self) -> Option<Duration> {
        match self {
            Self::Enforced => Some(TIME_LIMIT),
            Self::Within(time) => Some(time),
            Self::Off => None,
        }
    }
}

/// A step of a design that may take long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// The latency or the number of taps is chosen; so many designs were compared.
    Latency {
        /// Designs so far.
        designs: usize,
    },
    /// The method computes the filters.
    Filters,
    /// Order reduction, integer taps, and the form that runs fastest.
    Realisation,
    /// The search for a proof.
    Proof,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Latency { designs: 0 } => write!(f, "choosing the latency"),
            Self::Latency { designs } => write!(f, "choosing the latency ({designs} designs compared)"),
            Self::Filters => write!(f, "designing the filters"),
            Self::Realisation => write!(f, "realising the filters"),
            Self::Proof => write!(f, "searching for a proof of gamma"),
        }
    }
}

/// Ends a design before it is complete, with the best filters so far and without a proof. Clones end the
/// same design, from any thread. It takes effect between two rounds of a search, and between two sample
/// points of a problem that an interior-point method solves.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    deadline: Option<Instant>,
    asked: Arc<AtomicBool>,
}

impl Stop {
    /// Ends the design.
    pub fn now(&self) {
        self.asked.store(true, Ordering::Relaxed);
    }

    /// Whether the design is to end.
    pub fn is_due(&self) -> bool {
        self.asked.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// The same, due after the time of the limits as well where they hold.
    pub(super) fn within(&self, limits: Limits) -> Self {
        let deadline = limits.time().and_then(|time| Instant::now().checked_add(time));
        Self { deadline, asked: Arc::clone(&self.asked) }
    }
}

/// Time and memory that a design needs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Least seconds on one core.
    pub shortest: f64,
    /// Most seconds on one core.
    pub longest: f64,
    /// Bytes at the peak.
    pub bytes: f64,
}

/// A number that is known within bounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    pub(super) least: f64,
    pub(super) most: f64,
}

impl Effort {
    /// So many operations at the rate of dense linear algebra.
    pub(super) fn of(operations: f64, bytes: f64) -> Self {
        Self {
            shortest: operations / OPERATIONS_PER_SECOND,
            longest: operations / OPERATIONS_PER_SECOND,
            bytes,
        }
    }

    /// One step after the other; the memory of the first one is free again.
    pub(super) fn then(self, next: Self) -> Self {
        let (shortest, longest) = (self.shortest + next.shortest, self.longest + next.longest);
        Self { shortest, longest, bytes: self.bytes.max(next.bytes) }
    }

    /// A step that some designs take afterwards.
    pub(super) fn perhaps(self, next: Self) -> Self {
        self.then(Self { shortest: 0.0, ..next })
    }

    /// The same so many times.
    pub(super) fn times(self, count: Range) -> Self {
        Self { shortest: count.least * self.shortest, longest: count.most * self.longest, ..self }
    }

    /// "80 ms to 12 seconds", to two digits each; one time where the ends are much the same.
    pub fn time(self) -> String {
        let [shortest, longest] = [self.shortest, self.longest].map(|seconds| rounded(seconds, &TIMES));
        if self.longest <= MUCH_THE_SAME * self.shortest {
            longest
        } else {
            format!("{shortest} to {longest}")
        }
    }
}

const TIMES: [(f64, &str); 5] =
    [(1e-3, "ms"), (1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86_400.0, "days")];

impl fmt::Display for Effort {
    /// "35 minutes and 8.7 GB", to two digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {}", self.time(), memory_text(self.bytes))
    }
}

/// So long, to two digits.
pub(super) fn time_text(time: Duration) -> String {
    rounded(time.as_secs_f64(), &TIMES)
}

/// So many bytes, to two digits.
pub(super) fn memory_text(bytes: f64) -> String {
    rounded(bytes, &[(1e6, "MB"), (1e9, "GB"), (1e12, "TB"), (1e15, "PB")])
}

/// A quantity to two digits, in the largest of the units of which there are at least one and a half.
fn rounded(value: f64, units: &[(f64, &str)]) -> String {
    let (size, name) = units.iter().rev().find(|(size, _)| value >= 1.5 * size).unwrap_or(&units[0]);
    let number = value / size;
    let decimals = usize::from(number < 9.95);
    format!("{number:.decimals$} {name}")
}
