//! What designs and the choices before them are given.

use super::DesignError;
use super::deviations::Deviations;
use super::limits::Stop;
use super::merging::{MergedChannels, Repeats};
use super::methods::MethodSettings;
use super::methods::robust_fir::robust_box;
use super::problem::{Problem, common_delay};
use hybank_core::spec::{Method, Spec};
use hybank_verify::analog::SignalFilter;

/// Bits of a converter of which nothing is said.
const USUAL_BITS: u32 = 16;

/// What follows the designs that a choice compares, and ends them.
#[derive(Clone, Copy)]
pub(super) struct SizingControl<'a> {
    /// Called with the number of designs that were compared.
    pub(super) observer: &'a dyn Fn(usize),
    /// When to end.
    pub(super) stop: &'a Stop,
}

impl SizingControl<'_> {
    /// So many designs were compared, and another one begins.
    pub(super) fn after(self, designs: usize) -> Result<(), DesignError> {
        (self.observer)(designs);
        self.go_on()
    }

    /// A design that was ended early says nothing about its length or latency.
    pub(super) fn go_on(self) -> Result<(), DesignError> {
        if self.stop.is_due() { Err(DesignError::Stopped) } else { Ok(()) }
    }
}

/// The settings of the method, with so many taps.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`] at the slow rate.
pub(super) fn settings(spec: &Spec, taps: usize) -> Result<MethodSettings, DesignError> {
    let at_slow_rate = || {
        let signal = SignalFilter::written_out(spec);
        let slow = Spec { fast_period: spec.fast_period * spec.ratio as f64, signal, ..spec.per_sample() };
        // The method replaces the latency. With this one no delay chain is long.
        let problem = Problem::new(&slow, common_delay(&slow))?;
        Ok::<_, DesignError>(problem.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem)
    };
    let separate = spec.design.method == Method::Separation;
    Ok(MethodSettings {
        taps,
        robust: robust_box(spec),
        deviations: if spec.design.method == Method::H2 { Deviations::uncertain(spec) } else { Vec::new() },
        gamma_margin: spec.design.gamma_margin,
        at_slow_rate: separate.then(at_slow_rate).transpose()?,
        ..MethodSettings::default()
    })
}

/// The channels as they are designed; `apart` where their errors are their own.
pub(super) fn merged(spec: &Spec, problem: &Problem, apart: bool) -> Result<MergedChannels, DesignError> {
    if apart {
        return Ok(problem.merge_channels(Repeats::Never));
    }
    problem.merge_channels(Repeats::of(spec)).of_unit_size()
}

/// The spec with the usual resolution, if no channel has any noise.
pub(super) fn with_usual_noise(spec: &Spec) -> Spec {
    let mut noisy = spec.clone();
    if spec.channels.iter().all(|channel| channel.sample_noise() == 0.0 && channel.jitter.0 == 0.0) {
        noisy.channels.iter_mut().for_each(|channel| channel.bits = Some(USUAL_BITS));
    }
    noisy
}
