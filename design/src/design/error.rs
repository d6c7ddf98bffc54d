//! Errors of design and analysis.

use super::length::TargetFigure;
use super::limits::{MAX_LONG_STATES, MOST_STATES_AT_106_BITS, MOST_STATES_AT_512_BITS};
use crate::lti::LtiError;
use hybank_core::messages::Number;
use hybank_core::spec::{SpecError, WordLengths};
use hybank_core::units::FastPeriods;
use hybank_linalg::LinalgError;
use hybank_sampling::SamplingError;
use hybank_verify::analog::AnalogError;
use hybank_verify::verify::VerifyError;

/// Why a bank could not be designed or analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// The spec breaks a rule for specs.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A filter of the spec is not a valid front end.
    #[error("{place}: {source}")]
    Analog {
        /// Which filter: the target's or a channel's.
        place: String,
        /// What is wrong with it.
        source: AnalogError,
    },
    /// A property of a system could not be computed.
    #[error(transparent)]
    Lti(#[from] LtiError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
    /// No certificate was found at any gamma that was tried: up to 10 % above the computed norm in general.
    #[error(
        "the computed gamma could not be proven: for an error system of {states} states no certificate passes at any gamma that \
         was tried (in 512 bits up to {MAX_LONG_STATES} states){}; the front ends may be too stiff or the channels too nearly equal",
        failure_text(.failure.as_deref())
    )]
    NotCertified {
        /// States of the error system.
        states: usize,
        /// The first computation of the search that failed, if one did.
        failure: Option<Box<DesignError>>,
    },
    /// The caller did not ask for a proof.
    #[error("no proof was looked for")]
    ProofSkipped,
    /// The time limit or the caller ended the design.
    #[error(
        "the design was ended before it was complete: a bank that it has is the best so far, and its gamma may lie above the \
         least"
    )]
    Stopped,
    /// The time limit or the caller ended the design before it had a bank.
    #[error("the design was ended before it had a bank: {remedy}")]
    StoppedWithoutBank {
        /// The way out.
        remedy: &'static str,
    },
    /// The error system is too large for the search for a proof.
    #[error("a proof is looked for up to {limit} states of the error system, this bank's has {states}")]
    NotSearched {
        /// Its states.
        states: usize,
        /// Most states.
        limit: usize,
    },
    /// The proof that was found does not prove the gammas.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// At the requested scale the integers that fit their bits are zero, or so small that they do nothing.
    #[error(
        "with fraction_bits = {fraction_bits} the integer taps are zero, or too small to do better than zero output: the taps fit their bits up to fraction_bits = {fitting}; give about that, or leave it out"
    )]
    TinyTaps {
        /// The scale.
        fraction_bits: i32,
        /// The finest scale at which no tap is clipped.
        fitting: i32,
    },
    /// The most bits that integer taps may have lose more than is allowed.
    #[error(
        "integer taps of {bits} lose {best:.3} dB of SNR or more, and loss_db = {allowed} is allowed: allow more bits, or a \
         larger loss"
    )]
    WordsLoseMore {
        /// The most that were allowed.
        bits: WordLengths,
        /// What they lose, in decibels.
        best: f64,
        /// The most that may be lost.
        allowed: f64,
    },
    /// The settings of `separation` lack the channels in units of the slow period.
    #[error(
        "method = \"separation\" was called without its channels at the slow rate; this is a fault of hybank, please report \
         the spec"
    )]
    NoSlowRate,
    /// The sinc comparison needs the Nyquist rate: as many channels as the ratio.
    #[error(
        "method = \"sinc\" needs as many distinct channels as the ratio (N = M), got {channels} channels and ratio {ratio}; \
         channels that sample at the same instant count as one: use \"fir\", \"iir\" or \"h2\""
    )]
    SincNeedsNyquist {
        /// N.
        channels: usize,
        /// M.
        ratio: usize,
    },
    /// Sample instants that do not determine a band-limited signal.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The spec says nothing of the band of the signal.
    #[error(
        "the spec states no band of the signal, without which samples at any instants tell nothing; add [signal] band = .."
    )]
    NoBand,
    /// The bank carries no spec, so its front ends are unknown.
    #[error(
        "this bank carries no spec (\"spec\": null): its front ends are unknown, so its error cannot be computed"
    )]
    NoSpec,
    /// One delay error per channel.
    #[error("{given} delay errors were given for {channels} channels: give one for each channel, in seconds")]
    DelayErrorCount {
        /// Numbers given.
        given: usize,
        /// N.
        channels: usize,
    },
    /// One filter per channel, all of one length.
    #[error(
        "{lists} filters were given for {channels} channels: give one of the same length for each channel"
    )]
    TapCount {
        /// Filters given.
        lists: usize,
        /// N.
        channels: usize,
    },
    /// Latency and delays are so far apart that the lifted system is too large.
    #[error(
        "latency {latency} and delays up to {longest_delay} need delay chains of {} states, at most \
         {limit} are supported: check the unit of the delays (seconds), and bring latency and delays closer together",
        Number(*.states)
    )]
    TooLate {
        /// m0, fast samples.
        latency: usize,
        /// The largest delay.
        longest_delay: FastPeriods,
        /// States of all delay chains.
        states: f64,
        /// Most states.
        limit: usize,
    },
    /// No number of taps reaches the figure that was asked for.
    #[error(
        "an {figure} of {wanted:.1} dB is out of reach: no bank of latency {latency} has more than {best:.1} dB; ask for \
         less, give taps instead, allow a longer latency, or state less noise"
    )]
    FigureOutOfReach {
        /// Which.
        figure: TargetFigure,
        /// Decibels.
        wanted: f64,
        /// The most that any number of taps reaches, in decibels.
        best: f64,
        /// m0, fast samples.
        latency: usize,
    },
    /// The bank of least gamma misses the figure that was asked for, whatever its length.
    #[error(
        "no bank of least gamma of up to {taps} taps has the {figure} of {wanted:.1} dB that was asked for, the best has {best:.1} \
         dB: it does not minimise the mean square; use method = \"h2\", ask for less, or give taps"
    )]
    FigureMissed {
        /// Which.
        figure: TargetFigure,
        /// Decibels.
        wanted: f64,
        /// The best of the lengths that were designed, in decibels.
        best: f64,
        /// The longest of them.
        taps: usize,
    },
    /// No tap sees a sample that has to do with the reference.
    #[error(
        "at latency {latency} filters with taps = {taps} see no sample that has to do with the output: they suit latencies \
         {shortest} to {longest}; choose one of these, leave the latency out to have the best one \
         chosen, or give more taps"
    )]
    OutOfReach {
        /// m0, fast samples.
        latency: usize,
        /// Taps per channel.
        taps: usize,
        /// The shortest latency that is reached.
        shortest: usize,
        /// The longest one.
        longest: usize,
    },
    /// A bank's recursive filters are unstable.
    #[error(
        "state_space.a has spectral radius {radius}, so the bank is unstable and its output would grow without bound; \
         it must be below 1"
    )]
    UnstableBank {
        /// The largest modulus of an eigenvalue.
        radius: f64,
    },
    /// No Riccati equation could be solved, not even at the largest gamma.
    #[error(
        "no filters were found: the Riccati equation of {states} states could not be solved {} (in 106 bits up to \
         {MOST_STATES_AT_106_BITS} states, in 512 up to {MOST_STATES_AT_512_BITS}); try method = \"fir\", a shorter latency, or move \
         nearly equal delays apart",
        level_text(*.gamma)
    )]
    RiccatiFailed {
        /// The largest gamma tried; `None` for the mean-square optimum.
        gamma: Option<f64>,
        /// States of the plant.
        states: usize,
    },
}

fn level_text(gamma: Option<f64>) -> String {
    gamma.map_or_else(|| "for the least mean square".to_owned(), |gamma| format!("at gamma = {gamma}"))
}

fn failure_text(failure: Option<&DesignError>) -> String {
    failure.map_or_else(String::new, |failure| format!(" ({failure})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_square_is_no_level_of_gamma() {
        let failed = |gamma: Option<f64>| DesignError::RiccatiFailed { gamma, states: 3 }.to_string();
        assert!(failed(None).contains("for the least mean square"));
        assert!(failed(Some(0.5)).contains("at gamma = 0.5"));
    }
}
