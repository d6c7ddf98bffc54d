//! The comparison of the gains over a box with a threshold: a search among the vertices of its parts.
//!
//! The vertices form a tree, converter by converter. With a converter still free, each of its rows h_i lies
//! within r_i of the mean of its vertices, so sigma of the mean plus sum |F_i| r_i bounds the whole branch.
//! Where a branch has many vertices, multipliers bound them all at once and far better (`multipliers`).
//!
//! Most gains are compared in double precision (`quick`). Balls decide where that does not suffice, and give
//! the gains that are reported.

use super::angle::outward;
use super::at_frequency::{AtFrequency, Attained, Limits, MAX_BOXES, Mix, Part, Verdict, Vertex, Work};
use super::multipliers::{self, Vertices};
use super::quick::{Compared, Quick, Terms, Workspace, lower_gain, upper_gain};
use super::remainder::Remainders;
use std::collections::HashMap;

/// Steps of the grid that a part needs to be halved.
const HALVED: usize = 2;
/// Least vertices of a branch for which multipliers are sought: fewer are looked at in less time.
const MANY_VERTICES: usize = 1024;
/// Above this many vertices nothing else is tried.
const MOST_VERTICES: usize = 1 << 16;
/// Above this many they are not sought on grids that are finer than the box.
const MOST_DIVIDED: usize = 4096;

impl Work {
    /// Counts a search for multipliers and its proof, for matrices of some order from `rows` rows of a Gram
    /// matrix.
    fn count_multipliers(&mut self, order: usize, rows: usize) {
        self.gains += 1;
        let (order, rows) = (order as f64, rows as f64);
        self.operations += 4.0 * order * rows * (rows + order) + 6.0 * order.powi(3);
    }
}

impl AtFrequency<'_> {
    /// Compares the largest gain over the whole box with `threshold`, within the limit of `work`.
    pub(super) fn compare(&self, remainders: &Remainders, threshold: f64, work: &mut Work) -> Verdict {
        let quick = Quick::new(&self.gram, &self.filters);
        let mut limits = Limits::new(remainders, &self.filters, threshold, HALVED);
        let mut sets = Sets { at: self, known: HashMap::new() };
        let (mut terms, mut space) = (Terms::default(), Workspace::default());
        let mut boxes = vec![self.whole()];
        for _ in 0..MAX_BOXES {
            let Some(parts) = boxes.pop() else { return Verdict::Below };
            let gains = Gains {
                most: limits.of(&parts),
                // Where the box can be halved, gains below the threshold need no digits.
                reported: if limits.can_halve(&parts) { threshold } else { 0.0 },
            };
            let sets = sets.of(&parts);
            let (terms, space) = (&mut terms, &mut space);
            let mut tree = Tree { at: self, quick: &quick, sets: &sets, gains, work, terms, space };
            match tree.search() {
                Found::Nothing => continue,
                Found::UsedUp => break,
                Found::Gain(found) if found.lower > threshold => return Verdict::Above(found),
                found => match (limits.halved(&parts), found) {
                    (Some(halves), _) => boxes.extend(halves),
                    (None, Found::Gain(found)) => return Verdict::Open(found),
                    (None, _) => break,
                },
            }
        }
        Verdict::Open(Attained::unknown())
    }
}

/// The vertices of a converter over a part of its delays.
#[derive(Debug, Clone)]
struct Set {
    vertices: Vec<Vertex>,
    /// Of the rows of each of its columns.
    means: Vec<Mix>,
    /// Bounds the sum of |F_i| times the distance of the rows from their mean.
    radius: f64,
}

/// The sets of all parts so far, by converter and ends.
struct Sets<'a, 'b> {
    at: &'a AtFrequency<'b>,
    known: HashMap<(usize, Part), Set>,
}

impl Sets<'_, '_> {
    fn of(&mut self, parts: &[Part]) -> Vec<Set> {
        let at = self.at;
        let set = |(i, part): (usize, &Part)| {
            let make = || {
                let vertices = at.vertices(i, part);
                let columns = at.converters[i].clone();
                let means: Vec<Mix> = columns.clone().map(|column| at.mean(column, &vertices)).collect();
                let radius =
                    |(column, mean): (usize, &Mix)| at.columns[column] * at.radius(column, &vertices, mean);
                let radii = columns.zip(&means).map(radius);
                let radius =
                    radii.fold(0.0, |sum, radius| if sum == 0.0 { radius } else { outward(sum + radius) });
                Set { vertices, means, radius }
            };
            self.known.entry((i, *part)).or_insert_with(make).clone()
        };
        parts.iter().enumerate().map(set).collect()
    }
}

/// What the gains of one box are compared with.
#[derive(Debug, Clone, Copy)]
struct Gains {
    /// Gains up to this are small enough.
    most: f64,
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
    gains: Gains,
    work: &'a mut Work,
    terms: &'a mut Terms,
    space: &'a mut Workspace,
}

impl Tree<'_, '_> {
    fn search(&mut self) -> Found {
        // spread[i] bounds what the channels from i on may add to their means.
        let mut spread = vec![0.0; self.sets.len() + 1];
        for (i, set) in self.sets.iter().enumerate().rev() {
            spread[i] = outward(spread[i + 1] + set.radius);
        }
        let mut mixes: Vec<Mix> = self.sets.iter().flat_map(|set| set.means.clone()).collect();
        self.branch(&spread, &mut mixes, &mut Vec::new())
    }

    /// `mixes` are the rows of the chosen vertices of the first converters and the means of the others.
    fn branch(&mut self, spread: &[f64], mixes: &mut [Mix], chosen: &mut Vec<Vertex>) -> Found {
        let converter = chosen.len();
        if self.work.is_used_up() {
            return Found::UsedUp;
        }
        if let Some(found) = self.judge(spread[converter], mixes, chosen) {
            return found;
        }
        match self.are_bounded(chosen) {
            Some(true) => return Found::Nothing,
            Some(false) => return Found::UsedUp,
            None => {}
        }
        let (sets, columns) = (self.sets, self.at.converters[converter].clone());
        for vertex in &sets[converter].vertices {
            for column in columns.clone() {
                mixes[column].clear();
                mixes[column].push(self.at.mix(column, vertex));
            }
            chosen.push(*vertex);
            let found = self.branch(spread, mixes, chosen);
            chosen.pop();
            if !matches!(found, Found::Nothing) {
                return found;
            }
        }
        mixes[columns].clone_from_slice(&sets[converter].means);
        Found::Nothing
    }

    /// Whether multipliers prove that all vertices of a branch are within the limit; `None` if there are few
    /// enough to look at them.
    fn are_bounded(&mut self, chosen: &[Vertex]) -> Option<bool> {
        let others = self.sets[chosen.len()..].iter().map(|set| set.vertices.as_slice());
        let count = others.clone().fold(1usize, |all, vertices| all.saturating_mul(vertices.len()));
        if count < MANY_VERTICES {
            return None;
        }
        if count > MOST_DIVIDED && self.at.is_divided() {
            return Some(false);
        }
        // Multipliers bound the rows of a converter as if each had errors of its own.
        let converters = chosen.iter().map(std::slice::from_ref).chain(others);
        let columns = self.at.converters.iter().zip(converters);
        let channels: Vec<Vertices<'_>> =
            columns.flat_map(|(columns, vertices)| std::iter::repeat_n(vertices, columns.len())).collect();
        let order = multipliers::order(self.at.filters.re.nrows(), &channels);
        self.work.count_multipliers(order, self.at.gram.re.nrows());
        let is_proven = multipliers::proves(self.at, &channels, self.gains.most);
        (is_proven || count > MOST_VERTICES).then_some(is_proven)
    }

    /// The verdict on a branch, or `None` if its parts must be looked at.
    fn judge(&mut self, spread: f64, mixes: &[Mix], chosen: &[Vertex]) -> Option<Found> {
        let (limit, is_leaf) = (self.gains.most - spread, chosen.len() == self.sets.len());
        self.work.count_quick();
        self.set_terms(mixes);
        match self.quick.compare(self.terms, limit, self.space) {
            Compared::Below => return Some(Found::Nothing),
            Compared::NotBelow if !is_leaf => return None,
            Compared::NotBelow
                if self.quick.compare(self.terms, self.gains.reported, self.space) == Compared::Below =>
            {
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

    /// Sets the terms to -F_i times the rows and weights of each channel's mix.
    fn set_terms(&mut self, mixes: &[Mix]) {
        self.terms.clear();
        for (i, mix) in mixes.iter().enumerate() {
            mix.iter().for_each(|&(row, weight)| self.quick.subtract(self.terms, i, row, weight));
        }
    }
}
