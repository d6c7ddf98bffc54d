//! Exact discretisation: square roots of the finite-time controllability Gramian.

use hybank_linalg::{GAUSS_LEGENDRE, Mat};

/// e^{A t} of a block-diagonal A, computed block by block. Scaling and squaring of the whole matrix would
/// scale for the largest block, and the slow blocks would lose digits.
#[derive(Debug, Clone)]
pub(crate) struct StateTransition {
    blocks: Vec<Mat>,
    order: usize,
}

impl StateTransition {
    /// The transition of dx/dt = diag(blocks) x; the blocks are square.
    pub(crate) fn new(blocks: Vec<Mat>) -> Self {
        let order = blocks.iter().map(Mat::nrows).sum();
        Self { blocks, order }
    }

    /// e^{A t}, n x n.
    pub(crate) fn over(&self, t: f64) -> Mat {
        let mut transition = Mat::zeros(self.order, self.order);
        let mut start = 0;
        for block in &self.blocks {
            let n = block.nrows();
            transition.view_mut((start, start), (n, n)).copy_from(&hybank_linalg::expm(&(block * t)));
            start += n;
        }
        transition
    }

    fn norm(&self) -> f64 {
        self.blocks.iter().map(Mat::norm).fold(0.0, f64::max)
    }
}

/// Lower trapezoidal `S` with `S S' = int_0^t e^{a s} b b' e^{a' s} ds` (thesis A.5, there by Van Loan's
/// block exponential).
///
/// The Gramian of a smooth system over a short time has eigenvalues many decades apart; squaring
/// would lose half of the digits. So the *square root* is computed: quadrature columns
/// sqrt(weight) e^{a s} b over a sub-interval short against the dynamics, then doubling
/// S(2t) = [S(t), e^{a t} S(t)], compressed by an LQ factorisation each time.
pub(crate) fn gramian_root(transition: &StateTransition, b: &Mat, t: f64) -> Mat {
    let halvings = halvings(transition, t);
    let mut step = t * 0.5_f64.powi(halvings as i32);
    let mut root = quadrature_root(transition, b, step);
    for _ in 0..halvings {
        root = hybank_linalg::lq_factor(&hybank_linalg::hstack(&[&root, &(transition.over(step) * &root)]));
        step *= 2.0;
    }
    root
}

/// How often t must be halved until ||a|| t <= 1/2.
fn halvings(transition: &StateTransition, t: f64) -> usize {
    let size = transition.norm() * t * 2.0;
    if size <= 1.0 { 0 } else { (size.log2().ceil() as usize).min(128) }
}

fn quadrature_root(transition: &StateTransition, b: &Mat, t: f64) -> Mat {
    let (n, m) = b.shape();
    let mut columns = Mat::zeros(n, GAUSS_LEGENDRE.len() * m);
    for (k, (node, weight)) in GAUSS_LEGENDRE.iter().enumerate() {
        let column = transition.over(node * t) * b * (weight * t).sqrt();
        columns.columns_mut(k * m, m).copy_from(&column);
    }
    hybank_linalg::lq_factor(&columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Van Loan's block exponential, the independent route.
    fn van_loan(a: &Mat, b: &Mat, t: f64) -> Mat {
        let n = a.nrows();
        let mut block = Mat::zeros(2 * n, 2 * n);
        block.view_mut((0, 0), (n, n)).copy_from(&(-a * t));
        block.view_mut((0, n), (n, n)).copy_from(&(b * b.transpose() * t));
        block.view_mut((n, n), (n, n)).copy_from(&(a.transpose() * t));
        let e = hybank_linalg::expm(&block);
        e.view((n, n), (n, n)).transpose() * e.view((0, n), (n, n))
    }

    #[test]
    fn agrees_with_van_loan() {
        let a = Mat::from_row_slice(3, 3, &[-1.0, 2.0, 0.0, -2.0, -1.0, 1.0, 0.0, 0.0, -0.3]);
        let b = Mat::from_row_slice(3, 1, &[0.0, 1.0, 1.0]);
        for t in [1e-3, 0.1, 1.0, 4.0] {
            let root = gramian_root(&StateTransition::new(vec![a.clone()]), &b, t);
            let (ours, reference) = (&root * root.transpose(), van_loan(&a, &b, t));
            assert!((&ours - &reference).norm() < 1e-12 * reference.norm(), "t = {t}");
        }
    }

    #[test]
    fn one_pole_has_its_closed_form_for_any_stiffness() {
        for pole in [1e-9, 1e-3, 1.0, 1e3, 1e9] {
            let root = gramian_root(
                &StateTransition::new(vec![Mat::from_element(1, 1, -pole)]),
                &Mat::from_element(1, 1, 1.0),
                1.0,
            );
            let exact = -(-2.0 * pole).exp_m1() / (2.0 * pole);
            assert!((root[0] * root[0] - exact).abs() < 1e-11 * exact, "pole {pole}");
        }
    }

    #[test]
    fn chain_of_integrators_keeps_its_tiny_directions() {
        // The Gramian of n integrators over [0, t] is t^(2n-1-i-j)/((n-1-i)!(n-1-j)!(2n-1-i-j)); its
        // determinant is known through the Hilbert matrix, far below what the squared matrix resolves.
        let n = 6;
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(j == i + 1)));
        let mut b = Mat::zeros(n, 1);
        b[n - 1] = 1.0;
        let t: f64 = 1e-2;
        let root = gramian_root(&StateTransition::new(vec![a.clone()]), &b, t);
        let ours: f64 = (0..n).map(|i| root[(i, i)].abs().ln()).sum::<f64>() * 2.0;
        let factorial = |k: usize| (1..=k).map(|i| (i as f64).ln()).sum::<f64>();
        let hilbert = 4.0 * (1..n).map(factorial).sum::<f64>() - (1..2 * n).map(factorial).sum::<f64>();
        let powers: f64 =
            (0..n).map(|i| (2 * (n - 1 - i) + 1) as f64 * t.ln() - 2.0 * factorial(n - 1 - i)).sum();
        assert!((ours - hilbert - powers).abs() < 1e-4, "{ours} {}", hilbert + powers);
    }
}
