//! Opens inputs of every kind.

use super::byte_frames::ByteFrames;
use super::capture::{ByteSource, Capture, open_file};
use super::mat::{mat_variable, open_mat};
use super::npy::open_npy;
use super::pipe::{stdin_file, widen_pipe};
use super::sigmf::is_sigmf;
use super::sigmf_reader::SigmfReader;
use super::table::{TableOptions, TableReader, is_table};
use super::wav::WavReader;
use super::{Coding, IoError, PcmFormat, SampleLayout, StatedScale, StreamHeader, TimeInterleaving};
use crate::messages::Quoted;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// A kind of input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Sigmf,
    Csv,
    Npy,
    Mat,
    Flac,
    /// A recording that would have to be decoded or unpacked.
    Encoded,
    Raw,
    Wav,
}

impl Kind {
    /// Of an input of this name, which is of this coding if its name says nothing.
    fn of(path: &Path, coding: Coding) -> Self {
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.map(str::to_ascii_lowercase).as_deref() {
            _ if is_sigmf(path) => Self::Sigmf,
            Some("csv" | "tsv") => Self::Csv,
            Some("npy") => Self::Npy,
            Some("flac") if cfg!(feature = "flac") => Self::Flac,
            Some(
                "flac" | "mp3" | "aif" | "aiff" | "aifc" | "ogg" | "oga" | "opus" | "m4a" | "aac" | "sigmf",
            ) => Self::Encoded,
            _ if mat_variable(path).is_some() => Self::Mat,
            Some("wav" | "wave" | "bwf" | "rf64") => Self::Wav,
            _ => match coding {
                Coding::Csv => Self::Csv,
                Coding::Wav if is_table(path) => Self::Csv,
                Coding::Wav => Self::Wav,
                Coding::Raw(_) | Coding::Complex(_) => Self::Raw,
            },
        }
    }
}

/// True for inputs that state their own format and channels whatever the [`Coding`] is: names of WAV
/// files, SigMF recordings, tables, arrays, and recordings that are decoded.
pub fn is_self_describing(path: &Path) -> bool {
    Kind::of(path, Coding::Raw(PcmFormat::U8)) != Kind::Raw
}

/// An input to open, with its settings.
#[derive(Debug, Clone)]
pub(super) struct InputSource {
    pub(super) path: PathBuf,
    pub(super) coding: Coding,
    /// Number of channels if the input has no header and is not time-interleaved.
    pub(super) channels: usize,
    /// The converters whose samples are time-interleaved in the input, if they are.
    pub(super) interleaving: Option<TimeInterleaving>,
    /// Samples of each channel in a row that are a frame of the consumer.
    pub(super) per_frame: usize,
    /// The only channel to read, from 0.
    pub(super) only: Option<usize>,
    /// Pairs of channels are complex samples.
    pub(super) is_iq: bool,
    /// What is said of its full scale.
    pub(super) scale: StatedScale,
    /// How it is read if it is a table.
    pub(super) table: TableOptions,
    /// Bytes of a block.
    pub(super) block: usize,
}

impl InputSource {
    /// Name in messages to the user.
    pub(super) fn name(&self) -> String {
        if self.is_stdin() { "standard input".into() } else { self.path.display().to_string() }
    }

    pub(super) fn is_stdin(&self) -> bool {
        self.path.as_os_str() == "-"
    }

    pub(super) fn is_table(&self) -> bool {
        Kind::of(&self.path, self.coding) == Kind::Csv
    }

    /// True for inputs whose floats may be codes of a converter.
    pub(super) fn is_table_or_array(&self) -> bool {
        matches!(Kind::of(&self.path, self.coding), Kind::Csv | Kind::Npy | Kind::Mat)
    }

    /// Samples in a row that are a frame: one of each time-interleaved converter.
    pub(super) fn samples_per_frame(&self) -> usize {
        self.interleaving.as_ref().map_or(1, TimeInterleaving::converters)
    }

    /// Opens the input and reads its header; raw samples have none, and are opened when they are read.
    ///
    /// # Errors
    /// [`IoError`]: the system's refusal, or what is wrong with the header.
    pub(super) fn open(&self) -> Result<Box<dyn Capture>, IoError> {
        let (path, name) = (self.path.as_path(), self.name());
        Ok(match Kind::of(path, self.coding) {
            Kind::Sigmf => Box::new(ByteFrames::new(SigmfReader::open(path)?)),
            Kind::Csv => Box::new(TableReader::new(self.stream()?, &name, &self.table)?),
            Kind::Npy => Box::new(ByteFrames::new(open_npy(open_file(path)?, &name)?)),
            Kind::Mat => {
                let (file, variable) = mat_variable(path).unwrap_or_else(|| (path.to_owned(), None));
                Box::new(ByteFrames::new(open_mat(
                    &mut open_file(&file)?,
                    variable,
                    &file.display().to_string(),
                )?))
            }
            #[cfg(feature = "flac")]
            Kind::Flac => Box::new(super::flac::FlacReader::open(open_file(path)?, &name)?),
            #[cfg(not(feature = "flac"))]
            Kind::Flac => return Err(unread(path)),
            Kind::Encoded => return Err(unread(path)),
            Kind::Raw => Box::new(ByteFrames::new(RawReader { source: self.clone(), bytes: None })),
            Kind::Wav => Box::new(ByteFrames::new(WavReader::new(self.stream()?, &name)?)),
        })
    }

    /// Standard input or the file.
    fn stream(&self) -> Result<Box<dyn Read>, IoError> {
        if self.is_stdin() {
            return Ok(Box::new(stdin_file().map_err(IoError::system(&self.name(), "open it"))?));
        }
        let file = open_file(&self.path)?;
        widen_pipe(&file);
        Ok(Box::new(file))
    }
}

/// Refuses a recording, or a name that does not exist, which is the more useful message.
fn unread(path: &Path) -> IoError {
    let unfit = || {
        let flac = if cfg!(feature = "flac") { "" } else { "FLAC with the feature flac, " };
        IoError::unfit(&path.display().to_string())(format!(
            "it is not decoded here; give PCM ({flac}WAV, the .sigmf-meta of an archive, or a pipe: ffmpeg -i {} -f wav \
             -c:a pcm_f32le - | hybank fuse BANK.json -)",
            Quoted(path)
        ))
    };
    open_file(path).err().unwrap_or_else(unfit)
}

/// Raw samples. They are opened by the first read, since a FIFO waits for its writer.
struct RawReader {
    source: InputSource,
    bytes: Option<Box<dyn Read>>,
}

impl ByteSource for RawReader {
    fn stream_header(&self) -> StreamHeader {
        self.source.raw_header()
    }
}

impl InputSource {
    /// The header of raw samples: as the settings say.
    pub(super) fn raw_header(&self) -> StreamHeader {
        let layout = SampleLayout::packed(self.coding.format().unwrap_or(PcmFormat::F32Le));
        let channels = if self.interleaving.is_some() { 1 } else { self.channels };
        StreamHeader { is_complex: self.coding.is_complex(), ..StreamHeader::real(layout, channels) }
    }
}

impl Read for RawReader {
    /// A WAV header at the beginning is an error: raw samples look like one by chance in one of 2^64 cases.
    /// It is looked for in the first bytes that come; a header in pieces is not found.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if let Some(opened) = &mut self.bytes {
            return opened.read(bytes);
        }
        let opened = self.bytes.insert(self.source.stream()?);
        let count = opened.read(bytes)?;
        if matches!(bytes[..count], [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E', ..]) {
            let problem = "it begins with a WAV header, but raw samples are expected; give the format wav";
            return Err(IoError::unfit(&self.source.name())(problem.into()).into());
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::block::Block;

    #[test]
    fn only_a_wav_header_at_the_beginning_of_raw_samples_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let read = |bytes: &[u8]| {
            let path = folder.path().join("x");
            std::fs::write(&path, bytes).unwrap();
            let coding = Coding::Raw(PcmFormat::U8);
            let source = InputSource {
                path,
                coding,
                channels: 1,
                interleaving: None,
                per_frame: 1,
                only: None,
                is_iq: false,
                scale: StatedScale::default(),
                table: TableOptions::default(),
                block: 4096,
            };
            let mut block = Block::default();
            let mut capture = source.open().unwrap();
            block.begin(&capture.stream_header());
            while capture.read_block(4096, &mut block)? {}
            io::Result::Ok(block.frames())
        };
        let header = b"RIFF\x24\0\0\0WAVEfmt ";
        let error = read(header).unwrap_err().to_string();
        assert!(error.contains("x: it begins with a WAV header"), "{error}");
        assert_eq!(read(&header[1..]).unwrap(), 15);
        assert_eq!(read(&[&b"0123"[..], header].concat()).unwrap(), 20);
    }
}
