//! Frequency responses at many points: one Hessenberg reduction, then O(n^2) operations per point.

use super::StateSpace;
use hybank_linalg::{CMat, Complex, Mat};
use nalgebra::linalg::Hessenberg;

/// Evaluates G(z) = c (zI - a)^-1 b + d at many points z of the unit circle.
///
/// With a' = Q H Q' the transposed problem (zI - H) X = Q' c' has as many right-hand sides as the system
/// has outputs, which here are few. Then G = X' Q' b + d.
///
/// ```
/// use hybank_linalg::Mat;
/// use hybank_design::lti::{FrequencyResponse, StateSpace};
/// // y[k] = u[k] + y[k - 1] / 2.
/// let one = |x| Mat::from_element(1, 1, x);
/// let response = FrequencyResponse::new(&StateSpace::new(one(0.5), one(1.0), one(0.5), one(1.0)));
/// let gain = |w| response.at_frequency(w)[(0, 0)].norm();
/// assert!((gain(0.0) - 2.0).abs() < 1e-15 && (gain(std::f64::consts::PI) - 2.0 / 3.0).abs() < 1e-15);
/// ```
#[derive(Debug, Clone)]
pub struct FrequencyResponse {
    hessenberg: Mat,
    /// Q' c', n x p.
    outputs: Mat,
    /// Q' b, n x m.
    inputs: Mat,
    feedthrough: CMat,
}

impl FrequencyResponse {
    /// Prepares the evaluation of `system`.
    pub fn new(system: &StateSpace) -> Self {
        let system = system.rescaled();
        let (q, hessenberg) = reduce(&system.a().transpose());
        Self {
            hessenberg,
            outputs: q.transpose() * system.c().transpose(),
            inputs: q.transpose() * system.b(),
            feedthrough: hybank_linalg::to_complex(system.d()),
        }
    }

    /// G(e^{jw}), p x m.
    pub fn at_frequency(&self, w: f64) -> CMat {
        let mut x = hybank_linalg::to_complex(&self.outputs);
        self.solve_shifted(Complex::from_polar(1.0, w), &mut x);
        self.through_inputs(&x) + &self.feedthrough
    }

    /// X' Q' b. The inputs are real: one product for the real and imaginary parts together.
    fn through_inputs(&self, x: &CMat) -> CMat {
        let (n, p) = x.shape();
        let part = |i: usize, k: usize| if i < p { x[(k, i)].re } else { x[(k, i - p)].im };
        let parts = Mat::from_fn(2 * p, n, part) * &self.inputs;
        CMat::from_fn(p, self.inputs.ncols(), |i, j| Complex::new(parts[(i, j)], parts[(p + i, j)]))
    }

    /// x <- (zI - H)^-1 x by Gaussian elimination with exchange of neighbouring rows.
    fn solve_shifted(&self, z: Complex<f64>, x: &mut CMat) {
        let n = self.hessenberg.nrows();
        let mut t = self.hessenberg.map(|h| Complex::new(-h, 0.0));
        for i in 0..n {
            t[(i, i)] += z;
        }
        for k in 0..n.saturating_sub(1) {
            eliminate_subdiagonal(&mut t, x, k);
        }
        back_substitute(&t, x);
    }
}

/// (Q, H) with m = Q H Q'. nalgebra's reduction is not iterative, so the convergence failure of its QR
/// iteration with delay lines does not occur. It refuses sizes below two.
fn reduce(m: &Mat) -> (Mat, Mat) {
    if m.nrows() < 2 {
        (Mat::identity(m.nrows(), m.nrows()), m.clone())
    } else {
        Hessenberg::new(m.clone()).unpack()
    }
}

fn eliminate_subdiagonal(t: &mut CMat, x: &mut CMat, k: usize) {
    if t[(k + 1, k)].norm_sqr() > t[(k, k)].norm_sqr() {
        t.swap_rows(k, k + 1);
        x.swap_rows(k, k + 1);
    }
    if t[(k + 1, k)] == Complex::ZERO {
        return;
    }
    let factor = t[(k + 1, k)] / t[(k, k)];
    for j in k..t.ncols() {
        let above = t[(k, j)];
        t[(k + 1, j)] -= factor * above;
    }
    for j in 0..x.ncols() {
        let above = x[(k, j)];
        x[(k + 1, j)] -= factor * above;
    }
}

fn back_substitute(t: &CMat, x: &mut CMat) {
    let n = t.nrows();
    for mut column in x.column_iter_mut() {
        for k in (0..n).rev() {
            let value = column[k] / t[(k, k)];
            column[k] = value;
            for i in 0..k {
                column[i] -= t[(i, k)] * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(system: &StateSpace) {
        let response = FrequencyResponse::new(system);
        for w in [0.0, 0.3, 1.1, 2.7, std::f64::consts::PI] {
            let (fast, slow) = (response.at_frequency(w), system.response_at(Complex::from_polar(1.0, w)));
            assert!((&fast - &slow).norm() <= 1e-12 * slow.norm().max(1.0), "w = {w}: {fast} {slow}");
        }
    }

    #[test]
    fn agrees_with_the_plain_definition() {
        for n in [0_usize, 1, 2, 5, 12] {
            let a = Mat::from_fn(n, n, |i, j| 0.9 * ((i * 5 + j * 3 + 1) as f64).sin() / (n as f64));
            let b = Mat::from_fn(n, 3, |i, j| ((i + j) as f64).cos());
            let c = Mat::from_fn(2, n, |i, j| ((i * 2 + j) as f64).sin());
            check(&StateSpace::new(a, b, c, Mat::from_element(2, 3, 0.5)));
        }
    }

    #[test]
    fn agrees_on_delay_lines() {
        for n in 2..12 {
            let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
            let mut b = Mat::zeros(n, 1);
            b[0] = 1.0;
            let mut c = Mat::zeros(1, n);
            c[n - 1] = 1.0;
            check(&StateSpace::new(a, b, c, Mat::zeros(1, 1)));
        }
    }

    /// Gains of states on one another that differ by 20 decades, as where a filter is written in units of
    /// its own: orthogonal changes of coordinates keep errors small beside the largest of them only.
    #[test]
    fn units_of_the_states_do_not_move_the_response() {
        for n in [2_usize, 5, 12] {
            let a = Mat::from_fn(n, n, |i, j| 0.9 * ((i * 5 + j * 3 + 1) as f64).sin() / (n as f64));
            let b = Mat::from_fn(n, 3, |i, j| ((i + j) as f64).cos());
            let c = Mat::from_fn(2, n, |i, j| ((i * 2 + j) as f64).sin());
            let unit = |i: usize| ((i * 29 % 61) as f64 - 30.0).exp2();
            let scaled = StateSpace::new(
                Mat::from_fn(n, n, |i, j| a[(i, j)] * unit(i) / unit(j)),
                Mat::from_fn(n, 3, |i, j| b[(i, j)] * unit(i)),
                Mat::from_fn(2, n, |i, j| c[(i, j)] / unit(j)),
                Mat::zeros(2, 3),
            );
            let plain = StateSpace::new(a, b, c, Mat::zeros(2, 3));
            let response = FrequencyResponse::new(&scaled);
            for w in [0.0, 0.3, 1.1, 2.7] {
                let (got, want) = (response.at_frequency(w), plain.response_at(Complex::from_polar(1.0, w)));
                assert!((&got - &want).norm() <= 1e-13 * want.norm(), "n = {n}, w = {w}: {got} {want}");
            }
        }
    }
}
