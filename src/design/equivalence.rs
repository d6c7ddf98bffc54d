//! The exact discrete-time equivalent of the hybrid system, blocked by M (thesis 5.2, Theorem 5.1).
//!
//! In one slow period the analog state moves under the input; every sample, of a slow channel or of the
//! ideal fast one, is a row of that state at some instant of the period. Cut the period at these
//! instants. Over a piece of length l the state becomes e^{A l} x + w with w independent of the other
//! pieces and w w* = G(l), the finite-time Gramian; any square root of G(l) is a norm-equivalent input
//! (thesis 5.16). Following the state from cut to cut therefore gives the blocked system with all its
//! feedthroughs at once, for any real delays, and never squares anything.
//!
//! Time labels: moving all instants by one constant changes neither the norm of the error system
//! nor the filters. The latest instant is put at the very end of the period, so that the other
//! samples are *ahead* of the state at its beginning and need no delay chains; instants earlier than
//! one period are samples of the same row, some whole ticks late.

use super::problem::Problem;
use crate::analog::StrictlyProper;
use crate::linalg::Mat;
use crate::lti::StateSpace;
use crate::lti::exponential::{Flow, gramian_root};
use std::ops::Range;

/// Instants closer than this (fast periods) are one: far below what any converter resolves, far above
/// the rounding of delay / period.
const SAME_INSTANT: f64 = 1e-11;

/// The blocked analysis side: x+ = A x + B u, outputs [v_1..v_N; y_0[kM..kM+M-1]] of tick k.
#[derive(Debug, Clone)]
pub struct BlockedPlant {
    /// Outputs: the N slow samples of a tick first, then the M wanted fast samples.
    pub system: StateSpace,
    /// N.
    pub measured: usize,
    /// M.
    pub wanted: usize,
    /// For each measured output the states of its delay chain, first link first; empty unless the channel is
    /// whole ticks late. The output reads the last link, without feedthrough.
    chains: Vec<Range<usize>>,
}

/// One output of the blocked plant: which front end is read, when, and how many ticks later it counts.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    front_end: usize,
    /// In (0, M].
    instant: f64,
    ticks_late: usize,
}

impl BlockedPlant {
    /// The exact equivalent of `problem`.
    pub fn new(problem: &Problem) -> Self {
        let samples = schedule(problem);
        let (transition, input, rows) = follow_state(problem, &samples);
        let (system, mut chains) = append_chains(transition, input, rows, &samples);
        chains.truncate(problem.channels.len());
        Self { system, measured: problem.channels.len(), wanted: problem.ratio, chains }
    }

    /// The states of the delay chain of a channel, empty unless it is whole ticks late.
    pub(super) fn chain(&self, channel: usize) -> Range<usize> {
        self.chains[channel].clone()
    }
}

/// The instants of all outputs, relabelled so that the latest lies at the end of the period.
fn schedule(problem: &Problem) -> Vec<Sample> {
    let period = problem.ratio as f64;
    let channels = problem.channels.iter().map(|channel| (channel.front_end, -channel.delay.0));
    let wanted = (0..problem.ratio).map(|p| (problem.target, p as f64 - problem.latency as f64));
    let times: Vec<(usize, f64)> = channels.chain(wanted).collect();
    let latest = times.iter().map(|&(_, time)| time).fold(f64::NEG_INFINITY, f64::max);
    times.iter().map(|&(front_end, time)| place(front_end, latest - time, period)).collect()
}

/// A sample `age` fast periods older than the end of the period.
fn place(front_end: usize, age: f64, period: f64) -> Sample {
    let nearest = (age / period).round();
    let on_a_boundary = (age - nearest * period).abs() < SAME_INSTANT;
    let ticks = if on_a_boundary { nearest } else { (age / period).floor() };
    let instant = if on_a_boundary { period } else { period - (age - ticks * period) };
    Sample { front_end, instant, ticks_late: ticks as usize }
}

/// An output row: its part of the state and of the inputs.
struct Row {
    state: Mat,
    input: Mat,
}

/// Follows the joint analog state through one period; rows in the order of `samples`.
fn follow_state(problem: &Problem, samples: &[Sample]) -> (Mat, Mat, Vec<Row>) {
    let joint = JointState::new(&problem.front_ends);
    let period = problem.ratio as f64;
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.sort_by(|&i, &j| samples[i].instant.total_cmp(&samples[j].instant));
    let mut rows: Vec<Option<Row>> = samples.iter().map(|_| None).collect();
    let mut now = 0.0;
    let mut state = Mat::identity(joint.order, joint.order);
    let mut input = Mat::zeros(joint.order, 0);
    for index in order {
        let sample = samples[index];
        if sample.instant - now >= SAME_INSTANT {
            joint.advance(&mut state, &mut input, sample.instant - now);
            now = sample.instant;
        }
        let readout = &joint.readouts[sample.front_end];
        rows[index] = Some(Row { state: readout * &state, input: readout * &input });
    }
    // The latest sample ends the period by construction; a rest below SAME_INSTANT is none.
    debug_assert!(period - now < SAME_INSTANT);
    (state, input, rows.into_iter().flatten().collect())
}

/// All distinct front ends side by side, driven by the same input.
struct JointState {
    flow: Flow,
    b: Mat,
    readouts: Vec<Mat>,
    order: usize,
}

impl JointState {
    fn new(front_ends: &[StrictlyProper]) -> Self {
        let order = front_ends.iter().map(StrictlyProper::order).sum();
        let mut b = Mat::zeros(order, 1);
        let mut readouts = Vec::with_capacity(front_ends.len());
        let mut start = 0;
        for filter in front_ends {
            b.rows_mut(start, filter.order()).copy_from(filter.b());
            let mut readout = Mat::zeros(1, order);
            readout.columns_mut(start, filter.order()).copy_from(filter.c());
            readouts.push(readout);
            start += filter.order();
        }
        let flow = Flow::new(front_ends.iter().map(|filter| filter.a().clone()).collect());
        Self { flow, b, readouts, order }
    }

    /// x <- e^{A l} x + S u_new: the new inputs become further columns.
    fn advance(&self, state: &mut Mat, input: &mut Mat, length: f64) {
        let transition = self.flow.at(length);
        let root = gramian_root(&self.flow, &self.b, length);
        *state = &transition * &*state;
        let known = input.ncols();
        let mut grown = Mat::zeros(self.order, known + root.ncols());
        grown.columns_mut(0, known).copy_from(&(&transition * &*input));
        grown.columns_mut(known, root.ncols()).copy_from(&root);
        *input = grown;
    }
}

/// Adds a chain of slow delays for each sample that counts some ticks later; also gives their states.
fn append_chains(
    transition: Mat,
    input: Mat,
    rows: Vec<Row>,
    samples: &[Sample],
) -> (StateSpace, Vec<Range<usize>>) {
    let (n, m, p) = (transition.nrows(), input.ncols(), rows.len());
    let order = n + samples.iter().map(|sample| sample.ticks_late).sum::<usize>();
    let mut a = Mat::zeros(order, order);
    let mut b = Mat::zeros(order, m);
    let mut c = Mat::zeros(p, order);
    let mut d = Mat::zeros(p, m);
    a.view_mut((0, 0), (n, n)).copy_from(&transition);
    b.rows_mut(0, n).copy_from(&input);
    let mut next = n;
    let mut chains = vec![0..0; p];
    for (output, (row, sample)) in rows.iter().zip(samples).enumerate() {
        let known = row.input.ncols();
        if sample.ticks_late == 0 {
            c.view_mut((output, 0), (1, n)).copy_from(&row.state);
            d.view_mut((output, 0), (1, known)).copy_from(&row.input);
            continue;
        }
        a.view_mut((next, 0), (1, n)).copy_from(&row.state);
        b.view_mut((next, 0), (1, known)).copy_from(&row.input);
        for link in 1..sample.ticks_late {
            a[(next + link, next + link - 1)] = 1.0;
        }
        next += sample.ticks_late;
        c[(output, next - 1)] = 1.0;
        chains[output] = next - sample.ticks_late..next;
    }
    let system = StateSpace::new(a, b, c, d).expect("the chains fit by construction").compress_inputs();
    (system, chains)
}
