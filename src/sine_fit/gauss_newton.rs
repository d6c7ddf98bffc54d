//! The iteration: linearise, solve, update.

use super::columns::Oscillator;
use super::normal::{Normal, Point, centre, linear_count};
use super::result::{Covariance, SineFit};
use super::{Channel, SineFitError, alias, distance_to_edge};
use crate::linalg::{LinalgError, Mat, PositiveFactor};
use crate::units::Hertz;
use std::f64::consts::PI;

/// Most Gauss-Newton steps; a start within half a cycle per record takes three to six.
const MOST_STEPS: usize = 40;
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
    let mut state = State::new(channels, rate, tones)?;
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
    let mut state = State::new(channels, rate, tones)?;
    state.solve_linear()?;
    for step in 1..=MOST_STEPS {
        let movement = state.solve()?;
        state.check_movement(tones, step)?;
        if movement < state.tolerance() {
            state.solve_linear()?;
            state.check_frequencies()?;
            return state.finish(step);
        }
    }
    Err(SineFitError::NoConvergence { frequency: tones[0], iterations: MOST_STEPS })
}

/// The present parameters.
struct State<'a> {
    channels: &'a [Channel<'a>],
    rate: Hertz,
    /// Cycles per sample.
    frequencies: Vec<f64>,
    /// Coefficients of 1, cosines and sines of each channel, phases at the centre of its record.
    linear: Vec<Vec<f64>>,
    /// Half the length of the longest record, the unit of time of the derivatives.
    unit: f64,
    is_known: bool,
}

/// A channel's part of the solution: G = its Gram matrix without derivatives, with B = its Gram matrix with
/// them.
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

impl<'a> State<'a> {
    fn new(channels: &'a [Channel<'a>], rate: Hertz, tones: &[Hertz]) -> Result<Self, SineFitError> {
        if channels.is_empty() || tones.is_empty() || !(rate.0 > 0.0 && rate.0.is_finite()) {
            return Err(SineFitError::Nothing { channels: channels.len(), tones: tones.len(), rate });
        }
        let longest = channels.iter().map(|channel| channel.samples.len()).max().unwrap_or(0);
        let linear = vec![vec![0.0; linear_count(tones.len())]; channels.len()];
        let frequencies = tones.iter().map(|tone| *tone / rate).collect();
        let unit = 0.5 * longest as f64;
        let state = Self { channels, rate, frequencies, linear, unit, is_known: true };
        state.check_samples()?;
        state.check_frequencies()?;
        Ok(state)
    }

    /// [`PHASE_TOLERANCE`], but no less than what the rounding of the frequencies moves.
    fn tolerance(&self) -> f64 {
        let largest = self.frequencies.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
        PHASE_TOLERANCE + 4.0 * f64::EPSILON * 2.0 * PI * self.unit * largest
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

    /// One pass over all samples.
    fn eliminate(&self) -> Result<Vec<Eliminated>, SineFitError> {
        let oscillators: Vec<_> = self.frequencies.iter().map(|&f| Oscillator::new(f)).collect();
        let unit = (!self.is_known).then_some(self.unit);
        let channel = |(channel, linear): (&Channel<'_>, &Vec<f64>)| {
            let normal = Normal::accumulate(channel, &Point { oscillators: &oscillators, linear, unit });
            Eliminated::new(&normal, linear.len()).map_err(|error| match error {
                LinalgError::NotPositiveDefinite { pivot } => self.dependent(pivot / 2),
                _ => self.dependent(0),
            })
        };
        self.channels.iter().zip(&self.linear).map(channel).collect()
    }

    /// The least-squares coefficients at the present frequencies.
    fn solve_linear(&mut self) -> Result<(), SineFitError> {
        self.is_known = true;
        let parts = self.eliminate()?;
        for (linear, part) in self.linear.iter_mut().zip(&parts) {
            linear.iter_mut().zip(part.own.iter()).for_each(|(x, dx)| *x += dx);
        }
        Ok(())
    }

    /// One Gauss-Newton step of all parameters; returns the largest movement of a frequency, in radians at
    /// the ends of the longest record.
    fn solve(&mut self) -> Result<f64, SineFitError> {
        self.is_known = false;
        let parts = self.eliminate()?;
        let rest = parts.iter().fold(Mat::zeros(self.frequencies.len(), 1), |sum, part| sum + &part.rest);
        let step = self.inverse_schur(&parts, None)? * rest;
        let largest = step.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let factor = if largest > LARGEST_STEP { LARGEST_STEP / largest } else { 1.0 };
        let step = step * factor;
        for (linear, part) in self.linear.iter_mut().zip(&parts) {
            let change = &part.own - &part.coupling * &step;
            linear.iter_mut().zip(change.iter()).for_each(|(x, dx)| *x += dx);
        }
        for (f, change) in self.frequencies.iter_mut().zip(step.iter()) {
            *f += change / (2.0 * PI * self.unit);
        }
        Ok(largest)
    }

    /// The inverse of the sum of the Schur complements, S; with `variances` of the channels' noise
    /// S^-1 (sum of variance_i S_i) S^-1, the covariance of the frequencies.
    ///
    /// Rows and columns are scaled to a unit diagonal, since the amplitudes of tones may differ by decades.
    fn inverse_schur(&self, parts: &[Eliminated], variances: Option<&[f64]>) -> Result<Mat, SineFitError> {
        let tones = self.frequencies.len();
        let sum = |weight: &dyn Fn(usize) -> f64| {
            let terms = parts.iter().enumerate().map(|(i, part)| &part.schur * weight(i));
            terms.fold(Mat::zeros(tones, tones), |sum, term| sum + term)
        };
        let whole = sum(&|_| 1.0);
        let scale: Vec<f64> = (0..tones).map(|k| whole[(k, k)].sqrt().recip()).collect();
        if let Some(k) = scale.iter().position(|s| !s.is_finite()) {
            return Err(SineFitError::NoTone { near: Some(self.tone(k)) });
        }
        let scaled = Mat::from_fn(tones, tones, |i, j| whole[(i, j)] * scale[i] * scale[j]);
        let factor = PositiveFactor::new(&scaled).map_err(|_| self.dependent(tones - 1))?;
        let unit = factor.solve(&Mat::identity(tones, tones));
        let inverse = Mat::from_fn(tones, tones, |i, j| unit[(i, j)] * scale[i] * scale[j]);
        Ok(match variances {
            None => inverse,
            Some(variances) => &inverse * sum(&|i| variances[i]) * &inverse,
        })
    }

    fn check_movement(&self, tones: &[Hertz], iterations: usize) -> Result<(), SineFitError> {
        for (f, tone) in self.frequencies.iter().zip(tones) {
            let moved = 2.0 * PI * self.unit * (f - *tone / self.rate);
            if moved.is_nan() || moved.abs() > FARTHEST {
                return Err(SineFitError::NoConvergence { frequency: *tone, iterations });
            }
        }
        Ok(())
    }

    /// A last pass for the residual and the covariance.
    fn finish(mut self, iterations: usize) -> Result<SineFit, SineFitError> {
        let is_fitted = iterations > 0;
        self.is_known = !is_fitted;
        let parts = self.eliminate()?;
        let tones = self.frequencies.len();
        // Each channel carries its share of the common frequencies.
        let shared = if is_fitted { tones as f64 / self.channels.len() as f64 } else { 0.0 };
        let variance = |part: &Eliminated| {
            part.squares / (part.used as f64 - linear_count(tones) as f64 - shared).max(1.0)
        };
        let variances: Vec<f64> = parts.iter().map(variance).collect();
        let frequencies = match is_fitted {
            true => self.inverse_schur(&parts, Some(&variances))?,
            false => Mat::zeros(tones, tones),
        };
        let squares: Vec<(f64, usize)> = parts.iter().map(|part| (part.squares, part.used)).collect();
        let coupling = |part: &Eliminated| match is_fitted {
            true => part.coupling.clone(),
            false => Mat::zeros(linear_count(tones), tones),
        };
        let covariance = Covariance {
            couplings: parts.iter().map(coupling).collect(),
            factors: parts.into_iter().map(|part| part.factor).collect(),
            variances,
            frequencies,
            unit: self.unit,
        };
        let centres = self.channels.iter().map(|channel| centre(channel.samples.len())).collect();
        let offsets = self.channels.iter().map(|channel| channel.offset).collect();
        let lengths = self.channels.iter().map(|channel| channel.samples.len()).collect();
        Ok(SineFit::assemble(super::result::Parts {
            rate: self.rate,
            cycles: self.frequencies,
            linear: self.linear,
            squares,
            lengths,
            centres,
            offsets,
            covariance,
            iterations,
        }))
    }
}

impl Eliminated {
    /// Of the normal equations, whose first `linear` columns are the channel's own.
    fn new(normal: &Normal, linear: usize) -> Result<Self, LinalgError> {
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
        Ok(Self { factor, own, coupling, schur, rest, squares: normal.squares, used: normal.used })
    }
}
