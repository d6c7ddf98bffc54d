//! FIR filters with several inputs and outputs.

use super::StateSpace;
use hybank_linalg::{CMat, Complex, Mat};

/// `F(z) = sum_j z^-j F_j` with real lags F_0, F_1, .., at least one, all of one shape.
#[derive(Debug, Clone, PartialEq)]
pub struct FirMatrix {
    lags: Vec<Mat>,
}

impl FirMatrix {
    /// # Panics
    /// Unless there is a lag and all have its shape.
    pub fn new(lags: Vec<Mat>) -> Self {
        let fits = lags.first().is_some_and(|first| lags.iter().all(|lag| lag.shape() == first.shape()));
        assert!(fits, "the lags of FIR filters have one shape");
        Self { lags }
    }

    /// F_0, F_1, ..
    pub fn lags(&self) -> &[Mat] {
        &self.lags
    }

    /// Outputs and inputs.
    pub fn shape(&self) -> (usize, usize) {
        self.lags[0].shape()
    }

    /// F at e^{jw}, w in radians per lag.
    pub fn response(&self, w: f64) -> CMat {
        let (outputs, inputs) = self.shape();
        let mut f = CMat::zeros(outputs, inputs);
        for (j, lag) in self.lags.iter().enumerate() {
            let phase = Complex::from_polar(1.0, -w * j as f64);
            f.zip_apply(lag, |z, x| *z += phase * x);
        }
        f
    }

    /// With a shift register for each input: the states hold its last samples, newest first.
    pub fn state_space(&self) -> StateSpace {
        let ((outputs, inputs), stored) = (self.shape(), self.lags.len() - 1);
        let StateSpace { a, b, .. } = StateSpace::delays(&vec![stored; inputs]);
        let c = Mat::from_fn(outputs, inputs * stored, |p, state| {
            self.lags[state % stored + 1][(p, state / stored)]
        });
        StateSpace { a, b, c, d: self.lags[0].clone() }
    }
}

impl FromIterator<Mat> for FirMatrix {
    fn from_iter<I: IntoIterator<Item = Mat>>(lags: I) -> Self {
        Self::new(lags.into_iter().collect())
    }
}
