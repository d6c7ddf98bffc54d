//! The least mean-square error with which a history of slow samples determines one sample of the target, for
//! white noise of unit density at the analog input: a fixed-point smoother in square-root form.
//!
//! Frame 0 is the newest of J frames: sample j of channel i is taken at `-j M - D_i`. The joint analog state
//! x passes from instant to instant (see `lifting`), and the error of its estimate is kept as a root X with
//! cov(x) = X X*. A target sample `z = c x` is a further row of the root; once its instant has passed, z
//! stays and x moves on. A measured sample `y = c_i x` removes one direction: the columns are turned so that
//! y depends on the first one only, which is then known. The error of z is the norm of what remains of its
//! row. Nothing is subtracted, so small errors keep their digits.
//!
//! Source: Kailath, Sayed and Hassibi, *Linear Estimation* (2000), chapters 10 and 12 (array algorithms,
//! fixed-point smoothing).

use crate::design::DesignError;
use crate::design::lifting::{JointState, SAME_INSTANT};
use crate::design::problem::Problem;
use crate::linalg::{self, Mat};
use crate::lti::gramian::controllability_root;
use std::ops::RangeInclusive;

/// A target sample is settled when the state can still lower its mean square by less than this share.
const SETTLED: f64 = 1e-6;
/// A sample whose innovation is below this, relative to the terms that cancel, is known already.
const KNOWN: f64 = 1e-15;

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
    /// The errors at `instants` (fast periods) for the newest `frames` frames of all channels.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition fails or a front end is not stable.
    pub(super) fn new(
        problem: &Problem,
        frames: usize,
        instants: RangeInclusive<i64>,
    ) -> Result<Self, DesignError> {
        let timetable = Timetable::new(problem, frames, instants)?;
        let mut smoother = Smoother::new(problem, &timetable)?;
        let power = smoother.power(problem.target);
        for period in timetable.periods.clone() {
            for slot in &timetable.slots {
                match timetable.event(slot, period) {
                    Some(Event::Sample(front_end)) => smoother.measure(front_end),
                    Some(Event::Target(index)) => smoother.begin(index, problem.target),
                    None => {}
                }
                smoother.advance(&slot.segment)?;
            }
        }
        Ok(Self { first: *timetable.instants.start(), squares: smoother.finish(), power })
    }

    /// The error at `instant`; without samples for instants that were not asked for.
    pub(super) fn at(&self, instant: i64) -> f64 {
        let index = usize::try_from(instant - self.first).ok();
        index.and_then(|index| self.squares.get(index)).copied().unwrap_or(self.power)
    }
}

/// What happens at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Event {
    /// The front end of this index is sampled.
    Sample(usize),
    /// The target sample of this index begins.
    Target(usize),
}

/// A phase of the slow period at which something happens, and the way to the next one.
struct Slot {
    /// Fast periods after the beginning of the slow period.
    phase: f64,
    source: Source,
    /// (e^{A l}, S), with l the time until the next slot; `None` if that is the same instant.
    segment: Option<(Mat, Mat)>,
}

/// Whose sample a slot takes.
#[derive(Clone, Copy)]
enum Source {
    /// A channel with this front end, sampled first in this slow period and last in frame 0's.
    Channel { front_end: usize, periods: (i64, i64) },
    /// The target, at this fast sample of the slow period.
    Target(i64),
}

/// All instants of the history and of the targets, in ascending order.
struct Timetable {
    ratio: i64,
    slots: Vec<Slot>,
    periods: RangeInclusive<i64>,
    instants: RangeInclusive<i64>,
}

impl Timetable {
    fn new(problem: &Problem, frames: usize, instants: RangeInclusive<i64>) -> Result<Self, DesignError> {
        let ratio = problem.ratio as i64;
        let mut slots: Vec<Slot> = (0..ratio).map(|p| Slot::new(p as f64, Source::Target(p))).collect();
        for channel in &problem.channels {
            let newest = (-channel.delay.0 / ratio as f64).floor();
            let phase = -channel.delay.0 - newest * ratio as f64;
            let periods = (newest as i64 + 1 - frames as i64, newest as i64);
            slots.push(Slot::new(phase, Source::Channel { front_end: channel.front_end, periods }));
        }
        slots.sort_by(|a, b| a.phase.total_cmp(&b.phase));
        let phases: Vec<f64> = slots.iter().map(|slot| slot.phase).chain([ratio as f64]).collect();
        let joint = JointState::new(problem)?;
        for (slot, pair) in slots.iter_mut().zip(phases.windows(2)) {
            let length = pair[1] - pair[0];
            slot.segment = (length >= SAME_INSTANT).then(|| joint.over(length)).transpose()?;
        }
        let targets = (instants.start().div_euclid(ratio), instants.end().div_euclid(ratio));
        let (first, last) = slots
            .iter()
            .filter_map(Slot::periods)
            .fold(targets, |all, these| (all.0.min(these.0), all.1.max(these.1)));
        Ok(Self { ratio, slots, periods: first..=last, instants })
    }

    fn event(&self, slot: &Slot, period: i64) -> Option<Event> {
        match slot.source {
            Source::Channel { front_end, periods: (first, last) } => {
                (first..=last).contains(&period).then_some(Event::Sample(front_end))
            }
            Source::Target(phase) => {
                let instant = period * self.ratio + phase;
                let index = || usize::try_from(instant - self.instants.start()).ok().map(Event::Target);
                if self.instants.contains(&instant) { index() } else { None }
            }
        }
    }
}

impl Slot {
    fn new(phase: f64, source: Source) -> Self {
        Self { phase, source, segment: None }
    }

    /// The first and the last slow period in which a channel is sampled, if there is a frame at all.
    fn periods(&self) -> Option<(i64, i64)> {
        match self.source {
            Source::Channel { periods: (first, last), .. } if first <= last => Some((first, last)),
            _ => None,
        }
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
    c: Mat,
    /// X, S x S.
    root: Mat,
    open: Vec<Open>,
    squares: Vec<f64>,
}

impl Smoother {
    /// The steady state without any sample, at the beginning of a slow period.
    fn new(problem: &Problem, timetable: &Timetable) -> Result<Self, DesignError> {
        let joint = JointState::new(problem)?;
        let (transition, input) = joint.over(problem.ratio as f64)?;
        let prior = controllability_root(&transition, &input)?;
        let order = joint.order();
        let count = usize::try_from(timetable.instants.end() - timetable.instants.start() + 1).unwrap_or(0);
        Ok(Self {
            c: joint.c().clone(),
            root: prior.resize_horizontally(order, 0.0),
            open: Vec::new(),
            squares: vec![0.0; count],
        })
    }

    /// The mean square of a front end's output.
    fn power(&self, front_end: usize) -> f64 {
        (self.c.row(front_end) * &self.root).norm_squared()
    }

    fn begin(&mut self, index: usize, target: usize) {
        let row = (self.c.row(target) * &self.root).iter().copied().collect();
        self.open.push(Open { index, row, fixed: 0.0 });
    }

    /// Turns the columns so that the sample depends on the first one only, and sets that one to zero.
    fn measure(&mut self, front_end: usize) {
        let c = self.c.row(front_end);
        let y: Vec<f64> = (c * &self.root).iter().copied().collect();
        let size = norm(&y);
        let terms: f64 = c.iter().zip(self.root.row_iter()).map(|(c, x)| c.abs() * x.norm()).sum();
        if size <= KNOWN * terms {
            return;
        }
        // The Householder vector that turns y into a multiple of the first unit vector.
        let mut u = y;
        u[0] += size.copysign(u[0]);
        let scale = 2.0 / u.iter().map(|x| x * x).sum::<f64>();
        for i in 0..self.root.nrows() {
            let mut row: Vec<f64> = self.root.row(i).iter().copied().collect();
            reflect(&mut row, &u, scale);
            row.iter().enumerate().for_each(|(j, x)| self.root[(i, j)] = *x);
        }
        self.open.iter_mut().for_each(|open| reflect(&mut open.row, &u, scale));
    }

    /// Moves on to the next slot. The new inputs are compressed into as many columns as the state has; what
    /// remains of the rows of targets cannot be measured any more.
    fn advance(&mut self, segment: &Option<(Mat, Mat)>) -> Result<(), DesignError> {
        let Some((transition, input)) = segment else { return Ok(()) };
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
        self.settle();
        Ok(())
    }

    fn settle(&mut self) {
        let squares = &mut self.squares;
        self.open.retain(|open| {
            let rest = norm(&open.row).powi(2);
            squares[open.index] = open.fixed;
            rest > SETTLED * open.fixed
        });
    }

    fn finish(mut self) -> Vec<f64> {
        for open in &self.open {
            self.squares[open.index] = open.fixed + norm(&open.row).powi(2);
        }
        self.squares
    }
}

/// `row (I - scale u u*)` with its first entry set to zero.
fn reflect(row: &mut [f64], u: &[f64], scale: f64) {
    let along: f64 = row.iter().zip(u).map(|(x, u)| x * u).sum();
    row.iter_mut().zip(u).for_each(|(x, u)| *x -= scale * along * u);
    row[0] = 0.0;
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
