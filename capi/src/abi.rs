//! The functions of `include/hybank.h`: pointers in, slices for the safe code.
//!
//! The caller promises what the header says: a bank is one that `hybank_open` returned and `hybank_close`
//! has not yet taken, no other thread uses it meanwhile, and arrays are as long as the header says and do
//! not overlap. NULL is refused where it can be recognised. These promises are the contract of every
//! function here.

#![allow(unsafe_op_in_unsafe_fn, reason = "each function has the one contract above")]

use crate::{FAILURE, INT16, count, kept, open, process_int16, tail};
use hybank_core::runtime::{PcmOutput, Stream};
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

/// The stream through the bank that a pointer leads to.
unsafe fn stream<'a>(bank: *mut Stream) -> Result<&'a mut Stream, String> {
    // SAFETY: the caller promises NULL or an open bank that no other thread uses.
    bank.as_mut().ok_or_else(|| NO_BANK.to_owned())
}

/// A property of the bank that a pointer leads to; 0 for NULL.
unsafe fn ask(bank: *const Stream, of: impl FnOnce(&Stream) -> usize) -> usize {
    // SAFETY: as for `stream`.
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
) -> *mut Stream {
    let opened = || open(text(path, "path")?, text(algorithm, "algorithm")?, double_sums != 0);
    kept(opened()).map_or(std::ptr::null_mut(), |stream| Box::into_raw(Box::new(stream)))
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_close(bank: *mut Stream) {
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
pub unsafe extern "C" fn hybank_channels(bank: *const Stream) -> usize {
    ask(bank, Stream::channels)
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_ratio(bank: *const Stream) -> usize {
    ask(bank, Stream::ratio)
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_latency(bank: *const Stream) -> usize {
    ask(bank, |stream| stream.plan().latency())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_flush_frames(bank: *const Stream) -> usize {
    ask(bank, |stream| stream.plan().flush_frames())
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
            bank: *mut Stream,
            from: *const $sample,
            frames: usize,
            to: *mut $sample,
        ) -> isize {
            let run = || {
                let stream = stream(bank)?;
                let [n, m] = [stream.channels(), stream.ratio()];
                let from = input(from, len(frames, n, size_of::<$sample>())?)?;
                let to = output(to, len(frames, m, size_of::<$sample>())?)?;
                stream.process(from, to).map_err(|error| error.to_string())
            };
            count(run())
        }

        /// See the header.
        ///
        /// # Safety
        /// As the header says.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $flush(bank: *mut Stream, to: *mut $sample) -> isize {
            let run = || {
                let stream = stream(bank)?;
                stream.flush(&mut output(to, tail(stream))?).map_err(|error| error.to_string())
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
    bank: *mut Stream,
    from: *const i16,
    frames: usize,
    to: *mut i16,
) -> isize {
    let run = || {
        let stream = stream(bank)?;
        let [n, m] = [stream.channels(), stream.ratio()];
        let from = input(from.cast::<u8>(), len(frames, 2 * n, 1)?)?;
        process_int16(stream, from, output(to.cast::<u8>(), len(frames, 2 * m, 1)?)?)
    };
    count(run())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_flush_int16(bank: *mut Stream, to: *mut i16) -> isize {
    let run = || {
        let stream = stream(bank)?;
        let bytes = output(to.cast::<u8>(), 2 * tail(stream))?;
        stream.flush(&mut PcmOutput::packed(INT16, bytes)).map_err(|error| error.to_string())
    };
    count(run())
}

/// See the header.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hybank_reset(bank: *mut Stream) {
    if let Some(stream) = kept(stream(bank)) {
        stream.reset();
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
