//! The format of output samples, and the files that a run writes.

use super::Failure;
use super::bank_file::is_dash;
use super::say::name_leftovers;
use crate::files::refuse_overlaps;
use crate::io::{PcmFormat, SampleWriter, is_sigmf, mat_variable, sigmf_files};
use crate::runtime::Precision;
use std::path::Path;

/// Sample formats of a WAV output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Bits {
    /// 16-bit integers
    #[value(name = "16")]
    I16,
    /// 24-bit integers
    #[value(name = "24")]
    I24,
    /// 32-bit integers
    #[value(name = "32")]
    I32,
    /// 32-bit floats
    #[value(name = "32f")]
    F32,
    /// 64-bit floats
    #[value(name = "64f")]
    F64,
}

impl Bits {
    /// The sample format of this width.
    pub(super) fn format(self) -> PcmFormat {
        match self {
            Self::I16 => PcmFormat::S16Le,
            Self::I24 => PcmFormat::S24Le,
            Self::I32 => PcmFormat::S32Le,
            Self::F32 => PcmFormat::F32Le,
            Self::F64 => PcmFormat::F64Le,
        }
    }
}

/// Formats with more digits than f32 need sums in f64.
pub(super) fn precision(format: PcmFormat) -> Precision {
    use PcmFormat::{F64Be, F64Le, S32Be, S32Le};
    if matches!(format, F64Be | F64Le | S32Be | S32Le) { Precision::Double } else { Precision::Single }
}

/// Encoded formats, which are not written.
const ENCODED: [&str; 9] = ["flac", "mp3", "ogg", "oga", "opus", "m4a", "aac", "aif", "aiff"];

/// Refuses a name that promises another format than the one written.
fn check_extension(output: &Path) -> Result<(), Failure> {
    let extension = output.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let extension = extension.to_ascii_lowercase();
    if !ENCODED.contains(&extension.as_str()) {
        return Ok(());
    }
    let name = output.display();
    Err(Failure::Usage(format!(
        "{name}: the output is WAV or raw samples, not {extension}; write it to a pipe: hybank fuse .. -o - | sox -t wav - {name}"
    )))
}

/// Checks that no output of a run is also an input or another output.
pub(super) fn check_files(output: &Path, others: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    check_extension(output)?;
    let mut outputs = SampleWriter::files(output);
    outputs.extend(others.iter().copied().filter(|path| !is_dash(path)).map(Path::to_owned));
    let outputs: Vec<_> = outputs.iter().map(|path| path.as_path()).collect();
    // A SigMF recording has two files, and only one of them is named.
    let pairs: Vec<_> =
        inputs.iter().filter(|path| is_sigmf(path)).flat_map(|path| sigmf_files(path)).collect();
    // Of x.mat:name the file is x.mat.
    let arrays: Vec<_> = inputs.iter().filter_map(|path| mat_variable(path)).map(|(file, _)| file).collect();
    let more = pairs.iter().chain(&arrays).map(|path| path.as_path());
    let inputs: Vec<_> = inputs.iter().copied().chain(more).collect();
    refuse_overlaps(&outputs, &inputs).map_err(Failure::input)?;
    name_leftovers(&outputs);
    Ok(())
}
