//! The format of output samples, and the files that a run writes.

use super::choice::Choice;
use super::print::{Failure, failed, is_dash, warn};
use hybank::files::refuse_overlaps;
use hybank::io::{
    Container, IoError, OutputHeader, PcmFormat, SampleWriter, is_pipe, is_sigmf, mat_variable, sigmf_files,
};
use hybank::messages::Quoted;
use std::path::Path;

/// What `--bits` takes: sample formats of a WAV output.
pub(super) const WIDTHS: &[Choice<PcmFormat>] = &[
    Choice { name: "16", help: "16-bit integers", value: PcmFormat::S16Le },
    Choice { name: "24", help: "24-bit integers", value: PcmFormat::S24Le },
    Choice { name: "32", help: "32-bit integers", value: PcmFormat::S32Le },
    Choice { name: "32f", help: "32-bit floats", value: PcmFormat::F32Le },
    Choice { name: "64f", help: "64-bit floats", value: PcmFormat::F64Le },
];

/// Begins an output of samples, and says what its header cannot.
pub(super) fn begin_samples(path: &Path, header: OutputHeader, force: bool) -> Result<SampleWriter, IoError> {
    let writer = SampleWriter::create(path, header, force)?;
    writer.warning().into_iter().for_each(warn);
    Ok(writer)
}

/// Endings of WAV files.
pub(super) const WAV: [&str; 4] = ["wav", "wave", "bwf", "rf64"];
/// Endings of other formats, which are not written.
const OTHERS: [&str; 20] = [
    "flac", "mp3", "ogg", "oga", "opus", "m4a", "aac", "aif", "aiff", "aifc", "npy", "npz", "mat", "csv",
    "txt", "json", "toml", "h5", "hdf5", "zip",
];

/// Whether the name of a file says that it is WAV; pipes have any name.
pub(super) fn is_wav(output: &Path) -> bool {
    let extension = output.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    WAV.contains(&extension.to_ascii_lowercase().as_str()) && !is_pipe(output)
}

/// The container of a file of samples by its name.
pub(super) fn container_of(output: &Path) -> Container {
    let is_npy = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npy"));
    if is_npy && !is_pipe(output) { Container::Npy } else { Container::Wav }
}

/// Refuses a name that promises another format than the one written; pipes have any name.
fn check_extension(output: &Path, container: Container) -> Result<(), Failure> {
    let extension = output.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let extension = extension.to_ascii_lowercase();
    let remedy = match (extension.as_str(), container) {
        _ if is_pipe(output) => return Ok(()),
        ("sigmf-meta", _) | ("npy", Container::Npy) | ("", Container::Wav) => return Ok(()),
        ("sigmf" | "sigmf-data", _) => {
            format!("name it {}", Quoted(output.with_extension("sigmf-meta")))
        }
        (wav, Container::Wav) if WAV.contains(&wav) => return Ok(()),
        (wav, Container::Raw) if WAV.contains(&wav) => "give --output-format wav".to_owned(),
        (_, Container::Wav) => {
            let name = output.with_extension("wav");
            format!(
                "name it {}, or pipe it to what converts it: -o - | sox -t wav - {}",
                Quoted(name),
                Quoted(output)
            )
        }
        (other, Container::Raw) if OTHERS.contains(&other) => {
            format!("name it {}", Quoted(output.with_extension("raw")))
        }
        _ => return Ok(()),
    };
    let written = if container == Container::Wav { "WAV" } else { "raw samples" };
    let (name, extension) = (Quoted(output), Quoted(&extension));
    Err(Failure::Usage(format!("{name}: the output is {written}, not {extension}; {remedy}")))
}

/// Checks that no output of a run is also an input or another output, and that the name of the samples says
/// what they are in.
pub(super) fn check_files(
    output: &Path,
    container: Container,
    others: &[&Path],
    inputs: &[&Path],
) -> Result<(), Failure> {
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
    refuse_overlaps(&outputs, &inputs).map_err(failed)?;
    check_extension(output, container)
}
