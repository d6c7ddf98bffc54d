//! The taps to quantise and the error of integers in their place.

use super::forms::Forms;
use crate::bank::FixedPoint;
use crate::design::DesignError;
use crate::design::error_grid::ErrorGrid;
use crate::design::filters::polyphase;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::lmi::sampled::Point;

/// Taps to be replaced by integers times a power of two.
#[derive(Debug, Clone, Copy)]
pub struct QuantisationProblem<'a> {
    /// The plant whose error counts.
    pub plant: &'a LiftedPlant,
    /// One filter per channel, all of the same length.
    pub taps: &'a [Vec<f64>],
    /// Noise power of each channel.
    pub noise: &'a [f64],
    /// Relative excess of gamma granted to the mean square.
    pub gamma_margin: f64,
    /// Ends the search with the best integers so far.
    pub stop: &'a Stop,
}

/// Integer taps with their error.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// The integers with their scale.
    pub(super) fixed_point: FixedPoint,
    /// Estimate of gamma on the grid.
    pub(super) gamma: f64,
    /// Mean square of the error plus the converters' noise at the output, per slow period.
    pub(super) mean_square: f64,
}

/// Estimates of the error of integer taps, on a grid of frequencies.
pub(super) struct TapError<'a> {
    pub(super) problem: QuantisationProblem<'a>,
    pub(super) ratio: usize,
    pub(super) grid: ErrorGrid<'a>,
    /// The points of the grid.
    pub(super) points: Vec<Point>,
    pub(super) forms: Forms,
    /// Estimate of gamma of the real taps.
    pub(super) real_gamma: f64,
    /// Mean square of the real taps, as in [`Candidate`].
    pub(super) real_mean_square: f64,
}

impl<'a> TapError<'a> {
    /// Samples the plant and judges the real taps.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn new(problem: QuantisationProblem<'a>) -> Result<Self, DesignError> {
        let ratio = problem.plant.ratio();
        let lags = polyphase(problem.taps, ratio);
        let grid = ErrorGrid::new(problem.plant, lags.len())?;
        let points = grid.points();
        let forms = Forms::new(&points);
        let real_gamma = grid.peaks(&lags, 0.0)?.estimate;
        let real_mean_square = grid.mean_square(&lags) + output_noise(problem.noise, problem.taps);
        Ok(Self { problem, ratio, grid, points, forms, real_gamma, real_mean_square })
    }

    /// The error of integer taps.
    pub(super) fn candidate(&self, fixed_point: FixedPoint) -> Result<Candidate, DesignError> {
        let taps = fixed_point.taps();
        let lags = polyphase(&taps, self.ratio);
        let mean_square = self.grid.mean_square(&lags) + output_noise(self.problem.noise, &taps);
        Ok(Candidate { gamma: self.grid.peaks(&lags, 0.0)?.estimate, mean_square, fixed_point })
    }

    /// Estimate of gamma of integer taps.
    pub(super) fn gamma(&self, fixed_point: &FixedPoint) -> Result<f64, DesignError> {
        Ok(self.grid.peaks(&polyphase(&fixed_point.taps(), self.ratio), 0.0)?.estimate)
    }
}

/// `sum_i noise_i |f_i|^2`.
fn output_noise(noise: &[f64], taps: &[Vec<f64>]) -> f64 {
    noise
        .iter()
        .zip(taps)
        .map(|(power, filter)| power * filter.iter().map(|tap| tap * tap).sum::<f64>())
        .sum()
}
