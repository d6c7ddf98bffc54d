//! Signals, Ctrl-C among them, while a computation works without the interpreter lock.

use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two checks. Each waits for the interpreter lock, up to 5 ms while other threads keep it.
const EVERY: Duration = Duration::from_millis(100);

/// Checks for signals now and then, and keeps what a handler raised.
pub(crate) struct Signals {
    state: Mutex<State>,
}

struct State {
    next: Instant,
    raised: Option<PyErr>,
}

impl Signals {
    pub(crate) fn new() -> Self {
        Self { state: Mutex::new(State { next: Instant::now() + EVERY, raised: None }) }
    }

    /// Whether the handler of a signal raised. To be called without the interpreter lock.
    pub(crate) fn raised(&self) -> bool {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        if state.raised.is_none() && now >= state.next {
            state.raised = Python::attach(|py| py.check_signals()).err();
            state.next = now + EVERY;
        }
        state.raised.is_some()
    }

    /// What the handler raised.
    pub(crate) fn into_error(self) -> Option<PyErr> {
        self.state.into_inner().unwrap_or_else(PoisonError::into_inner).raised
    }
}
