//! Where fast samples go: a WAV file or SigMF recording that appears when whole, or standard output.

use super::Failure;
use crate::io::wav::{WavFile, stream_header};
use crate::io::{AtomicFile, IoError, PcmFormat, SigmfMeta, stdout_file};
use crate::runtime::Reconstructor;
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
    fn format(self) -> PcmFormat {
        match self {
            Self::I16 => PcmFormat::S16Le,
            Self::I24 => PcmFormat::S24Le,
            Self::I32 => PcmFormat::S32Le,
            Self::F32 => PcmFormat::F32Le,
            Self::F64 => PcmFormat::F64Le,
        }
    }

    /// More digits than f32 sums have.
    pub(super) fn needs_double(self) -> bool {
        matches!(self, Self::I32 | Self::F64)
    }
}

/// The open end.
enum Target {
    File(WavFile<AtomicFile>),
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
    /// Begins the output at `rate` hertz; `-` is standard output, with a header of unknown length.
    pub(super) fn create(path: &Path, bits: Bits, rate: u32, force: bool) -> Result<Self, Failure> {
        let format = bits.format();
        let name =
            if path.as_os_str() == "-" { "standard output".into() } else { path.display().to_string() };
        let target = if path.as_os_str() == "-" {
            stdout_target(format, rate)
        } else if path.extension().is_some_and(|extension| extension == "sigmf-meta") {
            Ok(sigmf_target(path, format, rate, force)?)
        } else {
            let file = AtomicFile::create(path, force).map_err(Failure::input)?;
            WavFile::new(file, format, 1, rate).map(Target::File)
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
            Target::File(file) => file.write_bytes(bytes),
            Target::Stdout(stdout) => stdout.write_all(bytes),
            Target::Sigmf { data, .. } => data.write_all(bytes),
        };
        self.bytes += bytes.len() as u64;
        written.map_err(|error| failure(&self.name, error))
    }

    /// Completes the sizes and gives the file its name.
    pub(super) fn finish(self) -> Result<(), Failure> {
        match self.target {
            Target::File(file) => {
                let file = file.finish().map_err(|error| failure(&self.name, error))?;
                file.commit().map_err(Failure::input)
            }
            Target::Stdout(mut stdout) => stdout.flush().map_err(|error| failure(&self.name, error)),
            Target::Sigmf { data, mut meta, text } => {
                meta.write_all(text.as_bytes()).map_err(|error| failure(&self.name, error))?;
                data.commit().map_err(Failure::input)?;
                meta.commit().map_err(Failure::input)
            }
        }
    }
}

fn sigmf_target(path: &Path, format: PcmFormat, rate: u32, force: bool) -> Result<Target, Failure> {
    let meta = AtomicFile::create(path, force).map_err(Failure::input)?;
    let data = AtomicFile::create(&path.with_extension("sigmf-data"), force).map_err(Failure::input)?;
    let text = serde_json::to_string_pretty(&SigmfMeta::for_output(format, f64::from(rate)));
    Ok(Target::Sigmf { data, meta, text: text.map_err(Failure::input)? + "\n" })
}

/// Standard output for samples, which a terminal cannot show.
pub(super) fn open_stdout() -> io::Result<Box<dyn Write>> {
    if io::stdout().is_terminal() {
        return Err(io::Error::other("it is a terminal; redirect it to a file or a pipe"));
    }
    Ok(Box::new(stdout_file()?))
}

fn stdout_target(format: PcmFormat, rate: u32) -> io::Result<Target> {
    let mut stdout = open_stdout()?;
    stdout.write_all(&stream_header(format, 1, rate)?)?;
    Ok(Target::Stdout(stdout))
}

/// A reader that went away ends the run quietly; everything else is told.
pub(super) fn failure(name: &str, error: io::Error) -> Failure {
    match IoError::system(name, "write it")(error) {
        error if error.is_closed_pipe() => Failure::ClosedPipe,
        error => Failure::input(error),
    }
}

/// What a run had to tolerate, in words; `lossless` is the option that would have kept clipped samples.
pub(super) fn run_warnings(stream: &Reconstructor, clipped: u64, lossless: &str) -> Vec<String> {
    [
        (stream.replaced(), "input samples were NaN or infinite and were replaced by 0".to_owned()),
        (clipped, format!("output samples were clipped; {lossless} keeps them")),
        (stream.state_resets(), "times the filter state was not finite and began anew".to_owned()),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} {what}"))
    .collect()
}
