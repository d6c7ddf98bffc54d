//! The small LMIs, one per point, with their dual matrices.
//!
//! `S = [t I - G, K; K*, I]` is never stored: it follows from t and K, and it is positive definite
//! if and only if `t I - G - K K*` is.

use crate::lmi::IsDue;
use hybank_linalg::Complex;
use hybank_linalg::blocks::{Batch, BatchView, SmallCholesky};

/// Steps of the search for the boundary of the cone: each halves the bracket.
const BISECTIONS: usize = 8;

/// All LMIs of a problem.
pub(super) struct Cone<'a> {
    /// Rows of the first block of each LMI.
    pub(super) m: usize,
    /// Rows of the second.
    pub(super) k1: usize,
    /// `gamma^2`.
    pub(super) t: f64,
    /// M x k1.
    pub(super) k: Batch,
    /// M x M.
    pub(super) g: Batch,
    /// Dual matrices of order M + k1.
    pub(super) z: Batch,
    /// `S^{-1}`.
    pub(super) x: Batch,
    chol: SmallCholesky,
    small: Batch,
    wide: Batch,
    full: Batch,
    is_due: IsDue<'a>,
}

/// A direction in the slack: change of t and of all `K_l`.
#[derive(Debug, Clone)]
pub(super) struct SlackStep {
    pub(super) t: f64,
    pub(super) k: Batch,
}

impl<'a> Cone<'a> {
    pub(super) fn new(t: f64, k: Batch, g: Batch, is_due: IsDue<'a>) -> Self {
        let (count, m, k1) = (k.count(), k.rows(), k.cols());
        let order = m + k1;
        Self {
            m,
            k1,
            t,
            k,
            g,
            z: Batch::zeros(count, order, order),
            x: Batch::zeros(count, order, order),
            chol: SmallCholesky::new(order),
            small: Batch::zeros(1, m, m),
            wide: Batch::zeros(1, m, order),
            full: Batch::zeros(1, order, order),
            is_due,
        }
    }

    /// The points one after the other, up to the moment at which the caller wants an end. The
    /// decompositions of a single point may take a second; what was computed is of no use when not all
    /// points were visited.
    fn points(&self) -> impl Iterator<Item = usize> + use<'a> {
        let is_due = self.is_due;
        (0..self.count()).take_while(move |_| !is_due())
    }

    pub(super) fn count(&self) -> usize {
        self.k.count()
    }

    /// Sum of the orders of all LMIs.
    pub(super) fn order(&self) -> usize {
        self.count() * (self.m + self.k1)
    }

    /// Computes all `S^{-1} = [0 0; 0 I] + E* E`, `E = L^{-1} [I, -K]`, `L L* = t I - G - K K*`. False if
    /// a slack is not positive definite.
    pub(super) fn invert(&mut self) -> bool {
        let (m, k1) = (self.m, self.k1);
        for l in self.points() {
            schur(&mut self.small, self.t, self.g.block(l), self.k.block(l));
            if !self.chol.factor(self.small.block_mut(0)) {
                return false;
            }
            let wide = self.wide.as_mut_slice();
            wide.fill(Complex::default());
            (0..m).for_each(|i| wide[i + m * i].re = 1.0);
            for (to, from) in wide[m * m..].iter_mut().zip(self.k.block(l).data) {
                *to = -from;
            }
            self.wide.block_mut(0).solve_lower(self.small.block(0));
            let e = self.wide.block(0);
            self.x.block_mut(l).set_product(1.0, e.adjoint(), e.plain());
            let data = self.x.block_mut(l).data;
            (m..m + k1).for_each(|i| data[i + (m + k1) * i].re += 1.0);
        }
        true
    }

    /// Starts the dual on the central path: `Z_l = tau S_l^{-1}` with `sum tr Z11 = 1`.
    pub(super) fn center(&mut self, tau: Option<f64>) {
        let tau = tau.unwrap_or_else(|| 1.0 / self.trace(&self.x));
        self.z = self.x.clone();
        self.z.as_mut_slice().iter_mut().for_each(|z| *z *= tau);
    }

    /// `sum_l tr Y11_l`.
    pub(super) fn trace(&self, y: &Batch) -> f64 {
        (0..y.count()).map(|l| (0..self.m).map(|i| y.block(l).at(i, i).re).sum::<f64>()).sum()
    }

    /// `sum_l Re tr(dS_l Y_l)`.
    pub(super) fn inner(&self, step: &SlackStep, y: &Batch) -> f64 {
        let mut off = 0.0;
        for l in 0..self.count() {
            let (dk, y) = (step.k.block(l), y.block(l));
            for c in 0..self.k1 {
                off += (0..self.m).map(|p| (dk.at(p, c).conj() * y.at(p, self.m + c)).re).sum::<f64>();
            }
        }
        step.t * self.trace(y) + 2.0 * off
    }

    /// `sum_l Re tr(S_l Y_l)`; with the dual matrices themselves this is the complementarity gap.
    pub(super) fn inner_slack(&self, y: &Batch) -> f64 {
        let mut sum = 0.0;
        for l in 0..self.count() {
            let (y, g, k) = (y.block(l), self.g.block(l), self.k.block(l));
            let inner = |c: usize, first: usize, from: BatchView<'_>| -> f64 {
                (0..self.m).map(|p| (from.at(p, c).conj() * y.at(p, first + c)).re).sum()
            };
            for c in 0..self.m {
                sum += self.t * y.at(c, c).re - inner(c, 0, g);
            }
            for c in 0..self.k1 {
                sum += 2.0 * inner(c, self.m, k) + y.at(self.m + c, self.m + c).re;
            }
        }
        sum
    }

    /// The complementarity gap `sum_l Re tr(S_l Z_l)`.
    pub(super) fn gap(&self) -> f64 {
        self.inner_slack(&self.z)
    }

    /// `-Z - sym(X dS Z) + sigma_mu X - corrector`, the HKM dual step.
    pub(super) fn dual_step(&self, step: &SlackStep, sigma_mu: f64, corrector: Option<&Batch>) -> Batch {
        let mut out = self.corrector(step, &self.z);
        for ((o, x), z) in out.as_mut_slice().iter_mut().zip(self.x.as_slice()).zip(self.z.as_slice()) {
            *o = x * sigma_mu - z - *o;
        }
        if let Some(c) = corrector {
            out.add_scaled(-1.0, c);
        }
        out
    }

    /// `sym(X dS Y)`, with dZ for Y the second-order term of the predictor.
    pub(super) fn corrector(&self, step: &SlackStep, y: &Batch) -> Batch {
        let order = self.m + self.k1;
        let [mut slack, mut product] = [(); 2].map(|()| Batch::zeros(1, order, order));
        let mut out = Batch::zeros(self.count(), order, order);
        for l in self.points() {
            fill_slack(&mut slack, self.m, step, l);
            product.block_mut(0).set_product(1.0, self.x.block(l).plain(), slack.block(0).plain());
            let mut block = out.block_mut(l);
            block.set_product(1.0, product.block(0).plain(), y.block(l).plain());
            block.make_hermitian();
        }
        out
    }

    /// Largest step, up to `most`, for which all slacks stay positive definite (to a part in 2^8).
    pub(super) fn max_primal_step(&mut self, step: &SlackStep, most: f64) -> f64 {
        let mut longest = most;
        let mut trial = Batch::zeros(1, self.m, self.k1);
        for l in self.points() {
            let (k, dk, g) = (self.k.block(l), step.k.block(l), self.g.block(l));
            let (small, chol, t) = (&mut self.small, &mut self.chol, self.t);
            longest = bisect(longest, |alpha| {
                for ((z, k), d) in trial.as_mut_slice().iter_mut().zip(k.data).zip(dk.data) {
                    *z = k + d * alpha;
                }
                schur(small, t + alpha * step.t, g, trial.block(0));
                chol.factor(small.block_mut(0))
            });
        }
        longest
    }

    /// Largest step, up to `most`, for which all dual matrices stay positive definite.
    pub(super) fn max_dual_step(&mut self, dz: &Batch, most: f64) -> f64 {
        let mut longest = most;
        for l in self.points() {
            let (z, d) = (self.z.block(l), dz.block(l));
            let (full, chol) = (&mut self.full, &mut self.chol);
            longest = bisect(longest, |alpha| {
                for ((f, z), d) in full.as_mut_slice().iter_mut().zip(z.data).zip(d.data) {
                    *f = z + d * alpha;
                }
                chol.factor(full.block_mut(0))
            });
        }
        longest
    }
}

/// `most` if the test holds there, else the largest value found to pass below it (0 if none).
fn bisect(most: f64, mut inside: impl FnMut(f64) -> bool) -> f64 {
    if most == 0.0 || inside(most) {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    // Down by factors of four first, so that short steps keep their relative accuracy.
    for _ in 0..20 {
        let next = 0.25 * high;
        if inside(next) {
            low = next;
            break;
        }
        high = next;
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if inside(middle) { low = middle } else { high = middle }
    }
    low
}

/// `small = t I - G - K K*`.
fn schur(small: &mut Batch, t: f64, g: BatchView<'_>, k: BatchView<'_>) {
    let m = g.rows;
    let data = small.as_mut_slice();
    for (s, g) in data.iter_mut().zip(g.data) {
        *s = -g;
    }
    (0..m).for_each(|i| data[i + m * i].re += t);
    small.block_mut(0).add_product(-1.0, k.plain(), k.adjoint());
}

/// `full = [dt I, dK; dK*, 0]`.
fn fill_slack(full: &mut Batch, m: usize, step: &SlackStep, l: usize) {
    let order = full.rows();
    let data = full.as_mut_slice();
    data.fill(Complex::default());
    (0..m).for_each(|i| data[i + order * i].re = step.t);
    let dk = step.k.block(l);
    for c in 0..dk.cols {
        for p in 0..m {
            data[p + order * (m + c)] = dk.at(p, c);
            data[m + c + order * p] = dk.at(p, c).conj();
        }
    }
}
