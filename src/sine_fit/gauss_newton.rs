//! The fit: the coefficients of each channel are eliminated, the frequencies are iterated.

use super::normal::{Linearisation, Oscillator, accumulate, centre, linear_count};
use super::result::{FitCovariance, SineFit};
use super::{Channel, SineFitError, alias, distance_to_edge};
use crate::linalg::least_squares::{LeastSquares, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::{LinalgError, Mat, PositiveFactor};
use crate::units::Hertz;
use std::f64::consts::{PI, TAU};

/// The iteration ends when the phase at the ends of the longest record moves by less than this (radians). A
/// record of 1e9 samples at an SNR of 120 dB has a standard deviation of 4e-11.
const PHASE_TOLERANCE: f64 = 1e-11;
/// Least distance of two aliases, and of an alias and a multiple of half the rate, in cycles per record.
const LEAST_DISTANCE: f64 = 0.5;
/// A step of the frequency is at most this (radians at the ends of the longest record): a quarter of a
/// cycle.
const LARGEST_STEP: f64 = 0.5 * PI;
/// A frequency that moves farther than this from its start is lost (radians at the ends of the longest
/// record).
const FARTHEST: f64 = 2.0 * PI;

/// Fits constants, amplitudes and phases of tones of known frequencies: the three-parameter fit of IEEE
/// 1057, for several tones and channels.
///
/// # Errors
/// [`SineFitError`], but neither `NoTone` nor `NoConvergence`.
pub fn fit_known(channels: &[Channel<'_>], rate: Hertz, tones: &[Hertz]) -> Result<SineFit, SineFitError> {
    let mut state = FitParameters::new(channels, rate, tones)?;
    state.solve_linear()?;
    // The second solution takes away what the rounding of the first left.
    state.solve_linear()?;
    state.finish(0)
}

/// Fits frequencies, constants, amplitudes and phases: the four-parameter fit of IEEE 1057, for several
/// tones and channels. `tones` are within about half a cycle per record of the frequencies;
/// [`super::find_tones`] and [`super::locate`] give such a start.
///
/// # Errors
/// [`SineFitError`].
pub fn fit(channels: &[Channel<'_>], rate: Hertz, tones: &[Hertz]) -> Result<SineFit, SineFitError> {
    let mut state = FitParameters::new(channels, rate, tones)?;
    state.solve_linear()?;
    let steps = minimise(&mut state)?.steps;
    state.solve_linear()?;
    state.check_frequencies()?;
    state.finish(steps)
}

/// The present parameters.
struct FitParameters<'a> {
    channels: &'a [Channel<'a>],
    rate: Hertz,
    tones: &'a [Hertz],
    /// Cycles per sample.
    frequencies: Vec<f64>,
    /// Coefficients of 1, cosines and sines of each channel, phases at the centre of its record.
    linear: Vec<Vec<f64>>,
    /// Half the length of the longest record, the unit of time of the derivatives.
    unit: f64,
    /// The parts of the last equations.
    parts: Vec<Eliminated>,
}

/// A channel's part of the solution, with its own coefficients eliminated: G = its Gram matrix without
/// derivatives, B = that with derivatives, D = that of the derivatives; g and h = the projections.
struct Eliminated {
    factor: PositiveFactor,
    /// G^-1 g.
    own: Mat,
    /// G^-1 B.
    coupling: Mat,
    /// D - B' G^-1 B and h - B' G^-1 g.
    schur: Mat,
    rest: Mat,
    squares: f64,
    used: usize,
}

impl LeastSquares for FitParameters<'_> {
    type Error = SineFitError;
    /// A start within half a cycle per record takes three to six.
    const MOST_STEPS: usize = 40;

    /// Of the frequencies, in radians at the ends of the longest record.
    fn equations(&mut self) -> Result<NormalEquations, SineFitError> {
        self.parts = self.eliminate(true)?;
        let mut sum = NormalEquations::new(self.frequencies.len());
        sum.gram = self.sum_of_schur(|_| 1.0);
        self.parts.iter().for_each(|part| sum.projection += &part.rest);
        Ok(sum)
    }

    fn advance(&mut self, step: &[f64]) -> bool {
        let step = Mat::from_column_slice(step.len(), 1, step);
        for (linear, part) in self.linear.iter_mut().zip(&self.parts) {
            let change = &part.own - &part.coupling * &step;
            linear.iter_mut().zip(change.iter()).for_each(|(x, dx)| *x += dx);
        }
        for (f, change) in self.frequencies.iter_mut().zip(step.iter()) {
            *f += change / (TAU * self.unit);
        }
        let moved = |(f, tone): (&f64, &Hertz)| (TAU * self.unit * (f - *tone / self.rate)).abs();
        self.frequencies.iter().zip(self.tones).map(moved).all(|moved| moved <= FARTHEST)
    }

    /// [`PHASE_TOLERANCE`], but no less than what the rounding of the frequencies moves.
    fn limits(&self, _: usize, _: f64) -> StepLimits {
        let largest = self.frequencies.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
        let rounding = 4.0 * f64::EPSILON * TAU * self.unit * largest;
        StepLimits { largest: LARGEST_STEP, negligible: PHASE_TOLERANCE + rounding }
    }

    fn error(&self, why: NoMinimum) -> SineFitError {
        match why {
            NoMinimum::WithoutEffect(k) => {
                SineFitError::NoTone { near: Some(self.tone(k)), lines: Vec::new() }
            }
            NoMinimum::Dependent => self.dependent(self.frequencies.len() - 1),
            NoMinimum::NoConvergence(iterations) => {
                SineFitError::NoConvergence { frequency: self.tones[0], iterations }
            }
        }
    }
}

impl<'a> FitParameters<'a> {
    fn new(channels: &'a [Channel<'a>], rate: Hertz, tones: &'a [Hertz]) -> Result<Self, SineFitError> {
        if channels.is_empty() || tones.is_empty() || !(rate.0 > 0.0 && rate.0.is_finite()) {
            return Err(SineFitError::Nothing { channels: channels.len(), tones: tones.len(), rate });
        }
        let longest = channels.iter().map(|channel| channel.samples.len()).max().unwrap_or(0);
        let linear = vec![vec![0.0; linear_count(tones.len())]; channels.len()];
        let frequencies = tones.iter().map(|tone| *tone / rate).collect();
        let unit = 0.5 * longest as f64;
        let state = Self { channels, rate, tones, frequencies, linear, unit, parts: Vec::new() };
        state.check_samples()?;
        state.check_frequencies()?;
        Ok(state)
    }

    fn check_samples(&self) -> Result<(), SineFitError> {
        let tones = self.frequencies.len();
        // One more than the parameters, so that the residual says something about the noise.
        let needed = linear_count(tones) + tones + 1;
        for (i, channel) in self.channels.iter().enumerate() {
            let samples = channel.samples.len();
            if let Some(mask) = channel.keep.map(<[bool]>::len).filter(|&mask| mask != samples) {
                return Err(SineFitError::Mask { channel: i + 1, mask, samples });
            }
            let used = channel.used();
            if used < needed {
                return Err(SineFitError::TooFewSamples { channel: i + 1, used, samples, tones, needed });
            }
        }
        Ok(())
    }

    /// The tones can be told apart from one another, from the constant and from its image.
    fn check_frequencies(&self) -> Result<(), SineFitError> {
        let shortest = self.channels.iter().map(|channel| channel.samples.len()).min().unwrap_or(0) as f64;
        for (k, &f) in self.frequencies.iter().enumerate() {
            let distance = distance_to_edge(f) * shortest;
            if distance.is_nan() || distance < LEAST_DISTANCE {
                return Err(SineFitError::AtEdge { frequency: self.tone(k), distance, rate: self.rate });
            }
            let close = |other: f64| (alias(f) - alias(other)).abs() * shortest < LEAST_DISTANCE;
            if let Some(j) = (0..k).find(|&j| close(self.frequencies[j])) {
                return Err(self.coincide(j, k));
            }
        }
        Ok(())
    }

    fn tone(&self, k: usize) -> Hertz {
        self.rate * self.frequencies[k]
    }

    fn coincide(&self, j: usize, k: usize) -> SineFitError {
        SineFitError::TonesCoincide { first: self.tone(j), second: self.tone(k) }
    }

    /// A failed Cholesky factorisation: the tone at the failing pivot depends on those before it.
    fn dependent(&self, pivot: usize) -> SineFitError {
        match pivot {
            0 => SineFitError::AtEdge { frequency: self.tone(0), distance: 0.0, rate: self.rate },
            _ => self.coincide(0, pivot.min(self.frequencies.len() - 1)),
        }
    }

    /// One pass over all samples, with the derivatives by the frequencies or without.
    fn eliminate(&self, is_searched: bool) -> Result<Vec<Eliminated>, SineFitError> {
        let oscillators: Vec<_> = self.frequencies.iter().map(|&f| Oscillator::new(f)).collect();
        let unit = is_searched.then_some(self.unit);
        let channel = |(channel, linear): (&Channel<'_>, &Vec<f64>)| {
            let normal = accumulate(channel, &Linearisation { oscillators: &oscillators, linear, unit });
            Eliminated::new(&normal, linear.len()).map_err(|error| match error {
                LinalgError::NotPositiveDefinite { pivot } => self.dependent(pivot / 2),
                _ => self.dependent(0),
            })
        };
        self.channels.iter().zip(&self.linear).map(channel).collect()
    }

    /// The least-squares coefficients at the present frequencies.
    fn solve_linear(&mut self) -> Result<(), SineFitError> {
        let parts = self.eliminate(false)?;
        for (linear, part) in self.linear.iter_mut().zip(&parts) {
            linear.iter_mut().zip(part.own.iter()).for_each(|(x, dx)| *x += dx);
        }
        Ok(())
    }

    fn sum_of_schur(&self, weight: impl Fn(usize) -> f64) -> Mat {
        let tones = self.frequencies.len();
        let terms = self.parts.iter().enumerate().map(|(i, part)| &part.schur * weight(i));
        terms.fold(Mat::zeros(tones, tones), |sum, term| sum + term)
    }

    /// A last pass for the residual and the covariance; frequencies were fitted if there were `iterations`.
    fn finish(mut self, iterations: usize) -> Result<SineFit, SineFitError> {
        let is_fitted = iterations > 0;
        let tones = self.frequencies.len();
        // With S_i the Schur complements and v_i the variances: S^-1 (sum of v_i S_i) S^-1.
        let inverse = match is_fitted {
            true => self.equations()?.inverse(Self::WORST_CONDITION).map_err(|why| self.error(why))?,
            false => {
                self.parts = self.eliminate(false)?;
                Mat::zeros(tones, tones)
            }
        };
        // Each channel carries its share of the common frequencies.
        let shared = if is_fitted { tones as f64 / self.channels.len() as f64 } else { 0.0 };
        let freedom = |part: &Eliminated| part.used as f64 - linear_count(tones) as f64 - shared;
        let variances: Vec<f64> =
            self.parts.iter().map(|part| part.squares / freedom(part).max(1.0)).collect();
        let frequencies =
            if is_fitted { &inverse * self.sum_of_schur(|i| variances[i]) * &inverse } else { inverse };
        let squares: Vec<(f64, usize)> = self.parts.iter().map(|part| (part.squares, part.used)).collect();
        let (mut factors, mut couplings) = (Vec::new(), Vec::new());
        for part in self.parts {
            couplings.push(if is_fitted { part.coupling } else { Mat::zeros(linear_count(tones), tones) });
            factors.push(part.factor);
        }
        let of_channels = |value: fn(&Channel<'_>) -> f64| self.channels.iter().map(value).collect();
        let fit = SineFit {
            rate: self.rate,
            frequencies: Vec::new(),
            channels: Vec::new(),
            iterations,
            cycles: self.frequencies,
            linear: self.linear,
            centres: of_channels(|channel| centre(channel.samples.len())),
            starts: of_channels(|channel| channel.offset.0),
            covariance: FitCovariance { factors, couplings, variances, frequencies, unit: self.unit },
        };
        Ok(fit.described(self.channels, &squares))
    }
}

impl Eliminated {
    /// Of the normal equations, whose first `linear` columns are the channel's own.
    fn new(normal: &NormalEquations, linear: usize) -> Result<Self, LinalgError> {
        let shared = normal.gram.nrows() - linear;
        let part = |row: usize, column: usize, rows: usize, columns: usize| {
            normal.gram.view((row, column), (rows, columns)).into_owned()
        };
        let factor = PositiveFactor::new(&part(0, 0, linear, linear))?;
        let (b, d) = (part(0, linear, linear, shared), part(linear, linear, shared, shared));
        let own = factor.solve(&normal.projection.rows(0, linear).into_owned());
        let coupling = factor.solve(&b);
        let schur = d - b.transpose() * &coupling;
        let rest = normal.projection.rows(linear, shared) - b.transpose() * &own;
        Ok(Self { factor, own, coupling, schur, rest, squares: normal.squares, used: normal.rows })
    }
}
