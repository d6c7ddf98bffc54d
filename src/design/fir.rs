//! FIR design: the taps of least gamma (thesis 5.4), and of least mean-square error among these.
//!
//! The bounded-real LMI of thesis 5.4 in the frequency domain is the semi-infinite problem
//! min over taps of max over w of sigma_max(W(w) - F(w) H(w)). On finitely many frequencies it is solved with
//! its dual by [`crate::lmi::sampled`]; the dual is a proven *lower* bound for all taps, since fewer
//! frequencies are fewer constraints. The exact norm of the taps found is the *upper* bound. Frequencies
//! are added at the peaks between the grid until the two meet. While taps still change, their norm is only
//! estimated, from the peaks between the points of a fine grid; the taps that are returned have the exact one.

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::error_grid::{ErrorGrid, Peaks};
use super::iir::noncausal_bound;
use crate::linalg::CMat;
use crate::lmi::sampled::{self, MeanSquareObjective, Settings, Taps};
use crate::lti::peak::Peak;

/// Relative width of [lower, upper] at which the exchange of frequencies ends.
pub const GAMMA_ACCURACY: f64 = 5e-7;
/// Optimal banks are many: this much of gamma (relative) always goes into the second objective, which
/// decides among them.
const LEAST_MARGIN: f64 = 4e-7;
/// Where the converters' noise is known, less of it is worth this much of gamma unless the spec says otherwise.
const NOISY_MARGIN: f64 = 1e-3;
/// Rounds of exchange; each at least closes in on one peak, five are rarely needed.
const ROUND_LIMIT: usize = 16;
/// Times that the exact norm may find a peak that the estimates have missed.
const SURPRISE_LIMIT: usize = 8;
/// An FIR design.
#[derive(Debug, Clone)]
pub struct FirDesign {
    /// `taps[i][n]` = `f_i[n]` at the fast rate.
    pub taps: Vec<Vec<f64>>,
    /// The exact norm of the error system with these taps, and where on the unit circle (radians a slow tick) the
    /// worst case sits.
    pub peak: Peak,
    /// A proven lower bound for all taps of this length.
    pub lower: f64,
    /// The bound that no filter at all beats.
    pub noncausal: f64,
    /// Rounds of exchange.
    pub rounds: usize,
    /// Interior-point iterations of all rounds.
    pub iterations: usize,
    /// What the lower bound was read from.
    pub dual: Vec<DualPoint>,
}

/// A frequency with the weights that the dual gives to the wanted samples there.
#[derive(Debug, Clone)]
pub struct DualPoint {
    /// Radians a slow tick.
    pub omega: f64,
    /// M x q; what counts are its left singular vectors.
    pub weight: CMat,
}

/// What decides among the banks of nearly least gamma: the power, a tick, of the error for white noise of unit density
/// at the analog input, and of the converters' noise at the output, `||K||_2^2 + sum_i noise_i ||f_i||^2`.
#[derive(Debug, Clone, PartialEq)]
pub struct SecondObjective {
    /// Power sigma_i^2 of the noise of each channel.
    pub noise: Vec<f64>,
    /// Relative excess over the least gamma that may be spent on it.
    pub gamma_margin: f64,
}

impl SecondObjective {
    /// With the margin given; the default is 1e-3 if a channel has noise, else 4e-7. Never below 4e-7.
    pub fn new(noise: &[f64], gamma_margin: Option<f64>) -> Self {
        let usual = if noise.iter().any(|power| *power > 0.0) { NOISY_MARGIN } else { LEAST_MARGIN };
        Self { noise: noise.to_vec(), gamma_margin: gamma_margin.unwrap_or(usual).max(LEAST_MARGIN) }
    }
}

/// The taps (a channel, at the fast rate) of least gamma within [`GAMMA_ACCURACY`], and among them those of the
/// least second objective.
///
/// # Errors
/// [`DesignError::Sampled`] if there is not one noise power a channel; [`DesignError::Lti`] for unstable plants.
pub fn design_fir(
    plant: &BlockedPlant,
    taps: usize,
    second: SecondObjective,
) -> Result<FirDesign, DesignError> {
    let mut exchange = Exchange::new(plant, taps, second)?;
    let mut best = exchange.optimise()?;
    for _ in 0..SURPRISE_LIMIT {
        if best.peak.gain <= best.estimate * (1.0 + GAMMA_ACCURACY)
            || !exchange.add(vec![best.peak.frequency])?
        {
            break;
        }
        let other = exchange.optimise()?;
        if other.peak.gain < best.peak.gain {
            best = other;
        }
    }
    Ok(exchange.finish(best, noncausal_bound(plant)?))
}

struct Exchange<'a> {
    plant: &'a BlockedPlant,
    grid: ErrorGrid<'a>,
    length: usize,
    problem: sampled::Problem,
    /// Only the first, uniform points have a weight in it.
    square: MeanSquareObjective,
    gamma_margin: f64,
    lower: f64,
    dual: Vec<DualPoint>,
    rounds: usize,
    iterations: usize,
}

/// Taps with their norm as far as the fine grid tells.
#[derive(Debug, Clone)]
struct Candidate {
    taps: Taps,
    peaks: Peaks,
}

/// Taps with their exact norm.
#[derive(Debug, Clone)]
struct Finished {
    taps: Vec<Vec<f64>>,
    estimate: f64,
    peak: Peak,
}

impl<'a> Exchange<'a> {
    fn new(plant: &'a BlockedPlant, length: usize, second: SecondObjective) -> Result<Self, DesignError> {
        let lags: Vec<usize> =
            (0..plant.wanted).map(|p| length.saturating_sub(p).div_ceil(plant.wanted)).collect();
        let grid = ErrorGrid::new(plant, lags[0])?;
        let (points, weights) = grid.coarse();
        let problem = sampled::Problem::new(points, lags)?;
        Ok(Self {
            plant,
            grid,
            length,
            problem,
            square: MeanSquareObjective { weights, noise: second.noise },
            gamma_margin: second.gamma_margin,
            lower: 0.0,
            dual: Vec::new(),
            rounds: 0,
            iterations: 0,
        })
    }

    /// Least gamma, then least mean square, then the exact norm.
    fn optimise(&mut self) -> Result<Finished, DesignError> {
        let start = self.minimise_gamma()?;
        let best = self.polish(start)?;
        let taps = self.impulse_responses(&best.taps);
        let peak = self.grid.gamma(&taps)?;
        Ok(Finished { taps, estimate: best.peaks.estimate, peak })
    }

    fn minimise_gamma(&mut self) -> Result<Candidate, DesignError> {
        let settings = Settings { tol_gap_rel: 0.1 * GAMMA_ACCURACY, ..Settings::default() };
        let mut best: Option<Candidate> = None;
        for _ in 0..ROUND_LIMIT {
            let solution = sampled::minimise(&self.problem, &settings)?;
            self.rounds += 1;
            self.iterations += solution.steps.len();
            if solution.lower.value > self.lower {
                self.lower = solution.lower.value;
                let weights = self.problem.points().iter().zip(solution.dual);
                self.dual = weights.map(|(point, weight)| DualPoint { omega: point.omega, weight }).collect();
            }
            let candidate = self.judge(solution.taps)?;
            let peaks = candidate.peaks.above(solution.gamma * (1.0 + 0.2 * GAMMA_ACCURACY));
            if best.as_ref().is_none_or(|best| candidate.peaks.estimate < best.peaks.estimate) {
                best = Some(candidate);
            }
            let reached = best.as_ref().map_or(0.0, |best| best.peaks.estimate);
            if reached <= self.lower * (1.0 + GAMMA_ACCURACY) || !self.add(peaks)? {
                break;
            }
        }
        best.ok_or(DesignError::NoTaps)
    }

    /// The least second objective under (1 + gamma_margin) gamma, with frequencies added where the cap is broken; the start
    /// if that cannot be had.
    fn polish(&mut self, start: Candidate) -> Result<Candidate, DesignError> {
        let cap = start.peaks.estimate * (1.0 + self.gamma_margin);
        // Aim a little below, so that the peaks between the points fit under the cap as well.
        let aim = start.peaks.estimate * (1.0 + 0.75 * self.gamma_margin);
        for _ in 0..ROUND_LIMIT {
            let found = sampled::mean_square_under_cap(
                &self.problem,
                &self.square,
                aim,
                &start.taps,
                &Settings::default(),
            );
            // An optimum of zero or a stalled iteration leaves nothing to polish.
            let Ok(found) = found else { break };
            self.rounds += 1;
            self.iterations += found.steps.len();
            let candidate = self.judge(found.taps)?;
            if candidate.peaks.estimate <= cap {
                return Ok(candidate);
            }
            if !self.add(candidate.peaks.above(aim))? {
                break;
            }
        }
        Ok(start)
    }

    fn judge(&self, taps: Taps) -> Result<Candidate, DesignError> {
        let peaks = self.grid.peaks(&taps)?;
        Ok(Candidate { taps, peaks })
    }

    /// Adds the frequencies that are not there yet; whether there were any.
    fn add(&mut self, frequencies: Vec<f64>) -> Result<bool, DesignError> {
        let mut fresh: Vec<f64> = Vec::new();
        for w in frequencies {
            let known = self.problem.points().iter().map(|point| point.omega).chain(fresh.iter().copied());
            if known.into_iter().all(|other| (other - w).abs() > 1e-7) {
                fresh.push(w);
            }
        }
        self.square.weights.extend(std::iter::repeat_n(0.0, fresh.len()));
        let points = fresh.iter().map(|&w| self.grid.at(w));
        self.problem = self.problem.with_points(points)?;
        Ok(!fresh.is_empty())
    }

    /// f_i[p + j M] = F_j[p, i].
    fn impulse_responses(&self, taps: &Taps) -> Vec<Vec<f64>> {
        let ratio = self.plant.wanted;
        (0..self.plant.measured)
            .map(|i| (0..self.length).map(|n| taps[n / ratio][(n % ratio, i)]).collect())
            .collect()
    }

    fn finish(self, best: Finished, noncausal: f64) -> FirDesign {
        let upper = best.peak.gain;
        FirDesign {
            taps: best.taps,
            peak: best.peak,
            lower: self.lower.max(noncausal).min(upper),
            noncausal: noncausal.min(upper),
            rounds: self.rounds,
            iterations: self.iterations,
            dual: self.dual,
        }
    }
}
