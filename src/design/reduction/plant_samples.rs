//! Output matrices of least gamma for given dynamics. The error W - F H is affine in them, so that they
//! solve a convex problem at sampled frequencies.

use super::dynamics::Dynamics;
use crate::design::DesignError;
use crate::design::error_grid::{AffineError, LocatedPeak, Location, Peaks};
use crate::design::exchange::Exchange;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::linalg::Complex;
use crate::lmi::sampled::{self, MeanSquareObjective, Point, Solution, Taps};
use crate::lti::peak::{Peak, peaks_above, resonances, stable_poles};
use crate::lti::{FirWithTail, FrequencyResponse};
use std::f64::consts::PI;

/// Intervals of the uniform frequencies.
const GRID: usize = 32;
/// Further frequencies, halving from pi/GRID towards 0, for slow analog filters.
const TOWARDS_ZERO: usize = 6;
/// See [`PlantSamples::coarse`].
const COARSE: usize = 4;
/// Frequencies closer than this are one, in radians.
const LEAST_DISTANCE: f64 = 1e-9;

/// The plant at the frequencies of the worst-case problem.
#[derive(Debug, Clone)]
pub(super) struct PlantSamples<'a> {
    pub(super) plant: &'a LiftedPlant,
    /// Ends each problem with the best outputs so far.
    stop: &'a Stop,
    /// The first GRID + 1 are uniform, unless the samples are coarse.
    pub(super) samples: Vec<Point>,
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

    /// One frequency in [`COARSE`], enough to rank candidates by their worst case.
    pub(super) fn coarse(&self) -> Self {
        Self { samples: self.samples.iter().step_by(COARSE).cloned().collect(), ..*self }
    }

    /// Adds a frequency, unless it is known.
    fn add(&mut self, omega: f64) {
        if self.samples.iter().all(|known| (known.omega - omega).abs() >= LEAST_DISTANCE) {
            self.samples.push(self.plant.at(omega));
        }
    }

    fn problem(&self, dynamics: &Dynamics) -> sampled::Problem {
        let regressors = FrequencyResponse::new(&dynamics.regressors());
        let points = self.samples.iter().map(|sample| driving(&regressors, sample.clone())).collect();
        sampled::Problem::new(points, vec![1; self.plant.ratio()])
    }

    /// The problem's solution at the sampled frequencies, to a relative accuracy. Its only tap holds the
    /// output matrices.
    pub(super) fn worst_case(&self, dynamics: &Dynamics, accuracy: f64) -> Result<Solution, DesignError> {
        Ok(sampled::minimise(&self.problem(dynamics), accuracy, &|| self.stop.is_due())?)
    }

    /// The bank of least gamma with these dynamics and, within `gamma_margin`, of least mean square. The
    /// frequencies that the exchange adds stay.
    pub(super) fn best_bank(
        &mut self,
        dynamics: &Dynamics,
        gamma_margin: f64,
    ) -> Result<FirWithTail, DesignError> {
        let problem = self.problem(dynamics);
        let objective = MeanSquareObjective::noiseless(self.weights(), problem.channels());
        let regressors = FrequencyResponse::new(&dynamics.regressors());
        let stop = self.stop.clone();
        let error = OutputError { samples: self, dynamics, regressors };
        let mut exchange = Exchange::new(error, problem, std::iter::repeat(()), objective, gamma_margin);
        exchange.stop = stop;
        let best = exchange.optimise()?;
        let frequencies: Vec<f64> = exchange.locations().iter().map(|location| location.frequency).collect();
        frequencies.into_iter().for_each(|omega| self.add(omega));
        Ok(dynamics.with_outputs(&best.taps[0]))
    }

    /// Trapezoidal weights of the uniform frequencies, zeros for the others.
    fn weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.samples.len()];
        weights[..=GRID].fill(1.0 / GRID as f64);
        (weights[0], weights[GRID]) = (0.5 / GRID as f64, 0.5 / GRID as f64);
        weights
    }
}

/// The error of given dynamics as a function of the output matrices.
struct OutputError<'a> {
    samples: &'a PlantSamples<'a>,
    dynamics: &'a Dynamics,
    regressors: FrequencyResponse,
}

impl AffineError for OutputError<'_> {
    type Scenario = ();

    fn at(&self, location: &Location<()>) -> Point {
        driving(&self.regressors, self.samples.plant.at(location.frequency))
    }

    fn peaks(&self, taps: &Taps, gamma: f64, level: f64) -> Result<Peaks<()>, DesignError> {
        let bank = self.dynamics.with_outputs(&taps[0]);
        let error = self.samples.plant.error_system(&bank.realise());
        let peaks = peaks_above(&error, level)?;
        let estimate = peaks.iter().map(|peak| peak.gain).fold(gamma, f64::max);
        let located = |peak: Peak| {
            let location = Location { frequency: peak.frequency, scenario: () };
            LocatedPeak { gain: peak.gain, location }
        };
        Ok(Peaks { estimate, peaks: peaks.into_iter().map(located).collect() })
    }
}

/// The point with the regressors as measurements.
fn driving(regressors: &FrequencyResponse, point: Point) -> Point {
    Point { h: regressors.at_frequency(point.omega) * point.h, ..point }
}

/// `e^{-i omega lags}`.
pub(super) fn delay(omega: f64, lags: usize) -> Complex<f64> {
    Complex::from_polar(1.0, -omega * lags as f64)
}
