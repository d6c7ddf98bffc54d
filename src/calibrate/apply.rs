//! A spec with the values that a calibration found.

use super::remark::Remark;
use super::result::{Calibration, ChannelEstimate};
use crate::spec::{HALF_WIDTH, PerChannel, Spec, UncertaintySpec};
use crate::units::Seconds;

/// `spec` with the values of `calibration` and an `[uncertainty]` table with their half-widths. Values that
/// were not fitted stay, and so do their half-widths. Delays that would be negative raise all
/// delays and the latency by whole fast periods.
pub fn applied(spec: &Spec, calibration: &Calibration) -> (Spec, Vec<Remark>) {
    let mut new = spec.clone();
    let h = spec.fast_period;
    for (channel, found) in new.channels.iter_mut().zip(&calibration.channels) {
        channel.delay = found.delay.map_or(channel.delay, |delay| delay.value.in_seconds(h));
        channel.gain = found.gain.map_or(channel.gain, |gain| gain.value);
        channel.offset = found.offset.map_or(channel.offset, |offset| offset.value);
        if let Some(cutoff) = found.cutoff {
            channel.filter = channel.filter.with_cutoff_scaled(cutoff.value);
        }
    }
    let remarks = raise(&mut new, h);
    new.uncertainty = Some(uncertainty(spec, calibration));
    (new, remarks)
}

/// Whole fast periods that make all delays positive.
fn raise(spec: &mut Spec, h: Seconds) -> Vec<Remark> {
    let least = spec.channels.iter().map(|channel| channel.delay / h).fold(0.0, f64::min);
    let periods = (-least).ceil() as usize;
    if periods == 0 {
        return Vec::new();
    }
    spec.channels.iter_mut().for_each(|channel| channel.delay += h * periods as f64);
    spec.latency = spec.latency.map(|latency| latency + periods);
    vec![Remark::Shifted { periods }]
}

fn uncertainty(spec: &Spec, calibration: &Calibration) -> UncertaintySpec {
    let before = spec.uncertainty.clone().unwrap_or_default();
    let h = spec.fast_period;
    let channels = || calibration.channels.iter();
    let delays = channels().map(|c| c.delay.map_or(Seconds(0.0), |d| d.sigma.in_seconds(h) * HALF_WIDTH));
    let gains = channels().map(|c| c.gain.map_or(0.0, |gain| gain.sigma * HALF_WIDTH));
    let offsets = channels().map(|c| c.offset.map_or(0.0, |offset| offset.sigma * HALF_WIDTH));
    let cutoffs = channels().map(|c| c.cutoff.map_or(0.0, |cutoff| cutoff.sigma / cutoff.value * HALF_WIDTH));
    let any = |is: fn(&ChannelEstimate) -> bool| calibration.channels.iter().any(is);
    UncertaintySpec {
        delay: if any(|c| c.delay.is_some()) {
            Some(PerChannel::Each(delays.collect()))
        } else {
            before.delay
        },
        gain: if any(|c| c.gain.is_some()) { Some(PerChannel::Each(gains.collect())) } else { before.gain },
        offset: if any(|c| c.offset.is_some()) {
            Some(PerChannel::Each(offsets.collect()))
        } else {
            before.offset
        },
        cutoff: if any(|c| c.cutoff.is_some()) {
            Some(PerChannel::Each(cutoffs.collect()))
        } else {
            before.cutoff
        },
        reference: Some(calibration.reference + 1),
    }
}
