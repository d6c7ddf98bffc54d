//! One input of several: its thread, its frames in the order of time, and what was tolerated.

use super::aligned_input::AlignedInput;
use super::block::Block;
use super::capture::InputNotes;
use super::frames::{InputFrames, Message};
use super::grouped::GroupedInput;
use super::lost::LostInInput;
use super::open::InputSource;
use super::pipe::is_file;
use super::stall::{PATIENCE, Wait};
use super::{InputFault, IoError, StreamHeader};
use crossbeam_channel::{Receiver, Sender, bounded, select};
use std::thread;

/// Number of blocks in the pool of each input: one is read and one is used while two wait.
pub(super) const BLOCKS: usize = 4;

/// Sends all messages of an input until its end, or until the receiver is gone. Blocks to fill come from
/// `pool`.
fn send_all(source: &InputSource, messages: &Sender<Result<Message, IoError>>, pool: &Receiver<Block>) {
    let end = || -> Result<Message, IoError> {
        let mut frames = InputFrames::open(source)?;
        let notes = frames.capture().notes().grouped(source.samples_per_frame());
        let notes = Box::new(notes.map_err(IoError::unfit(&source.name()))?);
        let _ = messages.send(Ok(Message::Header { header: frames.header, notes }));
        while let Ok(mut block) = pool.recv() {
            block.begin(&frames.header);
            while block.frames() == 0 && !frames.ended() {
                frames.read_some(&mut block)?;
            }
            if block.frames() == 0 || messages.send(Ok(Message::Frames(block))).is_err() {
                break;
            }
        }
        // A pipe may stay open after the samples.
        let chunks = if is_file(&source.path) { frames.capture().chunks_after() } else { Vec::new() };
        Ok(Message::End { faults: frames.faults(), chunks })
    };
    // If the receiver is gone, the message is not needed.
    let _ = messages.send(end());
}

/// One input on the side of the consumer.
pub(super) struct Input {
    pub(super) name: String,
    pub(super) grouped: GroupedInput,
    /// From its thread, to which blocks go back by the pool.
    messages: Receiver<Result<Message, IoError>>,
    pool: Sender<Block>,
    /// What it says besides its samples.
    pub(super) notes: InputNotes,
    faults: Vec<InputFault>,
}

impl Input {
    pub(super) fn on_thread(source: InputSource) -> Result<Self, IoError> {
        // Until the header comes, the channels are those of the settings; they may not fit these.
        let settings = source.raw_header();
        let header = source.chosen(settings).unwrap_or(settings);
        let name = source.name();
        let per_frame = source.per_frame;
        let send = move |messages, pool| send_all(&source, &messages, &pool);
        Self::on_thread_of(name, header, per_frame, send)
    }

    /// An input whose messages a new thread sends, with a pool of blocks to fill.
    pub(super) fn on_thread_of(
        name: String,
        header: StreamHeader,
        per_frame: usize,
        send_all: impl FnOnce(Sender<Result<Message, IoError>>, Receiver<Block>) + Send + 'static,
    ) -> Result<Self, IoError> {
        let (message_sender, messages) = bounded(BLOCKS + 2);
        let (pool, pool_out) = bounded(BLOCKS);
        (0..BLOCKS).for_each(|_| {
            // The channel has room for all blocks.
            let _ = pool.send(Block::default());
        });
        let thread = thread::Builder::new().name("input".into());
        thread
            .spawn(move || send_all(message_sender, pool_out))
            .map_err(IoError::system(&name, "start a thread that reads it"))?;
        Ok(Self {
            name,
            grouped: GroupedInput::new(AlignedInput::new(header), per_frame),
            messages,
            pool,
            notes: InputNotes::default(),
            faults: Vec::new(),
        })
    }

    /// Waits for the next message; false if a stop was asked for first.
    pub(super) fn receive(&mut self, stop: &Receiver<()>, mut wait: Wait<'_>) -> Result<bool, IoError> {
        let message = loop {
            select! {
                // A reader that has come to the end of its input says so.
                recv(self.messages) -> message => match message {
                    Ok(message) => break message?,
                    Err(_) => return Err(self.unfit(
                        "its reader ended before it did; this is a fault of hybank, please report it".into(),
                    )),
                },
                recv(stop) -> _ => return Ok(false),
                default(PATIENCE) => wait.go_on(),
            }
        };
        wait.end();
        self.take(message);
        Ok(true)
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Header { header, notes } => {
                self.grouped = GroupedInput::new(AlignedInput::new(header), self.grouped.per_frame());
                self.notes = InputNotes { per_frame: self.grouped.per_frame(), ..*notes };
            }
            Message::Frames(block) => {
                let used = self.grouped.aligned.refill(block);
                self.give_back(used);
            }
            Message::End { faults, chunks } => {
                self.grouped.aligned.end();
                self.faults = faults;
                self.notes.chunks.extend(chunks);
            }
        }
    }

    pub(super) fn advance(&mut self, frames: usize) {
        self.grouped.advance(frames);
        if let Some(used) = self.grouped.aligned.take_used() {
            self.give_back(used);
        }
    }

    fn give_back(&mut self, block: Block) {
        if !block.parts.is_empty() {
            // A thread that has ended needs no blocks.
            let _ = self.pool.send(block);
        }
    }

    /// The input's own timestamps go together with dropouts given beside it, but not with other timestamps.
    pub(super) fn take_timestamps(&mut self, lost: &mut LostInInput) -> Result<(), IoError> {
        if self.notes.timestamps.is_empty() {
            return Ok(());
        }
        if !lost.timestamps.is_empty() {
            return Err(
                self.unfit("it has captures of its own; leave out the lines with sample_start".into())
            );
        }
        lost.timestamps = self.notes.timestamps.clone();
        Ok(())
    }

    pub(super) fn unfit(&self, problem: String) -> IoError {
        IoError::unfit(&self.name)(problem)
    }

    pub(super) fn faults(&self) -> impl Iterator<Item = InputFault> {
        let beyond = self.grouped.is_over() && self.grouped.aligned.has_unreached_breaks();
        let unrated = self.notes.sigmf.is_some() && self.grouped.aligned.header.rate.is_none();
        let unrated = unrated.then_some(InputFault::NoRate);
        unrated
            .into_iter()
            .chain(self.faults.iter().copied())
            .chain(beyond.then_some(InputFault::TimestampsBeyondEnd))
    }

    /// Frames that were not used.
    pub(super) fn unused(&self) -> Option<InputFault> {
        let aligned = &self.grouped.aligned;
        let seen = aligned.seen();
        let promised = if aligned.is_over() { None } else { aligned.header.promised };
        let left = (aligned.left() + self.grouped.begun()) as u64;
        let frames = promised.unwrap_or(0).max(seen) - (seen.saturating_sub(left));
        let at_least = promised.is_none() && !aligned.ended();
        (frames > 0).then_some(InputFault::Unused { frames, at_least })
    }
}

/// The message for more lost frames than are allowed.
pub(super) fn too_many_lost(frames: u64, most: u64) -> String {
    format!(
        "{frames} frames were lost in all, more than {most}; check the numbers, or allow {frames} to be lost"
    )
}
