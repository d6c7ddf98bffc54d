//! The taps to quantise, the error of integers in their place, and the mean-square error that a change of
//! the taps adds, over weighted frequencies.
//!
//! A change Delta of the taps adds `Delta H` to the error. The mean square `sum_k w_k |Delta(w_k) H(w_k)|^2`
//! is a sum of one quadratic form per phase p, in the taps `f_i[p + j M]` of that phase:
//!
//! ```text
//! Q[(i, j), (i', j')] = sum_k w_k Re( e^{-i omega_k (j - j')} (H H*)[i, i'] )
//! ```

use super::settings::SETTINGS;
use crate::design::DesignError;
use crate::design::error_grid::ErrorGrid;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::design::reduction::Aim;
use crate::lmi::sampled::FrequencyPoint;
use crate::lti::FirMatrix;
use hybank_core::bank::FixedPoint;
use hybank_core::spec::{MAX_BITS, WordLengths};
use hybank_linalg::{CMat, Complex, Mat};

/// Taps to be replaced by integers times a power of two.
#[derive(Debug, Clone, Copy)]
pub(in crate::design) struct QuantisationProblem<'a> {
    /// The plant whose error counts.
    pub(in crate::design) plant: &'a LiftedPlant,
    /// One filter per channel, all of the same length.
    pub(in crate::design) taps: &'a [Vec<f64>],
    /// Noise power of each channel.
    pub(in crate::design) noise: &'a [f64],
    /// Relative excess of gamma granted to the mean square.
    pub(in crate::design) gamma_margin: f64,
    /// What the taps minimise, and the integers too.
    pub(in crate::design) aim: Aim,
    /// Ends the search with the best integers so far.
    pub(in crate::design) stop: &'a Stop,
}

/// Integer taps with their error.
#[derive(Debug, Clone)]
pub(super) struct RoundedTaps {
    /// The integers with their scale.
    pub(super) fixed_point: FixedPoint,
    /// Estimate of gamma on the grid.
    pub(super) gamma: f64,
    /// Mean square of the error plus the converters' noise at the output, per slow period; at least the
    /// rounding of that of zero taps.
    pub(super) mean_square: f64,
}

/// Estimates of the error of integer taps, on a grid of frequencies.
pub(super) struct TapError<'a> {
    pub(super) problem: QuantisationProblem<'a>,
    pub(super) ratio: usize,
    pub(super) grid: ErrorGrid<'a>,
    /// The points of the grid.
    pub(super) points: Vec<FrequencyPoint>,
    pub(super) forms: Forms,
    /// Estimate of gamma of the real taps.
    pub(super) real_gamma: f64,
    /// The least gamma that counts.
    pub(super) least_gamma: f64,
    /// Mean square of the real taps, as in [`RoundedTaps`].
    pub(super) real_mean_square: f64,
    /// The least mean square that counts.
    least_mean_square: f64,
}

impl<'a> TapError<'a> {
    /// Samples the plant and judges the real taps.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable, [`DesignError::Linalg`] if a decomposition fails.
    pub(super) fn new(problem: QuantisationProblem<'a>) -> Result<Self, DesignError> {
        let ratio = problem.plant.ratio();
        let fir = FirMatrix::polyphase(problem.taps, ratio);
        let grid = ErrorGrid::new(problem.plant, fir.lags().len())?;
        let points = grid.points();
        let forms = Forms::new(&points);
        let real_gamma = grid.gamma(&fir)?;
        let zeros = FirMatrix::polyphase(&vec![vec![0.0; problem.taps[0].len()]; problem.taps.len()], ratio);
        let least_gamma = SETTINGS.zero_gamma * grid.gamma(&zeros)?;
        let least_mean_square = SETTINGS.zero_mean_square * grid.mean_square(&zeros);
        let real = grid.mean_square(&fir) + output_noise(problem.noise, problem.taps);
        let real_mean_square = real.max(least_mean_square);
        Ok(Self {
            problem,
            ratio,
            grid,
            points,
            forms,
            real_gamma,
            least_gamma,
            real_mean_square,
            least_mean_square,
        })
    }

    /// The error of integer taps.
    pub(super) fn candidate(&self, fixed_point: FixedPoint) -> Result<RoundedTaps, DesignError> {
        let taps = fixed_point.taps();
        let fir = FirMatrix::polyphase(&taps, self.ratio);
        let found = match self.problem.aim {
            Aim::WorstCase => self.grid.mean_square(&fir) + output_noise(self.problem.noise, &taps),
            Aim::MeanSquare => self.real_mean_square + self.added(&taps),
        };
        let mean_square = found.max(self.least_mean_square);
        Ok(RoundedTaps { gamma: self.grid.gamma(&fir)?, mean_square, fixed_point })
    }

    /// The mean square that taps in place of the real ones add where these have the least one: the form of
    /// the change alone.
    fn added(&self, taps: &[Vec<f64>]) -> f64 {
        let differ = |(new, old): (&Vec<f64>, &Vec<f64>)| new.iter().zip(old).map(|(x, y)| x - y).collect();
        let change: Vec<Vec<f64>> = taps.iter().zip(self.problem.taps).map(differ).collect();
        let fir = FirMatrix::polyphase(&change, self.ratio);
        let square = |(point, weight): (&FrequencyPoint, f64)| {
            weight * (fir.response(point.omega) * &point.h).norm_squared()
        };
        let signal: f64 = self.points.iter().zip(self.grid.mean_weights()).map(square).sum();
        signal + output_noise(self.problem.noise, &change)
    }

    /// The mean square that a unit of each channel's tap adds.
    pub(super) fn powers(&self) -> Vec<f64> {
        let correlations = self.forms.correlations(&self.grid.mean_weights(), 1);
        (0..self.problem.taps.len()).map(|i| correlations.power(i) + noise(self.problem.noise, i)).collect()
    }

    /// The real taps of least mean square of the error plus the converters' noise at the output: the taps of
    /// the problem where they minimise that, over uncertain channels too.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if rounding errors make the form indefinite.
    pub(super) fn taps_of_least_square(&self) -> Result<Vec<Vec<f64>>, DesignError> {
        if self.problem.aim == Aim::MeanSquare {
            return Ok(self.problem.taps.to_vec());
        }
        let (problem, weights) = (self.problem, self.grid.mean_weights());
        let fir = FirMatrix::polyphase(problem.taps, self.ratio);
        let errors = self.points.iter().map(|point| point.error(&fir.response(point.omega)));
        let errors: Vec<CMat> = errors.collect();
        let correlations = self.forms.correlations(&weights, fir.lags().len());
        let mut least = problem.taps.to_vec();
        for phase in 0..self.ratio.min(least[0].len()) {
            let taps = Tap::of_phase(phase, self, &WordLengths::Same(MAX_BITS));
            let descent = |tap: &Tap| {
                let fit = self.points.iter().zip(&errors).zip(&weights).map(|((point, error), weight)| {
                    let phasor = Complex::from_polar(*weight, point.omega * tap.lag as f64);
                    (phasor * point.h.row(tap.channel).dotc(&error.row(phase))).re
                });
                let own = least[tap.channel][phase + tap.lag * self.ratio];
                fit.sum::<f64>() - noise(problem.noise, tap.channel) * own
            };
            let descent = Mat::from_iterator(taps.len(), 1, taps.iter().map(descent));
            let steps = hybank_linalg::solve_positive(&correlations.form(&taps, problem.noise), &descent)?;
            for (tap, step) in taps.iter().zip(steps.iter()) {
                least[tap.channel][phase + tap.lag * self.ratio] += step;
            }
        }
        Ok(least)
    }

    /// Estimate of gamma of integer taps.
    pub(super) fn gamma(&self, fixed_point: &FixedPoint) -> Result<f64, DesignError> {
        self.grid.gamma(&FirMatrix::polyphase(&fixed_point.taps(), self.ratio))
    }
}

/// The noise power of a channel; none is stated of a list that is empty.
fn noise(powers: &[f64], channel: usize) -> f64 {
    powers.get(channel).copied().unwrap_or(0.0)
}

/// `sum_i noise_i |f_i|^2`.
fn output_noise(noise: &[f64], taps: &[Vec<f64>]) -> f64 {
    noise
        .iter()
        .zip(taps)
        .map(|(power, filter)| power * filter.iter().map(|tap| tap * tap).sum::<f64>())
        .sum()
}

/// A tap of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tap {
    pub(super) channel: usize,
    /// Delay in slow periods.
    pub(super) lag: usize,
}

impl Tap {
    /// The taps of a phase of filters of these `bits`, in the order of time, those with few bits last. The
    /// lattice search decides the last ones first, so that taps with more bits compensate for them.
    pub(super) fn of_phase(phase: usize, error: &TapError<'_>, bits: &WordLengths) -> Vec<Self> {
        let (taps, ratio) = (error.problem.taps, error.ratio);
        let of_lag = |lag| (0..taps.len()).map(move |channel| Self { channel, lag });
        let mut all: Vec<Self> = (0..(taps[0].len() - phase).div_ceil(ratio)).flat_map(of_lag).collect();
        all.sort_by_key(|tap| std::cmp::Reverse(bits.bits(phase + tap.lag * ratio)));
        all
    }
}

/// `H H*` at the frequencies of a grid.
pub(super) struct Forms {
    omegas: Vec<f64>,
    grams: Vec<CMat>,
}

/// The form for all pairs of channels and all differences of lags, with given weights.
pub(super) struct Correlations {
    /// `sum_k w_k Re(e^{-i omega_k d} (H H*)[i, i'])` for d = 0, 1, ...
    by_lag: Vec<Mat>,
}

impl Forms {
    pub(super) fn new(points: &[FrequencyPoint]) -> Self {
        Self {
            omegas: points.iter().map(|point| point.omega).collect(),
            grams: points.iter().map(|point| &point.h * point.h.adjoint()).collect(),
        }
    }

    /// The correlations for `lags` lags, with one weight per frequency.
    pub(super) fn correlations(&self, weights: &[f64], lags: usize) -> Correlations {
        let channels = self.grams[0].nrows();
        let mut by_lag = vec![Mat::zeros(channels, channels); lags];
        for ((omega, gram), weight) in self.omegas.iter().zip(&self.grams).zip(weights) {
            for (d, sum) in by_lag.iter_mut().enumerate() {
                let phasor = Complex::from_polar(*weight, -omega * d as f64);
                sum.zip_apply(gram, |x, g| *x += phasor.re * g.re - phasor.im * g.im);
            }
        }
        Correlations { by_lag }
    }
}

impl Correlations {
    /// L with `L L' = Q` for the taps given, with the noise powers of their channels.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if rounding errors make the form indefinite.
    pub(super) fn factor(&self, taps: &[Tap], powers: &[f64]) -> Result<Mat, DesignError> {
        Ok(hybank_linalg::cholesky(&self.form(taps, powers))?)
    }

    fn form(&self, taps: &[Tap], powers: &[f64]) -> Mat {
        let n = taps.len();
        let mut form = Mat::from_fn(n, n, |r, c| self.between(taps[r], taps[c]));
        for (i, tap) in taps.iter().enumerate() {
            form[(i, i)] += noise(powers, tap.channel);
            form[(i, i)] += SETTINGS.ridge * form[(i, i)] + f64::MIN_POSITIVE;
        }
        form
    }

    /// The form of a single tap of channel i.
    fn power(&self, i: usize) -> f64 {
        self.by_lag[0][(i, i)]
    }

    fn between(&self, a: Tap, b: Tap) -> f64 {
        // The sum for -d is the transposed one.
        if a.lag >= b.lag {
            self.by_lag[a.lag - b.lag][(a.channel, b.channel)]
        } else {
            self.by_lag[b.lag - a.lag][(b.channel, a.channel)]
        }
    }
}
