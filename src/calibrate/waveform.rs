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

use super::error::CalibrateError;
use super::estimates::{Fitted, covariance};
use super::model::Model;
use super::parameters::{Kind, Point};
use super::record::Record;
use super::remark::Remark;
use super::settings::Settings;
use crate::analog::StrictlyProper;
use crate::linalg::{Complex, Mat, fourier};
use crate::simulate::{Instants, Recording};
use crate::spec::ChannelSpec;
use crate::units::{FastPeriods, Seconds};

/// The waveform counts as periodic; instants closer to its ends than this (fast periods) are left out,
/// because the captures do not see the other end.
const MARGIN: f64 = 32.0;
/// Least samples of a waveform, and least frames that it covers.
const LEAST_SAMPLES: usize = 64;
const LEAST_FRAMES: usize = 64;
/// Lags per fast period that are correlated.
const LAGS_PER_PERIOD: usize = 2;
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

/// The samples of a known waveform.
#[derive(Debug, Clone, Copy)]
pub(super) struct Training<'a> {
    pub(super) samples: &'a [f64],
    pub(super) spacing: FastPeriods,
}

/// One channel's problem.
struct ChannelFit<'a> {
    channel: usize,
    record: &'a Record,
    recording: &'a Recording,
    front_end: FrontEnd<'a>,
    ratio: f64,
    frames: usize,
}

/// A front end whose cut-off can be changed.
struct FrontEnd<'a> {
    written: &'a ChannelSpec,
    fast_period: Seconds,
}

/// The values of one channel: D + L, g, o, ln c, in this order of columns.
#[derive(Debug, Clone, Copy)]
struct Values {
    delay: f64,
    gain: f64,
    offset: f64,
    ln_cutoff: f64,
}

/// Values, covariance and noise.
struct Solved {
    values: Values,
    covariance: Mat,
    /// Standard deviation of the noise over that of white noise of the same power, 1 or more.
    colour: f64,
    frames: usize,
}

/// Calibrates from a known waveform.
pub(super) fn fit(
    model: &Model,
    written: &[ChannelSpec],
    records: &[Record],
    training: Training<'_>,
    settings: Settings,
) -> Result<Fitted, CalibrateError> {
    let Training { samples, spacing } = training;
    let is_usable = samples.len() >= LEAST_SAMPLES && samples.iter().all(|x| x.is_finite());
    if !(is_usable && spacing.0 > 0.0 && spacing.0.is_finite()) {
        return Err(CalibrateError::Waveform { samples: samples.len(), spacing });
    }
    let recording = Recording::new(samples, spacing);
    let reference = settings.reference;
    let lag = lag_of(model, &records[reference], &recording, reference)?;
    let mut solved = Vec::with_capacity(records.len());
    // The reference has the cut-off of the spec.
    let order = std::iter::once(reference).chain((0..records.len()).filter(|&i| i != reference));
    for i in order {
        let front_end = FrontEnd { written: &written[i], fast_period: model.fast_period };
        let frames = records[i].samples.len();
        let channel = ChannelFit {
            channel: i,
            record: &records[i],
            recording: &recording,
            front_end,
            ratio: model.ratio as f64,
            frames,
        };
        let cutoff = settings.fit.cutoff && i != reference;
        // The reference's lag is the best start for the others.
        let known = solved
            .first()
            .map_or(lag, |(_, first): &(usize, Solved)| first.values.delay - model.delays[reference].0);
        let start = |lag: f64| channel.solve(lag + model.delays[i].0, model.gains[i], cutoff);
        // A capture of another channel begins elsewhere: its own correlation finds it.
        let found = match start(known) {
            Err(refused) if i != reference => {
                start(lag_of(model, &records[i], &recording, i)?).map_err(|_| refused)?
            }
            other => other?,
        };
        solved.push((i, found));
    }
    solved.sort_by_key(|&(i, _)| i);
    let solved: Vec<Solved> = solved.into_iter().map(|(_, solved)| solved).collect();
    Ok(relative(model, &solved, settings))
}

/// The values relative to the reference, with the errors of both.
fn relative(model: &Model, solved: &[Solved], settings: Settings) -> Fitted {
    let Settings { fit, reference } = settings;
    let mut point = Point::nominal(model, fit, reference);
    let first = &solved[reference];
    let gain_scale = first.values.gain / model.gains[reference];
    let count = point.parameters.len();
    let mut covariance = Mat::zeros(count, count);
    let variance =
        |solved: &Solved, column: usize| solved.covariance[(column, column)] * solved.colour.powi(2);
    let mut steps = vec![0.0; count];
    for (k, parameter) in point.parameters.iter().enumerate() {
        let own = &solved[parameter.channel];
        let nominal = model.delays[parameter.channel].0 - model.delays[reference].0;
        let gain = |solved: &Solved| variance(solved, 1) / solved.values.gain.powi(2);
        let (step, squares) = match parameter.kind {
            Kind::Delay => {
                (own.values.delay - first.values.delay - nominal, variance(own, 0) + variance(first, 0))
            }
            Kind::Gain => {
                let relative = own.values.gain / gain_scale / model.gains[parameter.channel];
                (relative.abs().ln(), gain(own) + gain(first))
            }
            Kind::Cutoff => (own.values.ln_cutoff, variance(own, 3)),
        };
        steps[k] = step;
        covariance[(k, k)] = squares;
    }
    point.advance(steps.into_iter());
    let mut fitted = Fitted::new(point, covariance);
    if fit.offset {
        let offset = |solved: &Solved| (solved.values.offset, variance(solved, 2).sqrt());
        fitted.offsets = Some(solved.iter().map(offset).collect());
    }
    fitted.frames = solved.iter().map(|solved| solved.frames).min().unwrap_or(0);
    let coloured = solved.iter().enumerate().filter(|(_, solved)| solved.colour > 1.0);
    let remark =
        |(i, solved): (usize, &Solved)| Remark::ResidualNotWhite { channel: i + 1, misfit: solved.colour };
    fitted.remarks.extend(coloured.map(remark));
    fitted
}

/// L to half a lag: the largest correlation of a capture with the waveform.
fn lag_of(model: &Model, record: &Record, recording: &Recording, i: usize) -> Result<f64, CalibrateError> {
    let ratio = model.ratio as f64;
    let frames = record.samples.len();
    let covered = (recording.duration().0 / ratio).floor() as usize;
    if frames.min(covered) < LEAST_FRAMES {
        return Err(CalibrateError::ShortOverlap { frames: frames.min(covered), needed: LEAST_FRAMES });
    }
    let capture: Vec<f64> = centred(&record.samples, &record.keep);
    let count = LAGS_PER_PERIOD * model.ratio;
    let mut best = (0.0, 0.0);
    for q in 0..count {
        let part = q as f64 / LAGS_PER_PERIOD as f64;
        let first = FastPeriods(-model.delays[i].0 - part);
        let instants = Instants { first, step: FastPeriods(ratio), count: covered };
        let template = recording.sample(&model.front_ends[i], instants);
        let (shift, height) = largest_correlation(&capture, &centred(&template, &vec![true; covered]));
        if height > best.1 {
            best = (part + ratio * shift, height);
        }
    }
    Ok(best.0)
}

/// Deviations from the mean, 0 where a sample is left out.
fn centred(samples: &[f64], keep: &[bool]) -> Vec<f64> {
    let kept = || samples.iter().zip(keep).filter(|(_, keep)| **keep).map(|(x, _)| *x);
    let mean = kept().sum::<f64>() / kept().count().max(1) as f64;
    samples.iter().zip(keep).map(|(x, &keep)| if keep { x - mean } else { 0.0 }).collect()
}

/// The shift s of the largest |sum_k x[k] y[k - s]|, and that sum.
fn largest_correlation(x: &[f64], y: &[f64]) -> (f64, f64) {
    let size = (x.len() + y.len()).next_power_of_two();
    let padded = |samples: &mut dyn Iterator<Item = f64>| {
        let mut list: Vec<Complex<f64>> = samples.map(Complex::from).collect();
        list.resize(size, Complex::ZERO);
        list
    };
    let sums =
        fourier::circular_convolution(padded(&mut x.iter().copied()), padded(&mut y.iter().rev().copied()));
    let largest = sums.iter().enumerate().max_by(|a, b| a.1.re.abs().total_cmp(&b.1.re.abs()));
    largest.map_or((0.0, 0.0), |(n, sum)| (n as f64 - (y.len() - 1) as f64, sum.re.abs()))
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
    fn solve(&self, delay: f64, gain: f64, cutoff: bool) -> Result<Solved, CalibrateError> {
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
fn colour(rest: &[f64]) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::super::testbench::{
        assert_covers, errors, gaussian, interleaved, random_errors, trials, with_errors,
    };
    use super::super::{Calibration, Evidence, Fit, calibrate};
    use super::*;
    use crate::random::Random;
    use crate::spec::Spec;

    /// A noise that fills the band up to half the fast rate and beyond, at 1.5 times that rate.
    fn waveform(dice: &mut Random, samples: usize) -> Vec<f64> {
        (0..samples).map(|_| 0.3 * gaussian(dice)).collect()
    }

    const SPACING: FastPeriods = FastPeriods(1.0 / 1.5);

    /// Captures of the waveform, which begins at `start` (fast periods).
    fn captures(truth: &Spec, samples: &[f64], start: f64, noise: f64, dice: &mut Random) -> Vec<Record> {
        let recording = Recording::new(samples, SPACING);
        let ratio = truth.ratio as f64;
        let count = (recording.duration().0 / ratio) as usize + 60;
        let one = |channel: &ChannelSpec| {
            let filter = StrictlyProper::new(&channel.filter, truth.fast_period).unwrap();
            let delay = channel.delay / truth.fast_period;
            let instants = Instants { first: FastPeriods(-delay - start), step: FastPeriods(ratio), count };
            let inside =
                |k: usize| (0.0..recording.duration().0).contains(&(k as f64 * ratio - delay - start));
            let clean = recording.sample(&filter, instants).into_iter().enumerate();
            // Silence before and after.
            clean.map(|(k, x)| if inside(k) { channel.gain * x } else { 0.0 } + channel.offset).collect()
        };
        let clean: Vec<Vec<f64>> = truth.channels.iter().map(one).collect();
        let noisy = |samples: Vec<f64>, dice: &mut Random| {
            Record::new(samples.into_iter().map(|x| x + noise * gaussian(dice)).collect())
        };
        clean.into_iter().map(|samples| noisy(samples, dice)).collect()
    }

    fn by_waveform(
        spec: &Spec,
        records: &[Record],
        samples: &[f64],
        cutoff: bool,
    ) -> Result<Calibration, CalibrateError> {
        let settings = Settings { fit: Fit { cutoff, ..Fit::default() }, reference: 0 };
        calibrate(spec, records, Evidence::Waveform { samples, spacing: SPACING }, settings)
    }

    /// The standard deviation is s / sqrt(g^2 sum v'^2), and the intervals hold the truth.
    #[test]
    fn errors_are_at_the_bound_and_intervals_cover() {
        let (spec, mut dice, noise) = (interleaved(), Random(21), 1e-3);
        let (mut scaled, trials) = (Vec::new(), trials(40));
        for trial in 0..trials {
            let samples = waveform(&mut dice, 3000);
            let truth = with_errors(&spec, &random_errors(&mut dice, 4, [0.02, 0.01, 0.002, 0.0]));
            let records = captures(&truth, &samples, 37.3 + (trial % 100) as f64 * 0.37, noise, &mut dice);
            let found = by_waveform(&spec, &records, &samples, false).unwrap();
            scaled.extend(errors(&truth, &found).scaled);
            // White noise after a low-pass of 2 MHz, up to 0.75 MHz: the rms of v' from its spectrum.
            let slope: f64 = (1..750)
                .map(|k| k as f64 * 1e3)
                .map(|f| (f * 1e-6 * std::f64::consts::TAU).powi(2) / (1.0 + (f / 2e6).powi(2)))
                .sum::<f64>()
                / 750.0;
            let bound = noise * (2.0 / (found.frames as f64 * 0.09 * slope)).sqrt();
            let sigma = found.channels[1].delay.unwrap().sigma.0;
            assert!((sigma / bound - 1.0).abs() < 0.15, "{sigma:e}, bound {bound:e}");
        }
        assert_covers(&scaled, trials.min(100));
    }

    #[test]
    fn the_cutoff_is_found_with_the_delay() {
        let (spec, mut dice) = (interleaved(), Random(22));
        let samples = waveform(&mut dice, 3000);
        let shift = |delay, cutoff| [delay, 1.0, 0.0, cutoff];
        let truth =
            with_errors(&spec, &[shift(0.0, 1.0), shift(0.01, 1.02), shift(-0.02, 0.99), shift(0.0, 1.01)]);
        let records = captures(&truth, &samples, 11.1, 1e-4, &mut dice);
        let found = by_waveform(&spec, &records, &samples, true).unwrap();
        for (estimate, cutoff) in found.channels.iter().zip([1.0, 1.02, 0.99, 1.01]).skip(1) {
            let estimate = estimate.cutoff.unwrap();
            assert!(
                (estimate.value - cutoff).abs() < 4.0 * estimate.sigma && estimate.sigma < 2e-3,
                "{estimate:?}"
            );
        }
        assert!(errors(&truth, &found).scaled.iter().all(|x| x.abs() < 5.0));
    }

    #[test]
    fn another_waveform_is_refused() {
        let (spec, mut dice) = (interleaved(), Random(23));
        let (samples, other) = (waveform(&mut dice, 3000), waveform(&mut dice, 3000));
        let records = captures(&spec, &samples, 11.1, 1e-3, &mut dice);
        let refused = by_waveform(&spec, &records, &other, false).unwrap_err();
        assert!(
            matches!(
                refused,
                CalibrateError::NotTheWaveform { .. }
                    | CalibrateError::NoConvergence { .. }
                    | CalibrateError::ShortOverlap { .. }
            ),
            "{refused}"
        );
        let few = by_waveform(&spec, &records, &other[..50], false).unwrap_err();
        assert!(matches!(few, CalibrateError::Waveform { samples: 50, .. }), "{few}");
    }

    #[test]
    fn swapped_captures_are_recognised() {
        let (spec, mut dice) = (interleaved(), Random(24));
        let samples = waveform(&mut dice, 3000);
        let mut records = captures(&spec, &samples, 5.0, 1e-3, &mut dice);
        records.swap(0, 3);
        let refused = by_waveform(&spec, &records, &samples, false).unwrap_err();
        assert_eq!(refused, CalibrateError::WrongOrder { order: vec![4, 2, 3, 1] });
    }

    #[test]
    fn coloured_noise_widens_the_intervals() {
        let mut dice = Random(25);
        let white: Vec<f64> = (0..4000).map(|_| gaussian(&mut dice)).collect();
        assert_eq!(colour(&white), 1.0);
        let coloured: Vec<f64> = white.windows(8).map(|window| window.iter().sum()).collect();
        // The standard deviation of a mean of moving averages of 8 is sqrt(8) times that of white noise.
        assert!((colour(&coloured) - 8f64.sqrt()).abs() < 0.3, "{}", colour(&coloured));
    }
}
