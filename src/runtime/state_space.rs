//! State-space banks: x+ = a x + b u, y = c x + d u once a tick.
//!
//! Delay lines are taken out of the states and become the history of a window, as with FIR banks; the other states run
//! as a recursion whose values are further rows of that window. Then the output is one FIR filter over past
//! inputs and states.

use super::BuildError;
use super::aligned::Aligned;
use super::rows::{Fold, Rows, RowsMut};
use super::sample::Sample;
use super::simd::{
    ColumnTile, FirKernel, Form, Isa, OVERRUN, PhaseGroup, Recursion, RecursionKernel, Registers,
    SectionVector, Steps,
};
use super::structure::{Past, Structure};
use super::ticks::{FastSink, TickSource};
use super::window::Window;
use crate::bank::BlockFilter;
use std::collections::BTreeMap;

/// Ticks a block: whole tiles of the FIR kernels. Every so many ticks from the beginning of the stream, and not of a
/// call, the state is looked after, so that cuts do not change a bit.
pub(crate) const BLOCK: usize = 72;

/// The coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct StateSpacePlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// Ticks that the delay lines look back.
    history: usize,
    recursion: Recursion<T>,
    advance: RecursionKernel<T>,
    outputs: Vec<(PhaseGroup<T>, Steps)>,
    fir: FirKernel<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct StateSpaceState<T: Sample> {
    registers: Registers<T>,
    /// Inputs with their past, and the states before each tick.
    window: Window<T>,
    output: Aligned<T>,
    /// Ticks since the state was looked after.
    since: usize,
    /// Times the state was not finite and began anew.
    pub(crate) resets: u64,
}

/// Samples from output row to output row.
const OUT_STRIDE: usize = BLOCK + OVERRUN;

impl<T: Sample> StateSpacePlan<T> {
    pub(crate) fn new(
        filter: &BlockFilter,
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
        let advance = T::recursion_kernel(isa);
        let layout = Layout::new(&structure, channels, advance.lanes)?;
        Ok(Self {
            channels,
            ratio,
            history: layout.history,
            recursion: layout.recursion(&structure),
            advance,
            outputs: layout.outputs(&structure, ratio),
            fir: T::fir_kernel(isa),
            isa,
        })
    }

    /// True if the states are parallel sections and run as such.
    pub(crate) fn is_modal(&self) -> bool {
        matches!(self.recursion.form, Form::Sections(_))
    }

    pub(crate) fn state(&self) -> StateSpaceState<T> {
        StateSpaceState {
            registers: Registers::new(self.recursion.states, self.advance.lanes),
            window: Window::new(self.channels + self.recursion.states, self.history, BLOCK),
            output: Aligned::new(self.ratio * OUT_STRIDE),
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
        let (fold, isa) = (Fold { ticks: 1, lead: 0 }, self.isa);
        let mut replaced = 0;
        let mut first = 0;
        while first < source.ticks() {
            let ticks = (source.ticks() - first).min(BLOCK - state.since);
            state.window.make_room(ticks);
            let (samples, stride) = state.window.room();
            replaced +=
                source.gather(first, ticks, RowsMut { samples, stride, channels: self.channels, fold, isa });
            self.filter(state, ticks);
            let rows = Rows { samples: &state.output[..], stride: OUT_STRIDE, phases: self.ratio, fold, isa };
            sink.scatter(first, ticks, rows);
            state.pass(ticks);
            first += ticks;
        }
        replaced
    }

    fn filter(&self, state: &mut StateSpaceState<T>, ticks: usize) {
        self.advance.run(&self.recursion, &mut state.registers, state.window.view_mut(), ticks);
        for (group, steps) in &self.outputs {
            let out = &mut state.output[group.first * OUT_STRIDE..];
            self.fir.run(group, state.window.view(), steps, ticks, out, OUT_STRIDE);
        }
    }
}

impl<T: Sample> StateSpaceState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.registers.state().fill(T::default());
        self.window.reset();
        self.since = 0;
        self.resets = 0;
    }

    /// Counts ticks; at the end of a block the state is looked after.
    fn pass(&mut self, ticks: usize) {
        self.window.advance(ticks);
        self.since = (self.since + ticks) % BLOCK;
        if self.since > 0 {
            return;
        }
        let x = self.registers.state();
        // A NaN never leaves a recursion by itself.
        if !x.iter().all(|value| value.finite()) {
            x.fill(T::default());
            self.resets += 1;
        }
        // Numbers that fade away become denormal in the end, and slow.
        for value in x.iter_mut().filter(|value| value.magnitude() < T::NEGLIGIBLE) {
            *value = T::default();
        }
    }
}

/// Where things lie in the window: a row for each channel, then one for each state.
struct Layout {
    lanes: usize,
    channels: usize,
    history: usize,
    stride: usize,
    /// S.
    states: usize,
    /// Row of each state among the states.
    rows: Vec<usize>,
    modal: bool,
}

impl Layout {
    fn new(structure: &Structure, channels: usize, lanes: usize) -> Result<Self, BuildError> {
        let order = structure.a.len();
        let history = structure.history();
        // A window holds f32 or f64 alike: its stride counts samples.
        let stride = Window::<f64>::stride(history, BLOCK);
        let sections = structure.sections();
        let modal = sections.is_some();
        let rows = sections.map_or_else(|| (0..order).collect(), |twos| section_rows(&twos, order, lanes));
        let width = if modal { 2 * lanes } else { lanes };
        let states = rows.iter().max().map_or(0, |row| row + 1).next_multiple_of(width);
        if (channels + states).saturating_mul(stride) > u32::MAX as usize {
            return Err(BuildError::TooLong { history, channels });
        }
        Ok(Self { lanes, channels, history, stride, states, rows, modal })
    }

    fn place(&self, (channel, ticks): Past) -> u32 {
        (channel * self.stride + self.history - ticks) as u32
    }

    fn first_row(&self) -> usize {
        self.channels * self.stride + self.history
    }

    fn recursion<T: Sample>(&self, structure: &Structure) -> Recursion<T> {
        let form = if self.modal {
            let vectors = (0..self.states).step_by(2 * self.lanes);
            Form::Sections(vectors.map(|first| self.section_vector(structure, first)).collect())
        } else {
            Form::Dense(self.column_tiles(structure))
        };
        Recursion { states: self.states, first_row: self.first_row(), stride: self.stride, form }
    }

    /// The state that lies in a row; `None` for padding.
    fn state_in(&self, row: usize) -> Option<usize> {
        self.rows.iter().position(|&other| other == row)
    }

    /// Factors of `count` rows from `first` on, taken from one factor for each state.
    fn column<T: Sample>(&self, factor: impl Fn(usize) -> f64, first: usize, count: usize) -> Vec<T> {
        (first..first + count).map(|row| T::from_f64(self.state_in(row).map_or(0.0, &factor))).collect()
    }

    fn section_vector<T: Sample>(&self, structure: &Structure, first: usize) -> SectionVector<T> {
        let lanes = self.lanes;
        // a between the rows of a section, d rows apart.
        let a = |first: usize, other: usize| -> Vec<T> {
            let entry = |row: usize| {
                let (i, j) = self.state_in(first + row).zip(self.state_in(other + row))?;
                Some(structure.a[i][j])
            };
            (0..lanes).map(|row| T::from_f64(entry(row).unwrap_or(0.0))).collect()
        };
        let (p, q) = (first, first + lanes);
        let mut coefficients = [a(p, p), a(p, q), a(q, p), a(q, q)].concat();
        let mut inputs = Vec::new();
        for (&past, factors) in &structure.b {
            let column = self.column::<T>(|state| factors[state], first, 2 * lanes);
            if column.iter().any(|factor| factor.to_f64() != 0.0) {
                inputs.push(self.place(past));
                coefficients.extend(column);
            }
        }
        SectionVector { inputs, coefficients: Aligned::from_slice(&coefficients) }
    }

    fn column_tiles<T: Sample>(&self, structure: &Structure) -> Vec<ColumnTile<T>> {
        let mut tiles = Vec::new();
        let mut first = 0;
        while first < self.states {
            let left = (self.states - first) / self.lanes;
            let vectors =
                if left >= ColumnTile::<T>::WIDEST { ColumnTile::<T>::WIDEST } else { 1 << left.ilog2() };
            tiles.push(self.column_tile(structure, first, vectors));
            first += vectors * self.lanes;
        }
        tiles
    }

    fn column_tile<T: Sample>(&self, structure: &Structure, first: usize, vectors: usize) -> ColumnTile<T> {
        let count = vectors * self.lanes;
        let mut coefficients = Vec::new();
        let mut keep = |factor: &dyn Fn(usize) -> f64| {
            let column = self.column::<T>(factor, first, count);
            let some = column.iter().any(|factor| factor.to_f64() != 0.0);
            if some {
                coefficients.extend(column);
            }
            some
        };
        let inputs = structure.b.iter().filter(|(_, factors)| keep(&|i| factors[i]));
        let inputs = inputs.map(|(&past, _)| self.place(past)).collect();
        let columns = (0..structure.a.len()).filter(|&j| keep(&|i| structure.a[i][j]));
        let columns = columns.map(|j| self.rows[j] as u32).collect();
        ColumnTile { first, vectors, inputs, columns, coefficients: Aligned::from_slice(&coefficients) }
    }

    /// Phases with the inputs and states that they take; those that take the same run together.
    fn outputs<T: Sample>(&self, structure: &Structure, ratio: usize) -> Vec<(PhaseGroup<T>, Steps)> {
        let taps = structure.taps.iter().map(|(&past, factors)| (self.place(past), factors));
        let row = |state: usize| (self.first_row() + self.rows[state] * self.stride) as u32;
        let states = structure.c.iter().enumerate().map(|(state, factors)| (row(state), factors));
        let terms: Vec<(u32, &Vec<f64>)> = taps.chain(states).collect();
        let support = |p: usize| terms.iter().map(move |(_, factors)| factors[p] != 0.0);
        let alike = |p: &usize, q: &usize| support(*p).eq(support(*q));
        let phases: Vec<usize> = (0..ratio).collect();
        let groups =
            phases.chunk_by(alike).flat_map(|like| like.chunks(like.len().div_ceil(like.len().div_ceil(4))));
        groups.map(|group| output_group(&terms, group[0], group.len())).collect()
    }
}

/// Phases `first..first + width`, which take the same terms.
fn output_group<T: Sample>(terms: &[(u32, &Vec<f64>)], first: usize, width: usize) -> (PhaseGroup<T>, Steps) {
    let taken = terms.iter().filter(|(_, factors)| factors[first] != 0.0);
    let coefficients: Vec<T> = taken
        .clone()
        .flat_map(|(_, factors)| &factors[first..first + width])
        .map(|&f| T::from_f64(f))
        .collect();
    let group = PhaseGroup { first, width, coefficients: Aligned::from_slice(&coefficients) };
    (group, Steps::new(taken.map(|&(place, _)| place).collect()))
}

/// Rows of the states of sections: L first ones, their L partners, and so on.
fn section_rows(sections: &[(usize, Option<usize>)], order: usize, lanes: usize) -> Vec<usize> {
    let mut rows = vec![0; order];
    for (s, &(one, other)) in sections.iter().enumerate() {
        let row = s / lanes * 2 * lanes + s % lanes;
        rows[one] = row;
        if let Some(other) = other {
            rows[other] = row + lanes;
        }
    }
    rows
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

#[cfg(test)]
mod tests {
    use super::super::tests::Noise;
    use super::super::ticks::Interleaved;
    use super::*;

    /// The definition, row by row.
    fn definition(filter: &BlockFilter, input: &[f64], channels: usize) -> Vec<f64> {
        let dot = |row: &[f64], v: &[f64]| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
        let mut x = vec![0.0; filter.a.len()];
        let mut out = Vec::new();
        for u in input.chunks_exact(channels) {
            out.extend(filter.c.iter().zip(&filter.d).map(|(c, d)| dot(c, &x) + dot(d, u)));
            x = filter.a.iter().zip(&filter.b).map(|(a, b)| dot(a, &x) + dot(b, u)).collect();
        }
        out
    }

    fn run(
        filter: &BlockFilter,
        n: usize,
        m: usize,
        isa: Isa,
        input: &[f64],
        cut: usize,
    ) -> (Vec<f64>, bool) {
        let plan = StateSpacePlan::<f64>::new(filter, n, m, isa).unwrap();
        let mut state = plan.state();
        let mut out = vec![0.0; input.len() / n * m];
        for (x, y) in input.chunks(cut * n).zip(out.chunks_mut(cut * m)) {
            plan.process(&mut state, &Interleaved { samples: x, channels: n }, y);
        }
        (out, plan.is_modal())
    }

    fn random(order: usize, n: usize, m: usize, blocks: Option<&[usize]>, noise: &mut Noise) -> BlockFilter {
        let mut matrix = |rows: usize, cols: usize, scale: f64| -> Vec<Vec<f64>> {
            (0..rows).map(|_| (0..cols).map(|_| scale * noise.next()).collect()).collect()
        };
        let mut a = matrix(order, order, 0.9 / order.max(1) as f64);
        if let Some(blocks) = blocks {
            let mut owner = Vec::new();
            blocks.iter().enumerate().for_each(|(b, &size)| owner.extend(vec![b; size]));
            for (i, row) in a.iter_mut().enumerate() {
                row.iter_mut().enumerate().filter(|(j, _)| owner[*j] != owner[i]).for_each(|(_, x)| *x = 0.0);
            }
        }
        BlockFilter { a, b: matrix(order, n, 1.0), c: matrix(m, order, 1.0), d: matrix(m, n, 1.0) }
    }

    #[test]
    fn every_shape_follows_its_definition_with_the_same_bits_for_every_cut() {
        let mut noise = Noise(21);
        let modal: [&[usize]; 6] = [&[1], &[2], &[1, 2], &[2, 1, 1, 2], &[1, 1, 1, 2, 2, 1, 2, 2], &[2; 16]];
        let dense = [0, 1, 3, 5, 8, 17].map(|order| (order, None));
        let shapes = modal.map(|blocks| (blocks.iter().sum(), Some(blocks))).into_iter().chain(dense);
        for (order, blocks) in shapes {
            for (n, m) in [(1, 1), (2, 3), (4, 4), (3, 9)] {
                let filter = random(order, n, m, blocks, &mut noise);
                let input: Vec<f64> = (0..n * 300).map(|_| noise.next()).collect();
                let want = definition(&filter, &input, n);
                let (whole, is_modal) = run(&filter, n, m, Isa::detect(), &input, 300);
                // Small dense matrices are block-diagonal too.
                assert!(is_modal || (blocks.is_none() && order > 2), "{order} {blocks:?}");
                let worst = whole.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-12, "order {order} N {n} M {m}: {worst:e}");
                for cut in [1, 7, 63, 64, 65, 129] {
                    assert_eq!(run(&filter, n, m, Isa::detect(), &input, cut).0, whole, "cut {cut}");
                }
                let portable = run(&filter, n, m, Isa::Portable, &input, 300).0;
                let apart = whole.iter().zip(&portable).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-12, "{apart:e}");
            }
        }
    }

    #[test]
    fn a_state_that_fades_away_becomes_zero() {
        let filter =
            BlockFilter { a: vec![vec![0.5]], b: vec![vec![1.0]], c: vec![vec![1.0]], d: vec![vec![0.0]] };
        let plan = StateSpacePlan::<f64>::new(&filter, 1, 1, Isa::detect()).unwrap();
        let mut state = plan.state();
        let mut input = vec![0.0; 1200];
        input[0] = 1.0;
        let mut out = vec![0f64; 1200];
        plan.process(&mut state, &Interleaved { samples: &input[..], channels: 1 }, &mut out[..]);
        // 2^-900 is 1e-271, still there; 2^-960 is below the limit, and never denormal (2^-1022).
        assert!(out[900] > 0.0 && out[1100] == 0.0);
        assert!(out.iter().all(|y| *y == 0.0 || y.is_normal()));
    }
}
