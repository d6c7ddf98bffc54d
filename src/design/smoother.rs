//! The least mean-square estimate of samples of the target from noisy slow samples, for white noise of unit
//! density at the analog input: a fixed-point smoother in square-root form.
//!
//! The error of the estimate of the joint analog state x is kept as a root X with cov(x) = X X*. A target
//! sample `z = c x` is a further row of the root; once its instant has passed, z stays and x moves on. A
//! measured sample `y = g c_i x + n` removes one direction: the columns, with one more for the noise n, are
//! turned so that y depends on the first one only, which is then known. What x and z have there are the
//! gains of their estimates on the normalised innovation. The error of z is the norm of what remains of its
//! row. Nothing is subtracted, so small errors keep their digits.
//!
//! Source: Kailath, Sayed and Hassibi, *Linear Estimation* (2000), chapters 10 and 12 (array algorithms,
//! fixed-point smoothing).

use super::DesignError;
use super::lifting::JointState;
use super::problem::Problem;
use super::timetable::{Segment, Timetable};
use crate::linalg::{self, Mat};
use crate::lti::gramian::controllability_root;

/// A sample whose innovation is below this, relative to the terms that cancel, is known already.
const KNOWN: f64 = 1e-15;

/// A target sample whose error may still fall.
struct Open {
    index: usize,
    /// Its part in the columns of the state's root.
    row: Vec<f64>,
    /// The mean square of the part on which no later sample depends.
    fixed: f64,
}

/// How a slow sample is taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measurement {
    /// Index of the front end.
    pub(super) front_end: usize,
    /// Rms of the noise of the sample, in units in which the sample is the front end's output.
    pub(super) noise: f64,
}

/// What a sample tells: the gains of all estimates on the innovation of unit variance.
#[derive(Debug, Clone)]
pub(super) struct Innovation {
    /// Rms of the part of the sample that those before it do not explain.
    pub(super) size: f64,
    /// Of the state.
    pub(super) state: Vec<f64>,
    /// Of the target samples that have begun, each with its index.
    pub(super) targets: Vec<(usize, f64)>,
}

/// The root of the error covariance of the state and of the target samples.
pub(super) struct Smoother {
    c: Mat,
    target: usize,
    /// X, S x S.
    root: Mat,
    open: Vec<Open>,
    squares: Vec<f64>,
    /// A target sample is settled when the state can still lower its mean square by less than this share.
    settled: f64,
}

impl Smoother {
    /// The steady state without any sample, at the beginning of a slow period.
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition fails or a front end is not stable.
    pub(super) fn new(problem: &Problem, timetable: &Timetable, settled: f64) -> Result<Self, DesignError> {
        let joint = JointState::new(problem)?;
        let (transition, input) = joint.over(problem.ratio as f64)?;
        let prior = controllability_root(&transition, &input)?;
        let order = joint.order();
        let instants = timetable.instants();
        let count = usize::try_from(instants.end() - instants.start() + 1).unwrap_or(0);
        Ok(Self {
            c: joint.c().clone(),
            target: problem.target,
            root: prior.resize_horizontally(order, 0.0),
            open: Vec::new(),
            squares: vec![0.0; count],
            settled,
        })
    }

    /// The mean square of the target.
    pub(super) fn power(&self) -> f64 {
        (self.c.row(self.target) * &self.root).norm_squared()
    }

    /// Row i reads front end i.
    pub(super) fn outputs(&self) -> &Mat {
        &self.c
    }

    /// From now on the target's present value is estimated as the sample `index`.
    pub(super) fn begin(&mut self, index: usize) {
        let row = (self.c.row(self.target) * &self.root).iter().copied().collect();
        self.open.push(Open { index, row, fixed: 0.0 });
    }

    /// Turns the columns so that the sample depends on the first one only, and removes that one. `None` for
    /// a sample that is known already.
    pub(super) fn measure(&mut self, measurement: Measurement) -> Option<Innovation> {
        let c = self.c.row(measurement.front_end);
        let y: Vec<f64> = (c * &self.root).iter().copied().chain([measurement.noise]).collect();
        let size = norm(&y);
        let terms: f64 = c.iter().zip(self.root.row_iter()).map(|(c, x)| c.abs() * x.norm()).sum();
        if size <= KNOWN * terms {
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
    pub(super) fn advance(&mut self, segment: &Segment) {
        let order = self.root.nrows();
        let Segment { transition, input } = segment;
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
    }

    fn settle(&mut self) {
        let (squares, settled) = (&mut self.squares, self.settled);
        self.open.retain(|open| {
            let rest = norm(&open.row).powi(2);
            squares[open.index] = open.fixed;
            rest > settled * open.fixed
        });
    }

    /// The mean-square errors of all target samples.
    pub(super) fn finish(mut self) -> Vec<f64> {
        for open in &self.open {
            self.squares[open.index] = open.fixed + norm(&open.row).powi(2);
        }
        self.squares
    }
}

/// The Householder reflection I - scale u u* of the state's columns and one for the noise.
struct Reflection {
    u: Vec<f64>,
    scale: f64,
}

impl Reflection {
    /// Turns `y` of the norm `size` into a multiple of the first unit vector.
    fn new(y: Vec<f64>, size: f64) -> Self {
        let mut u = y;
        u[0] += size.copysign(u[0]);
        let scale = 2.0 / u.iter().map(|x| x * x).sum::<f64>();
        Self { u, scale }
    }

    /// Turns `row`, which has no noise. Its first entry is removed and returned, and the entry of the noise
    /// takes its place.
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
