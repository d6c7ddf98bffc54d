//! Gauss-Newton for the delay, gain, offset and cut-off of one channel.

use super::LEAST_FRAMES;
use crate::analog::StrictlyProper;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::estimates::covariance;
use crate::calibrate::record::Record;
use crate::linalg::Mat;
use crate::simulate::{Instants, Recording};
use crate::spec::ChannelSpec;
use crate::units::{FastPeriods, Seconds};

/// The waveform counts as periodic; instants closer to its ends than this (fast periods) are left out,
/// because the captures do not see the other end.
const MARGIN: f64 = 32.0;
/// Most Gauss-Newton steps of a channel.
const MOST_STEPS: usize = 40;
/// The iteration ends when a delay moves by less than this share of its standard deviation,
const SMALL_STEP: f64 = 1e-3;
/// or by less than this (fast periods): the rounding of the synthesis.
const ROUNDING: f64 = 1e-12;
/// Half the distance of central differences: their error is a sixth of its square times v''', below 2e-6 of
/// v'.
const DIFFERENCE: f64 = 1e-3;
/// Least share of the power that the waveform explains.
const LEAST_SHARE: f64 = 0.5;
/// A noise whose correlation of neighbours exceeds this many standard deviations is not white.
const NOT_WHITE: f64 = 5.0;

/// One channel's problem.
pub(super) struct ChannelFit<'a> {
    pub(super) channel: usize,
    pub(super) record: &'a Record,
    pub(super) recording: &'a Recording,
    pub(super) front_end: FrontEnd<'a>,
    pub(super) ratio: f64,
    pub(super) frames: usize,
}

/// A front end whose cut-off can be changed.
pub(super) struct FrontEnd<'a> {
    pub(super) written: &'a ChannelSpec,
    pub(super) fast_period: Seconds,
}

/// The values of one channel: D + L, g, o, ln c, in this order of columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
    pub(super) delay: f64,
    pub(super) gain: f64,
    pub(super) offset: f64,
    pub(super) ln_cutoff: f64,
}

/// Values, covariance and noise.
pub(super) struct Solved {
    pub(super) values: Values,
    pub(super) covariance: Mat,
    /// Standard deviation of the noise over that of white noise of the same power, 1 or more.
    pub(super) colour: f64,
    pub(super) frames: usize,
}

impl FrontEnd<'_> {
    /// Phi(j w / c): the filter of a fast period that is c times as long.
    fn with_cutoff(&self, channel: usize, ln_cutoff: f64) -> Result<StrictlyProper, CalibrateError> {
        let h = Seconds(self.fast_period.0 * ln_cutoff.exp());
        StrictlyProper::new(&self.written.filter, h)
            .map_err(|source| CalibrateError::Analog { channel: channel + 1, source: Box::new(source) })
    }
}

impl ChannelFit<'_> {
    /// Gauss-Newton from a delay and a gain.
    pub(super) fn solve(&self, delay: f64, gain: f64, cutoff: bool) -> Result<Solved, CalibrateError> {
        let mut values = Values { delay, gain, offset: 0.0, ln_cutoff: 0.0 };
        let mut is_started = false;
        for _ in 0..MOST_STEPS {
            let columns = self.columns(&values, cutoff)?;
            let kept = self.covered(values.delay);
            let needed = LEAST_FRAMES;
            if kept.len() < needed {
                return Err(CalibrateError::ShortOverlap { frames: kept.len(), needed });
            }
            if !is_started {
                // Gain and offset first: the derivative by the delay contains the gain.
                (values.gain, values.offset) = self.linear(&columns[1], &kept);
                is_started = true;
                continue;
            }
            let step = self.step(&columns, &kept, &values)?;
            let clamped = step.delta[0].clamp(-1.0, 1.0);
            values.delay += clamped;
            values.gain += step.delta[1];
            values.offset += step.delta[2];
            values.ln_cutoff += step.delta.get(3).copied().unwrap_or(0.0);
            let sigma = step.covariance[(0, 0)].sqrt();
            if clamped.abs() < (SMALL_STEP * sigma).max(ROUNDING) {
                self.check_share(&step)?;
                let (covariance, colour, frames) = (step.covariance, step.colour, kept.len());
                return Ok(Solved { values, covariance, colour, frames });
            }
        }
        Err(CalibrateError::NoConvergence { steps: MOST_STEPS })
    }

    /// The frames whose instants the waveform covers.
    fn covered(&self, delay: f64) -> Vec<usize> {
        let end = self.recording.duration().0 - MARGIN;
        let instant = |k: usize| k as f64 * self.ratio - delay;
        (0..self.frames).filter(|&k| self.record.keep[k] && (MARGIN..end).contains(&instant(k))).collect()
    }

    fn sampled(&self, filter: &StrictlyProper, delay: f64) -> Vec<f64> {
        let instants =
            Instants { first: FastPeriods(-delay), step: FastPeriods(self.ratio), count: self.frames };
        self.recording.sample(filter, instants)
    }

    /// Derivatives by delay, gain, offset and ln c; the first and the last are still to be multiplied by the
    /// gain.
    fn columns(&self, values: &Values, cutoff: bool) -> Result<Vec<Vec<f64>>, CalibrateError> {
        let filter = self.front_end.with_cutoff(self.channel, values.ln_cutoff)?;
        let difference = |late: Vec<f64>, early: Vec<f64>| -> Vec<f64> {
            late.iter().zip(&early).map(|(a, b)| (a - b) / (2.0 * DIFFERENCE)).collect()
        };
        let at = |step: f64| self.sampled(&filter, values.delay + step);
        let mut columns = vec![difference(at(DIFFERENCE), at(-DIFFERENCE)), at(0.0), vec![1.0; self.frames]];
        if cutoff {
            let at = |step: f64| -> Result<Vec<f64>, CalibrateError> {
                let filter = self.front_end.with_cutoff(self.channel, values.ln_cutoff + step)?;
                Ok(self.sampled(&filter, values.delay))
            };
            columns.push(difference(at(DIFFERENCE)?, at(-DIFFERENCE)?));
        }
        Ok(columns)
    }

    /// Gain and offset at a fixed delay.
    fn linear(&self, v: &[f64], kept: &[usize]) -> (f64, f64) {
        let n = kept.len() as f64;
        let x = &self.record.samples;
        let (mean_v, mean_x) =
            (kept.iter().map(|&k| v[k]).sum::<f64>() / n, kept.iter().map(|&k| x[k]).sum::<f64>() / n);
        let (mut product, mut square) = (0.0, 0.0);
        for &k in kept {
            product += (v[k] - mean_v) * (x[k] - mean_x);
            square += (v[k] - mean_v).powi(2);
        }
        let gain = if square > 0.0 { product / square } else { 0.0 };
        (gain, mean_x - gain * mean_v)
    }

    fn step(&self, columns: &[Vec<f64>], kept: &[usize], values: &Values) -> Result<Step, CalibrateError> {
        let (n, gain) = (columns.len(), values.gain);
        let scale = |c: usize| if c == 0 || c == 3 { gain } else { 1.0 };
        let (mut gram, mut projection) = (Mat::zeros(n, n), Mat::zeros(n, 1));
        let mut rest = Vec::with_capacity(kept.len());
        let mut row = vec![0.0; n];
        for &k in kept {
            let left = self.record.samples[k] - gain * columns[1][k] - values.offset;
            rest.push(left);
            (0..n).for_each(|c| row[c] = scale(c) * columns[c][k]);
            for i in 0..n {
                projection[(i, 0)] += row[i] * left;
                (0..n).for_each(|j| gram[(i, j)] += row[i] * row[j]);
            }
        }
        let inverse = covariance(&gram).ok_or(CalibrateError::NotIdentifiable)?;
        let delta = &inverse * projection;
        let squares: f64 = rest.iter().map(|r| r * r).sum();
        let variance = squares / (kept.len() - n) as f64;
        let power = kept.iter().map(|&k| (self.record.samples[k] - values.offset).powi(2)).sum::<f64>();
        let colour = colour(&rest);
        Ok(Step {
            delta: delta.iter().copied().collect(),
            covariance: inverse * variance,
            colour,
            share: 1.0 - squares / power,
        })
    }

    fn check_share(&self, step: &Step) -> Result<(), CalibrateError> {
        if step.share >= LEAST_SHARE {
            return Ok(());
        }
        Err(CalibrateError::NotTheWaveform {
            channel: self.channel + 1,
            percent: 100.0 * step.share.max(0.0),
        })
    }
}

/// One Gauss-Newton step.
struct Step {
    delta: Vec<f64>,
    covariance: Mat,
    colour: f64,
    /// Share of the power that is explained.
    share: f64,
}

/// By how much noise with the correlation of `rest` raises a standard deviation over that of white noise:
/// the square root of 1 + 2 sum of its correlations up to the first that is not significant; 1 for white
/// noise.
pub(super) fn colour(rest: &[f64]) -> f64 {
    let square: f64 = rest.iter().map(|r| r * r).sum();
    if square.is_nan() || square <= 0.0 {
        return 1.0;
    }
    let significant = NOT_WHITE / (rest.len() as f64).sqrt();
    let correlation = |lag: usize| rest.iter().zip(&rest[lag..]).map(|(a, b)| a * b).sum::<f64>() / square;
    let sizes = (1..rest.len().min(256)).map(|lag| correlation(lag).abs());
    let sum: f64 = sizes.take_while(|size| *size > significant).sum();
    (1.0 + 2.0 * sum).sqrt()
}
