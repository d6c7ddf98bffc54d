//! Reads several inputs as their samples arrive, with one thread per input. The consumer gets a frame as
//! soon as every input has its samples of it.
//!
//! Memory is bounded: each input has a pool of a few blocks that circulate between its thread and the
//! consumer. If the consumer is slow, reading stops, and so do the writers of the pipes.

use super::grouped::GroupedInput;
use super::input::{BLOCKS, Input, too_many_lost};
use super::lost::{LostInInput, LostSamples};
use super::notes::{OutputNotes, Placement};
use super::open::InputSource;
use super::pipe::refuse_shared_pipes;
use super::stall::{OnStall, Wait};
use super::{InputWarning, IoError, ReadOptions, RecordedFrames, StreamHeader, Until};
use crossbeam_channel::Receiver;
use std::path::PathBuf;

/// All blocks of all inputs together, unless that would make them smaller than a page: as much as a cache of
/// the last level holds.
const ALL_BYTES: usize = 16 << 20;

/// Each takes a thread; no spec has more channels.
const MOST_INPUTS: usize = 1024;

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

/// Several inputs, read side by side into frames.
///
/// [`MultiReader::wait`] until frames are there, use [`MultiReader::frames`], and [`MultiReader::consume`]
/// them.
pub struct MultiReader {
    inputs: Vec<Input>,
    stop: Receiver<()>,
    until: Until,
    max_lost: u64,
    /// Number of the earliest frame at the converter.
    origin: u64,
    /// Frames at hand.
    ready: usize,
    consumed: u64,
}

impl MultiReader {
    /// Starts reading and waits for the headers; tells `on_stall` of those that do not come. `-` is standard
    /// input. A name that ends in sigmf-meta or sigmf-data is a SigMF recording, everything else is as
    /// [`ReadOptions::coding`] says. Time counts from the earliest sample whose number is known: inputs that
    /// join late begin with lost samples.
    ///
    /// # Errors
    /// [`IoError`] for an input that cannot be read or is not plain PCM, for a pipe that is given twice,
    /// for lost samples that do not fit the inputs or are more than [`ReadOptions::max_lost`], and for a
    /// thread that cannot be started.
    pub fn start(
        paths: &[PathBuf],
        options: ReadOptions<'_>,
        on_stall: OnStall<'_>,
    ) -> Result<Self, IoError> {
        if let Some(path) = paths.get(MOST_INPUTS) {
            let problem =
                format!("it is one of {} inputs; at most {MOST_INPUTS} are read together", paths.len());
            return Err(IoError::unfit(&path.display().to_string())(problem));
        }
        refuse_shared_pipes(paths)?;
        let block = (ALL_BYTES / BLOCKS / paths.len().max(1)).min(options.block_bytes).max(4096);
        let interleaving = options.interleaving.filter(|_| paths.len() == 1);
        let source = |(i, path): (usize, &PathBuf)| InputSource {
            path: path.clone(),
            coding: options.coding,
            channels: options.channels,
            only: options.only,
            is_iq: options.is_iq,
            scale: options.scale,
            table: options.table.clone(),
            interleaving: interleaving.cloned(),
            per_frame: options.samples_per_frame.get(i).copied().unwrap_or(1),
            block,
        };
        let sources: Vec<InputSource> = paths.iter().enumerate().map(source).collect();
        if let Some(first) = sources.first()
            && options.table.is_layout_given()
            && !sources.iter().any(InputSource::is_table)
        {
            let problem =
                "it is no table, so leave out the options of tables (columns, delimiters, lines to skip)";
            return Err(IoError::unfit(&first.name())(problem.into()));
        }
        // All threads first: opening a FIFO waits for its writer, in whatever order they come.
        let inputs = sources.into_iter().map(Input::on_thread);
        let inputs = inputs.collect::<Result<_, _>>()?;
        let ReadOptions { until, max_lost, lost, .. } = options;
        let stop = crossbeam_channel::never();
        let mut reader = Self { inputs, stop, until, max_lost, origin: 0, ready: 0, consumed: 0 };
        for i in 0..paths.len() {
            reader.receive(i, on_stall)?;
        }
        reader.refuse_some_complex()?;
        reader.align(lost)?;
        Ok(reader)
    }

    /// From now on a message on `stop` ends any wait.
    pub fn stop_at(&mut self, stop: Receiver<()>) {
        self.stop = stop;
    }

    /// N, the samples of a frame: those of all channels of all inputs.
    pub fn channels(&self) -> usize {
        self.inputs
            .iter()
            .map(|input| input.grouped.aligned.header.channels * input.grouped.per_frame())
            .sum()
    }

    /// True if the samples are complex.
    pub fn is_complex(&self) -> bool {
        self.headers().any(|(_, header)| header.is_complex)
    }

    /// Name and header of each input.
    pub fn headers(&self) -> impl Iterator<Item = (&str, &StreamHeader)> {
        self.inputs.iter().map(|input| (input.name.as_str(), &input.grouped.aligned.header))
    }

    /// Samples of each channel of each input in a frame.
    pub fn samples_per_frame(&self) -> Vec<usize> {
        self.inputs.iter().map(|input| input.grouped.per_frame()).collect()
    }

    /// Number of frames according to the headers, if any header states it.
    pub fn promised_frames(&self) -> Option<u64> {
        let grouped = self.inputs.iter().map(|input| &input.grouped);
        grouped.filter_map(|input| Some(input.aligned.header.promised? / input.per_frame() as u64)).min()
    }

    /// Waits until every input has a frame, and tells `on_stall` of those that give none.
    ///
    /// # Errors
    /// The system's refusal to read one of them.
    pub fn wait(&mut self, on_stall: OnStall<'_>) -> Result<Arrival, IoError> {
        for i in 0..self.inputs.len() {
            self.inputs[i].grouped.gather(false);
            while self.inputs[i].grouped.waits() {
                if !self.receive(i, on_stall)? {
                    return Ok(Arrival::Stopped);
                }
                self.inputs[i].grouped.gather(false);
            }
        }
        if self.until == Until::Longest {
            self.inputs
                .iter_mut()
                .filter(|input| input.grouped.is_over())
                .for_each(|input| input.grouped.gather(true));
        }
        let grouped = || self.inputs.iter().map(|input| &input.grouped);
        let over = grouped().filter(|input| input.is_over()).count();
        let end = if self.until == Until::Shortest { over > 0 } else { over == self.inputs.len() };
        if end {
            self.ready = 0;
            return Ok(Arrival::End);
        }
        self.ready = grouped().filter(|input| !input.is_over()).map(GroupedInput::ready).min().unwrap_or(0);
        self.inputs.iter_mut().for_each(|input| input.grouped.prepare(self.ready));
        Ok(Arrival::Frames(self.ready))
    }

    /// The ready frames, as many as [`MultiReader::wait`] returned. Lost samples are NaN.
    pub fn frames(&self) -> Vec<RecordedFrames<'_>> {
        self.inputs.iter().map(|input| input.grouped.view(self.ready)).collect()
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

    /// What the inputs say besides their samples, for an output with its frames at `placement`.
    pub fn notes(&self, placement: Placement) -> OutputNotes {
        let notes: Vec<_> = self.inputs.iter().map(|input| &input.notes).collect();
        OutputNotes::of(&notes, self.origin, placement)
    }

    /// The faults tolerated so far.
    pub fn warnings(&self) -> Vec<InputWarning> {
        let one_ended = self.inputs.iter().any(|input| input.grouped.is_over());
        let of_input = |input: &Input| {
            let unused = if one_ended { input.unused() } else { None };
            let name = input.name.clone();
            let warning = move |fault| InputWarning { input: name.clone(), fault };
            input.faults().chain(unused).map(warning).collect::<Vec<_>>()
        };
        self.inputs.iter().flat_map(of_input).collect()
    }

    /// Waits for the next message of input i; false if a stop was asked for first.
    fn receive(&mut self, i: usize, on_stall: OnStall<'_>) -> Result<bool, IoError> {
        let before: usize = self.inputs[..i].iter().map(|input| input.grouped.aligned.header.channels).sum();
        let input = &mut self.inputs[i];
        let channels = [before + 1, before + input.grouped.aligned.header.channels];
        let wait = Wait::new(on_stall, &input.name, channels);
        input.receive(&self.stop, wait)
    }

    fn refuse_some_complex(&self) -> Result<(), IoError> {
        let find = |is_complex| self.headers().find(move |(_, header)| header.is_complex == is_complex);
        match (find(true), find(false)) {
            (Some((complex, _)), Some((real, _))) => Err(IoError::unfit(complex)(format!(
                "complex samples, and {real} holds real ones; give all channels in one of the two ways"
            ))),
            _ => Ok(()),
        }
    }

    /// One time axis for all inputs.
    fn align(&mut self, given: Option<&LostSamples>) -> Result<(), IoError> {
        let max_lost = self.max_lost;
        let channels: Vec<_> = self.headers().map(|(_, header)| header.channels).collect();
        let lost = match given {
            Some(given) => given.of_inputs(&channels)?,
            None => vec![LostInInput::default(); channels.len()],
        };
        let mut inputs: Vec<_> = self.inputs.iter_mut().zip(lost).collect();
        for (input, lost) in &mut inputs {
            input.take_timestamps(lost)?;
        }
        // The frames of all inputs begin together, their samples count for themselves.
        let begins = inputs.iter().filter_map(|(input, lost)| {
            Some(lost.timestamps.beginning()? / input.grouped.per_frame() as u64)
        });
        let origin = begins.min().unwrap_or(0);
        for (input, lost) in inputs {
            let per_frame = input.grouped.per_frame() as u64;
            let breaks = lost.timestamps.breaks(origin.saturating_mul(per_frame));
            let breaks = breaks.map_err(|problem| input.unfit(problem))?;
            let frames = breaks.iter().map(|next| next.lost).fold(0, u64::saturating_add);
            if frames / per_frame > max_lost {
                return Err(input.unfit(too_many_lost(frames / per_frame, max_lost)));
            }
            input.grouped.aligned.lose(breaks, lost);
        }
        self.origin = origin;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
