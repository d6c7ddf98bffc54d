//! An FIR head with a recursive tail.
//!
//! Filters with latency contain delay chains: states that only pass values on. Together these states form
//! one large defective eigenvalue at zero, which has no parallel form. Their response has finitely many
//! taps. The first q + 1 taps of the response are therefore realised as the FIR head. A recursion without
//! the chains, the tail, produces the rest:
//!
//! y[k] = sum_{j = 0..q} h_j u[k - j] + c x[k],  x[k + 1] = a x[k] + b u[k - q].

use super::gramian::{balanced, h2_norm};
use super::parallel_form::parallel_form;
use super::{LtiError, StateSpace};
use hybank_linalg::Mat;

/// States that together change the response by less than this fraction are left out. That is a quarter of
/// the effect of rounding the taps.
const TRUNCATION_TOLERANCE: f64 = f64::EPSILON / 4.0;

/// An FIR head with a recursive tail: `y[k] = sum h_j u[k - j] + c x[k]`, `x[k + 1] = a x[k] + b u[k - q]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FirWithTail {
    /// h_0 .. h_q, p x m each.
    head: Vec<Mat>,
    /// a, b, c, with d = 0.
    tail: StateSpace,
}

impl FirWithTail {
    /// The same transfer function, q being the length of the longest delay chain that drives only the
    /// output. The tail is balanced, and its negligible states are left out.
    ///
    /// # Errors
    /// [`LtiError`] if the system is not stable.
    pub(crate) fn new(system: &StateSpace) -> Result<Self, LtiError> {
        let chains = DelayChains::new(system.a());
        let Self { head, tail } = Self::split(system, chains.longest);
        let tail = tail.select_states(chains.core);
        let energy = head.iter().map(Mat::norm_squared).sum::<f64>() + h2_norm(&tail)?.powi(2);
        Ok(Self { head, tail: balanced(&tail, TRUNCATION_TOLERANCE * energy.sqrt())? })
    }

    /// The same transfer function with q = `length` and all states in the tail:
    /// `y[k] = sum h_j u[k - j] + c a^q x[k - q]`.
    fn split(system: &StateSpace, length: usize) -> Self {
        let mut head = vec![system.d().clone()];
        let mut c = system.c().clone();
        for _ in 0..length {
            head.push(&c * system.b());
            c *= system.a();
        }
        let zero = Mat::zeros(system.outputs(), system.inputs());
        Self { head, tail: StateSpace::new(system.a().clone(), system.b().clone(), c, zero) }
    }

    /// The tail as parallel sections, see [`parallel_form`].
    ///
    /// # Errors
    /// As [`parallel_form`].
    pub(crate) fn parallel_form(&self) -> Result<Option<Self>, LtiError> {
        let tail = parallel_form(&self.tail)?;
        Ok(tail.map(|tail| Self { head: self.head.clone(), tail }))
    }

    /// q, the steps by which the input of the tail is delayed.
    pub(crate) fn head_length(&self) -> usize {
        self.head.len() - 1
    }

    /// One system: the states of the tail first, then the past inputs from the oldest to the newest. So `a`
    /// is block triangular and as sparse as possible.
    pub(crate) fn realise(&self) -> StateSpace {
        let (q, m, n) = (self.head_length(), self.tail.inputs(), self.tail.order());
        let line = StateSpace::delay_line(m, q);
        let unity = Mat::identity(self.tail.outputs(), self.tail.outputs());
        let newest_last = self.head.iter().rev().chain([&unity]);
        let sum = hybank_linalg::hstack(&newest_last.collect::<Vec<_>>());
        let whole = line.cascade(0..m, &self.tail).map_outputs(&sum);
        whole.select_states((q * m..q * m + n).chain(0..q * m))
    }
}

/// The delay chains that drive only the output, recognised by exact zeros.
struct DelayChains {
    /// Steps after which none of them has any effect.
    longest: usize,
    /// All other states.
    core: Vec<usize>,
}

impl DelayChains {
    fn new(a: &Mat) -> Self {
        let mut core: Vec<usize> = (0..a.nrows()).collect();
        let mut longest = 0;
        loop {
            let drives_core = |&j: &usize| core.iter().any(|&i| a[(i, j)] != 0.0);
            let rest: Vec<usize> = core.iter().copied().filter(drives_core).collect();
            if rest.len() == core.len() {
                return Self { longest, core };
            }
            core = rest;
            longest += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank_linalg::Complex;

    /// The first `count` samples of the impulse responses, by running the system.
    fn impulse_responses(system: &StateSpace, count: usize) -> Vec<Mat> {
        let mut x = system.b().clone();
        let mut out = vec![system.d().clone()];
        for _ in 1..count {
            out.push(system.c() * &x);
            x = system.a() * x;
        }
        out
    }

    fn check_same(given: &StateSpace, made: &StateSpace, tolerance: f64) {
        for (k, (want, got)) in
            impulse_responses(given, 60).iter().zip(impulse_responses(made, 60)).enumerate()
        {
            assert!((want - &got).norm() <= tolerance, "sample {k}: {want} {got}");
        }
        for w in [0.0, 0.5, 1.7, 3.0] {
            let z = Complex::from_polar(1.0, w);
            let gap = (given.response_at(z) - made.response_at(z)).norm();
            assert!(gap <= 10.0 * tolerance, "at {w}: {gap:e}");
        }
    }

    /// A rotation read by two chains of `long` and `short` links, itself fed with two inputs.
    fn with_chains(long: usize, short: usize) -> StateSpace {
        let n = 2 + long + short;
        let mut a = Mat::zeros(n, n);
        a.view_mut((0, 0), (2, 2)).copy_from(&Mat::from_row_slice(2, 2, &[0.6, 0.5, -0.3, 0.7]));
        let (first, second) = (2, 2 + long);
        for (start, links) in [(first, long), (second, short)] {
            (0..links).for_each(|link| match link {
                0 => (0..2).for_each(|i| a[(start, i)] = 1.0 + (start + i) as f64 / 7.0),
                _ => a[(start + link, start + link - 1)] = 1.0,
            });
        }
        let b = Mat::from_fn(n, 2, |i, j| ((3 * i + 5 * j) as f64).sin());
        let mut c = Mat::zeros(2, n);
        c[(0, first + long - 1)] = 1.0;
        c[(1, second + short - 1)] = 1.0;
        c[(1, 0)] = 0.25;
        StateSpace::new(a, b, c, Mat::from_element(2, 2, 0.125))
    }

    #[test]
    fn chains_become_taps_and_the_rest_a_pair() {
        for (long, short) in [(1, 1), (4, 1), (5, 4), (30, 7)] {
            let system = with_chains(long, short);
            let split = FirWithTail::new(&system).unwrap();
            assert_eq!((split.head_length(), split.tail.order()), (long, 2));
            let parallel = split.parallel_form().unwrap().unwrap();
            for form in [split, parallel] {
                let made = form.realise();
                assert_eq!(made.order(), 2 + 2 * long);
                check_same(&system, &made, 1e-12);
            }
        }
    }

    #[test]
    fn the_matrix_has_nothing_but_its_section_and_the_line() {
        let a = FirWithTail::new(&with_chains(3, 2))
            .unwrap()
            .parallel_form()
            .unwrap()
            .unwrap()
            .realise()
            .a()
            .clone();
        assert!(a[(0, 0)] == a[(1, 1)] && a[(0, 1)] == -a[(1, 0)]);
        for i in 0..8 {
            for j in 0..8 {
                let (section, fed) = (i < 2 && j < 2, i < 2 && (2..4).contains(&j));
                let shifted = i >= 2 && j == i + 2;
                let want = if shifted { 1.0 } else { 0.0 };
                assert!(section || fed || a[(i, j)] == want, "({i}, {j}): {}", a[(i, j)]);
            }
        }
    }

    #[test]
    fn nothing_but_chains_is_nothing_but_taps() {
        let a = Mat::from_fn(6, 6, |i, j| f64::from(u8::from(i == j + 1)));
        let b = Mat::from_fn(6, 1, |i, _| 1.0 + i as f64);
        let c = Mat::from_fn(2, 6, |i, j| (i + 2 * j) as f64);
        let system = StateSpace::new(a, b, c, Mat::zeros(2, 1));
        let split = FirWithTail::new(&system).unwrap();
        assert_eq!((split.head_length(), split.tail.order()), (6, 0));
        assert_eq!(impulse_responses(&system, 20), impulse_responses(&split.realise(), 20));
    }

    #[test]
    fn without_chains_there_is_no_line() {
        let a = Mat::from_row_slice(3, 3, &[0.5, 0.4, 0.0, -0.4, 0.5, 0.0, 0.1, 0.0, -0.9]);
        let (b, c) = (Mat::from_element(3, 1, 1.0), Mat::from_row_slice(1, 3, &[1.0, -1.0, 2.0]));
        let system = StateSpace::new(a, b, c, Mat::zeros(1, 1));
        let split = FirWithTail::new(&system).unwrap();
        assert_eq!((split.head_length(), split.tail.order()), (0, 3));
        check_same(&system, &split.parallel_form().unwrap().unwrap().realise(), 1e-13);
    }

    #[test]
    fn an_unstable_system_is_refused() {
        let one = Mat::from_element(1, 1, 1.0);
        let system = StateSpace::new(one.clone() * 1.5, one.clone(), one.clone(), one);
        assert!(FirWithTail::new(&system).is_err());
    }
}
