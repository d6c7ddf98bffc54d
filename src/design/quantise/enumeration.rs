//! Banks of few taps: a search through all integers of a scale that leaves out what cannot be better
//! (branch and bound).
//!
//! The integers are decided one after the other. A partial decision is given up if one of several quadratic
//! lower bounds of gamma, minimised over the real values of the undecided taps, reaches the best gamma known
//! (Fincke and Pohst, Math. Comp. 44, 1985, with several forms in place of one). The work is limited; within
//! the limit the result is the best of all integers.
//!
//! The bounds are quadratic in the taps. For Hermitian positive semidefinite weights Lambda_k whose traces
//! sum to one,
//!
//! ```text
//! gamma(f)^2 >= sum_k tr( Lambda_k K_k K_k* ) = least + |L' (f - c)|^2,   K_k = W_k - sum_u f_u G_u(k),
//! ```
//!
//! because the largest singular value bounds every weighted mean of the error. G_u is the response of a
//! tap of value one. All phases are coupled, in contrast to the forms of `problem`.

use super::lattice::{Span, closest};
use super::problem::TapError;
use crate::linalg::{self, CMat, Complex, LinalgError, Mat};
use crate::spec::WordLengths;

/// Most taps that may differ from zero, in all channels.
const MAX_UNKNOWNS: usize = 16;
/// Decisions at each scale.
const MAX_DECISIONS: usize = 30_000;
/// A comparison of all integers of a bank costs as much as so many decisions.
const DECISIONS_PER_COMPARISON: usize = 8;
/// Integers of one tap on each side of the middle of its interval: all of 8 bits.
const MAX_BRANCHES: f64 = 128.0;
/// Bounds at each scale.
const BOUND_COUNT: usize = 8;
/// Integers must be better by this fraction.
const LEAST_IMPROVEMENT: f64 = 1e-4;
/// Added to the diagonal relative to each entry, because the form is singular for equal channels.
const RIDGE: f64 = 1e-13;
/// Fraction of the weights that a step replaces.
const REPLACED_SHARE: f64 = 0.3;
/// Points whose share of the new weights is below this get none.
const UNWEIGHTED_SHARE: f64 = 1e-3;

/// Integers, one list per channel.
pub(super) type Integers = Vec<Vec<i64>>;

/// The search for the integers of a bank of few taps.
pub(super) struct Enumeration<'a> {
    error: &'a TapError<'a>,
    errors: AffineErrors,
    spans: Vec<Span>,
}

impl<'a> Enumeration<'a> {
    /// None if the bank has too many taps.
    pub(super) fn new(error: &'a TapError<'a>, bits: &WordLengths) -> Option<Self> {
        let filters = error.problem.taps;
        let unknowns: Vec<Unknown> = (0..filters[0].len())
            .filter(|&tap| bits.span(tap) != (0, 0))
            .flat_map(|tap| (0..filters.len()).map(move |channel| Unknown { channel, tap }))
            .collect();
        if unknowns.len() > MAX_UNKNOWNS {
            return None;
        }
        let spans = unknowns.iter().map(|unknown| Span::of(bits, unknown.tap)).collect();
        Some(Self { error, errors: AffineErrors::new(error, unknowns), spans })
    }

    /// Whether integers of this scale are large enough for a gamma below `bar`.
    ///
    /// # Errors
    /// [`LinalgError`] if a decomposition fails.
    pub(super) fn may_reach(&self, fraction_bits: i32, bar: f64) -> Result<bool, LinalgError> {
        let most = self.spans.iter().map(|span| span.most.max(-span.least)).fold(0.0, f64::max);
        let taps = most * (-f64::from(fraction_bits)).exp2();
        let zero_output = vec![0.0; self.spans.len()];
        for k in 0..self.errors.count() {
            let gain = linalg::largest_singular_value(&self.errors.at(k, &zero_output))?;
            if gain - self.errors.reach(k, taps) >= bar {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Integers with a smaller gamma than `bar`, the best last.
    ///
    /// # Errors
    /// As [`Self::may_reach`].
    pub(super) fn better_than(&self, bar: f64, fraction_bits: i32) -> Result<Vec<Integers>, LinalgError> {
        let step = (-f64::from(fraction_bits)).exp2();
        let mut tree = Tree::new(&self.errors, &self.spans, step, bar);
        tree.find_bounds(self.error.real_gamma)?;
        if !tree.bounds.is_empty() {
            let costs: Vec<f64> = tree.bounds.iter().map(|bound| bound.least).collect();
            tree.decide(self.spans.len(), &mut vec![0.0; self.spans.len()], &costs)?;
        }
        Ok(tree.found.iter().map(|values| self.integers(values, step)).collect())
    }

    fn integers(&self, values: &[f64], step: f64) -> Integers {
        let filters = self.error.problem.taps;
        let mut integers = vec![vec![0; filters[0].len()]; filters.len()];
        for (unknown, value) in self.errors.unknowns.iter().zip(values) {
            integers[unknown.channel][unknown.tap] = (value / step).round() as i64;
        }
        integers
    }
}

/// The tree of decisions at one scale. Values are taps, that is, integers times `step`.
struct Tree<'a> {
    errors: &'a AffineErrors,
    spans: &'a [Span],
    step: f64,
    bounds: Vec<QuadraticBound>,
    /// gamma that is to be undercut.
    bar: f64,
    found: Vec<Vec<f64>>,
    /// Decisions left.
    left: usize,
    /// The points, those first that rejected last.
    order: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn new(errors: &'a AffineErrors, spans: &'a [Span], step: f64, bar: f64) -> Self {
        let order = (0..errors.count()).collect();
        let bar = bar * (1.0 - LEAST_IMPROVEMENT);
        Self { errors, spans, step, bounds: Vec::new(), bar, found: Vec::new(), left: MAX_DECISIONS, order }
    }

    /// Bounds with weights on the frequencies where the integers closest to the last bound's centre are
    /// worst. These integers are candidates, too.
    fn find_bounds(&mut self, floor: f64) -> Result<(), LinalgError> {
        let mut weights = self.errors.uniform();
        for _ in 0..BOUND_COUNT {
            let Some(bound) = self.errors.bound(&weights) else { break };
            let centre: Vec<f64> = bound.centre.iter().map(|value| value / self.step).collect();
            let near: Vec<f64> =
                closest(&bound.factor, &centre, self.spans).iter().map(|x| x * self.step).collect();
            self.compare(&near)?;
            self.bounds.push(bound);
            let Some(moved) = self.errors.emphasise(&weights, &near, floor)? else { break };
            weights = moved;
        }
        Ok(())
    }

    /// Decides the taps below `undecided`, those from there on being decided. `costs` are the bounds so far.
    fn decide(&mut self, undecided: usize, values: &mut Vec<f64>, costs: &[f64]) -> Result<(), LinalgError> {
        let Some(i) = undecided.checked_sub(1) else { return self.compare(values) };
        let bests: Vec<f64> = self.bounds.iter().map(|bound| bound.best(i, values)).collect();
        for integer in self.within_bounds(i, &bests, costs) {
            if self.left == 0 {
                break;
            }
            self.left -= 1;
            let value = integer * self.step;
            let after: Vec<f64> = self
                .bounds
                .iter()
                .zip(bests.iter().zip(costs))
                .map(|(bound, (best, cost))| cost + (bound.factor[(i, i)] * (value - best)).powi(2))
                .collect();
            if after.iter().all(|cost| *cost < self.bar * self.bar) {
                values[i] = value;
                self.decide(i, values, &after)?;
            }
        }
        Ok(())
    }

    /// The integers of tap i that no bound excludes, from the middle of their interval outward.
    fn within_bounds(&self, i: usize, bests: &[f64], costs: &[f64]) -> Vec<f64> {
        let (mut low, mut high) = (self.spans[i].least, self.spans[i].most);
        for (bound, (best, cost)) in self.bounds.iter().zip(bests.iter().zip(costs)) {
            let radius = (self.bar * self.bar - cost).max(0.0).sqrt() / bound.factor[(i, i)];
            low = low.max(((best - radius) / self.step).ceil());
            high = high.min(((best + radius) / self.step).floor());
        }
        let middle = 0.5 * (low + high);
        let first = low.max((middle - MAX_BRANCHES).ceil());
        let count = if high >= low { (high.min(middle + MAX_BRANCHES) - first) as usize + 1 } else { 0 };
        let mut integers: Vec<f64> = (0..count).map(|k| first + k as f64).collect();
        integers.sort_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
        integers
    }

    /// Keeps the values if their gamma is below the bar.
    fn compare(&mut self, values: &[f64]) -> Result<(), LinalgError> {
        self.left = self.left.saturating_sub(DECISIONS_PER_COMPARISON);
        let mut worst = 0.0f64;
        for at in 0..self.order.len() {
            let gain = linalg::largest_singular_value(&self.errors.at(self.order[at], values))?;
            if gain >= self.bar {
                self.order[..=at].rotate_right(1);
                return Ok(());
            }
            worst = worst.max(gain);
        }
        self.bar = worst * (1.0 - LEAST_IMPROVEMENT);
        self.found.push(values.to_vec());
        Ok(())
    }
}

impl QuadraticBound {
    /// The real value of tap i at which the bound is least, given the taps after it.
    fn best(&self, i: usize, values: &[f64]) -> f64 {
        let column = self.factor.column(i);
        let pull: f64 = (i + 1..values.len()).map(|l| column[l] * (values[l] - self.centre[l])).sum();
        self.centre[i] - pull / column[i]
    }
}

/// A tap that may differ from zero.
#[derive(Debug, Clone, Copy)]
struct Unknown {
    channel: usize,
    /// Number of the tap at the fast rate.
    tap: usize,
}

/// The error at the points of a grid as an affine function of a few taps.
struct AffineErrors {
    unknowns: Vec<Unknown>,
    points: Vec<AffinePoint>,
    ratio: usize,
}

/// W, M x q, and below one another the rows that the taps multiply, one per unknown.
struct AffinePoint {
    w: CMat,
    rows: CMat,
}

/// One weight per point, M x M.
#[derive(Clone)]
struct Weights(Vec<CMat>);

/// `gamma^2 >= least + |L' (f - centre)|^2`.
struct QuadraticBound {
    factor: Mat,
    centre: Vec<f64>,
    least: f64,
}

impl AffineErrors {
    fn new(error: &TapError<'_>, unknowns: Vec<Unknown>) -> Self {
        let ratio = error.ratio;
        let points = error.points.iter().map(|point| {
            let row = |u: usize, c: usize| {
                let Unknown { channel, tap } = unknowns[u];
                Complex::from_polar(1.0, -point.omega * (tap / ratio) as f64) * point.h[(channel, c)]
            };
            AffinePoint { w: point.w.clone(), rows: CMat::from_fn(unknowns.len(), point.h.ncols(), row) }
        });
        Self { points: points.collect(), unknowns, ratio }
    }

    /// Number of points.
    fn count(&self) -> usize {
        self.points.len()
    }

    /// K at point `k`.
    fn at(&self, k: usize, taps: &[f64]) -> CMat {
        let AffinePoint { w, rows } = &self.points[k];
        let mut error = w.clone();
        for (u, &value) in taps.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            let phase = self.unknowns[u].tap % self.ratio;
            for c in 0..error.ncols() {
                error[(phase, c)] -= rows[(u, c)] * value;
            }
        }
        error
    }

    /// A bound of how far taps of at most `most` each can lower the gain at point `k`.
    fn reach(&self, k: usize, most: f64) -> f64 {
        most * self.points[k].rows.row_iter().map(|row| row.norm()).sum::<f64>()
    }

    /// Equal weights at all points and in all directions.
    fn uniform(&self) -> Weights {
        let share = Complex::new(1.0 / (self.count() * self.ratio) as f64, 0.0);
        Weights(vec![CMat::from_diagonal_element(self.ratio, self.ratio, share); self.count()])
    }

    /// Moves `weights` towards the worst points and directions of the error of `taps`, which exceeds
    /// `floor`.
    fn emphasise(&self, weights: &Weights, taps: &[f64], floor: f64) -> Result<Option<Weights>, LinalgError> {
        let errors: Vec<CMat> = (0..self.count()).map(|k| self.at(k, taps)).collect();
        let gains: Vec<f64> = errors.iter().map(linalg::largest_singular_value).collect::<Result<_, _>>()?;
        let worst = gains.iter().copied().fold(0.0, f64::max);
        let shares: Vec<f64> =
            gains.iter().map(|gain| ((gain - floor) / (worst - floor)).max(0.0).powi(2)).collect();
        let total: f64 = shares.iter().sum();
        if !(worst > floor && total.is_finite()) {
            return Ok(None);
        }
        let mut moved: Vec<CMat> =
            weights.0.iter().map(|weight| weight * Complex::from(1.0 - REPLACED_SHARE)).collect();
        for (k, share) in shares.iter().enumerate().filter(|(_, share)| **share > UNWEIGHTED_SHARE) {
            let direction = linalg::svd(&errors[k])?.u.column(0).into_owned();
            moved[k] += &direction * direction.adjoint() * Complex::from(REPLACED_SHARE * share / total);
        }
        Ok(Some(Weights(moved)))
    }

    /// The bound that `weights` give; none if rounding errors make the form indefinite.
    fn bound(&self, weights: &Weights) -> Option<QuadraticBound> {
        let size = self.unknowns.len();
        let (mut form, mut slope, mut constant) = (Mat::zeros(size, size), Mat::zeros(size, 1), 0.0);
        for (AffinePoint { w, rows }, weight) in self.points.iter().zip(&weights.0) {
            let weighted = weight * w;
            constant += weighted.iter().zip(w.iter()).map(|(a, b)| a.re * b.re + a.im * b.im).sum::<f64>();
            let products = rows * rows.adjoint();
            let against = weighted * rows.adjoint();
            for (u, a) in self.unknowns.iter().enumerate() {
                let phase = a.tap % self.ratio;
                slope[u] += against[(phase, u)].re;
                for (v, b) in self.unknowns.iter().enumerate() {
                    form[(u, v)] += (products[(u, v)] * weight[(b.tap % self.ratio, phase)]).re;
                }
            }
        }
        (0..size).for_each(|u| form[(u, u)] += RIDGE * form[(u, u)] + f64::MIN_POSITIVE);
        let factor = linalg::cholesky(&form).ok()?;
        let half = factor.solve_lower_triangular(&slope)?;
        let centre = factor.transpose().solve_upper_triangular(&half)?;
        let least = (constant - half.norm_squared()).max(0.0);
        let finite = least.is_finite() && centre.iter().all(|x| x.is_finite());
        finite.then(|| QuadraticBound { factor, centre: centre.iter().copied().collect(), least })
    }
}
