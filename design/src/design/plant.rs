//! The lifted plant: the discrete-time model of front ends, delays and rates on which the design methods
//! work.

use super::DesignError;
use super::filters;
use super::lifting::{Lifted, lift};
use super::merging::Repeats;
use super::problem::Problem;
use crate::lmi::sampled::FrequencyPoint;
use crate::lti::gramian::h2_norm;
use crate::lti::peak::{
    Peak, hinf_norm, hinf_norm_with_response, resonances, stable_poles, unexplained_peak,
};
use crate::lti::{FirMatrix, FrequencyResponse, StateSpace};
use hybank_core::bank::{Gamma, SynthesisFilters};
use hybank_linalg::{CMat, Complex, Mat};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::OnceLock;

/// Number of initial frequencies in the search for a norm, per lag of FIR filters.
const FREQUENCIES_PER_LAG: usize = 4;
/// Norms below this share of ||W|| are small differences: with the norm of the error, its digits in double
/// precision go.
const FAINT_NORM: f64 = 1e-9;
/// Relative error of a norm that is such a difference. The largest one observed is 7 %.
const FAINT_NORM_ACCURACY: f64 = 0.1;

/// The hybrid error system of the thesis as a discrete-time plant, one step per slow period (Props. 5.1 to
/// 5.3 and Theorem 5.1):
///
/// ```text
///                 +-----------------------+
///                 |                       |   z   reference: the M fast samples y_0[kM], .., y_0[kM+M-1]
///          +----->|  W(z)        M x n_w  |---------------------------------------->(+)---> e = z - F y
///          |      |                       |                                          ^ -
///    w ----+      |  one state x, n       |                                          |
///   n_w inputs    |                       |   y   measurement: N samples, +-------+  |
///          |      |  H(z)        N x n_w  |----one per channel ---------->| F(z)  |--+
///          +----->|                       |                               | M x N |
///                 +-----------------------+                               +-------+
/// ```
///
/// `x+ = A x + B w`, `[y; z] = C x + D w`, and `||K|| = ||W - F H||` is the gain from the analog input to
/// the error, h = 1. The input w is norm-equivalent to the analog input: `[H; W] [H; W]*` equals that of
/// the hybrid system, so K has the same singular values. F holds the polyphase components `F_{p,i}` of the
/// synthesis filters.
///
/// ```
/// use hybank_core::bank::Bank;
/// use hybank_design::design::{LiftedPlant, Problem};
/// let bank = Bank::from_json(include_str!("../../../filters/thesis-iir.json"), "thesis-iir.json")?;
/// let plant = LiftedPlant::new(&Problem::of_bank(&bank)?);
/// let (bound, peak) = (plant.noncausal_bound()?, plant.bank_norm(&bank.filters)?);
/// // The bank is worst at f = 0, and no bank, causal or not, is better there.
/// assert!(peak.gain < 0.039933 && peak.frequency < 1e-6);
/// assert!((peak.gain / bound.gain - 1.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct LiftedPlant {
    problem: Problem,
    lifted: Lifted,
    response: OnceLock<FrequencyResponse>,
}

impl LiftedPlant {
    /// The exactly equivalent plant of `problem`.
    pub fn new(problem: &Problem) -> Self {
        Self { problem: problem.clone(), lifted: lift(problem), response: OnceLock::new() }
    }

    /// The same plant with the noise of the converters: each channel that has noise gets an input of unit
    /// power that adds to its samples alone, D_y = `[D_y, diag(s_i)]`. A channel with noise is no state of
    /// its delay chain any more, so its [`chain`](Self::chain) is empty. The norm of the error system of
    /// this plant is that of signal and noise, and so is its mean square.
    pub(super) fn with_noise(&self) -> Self {
        self.with_noise_scaled(1.0)
    }

    /// Whether a converter has noise.
    pub(super) fn has_noise(&self) -> bool {
        self.problem.noise.iter().any(|power| *power > 0.0)
    }

    /// As [`Self::with_noise`], with `share` of the rms of the noise.
    pub(super) fn with_noise_scaled(&self, share: f64) -> Self {
        let noise = &self.problem.noise;
        let noisy: Vec<usize> = (0..noise.len()).filter(|&i| noise[i] > 0.0).collect();
        let chains = self.lifted.chains.iter().zip(noise);
        let chains = chains.map(|(chain, power)| if *power > 0.0 { 0..0 } else { chain.clone() });
        let rms = |i: usize, k: usize| if noisy[k] == i { share * noise[i].sqrt() } else { 0.0 };
        let added = |system: &StateSpace| {
            let d = Mat::from_fn(system.outputs(), noisy.len(), rms);
            let b = hybank_linalg::hstack(&[system.b(), &Mat::zeros(system.order(), noisy.len())]);
            let d = hybank_linalg::hstack(&[system.d(), &d]);
            StateSpace::new(system.a().clone(), b, system.c().clone(), d)
        };
        let lifted = Lifted {
            system: added(&self.lifted.system),
            chains: chains.collect(),
            undelayed: added(&self.lifted.undelayed),
            delays: self.lifted.delays.clone(),
        };
        Self { problem: self.problem.clone(), lifted, response: OnceLock::new() }
    }

    /// The problem in normalised time from which the plant was made.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// `[H; W]`: the measurements y first, then the references z.
    pub fn system(&self) -> &StateSpace {
        &self.lifted.system
    }

    /// N, the measurements per slow period.
    pub fn channels(&self) -> usize {
        self.problem.channels.len()
    }

    /// M, the references per slow period.
    pub fn ratio(&self) -> usize {
        self.problem.ratio
    }

    /// H(z), N x n_w.
    pub fn measurement(&self) -> StateSpace {
        self.lifted.system.select_outputs(0..self.channels())
    }

    /// W(z), M x n_w.
    pub fn reference(&self) -> StateSpace {
        self.lifted.system.select_outputs(self.channels()..self.channels() + self.ratio())
    }

    /// The states of the delay chain of `channel`, newest sample first. The range is empty unless the
    /// channel is delayed by whole slow periods. The measurement of a delayed channel is the last state of
    /// its chain, without feedthrough.
    pub(super) fn chain(&self, channel: usize) -> Range<usize> {
        self.lifted.chains[channel].clone()
    }

    /// `[X y; z]`: the outputs of `filters` X, which the measurements drive, and below them the references.
    ///
    /// # Panics
    /// Unless `filters` has N inputs.
    pub fn driving(&self, filters: &StateSpace) -> StateSpace {
        let (n, m, x) = (self.channels(), self.ratio(), filters.outputs());
        let all = self.lifted.system.cascade(0..n, filters);
        all.select_outputs((n + m..n + m + x).chain(n..n + m))
    }

    /// The error system K = W - F H, M x n_w; states of the plant first.
    ///
    /// # Panics
    /// Unless `filters` is M x N.
    pub fn error_system(&self, filters: &StateSpace) -> StateSpace {
        let unity = Mat::identity(self.ratio(), self.ratio());
        self.driving(filters).map_outputs(&hybank_linalg::hstack(&[&-&unity, &unity]))
    }

    /// H and W at e^{j omega}, omega in radians per slow period. The columns are compressed to at
    /// most N + M, which keeps `[H; W] [H; W]*`.
    pub fn at(&self, omega: f64) -> FrequencyPoint {
        let g = hybank_linalg::lq_factor(&self.at_frequency(omega));
        let (n, m) = (self.channels(), self.ratio());
        FrequencyPoint { omega, h: g.rows(0, n).into_owned(), w: g.rows(n, m).into_owned() }
    }

    /// ||K|| with the frequency at which it is attained, radians per slow period.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the error system is not stable.
    ///
    /// # Panics
    /// Unless `filters` is M x N.
    pub fn norm(&self, filters: &StateSpace) -> Result<Peak, DesignError> {
        Ok(hinf_norm(&self.error_system(filters))?)
    }

    /// As [`LiftedPlant::norm`], faster for FIR filters `taps[i][n] = f_i[n]`: their response is a
    /// polynomial, and the response of the plant is prepared once for all filters.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    ///
    /// # Panics
    /// Unless there is a filter for each channel.
    pub fn fir_norm(&self, taps: &[Vec<f64>]) -> Result<Peak, DesignError> {
        let fir = FirMatrix::polyphase(taps, self.ratio());
        let system = self.error_system(&self.delay_lines(&fir, &self.problem.measurement_units()?));
        let (n, m) = (self.channels(), self.ratio());
        let response = |w: f64| {
            let g = self.at_frequency(w);
            g.rows(n, m) - fir.response(w) * g.rows(0, n)
        };
        // Between 0 and pi a polynomial in e^{-jw} has at most one peak per lag.
        let grid = FREQUENCIES_PER_LAG * fir.lags().len();
        let mut initial = self.resonances()?;
        initial.extend((1..grid).map(|k| PI * k as f64 / grid as f64));
        Ok(hinf_norm_with_response(&system, &response, initial)?)
    }

    /// FIR filters whose delay lines hold measurements of about unit size, each in its unit.
    fn delay_lines(&self, fir: &FirMatrix, units: &[f64]) -> StateSpace {
        let of_unit_size = |lag: &Mat| {
            let mut lag = lag.clone();
            lag.column_iter_mut().zip(units).for_each(|(mut column, unit)| column.unscale_mut(*unit));
            lag
        };
        fir.lags().iter().map(of_unit_size).collect::<FirMatrix>().state_space().scale_inputs(units)
    }

    /// ||K|| of a bank's filters, computed from the coefficients in the bank.
    ///
    /// # Errors
    /// As [`LiftedPlant::norm`].
    ///
    /// # Panics
    /// As [`LiftedPlant::norm`], and for matrices that form no system: see
    /// [`Bank::check`](hybank_core::bank::Bank::check).
    pub fn bank_norm(&self, filters: &SynthesisFilters) -> Result<Peak, DesignError> {
        match filters {
            SynthesisFilters::Fir(taps) => self.fir_norm(taps),
            SynthesisFilters::StateSpace(_) => self.norm(&filters::lifted(filters, self.ratio())),
        }
    }

    /// The absolute error that rounding may cause in the norm of the error system of `filters`: eps ||F||_2
    /// ||H||_2, with measurements of about unit size. A norm that is not larger is unresolved.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant or `filters` are not stable.
    pub fn rounding(&self, filters: &StateSpace) -> Result<f64, DesignError> {
        let units = self.problem.measurement_units()?;
        let inverse: Vec<f64> = units.iter().map(|unit| 1.0 / unit).collect();
        let measurement = h2_norm(&self.measurement().scale_outputs(&units))?;
        Ok(f64::EPSILON * h2_norm(&filters.scale_inputs(&inverse))? * measurement)
    }

    /// The absolute error that the computed `norm` of the error system of `filters` may have.
    ///
    /// # Errors
    /// As [`LiftedPlant::rounding`].
    pub fn norm_error(&self, norm: f64, filters: &StateSpace) -> Result<f64, DesignError> {
        Ok(self.accuracy(norm)? * norm + self.rounding(filters)?)
    }

    /// The relative error of a computed norm, without that from rounding in the products of filters and
    /// front ends.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub fn accuracy(&self, norm: f64) -> Result<f64, DesignError> {
        let is_faint = norm < FAINT_NORM * hinf_norm(&self.reference())?.gain;
        Ok(if is_faint { FAINT_NORM_ACCURACY } else { Gamma::NORM_ACCURACY })
    }

    /// The part of the references that no filter can estimate from the measurements: max over omega of
    /// sigma_max(W - W H* (H H*)^+ H). No filter, causal or not, has a smaller ||K||. Channels that sample
    /// proportional filters whole slow periods apart count as one: at each frequency they are multiples of
    /// each other.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub fn noncausal_bound(&self) -> Result<Peak, DesignError> {
        let distinct = self.problem.merge_channels(Repeats::AtWholePeriods).representatives();
        let units = self.problem.measurement_units()?;
        let scales = distinct.iter().map(|&channel| units[channel]);
        let scales: Vec<f64> = scales.chain(std::iter::repeat_n(1.0, self.ratio())).collect();
        let references = self.channels()..self.channels() + self.ratio();
        // Delays by whole periods turn the rows of the response, which changes neither the span of the
        // measurements nor the singular values.
        let undelayed = self.lifted.undelayed.select_outputs(distinct.iter().copied().chain(references));
        Ok(unexplained_peak(&undelayed.scale_outputs(&scales), distinct.len())?)
    }

    /// `[H; W]` at e^{j omega}. A delay by whole periods is a factor of its row, so the time does not depend
    /// on the length of the delay chains.
    pub(super) fn at_frequency(&self, omega: f64) -> CMat {
        let undelayed = self.response.get_or_init(|| FrequencyResponse::new(&self.lifted.undelayed));
        let mut g = undelayed.at_frequency(omega);
        for (mut row, &delay) in g.row_iter_mut().zip(&self.lifted.delays).filter(|(_, delay)| **delay > 0) {
            row *= Complex::from_polar(1.0, -omega * delay as f64);
        }
        g
    }

    /// The frequencies near the poles of the plant. Apart from poles at zero, every FIR error system has
    /// these poles.
    pub(super) fn resonances(&self) -> Result<Vec<f64>, DesignError> {
        Ok(resonances(&stable_poles(&self.lifted.undelayed)?))
    }
}

#[cfg(test)]
mod tests;
