//! Signals that end a process, and what is removed before they do.
#![doc(hidden)]

use super::remove_unfinished;
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGQUIT, SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::iterator::Signals;
use std::io::IsTerminal;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Once};

/// What terminals, shells, timers, limits of the processor time and users send to end a process.
const ENDING: [i32; 10] =
    [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGXCPU, SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2];

/// From this call on, the signals that end a process (interrupt, termination, a lost terminal, the limit of
/// processor time, timers, user signals) remove its unfinished files before they end it with code
/// 128 + signal. Where no thread can be started, signals keep their default effect: the process ends, and
/// its unfinished files stay.
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

/// From this call on, a write beyond the limit of the file size (`ulimit -f`) fails as one to a full disk
/// does. By default the signal SIGXFSZ ends the process there, without a message.
pub fn fail_at_file_size_limit() {
    // The handler only has to exist. Where the system refuses it, the default effect stays.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// Hands the signals that end a process to `handle` on a thread of its own; false if that is impossible.
pub fn watch(handle: impl FnOnce(Signals) + Send + 'static) -> bool {
    let (sender, signals) = sync_channel::<Signals>(1);
    // The thread is started first: if that fails, signals keep their default effect.
    let run = move || signals.recv().map_or((), handle);
    if std::thread::Builder::new().name("signals".into()).spawn(run).is_err() {
        return false;
    }
    // The thread waits for them.
    let caught = ENDING.iter().filter(|&&signal| signal != SIGHUP || !outlives_terminal());
    Signals::new(caught).is_ok_and(|signals| sender.send(signals).is_ok())
}

/// Whether the process was started to go on without its terminal, as by `nohup`, with SIGHUP ignored. Where
/// that is unknown: `nohup` redirects the messages of a terminal to a file.
fn outlives_terminal() -> bool {
    let ignored = || {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        u64::from_str_radix(mask.trim(), 16).ok()
    };
    ignored().map_or_else(|| !std::io::stderr().is_terminal(), |mask| mask >> (SIGHUP - 1) & 1 == 1)
}

/// Ends the process as `signal` asks, without unfinished files.
pub fn end(signal: i32) -> ! {
    remove_unfinished();
    std::process::exit(128 + signal)
}
