//! The largest gain of the error system at one frequency over a box of errors, with delay-scheduled taps.
//!
//! The filters are F(delta) = F_0 + sum_j delta_j S_j, so K(delta) = W - sum_i F_i(delta) h_i(delta_i),
//! written for converters with one sample per frame; each sample of a converter adds such a term. In a part
//! of the box with the half-widths d let t be the distances from its centre. Between -d_i and d_i the row
//! h_i is the parabola through its values at -d_i, 0 and d_i, h_i(0) + t_i b_i + t_i^2 q_i, plus a remainder
//! r_i ([`super::aliases::Weight::Parabola`]). Put t_i^2 = d_i^2 - (d_i^2 - t_i^2). The first part leaves a
//! function that is affine in each t_i, so it is a convex mix of the K at the vertices; the second part is
//!
//! ```text
//! s_i d_i^2 (F_i(delta) q_i + S_ii b_i),   s_i = 1 - t_i^2 / d_i^2 in [0, 1],
//! ```
//!
//! S_ii being column i of S_i. That is affine in each t_j and s_j too. With t and s taken as independent, K
//! is K_mix - sum_i F_i(delta) r_i with a convex mix K_mix over the vertices v and all e in {0, 1} of
//!
//! ```text
//! K_v + sum_i e_i d_i^2 (F_i(v) q_i + S_ii b_i).
//! ```
//!
//! A bound by the norms of the second part, sum_i d_i^2 |F_i q_i + S_ii b_i|, would be larger: what the taps
//! make up for at the vertices they miss at the centre, and in K_v both have opposite signs.

use super::super::ball::Ball;
use super::super::spectrum::ComplexMatrix;
use super::at_frequency::{
    AtFrequency, Attained, Limits, MAX_BOXES, Part, Verdict, Vertex, Work, column, scaled,
};
use super::channel::column_norm;
use super::grid::ChannelGrid;
use super::quick::{self, Columns, Compared, Quick, Terms, Workspace, lower_gain, upper_gain};
use super::remainder::Remainders;

/// Points of a grid that a part needs to be halved: each half has its ends and its middle.
const HALVED: usize = 4;

/// One frequency, with delay-scheduled taps.
pub(super) struct Scheduled<'a> {
    at: AtFrequency<'a>,
    /// S_j by converter, M x N, per fast period; `None` where the taps do not depend on the delay.
    slopes: Vec<Option<ComplexMatrix>>,
    /// Half-width of the box by converter, fast periods.
    halves: &'a [Ball],
    doubles: Doubles,
}

/// The same for gains in double precision.
struct Doubles {
    quick: Quick,
    filters: Columns,
    slopes: Vec<Option<Columns>>,
    /// Errors of the delays by converter and point of the grid, with bounds of their rounding.
    deltas: Vec<Vec<[f64; 2]>>,
}

/// What a converter does at a vertex.
#[derive(Debug, Clone, Copy)]
struct Choice {
    vertex: Vertex,
    /// e_i.
    bowed: bool,
}

/// A column of filters times a row of the Gram matrix.
type Term = (ComplexMatrix, usize);

impl<'a> Scheduled<'a> {
    pub(super) fn new(at: AtFrequency<'a>, slopes: Vec<Option<ComplexMatrix>>, halves: &'a [Ball]) -> Self {
        let points = |i: usize| (0..grid_of(&at, i).errors.len()).map(move |point| (i, point));
        let rounded = |(i, point)| {
            let exact = delta(&at, halves, i, point);
            [exact.nearest(), quick::off(exact)]
        };
        let doubles = Doubles {
            quick: Quick::new(&at.gram, &at.filters),
            filters: Columns::of(&at.filters),
            slopes: slopes.iter().map(|slope| slope.as_ref().map(Columns::of)).collect(),
            deltas: (0..halves.len()).map(|i| points(i).map(rounded).collect()).collect(),
        };
        Self { at, slopes, halves, doubles }
    }

    /// Compares the largest gain over the whole box with `threshold`, within the limit of `work`.
    pub(super) fn compare(&self, remainders: &Remainders, threshold: f64, work: &mut Work) -> Verdict {
        let mut limits = Limits::new(remainders, &self.at.filters, threshold, HALVED);
        let mut boxes = vec![self.at.whole()];
        for _ in 0..MAX_BOXES {
            let Some(parts) = boxes.pop() else { return Verdict::Below };
            // Where the box can be halved, gains below the threshold need no digits.
            let reported = if limits.can_halve(&parts) { threshold } else { 0.0 };
            let Some(found) = self.above(&parts, [limits.of(&parts), reported], work) else { continue };
            if found.lower > threshold {
                return Verdict::Above(found);
            }
            match limits.halved(&parts) {
                Some(halves) if !work.is_used_up() => boxes.extend(halves),
                _ => return Verdict::Open(found),
            }
        }
        Verdict::Open(Attained::unknown())
    }

    /// A vertex whose gain may exceed `limit`; `None` if it is proven that there is none. Gains up to
    /// `reported` are not computed to all digits.
    fn above(&self, parts: &[Part], [limit, reported]: [f64; 2], work: &mut Work) -> Option<Attained> {
        if limit.is_nan() || limit <= 0.0 {
            return Some(Attained::unknown());
        }
        let choices = |(i, part): (usize, &Part)| -> Vec<Choice> {
            let bows: &[bool] = if part.delays.first < part.delays.last { &[false, true] } else { &[false] };
            let at_vertices = self.at.vertices(i, part).into_iter();
            at_vertices.flat_map(|vertex| bows.iter().map(move |&bowed| Choice { vertex, bowed })).collect()
        };
        let sets: Vec<Vec<Choice>> = parts.iter().enumerate().map(choices).collect();
        let count = sets.iter().fold(1usize, |all, set| all.saturating_mul(set.len()));
        let mut chosen: Vec<Choice> = Vec::with_capacity(sets.len());
        let (mut terms, mut space) = (Terms::default(), Workspace::default());
        for index in 0..count {
            if work.is_used_up() {
                return Some(Attained::unknown());
            }
            work.count_quick();
            chosen.clear();
            let mut rest = index;
            for set in &sets {
                chosen.push(set[rest % set.len()]);
                rest /= set.len();
            }
            self.terms(parts, &chosen, &mut terms);
            let mut compare = |limit: f64| self.doubles.quick.compare(&terms, limit, &mut space);
            match compare(limit) {
                Compared::Below => continue,
                Compared::NotBelow if compare(reported) == Compared::Below => {
                    return Some(Attained::unknown());
                }
                _ => work.count(),
            }
            if let Some(found) = self.judge(parts, &chosen, limit) {
                return Some(found);
            }
        }
        None
    }

    /// `None` if it is proven that the gain of this choice is at most `limit`.
    fn judge(&self, parts: &[Part], chosen: &[Choice], limit: f64) -> Option<Attained> {
        let square = self.square(parts, chosen);
        let upper = upper_gain(&square, limit);
        if upper <= limit {
            return None;
        }
        // Only at the vertices themselves the gain is attained.
        let is_attained = chosen.iter().all(|choice| !choice.bowed);
        let lower = if is_attained { lower_gain(&square) } else { 0.0 };
        let vertices = if is_attained { chosen.iter().map(|c| c.vertex).collect() } else { Vec::new() };
        Some(Attained { lower, upper, vertices })
    }

    /// K K* of a choice.
    fn square(&self, parts: &[Part], chosen: &[Choice]) -> ComplexMatrix {
        let deltas: Vec<Ball> = (0..chosen.len()).map(|i| self.delta(i, chosen[i].vertex.error)).collect();
        let filters = moved(&self.at.filters, &self.slopes, &deltas);
        let mut terms: Vec<Term> = Vec::with_capacity(3 * self.at.channels.len());
        for (c, i) in self.columns() {
            let (part, Choice { vertex, bowed }) = (parts[i].delays, chosen[i]);
            let row = |error: usize| self.at.channels[c].rows[error][vertex.speed];
            let gain = Ball::from(vertex.gain);
            let column = scaled(&column(&filters, c), gain);
            terms.push((scaled(&column, Ball::from(-1.0)), row(vertex.error)));
            if bowed {
                let half = Ball::from(0.5);
                let bow = scaled(&column, half);
                // d_i / 2 S_ic for the column c of converter i.
                let width = self.delta(i, part.last) - self.delta(i, part.first);
                let lean = self.slopes[i]
                    .as_ref()
                    .map(|slope| scaled(&self::column(slope, c), gain * width * Ball::from(0.25)));
                let ends = [(part.last, 1.0), (part.first, -1.0)];
                for (error, sign) in ends {
                    let leaning = lean.as_ref().map(|lean| scaled(lean, Ball::from(sign)));
                    terms.push((leaning.map_or_else(|| bow.clone(), |lean| bow.plus(&lean)), row(error)));
                }
                let middle = (part.first + part.last) / 2;
                terms.push((scaled(&column, Ball::from(-1.0)), row(middle)));
            }
        }
        self.at.square_of(&terms)
    }

    /// The columns of the filters, each with its converter.
    fn columns(&self) -> impl Iterator<Item = (usize, usize)> {
        let converters = self.at.converters.iter().enumerate();
        converters.flat_map(|(i, columns)| columns.clone().map(move |column| (column, i)))
    }

    fn delta(&self, i: usize, point: usize) -> Ball {
        delta(&self.at, self.halves, i, point)
    }

    /// As [`Scheduled::square`], in doubles.
    fn terms(&self, parts: &[Part], chosen: &[Choice], terms: &mut Terms) {
        terms.clear();
        for (c, i) in self.columns() {
            let (part, Choice { vertex, bowed }) = (parts[i].delays, chosen[i]);
            let row = |error: usize| self.at.channels[c].rows[error][vertex.speed];
            let column = self.doubles.column(c, chosen);
            let gain = vertex.gain;
            terms.push(row(vertex.error), -gain, column.iter().copied());
            if !bowed {
                continue;
            }
            // d_i / 2 S_ii = (delta(last) - delta(first)) / 4 S_ii, beside F_i / 2.
            let [first, last] = [part.first, part.last].map(|point| self.doubles.deltas[i][point]);
            let width = [
                last[0] - first[0],
                last[1] + first[1] + 2.0 * quick::UNIT_ROUNDOFF * (last[0] - first[0]).abs(),
            ];
            for (error, sign) in [(part.last, 1.0), (part.first, -1.0)] {
                let mut bow = column.clone();
                bow.iter_mut().flatten().for_each(|x| *x *= 0.5);
                if let Some(slope) = &self.doubles.slopes[i] {
                    add(&mut bow, slope.column(c), [0.25 * sign * width[0], 0.25 * width[1]]);
                }
                terms.push(row(error), gain, bow.into_iter());
            }
            terms.push(row((part.first + part.last) / 2), -gain, column.into_iter());
        }
    }
}

impl Doubles {
    /// Column c of F at the chosen delays.
    fn column(&self, c: usize, chosen: &[Choice]) -> Vec<[f64; 3]> {
        let mut column: Vec<[f64; 3]> = self.filters.column(c).collect();
        for (j, slope) in self.slopes.iter().enumerate() {
            if let Some(slope) = slope {
                add(&mut column, slope.column(c), self.deltas[j][chosen[j].vertex.error]);
            }
        }
        column
    }
}

/// Adds a column times a factor with a bound of its error.
fn add(sum: &mut [[f64; 3]], column: impl Iterator<Item = [f64; 3]>, [factor, off]: [f64; 2]) {
    for ([re, im, error], [x, y, own]) in sum.iter_mut().zip(column) {
        *re += factor * x;
        *im += factor * y;
        let size = x.abs() + y.abs();
        // Each part is rounded in the product and in the sum.
        let rounded = 2.0 * quick::UNIT_ROUNDOFF * (factor.abs() * size + re.abs() + im.abs());
        *error += (factor.abs() + off) * own + off * size + rounded;
    }
}

/// The grid of converter `i`, which its samples share.
fn grid_of<'a>(at: &AtFrequency<'a>, i: usize) -> &'a ChannelGrid {
    &at.channels[at.converters[i].start]
}

/// The error of the delay of converter `i` at a point of its grid, in fast periods.
fn delta(at: &AtFrequency<'_>, halves: &[Ball], i: usize, point: usize) -> Ball {
    let last = grid_of(at, i).errors.len() - 1;
    if last == 0 {
        return Ball::ZERO;
    }
    // The share of the half-width is a short binary fraction.
    Ball::from(2.0 * point as f64 / last as f64 - 1.0) * halves[i]
}

/// Bounds of the columns of F over the whole box, from those of F_0.
pub(super) fn columns(fixed: &[f64], slopes: &[Option<ComplexMatrix>], halves: &[Ball]) -> Vec<f64> {
    let change = |i: usize| {
        let of = |(slope, half): (&Option<ComplexMatrix>, &Ball)| {
            slope.as_ref().map_or(0.0, |slope| column_norm(slope, i) * half.magnitude())
        };
        slopes.iter().zip(halves).map(of).sum::<f64>()
    };
    fixed.iter().enumerate().map(|(i, column)| super::angle::outward(column + change(i))).collect()
}

/// F_0 + sum_j delta_j S_j.
pub(super) fn moved(
    filters: &ComplexMatrix,
    slopes: &[Option<ComplexMatrix>],
    deltas: &[Ball],
) -> ComplexMatrix {
    let scheduled = slopes.iter().zip(deltas).filter_map(|(slope, delta)| Some((slope.as_ref()?, *delta)));
    scheduled.fold(filters.clone(), |sum, (slope, delta)| sum.plus(&scaled(slope, delta)))
}
