//! Long computations that Ctrl-C interrupts, on a thread of their own or on this one.

use crate::errors::refused;
use hybank::design::{Stage, Stop};
use pyo3::prelude::*;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two checks for signals.
const POLL: Duration = Duration::from_millis(20);
/// Recursions of the solvers fit the stack of a main thread.
const STACK_BYTES: usize = 16 << 20;

enum DesignMessage<T> {
    /// A step begins.
    Stage(Stage),
    Done(T),
}

/// What a computation says while it runs.
pub(crate) struct Reporter<T> {
    sender: Sender<DesignMessage<T>>,
    stop: Stop,
}

impl<T> Reporter<T> {
    /// Reports that a step begins.
    pub(crate) fn begins(&self, stage: Stage) {
        // The receiver lives as long as somebody waits.
        let _ = self.sender.send(DesignMessage::Stage(stage));
    }

    /// Due when the result is no longer waited for.
    pub(crate) fn stop(&self) -> Stop {
        self.stop.clone()
    }
}

/// Runs `work` on a thread of its own, without the interpreter lock. A signal whose handler raises ends the
/// wait at once; a design ends with the round that it is in. `progress(step)` is called for every step.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Reporter<T>) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut messages) = mpsc::channel();
    let stop = Stop::default();
    let reporter = Reporter { sender, stop: stop.clone() };
    let thread = thread::Builder::new().name("hybank".into()).stack_size(STACK_BYTES);
    thread.spawn(move || {
        let result = work(&reporter);
        let _ = reporter.sender.send(DesignMessage::Done(result));
    })?;
    let mut wait = || loop {
        let inbox = &mut messages;
        match py.detach(move || inbox.recv_timeout(POLL)) {
            Ok(DesignMessage::Done(result)) => return Ok(result),
            Ok(DesignMessage::Stage(stage)) => report(progress, stage)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(refused("the computation ended without a result; this is a fault of hybank"));
            }
        }
        py.check_signals()?;
    };
    let result = wait();
    if result.is_err() {
        stop.now();
    }
    result
}

fn report(progress: Option<&Bound<'_, PyAny>>, stage: Stage) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    progress.call1((stage.to_string(),)).map(drop)
}

/// Time between two checks. Each waits for the interpreter lock, up to 5 ms while other threads keep it.
const EVERY: Duration = Duration::from_millis(100);

/// Checks for signals now and then, and keeps what a handler raised.
pub(crate) struct SignalCheck {
    state: Mutex<SignalState>,
}

struct SignalState {
    next: Instant,
    raised: Option<PyErr>,
}

impl SignalCheck {
    pub(crate) fn new() -> Self {
        Self { state: Mutex::new(SignalState { next: Instant::now() + EVERY, raised: None }) }
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
