//! Denormal numbers count as 0 during a call.
//!
//! Processors of Intel handle denormals in microcode: a signal that fades away would run at a hundredth of
//! the usual speed. So the mode of the thread is set for the time of a call, on every processor, and the
//! bits agree everywhere. What a call gives depends on no mode that its caller has set.

/// Bits of MXCSR that count denormal operands as 0, and denormal results.
#[cfg(all(target_arch = "x86_64", not(miri)))]
const FLUSH: u64 = 1 << 6 | 1 << 15;
/// The bit of FPCR that does both.
#[cfg(all(target_arch = "aarch64", not(miri)))]
const FLUSH: u64 = 1 << 24;
/// Other processors have no such mode.
#[cfg(not(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri))))]
const FLUSH: u64 = 0;

/// Does `work` while denormals count as 0. The mode is as before then, also after a panic.
pub(crate) fn flushing<T>(work: impl FnOnce() -> T) -> T {
    let _before = Mode::change(FLUSH);
    work()
}

/// The mode to go back to.
struct Mode(u64);

impl Mode {
    /// Sets some bits, until the mode before is dropped.
    fn change(bits: u64) -> Self {
        let before = read();
        write(before | bits);
        Self(before)
    }
}

impl Drop for Mode {
    fn drop(&mut self) {
        write(self.0);
    }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
fn read() -> u64 {
    let mut bits = 0u32;
    // SAFETY: it stores four bytes at the address of `bits`.
    unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut bits, options(nostack, preserves_flags)) };
    bits.into()
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
fn write(bits: u64) {
    let bits = bits as u32;
    // SAFETY: the bits are those that were read, with those of the mode, which every x86-64 processor has.
    // Only kernels and copies of samples run until they are set back.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const bits, options(nostack, preserves_flags)) };
}

#[cfg(all(target_arch = "aarch64", not(miri)))]
fn read() -> u64 {
    let bits: u64;
    // SAFETY: it reads a register that every thread may read.
    unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) bits, options(nostack, nomem, preserves_flags)) };
    bits
}

#[cfg(all(target_arch = "aarch64", not(miri)))]
fn write(bits: u64) {
    // SAFETY: as for x86-64: the bits are those that were read, with that of the mode.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) bits, options(nostack, preserves_flags)) };
}

#[cfg(not(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri))))]
fn read() -> u64 {
    0
}

#[cfg(not(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri))))]
fn write(_: u64) {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    fn product() -> f32 {
        black_box(1e-30f32) * black_box(1e-10f32)
    }

    #[test]
    fn denormals_are_flushed_during_the_work_only() {
        assert!(product() > 0.0);
        if FLUSH != 0 {
            assert_eq!(flushing(product), 0.0);
            let caught = std::panic::catch_unwind(|| flushing(|| panic!("for this test")));
            assert!(caught.is_err());
        }
        assert!(product() > 0.0);
    }
}
