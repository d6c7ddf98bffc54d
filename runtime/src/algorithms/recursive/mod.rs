//! Recursive filters in state space: x+ = a x + b u, y = c x + d u, once per frame.
//!
//! Delay lines are taken out of the states and become the history of the input, as with FIR banks; the other
//! states run as a recursion whose values are one row per frame. Then the output is the sum of two FIR
//! filters, one over the inputs and one over the states.
//!
//! Every 64 frames from the beginning of the stream, and not of a call, denormals are flushed: states below
//! 1e-280 become zero, so that a recursion that fades out does not slow down. A state
//! that is not finite (the recursion overflowed) becomes zero there too, and is counted. NaN and infinity in
//! the input are replaced before filtering, so they never reach a state, and no frame is filtered twice.

mod delay_lines;
mod layout;

pub use self::delay_lines::{DelayLines, DelayedInput};
use self::layout::HistoryLayout;
use super::filter::{AlgorithmFacts, Filter};
use crate::adapters::{FrameSink, FrameSource};
use crate::aligned::Aligned;
use crate::history::History;
use crate::simd::{
    FirKernel, Polyphase, Recursion, RecursionForm, RecursionKernel, Segment, replace_not_finite,
};
use crate::state::{Count, StateNumbers};
use crate::{BuildError, Isa};

/// A filter in state space, one step per frame: x+ = a x + b u, y = c x + d u; u the N samples of a frame, y
/// its M output samples. Row-major lists of rows.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StateMatrices {
    /// n x n.
    pub a: Vec<Vec<f64>>,
    /// n x N.
    pub b: Vec<Vec<f64>>,
    /// M x n.
    pub c: Vec<Vec<f64>>,
    /// M x N.
    pub d: Vec<Vec<f64>>,
}

/// Frames per block. Blocks are counted from the beginning of the stream, so that cuts into calls do not
/// change a bit.
pub(crate) const BLOCK: usize = 64;

/// States below this become zero: far below every signal, and far above the denormals, which begin at
/// 2e-308.
pub(crate) const NEGLIGIBLE_STATE: f64 = 1e-280;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct Recursive {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// Frames that the delay lines look back.
    history: usize,
    recursion: Recursion,
    advance: RecursionKernel,
    feedthrough: Polyphase<f64>,
    output_matrix: Polyphase<f64>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct RecursiveState {
    history: History<f64>,
    /// The state before each frame of a block, and after the last one; the first row is the state.
    rows: Aligned<f64>,
    /// S.
    states: usize,
    output: Aligned<f64>,
    /// What the states add to the output.
    state_output: Aligned<f64>,
    /// Frames since denormals were flushed.
    phase_offset: usize,
    /// Times the state was not finite and became zero.
    pub(crate) resets: u64,
}

impl Recursive {
    /// For N = `channels` and M = `ratio`.
    pub(crate) fn new(
        filter: &StateMatrices,
        channels: usize,
        ratio: usize,
        isa: Isa,
    ) -> Result<Self, BuildError> {
        let order = filter.a.len();
        let check = |name, rows: &[Vec<f64>], wanted_rows, wanted_cols| {
            check_matrix(name, rows, wanted_rows, wanted_cols, channels, ratio)
        };
        check("a", &filter.a, order, order)?;
        check("b", &filter.b, order, channels)?;
        check("c", &filter.c, ratio, order)?;
        check("d", &filter.d, ratio, channels)?;
        let delay_lines = DelayLines::new(filter);
        let (advance, fir) = (RecursionKernel::new(isa), FirKernel::new(isa));
        let layout = HistoryLayout::new(&delay_lines, channels, ratio, advance.lanes, fir)?;
        Ok(Self {
            channels,
            ratio,
            history: delay_lines.history(),
            recursion: layout.recursion(&delay_lines),
            advance,
            feedthrough: layout.feedthrough(&delay_lines, ratio, fir),
            output_matrix: layout.output_matrix(&delay_lines, ratio, fir),
            isa,
        })
    }

    /// True if the states are second-order sections in parallel and run as such.
    fn is_parallel(&self) -> bool {
        matches!(self.recursion.form, RecursionForm::Sections(_))
    }

    /// Filters the frames in the history's room.
    fn filter(&self, state: &mut RecursiveState, frames: usize) {
        let RecursiveState { history, rows, output, state_output, .. } = state;
        self.advance.run(&self.recursion, rows, history.view(), self.channels, frames);
        self.feedthrough.run(&[Segment { x: history.view(), first: 0, frames }], output);
        if self.recursion.states > 0 {
            self.output_matrix.run(&[Segment { x: rows, first: 0, frames }], state_output);
            output.iter_mut().zip(&state_output[..frames * self.ratio]).for_each(|(y, more)| *y += *more);
        }
    }
}

impl Filter for Recursive {
    type State = RecursiveState;

    fn facts(&self) -> AlgorithmFacts {
        AlgorithmFacts {
            name: if self.is_parallel() { "parallel-form" } else { "dense" },
            history: None,
            delay: 0,
            alignment: BLOCK,
            transform: None,
            multiply_adds: None,
        }
    }

    fn state(&self) -> RecursiveState {
        let tiling = &self.feedthrough.tiling;
        let padding = tiling.vector * self.channels;
        let states = self.recursion.states;
        // A vector may read the rows of some more frames, which mean nothing.
        let rows = (BLOCK + self.output_matrix.tiling.vector) * states;
        RecursiveState {
            history: History::new(self.channels, tiling.history, BLOCK * self.channels, padding),
            rows: Aligned::new(rows),
            states,
            output: Aligned::new(self.ratio * BLOCK),
            state_output: Aligned::new(self.ratio * BLOCK),
            phase_offset: 0,
            resets: 0,
        }
    }

    fn reset(state: &mut RecursiveState) {
        state.rows.fill(0.0);
        state.history.reset();
        state.phase_offset = 0;
        state.resets = 0;
    }

    fn process(
        &self,
        state: &mut RecursiveState,
        input: &dyn FrameSource,
        output: &mut dyn FrameSink,
    ) -> u64 {
        let (mut replaced, mut first) = (0, 0);
        while first < input.frames() {
            let frames = (input.frames() - first).min(BLOCK - state.phase_offset);
            let samples = state.history.room(frames);
            input.load(self.isa, first, samples);
            replaced += replace_not_finite(self.isa, samples).count;
            self.filter(state, frames);
            output.store(self.isa, first * self.ratio, &state.output[..frames * self.ratio]);
            state.commit(frames);
            first += frames;
        }
        replaced
    }

    fn count(&self, _place: usize) -> Count {
        Count { inputs: self.history * self.channels, sums: self.recursion.states }
    }

    fn save(&self, state: &RecursiveState, put: &mut dyn FnMut(f64)) {
        state.history.save(self.history, put);
        state.rows[..state.states].iter().for_each(|&value| put(value));
    }

    fn resume(&self, state: &mut RecursiveState, place: usize, numbers: StateNumbers<'_>) {
        Self::reset(state);
        state.history.resume(self.history, numbers);
        for (i, slot) in state.rows[..state.states].iter_mut().enumerate() {
            *slot = numbers.get(self.history * self.channels + i);
        }
        state.phase_offset = place;
    }
}

impl RecursiveState {
    /// The last row becomes the first; at the end of a block denormals are flushed.
    fn commit(&mut self, frames: usize) {
        self.history.advance(frames);
        self.rows.copy_within(frames * self.states..(frames + 1) * self.states, 0);
        self.phase_offset = (self.phase_offset + frames) % BLOCK;
        if self.phase_offset == 0 {
            self.flush_denormals();
        }
    }

    fn flush_denormals(&mut self) {
        let x = &mut self.rows[..self.states];
        // A NaN never leaves a recursion by itself.
        if !x.iter().all(|value| value.is_finite()) {
            x.fill(0.0);
            self.resets += 1;
        }
        // Numbers that fade away become denormal in the end, and slow.
        x.iter_mut().filter(|value| value.abs() < NEGLIGIBLE_STATE).for_each(|value| *value = 0.0);
    }
}

fn check_matrix(
    name: &'static str,
    rows: &[Vec<f64>],
    wanted_rows: usize,
    wanted_cols: usize,
    channels: usize,
    ratio: usize,
) -> Result<(), BuildError> {
    let wrong = rows.iter().find(|row| row.len() != wanted_cols);
    if rows.len() != wanted_rows || wrong.is_some() {
        let cols = wrong.map_or(wanted_cols, Vec::len);
        return Err(BuildError::Shape {
            name,
            rows: rows.len(),
            cols,
            wanted_rows,
            wanted_cols,
            channels,
            ratio,
        });
    }
    match rows.iter().flatten().enumerate().find(|(_, value)| !value.is_finite()) {
        Some((index, &value)) => Err(BuildError::NotFinite {
            location: format!("matrix {name} of the state-space filters"),
            index,
            value,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
