//! The least mean-square error with which a history of slow samples determines samples of the target, and
//! the taps that attain it.

use super::DesignError;
use super::problem::Problem;
use super::smoother::{Innovation, Measurement, Smoother};
use super::timetable::{Event, Timetable};
use crate::linalg::Mat;
use std::ops::RangeInclusive;

/// Share of its mean square by which the error of a target sample may be too large in a survey.
const SURVEYED: f64 = 1e-6;

/// Least mean-square errors of the target's samples at whole instants, from one history of samples.
#[derive(Debug, Clone)]
pub(super) struct HistoryErrors {
    first: i64,
    /// The errors at the instants `first`, `first` + 1, ..
    squares: Vec<f64>,
    /// The mean square of the target, its error without any sample.
    pub(super) power: f64,
}

impl HistoryErrors {
    /// The errors at `instants` (fast periods) for the newest `frames` frames of all channels, with their
    /// noise.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition fails or a front end is not stable.
    pub(super) fn new(
        problem: &Problem,
        frames: usize,
        instants: RangeInclusive<i64>,
    ) -> Result<Self, DesignError> {
        let timetable = Timetable::new(problem, frames, instants)?;
        let smoother = Smoother::new(problem, &timetable, SURVEYED)?;
        let power = smoother.power();
        let first = *timetable.instants().start();
        let squares = run(problem, &timetable, smoother, |_| ());
        Ok(Self { first, squares, power })
    }

    /// The error at `instant`; without samples for instants that were not asked for.
    pub(super) fn at(&self, instant: i64) -> f64 {
        let index = usize::try_from(instant - self.first).ok();
        index.and_then(|index| self.squares.get(index)).copied().unwrap_or(self.power)
    }
}

/// The taps of least mean-square error on the newest `frames` frames of all channels, for the target at each
/// of `instants`: `[k][i][j]` weighs sample j of channel i for the instant k.
///
/// # Errors
/// As [`HistoryErrors::new`].
pub(super) fn best_taps(
    problem: &Problem,
    frames: usize,
    instants: RangeInclusive<i64>,
) -> Result<Vec<Vec<Vec<f64>>>, DesignError> {
    let timetable = Timetable::new(problem, frames, instants)?;
    let smoother = Smoother::new(problem, &timetable, 0.0)?;
    let outputs = smoother.outputs().clone();
    let mut innovations = Vec::new();
    let count = run(problem, &timetable, smoother, |innovation| innovations.push(innovation)).len();
    let record = Record { problem, timetable, outputs, innovations, frames };
    Ok((0..count).map(|index| record.taps(index)).collect())
}

/// Passes `smoother` through all instants. `told` receives the innovation of each sample in turn; `None` for
/// those that are known already. The result is the errors.
fn run(
    problem: &Problem,
    timetable: &Timetable,
    mut smoother: Smoother,
    mut told: impl FnMut(Option<Innovation>),
) -> Vec<f64> {
    for (event, slot) in timetable.steps() {
        match event {
            Some(Event::Sample { channel, .. }) => told(smoother.measure(measurement(problem, channel))),
            Some(Event::Target(index)) => smoother.begin(index),
            None => {}
        }
        if let Some(segment) = &slot.segment {
            smoother.advance(segment);
        }
    }
    smoother.finish()
}

fn measurement(problem: &Problem, channel: usize) -> Measurement {
    let noise = problem.noise[channel].sqrt() / problem.channels[channel].gain.abs();
    Measurement { front_end: problem.channels[channel].front_end, noise }
}

/// What the smoother did.
struct Record<'a> {
    problem: &'a Problem,
    timetable: Timetable,
    /// Row i reads front end i.
    outputs: Mat,
    /// Of each sample in turn.
    innovations: Vec<Option<Innovation>>,
    frames: usize,
}

impl Record<'_> {
    /// The taps of the target sample `index`.
    ///
    /// The innovation of a sample y of front end c is e = (y - c x) / size, and it moves the estimates: x
    /// by k e and z by l e. So the estimate of z is a linear form of all innovations, and going back in
    /// time the form `lambda` on the state gives the weight of each: (l + lambda k) / size for the sample
    /// itself, and minus c times that for the state before it.
    fn taps(&self, index: usize) -> Vec<Vec<f64>> {
        let mut taps = vec![vec![0.0; self.frames]; self.problem.channels.len()];
        let mut lambda = vec![0.0; self.outputs.ncols()];
        let mut innovations = self.innovations.iter().rev();
        for (event, slot) in self.timetable.steps().rev() {
            if let Some(segment) = &slot.segment {
                let row = Mat::from_row_slice(1, lambda.len(), &lambda) * &segment.transition;
                lambda.copy_from_slice(row.as_slice());
            }
            match event {
                Some(Event::Target(begun)) if begun == index => {
                    self.add(&mut lambda, self.problem.target, 1.0)
                }
                Some(Event::Sample { channel, frame }) => {
                    let Some(Some(innovation)) = innovations.next() else { continue };
                    let of = &self.problem.channels[channel];
                    let weight = innovation.weight(index, &lambda);
                    self.add(&mut lambda, of.front_end, -weight);
                    taps[channel][frame] = weight / of.gain;
                }
                _ => {}
            }
        }
        taps
    }

    fn add(&self, lambda: &mut [f64], front_end: usize, factor: f64) {
        let row = self.outputs.row(front_end);
        lambda.iter_mut().zip(row.iter()).for_each(|(sum, c)| *sum += factor * c);
    }
}

impl Innovation {
    /// The weight of the sample in the estimate of the target sample `index`, which also depends on the
    /// state after the sample by the form `lambda`.
    fn weight(&self, index: usize, lambda: &[f64]) -> f64 {
        let own = self.targets.iter().find(|(target, _)| *target == index).map_or(0.0, |(_, gain)| *gain);
        let by_state: f64 = self.state.iter().zip(lambda).map(|(gain, form)| gain * form).sum();
        (own + by_state) / self.size
    }
}
