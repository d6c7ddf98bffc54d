//! Counts the multiply-adds of the kernels, for tests of the worst case of a call: times would depend on the
//! machine.

use std::cell::Cell;

thread_local! {
    static MULTIPLY_ADDS: Cell<usize> = const { Cell::new(0) };
}

/// A kernel of this thread does so many, padding not counted.
pub(crate) fn add(multiply_adds: usize) {
    MULTIPLY_ADDS.set(MULTIPLY_ADDS.get() + multiply_adds);
}

/// Those that `call` does on this thread.
pub(crate) fn of(call: impl FnOnce()) -> usize {
    MULTIPLY_ADDS.set(0);
    call();
    MULTIPLY_ADDS.get()
}
