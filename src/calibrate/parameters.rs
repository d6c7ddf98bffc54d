//! What is fitted, and the present values.

use super::model::Model;

/// Which values of the channels are fitted; the others keep those of the spec.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fit {
    /// Delays.
    pub delay: bool,
    /// Gains.
    pub gain: bool,
    /// Offsets.
    pub offset: bool,
    /// Cut-off frequencies of the front ends.
    pub cutoff: bool,
}

impl Default for Fit {
    /// Delays, gains and offsets.
    fn default() -> Self {
        Self { delay: true, gain: true, offset: true, cutoff: false }
    }
}

/// A parameter of a channel. Gains and cut-offs are fitted by their logarithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Delay,
    Gain,
    Cutoff,
}

impl Fit {
    /// The fitted parameters of a channel that is not the reference.
    pub(super) fn kinds(self) -> Vec<Kind> {
        let all = [(self.delay, Kind::Delay), (self.gain, Kind::Gain), (self.cutoff, Kind::Cutoff)];
        all.into_iter().filter_map(|(is_fitted, kind)| is_fitted.then_some(kind)).collect()
    }
}

/// One fitted parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parameter {
    /// From 0; never the reference.
    pub(super) channel: usize,
    pub(super) kind: Kind,
}

/// The present values of all channels.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub(super) parameters: Vec<Parameter>,
    /// Fast periods.
    pub(super) delays: Vec<f64>,
    /// ln(g_i / nominal).
    pub(super) ln_gains: Vec<f64>,
    /// ln c_i.
    pub(super) ln_cutoffs: Vec<f64>,
}

impl Point {
    /// The values of the spec.
    pub(super) fn nominal(model: &Model, fit: Fit, reference: usize) -> Self {
        let others = (0..model.channels()).filter(|&i| i != reference);
        let of = |channel| fit.kinds().into_iter().map(move |kind| Parameter { channel, kind });
        Self {
            parameters: others.flat_map(of).collect(),
            delays: model.delays.iter().map(|delay| delay.0).collect(),
            ln_gains: vec![0.0; model.channels()],
            ln_cutoffs: vec![0.0; model.channels()],
        }
    }

    /// g_i.
    pub(super) fn gain(&self, i: usize, model: &Model) -> f64 {
        model.gains[i] * self.ln_gains[i].exp()
    }

    /// Adds a step of all parameters.
    pub(super) fn advance(&mut self, step: impl Iterator<Item = f64>) {
        for (parameter, step) in self.parameters.iter().zip(step) {
            let values = match parameter.kind {
                Kind::Delay => &mut self.delays,
                Kind::Gain => &mut self.ln_gains,
                Kind::Cutoff => &mut self.ln_cutoffs,
            };
            values[parameter.channel] += step;
        }
    }

    /// The index of a parameter.
    pub(super) fn index(&self, channel: usize, kind: Kind) -> Option<usize> {
        self.parameters.iter().position(|&p| p == Parameter { channel, kind })
    }
}
