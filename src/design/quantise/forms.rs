//! The mean-square error that a change of the taps adds, over weighted frequencies.
//!
//! A change Delta of the taps adds `Delta H` to the error. The mean square `sum_k w_k |Delta(w_k) H(w_k)|^2`
//! is a sum of one quadratic form per phase p, in the taps `f_i[p + j M]` of that phase:
//!
//! ```text
//! Q[(i, j), (i', j')] = sum_k w_k Re( e^{-i omega_k (j - j')} (H H*)[i, i'] )
//! ```

use crate::design::DesignError;
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lmi::sampled::Point;

/// Added to the diagonal, because the form is singular for equal channels. Relative to each entry, because
/// channels may differ by many decades.
const RIDGE: f64 = 1e-12;

/// A tap of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tap {
    pub(super) channel: usize,
    /// Delay in slow periods.
    pub(super) lag: usize,
}

/// `H H*` at the frequencies of a grid.
pub(super) struct Forms {
    omegas: Vec<f64>,
    grams: Vec<CMat>,
}

/// The form for all pairs of channels and all differences of lags, with given weights.
pub(super) struct Correlations {
    /// `sum_k w_k Re(e^{-i omega_k d} (H H*)[i, i'])` for d = 0, 1, ...
    by_lag: Vec<Mat>,
}

impl Forms {
    pub(super) fn new(points: &[Point]) -> Self {
        Self {
            omegas: points.iter().map(|point| point.omega).collect(),
            grams: points.iter().map(|point| &point.h * point.h.adjoint()).collect(),
        }
    }

    /// The correlations for `lags` lags, with one weight per frequency.
    pub(super) fn correlations(&self, weights: &[f64], lags: usize) -> Correlations {
        let channels = self.grams[0].nrows();
        let mut by_lag = vec![Mat::zeros(channels, channels); lags];
        for ((omega, gram), weight) in self.omegas.iter().zip(&self.grams).zip(weights) {
            for (d, sum) in by_lag.iter_mut().enumerate() {
                let phasor = Complex::from_polar(*weight, -omega * d as f64);
                sum.zip_apply(gram, |x, g| *x += phasor.re * g.re - phasor.im * g.im);
            }
        }
        Correlations { by_lag }
    }
}

impl Correlations {
    /// L with `L L' = Q` for the taps given.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if rounding errors make the form indefinite.
    pub(super) fn factor(&self, taps: &[Tap]) -> Result<Mat, DesignError> {
        let n = taps.len();
        let mut form = Mat::from_fn(n, n, |r, c| self.between(taps[r], taps[c]));
        (0..n).for_each(|i| form[(i, i)] += RIDGE * form[(i, i)] + f64::MIN_POSITIVE);
        Ok(linalg::cholesky(&form)?)
    }

    fn between(&self, a: Tap, b: Tap) -> f64 {
        // The sum for -d is the transposed one.
        if a.lag >= b.lag {
            self.by_lag[a.lag - b.lag][(a.channel, b.channel)]
        } else {
            self.by_lag[b.lag - a.lag][(b.channel, a.channel)]
        }
    }
}
