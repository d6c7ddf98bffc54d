//! The exact discrete-time equivalent of the hybrid system, lifted to one step per slow period (thesis 5.2,
//! Theorem 5.1).
//!
//! The input drives the analog state through one slow period. Each sample, of a slow channel or of the
//! ideal fast one, is a linear output C x of that state at some instant of the period. These instants
//! divide the period into segments. Over a segment of length l the state becomes e^{A l} x + w. Here w does
//! not depend on the other segments, and w w* = G(l) is the finite-time Gramian. Any square root of G(l) is
//! a norm-equivalent input (thesis 5.16). Propagating the state from instant to instant therefore gives the
//! whole lifted system with its feedthroughs, for any real delays. No matrix is squared on the way.
//!
//! Choice of the time origin: a common shift of all instants changes neither the norm of the error system
//! nor the filters. The latest instant is placed at the end of the period. All samples taken within that
//! period then come *after* the state at its beginning and need no delay chains. An older sample is the
//! sample at the same phase of the period, delayed by whole periods.

use super::problem::Problem;
use crate::lti::StateSpace;
use crate::lti::exponential::{StateTransition, gramian_root};
use hybank_core::units::Timeline;
use hybank_linalg::Mat;
use std::ops::Range;

/// The lifted analysis side.
#[derive(Debug, Clone)]
pub(super) struct Lifted {
    /// x+ = A x + B w, [y; z] = C x + D w.
    pub(super) system: StateSpace,
    /// For each measurement the states of its delay chain; the first state holds the newest sample.
    pub(super) chains: Vec<Range<usize>>,
    /// The system without the delays of its outputs by whole periods.
    pub(super) undelayed: StateSpace,
    /// These delays, one for each output, in slow periods.
    pub(super) delays: Vec<usize>,
}

/// What is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SampledChannel {
    /// Index of the filter that is sampled.
    front_end: usize,
    /// The sample over that filter's output.
    gain: f64,
    /// Index of its instant.
    instant: usize,
}

/// The exactly equivalent lifted system of `problem`.
pub(super) fn lift(problem: &Problem) -> Lifted {
    let timeline = problem.timeline();
    let delays = delays(&timeline);
    let undelayed = follow_state(problem, &timeline, &samples(problem, &timeline));
    let ends = delays.iter().scan(undelayed.order(), |end, &delay| {
        *end += delay;
        Some(*end)
    });
    let chains = ends.zip(&delays).map(|(end, &delay)| if delay == 0 { 0..0 } else { end - delay..end });
    let chains = chains.take(problem.channels.len()).collect();
    let system = undelayed.series(&StateSpace::delays(&delays)).compress_inputs();
    Lifted { system, chains, undelayed: undelayed.compress_inputs(), delays }
}

/// The samples of all outputs, the measurements first.
fn samples(problem: &Problem, timeline: &Timeline) -> Vec<SampledChannel> {
    let measured = problem.channels.iter().map(|channel| (channel.front_end, channel.gain));
    let references = (0..problem.ratio).map(|_| (problem.target, 1.0));
    let sample = |(index, (front_end, gain))| SampledChannel { front_end, gain, instant: timeline.of(index) };
    measured.chain(references).enumerate().map(sample).collect()
}

/// The whole slow periods by which each output is delayed in addition.
fn delays(timeline: &Timeline) -> Vec<usize> {
    timeline.delay_periods().iter().map(|&periods| periods as usize).collect()
}

/// Propagates the joint analog state through one period. The outputs of the returned system are the
/// samples, without their delays by whole periods.
fn follow_state(problem: &Problem, timeline: &Timeline, samples: &[SampledChannel]) -> StateSpace {
    let joint = JointState::new(problem);
    let mut rows = vec![(Mat::zeros(1, 0), Mat::zeros(1, 0)); samples.len()];
    let mut state = Mat::identity(joint.order(), joint.order());
    let mut input = Mat::zeros(joint.order(), 0);
    let mut before = timeline.start();
    for (instant, &now) in timeline.instants().iter().enumerate() {
        (state, input) = joint.advance(&state, &input, now.since(before).0);
        before = now;
        for (row, sample) in rows.iter_mut().zip(samples).filter(|(_, sample)| sample.instant == instant) {
            let output = joint.c.rows(sample.front_end, 1) * sample.gain;
            *row = (&output * &state, &output * &input);
        }
    }
    let width = input.ncols();
    let (c, d): (Vec<Mat>, Vec<Mat>) =
        rows.into_iter().map(|(c, d)| (c, d.resize_horizontally(width, 0.0))).unzip();
    let stacked = |rows: &[Mat]| hybank_linalg::vstack(&rows.iter().collect::<Vec<_>>());
    StateSpace::new(state, input, stacked(&c), stacked(&d))
}

/// The filter W of the signal and all distinct front ends, which it drives: dx/dt = A x + B f, row i of C
/// reads front end i. The states of W come first:
///
/// ```text
/// A = [ A_W                ]   B = [ B_W     ]   C = [ 0  C_1     ]
///     [ B_1 C_W  A_1       ]       [ B_1 D_W ]       [ 0      C_2 ]
///     [ B_2 C_W       A_2  ]       [ B_2 D_W ]
/// ```
///
/// Without a signal the front ends stand side by side, driven by the same input.
pub(super) struct JointState {
    transition: StateTransition,
    b: Mat,
    c: Mat,
}

impl JointState {
    pub(super) fn new(problem: &Problem) -> Self {
        let front_ends = &problem.front_ends;
        let b: Vec<&Mat> = front_ends.iter().map(|filter| filter.b()).collect();
        let c: Vec<&Mat> = front_ends.iter().map(|filter| filter.c()).collect();
        let (b, c) = (hybank_linalg::vstack(&b), hybank_linalg::block_diagonal(&c));
        let Some(signal) = &problem.signal else {
            let blocks = front_ends.iter().map(|filter| filter.a().clone()).collect();
            return Self { transition: StateTransition::new(blocks), b, c };
        };
        let blocks: Vec<&Mat> = std::iter::once(signal.a()).chain(front_ends.iter().map(|f| f.a())).collect();
        let mut a = hybank_linalg::block_diagonal(&blocks);
        let own = signal.order();
        a.view_mut((own, 0), (b.nrows(), own)).copy_from(&(&b * signal.c()));
        let b = hybank_linalg::vstack(&[signal.b(), &(b * signal.d())]);
        let c = hybank_linalg::hstack(&[&Mat::zeros(c.nrows(), own), &c]);
        Self { transition: StateTransition::new(vec![a]), b, c }
    }

    pub(super) fn order(&self) -> usize {
        self.b.nrows()
    }

    /// Row i reads front end i.
    pub(super) fn c(&self) -> &Mat {
        &self.c
    }

    /// (e^{A l}, S) of a segment of length l: x <- e^{A l} x + S w with S S* = G(l).
    pub(super) fn over(&self, length: f64) -> (Mat, Mat) {
        (self.transition.over(length), gramian_root(&self.transition, &self.b, length))
    }

    /// x <- e^{A l} x + S w_new over a segment of length l: the new inputs become further columns.
    fn advance(&self, state: &Mat, input: &Mat, length: f64) -> (Mat, Mat) {
        let (transition, root) = self.over(length);
        (&transition * state, hybank_linalg::hstack(&[&(&transition * input), &root]))
    }
}

#[cfg(test)]
mod tests;
