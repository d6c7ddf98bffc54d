//! Interrupts: Ctrl-C, SIGTERM and the other signals that end a process. In a run the first one requests an
//! orderly end, and the second one ends the process at once. In a computation the first one ends it at once.

use super::print::say_line;
#[cfg(not(unix))]
use crossbeam_channel::Receiver;
use hybank::files::remove_unfinished as remove_unfinished_files;

#[cfg(unix)]
mod watch {
    use super::end_with;
    use crossbeam_channel::{Receiver, Sender, bounded, never};
    use hybank::files::is_output_stalled;
    use hybank::files::signals::{end, watch};
    use signal_hook::consts::{SIGHUP, SIGXCPU};
    use signal_hook::iterator::Signals;
    use std::time::Duration;

    /// Time after the first signal for which a write to standard output or standard error may block.
    const PATIENCE: Duration = Duration::from_secs(2);
    const STEP: Duration = Duration::from_millis(50);

    /// A channel that receives a message at the first interrupt. A second interrupt ends the process. The
    /// first one also ends it if the reader of standard output or standard error takes no data. Unfinished
    /// files are removed.
    pub(crate) fn interrupts() -> Receiver<()> {
        let (stop_sender, stop) = bounded(1);
        if watch(move |signals| until_the_end(signals, &stop_sender)) { stop } else { never() }
    }

    /// From now on an interrupt ends the process at once, with a message and exit code 1. Unfinished files
    /// are removed.
    pub(crate) fn end_at_interrupt() {
        watch(|mut signals| {
            if signals.forever().next().is_some() {
                end_with("interrupted");
            }
        });
    }

    fn until_the_end(mut signals: Signals, stop: &Sender<()>) {
        let Some(first) = signals.forever().next() else { return };
        // The receiver lives as long as the run.
        let _ = stop.send(());
        loop {
            // A lost terminal may be reported twice, by the system and by the shell; the limit of processor
            // time is reported every second.
            if let Some(second) = signals.pending().find(|signal| ![SIGHUP, SIGXCPU].contains(signal)) {
                end(second);
            }
            // The run is blocked by a reader of its output and does not notice the request.
            if is_output_stalled(PATIENCE) {
                end(first);
            }
            std::thread::sleep(STEP);
        }
    }
}

#[cfg(unix)]
pub(super) use watch::{end_at_interrupt, interrupts};

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub(super) fn end_at_interrupt() {}

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub(super) fn interrupts() -> Receiver<()> {
    crossbeam_channel::never()
}

/// Ends the process with a message and exit code 1. Unfinished files are removed.
pub(super) fn end_with(reason: &str) -> ! {
    // The message may wait for its reader, the files must not.
    let written = remove_unfinished_files();
    let after = if written.is_empty() {
        String::new()
    } else {
        format!(" after {} was written", written.join(" and "))
    };
    say_line(&format!("{reason}{after}; no unfinished file is left"));
    std::process::exit(1);
}

/// From now on an interrupt removes unfinished files before it ends the process; for commands whose work
/// cannot be stopped half-way.
pub(super) fn remove_unfinished() {
    #[cfg(unix)]
    hybank::files::remove_unfinished_on_signals();
}
