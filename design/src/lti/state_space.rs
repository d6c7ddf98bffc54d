//! A discrete-time linear system with checked shapes.

use hybank_linalg::{CMat, Complex, Mat};

/// x+ = a x + b u, y = c x + d u with n states, m inputs, p outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    pub(super) a: Mat,
    pub(super) b: Mat,
    pub(super) c: Mat,
    pub(super) d: Mat,
}

impl StateSpace {
    /// # Panics
    /// Unless a is n x n, b n x m, c p x n and d p x m.
    pub fn new(a: Mat, b: Mat, c: Mat, d: Mat) -> Self {
        let n = a.nrows();
        let fits = a.ncols() == n && b.nrows() == n && c.ncols() == n && d.shape() == (c.nrows(), b.ncols());
        let shapes = [a.shape(), b.shape(), c.shape(), d.shape()];
        assert!(fits, "matrices of the shapes {shapes:?} form no system");
        Self { a, b, c, d }
    }

    /// State matrix, n x n.
    pub fn a(&self) -> &Mat {
        &self.a
    }

    /// Input matrix, n x m.
    pub fn b(&self) -> &Mat {
        &self.b
    }

    /// Output matrix, p x n.
    pub fn c(&self) -> &Mat {
        &self.c
    }

    /// Feedthrough, p x m.
    pub fn d(&self) -> &Mat {
        &self.d
    }

    /// n.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// m.
    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }

    /// p.
    pub fn outputs(&self) -> usize {
        self.c.nrows()
    }

    /// `G G*` is unchanged when the inputs are rotated: compresses them to at most n + p.
    pub(crate) fn compress_inputs(&self) -> Self {
        let (n, p) = (self.order(), self.outputs());
        if self.inputs() <= n + p {
            return self.clone();
        }
        let l = hybank_linalg::lq_factor(&Mat::from_fn(p + n, self.inputs(), |i, j| {
            if i < p { self.d[(i, j)] } else { self.b[(i - p, j)] }
        }));
        Self {
            a: self.a.clone(),
            b: l.rows(p, n).into_owned(),
            c: self.c.clone(),
            d: l.rows(0, p).into_owned(),
        }
    }

    /// The same system with balanced states, divided by powers of two, which is exact. Orthogonal changes
    /// of coordinates mix all states, so without this the small states would be lost in the rounding errors
    /// of the large ones.
    pub(crate) fn rescaled(&self) -> Self {
        let scales = hybank_linalg::state_scales(&self.a, &self.b, &self.c);
        let scaled = Self {
            a: Mat::from_fn(self.order(), self.order(), |i, j| self.a[(i, j)] * (scales[j] / scales[i])),
            b: Mat::from_fn(self.order(), self.inputs(), |i, j| self.b[(i, j)] / scales[i]),
            c: Mat::from_fn(self.outputs(), self.order(), |i, j| self.c[(i, j)] * scales[j]),
            d: self.d.clone(),
        };
        // Entries near both limits of double precision may need scales beyond it.
        let finite = |m: &Mat| m.iter().all(|x| x.is_finite());
        if [&scaled.a, &scaled.b, &scaled.c].into_iter().all(finite) { scaled } else { self.clone() }
    }

    /// Largest modulus of the poles.
    pub(crate) fn spectral_radius(&self) -> Result<f64, hybank_linalg::LinalgError> {
        hybank_linalg::spectral_radius(&self.a)
    }

    /// c (zI - a)^-1 b + d by one LU factorisation: the slow and plain definition.
    pub fn response_at(&self, z: Complex<f64>) -> CMat {
        let n = self.order();
        let mut pencil = hybank_linalg::to_complex(&self.a) * Complex::new(-1.0, 0.0);
        for i in 0..n {
            pencil[(i, i)] += z;
        }
        let x = hybank_linalg::solve(&pencil, &hybank_linalg::to_complex(&self.b));
        hybank_linalg::to_complex(&self.c) * x + hybank_linalg::to_complex(&self.d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic = "(3, 1)"]
    fn wrong_shapes_are_named() {
        StateSpace::new(Mat::zeros(2, 2), Mat::zeros(3, 1), Mat::zeros(1, 2), Mat::zeros(1, 1));
    }

    #[test]
    fn compressing_inputs_keeps_the_spectrum() {
        let b = Mat::from_fn(2, 9, |i, j| ((i + 3 * j) as f64).sin());
        let d = Mat::from_fn(1, 9, |_, j| (j as f64).cos());
        let a = Mat::from_row_slice(2, 2, &[0.5, 0.2, -0.1, 0.3]);
        let full = StateSpace::new(a, b, Mat::from_row_slice(1, 2, &[1.0, -2.0]), d);
        let small = full.compress_inputs();
        assert_eq!(small.inputs(), 3);
        let z = Complex::from_polar(1.0, 0.7);
        let (g, s) = (full.response_at(z), small.response_at(z));
        let gap = (&g * g.adjoint() - &s * s.adjoint()).norm();
        assert!(gap < 1e-12 * g.norm_squared(), "{gap}");
    }
}
