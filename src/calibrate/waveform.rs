//! Delays, gains, offsets and cut-offs from a known waveform.
//!
//! With v_i = phi_i * f computed from the waveform's samples, least squares fits
//!
//! ```text
//! x_i[k] = g_i v_i(k M - D_i - L) + o_i + noise
//! ```
//!
//! to each channel. The lag L between waveform and captures is common; it is found by correlation and drops
//! out of the delays relative to the reference. With the derivative v' freed from its parts along 1 and v,
//! var(D_i) = s^2 / (g^2 sum v'^2).

use super::CalibrationSettings;
use super::error::CalibrateError;
use super::estimates::{Fitted, WORST_CONDITION};
use super::fit::ChannelParameter;
use super::model::{ChannelModel, ChannelValues};
use super::record::Record;
use super::warning::CalibrationWarning;
use crate::linalg::least_squares::{LeastSquares, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::{Mat, fourier};
use crate::simulate::{Instants, Periodic};
use crate::sine_fit::{Channel, Estimate};
use crate::units::{FastPeriods, RadiansPerFastPeriod};

/// Least samples of a waveform, and least frames that it covers.
const LEAST_SAMPLES: usize = 64;
const LEAST_FRAMES: usize = 64;
/// Lags per fast period that are correlated.
const LAGS_PER_PERIOD: usize = 2;
/// The waveform counts as periodic; instants closer to its ends than this (fast periods) are left out,
/// because the captures do not see the other end.
const END_MARGIN: f64 = 32.0;
/// The iteration ends when a delay or a cut-off moves by less than this share of its standard deviation,
const SMALL_STEP: f64 = 1e-3;
/// or by less than this (fast periods): the rounding of the synthesis.
const SYNTHESIS_ROUNDING: f64 = 1e-12;
/// Half the distance of central differences: their error is a sixth of its square times v''', below 2e-6 of
/// v'.
const HALF_DIFFERENCE: f64 = 1e-3;
/// Least share of the power that the waveform explains.
const LEAST_SHARE: f64 = 0.5;
/// A noise whose correlation of neighbours exceeds this many standard deviations is not white.
const NOT_WHITE: f64 = 5.0;
/// Lags of the noise whose correlation is looked at.
const MOST_NOISE_LAGS: usize = 256;

/// A known waveform, and the captures that hold it.
pub(super) struct Training<'a> {
    model: &'a ChannelModel,
    records: &'a [Record],
    settings: CalibrationSettings,
    recording: Periodic,
}

impl<'a> Training<'a> {
    pub(super) fn new(
        model: &'a ChannelModel,
        records: &'a [Record],
        samples: &[f64],
        spacing: FastPeriods,
        settings: CalibrationSettings,
    ) -> Result<Self, CalibrateError> {
        let is_usable = samples.len() >= LEAST_SAMPLES && samples.iter().all(|x| x.is_finite());
        if !(is_usable && spacing.0 > 0.0 && spacing.0.is_finite()) {
            return Err(CalibrateError::Waveform { samples: samples.len(), spacing });
        }
        Ok(Self { model, records, settings, recording: Periodic::new(samples, spacing) })
    }

    /// Calibrates. The reference comes first: its lag is the best start for the others.
    pub(super) fn fit(&self) -> Result<Fitted, CalibrateError> {
        let reference = self.settings.reference;
        let first = self.solve_from(reference, self.lag_of(reference)?)?;
        let lag = first.values[0] - self.model.delays[reference];
        let solve = |i| {
            if i == reference {
                return Ok(first.clone());
            }
            self.solve_from(i, lag).or_else(|refused| {
                // A capture of another channel begins elsewhere: its own correlation finds it.
                self.solve_from(i, self.lag_of(i)?).map_err(|_| refused)
            })
        };
        let solved = (0..self.model.channels()).map(solve).collect::<Result<Vec<_>, _>>()?;
        Ok(self.relative(&solved))
    }

    /// L to half a lag: the largest correlation of a capture with the waveform.
    fn lag_of(&self, i: usize) -> Result<f64, CalibrateError> {
        let (record, ratio) = (&self.records[i], self.model.ratio as f64);
        let covered = (self.recording.duration().0 / ratio).floor() as usize;
        let frames = record.samples.len().min(covered);
        if frames < LEAST_FRAMES {
            return Err(CalibrateError::ShortOverlap { frames, needed: LEAST_FRAMES });
        }
        let capture = record.channel().deviations();
        let (mut lag, mut highest) = (0.0, 0.0);
        for q in 0..LAGS_PER_PERIOD * self.model.ratio {
            let part = q as f64 / LAGS_PER_PERIOD as f64;
            let first = FastPeriods(-self.model.delays[i] - part);
            let instants = Instants { first, step: FastPeriods(ratio), count: covered };
            let template = self.recording.sample(&self.model.front_ends[i], instants);
            let sums = fourier::cross_correlation(&capture, &Channel::new(&template).deviations());
            for (n, height) in sums.iter().map(|sum| sum.abs()).enumerate() {
                if height > highest {
                    // Shifts above those of the capture are negative ones.
                    let shift = n as f64 - if n < capture.len() { 0.0 } else { sums.len() as f64 };
                    (lag, highest) = (part + ratio * shift, height);
                }
            }
        }
        Ok(lag)
    }

    fn solve_from(&self, i: usize, lag: f64) -> Result<Solved, CalibrateError> {
        ChannelFit {
            channel: i,
            record: &self.records[i],
            recording: &self.recording,
            model: self.model,
            ratio: self.model.ratio as f64,
            values: [lag + self.model.delays[i], self.model.gains[i], 0.0, 0.0],
            // The reference has the cut-off of the spec.
            parameters: if self.settings.fit.cutoff.is_some() && i != self.settings.reference {
                4
            } else {
                3
            },
            rest: Vec::new(),
            power: 0.0,
            noise: 0.0,
        }
        .solve()
    }

    /// The values relative to the reference, with the errors of both.
    fn relative(&self, solved: &[Solved]) -> Fitted {
        let Self { model, settings: CalibrationSettings { fit, reference }, .. } = *self;
        let point = ChannelValues::nominal(model, fit, reference);
        let first = &solved[reference];
        let variance =
            |solved: &Solved, k: usize| solved.covariance[(k, k)] * solved.correlation_factor.powi(2);
        let both = |own: &Solved, k: usize, scale: fn(&Solved) -> f64| {
            variance(own, k) / scale(own).powi(2) + variance(first, k) / scale(first).powi(2)
        };
        let (mut steps, count) = (Vec::new(), point.parameters.len());
        let mut covariance = Mat::zeros(count, count);
        for (k, parameter) in point.parameters.iter().enumerate() {
            let (i, own) = (parameter.channel, &solved[parameter.channel]);
            let (step, variance) = match parameter.kind {
                ChannelParameter::Delay => {
                    let nominal = model.delays[i] - model.delays[reference];
                    (own.values[0] - first.values[0] - nominal, both(own, 0, |_| 1.0))
                }
                ChannelParameter::Gain => {
                    let scale = first.values[1] / model.gains[reference];
                    let relative = own.values[1] / scale / model.gains[i];
                    (relative.abs().ln(), both(own, 1, |solved| solved.values[1]))
                }
                ChannelParameter::Cutoff => (own.values[3], variance(own, 3)),
            };
            steps.push(step);
            covariance[(k, k)] = variance;
        }
        let frames = solved.iter().map(|solved| solved.frames).min().unwrap_or(0);
        let mut fitted = Fitted::new(point, covariance, frames);
        fitted.point.advance(&steps);
        if fit.offset {
            let offset = |s: &Solved| Estimate { value: s.values[2], sigma: variance(s, 2).sqrt() };
            fitted.offsets = Some(solved.iter().map(offset).collect());
        }
        let factors = solved.iter().map(|solved| solved.correlation_factor).enumerate();
        let warning = |(i, misfit)| CalibrationWarning::ResidualNotWhite { channel: i + 1, misfit };
        fitted.warnings.extend(factors.filter(|(_, factor)| *factor > 1.0).map(warning));
        fitted
    }
}

/// One channel's problem at the present values.
struct ChannelFit<'a> {
    channel: usize,
    record: &'a Record,
    recording: &'a Periodic,
    model: &'a ChannelModel,
    ratio: f64,
    /// D + L, g, o, ln c.
    values: [f64; 4],
    /// The first so many are fitted.
    parameters: usize,
    /// What the values leave of the samples.
    rest: Vec<f64>,
    /// Sum of the squares of the samples without offset.
    power: f64,
    /// Standard deviation of the rest.
    noise: f64,
}

/// Values, covariance and noise.
#[derive(Clone)]
struct Solved {
    values: [f64; 4],
    covariance: Mat,
    /// Standard deviation of the noise over that of white noise of the same power, 1 or more.
    correlation_factor: f64,
    frames: usize,
}

impl LeastSquares for ChannelFit<'_> {
    type Error = CalibrateError;
    const MOST_STEPS: usize = 40;
    const WORST_CONDITION: f64 = WORST_CONDITION;

    fn equations(&mut self) -> Result<NormalEquations, CalibrateError> {
        let (columns, kept, [_, gain, offset, _]) = (self.columns(), self.covered()?, self.values);
        let mut equations = NormalEquations::new(self.parameters);
        self.rest.clear();
        for &k in &kept {
            // The derivatives by delay and cut-off are those of the waveform with the gain.
            let row = [gain * columns[0][k], columns[1][k], 1.0, columns.get(2).map_or(0.0, |c| gain * c[k])];
            let left = self.record.samples[k] - gain * columns[1][k] - offset;
            equations.add(&row[..self.parameters], left);
            self.rest.push(left);
        }
        self.power = kept.iter().map(|&k| (self.record.samples[k] - offset).powi(2)).sum();
        self.noise = equations.variance().sqrt();
        Ok(equations)
    }

    fn advance(&mut self, step: &[f64]) -> bool {
        self.values.iter_mut().zip(step).for_each(|(value, step)| *value += step);
        true
    }

    /// Gain and offset follow from the others.
    fn limits(&self, k: usize, sigma: f64) -> StepLimits {
        let negligible = (SMALL_STEP * sigma * self.noise).max(SYNTHESIS_ROUNDING);
        match k {
            0 => StepLimits { largest: 1.0, negligible },
            3 => StepLimits { largest: f64::INFINITY, negligible },
            _ => StepLimits { largest: f64::INFINITY, negligible: f64::INFINITY },
        }
    }

    fn error(&self, why: NoMinimum) -> CalibrateError {
        why.into()
    }
}

impl ChannelFit<'_> {
    fn solve(mut self) -> Result<Solved, CalibrateError> {
        // Gain and offset first: the derivative by the delay contains the gain.
        let (waveform, mut linear) = (self.sampled(0.0, 0.0), NormalEquations::new(2));
        self.covered()?.iter().for_each(|&k| linear.add(&[waveform[k], 1.0], self.record.samples[k]));
        let start = linear.solve()?;
        (self.values[1], self.values[2]) = (start[0], start[1]);
        let found = minimise(&mut self)?;
        let share = 1.0 - found.equations.squares / self.power;
        if share < LEAST_SHARE {
            let percent = 100.0 * share.max(0.0);
            return Err(CalibrateError::NotTheWaveform { channel: self.channel + 1, percent });
        }
        Ok(Solved {
            values: self.values,
            covariance: found.inverse * found.equations.variance(),
            correlation_factor: correlation_factor(&self.rest),
            frames: self.rest.len(),
        })
    }

    /// The frames whose instants the waveform covers.
    fn covered(&self) -> Result<Vec<usize>, CalibrateError> {
        let inside = END_MARGIN..self.recording.duration().0 - END_MARGIN;
        let instant = |k: usize| k as f64 * self.ratio - self.values[0];
        let all = 0..self.record.samples.len();
        let kept: Vec<usize> = all.filter(|&k| self.record.keep[k] && inside.contains(&instant(k))).collect();
        match kept.len() {
            frames @ ..LEAST_FRAMES => Err(CalibrateError::ShortOverlap { frames, needed: LEAST_FRAMES }),
            _ => Ok(kept),
        }
    }

    /// v at the present values plus steps of the delay and of ln c.
    fn sampled(&self, delay: f64, ln_cutoff: f64) -> Vec<f64> {
        let response =
            |w: RadiansPerFastPeriod| self.model.response(self.channel, w.0, self.values[3] + ln_cutoff);
        let first = FastPeriods(-(self.values[0] + delay));
        let instants = Instants { first, step: FastPeriods(self.ratio), count: self.record.samples.len() };
        self.recording.sample_through(response, instants)
    }

    /// v' by the delay, v and, if the cut-off is fitted, v' by ln c.
    fn columns(&self) -> Vec<Vec<f64>> {
        let difference = |above: Vec<f64>, below: Vec<f64>| -> Vec<f64> {
            above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * HALF_DIFFERENCE)).collect()
        };
        let by_delay = difference(self.sampled(HALF_DIFFERENCE, 0.0), self.sampled(-HALF_DIFFERENCE, 0.0));
        let mut columns = vec![by_delay, self.sampled(0.0, 0.0)];
        if self.parameters == 4 {
            columns.push(difference(self.sampled(0.0, HALF_DIFFERENCE), self.sampled(0.0, -HALF_DIFFERENCE)));
        }
        columns
    }
}

/// By how much noise with the correlation of `rest` raises a standard deviation over that of white noise:
/// the square root of 1 + 2 sum of its correlations up to the first that is not significant; 1 for white
/// noise.
fn correlation_factor(rest: &[f64]) -> f64 {
    let square: f64 = rest.iter().map(|r| r * r).sum();
    if square.is_nan() || square <= 0.0 {
        return 1.0;
    }
    let significant = NOT_WHITE / (rest.len() as f64).sqrt();
    let correlation = |lag: usize| rest.iter().zip(&rest[lag..]).map(|(a, b)| a * b).sum::<f64>() / square;
    let sizes = (1..rest.len().min(MOST_NOISE_LAGS)).map(|lag| correlation(lag).abs());
    let sum: f64 = sizes.take_while(|size| *size > significant).sum();
    (1.0 + 2.0 * sum).sqrt()
}

#[cfg(test)]
mod tests;
