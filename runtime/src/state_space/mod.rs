//! State-space banks: x+ = a x + b u, y = c x + d u once a tick.
//!
//! Delay lines are taken out of the states and become the past of a window, as with FIR banks; the other states run
//! as a recursion whose values are frames, one a tick. Then the output is the sum of two FIR filters, one over the
//! inputs and one over the states.

mod layout;
#[cfg(test)]
mod tests;

use self::layout::Layout;
use super::BuildError;
use super::aligned::Aligned;
use super::fir::replace_not_finite;
use super::sample::Sample;
use super::simd::{FirKernel, Form, Isa, Polyphase, Recursion, RecursionKernel, Segment, all_finite};
use super::structure::Structure;
use super::ticks::{FastSink, TickSource};
use super::window::Window;
use crate::plan::StateSpace;

/// Ticks a block. Every so many ticks from the beginning of the stream, and not of a call, the state is looked after,
/// so that cuts do not change a bit.
pub(crate) const BLOCK: usize = 64;

/// The coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct StateSpacePlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    recursion: Recursion<T>,
    advance: RecursionKernel<T>,
    inputs_readout: Polyphase<T>,
    states_readout: Polyphase<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct StateSpaceState<T: Sample> {
    window: Window<T>,
    /// The state before each tick of a block, and after the last one; the first row is the state.
    rows: Aligned<T>,
    /// S.
    states: usize,
    output: Aligned<T>,
    /// What the states add to it.
    further: Aligned<T>,
    /// Ticks since the state was looked after.
    since: usize,
    /// Times the state was not finite and began anew.
    pub(crate) resets: u64,
}

impl<T: Sample> StateSpacePlan<T> {
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
        let structure = Structure::new(filter);
        let (advance, fir) = (RecursionKernel::new(isa), FirKernel::new(isa));
        let layout = Layout::new(&structure, (channels, ratio), advance.lanes, fir)?;
        Ok(Self {
            channels,
            ratio,
            recursion: layout.recursion(&structure),
            advance,
            inputs_readout: layout.inputs_readout(&structure, ratio, fir),
            states_readout: layout.states_readout(&structure, ratio, fir),
            isa,
        })
    }

    /// True if the states are parallel sections and run as such.
    pub(crate) fn is_modal(&self) -> bool {
        matches!(self.recursion.form, Form::Sections(_))
    }

    pub(crate) fn state(&self) -> StateSpaceState<T> {
        let tiling = self.inputs_readout.tiling();
        let beyond = tiling.vector * self.channels;
        let states = self.recursion.states;
        // A vector may read the rows of some more ticks, which mean nothing.
        let rows = (BLOCK + self.states_readout.tiling().vector) * states;
        StateSpaceState {
            window: Window::new(self.channels, tiling.past, BLOCK * self.channels, beyond),
            rows: Aligned::new(rows),
            states,
            output: Aligned::new(self.ratio * BLOCK),
            further: Aligned::new(self.ratio * BLOCK),
            since: 0,
            resets: 0,
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut StateSpaceState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let mut replaced = 0;
        let mut first = 0;
        while first < source.ticks() {
            let ticks = (source.ticks() - first).min(BLOCK - state.since);
            let input = state.window.room(ticks);
            source.gather(self.isa, first, ticks, input);
            if !all_finite(self.isa, input) {
                replaced += replace_not_finite(input);
            }
            self.filter(state, ticks);
            sink.store(self.isa, first * self.ratio, &state.output[..ticks * self.ratio]);
            state.pass(ticks);
            first += ticks;
        }
        replaced
    }

    fn filter(&self, state: &mut StateSpaceState<T>, ticks: usize) {
        let StateSpaceState { window, rows, output, further, .. } = state;
        self.advance.run(&self.recursion, rows, window.view(), self.channels, ticks);
        self.inputs_readout.run(&[Segment { x: window.view(), first: 0, frames: ticks }], output);
        if self.recursion.states > 0 {
            self.states_readout.run(&[Segment { x: rows, first: 0, frames: ticks }], further);
            output.iter_mut().zip(&further[..ticks * self.ratio]).for_each(|(y, more)| *y = *y + *more);
        }
    }
}

impl<T: Sample> StateSpaceState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.rows.fill(T::default());
        self.window.reset();
        self.since = 0;
        self.resets = 0;
    }

    /// The last row becomes the first; at the end of a block the state is looked after.
    fn pass(&mut self, ticks: usize) {
        self.window.advance(ticks);
        self.rows.copy_within(ticks * self.states..(ticks + 1) * self.states, 0);
        self.since = (self.since + ticks) % BLOCK;
        if self.since == 0 {
            self.look_after();
        }
    }

    fn look_after(&mut self) {
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
            place: format!("matrix {name} of the state-space filters"),
            index,
            value,
        }),
        None => Ok(()),
    }
}
