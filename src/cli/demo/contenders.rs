//! The methods that the demo compares.

use super::super::Failure;
use super::super::fused::fused;
use super::SETTLING;
use super::spline::Samples;
use crate::bank::Bank;
use crate::design::{self, Problem};
use crate::pipeline::WholeSettings;
use crate::simulate::{Captured, interleaved};
use crate::spec::{Method, Spec};
use crate::units::{Decibels, FastPeriods};

/// The banks, the best one first.
const BANKS: [(&str, Method); 4] = [
    ("hybank, FIR 24 taps", Method::Fir),
    ("hybank, IIR", Method::Iir),
    ("separate delays, 24 taps", Method::Separation),
    ("sinc interpolation, 24 taps", Method::Sinc),
];

/// One method with its fused samples and their error.
#[derive(Debug, serde::Serialize)]
pub(super) struct Contender {
    pub(super) name: &'static str,
    pub(super) file: String,
    pub(super) gamma: Option<f64>,
    pub(super) lower: Option<f64>,
    pub(super) rmse: f64,
    pub(super) max_error: f64,
    /// 20 log10(rms of the target / rmse).
    pub(super) snr_db: Decibels,
    #[serde(skip)]
    pub(super) samples: Vec<f64>,
}

/// The banks in the order of [`BANKS`], the spline, and plain interleaving last.
pub(super) fn contend(
    spec: &Spec,
    problem: &Problem,
    captured: &Captured,
) -> Result<Vec<Contender>, Failure> {
    let mut contenders = Vec::new();
    for (name, method) in BANKS {
        let mut variant = spec.clone();
        variant.design = spec.design.with_method(method, spec.channels.len()).map_err(Failure::input)?;
        let bank = design::design_with(&variant, design::ProofSearch::Skip).map_err(Failure::input)?.bank;
        // The target is as late as the bank.
        let causal = WholeSettings { keep_latency: true, ..WholeSettings::default() };
        let samples = fused(&bank, &captured.channels, causal)?;
        contenders.push(Contender::judge(name, method.name(), Some(&bank), samples, &captured.target));
    }
    let (delays, channels) = (problem.delays(), &captured.channels);
    let first = FastPeriods(-(problem.latency as f64));
    let spline = Samples::merged(&delays, problem.ratio, channels).spline(first, captured.target.len());
    contenders.push(Contender::judge("cubic spline", "spline", None, spline, &captured.target));
    let plain = interleaved(&delays, problem.ratio, problem.latency, channels);
    contenders.push(Contender::judge("plain interleaving", "interleaved", None, plain, &captured.target));
    Ok(contenders)
}

impl Contender {
    fn judge(name: &'static str, file: &str, bank: Option<&Bank>, samples: Vec<f64>, target: &[f64]) -> Self {
        let judged = SETTLING..target.len();
        let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
        let error = |n: usize| samples[n] - target[n];
        let error_power = power(&mut judged.clone().map(error));
        Self {
            name,
            file: format!("fused-{file}.wav"),
            gamma: bank.and_then(|bank| bank.gamma.norm),
            lower: bank
                .filter(|bank| matches!(bank.method, Method::Fir | Method::Iir))
                .and_then(|bank| bank.gamma.lower),
            rmse: (error_power / judged.len() as f64).sqrt(),
            max_error: judged.clone().map(|n| error(n).abs()).fold(0.0, f64::max),
            snr_db: Decibels::of_power(power(&mut target[judged].iter().copied()) / error_power),
            samples,
        }
    }
}
