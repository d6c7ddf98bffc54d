//! Warnings about a bank.

use super::text::six_digits;
use crate::bank::{Bank, FixedPoint, SynthesisFilters};
use crate::design::{GammaScale, MeanAnalysis};
use crate::spec::Method;

/// Warning for a bank whose taps are all zero.
const ALL_ZERO: &str = "all integer taps are zero, so the output is zero: no better integers of these bits were found; \
                        give more bits or another fraction_bits";

/// Warning for a bank that reaches nothing.
const USELESS_BANK: &str = "gamma is no better than that of zero output: the front ends or the delays leave nothing to \
                            reconstruct, or the latency does not suit the taps";

/// Noise gains above this cause a warning: 20 dB.
const LARGE_NOISE_GAIN: f64 = 10.0;
/// A gamma above this share of that of zero output is no better than zero output.
const USELESS: f64 = 0.99;

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

/// What a user of the bank should know: that it does nothing, is no better than silence, or amplifies noise.
pub fn doubts(bank: &Bank, mean: &MeanAnalysis, scale: &GammaScale) -> Vec<String> {
    let is_useless = bank.gamma.norm.is_some_and(|gamma| gamma > USELESS * scale.zero_output);
    let warnings = [
        bank.fixed_point.as_ref().is_some_and(FixedPoint::is_zero).then(|| ALL_ZERO.to_owned()),
        is_useless.then(|| USELESS_BANK.to_owned()),
        (mean.noise_gain > LARGE_NOISE_GAIN).then(|| large_noise_gain(bank, mean.noise_gain)),
    ];
    warnings.into_iter().flatten().collect()
}
