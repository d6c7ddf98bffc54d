//! The best that can be read from given states: for fixed dynamics the error W - F H is affine in what is read, so that the
//! least mean square is one projection and the least gamma one convex problem.

use super::dynamics::Dynamics;
use crate::design::equivalence::BlockedPlant;
use crate::design::{DesignError, error_system};
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lmi::sampled::{self, MeanSquareObjective, Point, Settings};
use crate::lti::gramian::controllability_root;
use crate::lti::peak::{Peak, peaks_above, resonances, stable_poles};
use crate::lti::{FrequencyResponse, StateSpace, TappedRecursion};
use std::f64::consts::PI;

/// Directions of the regressors below this share of the strongest are rounding.
const RANK: f64 = 1e-12;
/// Uniform frequencies at which the worst case is looked at first.
const GRID: usize = 32;
/// Frequencies that halve from pi/GRID on towards 0, where slow front ends have all that happens.
const TOWARDS_ZERO: usize = 6;
/// Relative accuracy of a gamma to choose by.
const ROUGH: f64 = 1e-4;
/// Rounds of exchange of frequencies.
const ROUND_LIMIT: usize = 12;
/// Times that the mean square may break the cap between the frequencies.
const KINDER_LIMIT: usize = 4;
/// Relative accuracy at which the exchange ends.
const GAMMA_ACCURACY: f64 = 5e-7;
/// This much of gamma (relative) always goes into the mean square, which decides among the many readouts of least gamma.
const LEAST_MARGIN: f64 = 4e-7;

/// Square root of the covariance of the states of `bank` when it is driven through the front ends.
pub(super) fn reach(plant: &BlockedPlant, bank: &StateSpace) -> Result<Mat, DesignError> {
    let error = error_system::error_system(plant, bank)?;
    let root = controllability_root(error.a(), error.b())?;
    Ok(root.rows(plant.system.order(), bank.order()).into_owned())
}

/// The same dynamics with states of unit mean square, and the root mean squares of the channels.
pub(super) fn normalised(
    plant: &BlockedPlant,
    dynamics: &Dynamics,
) -> Result<(Dynamics, Vec<f64>), DesignError> {
    let (x, _) = covariance_roots(plant, dynamics)?;
    let size = |i: usize| Some(x.row(i).norm()).filter(|size| size.is_normal()).unwrap_or(1.0);
    let states: Vec<f64> = (0..dynamics.tail()).map(size).collect();
    let channels = (x.nrows() - dynamics.channels()..x.nrows()).map(size).collect();
    Ok((dynamics.scaled(&states), channels))
}

/// The readout of least mean square with the H2 norm of its error.
pub(super) fn mean_square(plant: &BlockedPlant, dynamics: &Dynamics) -> Result<(Mat, f64), DesignError> {
    let (x, z) = covariance_roots(plant, dynamics)?;
    let readout = projection(&x, &z)?;
    let error = (z - &readout * x).norm();
    Ok((readout, error))
}

/// Rows X and Z with the covariance [X; Z] [X; Z]' of the regressors and of the wanted samples.
fn covariance_roots(plant: &BlockedPlant, dynamics: &Dynamics) -> Result<(Mat, Mat), DesignError> {
    let driven = driven(plant, &dynamics.regressors()?)?;
    let root = controllability_root(driven.a(), driven.b())?;
    let (outputs, inputs) = (driven.outputs(), driven.inputs());
    let mut t = Mat::zeros(outputs, root.ncols() + inputs);
    t.columns_mut(0, root.ncols()).copy_from(&(driven.c() * &root));
    t.columns_mut(root.ncols(), inputs).copy_from(driven.d());
    let known = outputs - plant.wanted;
    Ok((t.rows(0, known).into_owned(), t.rows(known, plant.wanted).into_owned()))
}

/// F of least ||z - F x||, and of these the least in units of the rows of x.
fn projection(x: &Mat, z: &Mat) -> Result<Mat, DesignError> {
    let scale: Vec<f64> =
        x.row_iter().map(|row| row.norm()).map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }).collect();
    let mut unit = x.clone();
    unit.row_iter_mut().zip(&scale).for_each(|(mut row, s)| row *= *s);
    let svd = linalg::svd(&unit)?;
    let floor = RANK * svd.s.first().copied().unwrap_or(0.0);
    let mut part = z * &svd.v;
    part.column_iter_mut()
        .zip(&svd.s)
        .for_each(|(mut column, &s)| column *= if s > floor { 1.0 / s } else { 0.0 });
    let mut readout = part * svd.u.transpose();
    readout.column_iter_mut().zip(&scale).for_each(|(mut column, s)| column *= *s);
    Ok(readout)
}

/// The regressors and the wanted samples as outputs of one system, driven by the plant's input.
fn driven(plant: &BlockedPlant, regressors: &StateSpace) -> Result<StateSpace, DesignError> {
    let (n, m, x) = (plant.measured, plant.wanted, regressors.outputs());
    let all = plant.system.cascade(0..n, regressors)?;
    Ok(all.select_outputs((n + m..n + m + x).chain(n..n + m))?)
}

/// The plant at the frequencies of the worst-case problem.
#[derive(Debug, Clone)]
pub(super) struct Samples<'a> {
    pub(super) plant: &'a BlockedPlant,
    response: FrequencyResponse,
    /// Frequency, H, W; the first GRID + 1 uniform.
    pub(super) points: Vec<(f64, CMat, CMat)>,
}

/// A readout of least gamma at the frequencies sampled.
#[derive(Debug, Clone)]
pub(super) struct WorstCase {
    pub(super) readout: Mat,
    pub(super) gamma: f64,
    /// For each frequency the M x q weight of the dual.
    pub(super) dual: Vec<CMat>,
}

impl<'a> Samples<'a> {
    pub(super) fn new(plant: &'a BlockedPlant) -> Result<Self, DesignError> {
        let response = FrequencyResponse::new(&plant.system.compress_inputs());
        let mut samples = Self { plant, response, points: Vec::new() };
        let uniform = (0..=GRID).map(|k| PI * k as f64 / GRID as f64);
        let near = (1..=TOWARDS_ZERO).map(|k| PI / GRID as f64 * 0.5_f64.powi(k as i32));
        for w in uniform.chain(near).chain(resonances(&stable_poles(&plant.system)?)) {
            samples.add(w);
        }
        Ok(samples)
    }

    /// Adds a frequency unless it is there; whether it was not.
    fn add(&mut self, w: f64) -> bool {
        if self.points.iter().any(|(known, ..)| (known - w).abs() < 1e-9) {
            return false;
        }
        let g = linalg::lq_factor_c(&self.response.at_frequency(w));
        let (n, m) = (self.plant.measured, self.plant.wanted);
        self.points.push((w, g.rows(0, n).into_owned(), g.rows(n, m).into_owned()));
        true
    }

    fn problem(&self, dynamics: &Dynamics) -> Result<sampled::Problem, DesignError> {
        let response = FrequencyResponse::new(&dynamics.regressors()?);
        let point = |(w, h, wanted): &(f64, CMat, CMat)| Point {
            omega: *w,
            w: wanted.clone(),
            h: response.at_frequency(*w) * h,
        };
        let points = self.points.iter().map(point).collect();
        Ok(sampled::Problem::new(points, vec![1; self.plant.wanted])?)
    }

    /// The least gamma at the frequencies sampled.
    pub(super) fn worst_case(&self, dynamics: &Dynamics, accuracy: f64) -> Result<WorstCase, DesignError> {
        let settings = Settings { tol_gap_rel: accuracy, ..Settings::default() };
        let mut found = sampled::minimise(&self.problem(dynamics)?, &settings)?;
        Ok(WorstCase { readout: found.taps.swap_remove(0), gamma: found.gamma, dual: found.dual })
    }

    /// The least gamma at the frequencies sampled, good enough to choose by.
    pub(super) fn rough_gamma(&self, dynamics: &Dynamics) -> Result<f64, DesignError> {
        self.worst_case(dynamics, ROUGH).map(|found| found.gamma)
    }

    /// The bank of least gamma with these dynamics and, within `gamma_margin`, of least mean square. Frequencies at which its error
    /// rises between those sampled join them.
    pub(super) fn best_bank(
        &mut self,
        dynamics: &Dynamics,
        gamma_margin: f64,
    ) -> Result<TappedRecursion, DesignError> {
        let (mut least, mut cap) = self.exchanged(dynamics)?;
        cap *= 1.0 + gamma_margin.max(LEAST_MARGIN);
        // Aim a little below, so that what rises between the frequencies fits under the cap as well.
        let aim = cap * (1.0 - 0.25 * gamma_margin.max(LEAST_MARGIN));
        for _ in 0..KINDER_LIMIT {
            let Some(readout) = self.kinder(dynamics, &least, aim)? else { break };
            let (bank, peaks) = self.judged(dynamics, &readout, cap)?;
            if peaks.is_empty() {
                return Ok(bank);
            }
            if !self.add_all(&peaks) {
                break;
            }
            least = self.worst_case(dynamics, 0.1 * GAMMA_ACCURACY)?;
        }
        dynamics.read_by(&least.readout)
    }

    /// The least gamma of any frequency, and the exact norm there.
    fn exchanged(&mut self, dynamics: &Dynamics) -> Result<(WorstCase, f64), DesignError> {
        let mut best: Option<(WorstCase, f64)> = None;
        for _ in 0..ROUND_LIMIT {
            let found = self.worst_case(dynamics, 0.1 * GAMMA_ACCURACY)?;
            let level = found.gamma * (1.0 + GAMMA_ACCURACY);
            let (_, peaks) = self.judged(dynamics, &found.readout, level)?;
            let norm = peaks.iter().map(|peak| peak.gain).fold(found.gamma, f64::max);
            if best.as_ref().is_none_or(|(_, least)| norm < *least) {
                best = Some((found, norm));
            }
            if !self.add_all(&peaks) {
                break;
            }
        }
        best.ok_or(DesignError::NoTaps)
    }

    /// The bank, and where its error rises above `level`.
    fn judged(
        &self,
        dynamics: &Dynamics,
        readout: &Mat,
        level: f64,
    ) -> Result<(TappedRecursion, Vec<Peak>), DesignError> {
        let bank = dynamics.read_by(readout)?;
        let error = error_system::error_system(self.plant, &bank.realise()?)?;
        let peaks = peaks_above(&error, level)?;
        Ok((bank, peaks))
    }

    /// Adds the frequencies of `peaks`; whether one was not there.
    fn add_all(&mut self, peaks: &[Peak]) -> bool {
        peaks.iter().filter(|peak| self.add(peak.frequency)).count() > 0
    }

    /// The readout of least mean square with gamma at most `cap` at the frequencies sampled.
    fn kinder(&self, dynamics: &Dynamics, start: &WorstCase, cap: f64) -> Result<Option<Mat>, DesignError> {
        let mut weights = vec![0.0; self.points.len()];
        weights[..=GRID].fill(1.0 / GRID as f64);
        (weights[0], weights[GRID]) = (0.5 / GRID as f64, 0.5 / GRID as f64);
        let problem = self.problem(dynamics)?;
        let square = MeanSquareObjective::noiseless(weights, problem.channels());
        let start = vec![start.readout.clone()];
        let found = sampled::mean_square_under_cap(&problem, &square, cap, &start, &Settings::default());
        // An optimum of zero or a stalled iteration leaves nothing to win.
        Ok(found.ok().map(|mut found| found.taps.swap_remove(0)))
    }
}

/// e^{-j w ticks}.
pub(super) fn delay(w: f64, ticks: usize) -> Complex<f64> {
    Complex::from_polar(1.0, -w * ticks as f64)
}
