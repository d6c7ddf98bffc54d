//! The thread of an input: opens it, sends its header, and passes its frames on.

use super::pipe::{stdin_file, widen_pipe};
use super::sigmf::{SigmfMeta, file_pair, is_sigmf};
use super::timestamps::Timestamps;
use super::wav::WavReader;
use super::{Coding, FrameReader, InputFault, IoError, PcmFormat, SampleLayout, StreamHeader, Turns};
use crossbeam_channel::{Receiver, Sender};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// An input to open, with its settings.
#[derive(Debug, Clone)]
pub(super) struct InputSource {
    pub(super) path: PathBuf,
    pub(super) coding: Coding,
    /// Number of channels if the input has no header and no converters take turns in it.
    pub(super) channels: usize,
    /// The converters that take turns in the input, if they do.
    pub(super) turns: Option<Turns>,
    /// Bytes of a block.
    pub(super) block: usize,
}

/// What the thread of an input sends.
pub(super) enum Message {
    /// The header and the timestamps; always the first message.
    Header { header: StreamHeader, timestamps: Timestamps },
    /// Whole frames.
    Frames { bytes: Vec<u8>, filled: usize },
    /// The end, with the faults that were tolerated; always last.
    End { faults: Vec<InputFault> },
}

impl InputSource {
    /// Name in messages to the user.
    pub(super) fn name(&self) -> String {
        if self.is_stdin() { "standard input".into() } else { self.path.display().to_string() }
    }

    /// Raw samples in the coding's format.
    pub(super) fn raw_header(&self) -> StreamHeader {
        let format = if let Coding::Raw(format) = self.coding { format } else { PcmFormat::F32Le };
        let layout = SampleLayout::packed(format);
        let channels = self.turns.as_ref().map_or(self.channels, Turns::converters);
        StreamHeader { layout, channels, rate: None, promised: None }
    }

    /// Samples in a row that belong to one frame.
    fn turn(&self) -> usize {
        self.turns.as_ref().map_or(1, Turns::converters)
    }

    /// What the header of the input itself says, with each turn as one frame of all converters.
    fn in_turns(&self, header: StreamHeader) -> Result<StreamHeader, IoError> {
        let Some(turns) = &self.turns else { return Ok(header) };
        if header.channels != 1 {
            return Err(IoError::TurnsInChannels { file: self.name(), channels: header.channels });
        }
        let converters = turns.converters();
        Ok(StreamHeader {
            layout: header.layout,
            channels: converters,
            rate: header.rate.map(|rate| rate / converters as f64),
            promised: header.promised.map(|samples| samples / converters as u64),
        })
    }

    /// Puts the samples of whole frames into the order of the channels.
    pub(super) fn reorder(&self, frames: &mut [u8], layout: SampleLayout) {
        self.turns.iter().for_each(|turns| turns.reorder(frames, layout.container));
    }

    pub(super) fn is_stdin(&self) -> bool {
        self.path.as_os_str() == "-"
    }
}

/// Reads until the end, or until the receiver is dropped. Blocks to fill come from `pool`.
pub(super) fn read(source: InputSource, messages: Sender<Result<Message, IoError>>, pool: Receiver<Vec<u8>>) {
    let reader = Reader { name: source.name(), source, messages, pool };
    let end = match reader.source.coding {
        _ if is_sigmf(&reader.source.path) => reader.read_sigmf(),
        Coding::Raw(_) => reader.read_raw(),
        Coding::Wav => reader.read_wav(),
    };
    // If the receiver is gone, the message is not needed.
    let _ = reader.messages.send(end);
}

struct Reader {
    source: InputSource,
    name: String,
    messages: Sender<Result<Message, IoError>>,
    pool: Receiver<Vec<u8>>,
}

impl Reader {
    fn open(&self) -> Result<Box<dyn Read>, IoError> {
        if self.source.is_stdin() {
            return Ok(Box::new(stdin_file().map_err(IoError::system(&self.name, "open it"))?));
        }
        let file = open_file(&self.source.path)?;
        widen_pipe(&file);
        Ok(Box::new(file))
    }

    fn read_raw(&self) -> Result<Message, IoError> {
        let header = self.source.raw_header();
        // Sent before opening, which may have to wait for a writer.
        self.send_header(header, Timestamps::default());
        self.send_raw_frames(self.open()?, header)
    }

    fn read_wav(&self) -> Result<Message, IoError> {
        let mut reader = WavReader::new(self.open()?, &self.name)?;
        let wav = reader.header();
        let promised = wav.data_bytes.map(|bytes| bytes / wav.frame_bytes() as u64);
        let rate = Some(f64::from(wav.rate));
        let header = StreamHeader { layout: wav.layout, channels: wav.channels, rate, promised };
        self.send_header(self.source.in_turns(header)?, Timestamps::default());
        reader.frames().group(self.source.turn());
        self.send_frames(reader.frames(), header.layout)?;
        Ok(Message::End { faults: reader.faults() })
    }

    fn read_sigmf(&self) -> Result<Message, IoError> {
        let (meta_path, _) = file_pair(&self.source.path, None);
        let meta = SigmfMeta::read(&meta_path)?;
        let meta_name = meta_path.display().to_string();
        let (_, data_path) = file_pair(&self.source.path, Some(&meta));
        let file = open_file(&data_path)?;
        let header = StreamHeader {
            layout: SampleLayout::packed(meta.format(&meta_name)?),
            channels: meta.global.num_channels.unwrap_or(1),
            rate: meta.global.sample_rate,
            promised: None,
        };
        let bytes = file.metadata().ok().filter(|data| data.is_file()).map(|data| data.len());
        let promised = bytes.map(|bytes| bytes / header.frame_bytes() as u64);
        let header = self.source.in_turns(StreamHeader { promised, ..header })?;
        let broken = |problem| IoError::Sigmf { file: meta_name.clone(), problem };
        let timestamps = meta.timestamps(&meta_name)?.in_turns(self.source.turn()).map_err(broken)?;
        self.send_header(header, timestamps);
        self.send_raw_frames(file, header)
    }

    fn send_header(&self, header: StreamHeader, timestamps: Timestamps) {
        let _ = self.messages.send(Ok(Message::Header { header, timestamps }));
    }

    fn send_raw_frames(&self, bytes: impl Read, header: StreamHeader) -> Result<Message, IoError> {
        let mut frames = FrameReader::new(bytes, header.frame_bytes(), None);
        self.send_frames(&mut frames, header.layout)?;
        Ok(Message::End { faults: cut_frame(frames.cut_bytes()) })
    }

    /// Sends frames to the consumer until the end, or until the consumer is gone.
    fn send_frames(&self, frames: &mut FrameReader<impl Read>, layout: SampleLayout) -> Result<(), IoError> {
        while let Ok(mut bytes) = self.pool.recv() {
            bytes.resize(self.source.block.max(frames.frame_bytes()), 0);
            let filled =
                frames.take_ready(&mut bytes).map_err(IoError::system(&self.name, "read the samples"))?;
            self.source.reorder(&mut bytes[..filled], layout);
            if filled == 0 || self.messages.send(Ok(Message::Frames { bytes, filled })).is_err() {
                break;
            }
        }
        Ok(())
    }
}

/// The fault of a last frame of which only `bytes` bytes were there.
pub(super) fn cut_frame(bytes: usize) -> Vec<InputFault> {
    Vec::from_iter((bytes > 0).then_some(InputFault::CutFrame { bytes }))
}

fn open_file(path: &Path) -> Result<File, IoError> {
    File::open(path).map_err(IoError::system(&path.display().to_string(), "open it"))
}
