//! The files of a simulation and their rates.

use crate::io::{Container, is_same_rate};
use crate::spec::Spec;
use crate::units::Hertz;
use std::path::{Path, PathBuf};

/// Fast rate in the headers of captures in normalised time.
const NORMALISED_RATE: Hertz = Hertz(48_000.0);

/// The kind of the files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Kind {
    /// ch1.wav, real samples only
    Wav,
    /// ch1.sigmf-meta and ch1.sigmf-data
    Sigmf,
    /// ch1.f32, for complex samples ch1.cf32: little-endian 32-bit floats
    Raw,
}

impl Kind {
    pub(super) fn container(self) -> Container {
        if self == Self::Raw { Container::Raw } else { Container::Wav }
    }

    fn extension(self, is_complex: bool) -> &'static str {
        match self {
            Self::Wav => "wav",
            Self::Sigmf => "sigmf-meta",
            Self::Raw if is_complex => "cf32",
            Self::Raw => "f32",
        }
    }
}

/// A recording to be written.
pub(super) struct Output {
    pub(super) path: PathBuf,
    /// Hertz.
    pub(super) rate: f64,
}

/// The recordings of the channels and of the target, in this order.
pub(super) fn outputs(
    folder: &Path,
    kind: Kind,
    is_complex: bool,
    rates: &Rates,
    channels: usize,
) -> Vec<Output> {
    let slow = (1..=channels).map(|i| (format!("ch{i}"), rates.slow));
    let names = slow.chain([("target".to_owned(), rates.fast)]);
    let extension = kind.extension(is_complex);
    names.map(|(name, rate)| Output { path: folder.join(format!("{name}.{extension}")), rate }).collect()
}

/// Rates of the headers, hertz.
pub(super) struct Rates {
    pub(super) slow: f64,
    pub(super) fast: f64,
}

impl Rates {
    /// Of a spec; WAV headers hold whole hertz, and the warnings say so.
    pub(super) fn of(spec: &Spec, kind: Kind) -> Result<(Self, Vec<String>), String> {
        let ratio = spec.ratio as f64;
        let exact = if spec.is_normalised() {
            (NORMALISED_RATE / ratio).0.round().max(1.0)
        } else {
            (spec.fast_period * ratio).rate().0
        };
        let exact = Self { slow: exact, fast: exact * ratio };
        if kind == Kind::Wav { exact.whole() } else { Ok((exact, Vec::new())) }
    }

    fn whole(self) -> Result<(Self, Vec<String>), String> {
        let Self { slow, fast } = self;
        if fast > f64::from(u32::MAX) || slow < 0.5 {
            return Err(format!(
                "the rates of {slow} Hz and {fast} Hz do not fit a WAV header (1 to {} Hz); write SigMF recordings \
                 with --to sigmf",
                u32::MAX
            ));
        }
        let uneven = [slow, fast].into_iter().filter(|rate| !is_same_rate(rate.round(), *rate, 0.0));
        let warning =
            |rate: f64| format!("WAV headers hold whole hertz: {rate} Hz is written as {} Hz", rate.round());
        let warnings = uneven.map(warning).collect();
        Ok((Self { slow: slow.round(), fast: fast.round() }, warnings))
    }
}

/// A rate as JSON: without a decimal point if it is whole.
pub(super) fn number(rate: f64) -> serde_json::Value {
    let is_whole = rate.fract() == 0.0 && rate < (1u64 << 53) as f64;
    if is_whole { (rate as u64).into() } else { rate.into() }
}
