//! Frequency responses, enclosed. Points of the unit circle are rational: e^{i w} =
//! (c + i s)^2 / (c^2 + s^2) for any two doubles c, s (about cos(w/2) and sin(w/2)), so that no
//! transcendental function is needed.

use super::ball::{self, Ball, Matrix};
use super::error_system::BlockForm;
use super::slow_period::SlowPeriod;
use crate::arithmetic::{ComplexBall, DoubleDouble, Float};
use hybank_core::bank::SynthesisFilters;
use hybank_linalg::Mat;
use nalgebra::DMatrix;

/// The point of the unit circle named by `half`.
pub(super) fn unit<F: Float>(half: [f64; 2]) -> ComplexBall<F> {
    let [c, s] = half.map(Ball::from);
    let (cc, ss, cs) = (c * c, s * s, c * s);
    ComplexBall::new((cc - ss) / (cc + ss), (cs + cs) / (cc + ss))
}

/// z^-k on the unit circle.
pub(super) fn delay<F: Float>(z: ComplexBall<F>, periods: usize) -> ComplexBall<F> {
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

/// The conjugate transpose.
pub(super) fn adjoint<F: Float>(m: &DMatrix<ComplexBall<F>>) -> DMatrix<ComplexBall<F>> {
    m.transpose().map(ComplexBall::conj)
}

fn complex<F: Float>(m: &Matrix<F>) -> DMatrix<ComplexBall<F>> {
    m.map(ComplexBall::from)
}

/// Row s times `factors[s]`.
fn with_rows_times<F: Float>(
    m: &DMatrix<ComplexBall<F>>,
    factors: &[ComplexBall<F>],
) -> DMatrix<ComplexBall<F>> {
    m.map_with_location(|s, _, x| x * factors[s])
}

/// Maximum number of refinement steps per 106 bits. The better the condition, the more digits each step
/// gains.
const REFINEMENTS: usize = 6;
/// They end where the residual falls by less than this.
const LEAST_GAIN: f64 = 0.1;

/// (z I - a)^-1 right, as a real system B x = r of twice the order.
///
/// Any approximate solution will do: it is wrong by at most ||B^-1|| times its residual, which is enclosed.
fn resolved<F: Float>(
    a: &Matrix<F>,
    z: ComplexBall<F>,
    right: &DMatrix<ComplexBall<F>>,
) -> DMatrix<ComplexBall<F>> {
    let n = a.nrows();
    if n == 0 {
        return right.clone();
    }
    // [Re, -Im; Im, Re] of z I - a, which acts on real over imaginary parts.
    let on_diagonal = |i: usize, j: usize, x: Ball<F>| if i == j { x } else { Ball::ZERO };
    let shifted = Matrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, true) => on_diagonal(i, j, z.re) - a[(i, j)],
        (false, false) => on_diagonal(i, j, z.re) - a[(i - n, j - n)],
        (false, true) => on_diagonal(i - n, j, z.im),
        (true, false) => on_diagonal(i, j - n, -z.im),
    });
    let right =
        Matrix::from_fn(
            2 * n,
            right.ncols(),
            |i, j| {
                if i < n { right[(i, j)].re } else { right[(i - n, j)].im }
            },
        );
    let inverse = hybank_linalg::inverse(&ball::nearest(&shifted));
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
    let part = |i: usize, j: usize| x[(i, j)].widened(error);
    DMatrix::from_fn(n, x.ncols(), |i, j| ComplexBall::new(part(i, j), part(i + n, j)))
}

fn refinements<F: Float>() -> usize {
    let digits = -F::ROUNDING.log10() / -DoubleDouble::ROUNDING.log10();
    (REFINEMENTS as f64 * digits).ceil() as usize
}

/// A bound on the row sums of B^-1 from an approximate inverse R: ||R|| / (1 - q) with
/// q = ||I - R B|| < 1/2, else NaN. The product R B is taken in double precision; its rounding is at most n
/// eps |R| |B|.
fn inverse_norm<F: Float>(matrix: &Matrix<F>, inverse: &Mat) -> f64 {
    let n = matrix.nrows();
    let near = ball::nearest(matrix);
    let sums = |m: &Mat| m.row_iter().map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, ball::nan_max);
    let rounding = (n + 8) as f64 * f64::EPSILON * sums(&(inverse.abs() * near.abs()));
    let q =
        sums(&(Mat::identity(n, n) - inverse * near)) + rounding + sums(inverse) * ball::radius_sum(matrix);
    if 1.01 * q < 0.5 { 1.01 * sums(inverse) / (1.0 - 1.01 * q) } else { f64::NAN }
}

/// For each sample z^-k, k the periods by which it is late.
fn phases<F: Float>(period: &SlowPeriod<F>, z: ComplexBall<F>) -> Vec<ComplexBall<F>> {
    period.delay_periods.iter().map(|&late| delay(z, late)).collect()
}

/// Gamma b with the Gram matrix Gamma of all samples of a slow period at the point z of the unit circle: G
/// G* of their responses G to the input.
pub(super) fn gram_times<F: Float>(
    period: &SlowPeriod<F>,
    z: ComplexBall<F>,
    b: &DMatrix<ComplexBall<F>>,
) -> DMatrix<ComplexBall<F>> {
    let (n, samples) = (period.order(), period.samples());
    let (outputs, phases) = (complex(&period.outputs), phases(period, z));
    // G* b: late samples weigh the input earlier.
    let earlier: Vec<ComplexBall<F>> = phases.iter().map(|phase| phase.conj()).collect();
    let late = with_rows_times(b, &earlier);
    let state = ball::product(&outputs.transpose(), &late);
    let state = resolved(&period.transition.transpose(), z.conj(), &state);
    let input = ball::product(&complex(&period.gram), &ball::above(&state, &late));
    let state = resolved(&period.transition, z, &input.rows(0, n).into_owned());
    with_rows_times(&(ball::product(&outputs, &state) + input.rows(n, samples)), &phases)
}

/// F(z), M x N, of the bank's filters.
pub(super) fn filter_response<F: Float>(
    filters: &SynthesisFilters,
    ratio: usize,
    z: ComplexBall<F>,
) -> DMatrix<ComplexBall<F>> {
    match filters {
        SynthesisFilters::Fir(taps) => {
            let lags = taps[0].len().div_ceil(ratio);
            let tap = |p: usize, i: usize, lag: usize| taps[i].get(p + lag * ratio).copied().unwrap_or(0.0);
            let back = z.conj();
            // Horner's rule in z^-1.
            DMatrix::from_fn(ratio, taps.len(), |p, i| {
                let add = |sum: ComplexBall<F>, lag: usize| sum * back + ComplexBall::from(tap(p, i, lag));
                (0..lags).rev().fold(ComplexBall::default(), add)
            })
        }
        SynthesisFilters::StateSpace(_) => {
            let BlockForm { a, b, c, d } = BlockForm::new(filters, ratio).balanced();
            complex(&d) + ball::product(&complex(&c), &resolved(&a, z, &complex(&b)))
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

    /// (z I - a) times the resolvent, less one.
    fn rest<F: Float>(a: &Matrix<F>, z: ComplexBall<F>) -> DMatrix<ComplexBall<F>> {
        let one: DMatrix<ComplexBall<F>> = ball::identity(a.nrows());
        let shifted = one.map(|x| x * z) - complex(a);
        ball::product(&shifted, &resolved(a, z, &one)) - one
    }

    #[test]
    fn resolvents_invert() {
        let a = Matrix::from_fn(4, 4, |i, j| Ball::from(0.3 * ((3 * i + 5 * j) as f64).sin()));
        let rest = rest::<DoubleDouble>(&a, unit([0.3, 0.9]));
        for x in rest.iter().flat_map(|x| [x.re, x.im]) {
            assert!(x.magnitude() < 1e-25 && x.nearest().abs() <= x.radius(), "{x:?}");
        }
        // At a pole on the unit circle there is no response.
        let pole: Matrix = ball::identity(1);
        let unbounded = resolved(&pole, ComplexBall::from(1.0), &complex(&pole));
        assert!(unbounded[(0, 0)].re.radius().is_nan());
    }

    #[test]
    fn residuals_of_512_bits_reach_their_precision() {
        let a = Matrix::<Float512>::from_fn(4, 4, |i, j| Ball::from(0.3 * ((3 * i + 5 * j) as f64).sin()));
        let rest = rest(&a, unit([0.3, 0.9]));
        assert!(rest.iter().all(|x| x.norm_sqr().magnitude() < 1e-280));
    }

    #[test]
    fn delays_are_powers() {
        let z: ComplexBall<DoubleDouble> = unit([0.7, 0.2]);
        let mut power = delay(z, 0);
        for periods in 0..20 {
            assert!((power - delay(z, periods)).norm_sqr().nearest() < 1e-56, "{periods}");
            power = power * delay(z, 1);
        }
    }
}
