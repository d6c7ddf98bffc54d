//! The Newton system: `H_ij = <F_i, X F_j Z>`, bordered by the equalities.

use super::coefficient::{Coefficient, sparse_product};
use super::cone::Element;
use super::problem::{MatrixBlock, Problem};
use crate::linalg::{LinalgError, Mat, PositiveFactor};

/// First shift tried when a matrix is not definite to rounding, its growth, and where to give up; relative
/// to a unit diagonal.
const SHIFT_FIRST: f64 = 1e-15;
const SHIFT_GROWTH: f64 = 10.0;
const SHIFT_LAST: f64 = 1e-4;
/// Steps of iterative refinement against the system as it is.
const REFINEMENTS: usize = 3;

/// `H` of all inequalities.
pub(super) fn assemble(problem: &Problem, x: &Element, z: &Element) -> Mat {
    let n = problem.unknowns();
    let mut h = Mat::zeros(n, n);
    for (k, block) in problem.matrices.iter().enumerate() {
        add_matrix_block(&mut h, block, &x.matrices[k], &z.matrices[k]);
    }
    for (k, block) in problem.linear.iter().enumerate() {
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); block.constant.len()];
        block.entries.iter().for_each(|&(row, i, v)| rows[row].push((i, v)));
        for (row, entries) in rows.iter().enumerate() {
            let weight = x.vectors[k][row] * z.vectors[k][row];
            for &(i, v) in entries {
                entries.iter().for_each(|&(j, w)| h[(i, j)] += weight * v * w);
            }
        }
    }
    h
}

/// Adds one block, the most expensive coefficients first, each by the cheaper of two ways: the full
/// product `X F_j Z` against all that follow, or entry by entry.
fn add_matrix_block(h: &mut Mat, block: &MatrixBlock, x: &Mat, z: &Mat) {
    let n = block.order;
    let mut terms: Vec<&(usize, Coefficient)> = block.terms.iter().collect();
    terms.sort_by_key(|(i, t)| (std::cmp::Reverse(t.inner_cost(n)), *i));
    let mut rest: usize = terms.iter().map(|(_, t)| t.inner_cost(n)).sum();
    for (first, (j, g)) in terms.iter().enumerate() {
        let direct = sparse_entries(g).map_or(usize::MAX, |e| 2 * e.len() * rest);
        let entrywise =
            direct < g.sandwich_cost(n) + rest && terms[first..].iter().all(|(_, t)| is_sparse(t));
        let product = if entrywise { None } else { Some(g.sandwich(x, z)) };
        for (i, f) in &terms[first..] {
            let value = match (&product, sparse_entries(f), sparse_entries(g)) {
                (None, Some(f), Some(g)) => sparse_product(f, g, x, z),
                (product, _, _) => product.as_ref().map_or(0.0, |p| f.inner(p)),
            };
            h[(*i, *j)] += value;
            // Equal unknowns in two different terms meet twice, the diagonal once.
            if !std::ptr::eq(f, g) {
                h[(*j, *i)] += value;
            }
        }
        rest -= g.inner_cost(n);
    }
}

fn sparse_entries(f: &Coefficient) -> Option<&[(usize, usize, f64)]> {
    if let Coefficient::Sparse(entries) = f { Some(entries) } else { None }
}

fn is_sparse(f: &Coefficient) -> bool {
    sparse_entries(f).is_some()
}

/// The factored system `[H, -A'; A, 0]`.
#[derive(Debug)]
pub(super) struct Newton<'a> {
    h: Mat,
    a: &'a Mat,
    scale: Vec<f64>,
    factor: PositiveFactor,
    border: Option<(Mat, PositiveFactor)>,
}

impl<'a> Newton<'a> {
    /// Factors H with the diagonal scaled to one, shifted only as far as it has to be. Rows of A are added
    /// to its definite part, so that directions which only the equalities determine do no harm.
    pub(super) fn new(h: Mat, a: &'a Mat) -> Result<Self, LinalgError> {
        let mut definite = h.clone();
        if a.nrows() > 0 {
            let weight = h.diagonal().amax().max(f64::MIN_POSITIVE);
            definite += a.transpose() * a * weight;
        }
        let scale: Vec<f64> =
            definite.diagonal().iter().map(|d| if *d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }).collect();
        let factor = shifted_factor(&Mat::from_fn(h.nrows(), h.nrows(), |i, j| {
            scale[i] * 0.5 * (definite[(i, j)] + definite[(j, i)]) * scale[j]
        }))?;
        let mut newton = Self { h, a, scale, factor, border: None };
        if a.nrows() > 0 {
            let image = newton.inverse(&a.transpose());
            let schur = a * &image;
            let border = shifted_factor(&((&schur + schur.transpose()) * 0.5))?;
            newton.border = Some((image, border));
        }
        Ok(newton)
    }

    /// The inverse of the definite part.
    fn inverse(&self, rhs: &Mat) -> Mat {
        let mut scaled = rhs.clone();
        scaled.row_iter_mut().zip(&self.scale).for_each(|(mut row, s)| row *= *s);
        let mut x = self.factor.solve(&scaled);
        x.row_iter_mut().zip(&self.scale).for_each(|(mut row, s)| row *= *s);
        x
    }

    /// Solves `H u - A'v = p`, `A u = q`.
    pub(super) fn solve(&self, p: &[f64], q: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (p, q) = (Mat::from_column_slice(p.len(), 1, p), Mat::from_column_slice(q.len(), 1, q));
        let (mut u, mut v) = self.solve_once(&p, &q);
        let mut last = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let (rp, rq) = (&p - &self.h * &u + self.a.transpose() * &v, &q - self.a * &u);
            let size = rp.norm() / (1.0 + p.norm()) + rq.norm() / (1.0 + q.norm());
            if size.is_nan() || size >= last {
                break;
            }
            last = size;
            let (du, dv) = self.solve_once(&rp, &rq);
            let (better_u, better_v) = (&u + du, &v + dv);
            let rest = &p - &self.h * &better_u + self.a.transpose() * &better_v;
            if rest.norm() <= rp.norm() {
                (u, v) = (better_u, better_v);
            }
        }
        (u.as_slice().to_vec(), v.as_slice().to_vec())
    }

    /// With `B = H + w A'A` and `A u = q` the system reads `B u - A'v' = p`, `v' = v + w q`.
    fn solve_once(&self, p: &Mat, q: &Mat) -> (Mat, Mat) {
        let free = self.inverse(p);
        let Some((image, border)) = &self.border else {
            return (free, q.clone());
        };
        let multiplier = border.solve(&(q - self.a * &free));
        let u = free + image * &multiplier;
        let weight = self.h.diagonal().amax().max(f64::MIN_POSITIVE);
        (u, multiplier - q * weight)
    }
}

fn shifted_factor(m: &Mat) -> Result<PositiveFactor, LinalgError> {
    let unit = m.diagonal().amax();
    let mut shift = 0.0;
    loop {
        let mut shifted = m.clone();
        (0..m.nrows()).for_each(|i| shifted[(i, i)] += shift * unit);
        match PositiveFactor::new(&shifted) {
            Ok(factor) => return Ok(factor),
            Err(error) if shift >= SHIFT_LAST => return Err(error),
            Err(_) => shift = (shift * SHIFT_GROWTH).max(SHIFT_FIRST),
        }
    }
}
