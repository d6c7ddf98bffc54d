//! Analysis of a bank: the norm of its error system, its mean-square error and its noise gain, with the
//! delays it was designed for or with others; and the scale of its gamma, what the simplest banks reach.

use super::normalise::input_scale;
use super::plant::LiftedPlant;
use super::problem::Problem;
use super::prove::resolved_norm;
use super::{DesignError, filters};
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;
use hybank_core::bank::Bank;
use hybank_core::spec::ErrorPoint;
use hybank_core::units::{FastPeriods, Hertz, RadiansPerSlowPeriod, Seconds};
use hybank_linalg::Mat;

/// The error of a bank with given front ends and delays.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Analysis {
    /// The norm ||K|| of the error system, in normalised time (h = 1): in double precision, or in the
    /// arithmetic of [`hybank_verify::verify`] where double precision does not resolve it.
    pub gamma: f64,
    /// Frequency of the worst case in hertz, from 0 to 1/(2 M h). All higher frequencies alias to one of
    /// these in the slow samples.
    pub peak_hertz: Hertz,
    /// The noncausal bound: no bank has a smaller norm with these front ends and delays. `None` where delays
    /// differ by less than doubles resolve: the bound is unknown there.
    pub noncausal: Option<f64>,
    /// Averages over time and inputs.
    #[serde(flatten)]
    pub mean: MeanAnalysis,
}

/// The error and noise of a bank, averaged over time and inputs.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MeanAnalysis {
    /// Root mean square of e for white noise f of unit density (h = 1): `||K||_2 / sqrt(M)`.
    pub rms_error: f64,
    /// RMS of the output noise for independent noise of unit RMS on all slow samples:
    /// `sqrt(sum_i ||f_i||^2 / M)`.
    pub noise_gain: f64,
    /// RMS of the output noise for the noise of the converters as the spec gives it, relative to full scale:
    /// `sqrt(sum_i sigma_i^2 ||f_i||^2 / M)`. Jitter counts for a signal of the rms of the spec.
    pub output_noise: f64,
}

/// Analyses `bank` with `delay_errors[i]` added to its delays; an empty slice means none.
///
/// ```
/// use hybank_core::{bank::Bank, units::Seconds};
/// use hybank_design::design::{GammaScale, analyze};
/// let bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json")?;
/// let (exact, late) = (analyze(&bank, &[])?, analyze(&bank, &[Seconds(0.0), Seconds(0.05)])?);
/// assert!(exact.gamma < 0.039933 && late.gamma > exact.gamma);
/// // Even so it is better than plain interleaving.
/// assert!(late.gamma < GammaScale::new(&bank, &[Seconds(0.0), Seconds(0.05)])?.interleaving);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::DelayErrorCount`] unless there is
/// one error per channel, [`DesignError::TooLate`] for delays that need too many delay-chain states,
/// [`DesignError::Lti`] for unstable filters.
pub fn analyze(bank: &Bank, delay_errors: &[Seconds]) -> Result<Analysis, DesignError> {
    let point = delay_point(bank, delay_errors)?;
    let problem = perturbed(bank, &point)?;
    let plant = LiftedPlant::new(&problem);
    let moved = delay_errors.iter().any(|error| error.0 != 0.0).then(|| bank.with_errors(&point));
    let peak = resolved_norm(moved.as_ref().unwrap_or(bank), plant.bank_norm(&bank.filters)?)?;
    let noncausal = if problem.resolves_delays() { Some(plant.noncausal_bound()?.gain) } else { None };
    Ok(Analysis {
        gamma: peak.gain,
        peak_hertz: RadiansPerSlowPeriod(peak.frequency).in_hertz(bank.slow_period()),
        noncausal: noncausal.map(|bound| bound.min(peak.gain)),
        mean: mean_of(bank, &plant)?,
    })
}

/// The errors of the delays alone; an empty slice means none.
///
/// # Errors
/// [`DesignError::DelayErrorCount`] unless there is one per channel.
pub fn delay_point(bank: &Bank, delay_errors: &[Seconds]) -> Result<ErrorPoint, DesignError> {
    let (given, channels) = (delay_errors.len(), bank.channel_count());
    if given == 0 {
        return Ok(ErrorPoint::none(channels));
    }
    if given != channels {
        return Err(DesignError::DelayErrorCount { given, channels });
    }
    let delays = delay_errors.iter().map(|error| error.in_fast_periods(bank.fast_period)).collect();
    Ok(ErrorPoint::of_delays(delays))
}

/// The problem of the bank with these errors.
fn perturbed(bank: &Bank, point: &ErrorPoint) -> Result<Problem, DesignError> {
    let problem = Problem::of_bank(bank)?.perturbed(point);
    problem.check_size()?;
    Ok(problem)
}

/// The norm of `bank` with the errors of `point`, in double precision.
///
/// # Errors
/// As [`analyze`].
pub fn norm_at(bank: &Bank, point: &ErrorPoint) -> Result<f64, DesignError> {
    Ok(LiftedPlant::new(&perturbed(bank, point)?).bank_norm(&bank.filters)?.gain)
}

/// Only the averages of [`analyze`], with the bank's own front ends and delays. For a large bank this takes
/// far less time than the norm.
///
/// # Errors
/// As [`analyze`].
pub fn analyze_mean(bank: &Bank) -> Result<MeanAnalysis, DesignError> {
    let problem = Problem::of_bank(bank)?;
    mean_of(bank, &LiftedPlant::new(&problem))
}

/// Rms of the output noise for independent noise of unit rms on all slow samples; a bank needs no front ends
/// for that.
///
/// # Errors
/// [`DesignError::Lti`] for unstable filters.
pub fn noise_gain(bank: &Bank) -> Result<f64, DesignError> {
    Ok(h2_norm(&filters::lifted(&bank.filters, bank.ratio))? / (bank.ratio as f64).sqrt())
}

fn mean_of(bank: &Bank, plant: &LiftedPlant) -> Result<MeanAnalysis, DesignError> {
    let filters = filters::lifted(&bank.filters, bank.ratio);
    let error = plant.error_system(&filters);
    let Problem { noise, signal, front_ends, target, .. } = plant.problem();
    // The noise of the problem is relative to an input of unit density.
    let scale = bank.spec.as_ref().map(|spec| input_scale(spec, signal.as_ref(), &front_ends[*target]));
    let noise_rms: Vec<f64> = noise.iter().map(|power| (power / scale.unwrap_or(1.0)).sqrt()).collect();
    let per_sample = (bank.ratio as f64).sqrt();
    Ok(MeanAnalysis {
        rms_error: h2_norm(&error)? / per_sample,
        noise_gain: h2_norm(&filters)? / per_sample,
        output_noise: h2_norm(&filters.scale_inputs(&noise_rms))? / per_sample,
    })
}

/// gamma of the simplest banks, h = 1, and the size of the reference.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct GammaScale {
    /// gamma of a bank whose output is zero: the largest gain from the analog input to the reference.
    pub zero_output: f64,
    /// gamma of plain interleaving: each output sample is the slow sample nearest to its instant.
    pub interleaving: f64,
    /// Root mean square of the reference for white noise f of unit density. With `rms_error` it gives the
    /// signal-to-noise ratio of a signal with the target's spectrum.
    pub rms_reference: f64,
}

impl GammaScale {
    /// Of the front ends, delays and latency of `bank`, with `delay_errors[i]` added to the delays of the
    /// samples that plain interleaving takes; an empty slice means none.
    ///
    /// # Errors
    /// As [`analyze`].
    pub fn new(bank: &Bank, delay_errors: &[Seconds]) -> Result<Self, DesignError> {
        let problem = Problem::of_bank(bank)?;
        let plant = LiftedPlant::new(&perturbed(bank, &delay_point(bank, delay_errors)?)?);
        let zero = StateSpace::gain(Mat::zeros(problem.ratio, problem.channels.len()));
        let reference = plant.reference();
        Ok(Self {
            zero_output: plant.norm(&zero)?.gain,
            interleaving: plant.fir_norm(&interleaving(&problem))?.gain,
            rms_reference: h2_norm(&reference)? / (problem.ratio as f64).sqrt(),
        })
    }
}

/// The taps of plain interleaving: one tap of 1 for each of the M phases.
fn interleaving(problem: &Problem) -> Vec<Vec<f64>> {
    let nearest = nearest_samples(&problem.delays(), problem.ratio, problem.latency, 0);
    let lags = 1 + nearest.iter().map(|sample| sample.lag as usize).max().unwrap_or(0);
    let mut taps = vec![vec![0.0; lags * problem.ratio]; problem.channels.len()];
    for (phase, sample) in nearest.into_iter().enumerate() {
        taps[sample.channel][sample.lag as usize * problem.ratio + phase] = 1.0;
    }
    taps
}

/// The slow sample nearest to the instant of an output phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearestSample {
    /// Index of its channel, from 0.
    pub channel: usize,
    /// Age in slow periods: frame k gives the output sample the slow sample k - lag. Negative for a sample
    /// that is taken after the frame.
    pub lag: i64,
}

/// The nearest sample of each of the M output phases; empty without channels.
///
/// Phase p of frame k belongs to the instant k M + p - m0 in fast periods, and sample l of channel i to
/// l M - D_i. Of equally near samples that of the first channel is taken. No lag is below `least_lag`: 0 for
/// causal interleaving, `i64::MIN` where the whole recording is known.
pub fn nearest_samples(
    delays: &[FastPeriods],
    ratio: usize,
    latency: usize,
    least_lag: i64,
) -> Vec<NearestSample> {
    let period = ratio as f64;
    let nearest = |phase: usize| {
        let instant = phase as f64 - latency as f64;
        let of_channel = |(channel, delay): (usize, &FastPeriods)| {
            let lag = ((-instant - delay.0) / period).round() as i64;
            let lag = lag.max(least_lag);
            let distance = (instant + lag as f64 * period + delay.0).abs();
            (distance, NearestSample { channel, lag })
        };
        let samples = delays.iter().enumerate().map(of_channel);
        samples.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, sample)| sample)
    };
    (0..ratio).filter_map(nearest).collect()
}

#[cfg(test)]
mod tests;
