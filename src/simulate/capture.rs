//! What all converters of a problem capture of one analog signal, beside what an ideal fast one gives.

use super::recording::Recording;
use super::response::{Instants, sample};
use super::source::Source;
use crate::analog::StrictlyProper;
use crate::design::Problem;

/// An analog signal, time in fast periods.
#[derive(Debug, Clone)]
pub enum Analog {
    /// Known in closed form.
    Known(Source),
    /// A recording, periodic and band-limited.
    Recorded(Recording),
}

/// The slow captures and the wanted fast samples of the same stretch of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// `channels[i][k]` = (phi_i * f)(k M - D_i).
    pub channels: Vec<Vec<f64>>,
    /// `target[n]` = (phi_0 * f)(n - m0), M samples for each tick.
    pub target: Vec<f64>,
}

/// Captures `ticks` slow ticks of `signal`.
pub fn capture(problem: &Problem, signal: &Analog, ticks: usize) -> Captured {
    let ratio = problem.ratio;
    let read = |front_end: usize, first: f64, step: f64, count: usize| {
        signal.filtered(&problem.front_ends[front_end], Instants { first, step, count })
    };
    let slow = |channel: &crate::design::problem::Channel| {
        read(channel.front_end, -channel.delay, ratio as f64, ticks)
    };
    Captured {
        channels: problem.channels.iter().map(slow).collect(),
        target: read(problem.target, -(problem.latency as f64), 1.0, ticks * ratio),
    }
}

impl Analog {
    fn filtered(&self, filter: &StrictlyProper, instants: Instants) -> Vec<f64> {
        match self {
            Self::Known(source) => sample(filter, source, instants),
            Self::Recorded(recording) => {
                recording.sample(filter, instants.first, instants.step, instants.count)
            }
        }
    }
}

/// What interleaving without any filter gives: each wanted fast sample is the slow sample whose instant lies
/// nearest, converters taken as alike.
pub fn interleaved(problem: &Problem, channels: &[Vec<f64>]) -> Vec<f64> {
    let ticks = channels.iter().map(Vec::len).min().unwrap_or(0);
    let period = problem.ratio as f64;
    let nearest = |n: usize| {
        let wanted = n as f64 - problem.latency as f64;
        problem
            .channels
            .iter()
            .zip(channels)
            .map(|(channel, samples)| {
                let tick = ((wanted + channel.delay) / period).round();
                let distance = (tick * period - channel.delay - wanted).abs();
                let value = if tick < 0.0 { 0.0 } else { samples.get(tick as usize).copied().unwrap_or(0.0) };
                (distance, value)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(0.0, |(_, value)| value)
    };
    (0..ticks * problem.ratio).map(nearest).collect()
}
