//! State-space banks: x+ = a x + b u, y = c x + d u once a tick, in f64.

use super::BuildError;
use super::rows::{Fold, Rows, RowsMut};
use super::simd::Isa;
use super::ticks::{FastSink, TickSource};
use crate::bank::BlockFilter;

/// Ticks a block.
const BLOCK: usize = 96;

/// The matrices, row-major and flat.
#[derive(Debug)]
pub(crate) struct StateSpacePlan {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    order: usize,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    d: Vec<f64>,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct StateSpaceState {
    x: Vec<f64>,
    next: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Times the state was not finite and began anew.
    pub(crate) resets: u64,
}

impl StateSpacePlan {
    pub(crate) fn new(filter: &BlockFilter, channels: usize, ratio: usize) -> Result<Self, BuildError> {
        let order = filter.a.len();
        let flat = |name, rows: &[Vec<f64>], wanted_rows, wanted_cols| {
            flatten(name, rows, (wanted_rows, wanted_cols), channels, ratio)
        };
        Ok(Self {
            channels,
            ratio,
            order,
            a: flat("a", &filter.a, order, order)?,
            b: flat("b", &filter.b, order, channels)?,
            c: flat("c", &filter.c, ratio, order)?,
            d: flat("d", &filter.d, ratio, channels)?,
        })
    }

    pub(crate) fn state(&self) -> StateSpaceState {
        StateSpaceState {
            x: vec![0.0; self.order],
            next: vec![0.0; self.order],
            input: vec![0.0; self.channels * BLOCK],
            output: vec![0.0; self.ratio * BLOCK],
            resets: 0,
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut StateSpaceState,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let mut replaced = 0;
        let mut first = 0;
        while first < source.ticks() {
            let ticks = (source.ticks() - first).min(BLOCK);
            let fold = Fold { ticks: 1, lead: 0 };
            let isa = Isa::Portable;
            let rows =
                RowsMut { samples: &mut state.input[..], stride: BLOCK, channels: self.channels, fold, isa };
            replaced += source.gather(first, ticks, rows);
            (0..ticks).for_each(|k| self.tick(state, k));
            let rows = Rows { samples: &state.output[..], stride: BLOCK, phases: self.ratio, fold, isa };
            sink.scatter(first, ticks, rows);
            first += ticks;
        }
        replaced
    }

    /// Tick k of the block.
    fn tick(&self, state: &mut StateSpaceState, k: usize) {
        let u = || state.input.iter().skip(k).step_by(BLOCK);
        for (p, y) in state.output.iter_mut().skip(k).step_by(BLOCK).enumerate() {
            let c = dot(&self.c[p * self.order..(p + 1) * self.order], state.x.iter());
            *y = c + dot(&self.d[p * self.channels..(p + 1) * self.channels], u());
        }
        for (j, next) in state.next.iter_mut().enumerate() {
            let a = dot(&self.a[j * self.order..(j + 1) * self.order], state.x.iter());
            *next = a + dot(&self.b[j * self.channels..(j + 1) * self.channels], u());
        }
        std::mem::swap(&mut state.x, &mut state.next);
        state.recover();
    }
}

impl StateSpaceState {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.x.fill(0.0);
        self.resets = 0;
    }

    /// A NaN never leaves a recursion by itself.
    fn recover(&mut self) {
        if !self.x.iter().all(|value| value.is_finite()) {
            self.x.fill(0.0);
            self.resets += 1;
        }
    }
}

fn dot<'a>(row: &[f64], values: impl Iterator<Item = &'a f64>) -> f64 {
    row.iter().zip(values).map(|(a, b)| a * b).sum()
}

fn flatten(
    name: &'static str,
    rows: &[Vec<f64>],
    (wanted_rows, wanted_cols): (usize, usize),
    channels: usize,
    ratio: usize,
) -> Result<Vec<f64>, BuildError> {
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
    let flat = rows.concat();
    match flat.iter().position(|value| !value.is_finite()) {
        Some(index) => {
            let place = format!("matrix {name} of the state-space filters");
            Err(BuildError::NotFinite { place, index, value: flat[index] })
        }
        None => Ok(flat),
    }
}
