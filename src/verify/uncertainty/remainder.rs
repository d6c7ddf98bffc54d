//! What the rows between the points of a grid may add to the gains at its points.
//!
//! Over a part of the box each row h_i is a mix of its rows at the ends of the part plus a remainder r_i,
//! which is bounded alias by alias ([`super::aliases`]): in the delay and in the cut-off by a chord. So
//! K = K_mix - sum_i F_i r_i, and for a direction u of length 1
//!
//! ```text
//! |u* sum_i F_i r_i| <= R_k = sum_i |F_i| |r_i|   at the alias k.
//! ```
//!
//! Adding norms, |u* K| <= |u* K_mix| + |R|, is too much for front ends that pass steps: there |R| falls
//! only with the root of the width, but lies at high aliases, where K_mix is small. So the aliases are
//! divided. With the near ones of R bounded by A, and kappa_k a bound of |u* W| + sum_i |u* F_i h_i| at the
//! alias k,
//!
//! ```text
//! |u* K|^2 <= (|u* K_mix| + A)^2 + (1/M) sum over the far k of (2 kappa_k R_k + R_k^2).
//! ```
//!
//! The mix is convex, so kappa_k also bounds K_mix. Any division is valid, and the best one is taken. For
//! the near aliases
//!
//! ```text
//! A^2 = the largest eigenvalue of sum_i (c_i^2 / w_i) F_i F_i*,   w_i = |F_i| c_i / sum_j |F_j| c_j,
//! ```
//!
//! with the norms c_i of the r_i, by Cauchy and Schwarz for u* F_i r_i with the weights w_i. That is at most
//! sum_i |F_i| c_i, and for columns F_i that are far from parallel much smaller.

use super::super::ball::{Ball, Matrix};
use super::aliases::{Aliases, FarAliases, Weight};
use super::angle::outward;
use super::complex_matrix::ComplexMatrix;
use super::grid::Halvings;
use super::quick::upper_gain;
use std::rc::Rc;

/// The uncertain row of a channel at a frequency.
#[derive(Debug, Clone)]
pub(super) struct UncertainRow {
    pub(super) response: Rc<Aliases>,
    /// Largest factor of the gain.
    pub(super) gain: f64,
    /// Largest relative error of the cut-off.
    pub(super) cutoff: f64,
    /// Largest error of the delay, and how far the points of its grid are rounded; fast periods.
    pub(super) half: f64,
    pub(super) rounding: f64,
}

/// The rows of all channels with the columns of the filters.
#[derive(Debug)]
pub(super) struct Remainders {
    rows: Vec<UncertainRow>,
    /// Bounds of |F_i|.
    columns: Vec<f64>,
    /// The converter of each row.
    owners: Vec<usize>,
    /// kappa_k at the near aliases, and as a decay over the far ones.
    sizes: Vec<f64>,
    decay: Vec<f64>,
}

/// The bounds of all remainders over one part of the box.
struct Bounds {
    /// |r_i| at the near aliases, by channel, and the sums of the squares of the first ones.
    near: Vec<Vec<f64>>,
    squares: Vec<Vec<f64>>,
    /// Norms of the r_i over the far aliases.
    far: Vec<f64>,
    /// (1/M) sum of kappa_k |r_i| over the far aliases.
    crossed: Vec<f64>,
}

/// A division of the aliases: how many are near, and the sum over the others.
struct Division {
    near: usize,
    others: f64,
    value: f64,
}

impl UncertainRow {
    fn is_certain(&self) -> bool {
        self.half == 0.0 && self.cutoff == 0.0
    }

    /// The weight of the aliases between two points of the grid; `None` if the delay is certain.
    fn weight(&self, halvings: u32) -> Option<Weight> {
        let half = self.half / f64::from(1u32 << halvings) + self.rounding;
        (self.half > 0.0).then_some(Weight::Chord(half))
    }

    /// The chord over 2 x of a function with the second derivative b is within x^2 b / 2 of it. The factors
    /// of the cut-off are doubles near 1.
    fn bend(&self, halvings: u32) -> f64 {
        if self.cutoff == 0.0 {
            return 0.0;
        }
        0.5 * (self.cutoff / f64::from(1u32 << halvings) + f64::EPSILON).powi(2)
    }

    /// |r| at the near aliases.
    fn near(&self, at: Halvings) -> Vec<f64> {
        if self.is_certain() {
            return vec![0.0; self.response.near.len()];
        }
        let (weight, bend) = (self.weight(at.delay), self.bend(at.cutoff));
        let aliases = self.response.frequencies.iter().zip(&self.response.near);
        let between = |nu: f64| weight.map_or(0.0, |weight| weight.at(nu));
        let r = |(&nu, moduli): (&f64, &super::transfer::Moduli)| {
            outward(self.gain * (moduli.value * between(nu) + bend * moduli.curvature))
        };
        aliases.map(r).collect()
    }

    /// The sum over the far aliases that `of` makes of their parts, each a decay with a weight.
    fn far(&self, at: Halvings, of: impl Fn(&FarAliases, &[f64], Weight) -> f64) -> f64 {
        if self.is_certain() {
            return 0.0;
        }
        let far = &self.response.far;
        let between = self.weight(at.delay).map_or(0.0, |weight| of(far, &far.decay, weight));
        let bend = match self.bend(at.cutoff) {
            0.0 => 0.0,
            bend => bend * of(far, &far.curvature, Weight::One),
        };
        outward(self.gain * (between + bend))
    }
}

impl Remainders {
    /// Of all rows, with the responses of the M reference samples and bounds of the columns.
    pub(super) fn new(
        rows: Vec<UncertainRow>,
        reference: &Aliases,
        columns: Vec<f64>,
        owners: Vec<usize>,
        outputs: usize,
    ) -> Self {
        let of_reference = (reference, (outputs as f64).sqrt());
        let of_rows = rows.iter().zip(&columns).map(|(row, column)| (&*row.response, row.gain * column));
        let all: Vec<(&Aliases, f64)> = std::iter::once(of_reference).chain(of_rows).collect();
        let near = |k: usize| outward(all.iter().map(|(aliases, by)| by * aliases.near[k].value).sum());
        let far = |p: usize| {
            let sum: f64 =
                all.iter().map(|(aliases, by)| by * aliases.far.decay.get(p).unwrap_or(&0.0)).sum();
            sum * (1.0 + 1e-11)
        };
        let longest = all.iter().map(|(aliases, _)| aliases.far.decay.len()).max().unwrap_or(0);
        let sizes = (0..reference.near.len()).map(near).collect();
        let decay = (0..longest).map(far).collect();
        Self { rows, columns, owners, sizes, decay }
    }

    /// The gain up to which K_mix may go, so that K does not exceed `threshold` after these halvings; not
    /// positive if there is none.
    pub(super) fn limit(&self, filters: &ComplexMatrix, halvings: &[Halvings], threshold: f64) -> f64 {
        let bounds = self.bounds(halvings);
        let Division { near, others, .. } = self.best_division(&bounds, threshold);
        let norms: Vec<f64> = self.norms(&bounds, near).collect();
        let rest = threshold * threshold * (1.0 - 1e-15) - others;
        signed_root(rest) * (1.0 - 1e-15) - self.joint(filters, &norms)
    }

    /// About the same, in a shorter time and not above it by more than roundings.
    pub(super) fn rough_limit(&self, halvings: &[Halvings], threshold: f64) -> f64 {
        self.best_division(&self.bounds(halvings), threshold).value
    }

    fn bounds(&self, halvings: &[Halvings]) -> Bounds {
        let rows = || self.rows.iter().zip(self.owners.iter().map(|&converter| halvings[converter]));
        let crossed = |far: &FarAliases, decay: &[f64], weight| far.inner(&self.decay, decay, weight);
        let near: Vec<Vec<f64>> = rows().map(|(row, at)| row.near(at)).collect();
        let squares = |r: &Vec<f64>| -> Vec<f64> {
            let sums = r.iter().scan(0.0, |sum, r| {
                *sum += r * r;
                Some(*sum)
            });
            std::iter::once(0.0).chain(sums).collect()
        };
        Bounds {
            squares: near.iter().map(squares).collect(),
            near,
            far: rows().map(|(row, at)| row.far(at, FarAliases::norm)).collect(),
            crossed: rows().map(|(row, at)| row.far(at, crossed)).collect(),
        }
    }

    /// The norm of r_i over the first `near` aliases; over all of them if these are more than are known one
    /// by one.
    fn norm(&self, bounds: &Bounds, i: usize, near: usize) -> f64 {
        let known = bounds.near[i].len();
        let far = if near > known { bounds.far[i] } else { 0.0 };
        let square = bounds.squares[i][near.min(known)] / self.ratio() + far * far;
        if square == 0.0 { 0.0 } else { outward(square.sqrt()) }
    }

    /// The norms of all r_i over the first `near` aliases.
    fn norms(&self, bounds: &Bounds, near: usize) -> impl Iterator<Item = f64> {
        (0..self.rows.len()).map(move |i| self.norm(bounds, i, near))
    }

    fn ratio(&self) -> f64 {
        self.rows.first().map_or(1.0, |row| row.response.far.ratio)
    }

    fn best_division(&self, bounds: &Bounds, threshold: f64) -> Division {
        let (known, ratio) = (self.sizes.len(), self.ratio());
        let weighed = |values: &[f64]| -> f64 {
            self.columns.iter().zip(values).map(|(column, value)| column * value).sum()
        };
        let value = |near: usize, others: f64| {
            let norms = self.columns.iter().zip(self.norms(bounds, near)).map(|(column, norm)| column * norm);
            Division { near, others, value: signed_root(threshold * threshold - others) - norms.sum::<f64>() }
        };
        let mut best = value(known + 1, 0.0);
        if self.rows.iter().all(UncertainRow::is_certain) {
            return best;
        }
        let mut others = 2.0 * weighed(&bounds.crossed) + weighed(&bounds.far).powi(2);
        for near in (0..=known).rev() {
            if near < known {
                let r: f64 = self.columns.iter().zip(&bounds.near).map(|(column, r)| column * r[near]).sum();
                others += (2.0 * self.sizes[near] + r) * r / ratio;
            }
            let other = value(near, outward(others));
            if other.value > best.value {
                best = other;
            }
        }
        best
    }

    /// A of the module's page, from the norms c_i.
    fn joint(&self, filters: &ComplexMatrix, norms: &[f64]) -> f64 {
        let terms = self.columns.iter().zip(norms).map(|(column, c)| column * c);
        let sum = outward(terms.sum());
        if norms.len() < 2 || sum == 0.0 || !sum.is_finite() {
            return sum;
        }
        // c_i^2 / w_i = c_i sum / |F_i|; channels without taps add nothing.
        let weight = |(column, c): (&f64, &f64)| {
            let square = Ball::from(*c) * Ball::from(sum);
            if *column > 0.0 { square / Ball::from(*column) } else { Ball::ZERO }
        };
        let weights: Vec<Ball> = self.columns.iter().zip(norms).map(weight).collect();
        let scaled = |m: &Matrix| Matrix::from_fn(m.nrows(), weights.len(), |p, i| m[(p, i)] * weights[i]);
        let scaled = ComplexMatrix { re: scaled(&filters.re), im: scaled(&filters.im) };
        upper_gain(&scaled.product(&filters.adjoint()), 0.0).min(sum)
    }
}

/// The root, with the sign of x: it grows with x where there is no root, too.
fn signed_root(x: f64) -> f64 {
    x.signum() * x.abs().sqrt()
}
