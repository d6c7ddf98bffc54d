//! The error system K = W - F H of a bank on a plant: what gamma is the norm of.

use super::DesignError;
use super::equivalence::BlockedPlant;
use crate::bank::{BlockFilter, SynthesisFilters};
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lti::peak::{Peak, hinf_norm, known_hinf_norm, resonances, stable_poles};
use crate::lti::{FrequencyResponse, StateSpace};
use std::f64::consts::PI;

/// Frequencies that are looked at first for each lag of FIR filters.
const LOOKS_PER_LAG: usize = 4;

/// The synthesis filters as one block system: N slow samples in, M fast samples out, a tick.
pub fn block_system(filters: &SynthesisFilters, ratio: usize) -> Result<StateSpace, DesignError> {
    match filters {
        SynthesisFilters::Fir(taps) => Ok(StateSpace::fir(&by_lag(taps, ratio))?),
        SynthesisFilters::StateSpace(block) => from_block(block, ratio),
    }
}

/// K = W - F H, both driven by the plant's input.
pub fn error_system(plant: &BlockedPlant, filters: &StateSpace) -> Result<StateSpace, DesignError> {
    let (n, m) = (plant.measured, plant.wanted);
    // [y; z; F y], of which z - F y is taken.
    let all = plant.system.cascade(0..n, filters)?;
    let unity = Mat::identity(m, m);
    Ok(all.map_outputs(&linalg::hstack(&[&Mat::zeros(m, n), &unity, &-&unity])?)?)
}

/// gamma = ||K|| with its peak frequency (radians a slow tick).
pub fn gamma(plant: &BlockedPlant, filters: &StateSpace) -> Result<Peak, DesignError> {
    Ok(hinf_norm(&error_system(plant, filters)?)?)
}

/// gamma of a bank's very coefficients.
pub fn bank_gamma(plant: &BlockedPlant, filters: &SynthesisFilters) -> Result<Peak, DesignError> {
    match filters {
        SynthesisFilters::Fir(taps) => FirError::new(plant)?.gamma(taps),
        SynthesisFilters::StateSpace(block) => gamma(plant, &from_block(block, plant.wanted)?),
    }
}

/// The error of FIR banks on one plant: the response of the plant is prepared once, that of the taps is a
/// polynomial.
#[derive(Debug, Clone)]
pub struct FirError<'a> {
    plant: &'a BlockedPlant,
    response: FrequencyResponse,
    resonances: Vec<f64>,
}

impl<'a> FirError<'a> {
    /// Prepares `plant`, whose poles are those of all its error systems, but for poles at zero.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub fn new(plant: &'a BlockedPlant) -> Result<Self, DesignError> {
        let poles = stable_poles(&plant.system)?;
        Ok(Self {
            plant,
            response: FrequencyResponse::new(&plant.system.compress_inputs()),
            resonances: resonances(&poles),
        })
    }

    /// The plant at w, its inputs compressed to at most N + M: (H, W), whose products with their adjoints are those of
    /// the whole.
    pub fn plant_at(&self, w: f64) -> (CMat, CMat) {
        let g = linalg::lq_factor_c(&self.response.at_frequency(w));
        let (n, m) = (self.plant.measured, self.plant.wanted);
        (g.rows(0, n).into_owned(), g.rows(n, m).into_owned())
    }

    /// gamma = ||W - F H|| of the filters `taps[i]`, with its peak frequency.
    pub fn gamma(&self, taps: &[Vec<f64>]) -> Result<Peak, DesignError> {
        let lags = by_lag(taps, self.plant.wanted);
        let system = error_system(self.plant, &StateSpace::fir(&lags)?)?;
        let response = |w: f64| {
            let g = self.response.at_frequency(w);
            let (n, m) = (self.plant.measured, self.plant.wanted);
            g.rows(n, m) - filter_response(&lags, w) * g.rows(0, n)
        };
        // A polynomial in e^{-jw} has at most a peak for each of its lags between 0 and pi.
        let grid = LOOKS_PER_LAG * lags.len();
        let mut hints = self.resonances.clone();
        hints.extend((1..grid).map(|k| PI * k as f64 / grid as f64));
        Ok(known_hinf_norm(&system, &response, hints)?)
    }
}

/// F(w) = sum_j e^{-jw} F_j.
pub fn filter_response(lags: &[Mat], w: f64) -> CMat {
    let (rows, cols) = lags.first().map_or((0, 0), Mat::shape);
    let mut filter = CMat::zeros(rows, cols);
    for (j, lag) in lags.iter().enumerate() {
        let rotation = Complex::from_polar(1.0, -w * j as f64);
        filter.zip_apply(lag, |sum, tap| *sum += rotation * tap);
    }
    filter
}

/// `F_j[p, i] = f_i[p + j M]`, at least one lag.
pub fn by_lag(taps: &[Vec<f64>], ratio: usize) -> Vec<Mat> {
    let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
    let tap = |i: usize, n: usize| taps[i].get(n).copied().unwrap_or(0.0);
    (0..lags).map(|j| Mat::from_fn(ratio, taps.len(), |p, i| tap(i, p + j * ratio))).collect()
}

fn from_block(block: &BlockFilter, ratio: usize) -> Result<StateSpace, DesignError> {
    let (n, channels) = (block.a.len(), block.d.first().map_or(0, Vec::len));
    let matrix = |rows: &[Vec<f64>], r: usize, c: usize| -> Result<Mat, DesignError> {
        if rows.len() != r || rows.iter().any(|row| row.len() != c) {
            return Err(DesignError::RaggedStateSpace { rows: r, cols: c });
        }
        Ok(Mat::from_fn(r, c, |i, j| rows[i][j]))
    };
    Ok(StateSpace::new(
        matrix(&block.a, n, n)?,
        matrix(&block.b, n, channels)?,
        matrix(&block.c, ratio, n)?,
        matrix(&block.d, ratio, channels)?,
    )?)
}

/// A block system as the lists of rows of a bank file.
pub fn to_block(system: &StateSpace) -> BlockFilter {
    let rows = |m: &Mat| m.row_iter().map(|row| row.iter().copied().collect()).collect();
    BlockFilter { a: rows(system.a()), b: rows(system.b()), c: rows(system.c()), d: rows(system.d()) }
}
