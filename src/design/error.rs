//! Errors of design and analysis.

use super::limits::{Effort, memory_text};
use crate::analog::AnalogError;
use crate::linalg::LinalgError;
use crate::lmi::LmiError;
use crate::lti::{LtiError, StateSpaceError};
use crate::sampling::SamplingError;
use crate::spec::SpecProblem;
use crate::units::FastPeriods;
use crate::verify::VerifyError;

/// Why a bank could not be designed or analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The spec breaks a rule for specs.
    #[error(transparent)]
    Spec(#[from] SpecProblem),
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
    /// Matrix sizes do not match.
    #[error(transparent)]
    Shapes(#[from] StateSpaceError),
    /// A linear matrix inequality was not well formed, or could not be set up.
    #[error(transparent)]
    Lmi(#[from] LmiError),
    /// Too many states for the bounded-real LMI.
    #[error(
        "solver = \"kyp\" solves the bounded-real LMI for up to {limit} states of the error system, this one has {states}: use \
         fewer taps or solver = \"sampled\""
    )]
    KypTooLarge {
        /// States of the plant and of the delay lines of its measurements.
        states: usize,
        /// Most states.
        limit: usize,
    },
    /// No certificate was found, not even for a gamma up to 10 % above the computed norm.
    #[error(
        "the computed gamma could not be proven: no certificate passes up to 10 % above it; the front ends are too stiff or \
         the channels too nearly equal for double precision"
    )]
    NotCertified,
    /// The caller did not ask for a proof.
    #[error("no proof was looked for")]
    ProofSkipped,
    /// The time limit or the caller ended the design.
    #[error(
        "the design was ended before it was complete: a bank that it has is the best so far, and its gamma may lie above the \
         least"
    )]
    Stopped,
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
    /// At the requested scale all taps round to zero.
    #[error(
        "with fraction_bits = {fraction_bits} all integer taps are zero: the taps fit their bits up to fraction_bits = {fitting}; give about that, or leave it out"
    )]
    AllZero {
        /// The scale.
        fraction_bits: i32,
        /// The finest scale at which no tap is clipped.
        fitting: i32,
    },
    /// At the requested scale the integers that fit their bits are so small that they do nothing.
    #[error(
        "with fraction_bits = {fraction_bits} the integer taps are too small to do better than zero output: the taps fit their bits up to fraction_bits = {fitting}; give about that, or leave it out"
    )]
    TinyTaps {
        /// The scale.
        fraction_bits: i32,
        /// The finest scale at which no tap is clipped.
        fitting: i32,
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
        "latency {latency} and delays up to {longest_delay} need delay chains of {states} states, at most \
         {limit} are supported: check the unit of the delays (seconds), and bring latency and delays closer together"
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
    /// No number of taps reaches the SNR that was asked for.
    #[error(
        "an SNR of {wanted:.1} dB is out of reach: no bank of latency {latency} has more than {best:.1} dB over the whole \
         spectrum of the signal, its floor outside the band included; ask for less, give taps instead, raise floor_db, \
         allow a longer latency, or state less noise"
    )]
    SnrOutOfReach {
        /// Decibels.
        wanted: f64,
        /// The most that any number of taps reaches, in decibels.
        best: f64,
        /// m0, fast samples.
        latency: usize,
    },
    /// The bank of least gamma misses the SNR that was asked for, whatever its length.
    #[error(
        "no bank of least gamma of up to {taps} taps has the SNR of {wanted:.1} dB that was asked for, the best has {best:.1} \
         dB: it does not minimise the mean square; use method = \"h2\", ask for less, or give taps"
    )]
    SnrMissed {
        /// Decibels.
        wanted: f64,
        /// The best of the lengths that were designed, in decibels.
        best: f64,
        /// The longest of them.
        taps: usize,
    },
    /// The design would take longer than ten minutes.
    #[error("this design would take about {effort}, and ten minutes are allowed: {remedy}")]
    TooLong {
        /// The estimate.
        effort: Effort,
        /// The way out.
        remedy: &'static str,
    },
    /// The design would need more memory than there is.
    #[error(
        "this design would take about {effort}, and this process may use {}: {remedy}",
        memory_text(*.memory)
    )]
    TooLarge {
        /// The estimate.
        effort: Effort,
        /// Bytes of memory.
        memory: f64,
        /// The way out.
        remedy: &'static str,
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
    /// A bank's state-space matrices have rows of unequal lengths.
    #[error("the bank's state-space matrices do not fit: expected {rows} rows of {cols} numbers")]
    RaggedStateSpace {
        /// Expected rows.
        rows: usize,
        /// Expected columns.
        cols: usize,
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
        "the Riccati equation could not be solved at gamma = {gamma}: the front ends are too stiff or the \
         channels too nearly equal for double precision; try method = \"fir\", or move nearly equal delays apart"
    )]
    RiccatiFailed {
        /// The largest gamma tried.
        gamma: f64,
    },
}
