//! Gains in double precision with a bound of their rounding. Most gains of a search are far from what they
//! are compared with, and are decided here at a small part of the cost of balls.
//!
//! At a frequency, K = A r with the rows r of the Gram matrix G and A = [I, -F_i w, ..]. As G is positive
//! semidefinite, |G_cd| <= s_c s_d with s_c = sqrt(G_cc). With a_p = sum_c |A_pc| s_c each entry of the
//! computed A G A* is wrong by at most eps a_p a_q for some small eps, so its largest eigenvalue is wrong by
//! at most eps |a|^2.
//!
//! The other gains have bounds in balls: the root of the largest eigenvalue of K K*, proven.

use super::super::ball::{self, Ball, Matrix};
use super::super::positive;
use super::complex_matrix::ComplexMatrix;
use crate::linalg;

/// Relative rounding error of an operation.
pub(super) const UNIT_ROUNDOFF: f64 = 0.5 * f64::EPSILON;
/// Smaller squares are left to balls: nothing here may underflow.
const LEAST_SQUARE: f64 = 1e-200;
/// Relative error of a squared gain that is no obstacle to a decision.
const SHARP_GAIN_ERROR: f64 = 1e-7;

/// The Gram matrix and the filters of a frequency as doubles.
#[derive(Debug)]
pub(super) struct Quick {
    gram: Complex,
    filters: Columns,
    /// s_c, from above.
    sizes: Vec<f64>,
    /// |G - gram| <= `spread` s_c s_d.
    spread: f64,
}

/// The columns of a matrix of balls as doubles with bounds of their errors.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    pub(super) outputs: usize,
    entries: Vec<[f64; 3]>,
}

impl Columns {
    pub(super) fn of(m: &ComplexMatrix) -> Self {
        let entries = m.re.iter().zip(&m.im);
        let entries = entries.map(|(re, im)| [re.nearest(), im.nearest(), off(*re) + off(*im)]).collect();
        Self { outputs: m.re.nrows(), entries }
    }

    pub(super) fn column(&self, i: usize) -> impl Iterator<Item = [f64; 3]> {
        self.entries[i * self.outputs..][..self.outputs].iter().copied()
    }
}

/// A complex matrix by rows.
#[derive(Debug, Clone, Default)]
struct Complex {
    columns: usize,
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Complex {
    /// Zeros in place of what was there.
    fn clear(&mut self, rows: usize, columns: usize) {
        self.columns = columns;
        for part in [&mut self.re, &mut self.im] {
            part.clear();
            part.resize(rows * columns, 0.0);
        }
    }

    fn of(m: &ComplexMatrix) -> Self {
        let (rows, columns) = m.re.shape();
        let at = |k: usize| (k / columns, k % columns);
        let part = |of: &dyn Fn(usize) -> f64| (0..rows * columns).map(of).collect();
        Self { columns, re: part(&|k| m.re[at(k)].nearest()), im: part(&|k| m.im[at(k)].nearest()) }
    }
}

/// Columns of M numbers, each times a row of the Gram matrix: what is added to the reference rows.
#[derive(Debug, Clone, Default)]
pub(super) struct Terms {
    rows: Vec<usize>,
    /// One column after another.
    re: Vec<f64>,
    im: Vec<f64>,
    /// Bounds of how far the entries are from these.
    off: Vec<f64>,
}

impl Terms {
    pub(super) fn clear(&mut self) {
        let Self { rows, re, im, off } = self;
        rows.clear();
        [re, im, off].into_iter().for_each(Vec::clear);
    }

    /// Adds a column of numbers with bounds of their errors, times `weight`.
    pub(super) fn push(&mut self, row: usize, weight: f64, column: impl Iterator<Item = [f64; 3]>) {
        self.rows.push(row);
        for [re, im, off] in column {
            self.re.push(weight * re);
            self.im.push(weight * im);
            self.off.push(weight.abs() * (off + UNIT_ROUNDOFF * (re.abs() + im.abs())));
        }
    }
}

/// What comparisons compute with, kept from one to the next: there are millions of them.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    /// The rows of the Gram matrix that K reads.
    rows: Vec<usize>,
    /// A.
    map: Complex,
    /// The rows and columns of the Gram matrix that K reads.
    gram: Complex,
    /// A row of A G.
    row: Complex,
    /// A G A*.
    square: Complex,
    /// Of Cholesky.
    factor: Complex,
}

/// How a gain compares with a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compared {
    /// It is proven to be at most the limit.
    Below,
    /// It is larger, or closer to the limit than [`SHARP_GAIN_ERROR`].
    NotBelow,
    /// Double precision does not suffice.
    Unclear,
}

impl Quick {
    pub(super) fn new(gram: &ComplexMatrix, filters: &ComplexMatrix) -> Self {
        let n = gram.re.nrows();
        // A faint row gets a size of its own, so that the quotients below stay finite.
        let size =
            |c: usize| gram.re[(c, c)].magnitude().sqrt() * (1.0 + 8.0 * UNIT_ROUNDOFF) + LEAST_SQUARE.sqrt();
        let sizes: Vec<f64> = (0..n).map(size).collect();
        let share = |(c, d): (usize, usize)| {
            (off(gram.re[(c, d)]) + off(gram.im[(c, d)])) / (sizes[c] * sizes[d])
                * (1.0 + 8.0 * UNIT_ROUNDOFF)
        };
        let pairs = (0..n).flat_map(|c| (0..n).map(move |d| (c, d)));
        let spread = pairs.map(share).fold(0.0, ball::nan_max);
        Self { gram: Complex::of(gram), filters: Columns::of(filters), sizes, spread }
    }

    /// Adds -F_i times `weight` for a row of channel `i`.
    pub(super) fn subtract(&self, terms: &mut Terms, i: usize, row: usize, weight: f64) {
        terms.push(row, -weight, self.filters.column(i));
    }

    /// Compares the gain of K = reference rows + `terms` with `limit`.
    pub(super) fn compare(&self, terms: &Terms, limit: f64, space: &mut Workspace) -> Compared {
        let square = limit * limit * (1.0 - 8.0 * UNIT_ROUNDOFF);
        if limit.is_nan() || limit <= 0.0 {
            return Compared::NotBelow;
        }
        let outputs = self.filters.outputs;
        let error = self.fill_map(terms, outputs, &mut space.map);
        let is_sharp = square > LEAST_SQUARE && error < SHARP_GAIN_ERROR * square;
        if square > LEAST_SQUARE && self.is_dominated(terms, square - error, space) {
            Compared::Below
        } else if is_sharp {
            Compared::NotBelow
        } else {
            Compared::Unclear
        }
    }

    /// Whether it is proven that A G A* as computed has no eigenvalue above `bound`.
    fn is_dominated(&self, terms: &Terms, bound: f64, space: &mut Workspace) -> bool {
        let outputs = self.filters.outputs;
        space.rows.clear();
        space.rows.extend((0..outputs).chain(terms.rows.iter().copied()));
        self.congruence(space);
        is_dominated(&space.square, outputs, bound, &mut space.factor)
    }

    /// Sets `map` to A, and bounds the error of the eigenvalues of A G A* as [`Quick::congruence`] computes
    /// it.
    fn fill_map(&self, terms: &Terms, outputs: usize, map: &mut Complex) -> f64 {
        let count = outputs + terms.rows.len();
        map.clear(outputs, count);
        // |a|^2 and |d|^2 with d_p = sum_c |A_pc - its double| s_c.
        let (mut all, mut inexact) = (0.0, 0.0);
        for p in 0..outputs {
            map.re[p * count + p] = 1.0;
            let (mut a, mut d) = (self.sizes[p], 0.0);
            for (t, &row) in terms.rows.iter().enumerate() {
                let (at, from) = (p * count + outputs + t, t * outputs + p);
                (map.re[at], map.im[at]) = (terms.re[from], terms.im[from]);
                a += self.sizes[row] * (terms.re[from].abs() + terms.im[from].abs() + terms.off[from]);
                d += self.sizes[row] * terms.off[from];
            }
            all += a * a;
            inexact += d * d;
        }
        // Each of the two products sums `count` complex terms, of which each is rounded four times.
        let rounding = (16 * count + 64) as f64 * UNIT_ROUNDOFF;
        let error = (self.spread + rounding) * all + 2.0 * (inexact * all).sqrt();
        error * (1.0 + 1e-10)
    }

    /// Sets `space.square` to A G A*, in rounded arithmetic.
    fn congruence(&self, space: &mut Workspace) {
        let Workspace { rows, map, gram, row, square, .. } = space;
        let (count, n) = (map.columns, self.gram.columns);
        let outputs = map.re.len() / count;
        gram.clear(count, count);
        for (c, &row) in rows.iter().enumerate() {
            for (d, &column) in rows.iter().enumerate() {
                gram.re[c * count + d] = self.gram.re[row * n + column];
                gram.im[c * count + d] = self.gram.im[row * n + column];
            }
        }
        square.clear(outputs, outputs);
        row.clear(1, count);
        for p in 0..outputs {
            row.re.copy_from_slice(&gram.re[p * count..][..count]);
            row.im.copy_from_slice(&gram.im[p * count..][..count]);
            for c in outputs..count {
                let (x, y) = (map.re[p * count + c], map.im[p * count + c]);
                let (row_re, row_im) = (&gram.re[c * count..][..count], &gram.im[c * count..][..count]);
                for d in 0..count {
                    row.re[d] += x * row_re[d] - y * row_im[d];
                    row.im[d] += x * row_im[d] + y * row_re[d];
                }
            }
            let (re, im) = (&row.re[..count], &row.im[..count]);
            for q in 0..=p {
                let (x, y) = (&map.re[q * count..][..count], &map.im[q * count..][..count]);
                // Times the conjugate.
                square.re[p * outputs + q] = (0..count).map(|d| re[d] * x[d] + im[d] * y[d]).sum();
                square.im[p * outputs + q] = (0..count).map(|d| im[d] * x[d] - re[d] * y[d]).sum();
            }
        }
    }
}

/// How far an enclosed number is from its nearest double.
pub(super) fn off(x: Ball) -> f64 {
    (x.radius() + UNIT_ROUNDOFF * x.magnitude()) * (1.0 + 8.0 * UNIT_ROUNDOFF)
}

/// Whether it is proven that the Hermitian matrix (lower triangle read) has no eigenvalue above `bound`: the
/// Cholesky factorisation of bound I - m, less the bound of its backward error, runs to its end. (See
/// [`super::super::positive`]; the complex matrix is that of twice the order which acts on (re, im).)
fn is_dominated(m: &Complex, n: usize, bound: f64, factor: &mut Complex) -> bool {
    let trace: f64 = (0..n).map(|i| bound.abs() + m.re[i * n + i].abs()).sum();
    // Twice the order, and complex operations that round up to four times.
    let rounding = (16 * n + 64) as f64 * UNIT_ROUNDOFF * trace;
    let shift = bound - 2.0 * rounding;
    if shift.is_nan() || shift < LEAST_SQUARE {
        return false;
    }
    factor.clear(n, n);
    for i in 0..n {
        for j in 0..=i {
            let (mut re, mut im) = (-m.re[i * n + j], -m.im[i * n + j]);
            for k in 0..j {
                let (a, b) = (i * n + k, j * n + k);
                re -= factor.re[a] * factor.re[b] + factor.im[a] * factor.im[b];
                im -= factor.im[a] * factor.re[b] - factor.re[a] * factor.im[b];
            }
            if j < i {
                let pivot = factor.re[j * n + j];
                (factor.re[i * n + j], factor.im[i * n + j]) = (re / pivot, im / pivot);
                continue;
            }
            let pivot = re + shift;
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            factor.re[i * n + i] = pivot.sqrt();
        }
    }
    true
}

/// Relative margins over a computed eigenvalue at which a proof that it is an upper bound is tried.
const MARGINS: [f64; 4] = [1e-9, 1e-6, 1e-3, 1.0];

/// A proven upper bound of the root of the largest eigenvalue; at least tries to prove `wanted` if the
/// eigenvalue is below.
pub(super) fn upper_gain(square: &ComplexMatrix, wanted: f64) -> f64 {
    let real = square.realified();
    let Ok(values) = linalg::hermitian_eigenvalues(&ball::nearest(&real)) else { return f64::INFINITY };
    let largest = values.into_iter().fold(0.0, f64::max);
    let exceeds = |bound: f64| {
        let shifted = Matrix::from_fn(real.nrows(), real.nrows(), |i, j| {
            let entry = -real[(i, j)];
            if i == j { entry + Ball::from(bound) } else { entry }
        });
        positive::is_positive_definite(&shifted)
    };
    let tight = wanted * wanted * (1.0 - 1e-14);
    let tried = MARGINS.iter().map(|margin| largest * (1.0 + margin) + f64::MIN_POSITIVE);
    let enough = (wanted > 0.0 && largest < tight).then_some(tight);
    let proven = enough.into_iter().chain(tried).find(|&bound| exceeds(bound));
    proven.map_or(f64::INFINITY, |bound| bound.sqrt() * (1.0 + 1e-15))
}

/// A proven lower bound of the same: the quotient of a direction near the eigenvector.
pub(super) fn lower_gain(square: &ComplexMatrix) -> f64 {
    let real = square.realified();
    let Ok((values, vectors)) = linalg::symmetric_eigen(&ball::nearest(&real)) else { return 0.0 };
    let Some(k) = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])) else { return 0.0 };
    let direction: Matrix = ball::exact(&vectors.columns(k, 1).into_owned());
    let transposed = direction.transpose();
    let energy = ball::product(&transposed, &ball::product(&real, &direction))[(0, 0)];
    let quotient = (energy / ball::product(&transposed, &direction)[(0, 0)]).lower();
    if quotient > 0.0 { quotient.sqrt() * (1.0 - 1e-15) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const WEIGHTS: [(usize, f64); 3] = [(0, 0.3), (0, 0.7), (1, 1.01)];

    fn random(random: &mut Random, rows: usize, columns: usize) -> ComplexMatrix {
        // Some digits below those of doubles.
        let mut draw = || {
            Matrix::from_fn(rows, columns, |_, _| {
                Ball::from(random.sample()) + Ball::from(1e-18 * random.sample())
            })
        };
        ComplexMatrix { re: draw(), im: draw() }
    }

    fn widened(m: &ComplexMatrix, by: f64) -> ComplexMatrix {
        ComplexMatrix { re: m.re.map(|x| x.widened(by)), im: m.im.map(|x| x.widened(by)) }
    }

    /// K K* in balls, the slow way.
    fn square(gram: &ComplexMatrix, filters: &ComplexMatrix) -> ComplexMatrix {
        let outputs = filters.re.nrows();
        let map = |of: &Matrix, unit: f64| {
            Matrix::from_fn(outputs, outputs + WEIGHTS.len(), |p, c| match c.checked_sub(outputs) {
                None => Ball::from(if p == c { unit } else { 0.0 }),
                Some(t) => of[(p, WEIGHTS[t].0)] * Ball::from(-WEIGHTS[t].1),
            })
        };
        let map = ComplexMatrix { re: map(&filters.re, 1.0), im: map(&filters.im, 0.0) };
        map.product(gram).product(&map.adjoint())
    }

    fn compared(gram: &ComplexMatrix, filters: &ComplexMatrix, limit: f64) -> Compared {
        let quick = Quick::new(gram, filters);
        let mut terms = Terms::default();
        for (t, &(i, weight)) in WEIGHTS.iter().enumerate() {
            quick.subtract(&mut terms, i, filters.re.nrows() + t, weight);
        }
        quick.compare(&terms, limit, &mut Workspace::default())
    }

    /// Against balls: no gain is called below a limit that it exceeds, and nearly all that are below are
    /// seen.
    #[test]
    fn gains_are_compared_as_balls_compare_them() {
        let mut source = Random(3);
        for trial in 0..60 {
            let (outputs, radius) = (1 + trial % 3, [0.0, 1e-10][trial % 2]);
            // Six rows of five inputs: the Gram matrix is singular.
            let rows = random(&mut source, outputs + WEIGHTS.len(), 5);
            let gram = widened(&rows.product(&rows.adjoint()), radius);
            let filters = widened(&random(&mut source, outputs, 2), radius);
            let square = square(&gram, &filters);
            let (lower, upper) = (lower_gain(&square), upper_gain(&square, 0.0));
            assert_ne!(compared(&gram, &filters, lower * (1.0 - 1e-14)), Compared::Below, "{trial}");
            assert_eq!(compared(&gram, &filters, upper * (1.0 + 1e-12 + 1e4 * radius)), Compared::Below);
            assert_eq!(compared(&gram, &filters, 0.9 * lower), Compared::NotBelow);
            assert_eq!(compared(&gram, &filters, 1e-9 * lower), Compared::Unclear);
        }
    }

    #[test]
    fn what_is_not_known_is_not_below() {
        let (gram, filters) = (ComplexMatrix::zeros(4, 4), ComplexMatrix::zeros(1, 2));
        assert_eq!(compared(&gram, &filters, 1e-3), Compared::Below);
        assert_eq!(compared(&widened(&gram, f64::NAN), &filters, 1e9), Compared::Unclear);
        assert_eq!(compared(&gram, &widened(&filters, f64::INFINITY), 1e9), Compared::Unclear);
        assert_eq!(compared(&gram, &filters, f64::NAN), Compared::NotBelow);
        assert_eq!(compared(&gram, &filters, 0.0), Compared::NotBelow);
    }
}
