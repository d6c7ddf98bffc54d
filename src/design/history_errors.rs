//! The least mean-square error with which a history of slow samples determines samples of the target, for
//! white noise of unit density at the analog input, and the taps that attain it: a fixed-point smoother in
//! square-root form.
//!
//! The joint analog state x passes from instant to instant (see `lifting`), oldest first; frame 0 is the
//! newest of J frames, and sample j of channel i is taken at `-j M - D_i`. The error of the estimate of x is
//! kept as a root X with cov(x) = X X*. A target sample `z = c x` is a further row of the root; once its
//! instant has passed, z stays and x moves on. A measured sample `y = g c_i x + n` removes one direction:
//! the columns, with one more for the noise n, are rotated so that y depends on the first one only, which is
//! then known. What x and z have there are the gains of their estimates on the normalised innovation. The
//! error of z is the norm of what remains of its row. Nothing is subtracted, so small errors keep their
//! digits.
//!
//! Source: Kailath, Sayed and Hassibi, *Linear Estimation* (2000), chapters 10 and 12 (array algorithms,
//! fixed-point smoothing).

use super::DesignError;
use super::lifting::JointState;
use super::problem::{Channel, Problem};
use crate::linalg::{self, Mat};
use crate::lti::gramian::controllability_root;
use crate::units::GridTime;
use std::ops::RangeInclusive;

/// Share of its mean square by which the error of a target sample may be too large where only errors are
/// wanted: the latency and the length that follow from them do not feel it.
const ERROR_ACCURACY: f64 = 1e-6;
/// A sample whose innovation is below this, relative to the terms that cancel, is known already: that is
/// their rounding.
const KNOWN_INNOVATION: f64 = 1e-15;

/// Least mean-square errors of the target's samples at whole instants, from one history of samples.
#[derive(Debug, Clone)]
pub(super) struct HistoryErrors {
    first: i64,
    /// The errors at the instants `first`, `first` + 1, ..
    errors: Vec<TargetError>,
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
        let first = *instants.start();
        let history = History::new(problem, frames, instants)?;
        let power = (history.joint.c().row(problem.target) * &history.prior).norm_squared();
        Ok(Self { first, errors: history.smooth(ERROR_ACCURACY, |_| ()), power })
    }

    /// The error at `instant`; without samples for instants that were not asked for.
    pub(super) fn at(&self, instant: i64) -> f64 {
        self.target(instant).map_or(self.power, |error| error.square)
    }

    /// What no sample after the history lowers of the error at `instant`: at least this remains at any
    /// latency.
    pub(super) fn lasting(&self, instant: i64) -> f64 {
        self.target(instant).map_or(0.0, |error| error.lasting)
    }

    fn target(&self, instant: i64) -> Option<&TargetError> {
        self.errors.get(usize::try_from(instant - self.first).ok()?)
    }
}

/// Mean squares of the error of one sample of the target.
#[derive(Debug, Clone, Copy)]
struct TargetError {
    /// With the samples of the history.
    square: f64,
    /// With all samples that could follow it too.
    lasting: f64,
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
    let history = History::new(problem, frames, instants)?;
    let mut innovations = Vec::new();
    let count = history.smooth(0.0, |innovation| innovations.push(innovation)).len();
    Ok((0..count).map(|index| history.taps(index, &innovations)).collect())
}

/// All instants of a history of samples and of the target.
struct History<'a> {
    problem: &'a Problem,
    joint: JointState,
    /// The steady-state root at the beginning of a slow period, without any sample.
    prior: Mat,
    frames: usize,
    instants: RangeInclusive<i64>,
    slots: Vec<Slot>,
    periods: RangeInclusive<i64>,
}

/// An instant of the slow period at which something happens, and the way to the next one.
struct Slot {
    source: Source,
    /// x <- e^{A l} x + S w until the next slot, as e^{A l} and S; `None` if that is the same instant.
    segment: Option<(Mat, Mat)>,
}

/// Whose sample a slot takes.
#[derive(Clone, Copy)]
enum Source {
    /// That of a channel, whose frame 0 is taken in the slow period `newest`.
    Channel { channel: usize, newest: i64 },
    /// That of the target, at this fast sample of the slow period.
    Target(i64),
}

/// What happens at an instant.
enum Event {
    /// This channel is sampled, for this frame; 0 is the newest.
    Sample { channel: usize, frame: usize },
    /// The target sample of this index begins.
    Target(usize),
}

/// The gains of all estimates on the part of a sample that those before it do not explain, of unit variance.
struct Innovation {
    /// Its rms.
    size: f64,
    /// Of the state.
    state: Vec<f64>,
    /// Of the target samples that have begun, each with its index.
    targets: Vec<(usize, f64)>,
}

impl<'a> History<'a> {
    fn new(problem: &'a Problem, frames: usize, instants: RangeInclusive<i64>) -> Result<Self, DesignError> {
        let (ratio, joint) = (problem.ratio as i64, JointState::new(problem));
        let at = |p: i64| GridTime::fast_sample(p as f64, problem.fast_period);
        let mut periods = (instants.start().div_euclid(ratio), instants.end().div_euclid(ratio));
        let mut sources: Vec<(GridTime, Source)> = (0..ratio).map(|p| (at(p), Source::Target(p))).collect();
        for (channel, &Channel { delay, .. }) in problem.channels.iter().enumerate() {
            let (newest, phase) = delay.negative().in_slow_period(problem.ratio);
            sources.push((phase, Source::Channel { channel, newest: newest as i64 }));
            if frames > 0 {
                let oldest = newest as i64 + 1 - frames as i64;
                periods = (periods.0.min(oldest), periods.1.max(newest as i64));
            }
        }
        sources.sort_by(|a, b| a.0.compare(b.0));
        let ends = sources.iter().skip(1).map(|slot| slot.0).chain([at(ratio)]).collect::<Vec<_>>();
        let slot = |(&(phase, source), end): (&(GridTime, Source), GridTime)| {
            let length = end.since(phase).0;
            let segment = (length > 0.0).then(|| joint.over(length));
            Slot { source, segment }
        };
        let slots = sources.iter().zip(ends).map(slot).collect();
        let (transition, input) = joint.over(problem.ratio as f64);
        let prior = controllability_root(&transition, &input)?.resize_horizontally(joint.order(), 0.0);
        Ok(Self { problem, joint, prior, frames, instants, slots, periods: periods.0..=periods.1 })
    }

    /// All slots with what happens there, if anything, from the oldest to the newest.
    fn steps(&self) -> impl DoubleEndedIterator<Item = (Option<Event>, &Slot)> {
        let of_period = move |period| self.slots.iter().map(move |slot| (self.event(slot, period), slot));
        self.periods.clone().flat_map(of_period)
    }

    fn event(&self, slot: &Slot, period: i64) -> Option<Event> {
        match slot.source {
            Source::Channel { channel, newest } => {
                let frame = usize::try_from(newest - period).ok()?;
                (frame < self.frames).then_some(Event::Sample { channel, frame })
            }
            Source::Target(phase) => {
                let instant = period * self.problem.ratio as i64 + phase;
                let index = usize::try_from(instant - self.instants.start()).ok()?;
                self.instants.contains(&instant).then_some(Event::Target(index))
            }
        }
    }

    /// Smooths the samples. `found` receives the innovation of each in turn; `None` for those that are known
    /// already. A target sample is settled when the state can still lower its mean square by no more than
    /// the share `settled`. The result is the errors of all target samples.
    fn smooth(&self, settled: f64, mut found: impl FnMut(Option<Innovation>)) -> Vec<TargetError> {
        let count = usize::try_from(self.instants.end() - self.instants.start() + 1).unwrap_or(0);
        let (root, squares) = (self.prior.clone(), vec![0.0; count]);
        let mut smoother = Smoother { root, open: Vec::new(), squares };
        for (event, slot) in self.steps() {
            match event {
                Some(Event::Sample { channel, .. }) => {
                    let of = &self.problem.channels[channel];
                    let noise = self.problem.noise[channel].sqrt() / of.gain.abs();
                    found(smoother.measure(&self.joint.c().rows(of.front_end, 1).into_owned(), noise));
                }
                Some(Event::Target(index)) => {
                    let row = self.joint.c().row(self.problem.target) * &smoother.root;
                    smoother.open.push(Open { index, row: row.iter().copied().collect(), fixed: 0.0 });
                }
                None => {}
            }
            if let Some((transition, input)) = &slot.segment {
                smoother.advance(transition, input, settled);
            }
        }
        smoother.errors()
    }

    /// The taps of the target sample `index`.
    ///
    /// The innovation of a sample y of front end c is e = (y - c x) / size, and it moves the estimates: x
    /// by k e and z by l e. So the estimate of z is a linear form of all innovations, and going back in
    /// time the form `lambda` on the state gives the weight of each: (l + lambda k) / size for the sample
    /// itself, and minus c times that for the state before it.
    fn taps(&self, index: usize, innovations: &[Option<Innovation>]) -> Vec<Vec<f64>> {
        let mut taps = vec![vec![0.0; self.frames]; self.problem.channels.len()];
        let mut lambda = vec![0.0; self.joint.order()];
        let mut innovations = innovations.iter().rev();
        let add = |lambda: &mut [f64], front_end: usize, factor: f64| {
            let row = self.joint.c().row(front_end);
            lambda.iter_mut().zip(row.iter()).for_each(|(sum, c)| *sum += factor * c);
        };
        for (event, slot) in self.steps().rev() {
            if let Some((transition, _)) = &slot.segment {
                let row = Mat::from_row_slice(1, lambda.len(), &lambda) * transition;
                lambda.copy_from_slice(row.as_slice());
            }
            match event {
                Some(Event::Target(begun)) if begun == index => add(&mut lambda, self.problem.target, 1.0),
                Some(Event::Sample { channel, frame }) => {
                    let Some(Some(innovation)) = innovations.next() else { continue };
                    let of = &self.problem.channels[channel];
                    let weight = innovation.weight(index, &lambda);
                    add(&mut lambda, of.front_end, -weight);
                    taps[channel][frame] = weight / of.gain;
                }
                _ => {}
            }
        }
        taps
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

/// A target sample whose error may still fall.
struct Open {
    index: usize,
    /// Its part in the columns of the state's root.
    row: Vec<f64>,
    /// The mean square of the part on which no later sample depends.
    fixed: f64,
}

/// The root of the error covariance of the state and of the target samples.
struct Smoother {
    /// X, S x S.
    root: Mat,
    open: Vec<Open>,
    squares: Vec<f64>,
}

impl Smoother {
    /// Rotates the columns so that the sample of the front end `c`, with this rms of noise, depends on the
    /// first one only, and removes that one. `None` for a sample that is known already.
    fn measure(&mut self, c: &Mat, noise: f64) -> Option<Innovation> {
        let y: Vec<f64> = (c * &self.root).iter().copied().chain([noise]).collect();
        let size = norm(&y);
        let terms: f64 = c.iter().zip(self.root.row_iter()).map(|(c, x)| c.abs() * x.norm()).sum();
        if size <= KNOWN_INNOVATION * terms {
            return None;
        }
        // y becomes -sign(y_0) |y| on the first column.
        let sign = -1f64.copysign(y[0]);
        let reflection = Reflection::new(y, size);
        let mut state = Vec::with_capacity(self.root.nrows());
        for i in 0..self.root.nrows() {
            let mut row: Vec<f64> = self.root.row(i).iter().copied().collect();
            state.push(sign * reflection.apply(&mut row));
            row.iter().enumerate().for_each(|(j, x)| self.root[(i, j)] = *x);
        }
        let estimate = |open: &mut Open| (open.index, sign * reflection.apply(&mut open.row));
        let targets = self.open.iter_mut().map(estimate).collect();
        Some(Innovation { size, state, targets })
    }

    /// Moves on to the next slot. The new inputs are compressed into as many columns as the state has; what
    /// remains of the rows of targets cannot be measured any more.
    fn advance(&mut self, transition: &Mat, input: &Mat, settled: f64) {
        let order = self.root.nrows();
        let mut stack = Mat::zeros(order + self.open.len(), order + input.ncols());
        stack.view_mut((0, 0), (order, order)).copy_from(&(transition * &self.root));
        stack.view_mut((0, order), input.shape()).copy_from(input);
        for (k, open) in self.open.iter().enumerate() {
            open.row.iter().enumerate().for_each(|(j, x)| stack[(order + k, j)] = *x);
        }
        let factor = linalg::lq_factor(&stack);
        self.root = factor.view((0, 0), (order, order)).into_owned();
        for (k, open) in self.open.iter_mut().enumerate() {
            let row: Vec<f64> = factor.row(order + k).iter().copied().collect();
            open.fixed += row[order..].iter().map(|x| x * x).sum::<f64>();
            open.row = row[..order].to_vec();
        }
        self.settle(settled);
    }

    /// The errors of all target samples after the last slot.
    fn errors(self) -> Vec<TargetError> {
        let settled = |lasting| TargetError { square: lasting, lasting };
        let mut errors: Vec<TargetError> = self.squares.into_iter().map(settled).collect();
        for Open { index, row, fixed } in self.open {
            errors[index] = TargetError { square: fixed + norm(&row).powi(2), lasting: fixed };
        }
        errors
    }

    /// Closes the target samples whose mean square the state can lower by no more than this share.
    fn settle(&mut self, share: f64) {
        let squares = &mut self.squares;
        self.open.retain(|open| {
            let rest = norm(&open.row).powi(2);
            squares[open.index] = open.fixed;
            rest > share * open.fixed
        });
    }
}

/// The Householder reflection I - scale u u* of the state's columns and one for the noise.
struct Reflection {
    u: Vec<f64>,
    scale: f64,
}

impl Reflection {
    /// Reflects `y` of the norm `size` to a multiple of the first unit vector.
    fn new(y: Vec<f64>, size: f64) -> Self {
        let mut u = y;
        u[0] += size.copysign(u[0]);
        let scale = 2.0 / u.iter().map(|x| x * x).sum::<f64>();
        Self { u, scale }
    }

    /// Reflects `row`, which has no noise. Its first entry is removed and returned, and the entry of the
    /// noise takes its place.
    fn apply(&self, row: &mut [f64]) -> f64 {
        let along: f64 = row.iter().zip(&self.u).map(|(x, u)| x * u).sum();
        row.iter_mut().zip(&self.u).for_each(|(x, u)| *x -= self.scale * along * u);
        let noise = self.u.last().map_or(0.0, |u| -self.scale * along * u);
        std::mem::replace(&mut row[0], noise)
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
