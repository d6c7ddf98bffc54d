//! Ctrl-C and SIGTERM: the first one requests an orderly end, the second one ends the process at once.

use crossbeam_channel::Receiver;

#[cfg(unix)]
mod watch {
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
        let (signal_sender, signals) = bounded::<Signals>(1);
        // The thread is started first: if that fails, signals keep their default effect.
        let watch = move || {
            if let Ok(signals) = signals.recv() {
                until_the_end(signals, &stop_sender);
            }
        };
        if std::thread::Builder::new().name("signals".into()).spawn(watch).is_err() {
            return never();
        }
        match Signals::new([SIGINT, SIGTERM]) {
            Ok(signals) => {
                // The thread waits for them.
                let _ = signal_sender.send(signals);
                stop
            }
            Err(_) => never(),
        }
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

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub(super) fn interrupts() -> Receiver<()> {
    crossbeam_channel::never()
}
