//! State-space banks: x+ = a x + b u, y = c x + d u once a tick, in f64.

use super::BuildError;
use super::aligned::Aligned;
use super::simd::{Columns, Isa, RECURSION_LANES, Registers, run_recursion};
use super::ticks::{FastSink, TickSource};
use crate::bank::BlockFilter;

/// Ticks a block. Every so many ticks from the beginning of the stream, and not of a call, the state
/// is looked after, so that cuts do not change a bit.
const BLOCK: usize = 64;

/// States below this are as good as zero, and above every number whose arithmetic is slow.
const NEGLIGIBLE: f64 = 1e-280;

/// The matrices in the order of use.
#[derive(Debug)]
pub(crate) struct StateSpacePlan {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    columns: Columns,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct StateSpaceState {
    registers: Registers,
    states: usize,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Ticks since the state was looked after.
    since: usize,
    /// Times the state was not finite and began anew.
    pub(crate) resets: u64,
}

impl StateSpacePlan {
    pub(crate) fn new(
        filter: &BlockFilter,
        channels: usize,
        ratio: usize,
        isa: Isa,
    ) -> Result<Self, BuildError> {
        let order = filter.a.len();
        let check = |name, rows: &[Vec<f64>], wanted| check_matrix(name, rows, wanted, channels, ratio);
        check("a", &filter.a, (order, order))?;
        check("b", &filter.b, (order, channels))?;
        check("c", &filter.c, (ratio, order))?;
        check("d", &filter.d, (ratio, channels))?;
        Ok(Self { channels, ratio, columns: columns(filter, channels, ratio), isa })
    }

    /// True if the state matrix is block-diagonal and runs as such.
    pub(crate) fn is_modal(&self) -> bool {
        self.columns.modal.is_some()
    }

    pub(crate) fn state(&self) -> StateSpaceState {
        StateSpaceState {
            registers: Registers::new(&self.columns),
            states: self.columns.states,
            input: vec![0.0; self.channels * BLOCK],
            output: vec![0.0; self.ratio * BLOCK],
            since: 0,
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
            let ticks = (source.ticks() - first).min(BLOCK - state.since);
            let input = &mut state.input[..ticks * self.channels];
            source.gather(self.isa, first, ticks, input);
            for slot in input.iter_mut().filter(|value| !value.is_finite()) {
                *slot = 0.0;
                replaced += 1;
            }
            let output = &mut state.output[..ticks * self.ratio];
            run_recursion(self.isa, &self.columns, &mut state.registers, input, output, ticks);
            sink.store(self.isa, first * self.ratio, output);
            state.pass(ticks);
            first += ticks;
        }
        replaced
    }
}

impl StateSpaceState {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.registers.z.fill(0.0);
        self.since = 0;
        self.resets = 0;
    }

    /// Counts ticks; at the end of a block the state is looked after.
    fn pass(&mut self, ticks: usize) {
        self.since = (self.since + ticks) % BLOCK;
        if self.since > 0 {
            return;
        }
        let x = &mut self.registers.z[..self.states];
        // A NaN never leaves a recursion by itself.
        if !x.iter().all(|value| value.is_finite()) {
            x.fill(0.0);
            self.resets += 1;
        }
        // Numbers that fade away become denormal in the end, and slow.
        x.iter_mut().filter(|value| value.abs() < NEGLIGIBLE).for_each(|value| *value = 0.0);
    }
}

/// The lane of each state such that every 2 x 2 block of a block-diagonal A is a pair of neighbours
/// (2l, 2l + 1); `None` if A is not of that form.
fn modal_lanes(a: &[Vec<f64>]) -> Option<Vec<usize>> {
    let n = a.len();
    let coupled = |i: usize, j: usize| a[i][j] != 0.0 || a[j][i] != 0.0;
    if (0..n).any(|i| (i + 2..n).any(|j| coupled(i, j))) {
        return None;
    }
    let mut lanes = Vec::with_capacity(n);
    let mut lane = 0;
    while lanes.len() < n {
        let i = lanes.len();
        let pair = i + 1 < n && coupled(i, i + 1);
        if pair && i + 2 < n && coupled(i + 1, i + 2) {
            return None;
        }
        lane += usize::from(pair && lane % 2 == 1);
        lanes.extend(lane..lane + 1 + usize::from(pair));
        lane += 1 + usize::from(pair);
    }
    Some(lanes)
}

fn columns(filter: &BlockFilter, channels: usize, ratio: usize) -> Columns {
    let n = filter.a.len();
    let modal = modal_lanes(&filter.a);
    let lanes = modal.clone().unwrap_or_else(|| (0..n).collect());
    let states = lanes.last().map_or(0, |lane| lane + 1).next_multiple_of(RECURSION_LANES);
    let outputs = ratio.next_multiple_of(RECURSION_LANES);
    let modal = modal.map(|_| modal_factors(&filter.a, &lanes, states));
    // Columns before those of the inputs.
    let before = if modal.is_some() { 0 } else { states };
    let mut next = Aligned::new(states * (before + channels));
    let mut output = Aligned::new(outputs * (states + channels));
    for (i, &lane) in lanes.iter().enumerate() {
        (0..channels).for_each(|u| next[(before + u) * states + lane] = filter.b[i][u]);
        (0..ratio).for_each(|p| output[lane * outputs + p] = filter.c[p][i]);
        if modal.is_none() {
            (0..n).for_each(|j| next[lanes[j] * states + lane] = filter.a[i][j]);
        }
    }
    for p in 0..ratio {
        (0..channels).for_each(|u| output[(states + u) * outputs + p] = filter.d[p][u]);
    }
    Columns { states, inputs: channels, phases: ratio, outputs, modal, next, output }
}

/// Factors of each state itself and of its neighbour.
fn modal_factors(a: &[Vec<f64>], lanes: &[usize], states: usize) -> [Aligned<f64>; 2] {
    let [mut own, mut neighbour] = [Aligned::new(states), Aligned::new(states)];
    for (i, &lane) in lanes.iter().enumerate() {
        own[lane] = a[i][i];
        let partner = lanes.iter().position(|&other| other == lane ^ 1);
        neighbour[lane] = partner.map_or(0.0, |j| a[i][j]);
    }
    [own, neighbour]
}

fn check_matrix(
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
    match rows.iter().flatten().enumerate().find(|(_, value)| !value.is_finite()) {
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
        let plan = StateSpacePlan::new(filter, n, m, isa).unwrap();
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
        let plan = StateSpacePlan::new(&filter, 1, 1, Isa::detect()).unwrap();
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
