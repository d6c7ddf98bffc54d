//! Writes one channel of samples to standard output or a FIFO, or to a file or SigMF recording that appears
//! only when it is complete.

use super::npy_writer::NpyFile;
use super::sigmf::malformed;
use super::wav::{WavFile, stream_header};
use super::{IoError, OutputNotes, PcmFormat, SigmfMeta, is_pipe, is_same_rate, open_fifo, stdout_file};
use crate::files::{AtomicFile, is_same_file};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// The container format of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Container {
    /// A WAV header.
    Wav,
    /// The header of a NumPy array.
    Npy,
    /// Nothing.
    Raw,
}

/// What an output holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputHeader {
    /// The container; a SigMF recording is one by its name.
    pub container: Container,
    /// Format of the numbers.
    pub format: PcmFormat,
    /// Each sample is two numbers. In WAV these are two channels.
    pub is_complex: bool,
    /// Hertz.
    pub rate: f64,
}

/// The open destination.
enum Target {
    Wav(WavFile<AtomicFile>),
    Npy(NpyFile<AtomicFile>),
    /// Raw samples, and the metadata beside those of a SigMF recording.
    Raw {
        data: AtomicFile,
        meta: Option<AtomicFile>,
    },
    /// Standard output or a FIFO.
    Stream(Box<dyn Write + Send>),
}

/// A writer of one channel of encoded samples.
pub struct SampleWriter {
    target: Target,
    header: OutputHeader,
    name: String,
    notes: OutputNotes,
    warning: Option<String>,
}

impl SampleWriter {
    /// Begins an output. `-` is standard output. There and in a FIFO, which waits for its
    /// reader, a WAV header states no length. A name that ends in sigmf-meta is a SigMF recording. `replace`
    /// allows files to be replaced.
    ///
    /// # Errors
    /// [`IoError`] for files that exist or cannot be created, for samples or rates that WAV cannot hold,
    /// and for a standard output that is a terminal.
    pub fn create(path: &Path, header: OutputHeader, replace: bool) -> Result<Self, IoError> {
        let to_stdout = path.as_os_str() == "-";
        let is_stream = to_stdout || is_fifo(path);
        let name = if to_stdout { "standard output".into() } else { path.display().to_string() };
        let refused = || IoError::system(&name, "write it");
        let mut warning = None;
        let target = match header.container {
            _ if is_sigmf_meta(path) => {
                let meta = Some(AtomicFile::create(path, replace)?);
                Target::Raw { data: AtomicFile::create(&path.with_extension("sigmf-data"), replace)?, meta }
            }
            Container::Wav => {
                let OutputHeader { format, is_complex, rate, .. } = header;
                let (channels, hertz) = (if is_complex { 2 } else { 1 }, wav_rate(&name, rate)?);
                warning = rounding(&name, rate, hertz);
                if is_stream {
                    let header = stream_header(format, channels, hertz).map_err(refused())?;
                    stream_target(path, &header).map_err(refused())?
                } else {
                    let file = AtomicFile::create(path, replace)?;
                    Target::Wav(WavFile::new(file, format, channels, hertz).map_err(refused())?)
                }
            }
            Container::Npy if is_stream => {
                return Err(IoError::unfit(&name)(
                    "an array states its length first, which a pipe cannot take; write WAV".into(),
                ));
            }
            Container::Npy => {
                Target::Npy(NpyFile::new(AtomicFile::create(path, replace)?, header).map_err(refused())?)
            }
            Container::Raw if is_stream => stream_target(path, &[]).map_err(refused())?,
            Container::Raw => Target::Raw { data: AtomicFile::create(path, replace)?, meta: None },
        };
        Ok(Self { target, header, name, notes: OutputNotes::default(), warning })
    }

    /// What the header cannot say exactly.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// The files that have no final name yet.
    pub fn unfinished(&mut self) -> impl Iterator<Item = &mut AtomicFile> {
        let files = match &mut self.target {
            Target::Wav(file) => [Some(file.inner_mut()), None],
            Target::Npy(file) => [Some(file.inner_mut()), None],
            Target::Raw { data, meta } => [Some(data), meta.as_mut()],
            Target::Stream(_) => [None, None],
        };
        files.into_iter().flatten()
    }

    /// The files that an output of this name has: none for `-`, two for a SigMF recording.
    pub fn files(path: &Path) -> Vec<PathBuf> {
        match path {
            _ if path.as_os_str() == "-" => Vec::new(),
            _ if is_sigmf_meta(path) => vec![path.to_owned(), path.with_extension("sigmf-data")],
            _ => vec![path.to_owned()],
        }
    }

    /// Appends encoded samples.
    ///
    /// # Errors
    /// The system's refusal.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), IoError> {
        let written = match &mut self.target {
            Target::Wav(file) => file.write_bytes(bytes),
            Target::Npy(file) => file.write_bytes(bytes),
            Target::Raw { data, .. } => data.write_all(bytes),
            Target::Stream(stream) => stream.write_all(bytes),
        };
        written.map_err(IoError::system(&self.name, "write it"))
    }

    /// What is to accompany the samples, where the output has room for it: SigMF and WAV files.
    pub fn annotate(&mut self, notes: OutputNotes) {
        self.notes = notes;
    }

    /// Completes headers and metadata. The caller must commit the returned files, which do not have their
    /// final names yet.
    ///
    /// # Errors
    /// The system's refusal.
    pub fn finish(self) -> Result<Vec<AtomicFile>, IoError> {
        let refused = IoError::system(&self.name, "write it");
        match self.target {
            Target::Wav(file) => Ok(vec![file.finish(&self.notes.chunks).map_err(refused)?]),
            Target::Npy(file) => Ok(vec![file.finish().map_err(refused)?]),
            Target::Stream(mut stream) => stream.flush().map(|()| Vec::new()).map_err(refused),
            Target::Raw { data, meta: None } => Ok(vec![data]),
            Target::Raw { data, meta: Some(mut meta) } => {
                let text = sigmf_text(&self.name, self.header, self.notes)?;
                meta.write_all(text.as_bytes()).map_err(refused)?;
                Ok(vec![data, meta])
            }
        }
    }
}

/// A pipe other than standard output, whose name is `-`.
fn is_fifo(path: &Path) -> bool {
    is_pipe(path) && !is_same_file(path, Path::new("/dev/stdout"))
}

fn is_sigmf_meta(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "sigmf-meta")
}

/// The metadata of an output called `file`.
fn sigmf_text(file: &str, header: OutputHeader, mut notes: OutputNotes) -> Result<String, IoError> {
    let OutputHeader { format, is_complex, rate, .. } = header;
    let mut meta = SigmfMeta::for_output(format, is_complex, rate);
    // The order that SigMF asks for.
    notes.annotations.sort_by_key(|annotation| annotation.sample_start);
    meta.global.other = notes.global;
    if !notes.captures.is_empty() {
        meta.captures = notes.captures;
    }
    let fault = |error: serde_json::Error| malformed(file, error.to_string());
    let annotations = notes.annotations.iter().map(serde_json::to_value).collect::<Result<_, _>>();
    meta.annotations = annotations.map_err(fault)?;
    Ok(serde_json::to_string_pretty(&meta).map_err(fault)? + "\n")
}

/// The nearest rate that a WAV header can state.
fn wav_rate(file: &str, rate: f64) -> Result<u32, IoError> {
    if rate > f64::from(u32::MAX) {
        return Err(IoError::unfit(file)(format!(
            "the rate of {rate} Hz does not fit a WAV header; give the output a name that ends in sigmf-meta, or write \
             raw samples with `hybank stream`"
        )));
    }
    Ok(rate.round().max(1.0) as u32)
}

/// That the header of an output called `file` states another rate than its own.
fn rounding(file: &str, rate: f64, hertz: u32) -> Option<String> {
    (!is_same_rate(f64::from(hertz), rate, 0.0))
        .then(|| format!("{file}: WAV headers hold whole hertz: {rate} Hz is written as {hertz} Hz"))
}

/// Standard output (`-`) or a FIFO for samples; refuses a terminal.
fn stream_target(path: &Path, header: &[u8]) -> io::Result<Target> {
    let to_stdout = path.as_os_str() == "-";
    if to_stdout && io::stdout().is_terminal() {
        return Err(io::Error::other("it is a terminal; redirect it to a file or a pipe"));
    }
    let mut stream: Box<dyn Write + Send> =
        if to_stdout { Box::new(stdout_file()?) } else { Box::new(open_fifo(path)?) };
    stream.write_all(header)?;
    Ok(Target::Stream(stream))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_the_header_rounds_is_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        let warning = |name: &str, rate: f64| {
            let header =
                OutputHeader { container: Container::Wav, format: PcmFormat::F32Le, is_complex: false, rate };
            let writer = SampleWriter::create(&folder.path().join(name), header, false).unwrap();
            writer.warning().map(str::to_owned)
        };
        assert_eq!(warning("x.wav", 48_000.000_01), None);
        assert_eq!(warning("x.sigmf-meta", 10.4), None);
        let said = warning("x.wav", 10.4).unwrap();
        assert!(said.ends_with("x.wav: WAV headers hold whole hertz: 10.4 Hz is written as 10 Hz"), "{said}");
    }
}
