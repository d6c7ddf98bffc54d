//! The C interface: see `include/hybank.h`. Everything here is safe code; pointers become slices in [`abi`].

#[allow(unsafe_code, reason = "C passes pointers")]
mod abi;

use hybank_core::bank::Bank;
use hybank_core::files::{SPEC_OR_BANK, read_text};
use hybank_core::messages::shown;
use hybank_core::runtime::{
    Algorithm, Options, PcmFormat, PcmFrames, PcmOutput, Precision, SampleLayout, Stream,
};
use std::cell::RefCell;
use std::ffi::CString;
use std::path::Path;

/// 16-bit samples in the byte order of this machine.
const INT16: PcmFormat = PcmFormat::S16Le.native();

/// A stream through the bank of a file.
fn open(path: &str, algorithm: &str, double_sums: bool) -> Result<Stream, String> {
    let text = read_text(Path::new(path), SPEC_OR_BANK).map_err(|error| error.to_string())?;
    let bank = Bank::from_json(&text, path).map_err(|error| error.to_string())?;
    let precision = if double_sums { Precision::Double } else { Precision::Single };
    let algorithm = algorithm.parse::<Algorithm>().map_err(|error| format!("algorithm: {error}"))?;
    let options = Options { precision, algorithm: algorithm.without_added_latency(), ..Options::default() };
    let plan = bank.plan(options).map_err(|error| format!("{path}: {error}"))?;
    Ok(Stream::new(&plan))
}

/// Samples that a flush writes.
fn tail(stream: &Stream) -> usize {
    stream.plan().flush_frames() * stream.ratio()
}

/// Frames of 16-bit samples as bytes.
fn process_int16(stream: &mut Stream, input: &[u8], output: &mut [u8]) -> Result<usize, String> {
    let layout = SampleLayout::packed(INT16);
    let input = PcmFrames { layout, channels: stream.channels(), bytes: input };
    stream.run(&input, &mut PcmOutput::packed(INT16, output)).map_err(|error| error.to_string())
}

thread_local! {
    /// The text of `hybank_error`.
    static FAILURE: RefCell<CString> = RefCell::default();
}

/// The samples written, or -1 with the reason kept for `hybank_error`.
fn count(result: Result<usize, String>) -> isize {
    kept(result).and_then(|count| isize::try_from(count).ok()).unwrap_or(-1)
}

/// The value; of a failure the text is kept for `hybank_error`.
fn kept<T>(result: Result<T, String>) -> Option<T> {
    result.map_err(|text| keep(&text)).ok()
}

fn keep(text: &str) {
    // A text without zeros is a C string, and none is left in what is shown.
    let text = CString::new(shown(text)).unwrap_or_default();
    FAILURE.with_borrow_mut(|kept| *kept = text);
}
