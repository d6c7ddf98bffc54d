//! Reads several inputs as their samples arrive, with one thread per input. The consumer gets a frame as
//! soon as every input has its samples of it. If raw standard input is the only input, it needs no thread.
//!
//! Memory is bounded: each input has a pool of a few blocks that circulate between its thread and the
//! consumer. If the consumer is slow, reading stops, and so do the writers of the pipes.

use super::aligned_input::{AlignedInput, Block};
use super::input_thread::{InputSource, Message, read};
use super::lost::{LostInInput, LostSamples};
#[cfg(target_os = "linux")]
use super::stdin_reader::StdinReader;
use super::timestamps::{MAX_LOST, Segment, Timestamps};
use super::{Coding, InputFault, InputWarning, IoError, PcmFrames, StreamHeader, Turns};
use crate::files::is_same_file;
use crossbeam_channel::{Receiver, Sender, bounded, select};
use std::path::{Path, PathBuf};
use std::thread;

/// Number of blocks in the pool of each input.
const BLOCKS: usize = 4;
/// Bytes of a block that suit one thread.
pub const BLOCK_BYTES: usize = 128 << 10;
/// All blocks of all inputs together, unless that would make them smaller than a page.
const ALL_BYTES: usize = 16 << 20;

/// Which input decides where the reading ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Until {
    /// The first one to end; the remaining frames of the others are not used.
    #[default]
    Shortest,
    /// The last one to end; samples of the others are lost from their end on.
    Longest,
}

/// Settings of the reading.
#[derive(Debug, Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Coding of all inputs except SigMF recordings.
    pub coding: Coding,
    /// Channels of a raw input, if it is the only one; several have one each.
    pub channels: usize,
    /// The converters that take turns in the only input, which has one channel then. Its frames are those of
    /// an input of M channels, at an M-th of its rate.
    pub turns: Option<&'a Turns>,
    /// The lost samples, if a file lists them.
    pub lost: Option<&'a LostSamples>,
    /// Maximum number of lost frames of one input, by default [`MAX_LOST`]. Without a limit a wrong number
    /// would lead to endless output.
    pub max_lost: u64,
    /// Which input decides where the reading ends.
    pub until: Until,
    /// The most bytes of an input that are read at a time; less if there are many inputs.
    pub block_bytes: usize,
}

impl ReadOptions<'_> {
    /// Files with headers, nothing lost.
    pub fn files() -> Self {
        Self {
            coding: Coding::Wav,
            channels: 1,
            turns: None,
            lost: None,
            max_lost: MAX_LOST,
            until: Until::Shortest,
            block_bytes: BLOCK_BYTES,
        }
    }
}

/// The result of waiting for frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// This many frames are ready, at least 1.
    Frames(usize),
    /// The inputs have ended.
    End,
    /// A stop was requested.
    Stopped,
}

/// One input on the side of the consumer.
struct Input {
    name: String,
    aligned: AlignedInput,
    source: Source,
    /// When its frames were taken, as far as the input itself knows.
    timestamps: Timestamps,
    faults: Vec<InputFault>,
}

/// The source of an input's frames.
enum Source {
    /// Its thread, to which blocks go back.
    Thread { messages: Receiver<Result<Message, IoError>>, pool: Sender<Vec<u8>> },
    /// Standard input itself.
    #[cfg(target_os = "linux")]
    Stdin(Box<StdinReader>),
}

/// Several inputs, read side by side into frames.
///
/// [`MultiReader::wait`] until frames are there, use [`MultiReader::frames`], and [`MultiReader::consume`]
/// them.
pub struct MultiReader {
    inputs: Vec<Input>,
    stop: Receiver<()>,
    until: Until,
    /// Frames at hand.
    ready: usize,
    consumed: u64,
}

impl MultiReader {
    /// Starts reading and waits for the headers. `-` is standard input. A name that ends in sigmf-meta or
    /// sigmf-data is a SigMF recording, everything else is as [`ReadOptions::coding`] says. Time counts
    /// from the earliest sample whose number is known: inputs that join late begin with lost samples. A
    /// message on `stop` ends any wait.
    ///
    /// # Errors
    /// [`IoError`] for an input that cannot be read or is not plain PCM, for a pipe that is given twice,
    /// for lost samples that do not fit the inputs or are more than [`ReadOptions::max_lost`], and for a
    /// thread that cannot be started; `Ok(None)` if a stop was requested first.
    pub fn start(
        paths: &[PathBuf],
        options: ReadOptions<'_>,
        stop: Receiver<()>,
    ) -> Result<Option<Self>, IoError> {
        refuse_shared_pipes(paths)?;
        let channels = if paths.len() == 1 { options.channels } else { 1 };
        let block = (ALL_BYTES / BLOCKS / paths.len().max(1)).min(options.block_bytes).max(4096);
        let turns = options.turns.filter(|_| paths.len() == 1);
        let source = |path: &PathBuf| InputSource {
            path: path.clone(),
            coding: options.coding,
            channels,
            turns: turns.cloned(),
            block,
        };
        let inputs = match paths {
            [path] => vec![Input::alone(source(path))?],
            // All threads first: opening a FIFO waits for its writer, in whatever order they come.
            _ => paths.iter().map(|path| Input::on_thread(source(path))).collect::<Result<_, _>>()?,
        };
        let mut reader = Self { inputs, stop, until: options.until, ready: 0, consumed: 0 };
        for i in 0..paths.len() {
            if reader.inputs[i].sends_header() && !reader.receive(i)? {
                return Ok(None);
            }
        }
        reader.align(options.lost, options.max_lost)?;
        Ok(Some(reader))
    }

    /// N, the channels of all inputs together.
    pub fn channels(&self) -> usize {
        self.headers().map(|(_, header)| header.channels).sum()
    }

    /// Name and header of each input.
    pub fn headers(&self) -> impl Iterator<Item = (&str, &StreamHeader)> {
        self.inputs.iter().map(|input| (input.name.as_str(), &input.aligned.header))
    }

    /// Number of frames according to the headers, if any header states it.
    pub fn promised_frames(&self) -> Option<u64> {
        self.headers().filter_map(|(_, header)| header.promised).min()
    }

    /// Waits until every input has a frame.
    ///
    /// # Errors
    /// The system's refusal to read one of them, or [`IoError::ReaderDied`].
    pub fn wait(&mut self) -> Result<Arrival, IoError> {
        for i in 0..self.inputs.len() {
            while self.inputs[i].aligned.waits() {
                if !self.receive(i)? {
                    return Ok(Arrival::Stopped);
                }
            }
        }
        let aligned = || self.inputs.iter().map(|input| &input.aligned);
        let over = aligned().filter(|input| input.is_over()).count();
        let end = if self.until == Until::Shortest { over > 0 } else { over == self.inputs.len() };
        if end {
            self.ready = 0;
            return Ok(Arrival::End);
        }
        self.ready = aligned().filter(|input| !input.is_over()).map(AlignedInput::ready).min().unwrap_or(0);
        self.inputs.iter_mut().for_each(|input| input.aligned.prepare(self.ready));
        Ok(Arrival::Frames(self.ready))
    }

    /// The ready frames, as many as [`MultiReader::wait`] returned. Lost samples are NaN.
    pub fn frames(&self) -> Vec<PcmFrames<'_>> {
        self.inputs.iter().map(|input| input.aligned.view(self.ready)).collect()
    }

    /// Releases the first `frames` frames, at most those that are ready.
    pub fn consume(&mut self, frames: usize) {
        let frames = frames.min(self.ready);
        self.inputs.iter_mut().for_each(|input| input.advance(frames));
        self.ready = 0;
        self.consumed += frames as u64;
    }

    /// Frames consumed since the beginning.
    pub fn consumed(&self) -> u64 {
        self.consumed
    }

    /// The faults tolerated so far.
    pub fn warnings(&self) -> Vec<InputWarning> {
        let one_ended = self.inputs.iter().any(|input| input.aligned.is_over());
        let of_input = |input: &Input| {
            let unused = if one_ended { input.unused() } else { None };
            let name = input.name.clone();
            let warning = move |fault| InputWarning { input: name.clone(), fault };
            input.faults().chain(unused).map(warning).collect::<Vec<_>>()
        };
        self.inputs.iter().flat_map(of_input).collect()
    }

    /// Waits for the next message of input i; false if a stop was asked for first.
    fn receive(&mut self, i: usize) -> Result<bool, IoError> {
        let input = &mut self.inputs[i];
        let message = match &mut input.source {
            Source::Thread { messages, .. } => select! {
                // A reader that has come to the end of its input says so.
                recv(messages) -> message => match message {
                    Ok(message) => Some(message?),
                    Err(_) => return Err(IoError::ReaderDied { file: input.name.clone() }),
                },
                recv(self.stop) -> _ => None,
            },
            #[cfg(target_os = "linux")]
            Source::Stdin(stdin) => stdin.receive(&self.stop)?,
        };
        let received = message.is_some();
        message.into_iter().for_each(|message| input.take(message));
        Ok(received)
    }

    /// One time axis for all inputs.
    fn align(&mut self, given: Option<&LostSamples>, max_lost: u64) -> Result<(), IoError> {
        let channels: Vec<_> = self.headers().map(|(_, header)| header.channels).collect();
        let lost = match given {
            Some(given) => given.of_inputs(&channels)?,
            None => vec![LostInInput::default(); channels.len()],
        };
        let mut inputs: Vec<_> = self.inputs.iter_mut().zip(lost).collect();
        for (input, lost) in &mut inputs {
            input.take_timestamps(lost)?;
        }
        let origin = inputs.iter().filter_map(|(_, lost)| lost.timestamps.beginning()).min().unwrap_or(0);
        for (input, lost) in inputs {
            let segments = lost.timestamps.segments(origin);
            let segments = segments.map_err(|problem| input.timing_fault(problem))?;
            let frames = segments.iter().map(Segment::lost).fold(0, u64::saturating_add);
            if frames > max_lost {
                return Err(input.timing_fault(format!(
                    "{frames} samples were lost in all, more than {max_lost}; check the numbers, or allow so many with \
                     --max-lost {frames}"
                )));
            }
            input.aligned.lose(segments, lost);
        }
        Ok(())
    }
}

impl Input {
    /// The only input.
    #[cfg(target_os = "linux")]
    fn alone(source: InputSource) -> Result<Self, IoError> {
        if !source.is_stdin() || source.coding == Coding::Wav {
            return Self::on_thread(source);
        }
        let stdin = StdinReader::new(&source)?;
        Ok(Self::new(source.name(), stdin.header, Source::Stdin(Box::new(stdin))))
    }

    /// The only input.
    #[cfg(not(target_os = "linux"))]
    fn alone(source: InputSource) -> Result<Self, IoError> {
        Self::on_thread(source)
    }

    fn on_thread(source: InputSource) -> Result<Self, IoError> {
        let (name, header) = (source.name(), source.raw_header());
        Self::on_thread_of(name, header, move |messages, pool| read(source, messages, pool))
    }

    /// An input whose messages a new thread sends, with a pool of blocks to fill.
    fn on_thread_of(
        name: String,
        header: StreamHeader,
        send_all: impl FnOnce(Sender<Result<Message, IoError>>, Receiver<Vec<u8>>) + Send + 'static,
    ) -> Result<Self, IoError> {
        let (message_sender, messages) = bounded(BLOCKS + 2);
        let (pool, pool_out) = bounded(BLOCKS);
        (0..BLOCKS).for_each(|_| {
            // The channel has room for all blocks.
            let _ = pool.send(Vec::new());
        });
        let thread = thread::Builder::new().name("input".into());
        thread
            .spawn(move || send_all(message_sender, pool_out))
            .map_err(IoError::system(&name, "start a thread that reads it"))?;
        Ok(Self::new(name, header, Source::Thread { messages, pool }))
    }

    fn new(name: String, header: StreamHeader, source: Source) -> Self {
        let aligned = AlignedInput::new(header);
        Self { name, aligned, source, timestamps: Timestamps::default(), faults: Vec::new() }
    }

    /// Whether the first message is the header.
    fn sends_header(&self) -> bool {
        matches!(self.source, Source::Thread { .. })
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Header { header, timestamps } => {
                self.aligned = AlignedInput::new(header);
                self.timestamps = timestamps;
            }
            Message::Frames { bytes, filled } => {
                let used = self.aligned.refill(Block { bytes, filled });
                self.give_back(used);
            }
            Message::End { faults } => {
                self.aligned.end();
                self.faults = faults;
            }
        }
    }

    fn advance(&mut self, frames: usize) {
        self.aligned.advance(frames);
        if let Some(used) = self.aligned.take_used() {
            self.give_back(used);
        }
    }

    fn give_back(&mut self, block: Block) {
        if block.bytes.is_empty() {
            return;
        }
        match &mut self.source {
            // A thread that has ended needs no blocks.
            Source::Thread { pool, .. } => drop(pool.send(block.bytes)),
            #[cfg(target_os = "linux")]
            Source::Stdin(stdin) => stdin.give_back(block.bytes),
        }
    }

    /// The input's own timestamps go together with dropouts given beside it, but not with other timestamps.
    fn take_timestamps(&mut self, lost: &mut LostInInput) -> Result<(), IoError> {
        if self.timestamps.is_empty() {
            return Ok(());
        }
        if !lost.timestamps.is_empty() {
            return Err(
                self.timing_fault("it has captures of its own; leave out the lines with sample_start".into())
            );
        }
        lost.timestamps = std::mem::take(&mut self.timestamps);
        Ok(())
    }

    fn timing_fault(&self, problem: String) -> IoError {
        IoError::Lost { file: self.name.clone(), problem }
    }

    fn faults(&self) -> impl Iterator<Item = InputFault> {
        let beyond = self.aligned.is_over() && self.aligned.has_unreached_segments();
        self.faults.iter().copied().chain(beyond.then_some(InputFault::TimestampsBeyondEnd))
    }

    /// Frames that were not used.
    fn unused(&self) -> Option<InputFault> {
        let seen = self.aligned.seen();
        let promised = if self.aligned.is_over() { None } else { self.aligned.header.promised };
        let frames = promised.unwrap_or(0).max(seen) - (seen - self.aligned.left() as u64);
        let at_least = promised.is_none() && !self.aligned.ended();
        (frames > 0).then_some(InputFault::Unused { frames, at_least })
    }
}

/// Two readers of one pipe would each get only some of its bytes.
fn refuse_shared_pipes(paths: &[PathBuf]) -> Result<(), IoError> {
    let pipes: Vec<_> = paths.iter().filter(|path| is_pipe(path)).collect();
    for (i, second) in pipes.iter().enumerate() {
        if let Some(first) = pipes[..i].iter().find(|first| is_same_file(first, second)) {
            let (first, second) = (first.display().to_string(), second.display().to_string());
            return Err(IoError::SharedPipe { first, second });
        }
    }
    Ok(())
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    let path = if path.as_os_str() == "-" { Path::new("/dev/stdin") } else { path };
    path.metadata().is_ok_and(|known| known.file_type().is_fifo() || known.file_type().is_socket())
}

#[cfg(not(unix))]
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::PcmFormat;

    fn raw(channels: usize) -> ReadOptions<'static> {
        ReadOptions { coding: Coding::Raw(PcmFormat::S8), channels, ..ReadOptions::files() }
    }

    /// A reader of one input whose thread does `send_all`.
    fn reader(
        send_all: impl FnOnce(Sender<Result<Message, IoError>>, Receiver<Vec<u8>>) + Send + 'static,
    ) -> MultiReader {
        let header =
            InputSource { path: "x".into(), coding: raw(1).coding, channels: 1, turns: None, block: 4 }
                .raw_header();
        let input = Input::on_thread_of("dying".into(), header, send_all).unwrap();
        let (stop, until) = (crossbeam_channel::never(), Until::Shortest);
        MultiReader { inputs: vec![input], stop, until, ready: 0, consumed: 0 }
    }

    #[test]
    fn a_reader_that_dies_is_an_error_and_not_the_end_of_its_input() {
        let mut reader = reader(|messages, _| {
            messages.send(Ok(Message::Frames { bytes: vec![1, 2, 3], filled: 3 })).unwrap();
            // As when it panics: the channel closes without an end.
        });
        assert_eq!(reader.wait().unwrap(), Arrival::Frames(3));
        reader.consume(3);
        let error = reader.wait().unwrap_err();
        assert!(matches!(&error, IoError::ReaderDied { file } if file == "dying"), "{error}");
    }

    #[test]
    fn a_panic_in_a_reader_is_an_error_too() {
        let mut reader = reader(|_messages, _| panic!("a reader that panics, for this test"));
        assert!(matches!(reader.wait(), Err(IoError::ReaderDied { .. })));
    }

    #[test]
    fn an_input_that_ends_is_no_error() {
        let mut reader = reader(|messages, _| messages.send(Ok(Message::End { faults: vec![] })).unwrap());
        assert_eq!(reader.wait().unwrap(), Arrival::End);
    }

    #[test]
    fn converters_in_turn_are_the_channels_of_one_input() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.raw");
        // Four turns of three converters, and two samples of a fifth.
        std::fs::write(&path, (0u8..14).collect::<Vec<_>>()).unwrap();
        let turns = Turns::by_delay(&[0.0, 2.0, 1.0]);
        let options = ReadOptions { turns: Some(&turns), ..raw(1) };
        let started = MultiReader::start(&[path], options, crossbeam_channel::never()).unwrap();
        let mut reader = started.unwrap();
        assert_eq!(reader.channels(), 3);
        let mut bytes: Vec<u8> = Vec::new();
        while let Arrival::Frames(frames) = reader.wait().unwrap() {
            bytes.extend(reader.frames()[0].bytes);
            reader.consume(frames);
        }
        assert_eq!(bytes, [2, 0, 1, 5, 3, 4, 8, 6, 7, 11, 9, 10]);
        let faults: Vec<_> = reader.warnings().into_iter().map(|warning| warning.fault).collect();
        assert_eq!(faults, [InputFault::CutFrame { bytes: 2 }]);
    }

    #[test]
    fn more_lost_samples_than_allowed_are_refused_with_the_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.raw");
        std::fs::write(&path, [0; 8]).unwrap();
        let lines = r#"{"sample_start": 0, "global_index": 0}
            {"sample_start": 1, "global_index": 41}
            {"sample_start": 2, "global_index": 82}"#;
        let lost = LostSamples::parse(lines, "lost").unwrap();
        let start = |max_lost| {
            let options = ReadOptions { lost: Some(&lost), max_lost, ..raw(1) };
            MultiReader::start(std::slice::from_ref(&path), options, crossbeam_channel::never())
        };
        assert!(start(80).is_ok());
        let error = start(79).err().unwrap().to_string();
        assert!(error.contains("80 samples were lost in all, more than 79"), "{error}");
        assert!(error.contains("--max-lost 80"), "{error}");
    }
}
