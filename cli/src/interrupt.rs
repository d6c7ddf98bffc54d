//! Interrupts as messages: of a recording of live input, and of a design that has something already.

use crossbeam_channel::{Receiver, bounded};
use hybank_program::interrupts::ask_first;

/// A channel that receives a message at the first interrupt. Once it is dropped an interrupt ends the
/// process, as before.
pub(super) fn interrupts() -> Receiver<()> {
    let (sender, receiver) = bounded(1);
    ask_first(move || sender.try_send(()).is_ok());
    receiver
}
