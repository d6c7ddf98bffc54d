//! Where fast samples go: a file or SigMF recording that appears when whole, or standard output.

use super::Failure;
use crate::io::wav::{WavFile, stream_header};
use crate::io::{AtomicFile, IoError, PcmFormat, SigmfMeta, stdout_file};
use crate::runtime::Precision;
use std::io::{self, IsTerminal, Write};
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
    /// How samples of this width are stored.
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

/// Formats with more digits than f32 sums have want sums in f64.
pub(super) fn precision(format: PcmFormat) -> Precision {
    use PcmFormat::{F64Be, F64Le, S32Be, S32Le};
    if matches!(format, F64Be | F64Le | S32Be | S32Le) { Precision::Double } else { Precision::Single }
}

/// What surrounds the samples of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Container {
    Wav,
    Raw,
}

/// The open end.
enum Target {
    Wav(WavFile<AtomicFile>),
    Raw(AtomicFile),
    Stdout(Box<dyn Write>),
    /// Raw samples, and the metadata beside them.
    Sigmf {
        data: AtomicFile,
        meta: AtomicFile,
        text: String,
    },
}

/// One channel of fast samples.
pub(super) struct FastWriter {
    target: Target,
    name: String,
    format: PcmFormat,
    bytes: u64,
}

impl FastWriter {
    /// Begins the output at `rate` hertz; `-` is standard output, where a WAV header tells no length, and a
    /// name that ends in sigmf-meta is a SigMF recording.
    pub(super) fn create(
        path: &Path,
        container: Container,
        format: PcmFormat,
        rate: f64,
        force: bool,
    ) -> Result<Self, Failure> {
        let to_stdout = path.as_os_str() == "-";
        let name = if to_stdout { "standard output".into() } else { path.display().to_string() };
        let create = || AtomicFile::create(path, force).map_err(Failure::input);
        let target = match container {
            _ if is_sigmf(path) => Ok(sigmf_target(path, format, rate, force)?),
            Container::Wav if to_stdout => {
                stream_header(format, 1, wav_rate(rate)?).and_then(|header| stdout_target(&header))
            }
            Container::Wav => WavFile::new(create()?, format, 1, wav_rate(rate)?).map(Target::Wav),
            Container::Raw if to_stdout => stdout_target(&[]),
            Container::Raw => Ok(Target::Raw(create()?)),
        };
        let target = target.map_err(|error| failure(&name, error))?;
        Ok(Self { target, name, format, bytes: 0 })
    }

    /// How samples are to be encoded.
    pub(super) fn format(&self) -> PcmFormat {
        self.format
    }

    /// Samples written.
    pub(super) fn samples(&self) -> u64 {
        self.bytes / self.format.bytes() as u64
    }

    /// Appends encoded samples.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let written = match &mut self.target {
            Target::Wav(file) => file.write_bytes(bytes),
            Target::Raw(file) => file.write_all(bytes),
            Target::Stdout(stdout) => stdout.write_all(bytes),
            Target::Sigmf { data, .. } => data.write_all(bytes),
        };
        self.bytes += bytes.len() as u64;
        written.map_err(|error| failure(&self.name, error))
    }

    /// Completes the sizes and gives the file its name.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let told = |error| failure(&self.name, error);
        match self.target {
            Target::Wav(file) => file.finish().map_err(told)?.commit().map_err(Failure::input),
            Target::Raw(file) => file.commit().map_err(Failure::input),
            Target::Stdout(mut stdout) => stdout.flush().map_err(told),
            Target::Sigmf { data, mut meta, text } => {
                meta.write_all(text.as_bytes()).map_err(told)?;
                data.commit().map_err(Failure::input)?;
                meta.commit().map_err(Failure::input)
            }
        }
    }
}

/// True for the name of a recording's metadata.
pub(super) fn is_sigmf(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "sigmf-meta")
}

fn sigmf_target(path: &Path, format: PcmFormat, rate: f64, force: bool) -> Result<Target, Failure> {
    let meta = AtomicFile::create(path, force).map_err(Failure::input)?;
    let data = AtomicFile::create(&path.with_extension("sigmf-data"), force).map_err(Failure::input)?;
    let text = serde_json::to_string_pretty(&SigmfMeta::for_output(format, rate));
    Ok(Target::Sigmf { data, meta, text: text.map_err(Failure::input)? + "\n" })
}

/// The nearest rate that a WAV header can say.
fn wav_rate(rate: f64) -> Result<u32, Failure> {
    if rate > f64::from(u32::MAX) {
        return Err(Failure::Input(format!(
            "the fast rate of {rate} Hz does not fit a WAV header; give the output a name that ends in sigmf-meta, or write raw samples with `hybank stream`"
        )));
    }
    Ok(rate.round().max(1.0) as u32)
}

/// Standard output for samples, which a terminal cannot show.
fn stdout_target(header: &[u8]) -> io::Result<Target> {
    if io::stdout().is_terminal() {
        return Err(io::Error::other("it is a terminal; redirect it to a file or a pipe"));
    }
    let mut stdout = stdout_file()?;
    stdout.write_all(header)?;
    Ok(Target::Stdout(Box::new(stdout)))
}

/// A reader that went away ends the run quietly; everything else is told.
pub(super) fn failure(name: &str, error: io::Error) -> Failure {
    match IoError::system(name, "write it")(error) {
        error if error.is_closed_pipe() => Failure::ClosedPipe,
        error => Failure::input(error),
    }
}
