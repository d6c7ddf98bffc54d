//! The thread of an input: opens it, sends its header, and passes its frames on.

use super::csv::CsvReader;
use super::kind::Kind;
use super::mat::{MatArray, MatReader, mat_variable};
use super::not_wav::NotWav;
use super::notes::InputNotes;
use super::npy::{NpyHeader, PlanarReader};
use super::pipe::{stdin_file, widen_pipe};
use super::sigmf::{SigmfMeta, archived, file_pair};
use super::timestamps::Timestamps;
use super::wav::{WavChunk, WavReader};
use super::{Coding, FrameReader, InputFault, IoError, PcmFormat, SampleLayout, StreamHeader, Turns};
use crossbeam_channel::{Receiver, Sender};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
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
    /// The only channel to read, from 0.
    pub(super) only: Option<usize>,
    /// Bytes of a block.
    pub(super) block: usize,
}

/// What the thread of an input sends.
pub(super) enum Message {
    /// The header and the timestamps; always the first message.
    Header { header: StreamHeader, timestamps: Timestamps, notes: Box<InputNotes> },
    /// Whole frames.
    Frames { bytes: Vec<u8>, filled: usize },
    /// The end, with the faults that were tolerated; always last.
    End { faults: Vec<InputFault>, chunks: Vec<WavChunk> },
}

impl InputSource {
    /// Name in messages to the user.
    pub(super) fn name(&self) -> String {
        if self.is_stdin() { "standard input".into() } else { self.path.display().to_string() }
    }

    /// Raw samples in the coding's format.
    pub(super) fn raw_header(&self) -> StreamHeader {
        let layout = SampleLayout::packed(self.coding.format().unwrap_or(PcmFormat::F32Le));
        let channels = self.turns.as_ref().map_or(self.channels, Turns::converters);
        StreamHeader { is_complex: self.coding.is_complex(), ..StreamHeader::real(layout, channels) }
    }

    /// As the consumer sees an input that states `header`: converters that take turns as channels, or the
    /// only channel that is read.
    pub(super) fn chosen(&self, header: StreamHeader) -> Result<StreamHeader, IoError> {
        match self.only {
            None => self.in_turns(header),
            Some(only) if only < header.channels => Ok(StreamHeader { channels: 1, ..header }),
            Some(only) => {
                Err(IoError::NoChannel { file: self.name(), channel: only + 1, channels: header.channels })
            }
        }
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
            channels: converters,
            rate: header.rate.map(|rate| rate / converters as f64),
            promised: header.promised.map(|samples| samples / converters as u64),
            ..header
        })
    }

    /// Puts the samples of whole frames, which are those of `header`, into the order of the channels, or
    /// keeps those of the only one. Gives the bytes that remain.
    pub(super) fn arrange(&self, frames: &mut [u8], header: &StreamHeader) -> usize {
        let sample = header.layout.container * header.parts();
        self.turns.iter().for_each(|turns| turns.reorder(frames, sample));
        let Some(only) = self.only.filter(|_| header.channels > 1) else { return frames.len() };
        let count = frames.len() / header.frame_bytes();
        for k in 0..count {
            let from = k * header.frame_bytes() + only * sample;
            frames.copy_within(from..from + sample, k * sample);
        }
        count * sample
    }

    pub(super) fn is_stdin(&self) -> bool {
        self.path.as_os_str() == "-"
    }
}

/// Reads until the end, or until the receiver is dropped. Blocks to fill come from `pool`.
pub(super) fn read(source: InputSource, messages: Sender<Result<Message, IoError>>, pool: Receiver<Vec<u8>>) {
    let reader = Reader { name: source.name(), source, messages, pool };
    let end = match Kind::of(&reader.source.path, reader.source.coding) {
        Kind::Sigmf => reader.read_sigmf(),
        Kind::Archive => reader.read_archive(),
        Kind::Csv => reader.read_csv(),
        Kind::Npy => reader.read_npy(),
        Kind::Mat => reader.read_mat(),
        Kind::Audio => reader.read_audio(),
        Kind::Raw => reader.read_raw(),
        Kind::Wav => reader.read_wav(),
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
        let chosen = if self.source.only.is_some() { self.source.chosen(header)? } else { header };
        self.send_header(chosen, Timestamps::default());
        self.send_raw_frames(self.open()?, header)
    }

    fn read_wav(&self) -> Result<Message, IoError> {
        let mut reader = WavReader::new(self.open()?, &self.name)?;
        let wav = reader.header();
        let promised = wav.data_bytes.map(|bytes| bytes / wav.frame_bytes() as u64);
        let rate = Some(f64::from(wav.rate));
        let header = StreamHeader { rate, promised, ..StreamHeader::real(wav.layout, wav.channels) };
        let notes = InputNotes { chunks: reader.header().chunks.clone(), ..InputNotes::default() };
        self.send_header_with(self.source.chosen(header)?, Timestamps::default(), notes);
        reader.frames().group(self.source.turn());
        self.send_frames(reader.frames(), header)?;
        // A pipe may stay open after the samples.
        let chunks = if self.source.path.is_file() { reader.chunks_after() } else { Vec::new() };
        Ok(Message::End { faults: reader.faults(), chunks })
    }

    fn read_csv(&self) -> Result<Message, IoError> {
        let reader = CsvReader::new(self.open()?, &self.name)?;
        let header = reader.stream_header();
        self.send_header(self.source.chosen(header)?, Timestamps::default());
        self.send_turns(FrameReader::new(reader, header.frame_bytes(), None), header)
    }

    fn read_npy(&self) -> Result<Message, IoError> {
        let mut file = open_file(&self.source.path)?;
        let array = NpyHeader::read(&mut file, &self.name)?;
        let header = array.stream_header();
        let chosen = self.source.chosen(header)?;
        let (frame, bytes) = (header.frame_bytes(), array.data_bytes());
        let reader: Box<dyn Read> = match array.is_planar {
            true => Box::new(PlanarReader::new(file, array, &self.name)?),
            false => Box::new(file),
        };
        self.send_header(chosen, Timestamps::default());
        self.send_turns(FrameReader::new(reader, frame, Some(bytes)), header)
    }

    fn read_mat(&self) -> Result<Message, IoError> {
        let named = mat_variable(&self.source.path);
        let (path, wanted) = named.unwrap_or_else(|| (self.source.path.clone(), None));
        let mut file = open_file(&path)?;
        if !file.metadata().is_ok_and(|found| found.is_file()) {
            let problem =
                "its variables are in any order, which a pipe cannot give; save it to a file".into();
            return Err(IoError::Malformed {
                file: self.name.clone(),
                kind: "a MATLAB file of samples",
                problem,
            });
        }
        let array = MatArray::read(&mut file, wanted, &path.display().to_string())?;
        let header = array.stream_header();
        self.send_header(self.source.chosen(header)?, Timestamps::default());
        self.send_turns(FrameReader::new(MatReader::new(array), header.frame_bytes(), None), header)
    }

    #[cfg(feature = "audio")]
    fn read_audio(&self) -> Result<Message, IoError> {
        let reader = super::audio::DecodedReader::open(&self.source.path, &self.name)?;
        let header = reader.stream_header();
        self.send_header(self.source.chosen(header)?, Timestamps::default());
        self.send_turns(FrameReader::new(reader, header.frame_bytes(), None), header)
    }

    #[cfg(not(feature = "audio"))]
    fn read_audio(&self) -> Result<Message, IoError> {
        // A name that does not exist is the more useful message.
        open_file(&self.source.path)?;
        Err(IoError::Encoded { file: self.name.clone() })
    }

    /// Sends frames of one channel or more, or turns.
    fn send_turns(
        &self,
        mut frames: FrameReader<impl Read>,
        header: StreamHeader,
    ) -> Result<Message, IoError> {
        frames.group(self.source.turn());
        self.send_frames(&mut frames, header)?;
        let missing_bytes = frames.missing_bytes();
        let truncated = (missing_bytes > 0).then_some(InputFault::Truncated { missing_bytes });
        let faults = truncated.into_iter().chain(cut_frame(frames.cut_bytes())).collect();
        Ok(Message::End { faults, chunks: Vec::new() })
    }

    fn read_sigmf(&self) -> Result<Message, IoError> {
        let (meta_path, _) = file_pair(&self.source.path, None);
        let meta = SigmfMeta::read(&meta_path)?;
        let meta_name = meta_path.display().to_string();
        let (_, data_path) = file_pair(&self.source.path, Some(&meta));
        let file = open_file(&data_path)?;
        let bytes = file.metadata().ok().filter(|data| data.is_file()).map(|data| data.len());
        self.read_recording(meta, &meta_name, file, bytes)
    }

    fn read_archive(&self) -> Result<Message, IoError> {
        let mut archive = open_file(&self.source.path)?;
        let (meta, name, data) = archived(&mut archive, &self.name)?;
        let sought = archive.seek(SeekFrom::Start(data.offset));
        sought.map_err(IoError::system(&self.name, "read the samples"))?;
        self.read_recording(meta, &name, archive.take(data.size), Some(data.size))
    }

    /// The samples `data`, of `bytes` bytes if that is known, with their metadata.
    fn read_recording(
        &self,
        meta: SigmfMeta,
        meta_name: &str,
        data: impl Read,
        bytes: Option<u64>,
    ) -> Result<Message, IoError> {
        let layout = SampleLayout::packed(meta.format(meta_name)?);
        let header = StreamHeader {
            is_complex: meta.is_complex(),
            rate: meta.global.sample_rate,
            ..StreamHeader::real(layout, meta.global.num_channels.unwrap_or(1))
        };
        let promised = bytes.map(|bytes| bytes / header.frame_bytes() as u64);
        let header = StreamHeader { promised, ..header };
        let chosen = self.source.chosen(header)?;
        let broken = |problem| IoError::Sigmf { file: meta_name.to_owned(), problem };
        let turn = self.source.turn();
        let timestamps = meta.timestamps(meta_name)?.in_turns(turn).map_err(broken)?;
        let (sigmf, chunks) = (Some(Box::new(meta)), Vec::new());
        let notes = InputNotes { sigmf, timestamps: timestamps.clone(), turn, chunks };
        self.send_header_with(chosen, timestamps, notes);
        self.send_turns(FrameReader::new(data, header.frame_bytes(), None), header)
    }

    fn send_header(&self, header: StreamHeader, timestamps: Timestamps) {
        self.send_header_with(header, timestamps, InputNotes::default());
    }

    fn send_header_with(&self, header: StreamHeader, timestamps: Timestamps, notes: InputNotes) {
        let _ = self.messages.send(Ok(Message::Header { header, timestamps, notes: Box::new(notes) }));
    }

    fn send_raw_frames(&self, bytes: impl Read, header: StreamHeader) -> Result<Message, IoError> {
        let mut frames = FrameReader::new(NotWav::new(bytes, &self.name), header.frame_bytes(), None);
        self.send_frames(&mut frames, header)?;
        Ok(Message::End { faults: cut_frame(frames.cut_bytes()), chunks: Vec::new() })
    }

    /// Sends frames to the consumer until the end, or until the consumer is gone.
    fn send_frames(&self, frames: &mut FrameReader<impl Read>, header: StreamHeader) -> Result<(), IoError> {
        while let Ok(mut bytes) = self.pool.recv() {
            bytes.resize(self.source.block.max(frames.frame_bytes()), 0);
            let filled = frames.take_ready(&mut bytes).map_err(IoError::reading(&self.name))?;
            let filled = self.source.arrange(&mut bytes[..filled], &header);
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
