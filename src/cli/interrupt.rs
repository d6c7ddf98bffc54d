//! Ctrl-C: the first one is a wish, the second an order.

use super::Failure;
use crossbeam_channel::Receiver;

/// A channel that speaks at the first interrupt; the second one ends the process.
#[cfg(unix)]
pub(super) fn interrupts() -> Result<Receiver<()>, Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let (tell, stop) = crossbeam_channel::bounded(1);
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]).map_err(Failure::input)?;
    std::thread::spawn(move || {
        for (count, signal) in signals.forever().enumerate() {
            if count > 0 {
                std::process::exit(128 + signal);
            }
            // The receiver lives as long as the run.
            let _ = tell.send(());
        }
    });
    Ok(stop)
}

#[cfg(not(unix))]
pub(super) fn interrupts() -> Result<Receiver<()>, Failure> {
    Ok(crossbeam_channel::never())
}
