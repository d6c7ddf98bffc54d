//! The largest gain of the error system at one frequency, over a box of errors.
//!
//! At a fixed frequency K = W - sum_i F_i h_i with the columns F_i of the filters and the rows h_i of the
//! channels. For a delay error between two points of the grid, h_i is a convex mix of the rows at the points
//! plus a remainder of norm at most c_i ([`super::aliases::Weight::Chord`]). The gain is convex, so over a
//! box
//!
//! ```text
//! sigma(K) <= max over the vertices of sigma(K_v) + rho,
//! rho^2 = the largest eigenvalue of sum_i (c_i^2 / w_i) F_i F_i*,   w_i = |F_i| c_i / sum_j |F_j| c_j.
//! ```
//!
//! rho bounds sum_i F_i r_i for all rows of norms c_i, by Cauchy and Schwarz for u* F_i r_i with the weights
//! w_i. It is at most sum_i |F_i| c_i, and for columns F_i that are far from parallel much smaller.
//!
//! Gains enter h_i as factors, so their box adds vertices and no remainder. Where the bound is too large,
//! the box is halved along the channel with the largest remainder.
//!
//! The vertices form a tree, channel by channel. With channel i still free, h_i lies within r_i of the mean
//! of its vertices, so sigma of the mean plus sum |F_i| r_i bounds the whole branch. Where a branch has many
//! vertices, multipliers bound them all at once and far better (`multipliers`).
//!
//! Most gains are compared in double precision (`quick`). Balls decide where that does not suffice, and give
//! the gains that are reported.

use super::super::ball::{self, Ball, Matrix};
use super::super::positive;
use super::super::spectrum::ComplexMatrix;
use super::grid::ChannelGrid;
use super::multipliers::{self, Vertices};
use super::quick::{Compared, Quick, Terms};
use crate::linalg;
use std::collections::HashMap;

/// Steps of the grid that a part needs to be halved.
const HALVED: usize = 2;
/// Relative margins over a computed eigenvalue at which a proof that it is an upper bound is tried.
const MARGINS: [f64; 4] = [1e-9, 1e-6, 1e-3, 1.0];
/// Least vertices of a branch for which multipliers are sought.
const MANY_VERTICES: usize = 512;
/// Above this many vertices nothing else is tried.
const MOST_VERTICES: usize = 1 << 16;
/// Above this many they are not sought on grids that are finer than the box.
const MOST_DIVIDED: usize = 4096;
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
    /// Largest relative error of the gain of each channel.
    pub(super) gains: &'a [f64],
    /// Bounds of the remainder of each channel, by the number of halvings; those of gains included.
    pub(super) remainders: Vec<Vec<f64>>,
}

/// A row h as a sum of rows of the Gram matrix.
pub(super) type Mix = Vec<(usize, f64)>;

/// One vertex of a channel's set.
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

    /// Counts a search for multipliers and its proof, for matrices of some order from `rows` rows of a Gram
    /// matrix.
    fn count_multipliers(&mut self, order: usize, rows: usize) {
        self.gains += 1;
        let (order, rows) = (order as f64, rows as f64);
        self.operations += 4.0 * order * rows * (rows + order) + 6.0 * order.powi(3);
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

/// A part of the delays of a channel: the points `first..=last` of its grid, after `level` halvings.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) level: usize,
}

impl AtFrequency<'_> {
    /// Compares the largest gain over the whole box with `threshold`, within the limit of `work`.
    pub(super) fn compare(&self, threshold: f64, work: &mut Work) -> Verdict {
        let quick = Quick::new(&self.gram, &self.filters);
        let mut remainders: HashMap<Vec<usize>, f64> = HashMap::new();
        let mut sets = Sets { at: self, known: HashMap::new() };
        let mut boxes = vec![self.whole()];
        for _ in 0..MAX_BOXES {
            let Some(parts) = boxes.pop() else { return Verdict::Below };
            let halves = self.halved(&parts, HALVED);
            let levels = parts.iter().map(|part| part.level).collect();
            let remainder = *remainders.entry(levels).or_insert_with(|| self.joint_remainder(&parts));
            let limits = Limits {
                gain: threshold - remainder,
                // Where the box can be halved, gains below the threshold need no digits.
                reported: if halves.is_some() { threshold } else { 0.0 },
            };
            let sets = sets.of(&parts);
            match (Tree { at: self, quick: &quick, sets: &sets, limits, work }.search(), halves) {
                (Found::Nothing, _) => continue,
                (Found::UsedUp, _) => break,
                (Found::Gain(found), _) if found.lower > threshold => return Verdict::Above(found),
                (Found::Gain(found), None) => return Verdict::Open(found),
                (Found::Between | Found::Gain(_), Some(halves)) => boxes.extend(halves),
                (Found::Between, None) => break,
            }
        }
        Verdict::Open(Attained::unknown())
    }

    /// The whole box.
    pub(super) fn whole(&self) -> Vec<Part> {
        let part = |channel: &ChannelGrid| Part { first: 0, last: channel.errors.len() - 1, level: 0 };
        self.channels.iter().map(part).collect()
    }

    /// Whether the grid has points between the ends of the box.
    fn is_divided(&self) -> bool {
        self.channels.iter().any(|channel| channel.errors.len() > 2)
    }

    /// A bound of what channel `i` adds to the gains at the vertices.
    fn term(&self, i: usize, part: &Part) -> f64 {
        self.columns[i] * self.remainders[i][part.level]
    }

    /// A bound of what all channels add to them.
    pub(super) fn remainder(&self, parts: &[Part]) -> f64 {
        super::angle::outward(parts.iter().enumerate().map(|(i, part)| self.term(i, part)).sum())
    }

    /// A smaller bound of the same for taps that stay: rho of the module's page.
    fn joint_remainder(&self, parts: &[Part]) -> f64 {
        let sum = self.remainder(parts);
        let outputs = self.filters.re.nrows();
        if parts.len() < 2 || sum == 0.0 || !sum.is_finite() {
            return sum;
        }
        // c_i^2 / w_i = c_i sum / |F_i|; channels without taps add nothing.
        let weight = |(i, part): (usize, &Part)| {
            let column = self.columns[i];
            let square = Ball::from(self.remainders[i][part.level]) * Ball::from(sum);
            if column > 0.0 { square / Ball::from(column) } else { Ball::ZERO }
        };
        let weights: Vec<Ball> = parts.iter().enumerate().map(weight).collect();
        let scaled = |m: &Matrix| Matrix::from_fn(outputs, weights.len(), |p, i| m[(p, i)] * weights[i]);
        let scaled = ComplexMatrix { re: scaled(&self.filters.re), im: scaled(&self.filters.im) };
        upper_gain(&scaled.product(&self.filters.adjoint()), 0.0).min(sum)
    }

    /// The halves along the channel with the largest remainder that has at least `steps` steps of the grid.
    pub(super) fn halved(&self, parts: &[Part], steps: usize) -> Option<[Vec<Part>; 2]> {
        let can = |i: &usize| parts[*i].last - parts[*i].first >= steps;
        let size = |i: usize| self.term(i, &parts[i]);
        let i = (0..parts.len()).filter(can).max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        let Part { first, last, level } = parts[i];
        let middle = (first + last) / 2;
        let with = |first, last| {
            let mut half = parts.to_vec();
            half[i] = Part { first, last, level: level + 1 };
            half
        };
        Some([with(first, middle), with(middle, last)])
    }

    /// The vertices of a channel.
    pub(super) fn vertices(&self, i: usize, part: &Part) -> Vec<Vertex> {
        let ends = if part.first == part.last { vec![part.first] } else { vec![part.first, part.last] };
        let gain = self.gains[i];
        let gains = if gain == 0.0 { vec![1.0] } else { vec![1.0 - gain, 1.0 + gain] };
        let speeds = 0..self.channels[i].speeds.len();
        let all = ends.iter().flat_map(|&error| speeds.clone().map(move |speed| (error, speed)));
        all.flat_map(|(error, speed)| gains.iter().map(move |&gain| Vertex { error, speed, gain })).collect()
    }

    fn mix(&self, i: usize, vertex: &Vertex) -> Mix {
        vec![(self.channels[i].rows[vertex.error][vertex.speed], vertex.gain)]
    }

    /// The mean of the rows of a set of vertices.
    fn mean(&self, i: usize, set: &[Vertex]) -> Mix {
        let mut mean: Mix = Vec::new();
        for (row, gain) in set.iter().flat_map(|vertex| self.mix(i, vertex)) {
            let share = gain / set.len() as f64;
            match mean.iter_mut().find(|(known, _)| *known == row) {
                Some((_, weight)) => *weight += share,
                None => mean.push((row, share)),
            }
        }
        mean
    }

    /// A bound of the distance of the rows of a set from their mean.
    fn radius(&self, i: usize, set: &[Vertex], mean: &Mix) -> f64 {
        if set.len() == 1 {
            return 0.0;
        }
        let distance = |vertex: &Vertex| {
            let mut difference = mean.clone();
            difference.extend(self.mix(i, vertex).into_iter().map(|(row, gain)| (row, -gain)));
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
        let outputs = self.filters.re.nrows();
        let terms: Vec<(usize, usize, f64)> = mixes
            .iter()
            .enumerate()
            .flat_map(|(i, mix)| mix.iter().map(move |&(row, weight)| (i, row, -weight)))
            .collect();
        let rows: Vec<usize> = (0..outputs).chain(terms.iter().map(|&(_, row, _)| row)).collect();
        let part = |filters: &Matrix, unit: f64| {
            Matrix::from_fn(outputs, rows.len(), |p, c| match c.checked_sub(outputs) {
                None if p == c && unit != 0.0 => Ball::from(unit),
                None => Ball::ZERO,
                Some(t) => filters[(p, terms[t].0)] * Ball::from(terms[t].2),
            })
        };
        let map = ComplexMatrix { re: part(&self.filters.re, 1.0), im: part(&self.filters.im, 0.0) };
        map.product(&self.gram.select(&rows, &rows)).product(&map.adjoint())
    }
}

/// The vertices of a channel over a part of its delays.
#[derive(Debug, Clone)]
struct Set {
    vertices: Vec<Vertex>,
    mean: Mix,
    /// Bounds |F_i| times the distance of the rows from their mean.
    radius: f64,
}

/// The sets of all parts so far, by channel and ends.
struct Sets<'a, 'b> {
    at: &'a AtFrequency<'b>,
    known: HashMap<(usize, usize, usize), Set>,
}

impl Sets<'_, '_> {
    fn of(&mut self, parts: &[Part]) -> Vec<Set> {
        let at = self.at;
        let set = |(i, part): (usize, &Part)| {
            let make = || {
                let vertices = at.vertices(i, part);
                let mean = at.mean(i, &vertices);
                let radius = at.columns[i] * at.radius(i, &vertices, &mean);
                Set { vertices, mean, radius }
            };
            self.known.entry((i, part.first, part.last)).or_insert_with(make).clone()
        };
        parts.iter().enumerate().map(set).collect()
    }
}

/// What the gains of one box are compared with.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// Gains up to this are small enough.
    gain: f64,
    /// Gains up to this are not computed to all digits.
    reported: f64,
}

/// What a search found.
enum Found {
    /// All gains are within the limit.
    Nothing,
    /// One is not, but is not to be reported.
    Between,
    Gain(Attained),
    /// The work ended, or there are too many vertices.
    UsedUp,
}

/// The search among the vertices of one box.
struct Tree<'a, 'b> {
    at: &'a AtFrequency<'b>,
    quick: &'a Quick,
    sets: &'a [Set],
    limits: Limits,
    work: &'a mut Work,
}

impl Tree<'_, '_> {
    fn search(&mut self) -> Found {
        // spread[i] bounds what the channels from i on may add to their means.
        let mut spread = vec![0.0; self.sets.len() + 1];
        for (i, set) in self.sets.iter().enumerate().rev() {
            spread[i] = super::angle::outward(spread[i + 1] + set.radius);
        }
        let mut mixes: Vec<Mix> = self.sets.iter().map(|set| set.mean.clone()).collect();
        self.branch(&spread, &mut mixes, &mut Vec::new())
    }

    /// `mixes` are the chosen vertices of the first channels and the means of the others.
    fn branch(&mut self, spread: &[f64], mixes: &mut [Mix], chosen: &mut Vec<Vertex>) -> Found {
        let channel = chosen.len();
        if self.work.is_used_up() {
            return Found::UsedUp;
        }
        if let Some(found) = self.judge(spread[channel], mixes, chosen) {
            return found;
        }
        match self.are_bounded(chosen) {
            Some(true) => return Found::Nothing,
            Some(false) => return Found::UsedUp,
            None => {}
        }
        let sets = self.sets;
        for vertex in &sets[channel].vertices {
            mixes[channel] = self.at.mix(channel, vertex);
            chosen.push(*vertex);
            let found = self.branch(spread, mixes, chosen);
            chosen.pop();
            if !matches!(found, Found::Nothing) {
                return found;
            }
        }
        mixes[channel].clone_from(&sets[channel].mean);
        Found::Nothing
    }

    /// Whether multipliers prove that all vertices of a branch are within the limit; `None` if there are few
    /// enough to look at them.
    fn are_bounded(&mut self, chosen: &[Vertex]) -> Option<bool> {
        let sets = self.sets;
        let chosen_sets = chosen.iter().map(std::slice::from_ref);
        let others = sets[chosen.len()..].iter().map(|set| set.vertices.as_slice());
        let channels: Vec<Vertices<'_>> = chosen_sets.chain(others).collect();
        let count = channels.iter().fold(1usize, |all, vertices| all.saturating_mul(vertices.len()));
        if count < MANY_VERTICES {
            return None;
        }
        if count > MOST_DIVIDED && self.at.is_divided() {
            return Some(false);
        }
        let order = multipliers::order(self.at.filters.re.nrows(), &channels);
        self.work.count_multipliers(order, self.at.gram.re.nrows());
        let is_proven = multipliers::proves(self.at, &channels, self.limits.gain);
        (is_proven || count > MOST_VERTICES).then_some(is_proven)
    }

    /// The verdict on a branch, or `None` if its parts must be looked at.
    fn judge(&mut self, spread: f64, mixes: &[Mix], chosen: &[Vertex]) -> Option<Found> {
        let (limit, is_leaf) = (self.limits.gain - spread, chosen.len() == self.sets.len());
        self.work.count_quick();
        let terms = self.terms(mixes);
        match self.quick.compare(&terms, limit) {
            Compared::Below => return Some(Found::Nothing),
            Compared::NotBelow if !is_leaf => return None,
            Compared::NotBelow if self.quick.compare(&terms, self.limits.reported) == Compared::Below => {
                return Some(Found::Between);
            }
            _ => {}
        }
        self.work.count();
        let square = self.at.square(mixes);
        let upper = upper_gain(&square, limit);
        if upper <= limit {
            return Some(Found::Nothing);
        }
        let attained = || Attained { lower: lower_gain(&square), upper, vertices: chosen.to_vec() };
        is_leaf.then(|| Found::Gain(attained()))
    }

    fn terms(&self, mixes: &[Mix]) -> Terms {
        let mut terms = Terms::default();
        for (i, mix) in mixes.iter().enumerate() {
            mix.iter().for_each(|&(row, weight)| self.quick.subtract(&mut terms, i, row, weight));
        }
        terms
    }
}

/// A proven upper bound of the root of the largest eigenvalue; at least tries to prove `wanted` if the
/// eigenvalue is below.
pub(super) fn upper_gain(square: &ComplexMatrix, wanted: f64) -> f64 {
    let real = square.realified();
    let Ok(values) = linalg::symmetric_eigenvalues(&ball::nearest(&real)) else { return f64::INFINITY };
    let largest = values.into_iter().fold(0.0, f64::max);
    let exceeds = |bound: f64| {
        let shifted = Matrix::from_fn(real.nrows(), real.nrows(), |i, j| {
            let entry = -real[(i, j)];
            if i == j { entry + Ball::from(bound) } else { entry }
        });
        positive::exceeds(&shifted, 0.0)
    };
    let tight = wanted * wanted * (1.0 - 1e-14);
    let tried = MARGINS.iter().map(|margin| largest * (1.0 + margin) + f64::MIN_POSITIVE);
    let enough = (wanted > 0.0 && largest < tight).then_some(tight);
    let proven = enough.into_iter().chain(tried).find(|&bound| exceeds(bound));
    proven.map_or(f64::INFINITY, |bound| bound.sqrt() * (1.0 + 1e-15))
}

/// A proven lower bound of the same: the quotient of a direction near the eigenvector.
pub(super) fn lower_gain(square: &ComplexMatrix) -> f64 {
    let real = square.realified();
    let Ok((values, vectors)) = linalg::symmetric_eigen(&ball::nearest(&real)) else { return 0.0 };
    let Some(k) = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])) else { return 0.0 };
    let direction: Matrix = ball::exact(&vectors.columns(k, 1).into_owned());
    let transposed = direction.transpose();
    let energy = ball::product(&transposed, &ball::product(&real, &direction))[(0, 0)];
    let quotient = (energy / ball::product(&transposed, &direction)[(0, 0)]).lower();
    if quotient > 0.0 { quotient.sqrt() * (1.0 - 1e-15) } else { 0.0 }
}
