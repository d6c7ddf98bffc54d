//! What the words about figures need to know of a bank.

use crate::bank::{Bank, SynthesisFilters};
use crate::spec::{ChannelSpec, Method, Spec};

/// How a bank was designed, and for what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Of the design.
    pub method: Method,
    /// Whether the filters are recursive, so that taps do not limit them.
    pub is_recursive: bool,
    /// The ratio M of the rates.
    pub ratio: usize,
    /// The number of channels.
    pub channels: usize,
    /// What the noise of the converters is.
    pub noise: NoiseSources,
    /// Whether the spec has uncertain cut-offs, which the signal-to-noise ratio does not count.
    pub has_uncertain_cutoffs: bool,
}

/// What the spec states of the noise of some converter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NoiseSources {
    /// The rounding to bits.
    pub bits: bool,
    /// Noise.
    pub noise: bool,
    /// Jitter.
    pub jitter: bool,
}

impl NoiseSources {
    fn of(spec: &Spec) -> Self {
        let any = |states: fn(&ChannelSpec) -> bool| spec.channels.iter().any(states);
        Self {
            bits: any(|channel| channel.bits.is_some()),
            noise: any(|channel| channel.noise > 0.0),
            jitter: any(|channel| channel.jitter.0 > 0.0),
        }
    }
}

impl Setup {
    pub(super) fn new(bank: &Bank, spec: &Spec) -> Self {
        let channels = spec.channels.len();
        let cutoffs = spec.uncertainty.as_ref().map(|table| table.cutoffs(channels));
        Self {
            method: bank.method,
            is_recursive: matches!(bank.filters, SynthesisFilters::StateSpace(_)),
            ratio: bank.ratio,
            channels,
            noise: NoiseSources::of(spec),
            has_uncertain_cutoffs: cutoffs.is_some_and(|shares| shares.into_iter().any(|share| share > 0.0)),
        }
    }
}
