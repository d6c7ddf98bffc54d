//! A bound of the gains at all vertices of a box at once, by multipliers (the S-procedure).
//!
//! The vertices of a channel are the ends of its delay, cut-off and gain. With a sign for each of them, its
//! row at a vertex is a sum over all sets of signs, of their product times a Walsh coefficient b of the
//! rows: h = h_0 + sum_k t_k b_k with |t_k| <= 1. So with K_0 the error system at the means of all
//! channels,
//!
//! ```text
//! K = K_0 - sum_k t_k f_k b_k,
//! ```
//!
//! k now running over the terms of all channels and f_k being the column of the filters of the channel of
//! term k. Let u be a direction and y_k = -t_k u* f_k, so that |y_k| <= |u* f_k|. For any e_k >= 0
//!
//! ```text
//! |u* K|^2 = |u* K_0 + sum_k y_k b_k|^2 <= |u* K_0 + sum_k y_k b_k|^2 + sum_k e_k (|u* f_k|^2 - |y_k|^2).
//! ```
//!
//! With B the rows b_k, f the columns f_k and E the diagonal matrix of the e_k, the right side is at most
//! g^2 |u|^2 for all u and y if
//!
//! ```text
//! [ g^2 - f E f* - K_0 K_0*    -K_0 B*  ]
//! [        -B K_0*              E - B B* ]  >= 0.
//! ```
//!
//! Then no vertex has a gain above g. The matrix is of order M plus the number of terms, where the
//! vertices are two to the power of the signs. The multipliers are sought in double precision: for given
//! ones the least g^2 is the largest eigenvalue of f E f* + K_0 K_0* + K_0 B* (E - B B*)^-1 B K_0*, a
//! convex function. The matrix is proven positive in balls. (V. A. Yakubovich, *S-procedure in nonlinear
//! control theory*, 1971.)

use super::super::ball::{Ball, Matrix};
use super::super::positive;
use super::at_frequency::{AtFrequency, Vertex};
use super::complex_matrix::ComplexMatrix;
use crate::linalg::{self, CMat, Complex, Mat};

/// Steps of the descent.
const STEPS: usize = 120;
/// Step in the logarithm of a multiplier: the first one, and the factor from step to step.
const FIRST_STEP: f64 = 0.3;
const STEP_FACTOR: f64 = 0.98;
/// Multipliers to begin with, over the least ones of that shape.
const STARTS: [f64; 5] = [1.05, 1.2, 1.5, 2.0, 3.0];
/// Bounds that exceed the limit by these factors after so many steps hardly get below it.
const PRUNE_LEVELS: [(usize, f64); 2] = [(0, 1.1), (20, 1.02)];
/// Share of the squared limit that is left for the proof.
const PROOF_SHARE: f64 = 1e-7;

/// The vertices of a channel, all combinations of its ends: their number is a power of two.
pub(super) type Vertices<'a> = &'a [Vertex];

/// Whether it is proven that no choice of a vertex for each channel has a gain above `limit`.
pub(super) fn proves(at: &AtFrequency<'_>, channels: &[Vertices<'_>], limit: f64) -> bool {
    let problem = Problem::new(at, channels);
    let square = limit * limit;
    if limit.is_nan() || square <= 0.0 {
        return false;
    }
    let found = Doubles::of(&problem).and_then(|doubles| doubles.multipliers(square * (1.0 - PROOF_SHARE)));
    found.is_some_and(|multipliers| problem.is_proven(&multipliers, square))
}

/// Numbers that a proof takes, for the estimate of work: the order of the matrix.
pub(super) fn order(outputs: usize, channels: &[Vertices<'_>]) -> usize {
    outputs + channels.iter().map(|vertices| vertices.len() - 1).sum::<usize>()
}

/// The rows K_0 and B with their filters.
struct Problem {
    /// Gram matrix of K_0 and B.
    gram: ComplexMatrix,
    /// f, M x the number of terms.
    filters: ComplexMatrix,
    /// The channel of each term.
    owners: Vec<usize>,
}

impl Problem {
    fn new(at: &AtFrequency<'_>, channels: &[Vertices<'_>]) -> Self {
        let (outputs, rows) = (at.filters.re.nrows(), at.gram.re.nrows());
        let mut map = ComplexMatrix::zeros(order(outputs, channels), rows);
        (0..outputs).for_each(|p| map.re[(p, p)] = Ball::from(1.0));
        let mut owners = Vec::new();
        for (i, vertices) in channels.iter().enumerate() {
            for (row, weight) in walsh(at, i, vertices, 0) {
                for p in 0..outputs {
                    map.re[(p, row)] -= at.filters.re[(p, i)] * weight;
                    map.im[(p, row)] -= at.filters.im[(p, i)] * weight;
                }
            }
            for signs in 1..vertices.len() {
                let term = outputs + owners.len();
                for (row, weight) in walsh(at, i, vertices, signs) {
                    map.re[(term, row)] += weight;
                }
                owners.push(i);
            }
        }
        let all: Vec<usize> = (0..outputs).collect();
        let gram = map.product(&at.gram).product(&map.adjoint());
        Self { gram, filters: at.filters.select(&all, &owners), owners }
    }

    /// The matrix of the module's page, in balls.
    fn is_proven(&self, multipliers: &[f64], square: f64) -> bool {
        let outputs = self.filters.re.nrows();
        let scaled = |m: &Matrix| {
            Matrix::from_fn(outputs, multipliers.len(), |p, k| m[(p, k)] * Ball::from(multipliers[k]))
        };
        let scaled = ComplexMatrix { re: scaled(&self.filters.re), im: scaled(&self.filters.im) };
        let weighed = scaled.product(&self.filters.adjoint());
        let part = |gram: &Matrix, weighed: &Matrix, unit: f64| {
            Matrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
                let mut entry = -gram[(i, j)];
                if i < outputs && j < outputs {
                    entry -= weighed[(i, j)];
                }
                if i == j {
                    let diagonal = if i < outputs { square } else { multipliers[i - outputs] };
                    entry += Ball::from(unit * diagonal);
                }
                entry
            })
        };
        let matrix = ComplexMatrix {
            re: part(&self.gram.re, &weighed.re, 1.0),
            im: part(&self.gram.im, &weighed.im, 0.0),
        };
        positive::is_positive_definite(&matrix.realified())
    }
}

/// A Walsh coefficient of the rows of a channel, as rows of the Gram matrix with their weights.
fn walsh(at: &AtFrequency<'_>, i: usize, vertices: &[Vertex], signs: usize) -> Vec<(usize, Ball)> {
    let share = Ball::from(1.0 / vertices.len() as f64);
    let weighed = |(index, vertex): (usize, &Vertex)| {
        let is_even = (index & signs).count_ones().is_multiple_of(2);
        let gain = Ball::from(if is_even { vertex.gain } else { -vertex.gain });
        (at.channels[i].rows[vertex.error][vertex.speed], gain * share)
    };
    vertices.iter().enumerate().map(weighed).collect()
}

/// A problem in double precision.
struct Doubles {
    filters: CMat,
    /// K_0 K_0*, K_0 B* and B B*.
    squares: [CMat; 3],
    /// The channel of each term.
    owners: Vec<usize>,
}

/// The least g^2 for some multipliers, and its derivatives.
struct Value {
    square: f64,
    slopes: Vec<f64>,
}

impl Doubles {
    fn of(problem: &Problem) -> Option<Self> {
        let complex = |m: &ComplexMatrix| {
            let (rows, columns) = m.re.shape();
            CMat::from_fn(rows, columns, |i, j| Complex::new(m.re[(i, j)].nearest(), m.im[(i, j)].nearest()))
        };
        let (gram, filters) = (complex(&problem.gram), complex(&problem.filters));
        let (m, n) = filters.shape();
        let block = |rows: (usize, usize), columns: (usize, usize)| {
            gram.view((rows.0, columns.0), (rows.1, columns.1)).into_owned()
        };
        let is_finite = gram.iter().chain(filters.iter()).all(|x| x.re.is_finite() && x.im.is_finite());
        let squares = [block((0, m), (0, m)), block((0, m), (m, n)), block((m, n), (m, n))];
        let owners = problem.owners.clone();
        (is_finite && n > 0).then_some(Self { filters, squares, owners })
    }

    /// Multipliers for which g^2 is at most `wanted`, if some are found.
    fn multipliers(&self, wanted: f64) -> Option<Vec<f64>> {
        let (mut multipliers, mut value) = self.start()?;
        let mut step = FIRST_STEP;
        for number in 0..STEPS {
            if value.square <= wanted {
                return Some(multipliers);
            }
            let is_pruned =
                |&(steps, factor): &(usize, f64)| number >= steps && value.square > factor * factor * wanted;
            if PRUNE_LEVELS.iter().any(is_pruned) {
                return None;
            }
            let slopes: Vec<f64> = value.slopes.iter().zip(&multipliers).map(|(s, e)| s * e).collect();
            let largest = slopes.iter().fold(0.0f64, |most, s| most.max(s.abs()));
            if largest.is_nan() || largest <= 0.0 {
                return None;
            }
            let moved = |step: f64| -> Vec<f64> {
                multipliers.iter().zip(&slopes).map(|(e, s)| e * (-step * s / largest).exp()).collect()
            };
            // Multipliers that are too small have no bound at all.
            let next = std::iter::successors(Some(step), |step| Some(0.5 * step)).take(20);
            let found = next.map(|step| (step, moved(step))).find_map(|(step, multipliers)| {
                let value = self.value(&multipliers)?;
                Some((step, multipliers, value))
            });
            (step, multipliers, value) = found?;
            step *= STEP_FACTOR;
        }
        (value.square <= wanted).then_some(multipliers)
    }

    /// Multipliers in proportion to |b_k| times the sum of |b_l| over the terms of the channel: those
    /// would do if the channels were orthogonal and their own terms parallel.
    fn start(&self) -> Option<(Vec<f64>, Value)> {
        let rows = &self.squares[2];
        let n = rows.nrows();
        let most = (0..n).map(|k| rows[(k, k)].re).fold(0.0, f64::max);
        let floor = f64::EPSILON * most + f64::MIN_POSITIVE;
        let lengths: Vec<f64> = (0..n).map(|k| rows[(k, k)].re.max(floor).sqrt()).collect();
        let of_channel = |k: usize| {
            let own = lengths.iter().zip(&self.owners).filter(|(_, owner)| **owner == self.owners[k]);
            own.map(|(length, _)| length).sum::<f64>()
        };
        let sizes: Vec<f64> = (0..n).map(|k| lengths[k] * of_channel(k)).collect();
        let shares = CMat::from_fn(n, n, |i, j| rows[(i, j)] / Complex::from((sizes[i] * sizes[j]).sqrt()));
        let largest = linalg::hermitian_eigenvalues(&shares).ok()?.into_iter().fold(0.0, f64::max);
        let starts = STARTS.iter().filter_map(|factor| {
            let multipliers: Vec<f64> = sizes.iter().map(|size| factor * largest * size).collect();
            let value = self.value(&multipliers)?;
            Some((multipliers, value))
        });
        starts.min_by(|a, b| a.1.square.total_cmp(&b.1.square))
    }

    /// `None` where E - B B* is not positive.
    fn value(&self, multipliers: &[f64]) -> Option<Value> {
        let [centre, mixed, rows] = &self.squares;
        let (m, n) = self.filters.shape();
        let diagonal = |i: usize, j: usize| if i == j { multipliers[i] } else { 0.0 };
        let rest = CMat::from_fn(n, n, |i, j| Complex::from(diagonal(i, j)) - rows[(i, j)]);
        let least = linalg::hermitian_eigenvalues(&rest).ok()?.into_iter().fold(f64::INFINITY, f64::min);
        let most = multipliers.iter().copied().fold(0.0, f64::max);
        if least.is_nan() || least <= 1e-12 * most {
            return None;
        }
        let answer = linalg::solve(&rest, &mixed.adjoint());
        let weighed = CMat::from_fn(m, n, |p, k| self.filters[(p, k)] * Complex::from(multipliers[k]));
        let sum = weighed * self.filters.adjoint() + centre + mixed * &answer;
        let (square, u) = largest_eigenvector(&sum)?;
        let of = |k: usize| {
            let by_filter: Complex<f64> = (0..m).map(|p| u[p].conj() * self.filters[(p, k)]).sum();
            let by_row: Complex<f64> = (0..m).map(|p| answer[(k, p)] * u[p]).sum();
            by_filter.norm_sqr() - by_row.norm_sqr()
        };
        Some(Value { square, slopes: (0..n).map(of).collect() })
    }
}

/// The largest eigenvalue of a Hermitian matrix with its vector.
fn largest_eigenvector(m: &CMat) -> Option<(f64, Vec<Complex<f64>>)> {
    let n = m.nrows();
    let real = Mat::from_fn(2 * n, 2 * n, |i, j| {
        let entry = m[(i % n, j % n)];
        match (i < n, j < n) {
            (true, true) | (false, false) => entry.re,
            (true, false) => -entry.im,
            (false, true) => entry.im,
        }
    });
    let (values, vectors) = linalg::symmetric_eigen(&real).ok()?;
    let k = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
    let vector = (0..n).map(|p| Complex::new(vectors[(p, k)], vectors[(n + p, k)]));
    values[k].is_finite().then(|| (values[k], vector.collect()))
}

#[cfg(test)]
mod tests {
    use super::super::grid::ChannelGrid;
    use super::super::quick::lower_gain;
    use super::*;
    use crate::random::Random;
    use crate::units::Seconds;

    const OUTPUTS: usize = 3;

    /// Two ends of the delay and of the cut-off for each channel.
    fn channels(count: usize) -> Vec<ChannelGrid> {
        let row = |i: usize, vertex: usize| OUTPUTS + 4 * i + vertex;
        let channel = |i: usize| ChannelGrid {
            errors: vec![Seconds(-1.0), Seconds(1.0)],
            speeds: vec![0.9, 1.1],
            rows: vec![vec![row(i, 0), row(i, 1)], vec![row(i, 2), row(i, 3)]],
        };
        (0..count).map(channel).collect()
    }

    fn random(source: &mut Random, rows: usize, columns: usize, size: f64) -> ComplexMatrix {
        let mut draw = || Matrix::from_fn(rows, columns, |_, _| Ball::from(size * source.sample()));
        ComplexMatrix { re: draw(), im: draw() }
    }

    /// Against all vertices: no bound is below the largest gain, and one that is a little above it is found.
    #[test]
    fn no_vertex_exceeds_the_bound() {
        let mut source = Random(6);
        let count = 3;
        for trial in 0..12 {
            let grid = channels(count);
            // Vertices that lie around a common row.
            let rows = random(&mut source, OUTPUTS + 4 * count, 9, 1.0);
            let spread = [0.05, 0.4][trial % 2];
            let near = |m: &Matrix| {
                Matrix::from_fn(m.nrows(), m.ncols(), |i, j| match i.checked_sub(OUTPUTS) {
                    Some(v) if v % 4 > 0 => m[(i - v % 4, j)] + m[(i, j)] * Ball::from(spread),
                    _ => m[(i, j)],
                })
            };
            let rows = ComplexMatrix { re: near(&rows.re), im: near(&rows.im) };
            let gains = vec![0.0, 0.02, 0.0];
            let converters: Vec<_> = (0..count).map(|i| i..i + 1).collect();
            let at = AtFrequency {
                gram: rows.product(&rows.adjoint()),
                filters: random(&mut source, OUTPUTS, count, 0.5),
                columns: vec![1.0; count],
                channels: &grid,
                converters: &converters,
                gains: &gains,
            };
            let parts = at.whole();
            let sets: Vec<Vec<Vertex>> = (0..count).map(|i| at.vertices(i, &parts[i])).collect();
            let mut most = 0.0f64;
            for index in 0..4 * 8 * 4 {
                let chosen = [sets[0][index % 4], sets[1][index / 4 % 8], sets[2][index / 32]];
                let of = |(i, v): (usize, &Vertex)| vec![(grid[i].rows[v.error][v.speed], v.gain)];
                let mixes: Vec<_> = chosen.iter().enumerate().map(of).collect();
                most = most.max(lower_gain(&at.square(&mixes)));
            }
            let all: Vec<Vertices<'_>> = sets.iter().map(Vec::as_slice).collect();
            assert!(!proves(&at, &all, most * (1.0 - 1e-9)), "{trial}");
            let enough = if spread < 0.1 { 1.1 } else { 1.3 };
            assert!(proves(&at, &all, enough * most), "{trial}");
            // Chosen vertices are sets of one.
            let one: Vec<Vertices<'_>> = sets.iter().map(|set| &set[..1]).collect();
            assert!(proves(&at, &[one[0], all[1], one[2]], enough * most), "{trial}");
        }
    }
}
