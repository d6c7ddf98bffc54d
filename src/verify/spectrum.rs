//! Frequency responses, enclosed. Points of the unit circle are rational: e^{i w} =
//! (c + i s)^2 / (c^2 + s^2) for any two doubles c, s (about cos(w/2) and sin(w/2)), so that no
//! transcendental function is needed.

use super::ball::{self, Ball, Matrix};
use super::error_system::BlockForm;
use super::slow_period::SlowPeriod;
use crate::arithmetic::{ComplexBall, DoubleDouble, Number};
use crate::bank::SynthesisFilters;
use crate::linalg::{self, CMat, Complex, Mat};

/// A complex matrix.
#[derive(Debug, Clone)]
pub(super) struct ComplexMatrix<F = DoubleDouble> {
    pub(super) re: Matrix<F>,
    pub(super) im: Matrix<F>,
}

impl<F: Number> ComplexMatrix<F> {
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        Self { re: ball::zeros(rows, columns), im: ball::zeros(rows, columns) }
    }

    pub(super) fn real(re: Matrix<F>) -> Self {
        Self { im: ball::zeros(re.nrows(), re.ncols()), re }
    }

    /// A column of complex numbers.
    pub(super) fn column(values: &[[f64; 2]]) -> Self {
        let part = |k: usize| Matrix::from_fn(values.len(), 1, |i, _| Ball::from(values[i][k]));
        Self { re: part(0), im: part(1) }
    }

    /// The point of the unit circle named by `half`.
    pub(super) fn unit(half: [f64; 2]) -> Self {
        let [c, s] = half.map(Ball::from);
        let (cc, ss, cs) = (c * c, s * s, c * s);
        let number = |x: Ball<F>| Matrix::from_element(1, 1, x / (cc + ss));
        Self { re: number(cc - ss), im: number(cs + cs) }
    }

    pub(super) fn product(&self, other: &Self) -> Self {
        let of = ball::product;
        Self {
            re: of(&self.re, &other.re) - of(&self.im, &other.im),
            im: of(&self.re, &other.im) + of(&self.im, &other.re),
        }
    }

    /// Times a complex number (1 x 1).
    pub(super) fn times(&self, z: &Self) -> Self {
        let (c, s) = (z.re[(0, 0)], z.im[(0, 0)]);
        Self {
            re: self.re.zip_map(&self.im, |x, y| x * c - y * s),
            im: self.re.zip_map(&self.im, |x, y| x * s + y * c),
        }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self { re: &self.re + &other.re, im: &self.im + &other.im }
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        Self { re: &self.re - &other.re, im: &self.im - &other.im }
    }

    pub(super) fn adjoint(&self) -> Self {
        Self { re: self.re.transpose(), im: self.im.transpose().map(|x| -x) }
    }

    pub(super) fn rows(&self, start: usize, count: usize) -> Self {
        Self { re: self.re.rows(start, count).into_owned(), im: self.im.rows(start, count).into_owned() }
    }

    /// Row i times `scales[i]`.
    pub(super) fn with_rows_scaled(&self, scales: &[f64]) -> Self {
        let part =
            |m: &Matrix<F>| Matrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * Ball::from(scales[i]));
        Self { re: part(&self.re), im: part(&self.im) }
    }

    /// Row i replaced by what `map` makes of it.
    fn each_row(&self, map: impl Fn(usize, Self) -> Self) -> Self {
        let mut all = Self::zeros(self.re.nrows(), self.re.ncols());
        for i in 0..self.re.nrows() {
            let row = map(i, self.rows(i, 1));
            all.re.row_mut(i).copy_from(&row.re);
            all.im.row_mut(i).copy_from(&row.im);
        }
        all
    }

    pub(super) fn above(&self, below: &Self) -> Self {
        let stack = |a: &Matrix<F>, b: &Matrix<F>| {
            Matrix::from_fn(a.nrows() + b.nrows(), a.ncols(), |i, j| {
                if i < a.nrows() { a[(i, j)] } else { b[(i - a.nrows(), j)] }
            })
        };
        Self { re: stack(&self.re, &below.re), im: stack(&self.im, &below.im) }
    }

    pub(super) fn select(&self, rows: &[usize], columns: &[usize]) -> Self {
        let part =
            |m: &Matrix<F>| Matrix::from_fn(rows.len(), columns.len(), |i, j| m[(rows[i], columns[j])]);
        Self { re: part(&self.re), im: part(&self.im) }
    }

    /// A Hermitian matrix as the real symmetric one of twice the order that acts on (re, im).
    pub(super) fn realified(&self) -> Matrix<F> {
        let n = self.re.nrows();
        Matrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, true) => self.re[(i, j)],
            (false, false) => self.re[(i - n, j - n)],
            (false, true) => self.im[(i - n, j)],
            (true, false) => -self.im[(i, j - n)],
        })
    }

    /// Real parts over imaginary parts.
    pub(super) fn stacked(&self) -> Matrix<F> {
        let n = self.re.nrows();
        Matrix::from_fn(
            2 * n,
            self.re.ncols(),
            |i, j| if i < n { self.re[(i, j)] } else { self.im[(i - n, j)] },
        )
    }

    /// sum |x|^2 over all entries.
    pub(super) fn square(&self) -> Ball<F> {
        self.re.iter().chain(&self.im).fold(Ball::ZERO, |sum, &x| sum + x * x)
    }

    /// Whether the radii stay below the share `most` of the largest entry.
    pub(super) fn is_resolved(&self, most: f64) -> bool {
        let all = || self.re.iter().chain(&self.im);
        let largest = all().map(|x| x.nearest().abs()).fold(0.0, f64::max);
        all().all(|x| x.radius() <= most * largest)
    }

    /// The nearest doubles to the midpoints.
    pub(super) fn nearest(&self) -> CMat {
        self.re.zip_map(&self.im, |re, im| Complex::new(re.nearest(), im.nearest()))
    }

    /// Re <self, other> = Re tr(self* other).
    pub(super) fn inner(&self, other: &Self) -> Ball<F> {
        let part = |a: &Matrix<F>, b: &Matrix<F>| {
            a.iter().zip(b.iter()).fold(Ball::ZERO, |sum, (&x, &y)| sum + x * y)
        };
        part(&self.re, &other.re) + part(&self.im, &other.im)
    }
}

/// z^-k on the unit circle.
pub(super) fn delay<F: Number>(z: &ComplexMatrix<F>, periods: usize) -> ComplexMatrix<F> {
    let (mut power, mut square) = (ComplexMatrix::real(ball::identity(1)), z.adjoint());
    let mut rest = periods;
    while rest > 0 {
        if rest & 1 == 1 {
            power = power.product(&square);
        }
        square = square.product(&square);
        rest >>= 1;
    }
    power
}

/// Maximum number of refinement steps per 106 bits. The better the condition, the more digits each step
/// gains.
const REFINEMENTS: usize = 6;
/// They end where the residual falls by less than this.
const LEAST_GAIN: f64 = 0.1;

/// (z I - a)^-1 right, as a real system B x = r of twice the order.
///
/// Any approximate solution will do: it is wrong by at most ||B^-1|| times its residual, which is enclosed.
fn resolved<F: Number>(a: &Matrix<F>, z: &ComplexMatrix<F>, right: &ComplexMatrix<F>) -> ComplexMatrix<F> {
    let n = a.nrows();
    if n == 0 {
        return right.clone();
    }
    let shifted = ComplexMatrix {
        re: ball::scaled(&ball::identity(n), z.re[(0, 0)]) - a,
        im: ball::scaled(&ball::identity(n), z.im[(0, 0)]),
    }
    .realified();
    let right = right.stacked();
    let inverse = linalg::inverse(&ball::nearest(&shifted));
    let residual = |x: &Matrix<F>| &right - ball::product(&shifted, x);
    let size = |m: &Matrix<F>| m.iter().map(|x| x.magnitude()).fold(0.0, ball::nan_max);
    let mut x = ball::zeros(2 * n, right.ncols());
    let mut rest = right.clone();
    let mut largest = size(&rest);
    for _ in 0..refinements::<F>() {
        let step = ball::exact(&(&inverse * ball::nearest(&rest)));
        let next = (&x + step).map(|x| Ball::exactly(x.mid()));
        let next_rest = residual(&next);
        let before = std::mem::replace(&mut largest, size(&next_rest));
        (x, rest) = (next, next_rest);
        // No further digits are gained, or the residual is not a number.
        if largest.is_nan() || largest > LEAST_GAIN * before {
            break;
        }
    }
    let error = 1.01 * inverse_norm(&shifted, &inverse) * largest;
    let part = |start: usize| x.rows(start, n).map(|x| x.widened(error));
    ComplexMatrix { re: part(0), im: part(n) }
}

fn refinements<F: Number>() -> usize {
    let digits = -F::ROUNDING.log10() / -DoubleDouble::ROUNDING.log10();
    (REFINEMENTS as f64 * digits).ceil() as usize
}

/// A bound on the row sums of B^-1 from an approximate inverse R: ||R|| / (1 - q) with
/// q = ||I - R B|| < 1/2, else NaN. The product R B is taken in double precision; its rounding is at most n
/// eps |R| |B|.
fn inverse_norm<F: Number>(matrix: &Matrix<F>, inverse: &Mat) -> f64 {
    let n = matrix.nrows();
    let near = ball::nearest(matrix);
    let sums = |m: &Mat| m.row_iter().map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, ball::nan_max);
    let rounding = (n + 8) as f64 * f64::EPSILON * sums(&(inverse.abs() * near.abs()));
    let q =
        sums(&(Mat::identity(n, n) - inverse * near)) + rounding + sums(inverse) * ball::radius_sum(matrix);
    if 1.01 * q < 0.5 { 1.01 * sums(inverse) / (1.0 - 1.01 * q) } else { f64::NAN }
}

/// Gram matrix of all samples of a slow period at the point z of the unit circle: G G* of their responses G
/// to the input.
pub(super) fn gram<F: Number>(period: &SlowPeriod<F>, z: &ComplexMatrix<F>) -> ComplexMatrix<F> {
    let (n, samples) = (period.order(), period.samples());
    let from_state = ComplexMatrix::real(period.outputs.clone()).product(&resolved(
        &period.transition,
        z,
        &ComplexMatrix::real(ball::identity(n)),
    ));
    let phases: Vec<ComplexMatrix<F>> = period.delay_periods.iter().map(|&late| delay(z, late)).collect();
    // G = [A D], A from the states and D = diag(d) of the inputs of this period.
    let rows: Vec<ComplexMatrix<F>> = (0..samples).map(|s| from_state.rows(s, 1).times(&phases[s])).collect();
    let entry = |m: &ComplexMatrix<F>, k: usize| ComplexBall::new(m.re[(0, k)], m.im[(0, k)]);
    let a = |s: usize, k: usize| entry(&rows[s], k);
    let d = |s: usize| entry(&phases[s], 0);
    let q = |i: usize, j: usize| period.gram[(i, j)];
    let mut gram = ComplexMatrix::zeros(samples, samples);
    for i in 0..samples {
        // Row i of [A D] times the Gram matrix of states and inputs.
        let sum = |column: usize| {
            let own = d(i).scaled(q(n + i, column));
            (0..n).fold(own, |sum, k| sum + a(i, k).scaled(q(k, column)))
        };
        let of_states: Vec<ComplexBall<F>> = (0..n).map(sum).collect();
        // The matrix is Hermitian.
        for j in 0..=i {
            let own = sum(n + j) * d(j).conj();
            let entry = (0..n).fold(own, |sum, k| sum + of_states[k] * a(j, k).conj());
            (gram.re[(i, j)], gram.re[(j, i)]) = (entry.re, entry.re);
            if i != j {
                (gram.im[(i, j)], gram.im[(j, i)]) = (entry.im, -entry.im);
            }
        }
    }
    gram
}

/// Gamma b, without Gamma.
pub(super) fn gram_times<F: Number>(
    period: &SlowPeriod<F>,
    z: &ComplexMatrix<F>,
    b: &ComplexMatrix<F>,
) -> ComplexMatrix<F> {
    let (n, samples) = (period.order(), period.samples());
    let outputs = ComplexMatrix::real(period.outputs.clone());
    let phases: Vec<ComplexMatrix<F>> = period.delay_periods.iter().map(|&late| delay(z, late)).collect();
    // G* b: late samples weigh the input earlier.
    let late = b.each_row(|s, x| x.times(&phases[s].adjoint()));
    let state = resolved(&period.transition.transpose(), &z.adjoint(), &outputs.adjoint().product(&late));
    let input = ComplexMatrix::real(period.gram.clone()).product(&state.above(&late));
    let state = resolved(&period.transition, z, &input.rows(0, n));
    outputs.product(&state).plus(&input.rows(n, samples)).each_row(|s, x| x.times(&phases[s]))
}

/// F(z), M x N, of the bank's filters.
pub(super) fn filter_response<F: Number>(
    filters: &SynthesisFilters,
    ratio: usize,
    z: &ComplexMatrix<F>,
) -> ComplexMatrix<F> {
    match filters {
        SynthesisFilters::Fir(taps) => {
            let lags = taps[0].len().div_ceil(ratio);
            let tap = |p: usize, i: usize, lag: usize| taps[i].get(p + lag * ratio).copied().unwrap_or(0.0);
            let back = z.adjoint();
            // Horner's rule in z^-1.
            (0..lags).rev().fold(ComplexMatrix::zeros(ratio, taps.len()), |sum, lag| {
                sum.times(&back).plus(&ComplexMatrix::real(Matrix::from_fn(ratio, taps.len(), |p, i| {
                    Ball::from(tap(p, i, lag))
                })))
            })
        }
        SynthesisFilters::StateSpace(_) => {
            let BlockForm { a, b, c, d } = BlockForm::new(filters, ratio).balanced();
            let moving = ComplexMatrix::real(c).product(&resolved(&a, z, &ComplexMatrix::real(b)));
            ComplexMatrix::real(d).plus(&moving)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Float512;

    #[test]
    fn any_two_doubles_name_a_point_of_the_circle() {
        for half in [[1.0, 0.0], [0.0, 1.0], [0.8, -0.6], [1e-100, 3e-100], [0.1, 7.0]] {
            let z: ComplexMatrix = ComplexMatrix::unit(half);
            let angle = 2.0 * f64::atan2(half[1], half[0]);
            assert!((z.re[(0, 0)].nearest() - angle.cos()).abs() < 1e-15, "{half:?}");
            assert!((z.im[(0, 0)].nearest() - angle.sin()).abs() < 1e-15, "{half:?}");
            let square = z.square() - Ball::from(1.0);
            assert!(square.magnitude() < 1e-28, "{half:?} {square:?}");
        }
    }

    #[test]
    fn resolvents_invert() {
        let a = Matrix::from_fn(4, 4, |i, j| Ball::from(0.3 * ((3 * i + 5 * j) as f64).sin()));
        let z: ComplexMatrix = ComplexMatrix::unit([0.3, 0.9]);
        let r = resolved(&a, &z, &ComplexMatrix::real(ball::identity(4)));
        let shifted = ComplexMatrix::real(ball::identity(4)).times(&z).minus(&ComplexMatrix::real(a));
        let rest = shifted.product(&r).minus(&ComplexMatrix::real(ball::identity(4)));
        assert!(rest.square().magnitude().sqrt() < 1e-25);
        assert!(rest.re.iter().chain(&rest.im).all(|x| x.nearest().abs() <= x.radius()));
        // At a pole on the unit circle there is no response.
        let one: ComplexMatrix = ComplexMatrix::real(ball::identity(1));
        assert!(resolved(&ball::identity(1), &one, &one).re[(0, 0)].radius().is_nan());
    }

    #[test]
    fn residuals_of_512_bits_reach_their_precision() {
        let a = Matrix::<Float512>::from_fn(4, 4, |i, j| Ball::from(0.3 * ((3 * i + 5 * j) as f64).sin()));
        let z: ComplexMatrix<Float512> = ComplexMatrix::unit([0.3, 0.9]);
        let one = ComplexMatrix::real(ball::identity(4));
        let inverse = resolved(&a, &z, &one);
        let rest = one.times(&z).minus(&ComplexMatrix::real(a)).product(&inverse).minus(&one);
        assert!(rest.re.iter().chain(&rest.im).all(|x| x.magnitude() < 1e-140));
    }

    #[test]
    fn delays_are_powers() {
        let z: ComplexMatrix = ComplexMatrix::unit([0.7, 0.2]);
        let step = delay(&z, 1);
        let mut power = delay(&z, 0);
        for periods in 0..20 {
            assert!(power.minus(&delay(&z, periods)).square().nearest() < 1e-56, "{periods}");
            power = power.product(&step);
        }
    }
}
