//! Sizes with which a design fits into the memory of a machine with 8 GiB.

use super::error::At;
use super::limits::within;
use super::{FilterSpec, FrameLayout, SignalSpectrum, Spec, SpecError, frames};
use crate::units::GridTime;

/// Most states of all distinct front ends and of the signal's filter together: a step of the smoother keeps
/// two matrices of this order for each sample of a frame.
pub const MAX_FRONT_END_STATES: usize = 512;

/// Largest order of the matrices of a design, that of the error system: the states of the front ends, of the
/// delay chains between them and the latency, and of the filters. A matrix takes 128 MiB, and a norm holds
/// about twenty of them.
pub const MAX_ERROR_STATES: usize = 4096;

/// Poles of the filter of a signal in a band, at most.
const BAND_POLES: usize = 16;

impl Spec {
    /// The sizes of the design problem, with what is chosen later left out.
    pub(super) fn check_sizes(&self, layout: &FrameLayout) -> Result<(), SpecError> {
        frames::check_size(layout, self.design.is_coupled()).at("channel")?;
        let front_ends = self.front_end_states();
        let rule = format!(
            "the distinct filters of the channels, the target and the signal have at most {MAX_FRONT_END_STATES} poles in all; \
             give channels that are alike one filter"
        );
        within(front_ends as f64, 0.0..=MAX_FRONT_END_STATES as f64, "poles", rule).at("channel")?;
        let plant = front_ends as f64 + self.chain_states(layout);
        let frames = self.design.taps.unwrap_or_default().div_ceil(self.ratio);
        let filters = match self.is_fir() {
            true => (layout.count() * frames.saturating_sub(1)) as f64,
            false => plant,
        };
        let rule = format!(
            "front ends, delays, latency and filters have at most {MAX_ERROR_STATES} states in all, the order of the \
             matrices of the design; use fewer taps or channels, or a shorter latency"
        );
        let path = if filters > plant { "design.taps" } else { "latency" };
        within(plant + filters, 0.0..=MAX_ERROR_STATES as f64, "states", rule).at(path)
    }

    fn front_end_states(&self) -> usize {
        let mut distinct: Vec<&FilterSpec> = vec![&self.target];
        for channel in &self.channels {
            if !distinct.contains(&&channel.filter) {
                distinct.push(&channel.filter);
            }
        }
        let poles = |filter: &FilterSpec| filter.degrees().1;
        let signal = self.signal.as_ref().map_or(0, |signal| match &signal.spectrum {
            SignalSpectrum::Band(_) => BAND_POLES,
            SignalSpectrum::Filter(filter) => poles(filter),
        });
        signal + distinct.into_iter().map(poles).sum::<usize>()
    }

    /// One state for each whole slow period by which a sample, of a converter or of the output, is older
    /// than the newest one.
    fn chain_states(&self, layout: &FrameLayout) -> f64 {
        let delays = layout.waited_delays(&self.delays()).into_iter().map(GridTime::in_fast_periods);
        let outputs = (0..self.ratio).filter_map(|p| Some(p as f64 - self.latency? as f64));
        let instants: Vec<f64> = delays.map(|delay| -delay.0).chain(outputs).collect();
        let newest = instants.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        instants.iter().map(|instant| ((newest - instant) / self.ratio as f64).floor()).sum()
    }
}
