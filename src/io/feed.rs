//! Samples as they arrive: a thread for each input, whole ticks to the consumer as soon as every
//! input has its part. Raw standard input that is alone needs no thread.
//!
//! Memory is bounded: each input has a few blocks that go round between its thread and the
//! consumer. A consumer that does not keep up stops the reading, and thereby the writers of the
//! pipes.

#[cfg(target_os = "linux")]
use super::direct::Direct;
use super::lane::{Block, Lane};
use super::lost::{LostOfInput, LostSamples};
use super::reader::{Opening, Said, read};
use super::sequence::Sequence;
use super::{IoError, PcmFormat, PcmFrames};
use crossbeam_channel::{Receiver, Sender, bounded, select};
use std::path::PathBuf;
use std::thread;

/// Blocks that go round for each input.
const BLOCKS: usize = 4;
/// Bytes of a block that suit one thread.
pub const BLOCK_BYTES: usize = 128 << 10;
/// All blocks of all inputs together, unless that would make them smaller than a page.
const ALL_BYTES: usize = 16 << 20;

/// How the bytes of the inputs are to be understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Raw samples.
    Raw(PcmFormat),
    /// A WAV header says.
    Wav,
}

/// Which input decides when the feed ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Until {
    /// The first one to end; what the others have left is not used.
    #[default]
    Shortest,
    /// The last one to end; samples of the others are lost from their end on.
    Longest,
}

/// How inputs are read.
#[derive(Debug, Clone, Copy)]
pub struct FeedOptions<'a> {
    /// Of all inputs but SigMF recordings.
    pub coding: Coding,
    /// Channels of a raw input, if it is the only one; several have one each.
    pub channels: usize,
    /// What is known of lost samples.
    pub lost: Option<&'a LostSamples>,
    /// Which input decides when the feed ends.
    pub until: Until,
    /// The most bytes of an input that are read at a time; less if there are many inputs.
    pub block_bytes: usize,
}

impl FeedOptions<'_> {
    /// Files with headers, nothing lost.
    pub fn files() -> Self {
        Self {
            coding: Coding::Wav,
            channels: 1,
            lost: None,
            until: Until::Shortest,
            block_bytes: BLOCK_BYTES,
        }
    }
}

/// What happened while waiting for ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// So many ticks are there, at least 1.
    Ticks(usize),
    /// The inputs have ended.
    End,
    /// The stop channel spoke.
    Stopped,
}

/// One input, seen from the consumer.
struct Input {
    name: String,
    lane: Lane,
    source: Source,
    /// When its frames were taken, as far as the input itself knows.
    sequence: Sequence,
    notes: Vec<String>,
}

/// Where an input's frames come from.
enum Source {
    /// Its thread, to which blocks go back.
    Thread { said: Receiver<Result<Said, IoError>>, free: Sender<Vec<u8>> },
    /// Standard input itself.
    #[cfg(target_os = "linux")]
    Direct(Direct),
}

/// The inputs of a stream.
pub struct Feed {
    inputs: Vec<Input>,
    stop: Receiver<()>,
    until: Until,
    /// Ticks at hand.
    ready: usize,
    ticks: u64,
}

impl Feed {
    /// Starts reading and waits for the headers. `-` is standard input. A name that ends in sigmf-meta or
    /// sigmf-data is a SigMF recording, everything else is as [`FeedOptions::coding`] says. Time counts from the
    /// earliest sample whose number is known: inputs that join late begin with lost samples.
    ///
    /// # Errors
    /// [`IoError`] for what cannot be read or is not plain PCM, and for lost samples that do not fit the inputs;
    /// `Ok(None)` if `stop` spoke first.
    pub fn start(
        paths: &[PathBuf],
        options: FeedOptions<'_>,
        stop: Receiver<()>,
    ) -> Result<Option<Self>, IoError> {
        let channels = if paths.len() == 1 { options.channels } else { 1 };
        let block = (ALL_BYTES / BLOCKS / paths.len().max(1)).min(options.block_bytes).max(4096);
        // All threads first: opening a FIFO waits for its writer, in whatever order they come.
        let opening =
            |path: &PathBuf| Opening { path: path.clone(), coding: options.coding, channels, block };
        let inputs = match paths {
            [path] => vec![alone(opening(path))?],
            _ => paths.iter().map(|path| spawn(opening(path))).collect(),
        };
        let mut feed = Self { inputs, stop, until: options.until, ready: 0, ticks: 0 };
        for i in 0..paths.len() {
            if feed.inputs[i].has_header() && !feed.hear(i)? {
                return Ok(None);
            }
        }
        feed.place_in_time(options.lost)?;
        Ok(Some(feed))
    }

    /// N, the channels of all inputs together.
    pub fn channels(&self) -> usize {
        self.headers().map(|(_, channels, _)| channels).sum()
    }

    /// Name, channels and sample rate (hertz, where a header says) of each input.
    pub fn headers(&self) -> impl Iterator<Item = (&str, usize, Option<f64>)> {
        let shape = |input: &Input| input.lane.shape;
        self.inputs.iter().map(move |input| (input.name.as_str(), shape(input).channels, shape(input).rate))
    }

    /// Ticks that the headers promise, if any of them says.
    pub fn promised_ticks(&self) -> Option<u64> {
        self.inputs.iter().filter_map(|input| input.lane.shape.promised).min()
    }

    /// Waits until every input has a tick.
    ///
    /// # Errors
    /// The system's refusal to read one of them.
    pub fn wait(&mut self) -> Result<Arrival, IoError> {
        for i in 0..self.inputs.len() {
            while self.inputs[i].lane.waits() {
                if !self.hear(i)? {
                    return Ok(Arrival::Stopped);
                }
            }
        }
        let lanes = || self.inputs.iter().map(|input| &input.lane);
        let over = lanes().filter(|lane| lane.is_over()).count();
        let end = if self.until == Until::Shortest { over > 0 } else { over == self.inputs.len() };
        if end {
            self.ready = 0;
            return Ok(Arrival::End);
        }
        self.ready = lanes().filter(|lane| !lane.is_over()).map(Lane::ready).min().unwrap_or(0);
        self.inputs.iter_mut().for_each(|input| input.lane.prepare(self.ready));
        Ok(Arrival::Ticks(self.ready))
    }

    /// The ticks that are there, as many as [`Feed::wait`] said. Lost samples are NaN.
    pub fn frames(&self) -> Vec<PcmFrames<'_>> {
        self.inputs.iter().map(|input| input.lane.view(self.ready)).collect()
    }

    /// Gives back the first `ticks` ticks, at most those that are there.
    pub fn consume(&mut self, ticks: usize) {
        let ticks = ticks.min(self.ready);
        self.inputs.iter_mut().for_each(|input| input.advance(ticks));
        self.ready = 0;
        self.ticks += ticks as u64;
    }

    /// Ticks consumed.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// What had to be tolerated so far.
    pub fn notes(&self) -> Vec<String> {
        let one_ended = self.inputs.iter().any(|input| input.lane.is_over());
        let named = |input: &Input| {
            let name = input.name.clone();
            let left = if one_ended { input.left() } else { None };
            input.faults().chain(left).map(move |note| format!("{name}: {note}")).collect::<Vec<_>>()
        };
        self.inputs.iter().flat_map(named).collect()
    }

    /// Waits for what input i has to say next; false if `stop` spoke first.
    fn hear(&mut self, i: usize) -> Result<bool, IoError> {
        let input = &mut self.inputs[i];
        let news = match &mut input.source {
            Source::Thread { said, .. } => select! {
                // A thread that says nothing more has come to its end.
                recv(said) -> said => Some(said.unwrap_or_else(|_| Ok(Said::End { notes: Vec::new() }))?),
                recv(self.stop) -> _ => None,
            },
            #[cfg(target_os = "linux")]
            Source::Direct(direct) => direct.hear(&self.stop)?,
        };
        let heard = news.is_some();
        news.into_iter().for_each(|said| input.take(said));
        Ok(heard)
    }

    /// One time axis for all inputs.
    fn place_in_time(&mut self, told: Option<&LostSamples>) -> Result<(), IoError> {
        let channels: Vec<_> = self.headers().map(|(_, channels, _)| channels).collect();
        let lost = match told {
            Some(told) => told.of_inputs(&channels)?,
            None => vec![LostOfInput::default(); channels.len()],
        };
        let mut inputs: Vec<_> = self.inputs.iter_mut().zip(lost).collect();
        for (input, lost) in &mut inputs {
            input.take_sequence(lost)?;
        }
        let origin = inputs.iter().filter_map(|(_, lost)| lost.sequence.beginning()).min().unwrap_or(0);
        for (input, lost) in inputs {
            let stretches = lost.sequence.stretches(origin);
            let stretches = stretches.map_err(|problem| input.out_of_time(problem))?;
            input.lane.lose(stretches, lost);
        }
        Ok(())
    }
}

impl Input {
    /// Whether the first thing that its source says is what its frames are.
    fn has_header(&self) -> bool {
        matches!(self.source, Source::Thread { .. })
    }

    fn take(&mut self, said: Said) {
        match said {
            Said::Shape { shape, sequence } => {
                self.lane = Lane::new(shape);
                self.sequence = sequence;
            }
            Said::Frames { bytes, filled } => {
                let used = self.lane.refill(Block { bytes, filled });
                self.give_back(used);
            }
            Said::End { notes } => {
                self.lane.end();
                self.notes = notes;
            }
        }
    }

    fn advance(&mut self, ticks: usize) {
        self.lane.advance(ticks);
        if let Some(used) = self.lane.take_used() {
            self.give_back(used);
        }
    }

    fn give_back(&mut self, block: Block) {
        if block.bytes.is_empty() {
            return;
        }
        match &mut self.source {
            // A thread that has ended needs no blocks.
            Source::Thread { free, .. } => drop(free.send(block.bytes)),
            #[cfg(target_os = "linux")]
            Source::Direct(direct) => direct.give_back(block.bytes),
        }
    }

    /// The input's own sequence goes with what is told beside it, but not against it.
    fn take_sequence(&mut self, lost: &mut LostOfInput) -> Result<(), IoError> {
        if self.sequence.is_empty() {
            return Ok(());
        }
        if !lost.sequence.is_empty() {
            return Err(
                self.out_of_time("it has captures of its own; leave out the lines with sample_start".into())
            );
        }
        lost.sequence = std::mem::take(&mut self.sequence);
        Ok(())
    }

    fn out_of_time(&self, problem: String) -> IoError {
        IoError::Lost { file: self.name.clone(), problem }
    }

    fn faults(&self) -> impl Iterator<Item = String> {
        let ended = self.lane.is_over();
        let unreached = "it ends before the last of the samples whose number is told";
        let unreached = (ended && self.lane.has_unreached_stretches()).then(|| unreached.into());
        self.notes.iter().cloned().chain(unreached)
    }

    /// Frames that nobody used.
    fn left(&self) -> Option<String> {
        let seen = self.lane.seen();
        let promised = if self.lane.is_over() { None } else { self.lane.shape.promised };
        let left = promised.unwrap_or(0).max(seen) - (seen - self.lane.left() as u64);
        let at_least = if promised.is_some() || self.lane.ended() { "" } else { "at least " };
        let what = "longer than the shortest channel";
        (left > 0).then(|| format!("{what}, {at_least}{left} samples a channel were left"))
    }
}

/// The only input.
#[cfg(target_os = "linux")]
fn alone(opening: Opening) -> Result<Input, IoError> {
    if !opening.is_stdin() || opening.coding == Coding::Wav {
        return Ok(spawn(opening));
    }
    let (name, direct) = (opening.name(), Direct::new(&opening)?);
    let lane = Lane::new(direct.shape);
    let source = Source::Direct(direct);
    Ok(Input { name, lane, source, sequence: Sequence::default(), notes: Vec::new() })
}

/// The only input.
#[cfg(not(target_os = "linux"))]
fn alone(opening: Opening) -> Result<Input, IoError> {
    Ok(spawn(opening))
}

fn spawn(opening: Opening) -> Input {
    let (say, said) = bounded(BLOCKS + 2);
    let (free, free_out) = bounded(BLOCKS);
    (0..BLOCKS).for_each(|_| {
        // The channel has room for all blocks.
        let _ = free.send(Vec::new());
    });
    let name = opening.name();
    let lane = Lane::new(opening.raw_shape());
    thread::spawn(move || read(opening, say, free_out));
    let source = Source::Thread { said, free };
    Input { name, lane, source, sequence: Sequence::default(), notes: Vec::new() }
}
