//! Signals that end a process, and what is removed before they do.

use super::remove_unfinished;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::sync::Once;
use std::sync::mpsc::sync_channel;

/// From this call on, SIGINT and SIGTERM remove the unfinished files of this process before they end it with
/// code 128 + signal. Where no thread can be started, signals keep their default effect: the process ends,
/// and its unfinished files stay.
pub fn remove_unfinished_on_signals() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        watch(|mut signals| {
            if let Some(signal) = signals.forever().next() {
                end(signal);
            }
        });
    });
}

/// Hands the signals SIGINT and SIGTERM to `handle` on a thread of its own; false if that is impossible.
pub(crate) fn watch(handle: impl FnOnce(Signals) + Send + 'static) -> bool {
    let (sender, signals) = sync_channel::<Signals>(1);
    // The thread is started first: if that fails, signals keep their default effect.
    let run = move || signals.recv().map_or((), handle);
    if std::thread::Builder::new().name("signals".into()).spawn(run).is_err() {
        return false;
    }
    // The thread waits for them.
    Signals::new([SIGINT, SIGTERM]).is_ok_and(|signals| sender.send(signals).is_ok())
}

/// Ends the process as `signal` asks, without unfinished files.
pub(crate) fn end(signal: i32) -> ! {
    remove_unfinished();
    std::process::exit(128 + signal)
}
