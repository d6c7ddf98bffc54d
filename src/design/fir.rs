//! FIR design: the taps of least gamma (thesis 5.4), and of least mean-square error among these.
//!
//! The bounded-real LMI of thesis 5.4 in the frequency domain is the semi-infinite problem
//! min over taps of max over w of sigma_max(W(w) - F(w) H(w)). On finitely many frequencies it is solved with
//! its dual by [`crate::lmi::sampled`]; the dual is a proven *lower* bound for all taps, since fewer
//! frequencies are fewer constraints. The exact norm of the taps found is the *upper* bound. Frequencies
//! are added at the peaks between the grid until the two meet.

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::error_system;
use super::iir::noncausal_bound;
use crate::bank::SynthesisFilters;
use crate::linalg::{self, CMat, Mat};
use crate::lmi::sampled::{self, Point, Settings, Taps};
use crate::lti::FrequencyResponse;
use std::f64::consts::PI;

/// Relative width of [lower, upper] at which the exchange of frequencies ends.
pub const GAMMA_ACCURACY: f64 = 5e-7;
/// Optimal banks are many: this much of gamma (relative) always goes into the mean-square error, which
/// decides among them.
const LEAST_SLACK: f64 = 4e-7;
/// Rounds of exchange; each at least closes in on one peak, five are rarely needed.
const ROUND_LIMIT: usize = 16;
/// Grid intervals for each slow lag: enough for the mean square of a polynomial of that degree to be exact.
const POINTS_PER_LAG: usize = 3;
const LEAST_POINTS: usize = 24;
/// Peaks are looked for on a grid this much finer.
const FINE: usize = 8;

/// An FIR design.
#[derive(Debug, Clone)]
pub struct FirDesign {
    /// `taps[i][n]` = `f_i[n]` at the fast rate.
    pub taps: Vec<Vec<f64>>,
    /// The exact norm of the error system with these taps.
    pub upper: f64,
    /// A proven lower bound for all taps of this length.
    pub lower: f64,
    /// The bound that no filter at all beats.
    pub noncausal: f64,
    /// Where on the unit circle the worst case sits, radians a slow tick.
    pub peak_frequency: f64,
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

/// The taps (a channel, at the fast rate) of least gamma within [`GAMMA_ACCURACY`]; `slack` is the
/// relative excess over the optimum that may be spent on a smaller mean-square error.
pub fn design_fir(plant: &BlockedPlant, taps: usize, slack: f64) -> Result<FirDesign, DesignError> {
    let mut exchange = Exchange::new(plant, taps)?;
    exchange.minimise_gamma()?;
    exchange.polish(slack.max(LEAST_SLACK))?;
    exchange.finish(noncausal_bound(plant)?)
}

struct Exchange<'a> {
    plant: &'a BlockedPlant,
    length: usize,
    fine: Vec<Point>,
    problem: sampled::Problem,
    /// Mean-square weights of the first, uniform points; later ones have none.
    weights: Vec<f64>,
    best: Option<Candidate>,
    lower: f64,
    dual: Vec<DualPoint>,
    rounds: usize,
    iterations: usize,
}

#[derive(Debug, Clone)]
struct Candidate {
    taps: Taps,
    norm: f64,
    frequency: f64,
}

impl<'a> Exchange<'a> {
    fn new(plant: &'a BlockedPlant, length: usize) -> Result<Self, DesignError> {
        let lags: Vec<usize> =
            (0..plant.wanted).map(|p| length.saturating_sub(p).div_ceil(plant.wanted)).collect();
        let intervals = LEAST_POINTS.max(POINTS_PER_LAG * lags[0]);
        let response = FrequencyResponse::new(&plant.system);
        let fine: Vec<Point> = (0..=FINE * intervals)
            .map(|k| sample_point(plant, &response, PI * k as f64 / (FINE * intervals) as f64))
            .collect();
        let grid = fine.iter().step_by(FINE).cloned().collect();
        let mut weights = vec![1.0 / intervals as f64; intervals + 1];
        (weights[0], weights[intervals]) = (0.5 / intervals as f64, 0.5 / intervals as f64);
        let problem = sampled::Problem::new(grid, lags)?;
        Ok(Self {
            plant,
            length,
            fine,
            problem,
            weights,
            best: None,
            lower: 0.0,
            dual: Vec::new(),
            rounds: 0,
            iterations: 0,
        })
    }

    fn minimise_gamma(&mut self) -> Result<(), DesignError> {
        let settings = Settings { tol_gap_rel: 0.1 * GAMMA_ACCURACY, ..Settings::default() };
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
            let (norm, grid) = (candidate.norm, solution.gamma);
            let peaks = self.peaks(&candidate, grid * (1.0 + 0.2 * GAMMA_ACCURACY))?;
            self.keep(candidate);
            if norm <= self.lower * (1.0 + GAMMA_ACCURACY) || peaks.is_empty() {
                break;
            }
            self.add(peaks)?;
        }
        Ok(())
    }

    /// Least mean-square error under (1 + slack) gamma, with frequencies added where the cap is broken.
    fn polish(&mut self, slack: f64) -> Result<(), DesignError> {
        let Some(start) = self.best.clone() else { return Ok(()) };
        let cap = start.norm * (1.0 + slack);
        for _ in 0..ROUND_LIMIT {
            // Aim a little below, so that the peaks between the points fit under the cap as well.
            let aim = start.norm * (1.0 + 0.75 * slack);
            let found = sampled::mean_square_under_cap(
                &self.problem,
                &self.weights,
                aim,
                &start.taps,
                &Settings::default(),
            );
            // An optimum of zero or a stalled iteration leaves nothing to polish.
            let Ok(found) = found else { return Ok(()) };
            let candidate = self.judge(found.taps)?;
            self.rounds += 1;
            self.iterations += found.steps.len();
            if candidate.norm <= cap {
                self.best = Some(candidate);
                return Ok(());
            }
            let peaks = self.peaks(&candidate, aim)?;
            if peaks.is_empty() {
                return Ok(());
            }
            self.add(peaks)?;
        }
        Ok(())
    }

    fn judge(&self, taps: Taps) -> Result<Candidate, DesignError> {
        let filters = SynthesisFilters::Fir(self.impulse_responses(&taps));
        let block = error_system::block_system(&filters, self.plant.wanted)?;
        let peak = error_system::gamma(self.plant, &block)?;
        Ok(Candidate { taps, norm: peak.gain, frequency: peak.frequency })
    }

    fn keep(&mut self, candidate: Candidate) {
        if self.best.as_ref().is_none_or(|best| candidate.norm < best.norm) {
            self.best = Some(candidate);
        }
    }

    /// Local peaks of the error between the points that rise above `level`, and the exact worst one.
    fn peaks(&self, candidate: &Candidate, level: f64) -> Result<Vec<f64>, DesignError> {
        let gains = self
            .fine
            .iter()
            .map(|point| error_gain(point, &candidate.taps))
            .collect::<Result<Vec<f64>, DesignError>>()?;
        let mut peaks = Vec::new();
        for k in 1..gains.len() - 1 {
            if gains[k] >= gains[k - 1] && gains[k] > gains[k + 1] {
                let (shift, height) = parabola(gains[k - 1], gains[k], gains[k + 1]);
                if height > level {
                    peaks.push(self.fine[k].omega + shift * (self.fine[1].omega - self.fine[0].omega));
                }
            }
        }
        if candidate.norm > level {
            peaks.push(candidate.frequency);
        }
        Ok(peaks)
    }

    /// Adds the frequencies that are not there yet.
    fn add(&mut self, frequencies: Vec<f64>) -> Result<(), DesignError> {
        let response = FrequencyResponse::new(&self.plant.system);
        let mut fresh: Vec<f64> = Vec::new();
        for w in frequencies {
            let known = self.problem.points().iter().map(|point| point.omega).chain(fresh.iter().copied());
            if known.into_iter().all(|other| (other - w).abs() > 1e-7) {
                fresh.push(w);
            }
        }
        self.weights.extend(std::iter::repeat_n(0.0, fresh.len()));
        let points = fresh.into_iter().map(|w| sample_point(self.plant, &response, w));
        self.problem = self.problem.with_points(points)?;
        Ok(())
    }

    /// f_i[p + j M] = F_j[p, i].
    fn impulse_responses(&self, taps: &Taps) -> Vec<Vec<f64>> {
        let ratio = self.plant.wanted;
        (0..self.plant.measured)
            .map(|i| (0..self.length).map(|n| taps[n / ratio][(n % ratio, i)]).collect())
            .collect()
    }

    fn finish(self, noncausal: f64) -> Result<FirDesign, DesignError> {
        let best = self.best.clone().ok_or(DesignError::NoTaps)?;
        Ok(FirDesign {
            taps: self.impulse_responses(&best.taps),
            upper: best.norm,
            lower: self.lower.max(noncausal).min(best.norm),
            noncausal: noncausal.min(best.norm),
            peak_frequency: best.frequency,
            rounds: self.rounds,
            iterations: self.iterations,
            dual: self.dual,
        })
    }
}

/// The plant at one frequency, its inputs compressed to N + M.
fn sample_point(plant: &BlockedPlant, response: &FrequencyResponse, omega: f64) -> Point {
    let g = linalg::lq_factor_c(&response.at_frequency(omega));
    let (n, m) = (plant.measured, plant.wanted);
    Point { omega, h: g.rows(0, n).into_owned(), w: g.rows(n, m).into_owned() }
}

fn error_gain(point: &Point, taps: &[Mat]) -> Result<f64, DesignError> {
    let mut filter = CMat::zeros(point.w.nrows(), point.h.nrows());
    for (j, tap) in taps.iter().enumerate() {
        let rotation = linalg::Complex::from_polar(1.0, -point.omega * j as f64);
        filter.zip_apply(tap, |sum, tap| *sum += rotation * tap);
    }
    Ok(linalg::singular_values_c(&(&point.w - filter * &point.h))?[0])
}

/// Vertex of the parabola through (-1, a), (0, b), (1, c): abscissa and height.
fn parabola(a: f64, b: f64, c: f64) -> (f64, f64) {
    let curvature = a - 2.0 * b + c;
    if curvature >= 0.0 {
        return (0.0, b);
    }
    let shift = (0.5 * (a - c) / curvature).clamp(-1.0, 1.0);
    (shift, b - 0.25 * (a - c) * shift)
}
