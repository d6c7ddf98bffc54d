//! Frequency responses, enclosed. Points of the unit circle are rational: e^{i w} =
//! (c + i s)^2 / (c^2 + s^2) for any two doubles c, s (about cos(w/2) and sin(w/2)), so that no
//! transcendental function is needed.

use super::ball::{self, Ball, ComplexMatrix, Matrix, product};
use super::error_system::BlockForm;
use super::slow_period::SlowPeriod;
use crate::arithmetic::{ComplexBall, DoubleDouble, Number};
use crate::bank::SynthesisFilters;
use crate::linalg::{self, CMat, Complex, Mat};
use nalgebra::DMatrix;

/// The point of the unit circle named by `half`.
pub(super) fn unit<F: Number>(half: [f64; 2]) -> ComplexBall<F> {
    let [c, s] = half.map(Ball::from);
    let (cc, ss, cs) = (c * c, s * s, c * s);
    ComplexBall::new((cc - ss) / (cc + ss), (cs + cs) / (cc + ss))
}

/// A column of complex numbers.
pub(super) fn column<F: Number>(values: &[[f64; 2]]) -> ComplexMatrix<F> {
    let number = |[re, im]: [f64; 2]| ComplexBall::new(Ball::from(re), Ball::from(im));
    DMatrix::from_fn(values.len(), 1, |i, _| number(values[i]))
}

/// A matrix of real numbers.
pub(super) fn real<F: Number>(m: &Matrix<F>) -> ComplexMatrix<F> {
    m.map(ComplexBall::from)
}

pub(super) fn adjoint<F: Number>(m: &ComplexMatrix<F>) -> ComplexMatrix<F> {
    m.transpose().map(ComplexBall::conj)
}

/// Row i times `factors[i]`.
fn rows_times<F: Number>(m: &ComplexMatrix<F>, factors: &[ComplexBall<F>]) -> ComplexMatrix<F> {
    m.map_with_location(|i, _, x| x * factors[i])
}

/// A Hermitian matrix as the real symmetric one of twice the order that acts on (re, im).
pub(super) fn realified<F: Number>(m: &ComplexMatrix<F>) -> Matrix<F> {
    let n = m.nrows();
    Matrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, true) => m[(i, j)].re,
        (false, false) => m[(i - n, j - n)].re,
        (false, true) => m[(i - n, j)].im,
        (true, false) => -m[(i, j - n)].im,
    })
}

/// Real parts over imaginary parts.
pub(super) fn stacked<F: Number>(m: &ComplexMatrix<F>) -> Matrix<F> {
    ball::above(&m.map(|x| x.re), &m.map(|x| x.im))
}

/// A column of real parts over imaginary parts as a complex one.
pub(super) fn unstacked<F: Number>(m: &Matrix<F>) -> ComplexMatrix<F> {
    let n = m.nrows() / 2;
    DMatrix::from_fn(n, m.ncols(), |i, j| ComplexBall::new(m[(i, j)], m[(i + n, j)]))
}

/// sum |x|^2 over all entries.
pub(super) fn square<F: Number>(m: &ComplexMatrix<F>) -> Ball<F> {
    m.iter().fold(Ball::ZERO, |sum, x| sum + x.norm_sqr())
}

/// Re <a, b> = Re tr(a* b).
pub(super) fn inner<F: Number>(a: &ComplexMatrix<F>, b: &ComplexMatrix<F>) -> Ball<F> {
    a.iter().zip(b.iter()).fold(Ball::ZERO, |sum, (x, y)| sum + x.re * y.re + x.im * y.im)
}

/// Whether the radii stay below the share `most` of the largest entry.
pub(super) fn is_resolved<F: Number>(m: &ComplexMatrix<F>, most: f64) -> bool {
    let all = || m.iter().flat_map(|x| [x.re, x.im]);
    let largest = all().map(|x| x.nearest().abs()).fold(0.0, f64::max);
    all().all(|x| x.radius() <= most * largest)
}

/// The nearest doubles to the midpoints.
pub(super) fn nearest<F: Number>(m: &ComplexMatrix<F>) -> CMat {
    m.map(|x| Complex::new(x.re.nearest(), x.im.nearest()))
}

/// z^-k on the unit circle.
pub(super) fn delay<F: Number>(z: ComplexBall<F>, periods: usize) -> ComplexBall<F> {
    let (mut power, mut square) = (ComplexBall::from(1.0), z.conj());
    let mut rest = periods;
    while rest > 0 {
        if rest & 1 == 1 {
            power = power * square;
        }
        square = square * square;
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
fn resolved<F: Number>(a: &Matrix<F>, z: ComplexBall<F>, right: &ComplexMatrix<F>) -> ComplexMatrix<F> {
    let n = a.nrows();
    if n == 0 {
        return right.clone();
    }
    let on_diagonal = |i: usize, j: usize| if i == j { z } else { ComplexBall::default() };
    let shifted = DMatrix::from_fn(n, n, |i, j| on_diagonal(i, j) - ComplexBall::from(a[(i, j)]));
    let (shifted, right) = (realified(&shifted), stacked(right));
    let inverse = linalg::inverse(&ball::nearest(&shifted));
    let residual = |x: &Matrix<F>| &right - product(&shifted, x);
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
    unstacked(&x.map(|x| x.widened(error)))
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
pub(super) fn gram<F: Number>(period: &SlowPeriod<F>, z: ComplexBall<F>) -> ComplexMatrix<F> {
    let (n, samples) = (period.order(), period.samples());
    let from_input = resolved(&period.transition, z, &ball::identity(n));
    // G = [A D], A from the states and D = diag(d) of the inputs of this period.
    let d: Vec<ComplexBall<F>> = period.delay_periods.iter().map(|&late| delay(z, late)).collect();
    let a = rows_times(&product(&real(&period.outputs), &from_input), &d);
    let q = |i: usize, j: usize| period.gram[(i, j)];
    let mut gram = ball::zeros(samples, samples);
    for i in 0..samples {
        // Row i of [A D] times the Gram matrix of states and inputs.
        let sum = |column: usize| {
            let own = d[i].scaled(q(n + i, column));
            (0..n).fold(own, |sum, k| sum + a[(i, k)].scaled(q(k, column)))
        };
        let of_states: Vec<ComplexBall<F>> = (0..n).map(sum).collect();
        // The matrix is Hermitian.
        for j in 0..=i {
            let own = sum(n + j) * d[j].conj();
            let entry = (0..n).fold(own, |sum, k| sum + of_states[k] * a[(j, k)].conj());
            gram[(i, j)] = if i == j { entry.re.into() } else { entry };
            gram[(j, i)] = gram[(i, j)].conj();
        }
    }
    gram
}

/// Gamma b, without Gamma.
pub(super) fn gram_times<F: Number>(
    period: &SlowPeriod<F>,
    z: ComplexBall<F>,
    b: &ComplexMatrix<F>,
) -> ComplexMatrix<F> {
    let (n, samples) = (period.order(), period.samples());
    let outputs = real(&period.outputs);
    let phases: Vec<ComplexBall<F>> = period.delay_periods.iter().map(|&late| delay(z, late)).collect();
    // G* b: late samples weigh the input earlier.
    let late = b.map_with_location(|s, _, x| x * phases[s].conj());
    let state = resolved(&period.transition.transpose(), z.conj(), &product(&adjoint(&outputs), &late));
    let input = product(&real(&period.gram), &ball::above(&state, &late));
    let state = resolved(&period.transition, z, &input.rows(0, n).into_owned());
    rows_times(&(product(&outputs, &state) + input.rows(n, samples)), &phases)
}

/// F(z), M x N, of the bank's filters.
pub(super) fn filter_response<F: Number>(
    filters: &SynthesisFilters,
    ratio: usize,
    z: ComplexBall<F>,
) -> ComplexMatrix<F> {
    match filters {
        SynthesisFilters::Fir(taps) => {
            let lags = taps[0].len().div_ceil(ratio);
            let tap = |p: usize, i: usize, lag: usize| taps[i].get(p + lag * ratio).copied().unwrap_or(0.0);
            let back = z.conj();
            // Horner's rule in z^-1.
            (0..lags).rev().fold(ball::zeros(ratio, taps.len()), |sum: ComplexMatrix<F>, lag| {
                sum.map_with_location(|p, i, x| x * back + ComplexBall::from(tap(p, i, lag)))
            })
        }
        SynthesisFilters::StateSpace(_) => {
            let BlockForm { a, b, c, d } = BlockForm::new(filters, ratio).balanced();
            real(&d) + product(&real(&c), &resolved(&a, z, &real(&b)))
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
            let z: ComplexBall<DoubleDouble> = unit(half);
            let angle = 2.0 * f64::atan2(half[1], half[0]);
            assert!((z.re.nearest() - angle.cos()).abs() < 1e-15, "{half:?}");
            assert!((z.im.nearest() - angle.sin()).abs() < 1e-15, "{half:?}");
            let square = z.norm_sqr() - Ball::from(1.0);
            assert!(square.magnitude() < 1e-28, "{half:?} {square:?}");
        }
    }

    /// (z I - a) (z I - a)^-1 - I.
    fn rest<F: Number>(half: [f64; 2]) -> ComplexMatrix<F> {
        let a = Matrix::from_fn(4, 4, |i, j| Ball::from(0.3 * ((3 * i + 5 * j) as f64).sin()));
        let (z, one) = (unit(half), ball::identity(4));
        let shifted = one.map(|x: ComplexBall<F>| x * z) - real(&a);
        product(&shifted, &resolved(&a, z, &one)) - one
    }

    #[test]
    fn resolvents_invert() {
        let rest = rest::<DoubleDouble>([0.3, 0.9]);
        assert!(square(&rest).magnitude().sqrt() < 1e-25);
        assert!(stacked(&rest).iter().all(|x| x.nearest().abs() <= x.radius()));
        // At a pole on the unit circle there is no response.
        let one: ComplexMatrix = ball::identity(1);
        assert!(resolved(&ball::identity(1), unit([1.0, 0.0]), &one)[(0, 0)].re.radius().is_nan());
    }

    #[test]
    fn residuals_of_512_bits_reach_their_precision() {
        assert!(stacked(&rest::<Float512>([0.3, 0.9])).iter().all(|x| x.magnitude() < 1e-140));
    }

    #[test]
    fn delays_are_powers() {
        let z: ComplexBall<DoubleDouble> = unit([0.7, 0.2]);
        let (step, mut power) = (delay(z, 1), delay(z, 0));
        for periods in 0..20 {
            assert!((power - delay(z, periods)).norm_sqr().nearest() < 1e-56, "{periods}");
            power = power * step;
        }
    }
}
