//! How well each converter is known.

use hybank_core::spec::{HALF_WIDTH, Spec};
use hybank_core::units::FastPeriods;

/// Standard deviations of the errors of a converter, which are Gaussian and constant while a recording
/// lasts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Deviations {
    pub(crate) delay: FastPeriods,
    /// As a share of the gain.
    pub(crate) gain: f64,
    /// Of full scale, or in the scale of a signal.
    pub(crate) offset: f64,
}

impl Deviations {
    /// Of the converters of a spec, by its `[uncertainty]`: a half-width of a 95 % interval of the normal
    /// law is 1.96 of them.
    pub(crate) fn of_spec(spec: &Spec) -> Vec<Self> {
        let (table, count) = (spec.uncertainty.clone().unwrap_or_default(), spec.channels.len());
        let (delays, gains, offsets) = (table.delays(count), table.gains(count), table.offsets(count));
        let of = |i: usize| Self {
            delay: (delays[i] * (1.0 / HALF_WIDTH)).in_fast_periods(spec.fast_period),
            gain: gains[i] / HALF_WIDTH,
            offset: offsets[i] / HALF_WIDTH,
        };
        (0..count).map(of).collect()
    }

    /// Of the converters of a spec with uncertain delays or gains; none if all are exact.
    pub(super) fn uncertain(spec: &Spec) -> Vec<Self> {
        let all = Self::of_spec(spec);
        let uncertain = all.iter().any(|deviations| deviations.delay.0 > 0.0 || deviations.gain > 0.0);
        if uncertain { all } else { Vec::new() }
    }

    /// A delay that is off by a Gaussian error of deviation s turns a sample of the frequency w by a random
    /// phase, whose mean is chi = e^{-(w s)^2 / 2}.
    pub(crate) fn mean_phase(&self, w: f64) -> f64 {
        (-0.5 * (w * self.delay.0).powi(2)).exp()
    }

    /// 1 - chi^2, the power of what the random phase has beside its mean.
    pub(crate) fn phase_power(&self, w: f64) -> f64 {
        -(-(w * self.delay.0).powi(2)).exp_m1()
    }

    /// The power of what a sample has beside its mean, relative to the sample without errors.
    pub(crate) fn power(&self, w: f64) -> f64 {
        self.phase_power(w) + self.gain * self.gain
    }
}
