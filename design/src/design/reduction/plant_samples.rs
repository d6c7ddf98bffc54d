//! Output matrices of least gamma for a given recursion. The error W - F H is affine in them, so that they
//! solve a convex problem at sampled frequencies.

use super::settings::SETTINGS;
use super::truncation::ReducedRecursion;
use crate::design::DesignError;
use crate::design::error_grid::{AffineError, GridFrequency, LocatedPeak};
use crate::design::exchange::Exchange;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::lmi::sampled::{self, FrequencyPoint, MeanSquareObjective};
use crate::lti::peak::{local_peaks, resonances, stable_poles};
use crate::lti::{FirMatrix, FrequencyResponse, StateSpace};
use std::f64::consts::PI;

/// Intervals of the uniform frequencies.
const GRID: usize = 32;
/// Further frequencies, halving from pi/GRID towards 0, for slow analog filters.
const TOWARDS_ZERO: usize = 6;

/// The plant at the frequencies of the worst-case problem.
#[derive(Debug, Clone)]
pub(super) struct PlantSamples<'a> {
    plant: &'a LiftedPlant,
    /// Ends each problem with the best outputs so far.
    stop: &'a Stop,
    /// The first GRID + 1 are uniform.
    samples: Vec<FrequencyPoint>,
}

impl<'a> PlantSamples<'a> {
    /// Uniform frequencies, more of them near 0, and the resonances of the plant.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub(super) fn new(plant: &'a LiftedPlant, stop: &'a Stop) -> Result<Self, DesignError> {
        let mut samples = Self { plant, stop, samples: Vec::new() };
        let uniform = (0..=GRID).map(|k| PI * k as f64 / GRID as f64);
        let near = (1..=TOWARDS_ZERO).map(|k| PI / GRID as f64 * 0.5_f64.powi(k as i32));
        for omega in uniform.chain(near).chain(resonances(&stable_poles(plant.system())?)) {
            samples.add(omega);
        }
        Ok(samples)
    }

    /// Adds a frequency, unless it is known.
    fn add(&mut self, omega: f64) {
        if self.samples.iter().all(|known| (known.omega - omega).abs() >= SETTINGS.least_distance) {
            self.samples.push(self.plant.at(omega));
        }
    }

    /// The bank of least gamma with this recursion and, within `gamma_margin`, of least mean square.
    pub(super) fn best_bank(
        &self,
        recursion: &ReducedRecursion,
        gamma_margin: f64,
    ) -> Result<StateSpace, DesignError> {
        let regressors = FrequencyResponse::new(&recursion.regressors());
        let points = self.samples.iter().map(|sample| driving(&regressors, sample.clone())).collect();
        let problem = sampled::SampledProblem::new(points, vec![1; self.plant.ratio()]);
        let objective = MeanSquareObjective::noiseless(self.weights(), problem.channels());
        let error = OutputError { plant: self.plant, recursion, regressors };
        let mut exchange = Exchange::new(error, problem, std::iter::repeat(()), objective, gamma_margin);
        exchange.stop = self.stop.clone();
        Ok(recursion.with_outputs(&exchange.optimise()?.taps.lags()[0]))
    }

    /// Trapezoidal weights of the uniform frequencies, zeros for the others.
    fn weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.samples.len()];
        weights[..=GRID].fill(1.0 / GRID as f64);
        (weights[0], weights[GRID]) = (0.5 / GRID as f64, 0.5 / GRID as f64);
        weights
    }
}

/// The error of a given recursion as a function of the output matrices.
struct OutputError<'a> {
    plant: &'a LiftedPlant,
    recursion: &'a ReducedRecursion,
    regressors: FrequencyResponse,
}

impl AffineError for OutputError<'_> {
    type Scenario = ();

    fn at(&self, location: &GridFrequency<()>) -> FrequencyPoint {
        driving(&self.regressors, self.plant.at(location.frequency))
    }

    fn peaks(&self, taps: &FirMatrix, _level: f64) -> Result<Vec<LocatedPeak<()>>, DesignError> {
        let error = self.plant.error_system(&self.recursion.with_outputs(&taps.lags()[0]));
        Ok(local_peaks(&error)?.into_iter().map(LocatedPeak::from).collect())
    }
}

/// The point with the regressors as measurements.
fn driving(regressors: &FrequencyResponse, point: FrequencyPoint) -> FrequencyPoint {
    FrequencyPoint { h: regressors.at_frequency(point.omega) * point.h, ..point }
}
