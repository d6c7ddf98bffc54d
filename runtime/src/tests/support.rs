//! Banks, inputs and the definition of the sum.

use crate::{Algorithm, BuildError, Isa, Options, Plan, Precision, Sample, Shape, StateMatrices, Stream};

/// A generator whose stream never changes (Knuth's MMIX).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn samples(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.next() as f32).collect()
    }
}

/// The coefficients of a test.
#[derive(Clone)]
pub(crate) enum Filters {
    Fir(Vec<Vec<f64>>),
    StateSpace(StateMatrices),
}

#[derive(Clone)]
pub(crate) struct Bank {
    pub(crate) filters: Filters,
    pub(crate) ratio: usize,
    pub(crate) latency: usize,
}

impl Bank {
    pub(crate) fn channel_count(&self) -> usize {
        match &self.filters {
            Filters::Fir(taps) => taps.len(),
            Filters::StateSpace(filter) => filter.d[0].len(),
        }
    }

    pub(crate) fn plan(&self, options: Options) -> Result<Plan, BuildError> {
        match &self.filters {
            Filters::Fir(taps) => Plan::from_taps(taps, self.ratio, self.latency, options),
            Filters::StateSpace(filter) => Plan::from_state_space(
                filter,
                Shape { channels: self.channel_count(), ratio: self.ratio },
                self.latency,
                options,
            ),
        }
    }
}

pub(crate) fn start(bank: &Bank, options: Options) -> Result<Stream, BuildError> {
    bank.plan(options).map(|plan| Stream::new(&plan))
}

pub(crate) fn fir_bank(taps: Vec<Vec<f64>>, ratio: usize) -> Bank {
    Bank { filters: Filters::Fir(taps), ratio, latency: 3 }
}

pub(crate) fn recursive_bank(filter: StateMatrices) -> Bank {
    Bank { ratio: filter.d.len(), filters: Filters::StateSpace(filter), latency: 3 }
}

pub(crate) fn random_taps(channels: usize, taps: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
    (0..channels).map(|_| (0..taps).map(|_| noise.next()).collect()).collect()
}

/// Two states that turn by one radian and shrink a little; c picks them, d passes input on.
pub(crate) fn rotation_bank() -> Bank {
    let (s, c) = 1f64.sin_cos();
    let filter = StateMatrices {
        a: vec![vec![0.9 * c, -0.9 * s], vec![0.9 * s, 0.9 * c]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![1.0, 0.0], vec![0.0, 1.0], vec![1.0, 1.0]],
        d: vec![vec![0.5], vec![0.0], vec![-1.0]],
    };
    recursive_bank(filter)
}

/// The algorithms for FIR filters.
pub(crate) const FIR_ALGORITHMS: [Algorithm; 2] = [Algorithm::Direct, Algorithm::OverlapSave];

pub(crate) fn by(algorithm: Algorithm) -> Options {
    Options { algorithm, ..Options::default() }
}

/// FIR filters in the precision.
pub(crate) fn precise(algorithm: Algorithm, precision: Precision) -> Options {
    Options { precision, ..by(algorithm) }
}

/// All outputs of an input in one call, the first of them for its first frame.
pub(crate) fn run<S: Sample>(bank: &Bank, options: Options, input: &[S]) -> Vec<S> {
    let mut stream = start(bank, options).unwrap();
    let (n, m, late) = (stream.channels(), stream.ratio(), stream.plan().extra_latency());
    let mut padded = input.to_vec();
    padded.resize(input.len() + late / m * n, S::default());
    let mut out = vec![S::default(); padded.len() / n * m];
    assert_eq!(stream.process(&padded, &mut out), Ok(out.len()));
    out.split_off(late)
}

/// The outputs of a stream that gets `input` in calls of so many frames.
pub(crate) fn in_pieces(stream: &mut Stream, input: &[f32], cuts: &[usize]) -> Vec<f32> {
    let (n, m) = (stream.channels(), stream.ratio());
    let mut pieces = vec![0.0; input.len() / n * m];
    let (mut from, mut to) = (input, &mut pieces[..]);
    for cut in cuts {
        let (head, tail) = to.split_at_mut(cut * m);
        assert_eq!(stream.process(&from[..cut * n], head).unwrap(), cut * m);
        (from, to) = (&from[cut * n..], tail);
    }
    pieces
}

/// The definition in f64.
pub(crate) fn definition<S: Sample>(taps: &[Vec<f64>], ratio: usize, input: &[S]) -> Vec<f64> {
    let n = taps.len();
    let mut out = vec![0.0; input.len() / n * ratio];
    for (t, y) in out.iter_mut().enumerate() {
        for (i, f) in taps.iter().enumerate() {
            *y += (0..=t / ratio)
                .filter_map(|k| f.get(t - k * ratio).map(|c| c * input[k * n + i].to_f64()))
                .sum::<f64>();
        }
    }
    out
}

/// The definition of a recursion, row by row.
pub(crate) fn state_space_definition(filter: &StateMatrices, input: &[f64]) -> Vec<f64> {
    let dot = |row: &[f64], v: &[f64]| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; filter.a.len()];
    let mut out = Vec::new();
    for u in input.chunks_exact(filter.d[0].len()) {
        out.extend(filter.c.iter().zip(&filter.d).map(|(c, d)| dot(c, &x) + dot(d, u)));
        x = filter.a.iter().zip(&filter.b).map(|(a, b)| dot(a, &x) + dot(b, u)).collect();
    }
    out
}

/// True if a multiply-add rounds once. The portable kernels round the product too on processors that may not
/// have a fused multiply-add (x86-64 before 2013).
pub(crate) fn fuses(isa: Isa) -> bool {
    isa != Isa::portable() || cfg!(any(target_arch = "aarch64", target_feature = "fma"))
}

/// The largest distance of two sequences.
pub(crate) fn worst<S: Sample>(want: &[f64], got: &[S]) -> f64 {
    assert_eq!(want.len(), got.len());
    let apart = want.iter().zip(got).map(|(a, b)| (a - b.to_f64()).abs());
    apart.fold(0.0, |most, x| if x.is_nan() { f64::INFINITY } else { most.max(x) })
}

/// The square root of the sum of squares.
pub(crate) fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|x| x * x).sum::<f64>().sqrt()
}
