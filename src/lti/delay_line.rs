//! A recursion at the end of a delay line.
//!
//! Filters that look ahead hold delay chains: states that only pass values on. Together they are one large defective
//! eigenvalue at zero, hopeless for any modal form, and yet nothing but a filter of finitely many taps. The first q taps
//! of the response are therefore taken as such; what comes after them is a recursion without the chains,
//!
//! y[k] = sum_{j = 0..q} h_j u[k - j] + c x[k],  x[k + 1] = a x[k] + b u[k - q].

use super::balanced::balanced;
use super::gramian::h2_norm;
use super::modal::{modal, triangular};
use super::{LtiError, StateSpace, StateSpaceError};
use crate::linalg::{self, Mat};

/// States that change the response by less than this fraction of it, all together, are left out: less than a
/// quarter of what rounding the taps does.
const NEGLIGIBLE: f64 = f64::EPSILON / 4.0;

/// See the module's text.
#[derive(Debug, Clone, PartialEq)]
pub struct TappedRecursion {
    /// h_0 .. h_q, p x m each.
    taps: Vec<Mat>,
    /// a, b, c, with d = 0.
    tail: StateSpace,
}

impl TappedRecursion {
    /// The same transfer function, q being the length of the longest chain at the end of which nothing but the
    /// output is. The recursion is balanced, and states of no account are left out.
    ///
    /// # Errors
    /// [`LtiError`] if the system is not stable.
    pub fn new(system: &StateSpace) -> Result<Self, LtiError> {
        let chains = Chains::new(system.a());
        let Self { taps, tail } = Self::split(system, chains.longest)?;
        let tail = tail.select_states(chains.core)?;
        let energy = taps.iter().map(Mat::norm_squared).sum::<f64>() + h2_norm(&tail)?.powi(2);
        Ok(Self { taps, tail: balanced(&tail, NEGLIGIBLE * energy.sqrt())? })
    }

    /// The same transfer function with the first `ticks` samples of its response after the direct one as taps and all states
    /// in the recursion: `y[k] = sum h_j u[k - j] + c a^ticks x[k - ticks]`.
    ///
    /// # Errors
    /// [`StateSpaceError`] never: the parts fit.
    pub fn split(system: &StateSpace, ticks: usize) -> Result<Self, StateSpaceError> {
        let mut taps = vec![system.d().clone()];
        let mut outlook = system.c().clone();
        for _ in 0..ticks {
            taps.push(&outlook * system.b());
            outlook *= system.a();
        }
        let silent = Mat::zeros(system.outputs(), system.inputs());
        Ok(Self { taps, tail: StateSpace::new(system.a().clone(), system.b().clone(), outlook, silent)? })
    }

    /// The recursion x+ = a x + b u at the end of a line of `ticks` inputs, of which `readout` = [c h_q .. h_0] is read.
    ///
    /// # Errors
    /// [`StateSpaceError`] if the shapes do not fit.
    pub fn read_by(readout: &Mat, ticks: usize, a: &Mat, b: &Mat) -> Result<Self, StateSpaceError> {
        let (p, n, m) = (readout.nrows(), a.nrows(), b.ncols());
        let tap = |j: usize| readout.columns(n + (ticks - j) * m, m).into_owned();
        let c = readout.columns(0, n).into_owned();
        let tail = StateSpace::new(a.clone(), b.clone(), c, Mat::zeros(p, m))?;
        Ok(Self { taps: (0..=ticks).map(tap).collect(), tail })
    }

    /// The same outputs for inputs u = `mix` v.
    ///
    /// # Errors
    /// [`StateSpaceError`] if `mix` has not a row for each input.
    pub fn with_inputs(&self, mix: impl Fn(&Mat) -> Mat) -> Result<Self, StateSpaceError> {
        let taps = self.taps.iter().map(&mix).collect();
        let unity = Mat::identity(self.tail.inputs(), self.tail.inputs());
        Ok(Self { taps, tail: self.tail.map_inputs(&mix(&unity))? })
    }

    /// a, b, c of the recursion, with d = 0.
    pub fn tail(&self) -> &StateSpace {
        &self.tail
    }

    /// The recursion as parallel sections, see [`modal`].
    ///
    /// # Errors
    /// As [`modal`].
    pub fn modal(&self) -> Result<Option<Self>, LtiError> {
        let tail = modal(&self.tail)?;
        Ok(tail.map(|tail| Self { taps: self.taps.clone(), tail }))
    }

    /// The recursion as a triangle, see [`triangular`].
    ///
    /// # Errors
    /// As [`triangular`].
    pub fn triangular(&self) -> Result<Self, LtiError> {
        Ok(Self { taps: self.taps.clone(), tail: triangular(&self.tail)? })
    }

    /// q, ticks that the line is long.
    pub fn ticks(&self) -> usize {
        self.taps.len() - 1
    }

    /// One system: the states of the recursion first, then the line from its oldest inputs to its newest. So `a` is block
    /// triangular, and as sparse as can be.
    ///
    /// # Errors
    /// [`StateSpaceError`] never for a recursion made by [`TappedRecursion::new`]: its parts fit.
    pub fn realise(&self) -> Result<StateSpace, StateSpaceError> {
        let (q, m, n) = (self.ticks(), self.tail.inputs(), self.tail.order());
        let line = StateSpace::delay_line(m, q);
        let unity = Mat::identity(self.tail.outputs(), self.tail.outputs());
        let newest_last = self.taps.iter().rev().chain([&unity]);
        let sum = linalg::hstack(&newest_last.collect::<Vec<_>>())?;
        let whole = line.cascade(0..m, &self.tail)?.map_outputs(&sum)?;
        whole.select_states((q * m..q * m + n).chain(0..q * m))
    }
}

/// The states that reach nothing but the output after some steps, told by exact zeros.
struct Chains {
    /// Steps after which none of them matters.
    longest: usize,
    /// All other states.
    core: Vec<usize>,
}

impl Chains {
    fn new(a: &Mat) -> Self {
        let mut core: Vec<usize> = (0..a.nrows()).collect();
        let mut longest = 0;
        loop {
            let reaches_core = |&j: &usize| core.iter().any(|&i| a[(i, j)] != 0.0);
            let rest: Vec<usize> = core.iter().copied().filter(reaches_core).collect();
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
    use crate::linalg::Complex;

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
        StateSpace::new(a, b, c, Mat::from_element(2, 2, 0.125)).unwrap()
    }

    #[test]
    fn chains_become_taps_and_the_rest_a_pair() {
        for (long, short) in [(1, 1), (4, 1), (5, 4), (30, 7)] {
            let system = with_chains(long, short);
            let tapped = TappedRecursion::new(&system).unwrap();
            assert_eq!((tapped.ticks(), tapped.tail.order()), (long, 2));
            let modal = tapped.modal().unwrap().unwrap();
            let triangular = tapped.triangular().unwrap();
            for form in [tapped, modal, triangular] {
                let made = form.realise().unwrap();
                assert_eq!(made.order(), 2 + 2 * long);
                check_same(&system, &made, 1e-12);
            }
        }
    }

    #[test]
    fn the_matrix_has_nothing_but_its_section_and_the_line() {
        let a = TappedRecursion::new(&with_chains(3, 2))
            .unwrap()
            .modal()
            .unwrap()
            .unwrap()
            .realise()
            .unwrap()
            .a()
            .clone();
        assert!(a[(0, 0)] == a[(1, 1)] && a[(0, 1)] == -a[(1, 0)]);
        for i in 0..8 {
            for j in 0..8 {
                let (section, fed) = (i < 2 && j < 2, i < 2 && (2..4).contains(&j));
                let shifted = i >= 2 && j == i + 2;
                let wanted = if shifted { 1.0 } else { 0.0 };
                assert!(section || fed || a[(i, j)] == wanted, "({i}, {j}): {}", a[(i, j)]);
            }
        }
    }

    #[test]
    fn nothing_but_chains_is_nothing_but_taps() {
        let a = Mat::from_fn(6, 6, |i, j| f64::from(u8::from(i == j + 1)));
        let b = Mat::from_fn(6, 1, |i, _| 1.0 + i as f64);
        let c = Mat::from_fn(2, 6, |i, j| (i + 2 * j) as f64);
        let system = StateSpace::new(a, b, c, Mat::zeros(2, 1)).unwrap();
        let tapped = TappedRecursion::new(&system).unwrap();
        assert_eq!((tapped.ticks(), tapped.tail.order()), (6, 0));
        assert_eq!(impulse_responses(&system, 20), impulse_responses(&tapped.realise().unwrap(), 20));
    }

    #[test]
    fn without_chains_there_is_no_line() {
        let a = Mat::from_row_slice(3, 3, &[0.5, 0.4, 0.0, -0.4, 0.5, 0.0, 0.1, 0.0, -0.9]);
        let (b, c) = (Mat::from_element(3, 1, 1.0), Mat::from_row_slice(1, 3, &[1.0, -1.0, 2.0]));
        let system = StateSpace::new(a, b, c, Mat::zeros(1, 1)).unwrap();
        let tapped = TappedRecursion::new(&system).unwrap();
        assert_eq!((tapped.ticks(), tapped.tail.order()), (0, 3));
        check_same(&system, &tapped.modal().unwrap().unwrap().realise().unwrap(), 1e-13);
    }

    #[test]
    fn an_unstable_system_is_refused() {
        let one = Mat::from_element(1, 1, 1.0);
        let system = StateSpace::new(one.clone() * 1.5, one.clone(), one.clone(), one).unwrap();
        assert!(TappedRecursion::new(&system).is_err());
    }
}
