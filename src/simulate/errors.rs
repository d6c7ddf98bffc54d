//! How the virtual converters of a spec differ from what it says, with the limits of that.

use super::{Analog, Quantiser, Sampler};
use crate::quantity::WrittenTime;
use crate::spec::{
    At, ChannelSpec, Cutoff, Fitting, MAX_LATENCY, Spec, SpecError, SpecProblem, check_noise, check_offset,
    for_channels, refused, within,
};
use crate::units::{FastPeriods, Seconds};

/// Largest rms of the jitter in fast periods: more than a tenth leaves no signal, so the unit is wrong.
const MOST_JITTER: f64 = 0.1;
/// Largest clock error, in parts per million; a crystal has less than 100.
const MOST_DRIFT: f64 = 1e5;
/// Largest relative error of a gain.
const MOST_GAIN_ERROR: f64 = 1.0;
/// Largest relative error of a cut-off: filters that differ by more are other filters.
const MOST_CUTOFF_ERROR: f64 = 0.5;

/// How converters differ from what a spec says. A list has no value, one for all channels, or one for each.
///
/// ```
/// use hybank::simulate::ErrorLists;
/// use hybank::spec::Spec;
/// let spec = Spec::from_toml(include_str!("../../filters/speech-2x.toml"), "spec.toml")?;
/// let errors = ErrorLists { bits: Some(12), gain_error: vec![0.01], ..Default::default() };
/// let converters = errors.converters(&spec, std::iter::empty())?;
/// assert_eq!((converters.len(), converters[1].errors.gain), (2, 0.01));
/// # Ok::<_, Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ErrorLists {
    /// White noise on every sample, rms relative to full scale.
    pub noise: f64,
    /// Samples are rounded to so many bits, 2 to 24, with full scale 1; those beyond it are clipped and
    /// counted.
    pub bits: Option<u32>,
    /// Aperture jitter: each sample is taken this much off its instant, rms.
    pub jitter: Option<WrittenTime>,
    /// By how many parts per million the clocks are too fast.
    pub drift: Vec<f64>,
    /// True delays minus those of the spec.
    pub delay_error: Vec<WrittenTime>,
    /// Relative errors of the gains.
    pub gain_error: Vec<f64>,
    /// Relative errors of the cut-offs of the front ends; of the stage that `fit` of the spec names, if it
    /// names one.
    pub cutoff_error: Vec<f64>,
    /// Offsets relative to full scale, added to those of the spec.
    pub offset: Vec<f64>,
    /// Seed of noise and jitter; the same seed gives the same samples.
    pub seed: u64,
}

/// The errors of one converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorsOfConverter {
    /// True delay minus that of the spec.
    pub delay: Seconds,
    /// Relative error of the gain.
    pub gain: f64,
    /// Relative error of the cut-off.
    pub cutoff: f64,
    /// What is added to the offset of the spec.
    pub offset: f64,
    /// Parts per million by which the clock is too fast.
    pub drift: f64,
}

/// A converter with its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct VirtualConverter {
    /// What was asked for.
    pub errors: ErrorsOfConverter,
    /// The converter, with the offset and the nonlinearity of the spec.
    pub converter: Sampler,
}

impl ErrorLists {
    /// The converters of `spec` with these errors, for the parts of a signal.
    ///
    /// # Errors
    /// [`SpecError`] with the field: a number out of its range, or a list that has neither one value nor one
    /// per channel.
    pub fn converters<'a>(
        &self,
        spec: &Spec,
        mut parts: impl Iterator<Item = &'a Analog>,
    ) -> Result<Vec<VirtualConverter>, SpecError> {
        check_noise(self.noise).at("noise")?;
        let quantiser = self.bits.map(|bits| Quantiser::new(bits).ok_or_else(no_quantiser)).transpose()?;
        let jitter = self.jitter.map_or(Seconds(0.0), |jitter| jitter.in_seconds(spec.fast_period));
        parts.try_for_each(|part| check_jitter(jitter, spec.fast_period, part))?;
        let channels = spec.channels.len();
        let drift = checked("drift", &self.drift, channels, check_drift)?;
        let most_delay = (spec.fast_period * MAX_LATENCY as f64).0;
        let delays: Vec<f64> = self.delay_error.iter().map(|e| e.in_seconds(spec.fast_period).0).collect();
        let delays = checked("delay_error", &delays, channels, |x| check_delay(x, most_delay))?;
        let gains = checked("gain_error", &self.gain_error, channels, |x| {
            check_share(x, MOST_GAIN_ERROR, "the gain")
        })?;
        let cutoffs = self.cutoffs(channels)?;
        let offsets = checked("offset", &self.offset, channels, check_offset)?;
        let each = |(i, channel): (usize, &ChannelSpec)| VirtualConverter {
            errors: ErrorsOfConverter {
                delay: Seconds(delays[i]),
                gain: gains[i],
                cutoff: cutoffs[i],
                offset: offsets[i],
                drift: drift[i],
            },
            converter: Sampler {
                delay_error: Seconds(delays[i]).in_fast_periods(spec.fast_period),
                gain_error: gains[i],
                offset: channel.offset + offsets[i],
                nonlinearity: channel.nonlinearity.clone(),
                drift: drift[i] * 1e-6,
                jitter: jitter.in_fast_periods(spec.fast_period),
                noise: self.noise,
                quantiser,
                seed: self.seed,
            },
        };
        Ok(spec.channels.iter().enumerate().map(each).collect())
    }

    /// The spec whose front ends have the true cut-offs: of the stage that `fit` names, if it names one.
    ///
    /// # Errors
    /// [`SpecError`] of `cutoff_error`.
    pub fn true_spec(&self, spec: &Spec) -> Result<Spec, SpecError> {
        let part = spec.fit.iter().find_map(|value| match value {
            Fitting::Cutoff(part) => Some(*part),
            _ => None,
        });
        let part = part.unwrap_or(Cutoff::Whole);
        let mut truth = spec.clone();
        let errors = self.cutoffs(spec.channels.len())?;
        for (channel, error) in truth.channels.iter_mut().zip(errors).filter(|(_, error)| *error != 0.0) {
            let scaled = part.scaled(&channel.filter, 1.0 + error);
            channel.filter = scaled.ok_or_else(|| {
                let stage = Fitting::Cutoff(part);
                refused(
                    "cutoff_error",
                    format!("`fit` of the spec names {stage}, and a filter has no such stage"),
                )
            })?;
        }
        Ok(truth)
    }

    /// True if the instants of the samples have no common distance.
    pub fn is_jittered(&self) -> bool {
        self.jitter.is_some_and(|jitter| jitter.in_seconds(Seconds(1.0)).0 > 0.0)
    }

    fn cutoffs(&self, channels: usize) -> Result<Vec<f64>, SpecError> {
        checked("cutoff_error", &self.cutoff_error, channels, |x| {
            check_share(x, MOST_CUTOFF_ERROR, "a cut-off")
        })
    }
}

fn no_quantiser() -> SpecError {
    let (least, most) = (Quantiser::LEAST_BITS, Quantiser::MOST_BITS);
    let rule =
        format!("a converter has {least} to {most} bits; leave them out for samples that are not rounded");
    refused("bits", rule)
}

fn check_jitter(rms: Seconds, fast_period: Seconds, signal: &Analog) -> Result<(), SpecError> {
    let jitter = rms.in_fast_periods(fast_period);
    if !(0.0..=MOST_JITTER).contains(&jitter.0) {
        let rule = format!(
            "{:e} s are {:e} fast periods rms, and the simulation takes 0 to {MOST_JITTER}; check the unit",
            rms.0, jitter.0
        );
        return Err(refused("jitter", rule));
    }
    let Analog::Recorded(recording) = signal else { return Ok(()) };
    let (reach, most): (FastPeriods, _) = (jitter * Sampler::MOST_SIGMAS, recording.most_shift());
    if reach <= most {
        return Ok(());
    }
    let rule = format!(
        "samples may be {reach:.2} off their instants, more than the {most:.2} for which a recording of this rate \
         keeps its digits; ask for less jitter, or resample the recording to the fast rate"
    );
    Err(refused("jitter", rule))
}

/// One number for each channel, within its range.
fn checked(
    field: &'static str,
    given: &[f64],
    channels: usize,
    check: impl Fn(f64) -> Result<(), SpecProblem>,
) -> Result<Vec<f64>, SpecError> {
    given.iter().try_for_each(|&value| check(value)).at(field)?;
    for_channels(given, channels).at(field)
}

fn check_drift(ppm: f64) -> Result<(), SpecProblem> {
    within(
        ppm,
        -MOST_DRIFT..=MOST_DRIFT,
        "ppm",
        format!("a clock is at most {MOST_DRIFT} ppm too fast or too slow"),
    )
}

fn check_delay(seconds: f64, most: f64) -> Result<(), SpecProblem> {
    let rule = format!("a delay error is at most {MAX_LATENCY} fast periods; check its unit");
    within(seconds, -most..=most, "s", rule)
}

fn check_share(error: f64, most: f64, what: &str) -> Result<(), SpecProblem> {
    let rule = format!("an error of {what} is relative, -{most} to {most}; 0.01 is one per cent");
    within(error, -most..=most, "(relative)", rule)
}
