//! Interrupts: Ctrl-C, SIGTERM and the other signals by which terminals, shells and supervisors end a
//! process.
//!
//! A program is in one of two states. While it computes, an interrupt ends it, with code 128 + signal. While
//! it reads what cannot be read again, or searches for something better than what it has, the first
//! interrupt asks it to end in order, and the next one ends it. Unfinished files go in both cases.

use std::sync::{Mutex, PoisonError};

/// How the first interrupt asks the program to end; `None` while it computes.
static REQUEST: Mutex<Option<Request>> = Mutex::new(None);

/// Says whether somebody was there to be asked.
type Request = Box<dyn FnOnce() -> bool + Send>;

/// From now on the first interrupt asks the program to end in order by `ask`. It ends the process if nobody
/// is there to be asked any more, and `ask` says so with false.
pub fn ask_first(ask: impl FnOnce() -> bool + Send + 'static) {
    *REQUEST.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(ask));
}

/// Asks the program to end in order; false if it computes.
#[cfg(unix)]
fn ask() -> bool {
    let request = REQUEST.lock().unwrap_or_else(PoisonError::into_inner).take();
    request.is_some_and(|ask| ask())
}

/// From here on interrupts are handled, and a write beyond the limit of the file size (`ulimit -f`) fails as
/// one to a full disk does. A program calls it once, at the beginning of its `main`. Where no thread can be
/// started, signals keep their default effect.
#[cfg(unix)]
pub fn handle() {
    // The handler only has to exist: by default this signal ends the process.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
    let (registered, all) = std::sync::mpsc::channel();
    let _ = std::thread::Builder::new().name("interrupts".into()).spawn(|| each_interrupt(registered));
    // A signal that comes while its handler is put in place may be lost. The sender only goes.
    let _ = all.recv();
}

/// Nothing, on a system without signals.
#[cfg(not(unix))]
pub fn handle() {}

#[cfg(unix)]
fn each_interrupt(registered: std::sync::mpsc::Sender<()>) {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    let caught = [SIGINT, SIGTERM, SIGQUIT, SIGHUP].into_iter();
    let caught = caught.filter(|&signal| signal != SIGHUP || !outlives_terminal());
    let Ok(mut signals) = signal_hook::iterator::Signals::new(caught) else { return };
    drop(registered);
    let mut is_asked = false;
    for signal in signals.forever() {
        // A lost terminal may be reported twice, by the system and by the shell.
        let is_repeated = is_asked && signal == SIGHUP;
        if !(is_repeated || ask()) {
            hybank_core::files::remove_unfinished();
            std::process::exit(128 + signal);
        }
        is_asked = true;
    }
}

/// Whether the process was started to go on without its terminal, as by `nohup`, with SIGHUP ignored; so it
/// is taken where that is unknown.
#[cfg(unix)]
fn outlives_terminal() -> bool {
    let ignored = || {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        u64::from_str_radix(mask.trim(), 16).ok()
    };
    ignored().is_none_or(|mask| mask >> (signal_hook::consts::SIGHUP - 1) & 1 == 1)
}
