//! Ctrl-C and SIGTERM. In a run the first one requests an orderly end, and the second one ends the process at
//! once. In a computation the first one ends it at once.

use crossbeam_channel::Receiver;

#[cfg(unix)]
mod watch {
    use crate::cli::say::say_line;
    use crate::files::remove_unfinished;
    use crate::io::is_stdout_stalled;
    use crossbeam_channel::{Receiver, Sender, bounded, never};
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use std::time::Duration;

    /// Time after the first signal for which a write to standard output may block.
    const PATIENCE: Duration = Duration::from_secs(2);
    const STEP: Duration = Duration::from_millis(50);

    /// See [`super::interrupts`].
    pub(super) fn start() -> Receiver<()> {
        let (stop_sender, stop) = bounded(1);
        if watched(move |signals| until_the_end(signals, &stop_sender)) { stop } else { never() }
    }

    /// See [`super::end_at_interrupt`].
    pub(super) fn end_at_first() {
        watched(|mut signals| {
            if signals.forever().next().is_some() {
                say_line("interrupted; nothing was written");
                remove_unfinished();
                std::process::exit(1);
            }
        });
    }

    /// Whether a thread does `watch` with the signals.
    fn watched(watch: impl FnOnce(Signals) + Send + 'static) -> bool {
        let (signal_sender, signals) = bounded::<Signals>(1);
        // The thread is started first: if that fails, signals keep their default effect.
        let wait = move || {
            if let Ok(signals) = signals.recv() {
                watch(signals);
            }
        };
        if std::thread::Builder::new().name("signals".into()).spawn(wait).is_err() {
            return false;
        }
        // The thread waits for them.
        Signals::new([SIGINT, SIGTERM]).is_ok_and(|signals| signal_sender.send(signals).is_ok())
    }

    fn until_the_end(mut signals: Signals, stop: &Sender<()>) {
        let Some(first) = signals.forever().next() else { return };
        // The receiver lives as long as the run.
        let _ = stop.send(());
        loop {
            if let Some(second) = signals.pending().next() {
                end(second);
            }
            // The run is blocked by the reader of its output and does not notice the request.
            if is_stdout_stalled(PATIENCE) {
                end(first);
            }
            std::thread::sleep(STEP);
        }
    }

    fn end(signal: i32) -> ! {
        remove_unfinished();
        std::process::exit(128 + signal)
    }
}

/// A channel that receives a message at the first interrupt. A second interrupt ends the process. The first
/// one also ends it if the reader of standard output takes no data. Unfinished files are removed.
#[cfg(unix)]
pub(super) fn interrupts() -> Receiver<()> {
    watch::start()
}

/// From now on an interrupt ends the process at once, with a message and exit code 1. Unfinished files are
/// removed.
#[cfg(unix)]
pub(super) fn end_at_interrupt() {
    watch::end_at_first();
}

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub(super) fn end_at_interrupt() {}

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub(super) fn interrupts() -> Receiver<()> {
    crossbeam_channel::never()
}
