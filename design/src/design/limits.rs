//! What a caller who waits for a design sees and says: the step that it is in, and its end before it is
//! complete.

use hybank_core::spec::Spec;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The usual limit: a design that takes longer ends with what it has.
pub const TIME_LIMIT: Duration = Duration::from_secs(600);

/// Maximum number of states of an error system whose certificate is searched in 512 bits: some seconds per
/// gamma that is tried.
pub(super) const MAX_LONG_STATES: usize = 96;
/// Maximum number of states of a plant whose filtering Riccati equation is solved with 106 bits; a step then
/// takes tens of milliseconds, and a trial about a second unless a channel is delayed by many periods.
pub(super) const MOST_STATES_AT_106_BITS: usize = 96;
/// The same for 512 bits.
pub(super) const MOST_STATES_AT_512_BITS: usize = 40;

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

    /// The same, due after the time of a limit as well.
    pub(super) fn within(&self, limit: Option<Duration>) -> Self {
        let deadline = limit.and_then(|time| Instant::now().checked_add(time));
        Self { deadline, asked: Arc::clone(&self.asked) }
    }
}

/// What makes the design of a spec shorter.
pub fn remedy(spec: &Spec) -> &'static str {
    if spec.is_fir() {
        "leave out bits and [uncertainty], or use fewer taps, a smaller ratio or fewer channels"
    } else {
        "use a shorter latency, a smaller ratio, fewer channels, or the method fir"
    }
}
