//! The errors of virtual converters on the command line.

use super::analyze::of_channels;
use super::bank_file::bad_flag;
use super::print::Failure;
use crate::io::PcmFormat;
use crate::quantity::{self, Time, readable};
use crate::simulate::{Analog, Converter, Quantiser};
use crate::spec::{
    ChannelSpec, Cutoff, Fitting, MAX_LATENCY, Spec, SpecProblem, check_noise, check_offset, within,
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

/// How the converters differ from what the spec says.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Errors of the converters")]
pub(super) struct ConverterArgs {
    /// White noise on every sample, rms relative to full scale
    #[arg(long, value_name = "RMS", default_value_t = 0.0, allow_hyphen_values = true)]
    noise: f64,
    /// Round to so many bits, 2 to 24, with full scale 1; samples beyond it are clipped and counted
    #[arg(long, value_name = "B", value_parser = quantiser)]
    bits: Option<(u32, Quantiser)>,
    /// Aperture jitter: each sample is taken this much off its instant, rms, as 2ps or 0.01samples [default:
    /// 0]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = quantity::time)]
    jitter: Option<Time>,
    /// By how many parts per million the clocks are too fast, one value for all or one per channel
    #[arg(long, value_name = "PPM,..", value_delimiter = ',', allow_hyphen_values = true)]
    drift: Vec<f64>,
    /// True delays minus those of the spec, as 10ps or 0.01samples, one value for all or one per channel
    #[arg(long, value_name = "TIME,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::time)]
    delay_error: Vec<Time>,
    /// Relative errors of the gains, as 1% or 0.01, one value for all or one per channel
    #[arg(long, value_name = "SHARE,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative)]
    gain_error: Vec<f64>,
    /// Relative errors of the cut-offs of the front ends, as 1% or 0.01, one value for all or one per
    /// channel; of the stage that `fit` of the spec names, if it names one
    #[arg(long, value_name = "SHARE,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative)]
    cutoff_error: Vec<f64>,
    /// Offsets relative to full scale, added to those of the spec, one value for all or one per channel
    #[arg(long, value_name = "O,..", value_delimiter = ',', allow_hyphen_values = true)]
    offset: Vec<f64>,
    /// Seed of noise and jitter; the same seed gives the same samples
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

fn quantiser(text: &str) -> Result<(u32, Quantiser), String> {
    let bits = text.trim().parse().ok();
    bits.and_then(|bits| Some((bits, Quantiser::new(bits)?))).ok_or_else(|| {
        let (least, most) = (Quantiser::LEAST_BITS, Quantiser::MOST_BITS);
        format!(
            "a converter has {least} to {most} bits; leave the option out for samples that are not rounded"
        )
    })
}

/// What all converters have in common.
#[derive(Debug, serde::Serialize)]
pub(super) struct CommonReport {
    /// Rms, of full scale.
    noise: f64,
    bits: Option<u32>,
    /// Seconds, rms.
    jitter: f64,
    seed: u64,
}

/// One converter as it was simulated.
#[derive(Debug, serde::Serialize)]
pub(super) struct ConverterReport {
    /// True delay, seconds.
    delay: f64,
    /// The part of it that the spec does not know.
    delay_error: f64,
    /// True gain relative to nominal.
    gain: f64,
    gain_error: f64,
    /// Relative error of the cut-off.
    cutoff_error: f64,
    /// Of full scale.
    offset: f64,
    /// Parts per million by which the clock is too fast.
    drift: f64,
    /// Samples beyond full scale.
    pub(super) clipped: usize,
}

/// The converters of a spec.
pub(super) struct Converters {
    pub(super) common: CommonReport,
    /// One for each channel.
    pub(super) each: Vec<(Converter, ConverterReport)>,
}

impl ConverterArgs {
    /// The converters of `spec` with their errors, for `signals`.
    ///
    /// # Errors
    /// A number out of its range, or a list that has neither one value nor one for each channel.
    pub(super) fn converters<'a>(
        &self,
        spec: &Spec,
        mut signals: impl Iterator<Item = &'a Analog>,
    ) -> Result<Converters, Failure> {
        check_noise(self.noise).map_err(|problem| bad_flag("noise", &problem))?;
        let jitter = self.jitter(spec.fast_period);
        signals.try_for_each(|signal| check_jitter(jitter, spec.fast_period, signal))?;
        let channels = spec.channels.len();
        let drift = checked("drift", &self.drift, channels, check_drift)?;
        let most_delay = (spec.fast_period * MAX_LATENCY as f64).0;
        let delay_error: Vec<f64> =
            self.delay_error.iter().map(|e| e.in_seconds(spec.fast_period).0).collect();
        let delay_error = checked("delay-error", &delay_error, channels, |x| check_delay(x, most_delay))?;
        let gain_error = checked("gain-error", &self.gain_error, channels, check_gain_error)?;
        let cutoff_error = self.cutoff_errors(channels)?;
        let offset = checked("offset", &self.offset, channels, check_offset)?;
        let each = |(i, channel): (usize, &ChannelSpec)| {
            let report = ConverterReport {
                delay: channel.delay.0 + delay_error[i],
                delay_error: delay_error[i],
                gain: channel.gain * (1.0 + gain_error[i]),
                gain_error: gain_error[i],
                cutoff_error: cutoff_error[i],
                offset: channel.offset + offset[i],
                drift: drift[i],
                clipped: 0,
            };
            (self.converter(&report, jitter, spec.fast_period), report)
        };
        let each = spec.channels.iter().enumerate().map(each).collect();
        let (noise, jitter, seed) = (self.noise, jitter.0, self.seed);
        let common = CommonReport { noise, bits: self.bits.map(|(bits, _)| bits), jitter, seed };
        Ok(Converters { common, each })
    }

    /// The spec whose front ends have the true cut-offs.
    pub(super) fn true_spec(&self, spec: &Spec) -> Result<Spec, Failure> {
        let part = spec.fit.iter().find_map(|value| match value {
            Fitting::Cutoff(part) => Some(*part),
            _ => None,
        });
        let part = part.unwrap_or(Cutoff::Whole);
        let mut truth = spec.clone();
        let errors = self.cutoff_errors(spec.channels.len())?;
        for (channel, error) in truth.channels.iter_mut().zip(errors).filter(|(_, error)| *error != 0.0) {
            channel.filter = part.scaled(&channel.filter, 1.0 + error).ok_or_else(|| {
                let part = Fitting::Cutoff(part);
                Failure::Input(format!(
                    "--cutoff-error: `fit` of the spec names {part}, and a filter has no such stage"
                ))
            })?;
        }
        Ok(truth)
    }

    fn cutoff_errors(&self, channels: usize) -> Result<Vec<f64>, Failure> {
        checked("cutoff-error", &self.cutoff_error, channels, check_cutoff_error)
    }

    /// The format of the converters' codes, if they have any.
    pub(super) fn integers(&self) -> Option<PcmFormat> {
        let (bits, _) = self.bits?;
        Some(if bits <= 16 { PcmFormat::S16Le } else { PcmFormat::S24Le })
    }

    /// Rms of the jitter.
    fn jitter(&self, fast_period: Seconds) -> Seconds {
        self.jitter.map_or(Seconds(0.0), |jitter| jitter.in_seconds(fast_period))
    }

    fn converter(&self, report: &ConverterReport, jitter: Seconds, fast_period: Seconds) -> Converter {
        Converter {
            delay_error: Seconds(report.delay_error).in_fast_periods(fast_period),
            gain_error: report.gain_error,
            offset: report.offset,
            drift: report.drift * 1e-6,
            jitter: jitter.in_fast_periods(fast_period),
            noise: self.noise,
            quantiser: self.bits.map(|(_, quantiser)| quantiser),
            seed: self.seed,
        }
    }

    /// True if the instants of the samples have no common distance.
    pub(super) fn is_jittered(&self) -> bool {
        self.jitter(Seconds(1.0)).0 > 0.0
    }
}

fn check_jitter(rms: Seconds, fast_period: Seconds, signal: &Analog) -> Result<(), Failure> {
    let jitter = rms.in_fast_periods(fast_period);
    if !(0.0..=MOST_JITTER).contains(&jitter.0) {
        return Err(Failure::Input(format!(
            "--jitter: {:e} s are {:e} fast periods rms, and the simulation takes 0 to {MOST_JITTER}; check the unit",
            rms.0, jitter.0
        )));
    }
    let Analog::Recorded(recording) = signal else { return Ok(()) };
    let (reach, most): (FastPeriods, _) = (jitter * Converter::MOST_SIGMAS, recording.most_shift());
    if reach <= most {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "--jitter: samples may be {reach:.2} off their instants, more than the {most:.2} for which a recording of \
         this rate keeps its digits; ask for less jitter, or resample the recording to the fast rate"
    )))
}

/// One number for each channel, within its range.
fn checked(
    flag: &str,
    given: &[f64],
    channels: usize,
    check: impl Fn(f64) -> Result<(), SpecProblem>,
) -> Result<Vec<f64>, Failure> {
    given.iter().try_for_each(|&value| check(value)).map_err(|problem| bad_flag(flag, &problem))?;
    of_channels(&format!("--{flag}"), given, channels)
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

fn check_gain_error(error: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "an error of the gain is relative, -{MOST_GAIN_ERROR} to {MOST_GAIN_ERROR}; 0.01 is one per cent"
    );
    within(error, -MOST_GAIN_ERROR..=MOST_GAIN_ERROR, "(relative)", rule)
}

fn check_cutoff_error(error: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "an error of a cut-off is relative, -{MOST_CUTOFF_ERROR} to {MOST_CUTOFF_ERROR}; 0.01 is one per cent"
    );
    within(error, -MOST_CUTOFF_ERROR..=MOST_CUTOFF_ERROR, "(relative)", rule)
}

impl CommonReport {
    /// What differs from an ideal converter, in one line.
    pub(super) fn text(&self) -> String {
        let noise = (self.noise > 0.0).then(|| format!("noise {} of full scale rms", self.noise));
        let jitter = (self.jitter > 0.0).then(|| format!("jitter {} rms", readable(self.jitter, "s")));
        let bits = self.bits.map(|bits| format!("{bits} bits"));
        let errors: Vec<String> = [noise, jitter, bits].into_iter().flatten().collect();
        if errors.is_empty() {
            return String::new();
        }
        format!("converters: {}, seed {}\n", errors.join(", "), self.seed)
    }
}

impl ConverterReport {
    /// What differs from an ideal converter, in one line.
    pub(super) fn text(&self, channel: usize) -> String {
        let Self { delay, delay_error, gain, cutoff_error, offset, drift, .. } = *self;
        if (delay_error, gain, cutoff_error, offset, drift) == (0.0, 1.0, 0.0, 0.0, 0.0) {
            return String::new();
        }
        let (delay, error) = (readable(delay, "s"), readable(delay_error, "s"));
        let cutoff = 1.0 + cutoff_error;
        let cutoff = if cutoff == 1.0 { String::new() } else { format!(", cut-off x {cutoff}") };
        format!(
            "converter {channel}: delay {delay} (error {error}), gain {gain}{cutoff}, offset {offset}, drift {drift} ppm\n"
        )
    }
}
