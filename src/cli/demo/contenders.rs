//! The methods that the demo compares.

use super::super::Failure;
use super::super::fused::fused;
use super::spline::Samples;
use super::{Parts, SETTLING};
use crate::bank::Bank;
use crate::design::{self, Problem};
use crate::pipeline::{DroppedLatency, Settings};
use crate::simulate::interleaved;
use crate::spec::{Method, Spec};
use crate::units::{Decibels, FastPeriods};

/// A method of design, and whether it knows the band of the signal.
struct BankOf {
    name: &'static str,
    file: &'static str,
    method: Method,
    knows_the_band: bool,
}

/// The banks, the best one first.
const BANKS: [BankOf; 5] = [
    BankOf { name: "hybank, FIR 24 taps, with band", file: "fir", method: Method::Fir, knows_the_band: true },
    BankOf { name: "hybank, IIR, with band", file: "iir", method: Method::Iir, knows_the_band: true },
    BankOf {
        name: "hybank, FIR 24 taps, any input",
        file: "any",
        method: Method::Fir,
        knows_the_band: false,
    },
    BankOf {
        name: "separate delays, 24 taps",
        file: "separation",
        method: Method::Separation,
        knows_the_band: false,
    },
    BankOf { name: "sinc interpolation, 24 taps", file: "sinc", method: Method::Sinc, knows_the_band: false },
];

/// One method with its fused samples and their errors.
#[derive(Debug, serde::Serialize)]
pub(super) struct Contender {
    pub(super) name: &'static str,
    pub(super) file: String,
    pub(super) gamma: Option<f64>,
    /// For the chirp and the tones.
    pub(super) in_band: Error,
    pub(super) step: Error,
    /// Of the whole signal.
    #[serde(skip)]
    pub(super) samples: Vec<f64>,
}

/// The error against the exact fast samples.
#[derive(Debug, serde::Serialize)]
pub(super) struct Error {
    pub(super) rmse: f64,
    pub(super) max_error: f64,
    /// 20 log10(rms of the target / rmse).
    pub(super) snr_db: Decibels,
}

/// The banks in the order of [`BANKS`], the spline, and plain interleaving last.
pub(super) fn contend(spec: &Spec, problem: &Problem, parts: &Parts) -> Result<Vec<Contender>, Failure> {
    let mut contenders = Vec::new();
    for BankOf { name, file, method, knows_the_band } in BANKS {
        let bank = designed(spec, method, knows_the_band)?;
        // The target is as late as the bank.
        let causal = Settings { dropped: DroppedLatency::Added, ..Settings::default() };
        let contender = Contender::judge(name, file, parts, |channels| fused(&bank, channels, causal))?;
        contenders.push(Contender { gamma: bank.gamma.norm, ..contender });
    }
    let (delays, ratio, latency) = (problem.delays(), problem.ratio, problem.latency);
    let first = FastPeriods(-(latency as f64));
    let count = parts.step.target.len();
    contenders.push(Contender::judge("cubic spline through all samples", "spline", parts, |channels| {
        Ok(Samples::merged(&delays, ratio, channels).spline(first, count))
    })?);
    contenders.push(Contender::judge("plain interleaving", "interleaved", parts, |channels| {
        Ok(interleaved(&delays, ratio, latency, channels))
    })?);
    Ok(contenders)
}

fn designed(spec: &Spec, method: Method, knows_the_band: bool) -> Result<Bank, Failure> {
    let mut variant = spec.clone();
    variant.design = spec.design.with_method(method, spec.channels.len()).map_err(Failure::input)?;
    variant.signal = variant.signal.filter(|_| knows_the_band);
    Ok(design::design_with(&variant, design::ProofSearch::Skip).map_err(Failure::input)?.bank)
}

impl Contender {
    fn judge(
        name: &'static str,
        file: &str,
        parts: &Parts,
        fuse: impl Fn(&[Vec<f64>]) -> Result<Vec<f64>, Failure>,
    ) -> Result<Self, Failure> {
        let (in_band, step) = (fuse(&parts.in_band.channels)?, fuse(&parts.step.channels)?);
        Ok(Self {
            name,
            file: format!("fused-{file}.wav"),
            gamma: None,
            in_band: Error::of(&in_band, &parts.in_band.target),
            step: Error::of(&step, &parts.step.target),
            samples: in_band.iter().zip(&step).map(|(a, b)| a + b).collect(),
        })
    }
}

impl Error {
    fn of(samples: &[f64], target: &[f64]) -> Self {
        let errors = samples.iter().zip(target).skip(SETTLING).map(|(sample, target)| sample - target);
        let error_power: f64 = errors.clone().map(|error| error * error).sum();
        let power: f64 = target.iter().skip(SETTLING).map(|x| x * x).sum();
        Self {
            rmse: (error_power / (target.len() - SETTLING) as f64).sqrt(),
            max_error: errors.map(f64::abs).fold(0.0, f64::max),
            snr_db: Decibels::of_power(power / error_power),
        }
    }
}
