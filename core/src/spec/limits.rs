//! Ranges of the numbers in a spec, each with its reason.

use super::{FrameLayout, SpecProblem};
use crate::runtime::Nonlinearity;
use crate::units::{FastPeriods, Hertz, Seconds};
use std::ops::RangeInclusive;

/// Largest M. The designer factors dense matrices of M + N rows at every frequency; the largest
/// interleaved converters have a few hundred.
pub const MAX_RATIO: usize = 1024;

/// Largest number of channels N; see [`MAX_RATIO`].
pub const MAX_CHANNELS: usize = 1024;

/// Most fast samples and samples of the converters per frame, together: the time and the matrices of a
/// design grow with their square.
pub(super) const MAX_FRAME: usize = 1024;

/// The same for designs that couple all samples of a frame, which are all but mean-square taps: they keep
/// their responses at hundreds of frequencies, up to 4 GiB.
pub(super) const MAX_COUPLED_FRAME: usize = 384;

/// Most taps per channel, for every FIR method.
pub const MAX_TAPS: usize = 65_536;

/// Most taps of all channels together for the method `fir`: the Hessian of its solver is dense, 512 MiB at
/// this size, and there are three of them.
pub const MAX_OPTIMISED_TAPS: usize = 8192;

/// Largest latency and largest delay in fast periods.
pub const MAX_LATENCY: usize = 65_536;

/// Largest order of a spec; banks of the designer have fewer states.
pub const MAX_STATES: usize = 65_536;

/// Most samples of all channels that an output sample of the method `h2` with taps sees: the least squares
/// take a gigabyte at this size.
const MAX_SAMPLES_SEEN: usize = 2048;

/// Largest SNR or SFDR that can be asked for: doubles have no more.
pub const MAX_TARGET_DB: f64 = 300.0;

/// Largest loss by order reduction of a spec; a larger one would leave no state.
pub const MAX_REDUCTION_LOSS_DB: f64 = 400.0;

/// Largest loss by integer taps; one that loses more is of other taps.
const MAX_WORD_LOSS_DB: f64 = 20.0;

/// Largest share by which gamma may exceed its optimum; no bank that is worth anything is so far from it.
const MAX_GAMMA_MARGIN: f64 = 1e6;

/// Most bits of a converter; finer steps than these are lost in doubles beside full scale.
const MAX_CONVERTER_BITS: u32 = 32;

/// Largest jitter in fast periods: instants that are off by more say nothing of the signal.
const MAX_JITTER: f64 = 1.0;

/// Largest and, inverted, smallest size of a converter's gain. 120 dB from nominal a 24-bit converter has
/// four bits left or clips nearly always, so such a number is in the wrong unit.
const MAX_GAIN: f64 = 1e6;

/// Largest entry of a matrix, pole, zero, tap or gamma: squares and their sums still fit a double.
pub(crate) const MAX_ENTRY: f64 = 1e150;

/// Fast periods in seconds, and rates in hertz: rates and squares still fit a double.
const FAST_PERIODS: RangeInclusive<f64> = 1e-100..=1e100;

pub(super) fn range(value: f64, unit: &'static str, rule: impl Into<String>) -> SpecProblem {
    SpecProblem::Range { value, unit, rule: rule.into() }
}

/// A value within its range, or the rule. NaN is outside.
///
/// # Errors
/// [`SpecProblem`] with the rule.
pub fn within(
    value: f64,
    range_of: RangeInclusive<f64>,
    unit: &'static str,
    rule: impl Into<String>,
) -> Result<(), SpecProblem> {
    if range_of.contains(&value) { Ok(()) } else { Err(range(value, unit, rule)) }
}

/// h: positive, with a margin to the ends of double precision for rates and squares.
pub(crate) fn check_fast_period(h: Seconds) -> Result<(), SpecProblem> {
    within(h.0, FAST_PERIODS, "s", "the fast period must be positive, between 1e-100 and 1e100 seconds")
}

/// The sample rate of a converter.
pub(super) fn check_rate(rate: Hertz) -> Result<(), SpecProblem> {
    within(rate.0, FAST_PERIODS, "Hz", "a sample rate is positive, between 1e-100 and 1e100 hertz")
}

/// M.
pub(crate) fn check_ratio(ratio: usize) -> Result<(), SpecProblem> {
    let rule = format!("ratio is the number of fast samples per slow sample and must be 1 to {MAX_RATIO}");
    within(ratio as f64, 1.0..=MAX_RATIO as f64, "fast samples", rule)
}

/// m0.
pub(crate) fn check_latency(latency: usize) -> Result<(), SpecProblem> {
    let rule = format!(
        "latency is in fast samples and at most {MAX_LATENCY}, since every sample of latency is a state of the design problem"
    );
    within(latency as f64, 0.0..=MAX_LATENCY as f64, "fast samples", rule)
}

/// D_i, in seconds and in fast periods.
pub(crate) fn check_delay(delay: Seconds, periods: FastPeriods) -> Result<(), SpecProblem> {
    if periods.0.abs() <= MAX_LATENCY as f64 {
        return Ok(());
    }
    let rule = format!("at most {MAX_LATENCY} fast periods are supported; check its unit");
    // Far beyond both ends the quotient is no number that says more.
    let found = if periods.0.is_finite() { format!("it is {periods}; ") } else { String::new() };
    Err(range(delay.0, "s", found + &rule))
}

/// N.
pub(crate) fn check_channel_count(count: usize) -> Result<(), SpecProblem> {
    let rule = format!("a bank has 1 to {MAX_CHANNELS} channels");
    within(count as f64, 1.0..=MAX_CHANNELS as f64, "channels", rule)
}

/// Taps per channel.
pub(crate) fn check_taps(taps: usize) -> Result<(), SpecProblem> {
    let rule = format!("a channel's filter has 1 to {MAX_TAPS} taps at the fast rate");
    within(taps as f64, 1.0..=MAX_TAPS as f64, "taps", rule)
}

/// Taps of all channels together, limited only for the method `fir`.
pub(crate) fn check_optimised_taps(taps: usize, channels: usize) -> Result<(), SpecProblem> {
    let rule = format!(
        "taps times channels is at most {MAX_OPTIMISED_TAPS} for the method fir; use fewer taps, or the method iir"
    );
    within(taps.saturating_mul(channels) as f64, 0.0..=MAX_OPTIMISED_TAPS as f64, "taps in all", rule)
}

/// Samples of the frames that the taps of an output sample reach.
pub(super) fn check_samples_seen(taps: usize, layout: &FrameLayout) -> Result<(), SpecProblem> {
    let seen = taps.div_ceil(layout.ratio()).saturating_mul(layout.count());
    let rule = format!(
        "the taps of one output sample reach at most {MAX_SAMPLES_SEEN} samples of all channels for the method h2; use fewer \
         taps, or h2 without taps"
    );
    within(seen as f64, 0.0..=MAX_SAMPLES_SEEN as f64, "samples", rule)
}

/// sigma_i, the rms of a converter's noise.
///
/// # Errors
/// [`SpecProblem`] with the rule.
pub fn check_noise(noise: f64) -> Result<(), SpecProblem> {
    let rule =
        "noise is the rms of the converter's noise relative to full scale, from 0 to 1; 1e-4 is -80 dB";
    within(noise, 0.0..=1.0, "of full scale", rule)
}

/// The resolution of a converter.
pub(super) fn check_converter_bits(bits: u32) -> Result<(), SpecProblem> {
    let rule = format!(
        "a converter has 1 to {MAX_CONVERTER_BITS} bits, its sign among them; leave it out for no rounding"
    );
    within(bits.into(), 1.0..=MAX_CONVERTER_BITS.into(), "bits", rule)
}

/// The jitter of sampling instants in fast periods; `seconds` is what a message states.
pub(super) fn check_jitter(periods: FastPeriods, seconds: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "jitter is the rms error of a sampling instant, 0 to {MAX_JITTER} fast periods; check its unit"
    );
    if (0.0..=MAX_JITTER).contains(&periods.0) { Ok(()) } else { Err(range(seconds, "s", rule)) }
}

/// g_i.
pub fn check_gain(gain: f64) -> Result<(), SpecProblem> {
    if (1.0 / MAX_GAIN..=MAX_GAIN).contains(&gain.abs()) {
        return Ok(());
    }
    let rule = format!(
        "gain is the factor of the converter's samples relative to nominal, {:e} to {MAX_GAIN:e} in size and \
         negative if it inverts; 1.01 is one per cent too much",
        1.0 / MAX_GAIN
    );
    Err(range(gain, "(factor)", rule))
}

/// Most coefficients of a nonlinearity: beyond them the polynomial follows single codes.
const MAX_NONLINEARITY: usize = 31;
/// Entries of the table of a nonlinearity: those of 4 to 12 bits.
const TABLE_ENTRIES: RangeInclusive<usize> = 16..=4096;

/// A curve that moves samples by more than a tenth of full scale is no error of a converter.
///
/// # Errors
/// [`SpecProblem`] for too many coefficients or entries, or one that is too large.
pub fn check_nonlinearity(nonlinearity: &Nonlinearity) -> Result<(), SpecProblem> {
    let values = nonlinearity.values();
    match nonlinearity {
        Nonlinearity::Polynomial(_) => {
            let rule = format!("give the coefficients of T_2, T_3, .., at most {MAX_NONLINEARITY} of them");
            within(values.len() as f64, 0.0..=MAX_NONLINEARITY as f64, "coefficients", rule)?;
        }
        Nonlinearity::Table { .. } => {
            let is_table = values.len().is_power_of_two() && TABLE_ENTRIES.contains(&values.len());
            let rule = "a table has an entry for each of 2^b equal parts from -1 to 1, b from 4 to 12";
            is_table.then_some(()).ok_or_else(|| range(values.len() as f64, "entries", rule.to_owned()))?;
        }
    }
    let rule =
        "a coefficient or entry is relative to full scale, -0.1 to 0.1; of 12 bits half a step is 0.00024";
    values.iter().try_for_each(|&a| within(a, -0.1..=0.1, "of full scale", rule))
}

/// o_i: a converter whose offset exceeds full scale delivers nothing but clipped samples.
///
/// # Errors
/// [`SpecProblem`] with the rule.
pub fn check_offset(offset: f64) -> Result<(), SpecProblem> {
    let rule = "offset is what the converter adds to its samples relative to full scale, -1 to 1; 5 steps of a \
                12-bit converter are 5 / 2048";
    within(offset, -1.0..=1.0, "of full scale", rule)
}

/// States of a recursive bank.
pub(crate) fn check_order(order: usize) -> Result<(), SpecProblem> {
    let rule = format!(
        "order is the largest number of states of the bank, 0 to {MAX_STATES}; leave it out for no limit"
    );
    within(order as f64, 0.0..=MAX_STATES as f64, "states", rule)
}

/// The SNR for which taps are chosen.
pub(super) fn check_target_snr(db: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "target_snr_db is the ratio of the signal to error and noise together, 0 to {MAX_TARGET_DB} dB; 90 is that of \
         15 bits"
    );
    within(db, 0.0..=MAX_TARGET_DB, "dB", rule)
}

/// The SFDR for which taps are chosen.
pub(super) fn check_target_sfdr(db: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "target_sfdr_db is the distance of the largest image of a tone in the band, 0 to {MAX_TARGET_DB} dB"
    );
    within(db, 0.0..=MAX_TARGET_DB, "dB", rule)
}

/// Decibels that order reduction may lose.
pub(crate) fn check_reduction_loss(db: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "reduction_loss_db is the increase of the error that order reduction may cause, 0 to {MAX_REDUCTION_LOSS_DB} dB; \
         0 removes only states without effect"
    );
    within(db, 0.0..=MAX_REDUCTION_LOSS_DB, "dB", rule)
}

/// Decibels of SNR that integer taps may lose.
pub(super) fn check_word_loss(db: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "loss_db is how much of the SNR integer taps may lose, above 0 and at most {MAX_WORD_LOSS_DB} dB; 0.1 is usual"
    );
    within(db, f64::MIN_POSITIVE..=MAX_WORD_LOSS_DB, "dB", rule)
}

/// Relative excess over the optimal gamma.
pub(crate) fn check_gamma_margin(gamma_margin: f64) -> Result<(), SpecProblem> {
    let rule = format!(
        "gamma_margin is the share by which gamma may exceed its optimum, zero or more and at most {MAX_GAMMA_MARGIN}; \
         0.01 is one per cent"
    );
    within(gamma_margin, 0.0..=MAX_GAMMA_MARGIN, "(relative)", rule)
}
