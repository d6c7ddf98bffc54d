//! The largest gain of the error system at one frequency, over a box of errors.
//!
//! At a fixed frequency K = W - sum_i F_i h_i with the columns F_i of the filters and the rows h_i of the
//! samples of a frame. The rows of one converter have one error, so they are chosen together. Over a part of
//! the box each h_i is a convex mix of its rows at the ends of the part plus a remainder (`remainder`). The
//! gain is convex, so it is at most the largest gain at a vertex plus what the remainders add. Gains enter
//! h_i as factors, so their box adds vertices and no remainder. Where the bound is too large, the part is
//! halved along the side that matters most (`vertex_tree`).

use super::super::ball::{self, Ball, Matrix};
use super::complex_matrix::ComplexMatrix;
use super::grid::{ChannelGrid, Halvings};
use super::remainder::Remainders;
use std::collections::HashMap;
use std::ops::Range;

/// Maximum number of boxes at one frequency.
pub(super) const MAX_BOXES: usize = 4096;

/// The Gram matrix of all samples of a grid at one frequency, with the filters.
#[derive(Debug)]
pub(super) struct AtFrequency<'a> {
    pub(super) gram: ComplexMatrix,
    /// F, M x N.
    pub(super) filters: ComplexMatrix,
    /// Bounds of |F_i|.
    pub(super) columns: Vec<f64>,
    pub(super) channels: &'a [ChannelGrid],
    /// The columns of each converter.
    pub(super) converters: &'a [Range<usize>],
    /// Largest relative error of the gain of each converter.
    pub(super) gains: &'a [f64],
}

/// A row h as a sum of rows of the Gram matrix.
pub(super) type Mix = Vec<(usize, f64)>;

/// One vertex of a converter's set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vertex {
    /// Index of the delay error.
    pub(super) error: usize,
    /// Index of the factor of the cut-off.
    pub(super) speed: usize,
    /// Factor of the gain.
    pub(super) gain: f64,
}

/// A gain that is attained at a vertex.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Attained {
    /// Proven from below.
    pub(super) lower: f64,
    /// Proven from above.
    pub(super) upper: f64,
    pub(super) vertices: Vec<Vertex>,
}

impl Attained {
    /// Nothing is known.
    pub(super) fn unknown() -> Self {
        Self { lower: 0.0, upper: f64::INFINITY, vertices: Vec::new() }
    }
}

/// Gains computed and the operations on balls that they took, or the like of them in doubles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Work {
    pub(super) gains: usize,
    pub(super) operations: f64,
    pub(super) limit: f64,
    /// Operations for one gain in balls.
    pub(super) per_gain: f64,
}

/// Gains in doubles for the time of one in balls.
const QUICK_GAINS: f64 = 40.0;

impl Work {
    pub(super) fn is_used_up(&self) -> bool {
        self.operations >= self.limit
    }

    /// Counts a gain in balls.
    pub(super) fn count(&mut self) {
        self.gains += 1;
        self.operations += self.per_gain;
    }

    /// Counts a gain in doubles.
    pub(super) fn count_quick(&mut self) {
        self.gains += 1;
        self.operations += self.per_gain / QUICK_GAINS;
    }
}

/// What is known of the gains over the box.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Verdict {
    /// None is above the threshold.
    Below,
    /// One is.
    Above(Attained),
    /// The remainders are too large for a decision on this grid. The vertex is the worst of those seen.
    Open(Attained),
}

/// The points `first..=last` of a grid, after `halvings` of the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Span {
    pub(super) first: usize,
    pub(super) last: usize,
    halvings: u32,
}

/// A part of the errors of a converter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Part {
    pub(super) delays: Span,
    pub(super) cutoffs: Span,
}

impl Span {
    /// All of `count` points.
    fn whole(count: usize) -> Self {
        Self { first: 0, last: count - 1, halvings: 0 }
    }

    /// Both halves, if there are at least `steps` steps between the ends.
    fn halved(self, steps: usize) -> Option<[Self; 2]> {
        let Self { first, last, halvings } = self;
        let (middle, halvings) = ((first + last) / 2, halvings + 1);
        (last - first >= steps)
            .then_some([Self { first, last: middle, halvings }, Self { first: middle, last, halvings }])
    }

    /// The points at the ends.
    fn ends(self) -> Vec<usize> {
        if self.first == self.last { vec![self.first] } else { vec![self.first, self.last] }
    }
}

/// Steps between the points of the cut-off that a part needs to be halved.
const HALVED_CUTOFF: usize = 2;

impl Part {
    fn halvings(&self) -> Halvings {
        Halvings { delay: self.delays.halvings, cutoff: self.cutoffs.halvings }
    }

    /// The pairs of halves, of the delays and of the cut-offs; `steps` are those that the delays need.
    fn halves(&self, steps: usize) -> impl Iterator<Item = [Self; 2]> {
        let Self { delays, cutoffs } = *self;
        let by_delay = delays.halved(steps).map(|halves| halves.map(|delays| Self { delays, cutoffs }));
        let halves = cutoffs.halved(HALVED_CUTOFF);
        let by_cutoff = halves.map(|halves| halves.map(|cutoffs| Self { delays, cutoffs }));
        by_delay.into_iter().chain(by_cutoff)
    }
}

/// The gains up to which the vertices of parts may go, so that no gain in the part exceeds `threshold`.
pub(super) struct Limits<'a> {
    remainders: &'a Remainders,
    filters: &'a ComplexMatrix,
    threshold: f64,
    /// Steps between the points of a delay that a part needs to be halved.
    steps: usize,
    known: HashMap<Vec<Halvings>, f64>,
}

impl<'a> Limits<'a> {
    pub(super) fn new(
        remainders: &'a Remainders,
        filters: &'a ComplexMatrix,
        threshold: f64,
        steps: usize,
    ) -> Self {
        Self { remainders, filters, threshold, steps, known: HashMap::new() }
    }

    pub(super) fn of(&mut self, parts: &[Part]) -> f64 {
        let halvings: Vec<Halvings> = parts.iter().map(Part::halvings).collect();
        let make = |halvings: &Vec<Halvings>| self.remainders.limit(self.filters, halvings, self.threshold);
        *self.known.entry(halvings).or_insert_with_key(make)
    }

    /// Whether the grid has points within the parts.
    pub(super) fn can_halve(&self, parts: &[Part]) -> bool {
        parts.iter().any(|part| part.halves(self.steps).next().is_some())
    }

    /// The halves along the side that leaves most of the limit, of those with points within.
    pub(super) fn halved(&self, parts: &[Part]) -> Option<[Vec<Part>; 2]> {
        let sides = parts.iter().enumerate();
        let sides = sides.flat_map(|(i, part)| part.halves(self.steps).map(move |halves| (i, halves)));
        let limit = |i: usize, half: Part| {
            let at = |(k, part): (usize, &Part)| if k == i { half.halvings() } else { part.halvings() };
            let halvings: Vec<Halvings> = parts.iter().enumerate().map(at).collect();
            self.remainders.rough_limit(&halvings, self.threshold)
        };
        let rated = sides.map(|(i, halves)| (limit(i, halves[0]), i, halves));
        let (_, i, halves) = rated.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(halves.map(|half| {
            let mut with = parts.to_vec();
            with[i] = half;
            with
        }))
    }
}

impl AtFrequency<'_> {
    /// The whole box.
    pub(super) fn whole(&self) -> Vec<Part> {
        let part = |columns: &Range<usize>| Part {
            delays: Span::whole(self.channels[columns.start].errors.len()),
            cutoffs: Span::whole(self.channels[columns.start].speeds.len()),
        };
        self.converters.iter().map(part).collect()
    }

    /// Whether the grid has points between the ends of the box.
    pub(super) fn is_divided(&self) -> bool {
        self.channels.iter().any(|channel| channel.errors.len() > 2 || channel.speeds.len() > 2)
    }

    /// The vertices of a converter.
    pub(super) fn vertices(&self, i: usize, part: &Part) -> Vec<Vertex> {
        let gain = self.gains[i];
        let gains = if gain == 0.0 { vec![1.0] } else { vec![1.0 - gain, 1.0 + gain] };
        let (errors, speeds) = (part.delays.ends(), part.cutoffs.ends());
        let all = errors.iter().flat_map(|&error| speeds.iter().map(move |&speed| (error, speed)));
        all.flat_map(|(error, speed)| gains.iter().map(move |&gain| Vertex { error, speed, gain })).collect()
    }

    /// The row of a vertex, and its weight.
    pub(super) fn mix(&self, i: usize, vertex: &Vertex) -> (usize, f64) {
        (self.channels[i].rows[vertex.error][vertex.speed], vertex.gain)
    }

    /// The mean of the rows of a set of vertices.
    pub(super) fn mean(&self, i: usize, set: &[Vertex]) -> Mix {
        let mut mean: Mix = Vec::new();
        for (row, gain) in set.iter().map(|vertex| self.mix(i, vertex)) {
            let share = gain / set.len() as f64;
            match mean.iter_mut().find(|(known, _)| *known == row) {
                Some((_, weight)) => *weight += share,
                None => mean.push((row, share)),
            }
        }
        mean
    }

    /// A bound of the distance of the rows of a set from their mean.
    pub(super) fn radius(&self, i: usize, set: &[Vertex], mean: &Mix) -> f64 {
        if set.len() == 1 {
            return 0.0;
        }
        let distance = |vertex: &Vertex| {
            let mut difference = mean.clone();
            let (row, gain) = self.mix(i, vertex);
            difference.push((row, -gain));
            let square = difference.iter().fold(Ball::ZERO, |sum, &(a, x)| {
                difference
                    .iter()
                    .fold(sum, |sum, &(b, y)| sum + Ball::from(x) * Ball::from(y) * self.gram.re[(a, b)])
            });
            square.upper().max(0.0).sqrt() * (1.0 + 1e-15)
        };
        set.iter().map(distance).fold(0.0, ball::nan_max)
    }

    /// K K*, M x M, of K = W + the sum of the columns times their rows of the Gram matrix.
    pub(super) fn square_of(&self, terms: &[(ComplexMatrix, usize)]) -> ComplexMatrix {
        let outputs = self.filters.re.nrows();
        let rows: Vec<usize> = (0..outputs).chain(terms.iter().map(|&(_, row)| row)).collect();
        let part = |of: fn(&ComplexMatrix) -> &Matrix, unit: f64| {
            Matrix::from_fn(outputs, rows.len(), |p, c| match c.checked_sub(outputs) {
                None if p == c && unit != 0.0 => Ball::from(unit),
                None => Ball::ZERO,
                Some(t) => of(&terms[t].0)[(p, 0)],
            })
        };
        let map = ComplexMatrix { re: part(|m| &m.re, 1.0), im: part(|m| &m.im, 0.0) };
        map.product(&self.gram.select(&rows, &rows)).product(&map.adjoint())
    }

    /// K K*, M x M, of the rows `mixes`.
    pub(super) fn square(&self, mixes: &[Mix]) -> ComplexMatrix {
        let term = |i: usize, &(row, weight): &(usize, f64)| {
            (scaled(&column(&self.filters, i), Ball::from(-weight)), row)
        };
        let terms = mixes.iter().enumerate().flat_map(|(i, mix)| mix.iter().map(move |part| term(i, part)));
        self.square_of(&terms.collect::<Vec<_>>())
    }
}

pub(super) fn column(filters: &ComplexMatrix, i: usize) -> ComplexMatrix {
    let rows: Vec<usize> = (0..filters.re.nrows()).collect();
    filters.select(&rows, &[i])
}

pub(super) fn scaled(m: &ComplexMatrix, by: Ball) -> ComplexMatrix {
    ComplexMatrix { re: ball::scaled(&m.re, by), im: ball::scaled(&m.im, by) }
}
