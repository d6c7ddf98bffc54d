//! The data of a sampled problem.

use crate::lti::FirMatrix;
use hybank_linalg::{CMat, LinalgError, Mat};

/// A frequency with the responses of the reference and the measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyPoint {
    /// Frequency in radians per lag.
    pub omega: f64,
    /// Response of the reference, M x q.
    pub w: CMat,
    /// Responses of the measurements, N x q.
    pub h: CMat,
}

impl FrequencyPoint {
    /// K = W - F H for the filters' response F.
    pub(crate) fn error(&self, filters: &CMat) -> CMat {
        &self.w - filters * &self.h
    }
}

/// The secondary objective: the weighted mean square of the error, and the power of the noise that the
/// channels themselves add,
///
/// ```text
/// sum_l weights_l ||K_l||_F^2 + sum_i noise_i sum_j |F_j e_i|^2.
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MeanSquareObjective {
    /// One for each point; finite, not negative, not all zero.
    pub weights: Vec<f64>,
    /// Power of the white noise of each channel, N of them; finite, not negative.
    pub noise: Vec<f64>,
}

impl MeanSquareObjective {
    /// Noiseless channels.
    pub fn noiseless(weights: Vec<f64>, channels: usize) -> Self {
        Self { weights, noise: vec![0.0; channels] }
    }
}

/// A sampled worst-case norm problem with consistent sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledProblem {
    points: Vec<FrequencyPoint>,
    lags: Vec<usize>,
}

impl SampledProblem {
    /// `lags[p]` is the number of lags of row p, M of them; 0 fixes the row at zero.
    ///
    /// # Panics
    /// Unless there is a point, all points have the sizes of the first, and each row has its lags.
    pub fn new(points: Vec<FrequencyPoint>, lags: Vec<usize>) -> Self {
        let (w, h) = (points[0].w.shape(), points[0].h.shape());
        let fits = points.iter().all(|point| point.w.shape() == w && point.h.shape() == h);
        assert!(
            fits && h.1 == w.1 && lags.len() == w.0,
            "the points of a problem have one size: {w:?}, {h:?}"
        );
        Self { points, lags }
    }

    /// The points.
    pub(crate) fn points(&self) -> &[FrequencyPoint] {
        &self.points
    }

    /// Number of lags of each row.
    pub(crate) fn lags(&self) -> &[usize] {
        &self.lags
    }

    /// Largest number of lags of any row.
    pub(crate) fn max_lags(&self) -> usize {
        self.lags.iter().copied().max().unwrap_or(0)
    }

    /// M, the rows of `W_l` and of the taps.
    pub(crate) fn rows(&self) -> usize {
        self.points[0].w.nrows()
    }

    /// N, the rows of `H_l` and the columns of the taps.
    pub fn channels(&self) -> usize {
        self.points[0].h.nrows()
    }

    /// q, the columns of `W_l` and `H_l`.
    pub(crate) fn inputs(&self) -> usize {
        self.points[0].w.ncols()
    }

    /// Taps that are all zero.
    pub(crate) fn zero_taps(&self) -> FirMatrix {
        FirMatrix::new(vec![Mat::zeros(self.rows(), self.channels()); self.max_lags().max(1)])
    }

    /// The same problem with more points.
    pub(crate) fn with_points(&self, more: impl IntoIterator<Item = FrequencyPoint>) -> Self {
        Self::new(self.points.iter().cloned().chain(more).collect(), self.lags.clone())
    }

    /// `K_l = W_l - sum_j e^{-i omega_l j} F_j H_l`.
    pub(crate) fn error_at(&self, l: usize, taps: &FirMatrix) -> CMat {
        let point = &self.points[l];
        point.error(&taps.response(point.omega))
    }

    /// Largest `sigma_max(K_l)` over the points.
    pub(crate) fn worst(&self, taps: &FirMatrix) -> Result<f64, LinalgError> {
        let gain = |l: usize| hybank_linalg::largest_singular_value(&self.error_at(l, taps));
        (0..self.points.len()).map(gain).try_fold(0.0, |worst, gain| Ok(f64::max(worst, gain?)))
    }

    /// Value of the secondary objective: see [`MeanSquareObjective`].
    pub(crate) fn mean_square(&self, taps: &FirMatrix, square: &MeanSquareObjective) -> f64 {
        let error = |l: usize| self.error_at(l, taps).iter().map(|z| z.norm_sqr()).sum::<f64>();
        let errors: f64 = square.weights.iter().enumerate().map(|(l, w)| w * error(l)).sum();
        let noise =
            |f: &Mat| f.column_iter().zip(&square.noise).map(|(c, n)| n * c.norm_squared()).sum::<f64>();
        errors + taps.lags().iter().map(noise).sum::<f64>()
    }
}
