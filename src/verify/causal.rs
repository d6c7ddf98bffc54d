//! Lower bound for causal banks: no filter that uses only present and past samples has an error system of
//! norm below gamma.
//!
//! # The game over T periods
//! Let the plant start from rest, xi_0 = 0, and let W and H map the inputs w of the periods 0..T-1 to the
//! reference samples z and the measured samples y of these periods. If y = 0 then the output of every
//! causal bank over these periods is zero too, and its error is z. So a w with `H w = 0` and
//! `|W w| >= gamma |w|` shows that no causal bank, linear or not, has a norm below gamma: the error after
//! period T only increases the norm. (By Arveson's distance formula for nests these bounds tend to the
//! optimum as T grows.)
//!
//! Such a w exists if the Gram matrix of all y and z less gamma^2 on z,
//!
//! ```text
//! Delta = [H H'  H W'            ]
//!         [W H'  W W' - gamma^2 I],
//! ```
//!
//! has fewer negative eigenvalues than there are z: where H H' > 0, its Schur complement W (I - H'(H H')^-1
//! H) W' - gamma^2 I then has an eigenvalue mu - gamma^2 >= 0 with eigenvector b, and w = (I - H'(H H')^-1
//! H) W'b is such an input.
//!
//! # The recursion
//! The block pivots of Delta, period by period, are those of the a-posteriori filtering Riccati difference
//! equation from P = 0 (B. Hassibi, A. H. Sayed, T. Kailath, *Indefinite-Quadratic Estimation and Control*,
//! SIAM 1999, section 4.2): with `[xi+; y; z] = [A; C_2; C_1] xi + [J; L_2; L_1] u` and the Gram matrix S
//! of u,
//!
//! ```text
//! G = [A; C_2; C_1] P [A; C_2; C_1]' + [J; L_2; L_1] S [J; L_2; L_1]' - diag(0, 0, gamma^2 I),
//! P+ = the Schur complement of the block of y and z in G.
//! ```
//!
//! By Sylvester's law the pivots of y are positive and those of z negative as long as the inertia of Delta
//! is right; the first z pivot that is not negative refutes gamma.
//!
//! # Enclosures that do not grow
//! While the inertia is right, a' P+ a is the largest over b_z of the least over b_y of `[a; b]' G [a; b]`;
//! so P+ grows with P, and so do the pivots of z. Each period may therefore begin with exact numbers: the
//! midpoint of the enclosure of P+ minus a diagonal matrix that dominates all radii. This matrix is at most
//! P+. So if it makes a pivot of z nonnegative, the pivot is also nonnegative for P+.
//!
//! A measured sample counts from the first period in which it may differ from zero. If the same filter is
//! sampled at instants a whole number of periods apart, only the newest sample is used. R = L_2 S L_2'
//! may be singular (delayed channels are noise-free measurements of delay-line states); the argument still
//! holds, because the pivots of y are variances given the past.

use super::ball::{self, Ball, Matrix};
use super::error_system::{Layout, Rows, sampled};
use super::slow_period::SlowPeriod;
use crate::arithmetic::Number;

/// Maximum number of states of the recursion, including delay lines.
const MAX_RECURSION_STATES: usize = 128;

/// Relative change of P per period below which it has settled.
const SETTLED_CHANGE: f64 = 1e-13;

/// The precision of the recursion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 106 bits: fast, and sufficient for most banks.
    Short,
    /// 512 bits: for steep filters, whose samples are nearly dependent.
    Long,
}

/// The result of the recursion for a gamma.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recursion {
    /// No causal bank has a norm below gamma.
    Refuted {
        /// The number T of slow periods.
        periods: usize,
    },
    /// The inertia stayed right for the requested number of periods, or until P converged. This proves
    /// nothing.
    Standing,
    /// The precision does not suffice to determine the sign of a pivot.
    Undecided,
}

/// The analog side with its delay lines, and the matrices that the recursion needs.
#[derive(Debug, Clone)]
pub(super) struct CausalPlant<F> {
    /// [A; C_2; C_1].
    system: Matrix<F>,
    /// [J; L_2; L_1] S [J; L_2; L_1]'.
    input_gram: Matrix<F>,
    /// For each measured sample the first period in which it is not zero.
    first: Vec<usize>,
}

impl<F: Number> CausalPlant<F> {
    /// `measured` lists the rows of the measured samples that are not redundant; `None` if there are too
    /// many states.
    pub(super) fn new(period: &SlowPeriod<F>, ratio: usize, measured: &[usize]) -> Option<Self> {
        let used = |s: usize| s < ratio || measured.contains(&s);
        let late = period.delay_periods.iter().enumerate();
        let delay_periods: Vec<usize> = late.map(|(s, &late)| if used(s) { late } else { 0 }).collect();
        if delay_periods.iter().sum::<usize>() + period.order() > MAX_RECURSION_STATES {
            return None;
        }
        let first = measured.iter().map(|&s| delay_periods[s]).collect();
        let period = SlowPeriod { delay_periods, ..period.clone() };
        let (next, samples) = sampled(&period, &Layout::new(&period, 0), 0);
        let order = |rows: &dyn Fn(&Rows<F>) -> Matrix<F>| {
            let (next, samples) = (rows(&next), rows(&samples));
            let n = next.nrows();
            let source = |i: usize| if i < measured.len() { measured[i] } else { i - measured.len() };
            Matrix::from_fn(n + measured.len() + ratio, next.ncols(), |i, j| {
                if i < n { next[(i, j)] } else { samples[(source(i - n), j)] }
            })
        };
        let inputs = order(&|rows| rows.input.clone());
        let system = order(&|rows| rows.state.clone());
        Some(Self { system, input_gram: ball::congruence(&inputs, &period.gram), first })
    }

    /// Runs the recursion at `gamma` for at most `periods` periods.
    pub(super) fn recursion(&self, gamma: f64, periods: usize) -> Recursion {
        let n = self.system.ncols();
        let (measured, rows) = (n + self.first.len(), self.system.nrows());
        let square = Ball::from(gamma) * Ball::from(gamma);
        let mut p: Matrix<F> = ball::zeros(n, n);
        for period in 0..periods {
            let mut gram = ball::congruence(&self.system, &p) + &self.input_gram;
            (measured..rows).for_each(|i| gram[(i, i)] -= square);
            for (row, _) in (n..).zip(&self.first).filter(|&(_, &first)| first <= period) {
                if gram[(row, row)].lower().is_nan() || gram[(row, row)].lower() <= 0.0 {
                    return Recursion::Undecided;
                }
                eliminate(&mut gram, n, row);
            }
            for row in measured..rows {
                let pivot = gram[(row, row)];
                if pivot.lower() >= 0.0 {
                    return Recursion::Refuted { periods: period + 1 };
                }
                if pivot.upper().is_nan() || pivot.upper() >= 0.0 {
                    return Recursion::Undecided;
                }
                eliminate(&mut gram, n, row);
            }
            let next = from_below(&gram.view((0, 0), (n, n)).into_owned());
            let settled = |(a, b): (&Ball<F>, &Ball<F>)| {
                (a.nearest() - b.nearest()).abs() <= SETTLED_CHANGE * b.nearest().abs()
            };
            if period >= n && p.iter().zip(&next).all(settled) {
                return Recursion::Standing;
            }
            p = next;
        }
        Recursion::Standing
    }
}

/// Eliminates `row` from the first `n` rows and from the rows after it, and likewise the columns.
fn eliminate<F: Number>(gram: &mut Matrix<F>, n: usize, row: usize) {
    let pivot = gram[(row, row)];
    let column: Vec<Ball<F>> = gram.column(row).iter().copied().collect();
    let quotients: Vec<Ball<F>> = column.iter().map(|&x| x / pivot).collect();
    let remains = |i: &usize| *i < n || *i > row;
    for i in (0..gram.nrows()).filter(remains) {
        for j in (0..=i).filter(remains) {
            gram[(i, j)] -= column[i] * quotients[j];
            gram[(j, i)] = gram[(i, j)];
        }
    }
}

/// An exact matrix that is at most every matrix of the enclosure, in the order of symmetric matrices
/// (Gershgorin).
fn from_below<F: Number>(m: &Matrix<F>) -> Matrix<F> {
    let radii = ball::row_radii(m);
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| {
        let mid = Ball::exactly(m[(i.max(j), i.min(j))].mid());
        // Twice the radii plus the rounding error of the difference.
        let shift = 2.0 * radii[i] + 4.0 * F::ROUNDING * mid.magnitude();
        if i == j && shift > 0.0 { Ball::exactly((mid - Ball::from(shift)).mid()) } else { mid }
    })
}
