//! The level-set iteration: a lower bound from evaluated gains, raised until no eigenvalue suggests a
//! higher one.

use super::hamiltonian::{about_any, about_real};
use super::refine::{higher, local_maxima, refine, upper_estimate};
use super::{PEAK_ACCURACY, Peak, unexplained_gain};
use crate::linalg::{self, CMat};
use crate::lti::{LtiError, StateSpace};
use std::f64::consts::PI;

/// Limit on the rounds. The level rises at least by [`PEAK_ACCURACY`] in each; in practice two or three
/// rounds suffice.
const ROUND_LIMIT: usize = 60;
/// Uniform initial frequencies.
const FIRST_GRID: usize = 32;
/// At least so many uniform frequencies per state: |G|^2 has at most a peak for each state between 0 and pi.
const FREQUENCIES_PER_STATE: usize = 2;
/// Frequencies closer than this count as equal.
const SAME_FREQUENCY: f64 = 1e-9;
/// How far off the axis (relative) an eigenvalue may lie and still count as a crossing.
const ON_AXIS: f64 = 1e-5;
/// As [`ON_AXIS`], for frequencies that are only suggested. If the level almost touches a peak, two
/// eigenvalues meet on the axis, and a rounding error of the matrix moves them by its square root. Errors
/// of 1e-4 are common if the gain is small relative to terms that cancel. A false suggestion costs one
/// evaluation; a missed one loses a peak.
const NEAR_AXIS: f64 = 1e-2;

/// A frequency whose gain is this close to the level (relative) is a bad centre of the Cayley transform.
const NEAR_LEVEL: f64 = 1e-2;
/// Number of frequencies tried for a better centre.
const CENTRES: usize = 16;

/// The search on one system.
pub(super) struct Search<'a> {
    system: StateSpace,
    measurements: usize,
    response: &'a dyn Fn(f64) -> CMat,
    /// Initial frequencies beside the uniform ones.
    initial: Vec<f64>,
    /// The level set squares the gain. Below sqrt(eps) of the terms that cancel it consists of rounding
    /// errors only, and the refined grid gives the result.
    floor: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        system: &StateSpace,
        measurements: usize,
        response: &'a dyn Fn(f64) -> CMat,
        initial: Vec<f64>,
    ) -> Self {
        let system = system.rescaled();
        let scale = system.d().norm() + system.c().norm() * system.b().norm();
        Self { system, measurements, response, initial, floor: f64::EPSILON.sqrt() * scale }
    }

    fn gain(&self, w: f64) -> Result<f64, LtiError> {
        unexplained_gain(&(self.response)(w), self.measurements)
    }

    pub(super) fn run(&self) -> Result<Peak, LtiError> {
        let mut best = self.first_peak()?;
        for _ in 0..ROUND_LIMIT {
            if best.gain <= self.floor {
                return Ok(best);
            }
            match self.above(best.gain * (1.0 + PEAK_ACCURACY))? {
                None => return Ok(best),
                Some(higher) => best = higher,
            }
        }
        Err(LtiError::IterationLimit { what: "the level set", limit: ROUND_LIMIT, change: PEAK_ACCURACY })
    }

    /// The highest local maximum. Each local maximum of the grid that may be the highest is refined.
    /// Minimax designs have many nearly equal peaks that no level set can distinguish, so none of them is
    /// left to the level sets.
    fn first_peak(&self) -> Result<Peak, LtiError> {
        let grid = self.grid()?;
        let mut maxima = local_maxima(&grid);
        maxima.sort_by(|a, b| b[1].gain.total_cmp(&a[1].gain));
        let mut best =
            maxima.first().map_or(Peak { gain: 0.0, frequency: 0.0 }, |maximum| maximum[1].folded());
        for [low, middle, high] in maxima {
            if upper_estimate(low, middle, high) > best.gain {
                best = higher(best, refine(|w| self.at(w), [low, middle, high])?);
            }
        }
        Ok(best)
    }

    /// The gains at the initial frequencies, ascending from 0 to pi.
    fn grid(&self) -> Result<Vec<Peak>, LtiError> {
        let intervals = FIRST_GRID.max(FREQUENCIES_PER_STATE * self.system.order());
        let mut grid: Vec<f64> = (0..=intervals).map(|k| PI * k as f64 / intervals as f64).collect();
        grid.extend(&self.initial);
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a < SAME_FREQUENCY);
        grid.into_iter().map(|w| self.at(w)).collect()
    }

    pub(super) fn at(&self, frequency: f64) -> Result<Peak, LtiError> {
        Ok(Peak { gain: self.gain(frequency)?, frequency })
    }

    /// A frequency with a gain above `level`, refined, if there is one.
    fn above(&self, level: f64) -> Result<Option<Peak>, LtiError> {
        let crossings = self.crossings(level, NEAR_AXIS)?;
        let mut candidates = crossings.clone();
        candidates.extend(crossings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
        let mut best = Peak { gain: level, frequency: f64::NAN };
        for w in candidates {
            best = higher(best, self.at(w)?);
        }
        if best.frequency.is_nan() {
            return Ok(None);
        }
        let spread = 0.25 * PI / FIRST_GRID as f64;
        let (low, high) = (self.at(best.frequency - spread)?, self.at(best.frequency + spread)?);
        refine(|w| self.at(w), [low, best, high]).map(Some)
    }

    pub(super) fn all_above(&self, level: f64) -> Result<Vec<Peak>, LtiError> {
        let mut edges = self.crossings(level, ON_AXIS)?;
        edges.dedup();
        let mut peaks = Vec::new();
        for range in edges.windows(2) {
            let start = self.at(0.5 * (range[0] + range[1]))?;
            if start.gain > level {
                let (low, high) = (self.at(range[0])?, self.at(range[1])?);
                peaks.push(higher(refine(|w| self.at(w), [low, start, high])?, higher(low, high)));
            }
        }
        Ok(peaks)
    }

    /// Frequencies in [0, pi], ascending and with both ends, at which the gain may equal `level`: those of
    /// eigenvalues that lie off the axis by at most `tolerance` (relative).
    ///
    /// The eigenvalues are computed for the balanced Hamiltonian matrix. If its scales differ by many
    /// decades, they are also computed for the unbalanced one. Large gains need balancing; balancing may
    /// amplify the smallest entries, which are rounding errors.
    ///
    /// If measurements are copies of one another, there is no Hamiltonian matrix. Then no frequency is
    /// suggested, and the result is that of the refined grid, which is still an attained value.
    fn crossings(&self, level: f64, tolerance: f64) -> Result<Vec<f64>, LtiError> {
        let mut crossings = vec![0.0, PI];
        let centre = self.centre(level)?;
        let real = centre == 0.0 || centre == PI;
        let eigenvalues = if real {
            linalg::candidate_eigenvalues(&about_real(&self.system, self.measurements, level, centre)?)
        } else {
            linalg::candidate_eigenvalues_c(&about_any(&self.system, self.measurements, level, centre)?)
        };
        let eigenvalues = match eigenvalues {
            Err(linalg::LinalgError::NotFinite { .. }) if self.measurements > 0 => return Ok(crossings),
            other => other?,
        };
        // Of a conjugate pair one is enough.
        for lambda in eigenvalues.into_iter().filter(|lambda| !real || lambda.im >= 0.0) {
            if lambda.re.abs() <= tolerance * (1.0 + lambda.norm()) {
                let w = centre + PI + 2.0 * lambda.im.atan();
                crossings.push(Peak { gain: level, frequency: w }.folded().frequency);
            }
        }
        crossings.sort_by(f64::total_cmp);
        Ok(crossings)
    }

    /// The Cayley transform sends e^{j centre} to infinity, where the gain must not equal the level: of pi
    /// and 0 the one whose gain is farther away or, where both are near (as in errors of many equal peaks),
    /// a frequency between them.
    fn centre(&self, level: f64) -> Result<f64, LtiError> {
        let distance = |w: f64| self.gain(w).map(|gain| (gain - level).abs());
        let (low, high) = (distance(0.0)?, distance(PI)?);
        let mut best = if high >= low { (high, PI) } else { (low, 0.0) };
        if best.0 > NEAR_LEVEL * level {
            return Ok(best.1);
        }
        for k in 1..CENTRES {
            let w = PI * k as f64 / CENTRES as f64;
            let away = distance(w)?;
            if away > best.0 {
                best = (away, w);
            }
        }
        Ok(best.1)
    }
}
