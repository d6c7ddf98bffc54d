//! The errors of virtual converters on the command line.

use hybank::io::PcmFormat;
use hybank::quantity::{self, WrittenTime, readable};
use hybank::simulate::{ErrorLists, ErrorsOfConverter};
use hybank::spec::{ChannelSpec, Spec};
use hybank::units::Seconds;

/// How the converters differ from the spec.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Errors of the converters")]
pub(super) struct ErrorArgs {
    /// White noise on every sample, rms relative to full scale
    #[arg(long, value_name = "RMS", default_value_t = 0.0, allow_hyphen_values = true)]
    noise: f64,
    /// Round to so many bits, 2 to 24, with full scale 1; samples beyond it are clipped and counted
    #[arg(long, value_name = "B")]
    pub(super) bits: Option<u32>,
    /// Aperture jitter: each sample is taken this much off its instant, rms, as 2ps or 0.01samples [default:
    /// 0]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = quantity::time, hide_short_help = true)]
    jitter: Option<WrittenTime>,
    /// By how many parts per million the clocks are too fast, one value for all or one per channel
    #[arg(long, value_name = "PPM,..", value_delimiter = ',', allow_hyphen_values = true)]
    drift: Vec<f64>,
    /// True delays minus those of the spec, as 10ps or 0.01samples, one value for all or one per channel
    #[arg(long, value_name = "TIME,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::time)]
    delay_error: Vec<WrittenTime>,
    /// Relative errors of the gains, as 1% or 0.01, one value for all or one per channel
    #[arg(long, value_name = "SHARE,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative)]
    gain_error: Vec<f64>,
    /// Relative errors of the cut-offs of the front ends, as 1% or 0.01, one value for all or one per
    /// channel; of the stage that `fit` of the spec names, if it names one
    #[arg(long, value_name = "SHARE,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative, hide_short_help = true)]
    cutoff_error: Vec<f64>,
    /// Offsets relative to full scale, added to those of the spec, one value for all or one per channel
    #[arg(
        long,
        value_name = "O,..",
        value_delimiter = ',',
        allow_hyphen_values = true,
        hide_short_help = true
    )]
    offset: Vec<f64>,
    /// Seed of noise and jitter; the same seed gives the same samples
    #[arg(long, value_name = "N", default_value_t = 0, hide_short_help = true)]
    seed: u64,
}

impl ErrorArgs {
    pub(super) fn errors(&self) -> ErrorLists {
        ErrorLists {
            noise: self.noise,
            bits: self.bits,
            jitter: self.jitter,
            drift: self.drift.clone(),
            delay_error: self.delay_error.clone(),
            gain_error: self.gain_error.clone(),
            cutoff_error: self.cutoff_error.clone(),
            offset: self.offset.clone(),
            seed: self.seed,
        }
    }
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

impl ConverterReport {
    /// Of a channel with these errors.
    pub(super) fn new(channel: &ChannelSpec, errors: &ErrorsOfConverter) -> Self {
        Self {
            delay: channel.delay.0 + errors.delay.0,
            delay_error: errors.delay.0,
            gain: channel.gain * (1.0 + errors.gain),
            gain_error: errors.gain,
            cutoff_error: errors.cutoff,
            offset: channel.offset + errors.offset,
            drift: errors.drift,
            clipped: 0,
        }
    }
}

/// The format of the codes of converters with so many bits.
pub(super) fn integers(bits: Option<u32>) -> Option<PcmFormat> {
    bits.map(|bits| if bits <= 16 { PcmFormat::S16Le } else { PcmFormat::S24Le })
}

impl CommonReport {
    /// Of the converters of a spec.
    pub(super) fn new(errors: &ErrorLists, spec: &Spec) -> Self {
        let jitter = errors.jitter.map_or(Seconds(0.0), |jitter| jitter.in_seconds(spec.fast_period));
        Self { noise: errors.noise, bits: errors.bits, jitter: jitter.0, seed: errors.seed }
    }

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
