//! What missing samples cost the outputs.

use crate::runtime::{Plan, Stream};
use crate::units::Decibels;
use std::ops::Range;

/// Most frames for which the response of a recursion is followed.
const MOST_FRAMES: usize = 4096;
/// What is below this share of the largest value of a response counts as 0, unless all values are exact.
const ENDS_BELOW: f64 = 1e-7;

/// The cost of one missing sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cost {
    /// Standard deviation of the error of its estimate, over that of the target.
    pub(super) deviation: f64,
    /// The most that it adds to the mean-square error of an output, over the power of the target.
    pub(super) most: f64,
}

/// The costs of all missing samples that affect an output.
///
/// An output that weighs the sample k by g_k errs by `sum g_k e_k`. Whatever errors e_k have to do with one
/// another, the root of its mean square is at most `sum |g_k| d_k` with their deviations d_k. For long gaps
/// this bound is too large. It is cut at the largest error of the outputs during the gap, which is known.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Affected {
    root: f64,
    most: f64,
}

/// The costs of the outputs of the last frames, and the known ones of later outputs.
#[derive(Debug, Clone)]
pub(super) struct Costs {
    ratio: usize,
    /// The magnitudes of the output for a single 1 in each sample of a frame, from its frame on.
    responses: Vec<Vec<f64>>,
    /// The error where nothing is missing.
    error: f64,
    outputs: Vec<Affected>,
    marks: Vec<u8>,
    /// How many outputs belong to the last frames.
    used: usize,
}

impl Costs {
    /// Of samples with these `offsets` before `plan`.
    pub(super) fn new(plan: &Plan, offsets: &[f64], error: f64) -> Self {
        let responses = (0..offsets.len()).map(|i| response(plan, offsets, i)).collect();
        let (outputs, marks) = (Vec::new(), Vec::new());
        Self { ratio: plan.ratio(), responses, error, outputs, marks, used: 0 }
    }

    /// Begins with the outputs of the next frames.
    pub(super) fn begin(&mut self, frames: usize) {
        self.outputs.drain(..self.used);
        self.used = frames * self.ratio;
        self.room(self.used);
        self.marks.clear();
    }

    /// Adds the cost of sample i of one of these frames.
    pub(super) fn add(&mut self, frame: usize, i: usize, cost: Cost) {
        let first = frame * self.ratio;
        self.room(first + self.responses[i].len());
        for (output, weight) in self.outputs[first..].iter_mut().zip(&self.responses[i]) {
            if *weight > 0.0 {
                output.root += weight * cost.deviation;
                output.most = output.most.max(cost.most);
            }
        }
    }

    /// The marks of some of the outputs, once all costs of their frames are added.
    pub(super) fn marks(&self, outputs: Range<usize>) -> &[u8] {
        &self.marks[outputs]
    }

    /// Makes the marks of the outputs of these frames.
    pub(super) fn complete(&mut self) {
        let mark = |output: &Affected| {
            if output.root == 0.0 {
                return 0;
            }
            self.snr(output.root.powi(2).min(output.most)).0.round().clamp(1.0, 255.0) as u8
        };
        self.marks = self.outputs[..self.used].iter().map(mark).collect();
    }

    /// The signal-to-noise ratio where missing samples add this error.
    pub(super) fn snr(&self, added: f64) -> Decibels {
        Decibels::of_power(1.0 / (self.error + added))
    }

    fn room(&mut self, outputs: usize) {
        let none = Affected { root: 0.0, most: 0.0 };
        self.outputs.resize(self.outputs.len().max(outputs), none);
    }
}

/// The magnitudes of the output for a 1 in sample i of a frame.
fn response(plan: &Plan, offsets: &[f64], i: usize) -> Vec<f64> {
    let frames = plan.history().map_or(MOST_FRAMES, |history| history + 1) + plan.flush_frames();
    let mut input = offsets.repeat(frames);
    input[i] += 1.0;
    let mut outputs = vec![0.0; frames * plan.ratio()];
    // The shapes are those of the plan.
    Stream::new(plan).process(&input, &mut outputs).unwrap_or_default();
    // Recursions die away, and transforms leave rounding errors where there is no tap.
    let is_exact = plan.history().is_some() && plan.extra_latency() == 0;
    let share = if is_exact { 0.0 } else { ENDS_BELOW };
    let least = share * outputs.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let end = outputs.iter().rposition(|x| x.abs() > least).map_or(0, |last| last + 1);
    outputs[..end].iter().map(|x| if x.abs() > least { x.abs() } else { 0.0 }).collect()
}
