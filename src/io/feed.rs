//! Samples as they arrive: a thread for each input, whole ticks to the consumer as soon as every
//! input has its part.
//!
//! Memory is bounded: each input has a few blocks that go round between its thread and the
//! consumer. A consumer that does not keep up stops the reading, and thereby the writers of the
//! pipes.

use super::wav::{WavHeader, WavReader};
use super::{FrameReader, IoError, PcmFormat, PcmFrames, SampleLayout};
use crossbeam_channel::{Receiver, Sender, bounded, select};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::thread;

/// Blocks that go round for each input, and their size.
const BLOCKS: usize = 4;
const BLOCK_BYTES: usize = 128 << 10;
/// Pipes are widened to this where the system allows it; 64 KiB would halve the throughput
/// between two processors.
const PIPE_BYTES: usize = 1 << 20;

/// How the bytes of the inputs are to be understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Raw samples.
    Raw(PcmFormat),
    /// A WAV header says.
    Wav,
}

/// What an input's thread has to say.
enum Message {
    /// The header, always first.
    Shape(Shape),
    /// Whole frames.
    Frames { bytes: Vec<u8>, filled: usize },
    /// The end, with the faults that were tolerated.
    End { notes: Vec<String> },
}

/// What the frames of an input are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shape {
    layout: SampleLayout,
    channels: usize,
    rate: Option<u32>,
}

/// What happened while waiting for ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// So many ticks are there, at least 1.
    Ticks(usize),
    /// One of the inputs has ended.
    End,
    /// The stop channel spoke.
    Stopped,
}

/// One input, seen from the consumer.
struct Input {
    name: String,
    shape: Shape,
    full: Receiver<Result<Message, IoError>>,
    free: Sender<Vec<u8>>,
    /// The block in use: bytes, how many are filled and how many are used up.
    block: Option<(Vec<u8>, usize, usize)>,
    ended: bool,
    notes: Vec<String>,
}

/// The inputs of a stream.
pub struct Feed {
    inputs: Vec<Input>,
    stop: Receiver<()>,
}

impl Feed {
    /// Starts reading. One path is an input with all `channels`, interleaved; several are one channel
    /// each. `-` is standard input. With [`Coding::Wav`] this waits for the headers.
    ///
    /// # Errors
    /// [`IoError`] for a header that is not plain PCM; `Ok(None)` if `stop` spoke first.
    pub fn start(
        paths: &[PathBuf],
        coding: Coding,
        channels: usize,
        stop: Receiver<()>,
    ) -> Result<Option<Self>, IoError> {
        let each = if paths.len() == 1 { channels } else { 1 };
        let mut feed = Self { inputs: Vec::new(), stop };
        // All threads first: opening a FIFO waits for its writer, in whatever order they come.
        for path in paths {
            feed.inputs.push(spawn(path, coding, each));
        }
        for i in 0..paths.len() {
            if feed.wait_for(i)? == Arrival::Stopped {
                return Ok(None);
            }
        }
        Ok(Some(feed))
    }

    /// N, the channels of all inputs together.
    pub fn channels(&self) -> usize {
        self.inputs.iter().map(|input| input.shape.channels).sum()
    }

    /// Name, channels and sample rate (where a header says) of each input.
    pub fn headers(&self) -> impl Iterator<Item = (&str, usize, Option<u32>)> {
        self.inputs.iter().map(|input| (input.name.as_str(), input.shape.channels, input.shape.rate))
    }

    /// Waits until every input has a tick.
    ///
    /// # Errors
    /// The system's refusal to read one of them.
    pub fn wait(&mut self) -> Result<Arrival, IoError> {
        for i in 0..self.inputs.len() {
            while self.inputs[i].frames().frames() == 0 {
                if self.inputs[i].ended {
                    return Ok(Arrival::End);
                }
                if self.wait_for(i)? == Arrival::Stopped {
                    return Ok(Arrival::Stopped);
                }
            }
        }
        Ok(Arrival::Ticks(self.inputs.iter().map(|input| input.frames().frames()).min().unwrap_or(0)))
    }

    /// The ticks that are there, as many as [`Feed::wait`] said.
    pub fn frames(&self) -> Vec<PcmFrames<'_>> {
        self.inputs.iter().map(Input::frames).collect()
    }

    /// Gives back the first `ticks` ticks.
    pub fn consume(&mut self, ticks: usize) {
        self.inputs.iter_mut().for_each(|input| input.consume(ticks));
    }

    /// What had to be tolerated so far.
    pub fn notes(&self) -> Vec<String> {
        let named = |input: &Input, note: &str| format!("{}: {note}", input.name);
        let faults =
            self.inputs.iter().flat_map(|input| input.notes.iter().map(move |note| named(input, note)));
        let left = self.inputs.iter().filter(|input| input.frames().frames() > 0).map(|input| {
            let frames = input.frames().frames();
            named(input, &format!("another input ended first, at least {frames} samples a channel were left"))
        });
        faults.chain(left).collect()
    }

    /// Takes one message of input i.
    fn wait_for(&mut self, i: usize) -> Result<Arrival, IoError> {
        let input = &mut self.inputs[i];
        select! {
            recv(input.full) -> message => match message {
                Ok(message) => input.take(message?),
                Err(_) => input.ended = true,
            },
            recv(self.stop) -> _ => return Ok(Arrival::Stopped),
        }
        Ok(Arrival::Ticks(0))
    }
}

impl Input {
    fn frames(&self) -> PcmFrames<'_> {
        let bytes = self.block.as_ref().map_or(&[][..], |(bytes, filled, used)| &bytes[*used..*filled]);
        PcmFrames { layout: self.shape.layout, channels: self.shape.channels, bytes }
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Shape(shape) => self.shape = shape,
            Message::Frames { bytes, filled } => self.block = Some((bytes, filled, 0)),
            Message::End { notes } => {
                self.ended = true;
                self.notes = notes;
            }
        }
    }

    fn consume(&mut self, ticks: usize) {
        let size = self.frames().frame_bytes();
        if let Some((_, filled, used)) = &mut self.block {
            *used += ticks * size;
            if *used < *filled {
                return;
            }
        }
        if let Some((bytes, _, _)) = self.block.take() {
            // A thread that has ended needs no blocks.
            let _ = self.free.send(bytes);
        }
    }
}

fn spawn(path: &Path, coding: Coding, channels: usize) -> Input {
    let (full_in, full) = bounded(BLOCKS + 2);
    let (free, free_out) = bounded(BLOCKS);
    let name = if path.as_os_str() == "-" { "standard input".into() } else { path.display().to_string() };
    let format = if let Coding::Raw(format) = coding { format } else { PcmFormat::F32Le };
    let shape = Shape { layout: SampleLayout::packed(format), channels, rate: None };
    let reader = Reader { path: path.to_owned(), name: name.clone(), full: full_in, free: free_out };
    (0..BLOCKS).for_each(|_| {
        // The channel has room for all blocks.
        let _ = free.send(Vec::new());
    });
    thread::spawn(move || reader.run(coding, shape));
    Input { name, shape, full, free, block: None, ended: false, notes: Vec::new() }
}

/// The thread's side of an input.
struct Reader {
    path: PathBuf,
    name: String,
    full: Sender<Result<Message, IoError>>,
    free: Receiver<Vec<u8>>,
}

impl Reader {
    fn run(self, coding: Coding, shape: Shape) {
        let end = match coding {
            Coding::Raw(_) => self.read_raw(shape),
            Coding::Wav => self.read_wav(),
        };
        // If nobody listens any more there is nobody to tell.
        let _ = self.full.send(end);
    }

    fn open(&self) -> Result<Box<dyn Read>, IoError> {
        if self.path.as_os_str() == "-" {
            return Ok(Box::new(stdin_file().map_err(IoError::system(&self.name, "open it"))?));
        }
        let file = File::open(&self.path).map_err(IoError::system(&self.name, "open it"))?;
        widen_pipe(&file);
        Ok(Box::new(file))
    }

    fn read_raw(&self, shape: Shape) -> Result<Message, IoError> {
        // Sent before opening, which may have to wait for a writer.
        let _ = self.full.send(Ok(Message::Shape(shape)));
        let mut frames = FrameReader::new(self.open()?, shape.layout.container * shape.channels, None);
        self.pump(&mut frames)?;
        let cut = frames.cut_bytes();
        let note = format!("the last frame is cut ({cut} bytes of it are there) and was left out");
        Ok(Message::End { notes: Vec::from_iter((cut > 0).then_some(note)) })
    }

    fn read_wav(&self) -> Result<Message, IoError> {
        let mut reader = WavReader::new(self.open()?, &self.name)?;
        let WavHeader { layout, channels, rate, .. } = *reader.header();
        let _ = self.full.send(Ok(Message::Shape(Shape { layout, channels, rate: Some(rate) })));
        self.pump(reader.frames())?;
        Ok(Message::End { notes: reader.notes().iter().map(ToString::to_string).collect() })
    }

    /// Frames to the consumer until the end, or until the consumer is gone.
    fn pump(&self, frames: &mut FrameReader<impl Read>) -> Result<(), IoError> {
        while let Ok(mut bytes) = self.free.recv() {
            bytes.resize(BLOCK_BYTES.max(frames.frame_bytes()), 0);
            let filled =
                frames.take_ready(&mut bytes).map_err(IoError::system(&self.name, "read the samples"))?;
            if filled == 0 || self.full.send(Ok(Message::Frames { bytes, filled })).is_err() {
                break;
            }
        }
        Ok(())
    }
}

/// Standard input without the buffer that the library's handle shares between threads.
#[cfg(unix)]
fn stdin_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    let file = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

#[cfg(not(unix))]
fn stdin_file() -> io::Result<io::Stdin> {
    Ok(io::stdin())
}

/// Standard output without line buffering.
///
/// # Errors
/// The system's refusal to duplicate the descriptor.
#[cfg(unix)]
pub fn stdout_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    widen_pipe(&file);
    Ok(file)
}

/// Standard output.
///
/// # Errors
/// None here.
#[cfg(not(unix))]
pub fn stdout_file() -> io::Result<io::Stdout> {
    Ok(io::stdout())
}

/// Files that are no pipes, and systems that refuse, stay as they are.
#[cfg(target_os = "linux")]
fn widen_pipe(file: &File) {
    let _ = rustix::pipe::fcntl_setpipe_size(file, PIPE_BYTES);
}

#[cfg(not(target_os = "linux"))]
fn widen_pipe(_: &File) {}
