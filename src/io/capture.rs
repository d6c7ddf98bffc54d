//! N channels of slow samples from one or several WAV files, WAV streams or SigMF recordings.

use super::sigmf::{SigmfMeta, Timeline, file_pair, is_sigmf};
use super::wav::{WavHeader, WavNote, WavReader};
use super::{IoError, PcmFormat, PcmFrames, SampleLayout};
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A fault that was tolerated, with the name of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CaptureNote {
    /// The bytes are not all there.
    Wav {
        /// Name of the file.
        file: String,
        /// What is missing.
        note: WavNote,
    },
    /// The file is longer than the shortest.
    Left {
        /// Name of the file.
        file: String,
        /// Frames that were not used.
        frames: u64,
        /// False where the file's length is unknown, so that there may be more.
        exact: bool,
    },
}

impl fmt::Display for CaptureNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wav { file, note } => write!(f, "{file}: {note}"),
            Self::Left { file, frames, exact } => {
                let at_least = if *exact { "" } else { "at least " };
                write!(
                    f,
                    "{file}: longer than the shortest channel, {at_least}{frames} samples a channel were left"
                )
            }
        }
    }
}

/// One file, read in blocks.
struct Part {
    name: String,
    reader: WavReader<Box<dyn Read + Send>>,
    bytes: Vec<u8>,
    filled: usize,
    /// Frames read so far.
    frames: u64,
}

impl Part {
    /// A SigMF recording, its time counted from `origin`.
    fn open_sigmf(path: &Path, origin: u64) -> Result<Self, IoError> {
        let (meta_path, _) = file_pair(path, None);
        let meta = SigmfMeta::read(&meta_path)?;
        let (_, data_path) = file_pair(path, Some(&meta));
        let name = data_path.display().to_string();
        let format = meta.format(&meta_path.display().to_string())?;
        let channels = meta.global.num_channels.unwrap_or(1).max(1);
        let rate = meta.global.sample_rate.unwrap_or(0.0).round().clamp(0.0, f64::from(u32::MAX)) as u32;
        let file = File::open(&data_path).map_err(IoError::system(&name, "open it"))?;
        let timeline =
            Timeline::new(file, &meta, format, channels, &meta_path.display().to_string(), origin)?;
        let (inner, format): (Box<dyn Read + Send>, _) = match timeline {
            Ok(timeline) => (Box::new(timeline), PcmFormat::F64Le),
            Err(file) => (Box::new(file), format),
        };
        let reader = WavReader::headerless(inner, SampleLayout::packed(format), channels, rate);
        Ok(Self { name, reader, bytes: Vec::new(), filled: 0, frames: 0 })
    }

    fn open(path: &Path) -> Result<Self, IoError> {
        let from_stdin = path.as_os_str() == "-";
        let name = if from_stdin { "standard input".to_owned() } else { path.display().to_string() };
        let inner: Box<dyn Read + Send> = if from_stdin {
            Box::new(io::stdin())
        } else {
            Box::new(File::open(path).map_err(IoError::system(&name, "open it"))?)
        };
        // The header is read in small pieces; the bytes behind it are read past the buffer.
        let reader = WavReader::new(Box::new(io::BufReader::with_capacity(4096, inner)) as Box<_>, &name)?;
        Ok(Self { name, reader, bytes: Vec::new(), filled: 0, frames: 0 })
    }

    fn fill(&mut self, frames: usize) -> Result<usize, IoError> {
        let size = self.reader.header().frame_bytes();
        self.bytes.resize(frames * size, 0);
        let filled = self.reader.frames().fill(&mut self.bytes);
        self.filled = filled.map_err(IoError::system(&self.name, "read the samples"))?;
        self.frames += (self.filled / size) as u64;
        Ok(self.filled / size)
    }

    fn frames(&self) -> PcmFrames<'_> {
        let header = self.reader.header();
        PcmFrames { layout: header.layout, channels: header.channels, bytes: &self.bytes[..self.filled] }
    }

    /// Faults, given the frames that were used.
    fn notes(&self, used: u64) -> Vec<CaptureNote> {
        let header = self.reader.header();
        let promised = header.data_bytes.map(|bytes| bytes / header.frame_bytes() as u64);
        let ended = self.reader.ended();
        let total = if ended { self.frames } else { promised.unwrap_or(0).max(self.frames) };
        let file = || self.name.clone();
        let left =
            CaptureNote::Left { file: file(), frames: total - used, exact: ended || promised.is_some() };
        let faults = self.reader.notes().into_iter().map(|note| CaptureNote::Wav { file: file(), note });
        faults.chain((total > used).then_some(left)).collect()
    }
}

/// Recordings side by side: one N-channel file, N mono files, or any mixture in this order.
pub struct Capture {
    parts: Vec<Part>,
    used: u64,
}

impl Capture {
    /// Opens the files; `-` is standard input. A name that ends in sigmf-meta or sigmf-data is a
    /// SigMF recording, everything else is WAV. The time of SigMF recordings counts from the earliest
    /// of them: one that joins late begins with missing samples.
    ///
    /// # Errors
    /// [`IoError`] for a file that cannot be opened or is not plain PCM.
    pub fn open<P: AsRef<Path>>(paths: &[P]) -> Result<Self, IoError> {
        let sigmf = paths.iter().map(AsRef::as_ref).filter(|path| is_sigmf(path));
        let first = |path: &Path| Ok(SigmfMeta::read(&file_pair(path, None).0)?.first_index());
        let origin = sigmf.map(first).collect::<Result<Vec<_>, IoError>>()?.into_iter().min().unwrap_or(0);
        let open = |path: &Path| {
            if is_sigmf(path) { Part::open_sigmf(path, origin) } else { Part::open(path) }
        };
        let parts = paths.iter().map(|path| open(path.as_ref())).collect::<Result<_, _>>()?;
        Ok(Self { parts, used: 0 })
    }

    /// N, the channels of all files together.
    pub fn channels(&self) -> usize {
        self.headers().map(|(_, header)| header.channels).sum()
    }

    /// Name and header of each file.
    pub fn headers(&self) -> impl Iterator<Item = (&str, &WavHeader)> {
        self.parts.iter().map(|part| (part.name.as_str(), part.reader.header()))
    }

    /// Ticks that the headers promise, if any of them says.
    pub fn promised_ticks(&self) -> Option<u64> {
        let frames = |(_, header): (&str, &WavHeader)| Some(header.data_bytes? / header.frame_bytes() as u64);
        self.headers().filter_map(frames).min()
    }

    /// Reads up to `ticks` ticks; returns how many all files have, fewer only at the end.
    ///
    /// # Errors
    /// The system's refusal to read.
    pub fn read(&mut self, ticks: usize) -> Result<usize, IoError> {
        let mut common = ticks;
        for part in &mut self.parts {
            common = common.min(part.fill(ticks)?);
        }
        self.used += common as u64;
        Ok(common)
    }

    /// What the last [`Capture::read`] brought, cut to the ticks that all files have.
    pub fn frames(&self) -> Vec<PcmFrames<'_>> {
        let parts = || self.parts.iter().map(Part::frames);
        let common = parts().map(|part| part.frames()).min().unwrap_or(0);
        parts().map(|part| PcmFrames { bytes: &part.bytes[..common * part.frame_bytes()], ..part }).collect()
    }

    /// Ticks read so far.
    pub fn ticks(&self) -> u64 {
        self.used
    }

    /// What had to be tolerated; complete after the end.
    pub fn notes(&self) -> Vec<CaptureNote> {
        self.parts.iter().flat_map(|part| part.notes(self.used)).collect()
    }
}
