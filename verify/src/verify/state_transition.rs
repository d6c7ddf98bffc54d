//! The state transition over a given time: e^{A t} and the Gramian G(t) = int_0^t e^{A s} B B' e^{A' s} ds,
//! enclosed.
//!
//! Both are computed from their Taylor series over a time that is short relative to the dynamics, with the
//! remainder of the series in the radius, and then by doubling: e^{2 A t} = (e^{A t})^2,
//! G(2 t) = G(t) + e^{A t} G(t) e^{A' t}. Only sums and products occur.

use super::ball::{self, Ball, Matrix};
use crate::arithmetic::{DoubleDouble, Float};

/// Maximum number of halvings of the time: ||A|| t up to 1e18.
const MAX_HALVINGS: i32 = 64;

/// e^{A t} and G(t).
#[derive(Debug, Clone)]
pub(super) struct EnclosedTransition<F = DoubleDouble> {
    /// e^{A t}.
    pub(super) transition: Matrix<F>,
    /// G(t).
    pub(super) gramian: Matrix<F>,
}

/// Encloses both for `dx/dt = a x + b f` after the time `t`.
pub(super) fn state_transition<F: Float>(a: &Matrix<F>, b: &Matrix<F>, t: Ball<F>) -> EnclosedTransition<F> {
    let norm = ball::nan_max(ball::row_sum(a), ball::row_sum(&a.transpose()));
    let halvings = halvings(norm * t.magnitude());
    let mut whole = taylor(a, b, t * Ball::from(0.5f64.powi(halvings)), norm);
    for _ in 0..halvings {
        let EnclosedTransition { transition, gramian } = &whole;
        let grown = gramian + ball::congruence(transition, gramian);
        whole = EnclosedTransition { gramian: grown, transition: ball::product(transition, transition) };
    }
    whole
}

/// How often the time must be halved until `2 ||A|| t <= 1/2`.
fn halvings(size: f64) -> i32 {
    (4.0 * size).max(1.0).log2().ceil().min(f64::from(MAX_HALVINGS)) as i32
}

/// The series sum_k (A t)^k / k! and sum_k t^k / k! M_k with M_1 = B B', M_{k+1} = A M_k + M_k A'.
fn taylor<F: Float>(a: &Matrix<F>, b: &Matrix<F>, t: Ball<F>, norm: f64) -> EnclosedTransition<F> {
    let (n, terms) = (a.nrows(), F::SERIES_TERMS);
    let at = ball::scaled(a, t);
    let inputs = ball::scaled(&ball::product_transposed(b, b), t);
    let (mut power, mut derivative) = (ball::identity(n), inputs.clone());
    let (mut transition, mut gramian) = (power.clone(), inputs.clone());
    for k in 1..terms {
        let over = |k: usize| Ball::from(1.0) / Ball::from(k as f64);
        power = ball::scaled(&ball::product(&at, &power), over(k));
        transition += &power;
        let half = ball::product(&at, &derivative);
        derivative = ball::scaled(&(&half + half.transpose()), over(k + 1));
        gramian += &derivative;
    }
    // The terms left out fall at least as fast as 1, 1/2, 1/4, ...
    let (size, factorial) = (norm * t.magnitude() * 1.001, factorial(terms));
    let rest = 2.0 * size.powi(terms as i32) / factorial;
    let gramian_rest = 2.0 * ball::row_sum(&inputs) * (2.0 * size).powi(terms as i32) / factorial;
    // This form of the comparison also treats NaN as unknown; the remainder may be too small for a double.
    let known = |rest: f64| if size <= 0.26 { 1.01 * rest + f64::MIN_POSITIVE } else { f64::NAN };
    EnclosedTransition {
        transition: transition.map(|x| x.widened(known(rest))),
        gramian: gramian.map(|x| x.widened(known(gramian_rest))),
    }
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Float512;
    use hybank_linalg::Mat;

    fn enclosed(a: &Mat, b: &Mat, t: f64) -> EnclosedTransition {
        state_transition(&ball::exact(a), &ball::exact(b), Ball::from(t))
    }

    #[test]
    fn one_pole_has_its_closed_form_for_any_stiffness() {
        for pole in [1e-9, 1e-3, 1.0, 40.0, 1e3, 1e9] {
            let flow = enclosed(&Mat::from_element(1, 1, -pole), &Mat::from_element(1, 1, 1.0), 1.0);
            let (e, g) = (flow.transition[(0, 0)], flow.gramian[(0, 0)]);
            let exact = -(-2.0 * pole).exp_m1() / (2.0 * pole);
            assert!((e.nearest() - (-pole).exp()).abs() <= 1e-15 + e.radius(), "pole {pole}: {e:?}");
            assert!((g.nearest() - exact).abs() <= 4e-15 * exact, "pole {pole}: {g:?}");
            assert!(e.radius() < 1e-17 && g.radius() < 1e-17 * exact.max(1e-9), "pole {pole}: {e:?} {g:?}");
        }
    }

    #[test]
    fn a_rotation_comes_back_to_itself() {
        // e^{2 pi w J} = I; the time is a rounded 2 pi, so the rest is known to first order.
        let a = Mat::from_row_slice(2, 2, &[0.0, 1.0, -1.0, 0.0]);
        let flow = enclosed(&a, &Mat::from_row_slice(2, 1, &[0.0, 1.0]), std::f64::consts::TAU);
        // 2 pi less its double, by the published digits.
        let missing = 2.449_293_598_294_706_4e-16;
        assert!((flow.transition[(0, 1)].nearest() + missing).abs() < 1e-30);
        assert!(flow.transition[(0, 1)].radius() < 1e-26);
    }

    #[test]
    fn a_chain_of_integrators_is_a_polynomial() {
        let n = 5;
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(j == i + 1)));
        let mut b = Mat::zeros(n, 1);
        b[n - 1] = 1.0;
        let t: f64 = 0.75;
        let flow = enclosed(&a, &b, t);
        for i in 0..n {
            for j in 0..n {
                let (p, q) = (n - 1 - i, n - 1 - j);
                let exact = t.powi((p + q + 1) as i32) / (factorial(p) * factorial(q) * (p + q + 1) as f64);
                let g = flow.gramian[(i, j)];
                assert!(
                    (g.nearest() - exact).abs() <= 1e-15 * exact && g.radius() < 1e-27,
                    "{i} {j}: {g:?} {exact}"
                );
            }
        }
    }

    /// The enclosures of 512 bits lie in those of 106, and are tight.
    #[test]
    fn more_digits_agree() {
        let a = Mat::from_row_slice(3, 3, &[-1.0, 2.0, 0.0, -2.0, -1.0, 30.0, 0.0, 0.0, -70.0]);
        let b = Mat::from_row_slice(3, 1, &[0.0, 1.0, 1.0]);
        let short = enclosed(&a, &b, 1.7);
        let long: EnclosedTransition<Float512> =
            state_transition(&ball::exact(&a), &ball::exact(&b), Ball::from(1.7));
        for (x, y) in short.gramian.iter().zip(&long.gramian) {
            assert!(
                (x.nearest() - y.nearest()).abs() <= 2.0 * f64::EPSILON * x.nearest().abs(),
                "{x:?} {y:?}"
            );
        }
        assert!(ball::radius_sum(&long.gramian) < 1e-140 && ball::radius_sum(&long.transition) < 1e-140);
    }

    /// Splitting the time anywhere gives enclosures of the same numbers.
    #[test]
    fn times_add_up() {
        let a = Mat::from_row_slice(3, 3, &[-1.0, 2.0, 0.0, -2.0, -1.0, 30.0, 0.0, 0.0, -70.0]);
        let b = Mat::from_row_slice(3, 1, &[0.0, 1.0, 1.0]);
        let whole = enclosed(&a, &b, 2.0);
        for t in [1e-6, 0.3, 1.9] {
            let rest = state_transition(&ball::exact(&a), &ball::exact(&b), Ball::from(2.0) - Ball::from(t));
            let first = enclosed(&a, &b, t);
            let joined = ball::product(&rest.transition, &first.transition);
            let gramian = &rest.gramian + ball::congruence(&rest.transition, &first.gramian);
            let difference =
                |x: &Matrix, y: &Matrix| x.zip_map(y, |x, y| (x - y).nearest().abs() - (x - y).radius());
            for gap in
                difference(&joined, &whole.transition).iter().chain(&difference(&gramian, &whole.gramian))
            {
                assert!(*gap <= 0.0, "t = {t}: {gap}");
            }
            assert!(ball::radius_sum(&gramian) < 1e-25);
        }
    }
}
