//! Output matrices of least gamma for given dynamics. The error W - F H is affine in them, so that they
//! solve a convex problem at sampled frequencies.

use super::dynamics::Dynamics;
use crate::design::DesignError;
use crate::design::exchange::{AffineError, Exchange, Peaks};
use crate::design::plant::LiftedPlant;
use crate::linalg::{CMat, Complex, Mat};
use crate::lmi::Settings;
use crate::lmi::sampled::{self, MeanSquareObjective, Point, Taps};
use crate::lti::peak::{peaks_above, resonances, stable_poles};
use crate::lti::{FirWithTail, FrequencyResponse};
use std::f64::consts::PI;

/// Intervals of the uniform frequencies.
const GRID: usize = 32;
/// Further frequencies, halving from pi/GRID towards 0, for slow analog filters.
const TOWARDS_ZERO: usize = 6;
/// Relative accuracy of a gamma that only ranks candidates.
const RANKING_ACCURACY: f64 = 1e-4;
/// See [`PlantSamples::coarse`].
const COARSE: usize = 4;
/// Frequencies closer than this are one, in radians.
const LEAST_DISTANCE: f64 = 1e-9;

/// The plant at the frequencies of the worst-case problem.
#[derive(Debug, Clone)]
pub(super) struct PlantSamples<'a> {
    pub(super) plant: &'a LiftedPlant,
    /// The first GRID + 1 are uniform, unless the samples are coarse.
    pub(super) samples: Vec<PlantSample>,
}

/// The plant at one frequency, with its inputs compressed by a unitary matrix.
#[derive(Debug, Clone)]
pub(super) struct PlantSample {
    /// Radians per slow period.
    pub(super) omega: f64,
    /// Measurements, N x q.
    pub(super) h: CMat,
    /// Reference, M x q.
    w: CMat,
}

/// Output matrices of least gamma at the sampled frequencies.
#[derive(Debug, Clone)]
pub(super) struct WorstCase {
    pub(super) outputs: Mat,
    pub(super) gamma: f64,
    /// M x q for each frequency.
    pub(super) dual: Vec<CMat>,
}

impl<'a> PlantSamples<'a> {
    /// Uniform frequencies, more of them near 0, and the resonances of the plant.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub(super) fn new(plant: &'a LiftedPlant) -> Result<Self, DesignError> {
        let mut samples = Self { plant, samples: Vec::new() };
        let uniform = (0..=GRID).map(|k| PI * k as f64 / GRID as f64);
        let near = (1..=TOWARDS_ZERO).map(|k| PI / GRID as f64 * 0.5_f64.powi(k as i32));
        for omega in uniform.chain(near).chain(resonances(&stable_poles(plant.system())?)) {
            samples.add(omega);
        }
        Ok(samples)
    }

    /// One frequency in [`COARSE`], enough to rank candidates by their worst case.
    pub(super) fn coarse(&self) -> Self {
        Self { plant: self.plant, samples: self.samples.iter().step_by(COARSE).cloned().collect() }
    }

    /// Adds a frequency, unless it is known.
    fn add(&mut self, omega: f64) {
        if self.samples.iter().all(|known| (known.omega - omega).abs() >= LEAST_DISTANCE) {
            self.samples.push(self.at(omega));
        }
    }

    fn at(&self, omega: f64) -> PlantSample {
        let (h, w) = self.plant.response(omega);
        PlantSample { omega, h, w }
    }

    fn problem(&self, dynamics: &Dynamics) -> Result<sampled::Problem, DesignError> {
        let regressors = FrequencyResponse::new(&dynamics.regressors()?);
        let points = self.samples.iter().map(|sample| point(sample.clone(), &regressors)).collect();
        Ok(sampled::Problem::new(points, vec![1; self.plant.ratio()])?)
    }

    /// The output matrices of least gamma at the sampled frequencies, to a relative accuracy.
    pub(super) fn worst_case(&self, dynamics: &Dynamics, accuracy: f64) -> Result<WorstCase, DesignError> {
        let settings = Settings { tol_gap_rel: accuracy, ..Settings::SAMPLED };
        let mut found = sampled::minimise(&self.problem(dynamics)?, &settings)?;
        Ok(WorstCase { outputs: found.taps.swap_remove(0), gamma: found.gamma, dual: found.dual })
    }

    /// The least gamma at the sampled frequencies, accurate enough to rank candidates.
    pub(super) fn rough_gamma(&self, dynamics: &Dynamics) -> Result<f64, DesignError> {
        self.worst_case(dynamics, RANKING_ACCURACY).map(|found| found.gamma)
    }

    /// The bank of least gamma with these dynamics and, within `gamma_margin`, of least mean square. The
    /// frequencies that the exchange adds stay.
    pub(super) fn best_bank(
        &mut self,
        dynamics: &Dynamics,
        gamma_margin: f64,
    ) -> Result<FirWithTail, DesignError> {
        let problem = self.problem(dynamics)?;
        let objective = MeanSquareObjective::noiseless(self.weights(), problem.channels());
        let error = OutputError::new(self, dynamics)?;
        let mut exchange = Exchange::new(error, problem, objective, gamma_margin)?;
        let best = exchange.optimise()?;
        let frequencies: Vec<f64> = exchange.frequencies().collect();
        frequencies.into_iter().for_each(|omega| self.add(omega));
        dynamics.with_outputs(&best.taps[0])
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

impl<'a> OutputError<'a> {
    fn new(samples: &'a PlantSamples<'a>, dynamics: &'a Dynamics) -> Result<Self, DesignError> {
        Ok(Self { samples, dynamics, regressors: FrequencyResponse::new(&dynamics.regressors()?) })
    }
}

impl AffineError for OutputError<'_> {
    fn at(&self, omega: f64) -> Point {
        point(self.samples.at(omega), &self.regressors)
    }

    fn peaks(&self, taps: &Taps, gamma: f64, level: f64) -> Result<Peaks, DesignError> {
        let bank = self.dynamics.with_outputs(&taps[0])?;
        let error = self.samples.plant.error_system(&bank.realise()?)?;
        let peaks = peaks_above(&error, level)?;
        let estimate = peaks.iter().map(|peak| peak.gain).fold(gamma, f64::max);
        Ok(Peaks { estimate, peaks })
    }
}

fn point(sample: PlantSample, regressors: &FrequencyResponse) -> Point {
    let PlantSample { omega, h, w } = sample;
    Point { omega, w, h: regressors.at_frequency(omega) * h }
}

/// `e^{-i omega lags}`.
pub(super) fn delay(omega: f64, lags: usize) -> Complex<f64> {
    Complex::from_polar(1.0, -omega * lags as f64)
}
