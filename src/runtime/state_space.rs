//! State-space banks: x+ = a x + b u, y = c x + d u once a tick.
//!
//! Delay lines are taken out of the states and become the past of a window, as with FIR banks; the other states run
//! as a recursion whose values are frames, one a tick. Then the output is the sum of two FIR filters, one over the
//! inputs and one over the states.

use super::BuildError;
use super::aligned::Aligned;
use super::fir::{phase_group, replace_not_finite, widths};
use super::sample::Sample;
use super::simd::{
    ColumnTile, Cut, FirKernel, Form, Isa, PhaseGroup, Recursion, RecursionKernel, SectionVector,
};
use super::structure::{Past, Structure};
use super::ticks::{FastSink, TickSource};
use super::window::Window;
use crate::bank::BlockFilter;

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
    inputs_readout: Readout<T>,
    states_readout: Readout<T>,
    fir: FirKernel<T>,
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
        let (advance, fir) = (T::recursion_kernel(isa), T::fir_kernel(isa));
        let layout = Layout::new(&structure, channels, advance.lanes, fir.group())?;
        Ok(Self {
            channels,
            ratio,
            recursion: layout.recursion(&structure),
            advance,
            inputs_readout: layout.inputs_readout(&structure, ratio),
            states_readout: layout.states_readout(&structure, ratio),
            fir,
            isa,
        })
    }

    /// True if the states are parallel sections and run as such.
    pub(crate) fn is_modal(&self) -> bool {
        matches!(self.recursion.form, Form::Sections(_))
    }

    pub(crate) fn state(&self) -> StateSpaceState<T> {
        let cut = self.inputs_readout.cut;
        let beyond = self.fir.vector_ticks(cut) * self.channels;
        let states = self.recursion.states;
        // A vector may read the rows of some more ticks, which mean nothing.
        let rows = (BLOCK + self.fir.vector_ticks(self.states_readout.cut)) * states;
        StateSpaceState {
            window: Window::new(self.channels, 1, cut.past(), BLOCK * self.channels, beyond),
            rows: Aligned::new(rows),
            states,
            output: Aligned::new(self.hop() * BLOCK),
            further: Aligned::new(self.hop() * BLOCK),
            since: 0,
            resets: 0,
        }
    }

    /// Outputs of a tick, with padding.
    fn hop(&self) -> usize {
        self.inputs_readout.phases
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
            if !T::all_finite(self.isa, input) {
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
        self.inputs_readout.run(&self.fir, window.view(), ticks, output);
        if self.recursion.states > 0 {
            self.states_readout.run(&self.fir, rows, ticks, further);
            output.iter_mut().zip(&further[..ticks * self.hop()]).for_each(|(y, more)| *y = *y + *more);
        }
        if self.hop() > self.ratio {
            (0..ticks).for_each(|t| output[t] = output[t * self.hop()]);
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

/// An FIR filter from frames to phases.
#[derive(Debug)]
struct Readout<T: Sample> {
    cut: Cut,
    /// M, or 2 if M is 1: the kernels make at least two.
    phases: usize,
    groups: Vec<PhaseGroup<T>>,
}

impl<T: Sample> Readout<T> {
    /// `factor(e, p)`: of the sample e before the last one of a frame, for phase p.
    fn new(cut: Cut, ratio: usize, factor: impl Fn(usize, usize) -> f64) -> Self {
        let phases = ratio.max(2);
        let factor = |e: usize, p: usize| if p < ratio { factor(e, p) } else { 0.0 };
        let groups = widths(phases).map(|(first, width)| phase_group(cut, first, width, factor)).collect();
        Self { cut, phases, groups }
    }

    fn run(&self, kernel: &FirKernel<T>, x: &[T], ticks: usize, out: &mut [T]) {
        for group in &self.groups {
            kernel.run(group, self.cut, x, ticks, &mut out[group.first..], self.phases);
        }
    }
}

/// Where things lie: in a window of frames of N inputs, and in rows of S states.
struct Layout {
    /// Of the recursion.
    lanes: usize,
    channels: usize,
    inputs: Cut,
    /// S.
    states: usize,
    state_rows: Cut,
    /// Place of each state among the S.
    places: Vec<usize>,
    modal: bool,
}

impl Layout {
    fn new(structure: &Structure, channels: usize, lanes: usize, group: usize) -> Result<Self, BuildError> {
        let order = structure.a.len();
        let history = structure.history();
        let len = (history + 1)
            .checked_mul(channels)
            .filter(|&len| len <= u32::MAX as usize / 64)
            .ok_or(BuildError::TooLong { history, channels })?;
        let sections = structure.sections();
        let modal = sections.is_some();
        let places =
            sections.map_or_else(|| (0..order).collect(), |twos| section_places(&twos, order, lanes));
        let states =
            places.iter().max().map_or(0, |place| place + 1).next_multiple_of((2 * lanes).max(group));
        // Where there is no state, the readout is not used.
        let state_rows = Cut::new(states.max(group), states, group);
        Ok(Self {
            lanes,
            channels,
            inputs: Cut::new(channels, len, group),
            states,
            state_rows,
            places,
            modal,
        })
    }

    fn place(&self, (channel, ticks): Past) -> u32 {
        (self.inputs.past() - ticks * self.channels + channel) as u32
    }

    /// The state at each place; `None` for padding.
    fn occupants(&self) -> Vec<Option<usize>> {
        let mut occupants = vec![None; self.states.max(self.state_rows.hop)];
        self.places.iter().enumerate().for_each(|(state, &place)| occupants[place] = Some(state));
        occupants
    }

    fn inputs_readout<T: Sample>(&self, structure: &Structure, ratio: usize) -> Readout<T> {
        let n = self.channels;
        Readout::new(self.inputs, ratio, |e, p| {
            structure.taps.get(&(n - 1 - e % n, e / n)).map_or(0.0, |factors| factors[p])
        })
    }

    fn states_readout<T: Sample>(&self, structure: &Structure, ratio: usize) -> Readout<T> {
        let occupants = self.occupants();
        let last = occupants.len() - 1;
        Readout::new(self.state_rows, ratio, |e, p| {
            occupants[last - e].map_or(0.0, |state| structure.c[state][p])
        })
    }

    fn recursion<T: Sample>(&self, structure: &Structure) -> Recursion<T> {
        let columns = Columns { layout: self, structure, occupants: self.occupants() };
        let form = if self.modal {
            let vectors = (0..self.states).step_by(2 * self.lanes);
            Form::Sections(vectors.map(|first| columns.section_vector(first)).collect())
        } else {
            Form::Dense(columns.tiles())
        };
        Recursion { states: self.states, form }
    }
}

/// The columns of A and B, as the recursion takes them.
struct Columns<'a> {
    layout: &'a Layout,
    structure: &'a Structure,
    occupants: Vec<Option<usize>>,
}

impl Columns<'_> {
    /// Factors of `count` places from `first` on, taken from one factor for each state.
    fn column<T: Sample>(&self, factor: impl Fn(usize) -> f64, first: usize, count: usize) -> Vec<T> {
        let places = self.occupants[first..first + count].iter();
        places.map(|state| T::from_f64(state.map_or(0.0, &factor))).collect()
    }

    fn section_vector<T: Sample>(&self, first: usize) -> SectionVector<T> {
        let lanes = self.layout.lanes;
        // What the states from `to` on take from those from `from` on, lane by lane.
        let a = |to: usize, from: usize| {
            let pairs = self.occupants[to..to + lanes].iter().zip(&self.occupants[from..from + lanes]);
            pairs.map(|(i, j)| i.zip(*j).map_or(0.0, |(i, j)| self.structure.a[i][j])).map(T::from_f64)
        };
        let (p, q) = (first, first + lanes);
        let mut coefficients: Vec<T> = a(p, p).chain(a(p, q)).chain(a(q, p)).chain(a(q, q)).collect();
        let mut inputs = Vec::new();
        for (&past, factors) in &self.structure.b {
            let column: Vec<T> = self.column(|state| factors[state], first, 2 * lanes);
            if column.iter().any(|&factor| factor != T::default()) {
                inputs.push(self.layout.place(past));
                coefficients.extend(column);
            }
        }
        SectionVector { inputs, coefficients: Aligned::from_slice(&coefficients) }
    }

    fn tiles<T: Sample>(&self) -> Vec<ColumnTile<T>> {
        let mut tiles = Vec::new();
        let mut first = 0;
        while first < self.layout.states {
            let left = (self.layout.states - first) / self.layout.lanes;
            let vectors = (1 << left.ilog2()).min(ColumnTile::<T>::WIDEST);
            tiles.push(self.tile(first, vectors));
            first += vectors * self.layout.lanes;
        }
        tiles
    }

    /// Columns of zeros are left out, so that triangles and blocks cost less than full matrices.
    fn tile<T: Sample>(&self, first: usize, vectors: usize) -> ColumnTile<T> {
        let (mut inputs, mut columns, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
        let mut keep = |list: &mut Vec<u32>, place: u32, column: Vec<T>| {
            if column.iter().any(|&factor| factor != T::default()) {
                list.push(place);
                coefficients.extend(column);
            }
        };
        let count = vectors * self.layout.lanes;
        for (&past, factors) in &self.structure.b {
            keep(&mut inputs, self.layout.place(past), self.column(|i| factors[i], first, count));
        }
        for (j, &place) in self.layout.places.iter().enumerate() {
            keep(&mut columns, place as u32, self.column(|i| self.structure.a[i][j], first, count));
        }
        ColumnTile { first, vectors, inputs, columns, coefficients: Aligned::from_slice(&coefficients) }
    }
}

/// Places of the states of sections: L first ones, their L partners, and so on.
fn section_places(sections: &[(usize, Option<usize>)], order: usize, lanes: usize) -> Vec<usize> {
    let mut places = vec![0; order];
    for (s, &(one, other)) in sections.iter().enumerate() {
        let place = s / lanes * 2 * lanes + s % lanes;
        places[one] = place;
        if let Some(other) = other {
            places[other] = place + lanes;
        }
    }
    places
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

    fn run<T: Sample>(
        filter: &BlockFilter,
        n: usize,
        m: usize,
        isa: Isa,
        input: &[f64],
        cut: usize,
    ) -> (Vec<f64>, bool) {
        let plan = StateSpacePlan::<T>::new(filter, n, m, isa).unwrap();
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
                let (whole, is_modal) = run::<f64>(&filter, n, m, Isa::detect(), &input, 300);
                // Small dense matrices are block-diagonal too.
                assert!(is_modal || (blocks.is_none() && order > 2), "{order} {blocks:?}");
                let worst = whole.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-12, "order {order} N {n} M {m}: {worst:e}");
                for cut in [1, 7, 63, 64, 65, 129] {
                    assert_eq!(run::<f64>(&filter, n, m, Isa::detect(), &input, cut).0, whole, "cut {cut}");
                }
                let portable = run::<f64>(&filter, n, m, Isa::Portable, &input, 300).0;
                let apart = whole.iter().zip(&portable).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-12, "{apart:e}");
            }
        }
    }

    fn worst(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The same filter with its inputs `ticks` ticks late, in a delay line that the output reads too: the form of
    /// designed banks.
    fn behind(core: &BlockFilter, ticks: usize, noise: &mut Noise) -> BlockFilter {
        let (states, n) = (core.a.len(), core.d[0].len());
        let order = states + ticks * n;
        let mut a = vec![vec![0.0; order]; order];
        for (i, row) in a.iter_mut().enumerate() {
            match core.a.get(i) {
                Some(own) => {
                    row[..states].copy_from_slice(own);
                    row[states..states + n].copy_from_slice(&core.b[i]);
                }
                None if i + n < order => row[i + n] = 1.0,
                None => {}
            }
        }
        let newest = |i: usize, u: usize| f64::from(u8::from(i == order - n + u));
        let b = (0..order).map(|i| (0..n).map(|u| newest(i, u)).collect()).collect();
        let read = |row: &Vec<f64>| row.iter().copied().chain((0..ticks * n).map(|_| noise.next())).collect();
        BlockFilter { a, b, c: core.c.iter().map(read).collect(), d: core.d.clone() }
    }

    #[test]
    fn delay_lines_before_the_states_follow_the_definition() {
        let mut noise = Noise(22);
        for (order, blocks) in [(0, None), (2, Some(&[2][..])), (5, Some(&[2, 1, 2])), (4, None)] {
            for (n, m, ticks) in [(1, 1, 3), (1, 3, 1), (2, 2, 5), (3, 2, 4), (4, 4, 17), (5, 9, 2)] {
                let filter = behind(&random(order, n, m, blocks, &mut noise), ticks, &mut noise);
                let input: Vec<f64> = (0..n * 300).map(|_| noise.next()).collect();
                let (whole, is_modal) = run::<f64>(&filter, n, m, Isa::detect(), &input, 300);
                assert!(is_modal || (blocks.is_none() && order > 2));
                let error = worst(&whole, &definition(&filter, &input, n));
                assert!(error < 1e-12, "order {order} N {n} M {m} behind {ticks}: {error:e}");
                for cut in [1, 63, 65] {
                    assert_eq!(run::<f64>(&filter, n, m, Isa::detect(), &input, cut).0, whole, "cut {cut}");
                }
            }
        }
    }

    #[test]
    fn in_single_precision_the_error_is_what_the_poles_make_of_rounding() {
        let mut noise = Noise(23);
        for radius in [0.5, 0.9, 0.99, 0.999] {
            let mut filter = random(6, 2, 3, Some(&[2, 2, 2]), &mut noise);
            for (k, pair) in filter.a.chunks_mut(2).enumerate() {
                let (s, c) = (0.3 + k as f64).sin_cos();
                (pair[0][2 * k], pair[0][2 * k + 1]) = (radius * c, radius * s);
                (pair[1][2 * k], pair[1][2 * k + 1]) = (-radius * s, radius * c);
            }
            let input: Vec<f64> = (0..2 * 3000).map(|_| f64::from(noise.next() as f32)).collect();
            let want = definition(&filter, &input, 2);
            let single = run::<f32>(&filter, 2, 3, Isa::detect(), &input, 3000).0;
            let size = want.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
            let error = worst(&single, &want) / size;
            assert!(error > 1e-9, "this is not single precision: {error:e}");
            assert!(error < 8.0 * f64::from(f32::EPSILON) / (1.0 - radius), "radius {radius}: {error:e}");
            for cut in [1, 63, 65] {
                assert_eq!(run::<f32>(&filter, 2, 3, Isa::detect(), &input, cut).0, single, "cut {cut}");
            }
        }
    }

    #[test]
    fn zero_columns_of_triangles_are_not_multiplied() {
        let mut noise = Noise(24);
        let mut filter = random(24, 1, 2, None, &mut noise);
        (0..24).for_each(|i| filter.a[i][..i].fill(0.0));
        let plan = StateSpacePlan::<f64>::new(&filter, 1, 2, Isa::detect()).unwrap();
        let Form::Dense(tiles) = &plan.recursion.form else { panic!("a triangle is no section") };
        let columns: Vec<usize> = tiles.iter().map(|tile| tile.columns.len()).collect();
        assert_eq!(columns[0], 24);
        assert!(columns[1..].iter().all(|&count| count < 24), "{columns:?}");
        let input: Vec<f64> = (0..300).map(|_| noise.next()).collect();
        let got = run::<f64>(&filter, 1, 2, Isa::detect(), &input, 300).0;
        assert!(worst(&got, &definition(&filter, &input, 1)) < 1e-12);
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
