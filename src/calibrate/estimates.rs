//! Fitted values and their covariance: what all three methods end with.

use super::model::Model;
use super::parameters::{Kind, Point};
use super::remark::Remark;
use super::result::ChannelEstimate;
use crate::linalg::{Mat, solve_positive};
use crate::sine_fit::Estimate;
use crate::units::FastPeriods;

/// Largest condition of an information matrix with unit diagonal. Beyond it two parameters have the same
/// effect to five digits, and the fit follows the noise.
const WORST_CONDITION: f64 = 1e10;
/// A misfit counts only if chance produces it once in a thousand runs.
const CHANCE: f64 = 3.09;

/// Values, covariance and remarks.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) point: Point,
    /// Of the parameters of `point`.
    pub(super) covariance: Mat,
    /// o_i and its standard deviation.
    pub(super) offsets: Option<Vec<(f64, f64)>>,
    /// Square root of chi squared per degree of freedom, if it could be judged.
    pub(super) misfit: Option<f64>,
    /// Frames that took part.
    pub(super) frames: usize,
    pub(super) remarks: Vec<Remark>,
}

impl Fitted {
    pub(super) fn new(point: Point, covariance: Mat) -> Self {
        Self { point, covariance, offsets: None, misfit: None, frames: 0, remarks: Vec::new() }
    }

    /// Notes the misfit, and widens the intervals by it if it is more than chance; returns it then.
    pub(super) fn widen(&mut self, squares: f64, freedom: usize) -> Option<f64> {
        if freedom == 0 {
            return None;
        }
        let misfit = (squares / freedom as f64).sqrt();
        self.misfit = Some(misfit);
        let is_clear = squares > chi_squared_quantile(freedom, CHANCE);
        if is_clear {
            self.covariance *= misfit * misfit;
        }
        is_clear.then_some(misfit)
    }

    /// The channels' values; nominal ones have no standard deviation.
    pub(super) fn channels(&self, model: &Model) -> Vec<ChannelEstimate> {
        let sigma = |i, kind| self.point.index(i, kind).map(|k| self.covariance[(k, k)].max(0.0).sqrt());
        let channel = |i| {
            let (gain, cutoff) = (self.point.gain(i, model), self.point.ln_cutoffs[i].exp());
            let delay =
                |sigma| Estimate { value: FastPeriods(self.point.delays[i]), sigma: FastPeriods(sigma) };
            ChannelEstimate {
                delay: sigma(i, Kind::Delay).map(delay),
                gain: sigma(i, Kind::Gain).map(|sigma| Estimate { value: gain, sigma: sigma * gain.abs() }),
                cutoff: sigma(i, Kind::Cutoff).map(|sigma| Estimate { value: cutoff, sigma: sigma * cutoff }),
                offset: self.offsets.as_ref().map(|all| Estimate { value: all[i].0, sigma: all[i].1 }),
            }
        };
        (0..model.channels()).map(channel).collect()
    }
}

/// The inverse of an information matrix; `None` if it is singular to [`WORST_CONDITION`].
pub(super) fn covariance(information: &Mat) -> Option<Mat> {
    let n = information.nrows();
    let scale: Vec<f64> = (0..n).map(|k| information[(k, k)].sqrt().recip()).collect();
    if n == 0 || !scale.iter().all(|x| x.is_finite()) {
        return None;
    }
    let correlation = Mat::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = solve_positive(&correlation, &Mat::identity(n, n)).ok()?;
    let worst = (0..n).map(|k| inverse[(k, k)]).fold(0.0, f64::max);
    (worst < WORST_CONDITION).then(|| Mat::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// The value that chi squared exceeds as rarely as a Gaussian exceeds `z` standard deviations (Wilson and
/// Hilferty, 1931).
fn chi_squared_quantile(freedom: usize, z: f64) -> f64 {
    let v = freedom as f64;
    let t = 2.0 / (9.0 * v);
    v * (1.0 - t + z * t.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // The 99.9 % points of 1, 10 and 100 degrees of freedom.
        for (freedom, table) in [(1, 10.828), (10, 29.588), (100, 149.449)] {
            let ours = chi_squared_quantile(freedom, CHANCE);
            assert!((ours / table - 1.0).abs() < 0.04, "{freedom}: {ours}");
        }
    }

    #[test]
    fn parameters_with_the_same_effect_have_no_covariance() {
        let same = Mat::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 1.0]);
        assert!(covariance(&same).is_none());
        let apart = covariance(&Mat::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 1e-12])).unwrap();
        assert_eq!((apart[(0, 0)], apart[(1, 1)]), (0.25, 1e12));
    }
}
