//! The functions of `include/hybank.h`: pointers in, slices for the safe code.
//!
//! The caller promises what the header says: a bank is one that `hybank_open` returned and `hybank_close`
//! has not yet taken, no other thread uses it meanwhile, and arrays are as long as the header says and do
//! not overlap. NULL is refused where it can be recognised. These promises are the contract of every
//! function here.

#![allow(unsafe_op_in_unsafe_fn, reason = "each function has the one contract above")]

use crate::{FAILURE, Handle, INT16, count, kept};
use hybank::runtime::PcmOutput;
use std::ffi::{CStr, c_char, c_int};
use std::slice;

const NO_BANK: &str = "the bank is NULL; give what hybank_open returned";

/// A text of C.
unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, String> {
    if pointer.is_null() {
        return Err(format!("the {what} is NULL; give a text"));
    }
    // SAFETY: the caller promises a text that ends with a zero byte and outlives the call.
    let text = CStr::from_ptr(pointer);
    text.to_str().map_err(|_| format!("the {what} is not UTF-8"))
}

/// The bank that a pointer leads to.
unsafe fn handle<'a>(bank: *mut Handle) -> Result<&'a mut Handle, String> {
    // SAFETY: the caller promises NULL or an open bank that no other thread uses.
    bank.as_mut().ok_or_else(|| NO_BANK.to_owned())
}

/// A property of the bank that a pointer leads to; 0 for NULL.
unsafe fn ask(bank: *const Handle, of: impl FnOnce(&Handle) -> usize) -> usize {
    // SAFETY: as for `handle`.
    bank.as_ref().map_or(0, of)
}

/// An array of input.
unsafe fn input<'a, T>(pointer: *const T, len: usize) -> Result<&'a [T], String> {
    match (pointer.is_null(), len) {
        (_, 0) => Ok(&[]),
        (true, _) => Err("the input is NULL; give an array of frames * N samples".to_owned()),
        // SAFETY: the caller promises so many samples, and no array is longer than isize::MAX bytes.
        (false, _) => Ok(slice::from_raw_parts(pointer, len)),
    }
}

/// An array for output.
unsafe fn output<'a, T>(pointer: *mut T, len: usize) -> Result<&'a mut [T], String> {
    match (pointer.is_null(), len) {
        (_, 0) => Ok(&mut []),
        (true, _) => Err("the output is NULL; give room for frames * M samples".to_owned()),
        // SAFETY: the caller promises room for so many samples that nothing else reads or writes meanwhile.
        (false, _) => Ok(slice::from_raw_parts_mut(pointer, len)),
    }
}

/// `frames` times `samples`, in bytes at most what an array can have.
fn len(frames: usize, samples: usize, bytes: usize) -> Result<usize, String> {
    let len = frames.checked_mul(samples).filter(|len| len.saturating_mul(bytes) <= isize::MAX as usize);
    len.ok_or_else(|| format!("{frames} frames are more than memory can hold"))
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_open(
    path: *const c_char,
    algorithm: *const c_char,
    double_sums: c_int,
) -> *mut Handle {
    let open = || Handle::open(text(path, "path")?, text(algorithm, "algorithm")?, double_sums != 0);
    kept(open()).map_or(std::ptr::null_mut(), |handle| Box::into_raw(Box::new(handle)))
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_close(bank: *mut Handle) {
    if !bank.is_null() {
        // SAFETY: the caller promises a bank that `hybank_open` made by `Box::into_raw` and that was not
        // closed.
        drop(Box::from_raw(bank));
    }
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_channels(bank: *const Handle) -> usize {
    ask(bank, Handle::channels)
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_ratio(bank: *const Handle) -> usize {
    ask(bank, Handle::ratio)
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_latency(bank: *const Handle) -> usize {
    ask(bank, |handle| handle.stream.latency())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_flush_frames(bank: *const Handle) -> usize {
    ask(bank, |handle| handle.stream.plan().flush_frames())
}

/// The calls for one type of samples that the runtime takes as they are.
macro_rules! calls {
    ($sample:ty, $process:ident, $flush:ident) => {
        /// See the header.
        ///
        /// # Safety
        /// As the header says.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $process(
            bank: *mut Handle,
            from: *const $sample,
            frames: usize,
            to: *mut $sample,
        ) -> isize {
            let run = || {
                let handle = handle(bank)?;
                let [n, m] = [handle.channels(), handle.ratio()];
                let from = input(from, len(frames, n, size_of::<$sample>())?)?;
                let to = output(to, len(frames, m, size_of::<$sample>())?)?;
                handle.stream.process(from, to).map_err(|error| error.to_string())
            };
            count(run())
        }

        /// See the header.
        ///
        /// # Safety
        /// As the header says.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $flush(bank: *mut Handle, to: *mut $sample) -> isize {
            let run = || {
                let handle = handle(bank)?;
                handle.flush(output(to, handle.tail())?)
            };
            count(run())
        }
    };
}

calls!(f32, hybank_process, hybank_flush);
calls!(f64, hybank_process_double, hybank_flush_double);

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_process_int16(
    bank: *mut Handle,
    from: *const i16,
    frames: usize,
    to: *mut i16,
) -> isize {
    let run = || {
        let handle = handle(bank)?;
        let [n, m] = [handle.channels(), handle.ratio()];
        let from = input(from.cast::<u8>(), len(frames, 2 * n, 1)?)?;
        handle.process_int16(from, output(to.cast::<u8>(), len(frames, 2 * m, 1)?)?)
    };
    count(run())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_flush_int16(bank: *mut Handle, to: *mut i16) -> isize {
    let run = || {
        let handle = handle(bank)?;
        let bytes = output(to.cast::<u8>(), 2 * handle.tail())?;
        handle.flush(&mut PcmOutput::packed(INT16, bytes))
    };
    count(run())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_reset(bank: *mut Handle) {
    if let Some(handle) = kept(handle(bank)) {
        handle.stream.reset();
    }
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_error() -> *const c_char {
    FAILURE.with_borrow(|text| text.as_ptr())
}
