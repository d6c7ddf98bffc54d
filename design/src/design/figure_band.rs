//! The band in which figures hold.

use super::problem::Problem;
use hybank_core::spec::{Band, Spec};
use hybank_core::units::{CyclesPerFastPeriod, Hertz};
use hybank_verify::analog::{StableFilter, resolved_band, signal};
use std::f64::consts::TAU;

/// Where a band comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BandSource {
    /// The spec's `[signal]`.
    Signal,
    /// What the target passes, as far as the channels sample fast enough.
    Target,
}

/// Frequencies of the analog input, and why these.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct FigureBand {
    /// 0 for a low-pass band.
    pub low_hertz: Hertz,
    /// Above `low_hertz`.
    pub high_hertz: Hertz,
    /// Why these.
    pub source: BandSource,
}

impl FigureBand {
    /// The band of the spec's `[signal]`: the stated one, or the half-power band of its filter. Without a
    /// signal the half-power band of the target, up to half the rate at which the channels sample together,
    /// f_N = min(1, N / M) / (2 h). A target that lies above f_N keeps its band: it is undersampled.
    pub(crate) fn new(spec: &Spec, problem: &Problem) -> Self {
        if let Some(Band { low, high }) = spec.signal.as_ref().and_then(|signal| signal.band()) {
            return Self { low_hertz: low, high_hertz: high, source: BandSource::Signal };
        }
        let edges =
            |filter: &StableFilter| filter.half_power_band().map(|w| Hertz(w.0 / TAU / spec.fast_period.0));
        if let Ok(Some(filter)) = signal(spec) {
            let [low_hertz, high_hertz] = edges(&filter);
            return Self { low_hertz, high_hertz, source: BandSource::Signal };
        }
        let [low, high] = edges(&problem.front_ends[problem.target]);
        let resolved = resolved_band(spec);
        let high = if low < resolved && high > resolved { resolved } else { high };
        Self { low_hertz: low, high_hertz: high, source: BandSource::Target }
    }

    /// The ends in cycles per fast period.
    pub(crate) fn cycles(&self, spec: &Spec) -> [CyclesPerFastPeriod; 2] {
        [self.low_hertz, self.high_hertz].map(|end| end.per_fast_period(spec.fast_period))
    }
}
