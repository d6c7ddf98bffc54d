//! The figures of a bank, and warnings about it.

use super::terms::{Fact, fact, figure_facts};
use super::text::{decibels, six_digits};
use super::understood::understood;
use crate::bank::{Bank, FixedPoint, SynthesisFilters};
use crate::design::{DesignError, GammaScale, MeanAnalysis, analyze_mean};
use crate::figures::{Figures, KeyFigures, Snr};
use crate::quantity::readable;
use crate::runtime::Options;
use crate::spec::{ErrorPoint, Method, Spec};
use crate::units::{Decibels, FastPeriods};
use crate::verify::verify;

/// The error of a delay for which figures are stated.
const SMALL_ERROR: FastPeriods = FastPeriods(1e-3);

/// A channel and what an error of its delay does.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelFact {
    /// In fast samples and in seconds.
    pub delay: String,
    /// Of the converter.
    pub gain: String,
    /// Of full scale.
    pub offset: String,
    /// The figures of the bank if this delay alone is a thousandth of a fast sample longer.
    pub later: KeyFigures,
}

/// All figures.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Facts {
    /// The name of the spec.
    pub title: String,
    /// The spec in units of the user.
    pub understood: String,
    /// In the user's terms: signal-to-noise ratio, images, error of gain, and the usual ways. Then gamma,
    /// its bounds and the noise gain.
    pub error: Vec<Fact>,
    /// Method, latency, size and operations.
    pub cost: Vec<Fact>,
    /// In the order of the spec.
    pub channels: Vec<ChannelFact>,
}

/// A proven interval. Its ends are rounded outwards, so that what is printed is proven too.
fn interval(lower: f64, upper: f64) -> String {
    format!("{} to {}", beyond(lower, -1.0), beyond(upper, 1.0))
}

/// The number of six digits next to the value in `direction`, 1 or -1.
fn beyond(value: f64, direction: f64) -> String {
    let text = six_digits(value);
    if text.parse().is_ok_and(|rounded: f64| direction * (rounded - value) >= 0.0) {
        return text;
    }
    let last_digit = 10f64.powi(value.abs().log10().floor() as i32 - 5);
    six_digits(value + direction * last_digit)
}

impl Facts {
    /// Of a bank and its spec. The bounds are proven again: only what `verify` proves of a file is reported.
    ///
    /// # Errors
    /// [`DesignError`] if the bank does not fit its spec, or its norm cannot be computed.
    pub fn new(bank: &Bank, spec: &Spec) -> Result<Self, DesignError> {
        let name = if spec.name.is_empty() { "A bank without a name" } else { &spec.name };
        Ok(Self {
            title: name.to_owned(),
            understood: understood(&Spec { latency: Some(bank.latency), ..spec.clone() }),
            error: figure_facts(&Figures::new(bank)?, bank.is_normalised())
                .into_iter()
                .chain(error_facts(bank, &GammaScale::new(bank, &[])?, &analyze_mean(bank)?))
                .collect(),
            cost: cost_facts(bank),
            channels: (0..spec.channels.len())
                .map(|i| channel_fact(bank, spec, i))
                .collect::<Result<_, _>>()?,
        })
    }
}

fn error_facts(bank: &Bank, scale: &GammaScale, mean: &MeanAnalysis) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(gamma) = bank.gamma.norm {
        let below = |other: f64| decibels(gamma, other);
        facts.push(fact(
            "gamma",
            six_digits(gamma),
            format!(
                "worst-case gain from the signal's source to the error (h = 1, computed): {} against zero output, {} \
                 against plain interleaving",
                below(scale.zero_output),
                below(scale.interleaving)
            ),
        ));
    }
    facts.push(match verify(bank) {
        Ok(proven) => fact(
            "proven",
            interval(proven.attained, proven.upper),
            "gamma of this bank lies between these values; proven for this page",
        ),
        Err(error) => fact("proven", "nothing", format!("the bounds of the file were not proven: {error}")),
    });
    if let Some(noncausal) = bank.gamma.noncausal {
        facts.push(fact(
            "noncausal",
            six_digits(noncausal),
            "no latency makes gamma smaller (computed lower bound)",
        ));
    }
    facts.push(fact("noise gain", six_digits(mean.noise_gain), noise(mean)));
    facts
}

fn noise(mean: &MeanAnalysis) -> String {
    let gain = "rms noise at the output per rms noise of the converters";
    match mean.output_noise {
        0.0 => format!("{gain}; the spec gives them none"),
        noise => format!("{gain}; theirs gives {noise:.3e} of full scale"),
    }
}

fn cost_facts(bank: &Bank) -> Vec<Fact> {
    let time = readable(bank.fast_period.0 * bank.latency as f64, "s");
    let latency =
        if bank.is_normalised() { "fast samples".to_owned() } else { format!("fast samples = {time}") };
    let (size, meaning) = size(&bank.filters);
    let mut facts = vec![
        fact("method", bank.method.name(), ""),
        fact("latency", bank.latency.to_string(), latency),
        fact("size", size, meaning),
    ];
    if let Ok(plan) = bank.plan(Options::default()) {
        let summary = plan.summary();
        let operations = summary.multiply_adds.unwrap_or_else(|| recursion(bank));
        facts.push(fact(
            "cost",
            six_digits(operations),
            format!("multiply-adds per output sample ({}, {})", summary.algorithm, summary.numbers),
        ));
    }
    facts
}

fn size(filters: &SynthesisFilters) -> (String, String) {
    match filters {
        SynthesisFilters::Fir(taps) => {
            let nonzero = taps.iter().flatten().filter(|tap| **tap != 0.0).count();
            (
                format!("{} taps", taps.first().map_or(0, Vec::len)),
                format!("per channel; {nonzero} taps of all channels are not zero"),
            )
        }
        SynthesisFilters::StateSpace(block) => (format!("{} states", block.a.len()), "recursive".to_owned()),
    }
}

/// Multiply-adds per output sample of a recursion that skips zeros.
fn recursion(bank: &Bank) -> f64 {
    match &bank.filters {
        SynthesisFilters::Fir(_) => 0.0,
        SynthesisFilters::StateSpace(block) => {
            let all = [&block.a, &block.b, &block.c, &block.d].into_iter().flatten().flatten();
            all.filter(|x| **x != 0.0).count() as f64 / bank.ratio as f64
        }
    }
}

fn channel_fact(bank: &Bank, spec: &Spec, i: usize) -> Result<ChannelFact, DesignError> {
    let channel = &spec.channels[i];
    let time = readable(channel.delay.0, "s");
    let samples = format!("{} samples", six_digits(bank.delays_in_fast_periods()[i].0));
    let mut point = ErrorPoint::none(spec.channels.len());
    point.delays[i] = SMALL_ERROR;
    Ok(ChannelFact {
        delay: if spec.is_normalised() { samples } else { format!("{samples} = {time}") },
        gain: six_digits(channel.gain),
        offset: six_digits(channel.offset),
        later: KeyFigures::new(&bank.with_errors(&point))?,
    })
}

/// Warning for a bank whose taps are all zero.
const ALL_ZERO: &str = "all integer taps are zero, so the output is zero: no better integers of these bits were found; \
                        give more bits or another fraction_bits";

/// Noise gains above this cause a warning: 20 dB.
const LARGE_NOISE_GAIN: f64 = 10.0;
/// A gamma above this share of that of zero output is hardly better than zero output.
const USELESS_SHARE: f64 = 0.9;
/// A bank whose own errors leave less than this in the band of the signal reconstructs nothing.
const LEAST_SNR: Decibels = Decibels(10.0);

/// Warning for a bank with large coefficients.
fn large_noise_gain(bank: &Bank, noise_gain: f64) -> String {
    let rounding = match bank.filters {
        SynthesisFilters::StateSpace(_) => "",
        SynthesisFilters::Fir(_) => {
            ", and the rounding of f32 (fuse to 32-bit integers or 64-bit floats to avoid that)"
        }
    };
    let weighed = match bank.method {
        Method::Fir | Method::Iir => {
            "; `noise` with the method h2, or with a large `gamma_margin`, trades gamma for less noise"
        }
        Method::H2 => "; with the `noise` of the converters h2 has less",
        Method::Sinc | Method::Separation => "",
    };
    format!(
        "noise gain {}: the bank amplifies the converters' noise that much{rounding}{weighed}; \
         look for nearly equal delays and for front ends of little gain",
        six_digits(noise_gain)
    )
}

/// Why a bank is of no use, if it is: it is hardly better than silence, or leaves little of the signal that
/// the spec states. The noise of the converters, which no bank removes, does not count.
pub fn uselessness(bank: &Bank, scale: &GammaScale, figures: &Figures) -> Option<String> {
    let gamma = bank.gamma.norm.filter(|gamma| *gamma > USELESS_SHARE * scale.zero_output);
    if let Some(gamma) = gamma.filter(|_| scale.zero_output > 0.0) {
        return Some(format!(
            "gamma is {:.0} % of that of zero output: the front ends or the delays leave nothing to reconstruct, or the \
             latency does not suit the taps",
            100.0 * gamma / scale.zero_output
        ));
    }
    let Snr { signal_db, delays_db, gains_db, offsets_db, .. } = figures.snr;
    let share = |db: Decibels| 10f64.powf(-0.1 * db.0);
    let uncertain = [delays_db, gains_db, offsets_db].into_iter().flatten();
    let error = share(signal_db) + uncertain.map(share).sum::<f64>();
    (bank.spec.as_ref()?.signal.is_some() && error > share(LEAST_SNR)).then(|| {
        format!(
            "the SNR of the signal is {:.1} dB, without the noise of the converters: the channels do not hold its band, \
             the taps or the latency are too few, or delays, gains or offsets too uncertain",
            -10.0 * error.log10() + 0.0
        )
    })
}

/// What a user of the bank should know: that it does nothing, is of no use, or amplifies noise.
pub fn warnings(bank: &Bank, mean: &MeanAnalysis, scale: &GammaScale, figures: &Figures) -> Vec<String> {
    let warnings = [
        bank.fixed_point.as_ref().is_some_and(FixedPoint::is_zero).then(|| ALL_ZERO.to_owned()),
        uselessness(bank, scale, figures),
        (mean.noise_gain > LARGE_NOISE_GAIN).then(|| large_noise_gain(bank, mean.noise_gain)),
    ];
    warnings.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::interval;

    #[test]
    fn proven_ends_are_rounded_outwards() {
        for (lower, upper, text) in [
            (0.031_293_64, 0.031_293_64, "0.0312936 to 0.0312937"),
            (0.031_293_69, 0.031_293_69, "0.0312936 to 0.0312937"),
            (0.25, 0.5, "0.25 to 0.5"),
            (0.0, 0.999_999_9, "0 to 1"),
            (1.000_001e-9, 1.000_001e-9, "1.00000e-9 to 1.00001e-9"),
        ] {
            assert_eq!(interval(lower, upper), text);
        }
    }
}
