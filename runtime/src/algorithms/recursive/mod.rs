//! Recursive filters in state space: x+ = a x + b u, y = c x + d u, once per frame.
//!
//! Delay lines are taken out of the states and become the history of the input, as with FIR banks; the other
//! states run as a recursion whose values are one row per frame. Then the output is the sum of two FIR
//! filters, one over the inputs and one over the states.
//!
//! Every 64 frames from the beginning of the stream, and not of a call, denormals are flushed: states below
//! 1e-30 (f32) or 1e-280 (f64) become zero, so that a recursion that fades out does not slow down. A state
//! that is not finite (the recursion overflowed) becomes zero there too, and is counted. NaN and infinity in
//! the input are replaced before filtering, so they never reach a state, and no frame is filtered twice.

mod delay_lines;
mod layout;
#[cfg(test)]
mod tests;

use self::delay_lines::DelayLines;
use self::layout::Layout;
use super::filter::{Facts, Filter, replace_not_finite};
use crate::adapters::{Input, Output};
use crate::aligned::Aligned;
use crate::history::History;
use crate::simd::{FirKernel, Form, Polyphase, Recursion, RecursionKernel, Segment, all_finite};
use crate::state::{Count, Numbers};
use crate::{BuildError, Isa, Sample, StateSpace};

/// Frames per block. Blocks are counted from the beginning of the stream, so that cuts into calls do not
/// change a bit.
pub(crate) const BLOCK: usize = 64;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct Recursive<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// Frames that the delay lines look back.
    history: usize,
    recursion: Recursion<T>,
    advance: RecursionKernel<T>,
    feedthrough: Polyphase<T>,
    output_matrix: Polyphase<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct RecursiveState<T: Sample> {
    history: History<T>,
    /// The state before each frame of a block, and after the last one; the first row is the state.
    rows: Aligned<T>,
    /// S.
    states: usize,
    output: Aligned<T>,
    /// What the states add to the output.
    state_output: Aligned<T>,
    /// Frames since denormals were flushed.
    phase_offset: usize,
    /// Times the state was not finite and became zero.
    pub(crate) resets: u64,
}

impl<T: Sample> Recursive<T> {
    /// For N = `channels` and M = `ratio`.
    pub(crate) fn new(
        filter: &StateSpace,
        channels: usize,
        ratio: usize,
        isa: Isa,
    ) -> Result<Self, BuildError> {
        let order = filter.a.len();
        let check = |name, rows: &[Vec<f64>], wanted| check_matrix::<T>(name, rows, wanted, channels, ratio);
        check("a", &filter.a, (order, order))?;
        check("b", &filter.b, (order, channels))?;
        check("c", &filter.c, (ratio, order))?;
        check("d", &filter.d, (ratio, channels))?;
        let delay_lines = DelayLines::new(filter);
        let (advance, fir) = (RecursionKernel::new(isa), FirKernel::new(isa));
        let layout = Layout::new(&delay_lines, (channels, ratio), advance.lanes, fir)?;
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
        matches!(self.recursion.form, Form::Sections(_))
    }

    /// Filters the frames in the history's room.
    fn filter(&self, state: &mut RecursiveState<T>, frames: usize) {
        let RecursiveState { history, rows, output, state_output, .. } = state;
        self.advance.run(&self.recursion, rows, history.view(), self.channels, frames);
        self.feedthrough.run(&[Segment { x: history.view(), first: 0, frames }], output);
        if self.recursion.states > 0 {
            self.output_matrix.run(&[Segment { x: rows, first: 0, frames }], state_output);
            output.iter_mut().zip(&state_output[..frames * self.ratio]).for_each(|(y, more)| *y = *y + *more);
        }
    }
}

impl<T: Sample> Filter for Recursive<T> {
    type State = RecursiveState<T>;

    fn facts(&self) -> Facts {
        Facts {
            name: if self.is_parallel() { "parallel-form" } else { "dense" },
            history: None,
            delay: 0,
            alignment: BLOCK,
            transform: None,
            multiply_adds: None,
        }
    }

    fn state(&self) -> RecursiveState<T> {
        let tiling = self.feedthrough.tiling();
        let padding = tiling.vector * self.channels;
        let states = self.recursion.states;
        // A vector may read the rows of some more frames, which mean nothing.
        let rows = (BLOCK + self.output_matrix.tiling().vector) * states;
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

    fn reset(state: &mut RecursiveState<T>) {
        state.rows.fill(T::default());
        state.history.reset();
        state.phase_offset = 0;
        state.resets = 0;
    }

    fn process(
        &self,
        state: &mut RecursiveState<T>,
        input: &(impl Input + ?Sized),
        output: &mut (impl Output + ?Sized),
    ) -> u64 {
        let (mut replaced, mut first) = (0, 0);
        while first < input.frames() {
            let frames = (input.frames() - first).min(BLOCK - state.phase_offset);
            let samples = state.history.room(frames);
            input.load(self.isa, first, samples);
            if !all_finite(self.isa, samples) {
                replaced += replace_not_finite(samples);
            }
            self.filter(state, frames);
            output.store(self.isa, first * self.ratio, &state.output[..frames * self.ratio]);
            state.commit(frames);
            first += frames;
        }
        replaced
    }

    fn resets(state: &RecursiveState<T>) -> u64 {
        state.resets
    }

    /// States mean something to their own coefficients only.
    fn take_over(
        &self,
        state: &mut RecursiveState<T>,
        (_, from): (&Self, &RecursiveState<T>),
        same: bool,
    ) -> bool {
        if same {
            state.rows.copy_from_slice(&from.rows);
            state.history.copy_from(&from.history);
            state.phase_offset = from.phase_offset;
            state.resets = from.resets;
        }
        same
    }

    fn count(&self, _place: usize) -> Count {
        Count { inputs: self.history * self.channels, sums: self.recursion.states }
    }

    fn save(&self, state: &RecursiveState<T>, put: &mut dyn FnMut(f64)) {
        for age in 1..=self.history {
            (0..self.channels).for_each(|channel| put(state.history.sample(age, channel).to_f64()));
        }
        state.rows[..state.states].iter().for_each(|value| put(value.to_f64()));
    }

    fn resume(&self, state: &mut RecursiveState<T>, place: usize, numbers: Numbers<'_>) {
        let n = self.channels;
        let past = |age: usize, channel: usize| {
            let known = age <= self.history;
            T::from_f64(if known { numbers.get((age - 1) * n + channel) } else { 0.0 })
        };
        Self::reset(state);
        state.history.fill(past);
        for (i, slot) in state.rows[..state.states].iter_mut().enumerate() {
            *slot = T::from_f64(numbers.get(self.history * n + i));
        }
        state.phase_offset = place;
    }

    fn set_resets(state: &mut RecursiveState<T>, resets: u64) {
        state.resets = resets;
    }
}

impl<T: Sample> RecursiveState<T> {
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
        if !x.iter().all(|value| value.finite()) {
            x.fill(T::default());
            self.resets += 1;
        }
        // Numbers that fade away become denormal in the end, and slow.
        let tiny = |value: &T| *value < T::NEGLIGIBLE && T::from_f64(-value.to_f64()) < T::NEGLIGIBLE;
        x.iter_mut().filter(|value| tiny(value)).for_each(|value| *value = T::default());
    }
}

fn check_matrix<T: Sample>(
    name: &'static str,
    rows: &[Vec<f64>],
    (wanted_rows, wanted_cols): (usize, usize),
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
    match rows.iter().flatten().enumerate().find(|(_, value)| !T::from_f64(**value).finite()) {
        Some((index, &value)) => Err(BuildError::NotFinite {
            location: format!("matrix {name} of the state-space filters"),
            index,
            value,
        }),
        None => Ok(()),
    }
}
