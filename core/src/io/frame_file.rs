//! Frames of a file from any place, for workers that read parts of a long recording.

use super::block::Block;
use super::capture::{ByteSource, open_file};
use super::full_scale::{Scaling, StatedScale};
use super::sigmf_reader::SigmfReader;
use super::wav::WavReader;
use super::{IoError, StreamHeader, is_sigmf, sigmf_files};
use crate::runtime::{FrameSource, Isa, PcmFrames, Sample};
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Frames that tell where the codes of a recording stand.
const FIRST_FRAMES: usize = 16_384;

/// A WAV file or a SigMF recording.
///
/// ```
/// use hybank_core::io::FrameFile;
/// # let folder = std::env::temp_dir().join(format!("hybank-frames-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// let meta = r#"{"global": {"core:datatype": "ri16_le", "core:trailing_bytes": 3}}"#;
/// std::fs::write(folder.join("x.sigmf-meta"), meta)?;
/// std::fs::write(folder.join("x.sigmf-data"), [1, 0, 2, 0, 7, 7, 7])?;
/// let file = FrameFile::open(&folder.join("x.sigmf-meta"))?;
/// assert_eq!((file.frames(), file.read::<f32>(1, 1)?), (2, vec![2.0 / 32768.0]));
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FrameFile {
    /// The file of the samples, and where they begin in it.
    data: PathBuf,
    offset: u64,
    header: StreamHeader,
    frames: u64,
    scaling: Scaling,
}

impl FrameFile {
    /// Reads the header of a WAV file, or the metadata of a SigMF recording.
    ///
    /// # Errors
    /// [`IoError`], also for a SigMF recording that lacks frames.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        let name = path.display().to_string();
        let (data, offset, header) = if is_sigmf(path) {
            let reader = SigmfReader::open(path)?;
            if reader.notes().timestamps.has_losses() {
                let problem =
                    "frames were lost (core:global_index jumps); fuse the whole recording, which fills them";
                return Err(IoError::unfit(&name)(problem.into()));
            }
            let Some(beginning) = reader.beginning() else {
                let problem = "its captures have headers between their samples; fuse the whole recording";
                return Err(IoError::unfit(&name)(problem.into()));
            };
            let [_, data] = sigmf_files(path);
            (data, beginning, reader.stream_header())
        } else {
            let reader = WavReader::new(open_file(path)?, &name)?;
            (path.to_owned(), reader.header().data_offset, reader.stream_header())
        };
        let size = data.metadata().map_err(IoError::system(&name, "read it"))?.len();
        // A truncated file has fewer frames than its header promises.
        let there = size.saturating_sub(offset) / header.frame_bytes() as u64;
        let frames = header.promised.map_or(there, |promised| promised.min(there));
        // Of complex samples each part is a channel here.
        let numbers = StreamHeader { channels: header.columns(), is_complex: false, ..header };
        let scaling = Scaling::new(&numbers, StatedScale::default()).map_err(IoError::unfit(&name))?;
        let mut file = Self { data, offset, header, frames, scaling };
        let first = file.stored(0, FIRST_FRAMES)?;
        file.scaling = file.scaled(&first)?.1;
        Ok(file)
    }

    /// The format of the frames.
    pub fn header(&self) -> StreamHeader {
        self.header
    }

    /// How many there are.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The numbers of `count` frames from `first` on, or of as many as there are, frame after frame; the
    /// parts of complex samples take turns.
    ///
    /// # Errors
    /// [`IoError::File`].
    pub fn read<T: Sample>(&self, first: u64, count: usize) -> Result<Vec<T>, IoError> {
        let (block, _) = self.scaled(&self.stored(first, count)?)?;
        let frames = block.view(0..block.frames(), 1).real;
        let mut numbers = vec![T::default(); frames.frames() * frames.channels()];
        (&frames as &dyn FrameSource).load(Isa::detect(), 0, &mut numbers);
        Ok(numbers)
    }

    /// The bytes of frames.
    fn stored(&self, first: u64, count: usize) -> Result<Vec<u8>, IoError> {
        let first = first.min(self.frames);
        let count = (self.frames - first).min(count as u64);
        let frame = self.header.frame_bytes() as u64;
        let mut bytes = vec![0; (count * frame) as usize];
        let mut file = open_file(&self.data)?;
        let read =
            file.seek(SeekFrom::Start(self.offset + first * frame)).and_then(|_| file.read_exact(&mut bytes));
        read.map_err(IoError::system(&self.data.display().to_string(), "read it"))?;
        Ok(bytes)
    }

    /// Frames of full scale 1, and what is known after them of where their codes stand.
    fn scaled(&self, bytes: &[u8]) -> Result<(Block, Scaling), IoError> {
        let name = self.data.display().to_string();
        let header = StreamHeader { channels: self.header.columns(), is_complex: false, ..self.header };
        let (mut block, mut scaling) = (Block::default(), self.scaling.clone());
        block.begin(&header);
        let frames = PcmFrames { layout: header.layout, channels: header.channels, bytes };
        let memory = |_| IoError::reading(&name)(ErrorKind::OutOfMemory.into());
        block.decode(&frames).map_err(memory)?;
        scaling.take(&mut block, 0).map_err(IoError::unfit(&name))?;
        Ok((block, scaling))
    }
}
