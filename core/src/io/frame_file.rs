//! Frames of a file from any place, for workers that read parts of a long recording.

use super::capture::{Capture, open_file};
use super::sigmf_reader::SigmfReader;
use super::wav::WavReader;
use super::{IoError, StreamHeader, is_sigmf, sigmf_files};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

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
/// assert_eq!((file.frames(), file.read(1, 1)?), (2, vec![2, 0]));
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
            let [_, data] = sigmf_files(path);
            (data, 0, reader.stream_header())
        } else {
            let reader = WavReader::new(open_file(path)?, &name)?;
            (path.to_owned(), reader.header().data_offset, reader.stream_header())
        };
        let size = data.metadata().map_err(IoError::system(&name, "read it"))?.len();
        // A truncated file has fewer frames than its header promises.
        let there = size.saturating_sub(offset) / header.frame_bytes() as u64;
        let frames = header.promised.map_or(there, |promised| promised.min(there));
        Ok(Self { data, offset, header, frames })
    }

    /// The format of the frames.
    pub fn header(&self) -> StreamHeader {
        self.header
    }

    /// How many there are.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The bytes of `count` frames from `first` on, or of as many as there are.
    ///
    /// # Errors
    /// [`IoError::File`].
    pub fn read(&self, first: u64, count: usize) -> Result<Vec<u8>, IoError> {
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
}
