//! The reading end of an input: opens it, says what it is, and passes its frames on.

use super::lane::Shape;
use super::pipe::{stdin_file, widen_pipe};
use super::sequence::Sequence;
use super::sigmf::{SigmfMeta, file_pair, is_sigmf};
use super::wav::WavReader;
use super::{Coding, FrameReader, IoError, PcmFormat, SampleLayout};
use crossbeam_channel::{Receiver, Sender};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What is to be opened, and how.
#[derive(Debug, Clone)]
pub(super) struct Opening {
    pub(super) path: PathBuf,
    pub(super) coding: Coding,
    /// Channels, where no header says.
    pub(super) channels: usize,
    /// Bytes of a block.
    pub(super) block: usize,
}

/// What an input has to say.
pub(super) enum Said {
    /// What its frames are; always first.
    Shape { shape: Shape, sequence: Sequence },
    /// Whole frames.
    Frames { bytes: Vec<u8>, filled: usize },
    /// The end, with the faults that were tolerated.
    End { notes: Vec<String> },
}

impl Opening {
    /// Name for messages.
    pub(super) fn name(&self) -> String {
        if self.is_stdin() { "standard input".into() } else { self.path.display().to_string() }
    }

    /// Raw samples in the coding's format.
    pub(super) fn raw_shape(&self) -> Shape {
        let format = if let Coding::Raw(format) = self.coding { format } else { PcmFormat::F32Le };
        Shape { layout: SampleLayout::packed(format), channels: self.channels, rate: None, promised: None }
    }

    pub(super) fn is_stdin(&self) -> bool {
        self.path.as_os_str() == "-"
    }
}

/// Reads until the end, or until nobody listens any more. Blocks come back by `free`.
pub(super) fn read(opening: Opening, say: Sender<Result<Said, IoError>>, free: Receiver<Vec<u8>>) {
    let reader = Reader { name: opening.name(), opening, say, free };
    let end = match reader.opening.coding {
        _ if is_sigmf(&reader.opening.path) => reader.read_sigmf(),
        Coding::Raw(_) => reader.read_raw(),
        Coding::Wav => reader.read_wav(),
    };
    // If nobody listens any more there is nobody to tell.
    let _ = reader.say.send(end);
}

struct Reader {
    opening: Opening,
    name: String,
    say: Sender<Result<Said, IoError>>,
    free: Receiver<Vec<u8>>,
}

impl Reader {
    fn open(&self) -> Result<Box<dyn Read>, IoError> {
        if self.opening.is_stdin() {
            return Ok(Box::new(stdin_file().map_err(IoError::system(&self.name, "open it"))?));
        }
        let file = open_file(&self.opening.path)?;
        widen_pipe(&file);
        Ok(Box::new(file))
    }

    fn read_raw(&self) -> Result<Said, IoError> {
        let shape = self.opening.raw_shape();
        // Said before opening, which may have to wait for a writer.
        self.say_shape(shape, Sequence::default());
        self.pump_raw(self.open()?, shape)
    }

    fn read_wav(&self) -> Result<Said, IoError> {
        let mut reader = WavReader::new(self.open()?, &self.name)?;
        let header = reader.header();
        let promised = header.data_bytes.map(|bytes| bytes / header.frame_bytes() as u64);
        let rate = Some(f64::from(header.rate));
        let shape = Shape { layout: header.layout, channels: header.channels, rate, promised };
        self.say_shape(shape, Sequence::default());
        self.pump(reader.frames())?;
        Ok(Said::End { notes: reader.notes().iter().map(ToString::to_string).collect() })
    }

    fn read_sigmf(&self) -> Result<Said, IoError> {
        let (meta_path, _) = file_pair(&self.opening.path, None);
        let meta = SigmfMeta::read(&meta_path)?;
        let meta_name = meta_path.display().to_string();
        let (_, data_path) = file_pair(&self.opening.path, Some(&meta));
        let file = open_file(&data_path)?;
        let shape = Shape {
            layout: SampleLayout::packed(meta.format(&meta_name)?),
            channels: meta.global.num_channels.unwrap_or(1),
            rate: meta.global.sample_rate,
            promised: None,
        };
        let bytes = file.metadata().ok().filter(|data| data.is_file()).map(|data| data.len());
        let promised = bytes.map(|bytes| bytes / shape.frame_bytes() as u64);
        self.say_shape(Shape { promised, ..shape }, meta.sequence(&meta_name)?);
        self.pump_raw(file, shape)
    }

    fn say_shape(&self, shape: Shape, sequence: Sequence) {
        let _ = self.say.send(Ok(Said::Shape { shape, sequence }));
    }

    fn pump_raw(&self, source: impl Read, shape: Shape) -> Result<Said, IoError> {
        let mut frames = FrameReader::new(source, shape.frame_bytes(), None);
        self.pump(&mut frames)?;
        Ok(Said::End { notes: cut_note(frames.cut_bytes()) })
    }

    /// Frames to the consumer until the end, or until the consumer is gone.
    fn pump(&self, frames: &mut FrameReader<impl Read>) -> Result<(), IoError> {
        while let Ok(mut bytes) = self.free.recv() {
            bytes.resize(self.opening.block.max(frames.frame_bytes()), 0);
            let filled =
                frames.take_ready(&mut bytes).map_err(IoError::system(&self.name, "read the samples"))?;
            if filled == 0 || self.say.send(Ok(Said::Frames { bytes, filled })).is_err() {
                break;
            }
        }
        Ok(())
    }
}

/// What there is to say about the `cut` bytes of a last frame.
pub(super) fn cut_note(cut: usize) -> Vec<String> {
    let note = format!("the last frame is cut ({cut} bytes of it are there) and was left out");
    Vec::from_iter((cut > 0).then_some(note))
}

fn open_file(path: &Path) -> Result<File, IoError> {
    File::open(path).map_err(IoError::system(&path.display().to_string(), "open it"))
}
