//! How long the analog side and the filters remember: with their responses cut off after some periods the
//! error system is a polynomial in z^-1, and its distance from the true one is bounded.
//!
//! A sample is a convolution of the input with a kernel phi. The part of the kernel beyond T contributes at
//! most sum_k q_k over the slow periods k beyond T, with q_k^2 = int_{kM}^inf phi^2: each period of the
//! kernel maps one period of the input to one sample, and different samples read different periods. The
//! bound does not depend on the instant of the sample within its period.

use super::super::ball::{self, Ball, Matrix};
use super::super::error_system::BlockForm;
use super::angle::outward;
use crate::bank::SynthesisFilters;

/// Maximum number of slow periods that are followed.
const MAX_PERIODS: usize = 20_000;
/// Relative size of the energy at which the explicit sum ends.
const NEGLIGIBLE_ENERGY: f64 = 1e-22;

/// A bound of sum_{j >= 0} ||E^j|| in row sums; `None` if the powers do not fall below 1/2 in time.
///
/// Balls would grow like the powers of |E|, which need not fall. So the powers are followed as exact
/// numbers M_j: M_{j+1} = M_j E - D_j with the rounding errors D_j, whence E^j = M_j + sum_{i < j} D_i
/// E^{j-1-i}. With
/// ||D_i|| <= d the sum S of the first J norms is at most sum ||M_j|| + J d S.
pub(super) fn growth(transition: &Matrix) -> Option<f64> {
    let (mut power, mut sum, mut rounding) = (ball::identity(transition.nrows()), 0.0, 0.0);
    for periods in 1..=MAX_PERIODS {
        let size = if power.nrows() == 0 { 0.0 } else { ball::row_sum(&power) };
        let share = outward(periods as f64 * rounding);
        let total = outward(sum / (1.0 - share));
        let last = outward(size + rounding * total);
        if share < 0.5 && last < 0.5 {
            // The powers from here on: at most `last` times the whole.
            return Some(outward(total / (1.0 - last)));
        }
        sum += size;
        let next = ball::product(&power, transition);
        rounding = ball::nan_max(rounding, ball::radius_sum(&next));
        power = midpoint(&next);
    }
    None
}

fn midpoint(m: &Matrix) -> Matrix {
    m.map(|x| Ball::exactly(x.mid()))
}

/// [`growth`] in column sums.
fn growth_of_transposed(transition: &Matrix) -> Option<f64> {
    growth(&transition.transpose())
}

/// A row v E^k for k = 0, 1, ..: an exact row, and a bound of the sum of the moduli of what it lacks. That
/// is the sum of the rounding errors d_i E^{k-1-i}, so at most the largest of them times the growth.
struct MovingRow<'a> {
    row: Matrix,
    transition: &'a Matrix,
    growth: f64,
    rounding: f64,
}

impl<'a> MovingRow<'a> {
    fn new(row: &Matrix, transition: &'a Matrix, growth: f64) -> Self {
        Self { rounding: ball::radius_sum(row), row: midpoint(row), transition, growth }
    }

    /// What the row lacks.
    fn missing(&self) -> f64 {
        outward(self.rounding * self.growth)
    }

    /// The row in balls.
    fn enclosed(&self) -> Matrix {
        let missing = self.missing();
        self.row.map(|x| x.widened(missing))
    }

    /// A bound of the sum of its moduli.
    fn size(&self) -> f64 {
        outward(self.row.iter().fold(0.0, |sum, x| sum + x.magnitude()) + self.missing())
    }

    fn advance(&mut self) {
        let next = ball::product(&self.row, self.transition);
        self.rounding = ball::nan_max(self.rounding, ball::radius_sum(&next));
        self.row = midpoint(&next);
    }
}

/// The sums of all terms from each one on, and of `rest` beyond them.
fn sums_from(terms: &[f64], rest: f64) -> Vec<f64> {
    let mut sums = vec![rest; terms.len() + 1];
    for (k, term) in terms.iter().enumerate().rev() {
        sums[k] = outward(sums[k + 1] + term);
    }
    sums
}

/// The tails of a kernel.
#[derive(Debug, Clone)]
pub(super) struct Memory {
    /// By the number of periods: the sum of q_k from there on.
    tails: Vec<f64>,
    /// q_0.
    energy: f64,
}

impl Memory {
    /// Of the kernel read by `row` from states with the given `transition` over a slow period, stationary
    /// `covariance` and `growth` (see [`growth`]).
    pub(super) fn new(row: &Matrix, transition: &Matrix, covariance: &Matrix, growth: f64) -> Self {
        let mut moving = MovingRow::new(row, transition, growth);
        let mut energies: Vec<f64> = Vec::new();
        while energies.len() < MAX_PERIODS {
            let row = moving.enclosed();
            let square = ball::product_transposed(&ball::product(&row, covariance), &row)[(0, 0)];
            energies.push(outward(square.magnitude().sqrt()));
            moving.advance();
            if energies[energies.len() - 1] <= NEGLIGIBLE_ENERGY * energies[0] {
                break;
            }
        }
        // sqrt(v X v') <= |v|_1 sqrt(||X||), and |v E^j|_1 <= |v|_1 ||E^j||.
        let rest = outward(moving.size() * ball::row_sum(covariance).sqrt() * growth);
        Self { tails: sums_from(&energies, rest), energy: energies[0] }
    }

    /// Bounds the norm of the part of the kernel from `periods` slow periods on.
    pub(super) fn tail(&self, periods: usize) -> f64 {
        self.tails[periods.min(self.tails.len() - 1)]
    }

    /// The fewest slow periods, up to `most`, after which the tail is at most `wanted`; `most` if there are
    /// none.
    pub(super) fn periods(&self, wanted: f64, most: usize) -> usize {
        self.tails.partition_point(|tail| *tail > wanted).min(most)
    }

    /// Bounds the norm of the whole sampled filter.
    pub(super) fn whole(&self) -> f64 {
        // The part of the period in which the sample is taken has at most the energy of the whole kernel.
        outward(self.tail(0) + self.energy)
    }
}

/// Bounds of the synthesis filters F = sum_k F_k z^-k, whose lags may be cut off from any number on.
#[derive(Debug, Clone)]
pub(super) struct Lags {
    /// For each channel, by the number of lags that are kept: bounds the norm of the column of all others.
    beyond: Vec<Vec<f64>>,
}

impl Lags {
    /// FIR filters whole; of recursive ones, the lags up to a remainder of `negligible` relative to the
    /// whole. `None` if that takes too many.
    pub(super) fn new(filters: &SynthesisFilters, ratio: usize, negligible: f64) -> Option<Self> {
        let SynthesisFilters::Fir(taps) = filters else {
            return Self::recursive(&BlockForm::new(filters, ratio).balanced(), negligible);
        };
        let lag = |list: &[f64]| outward(list.iter().map(|x| x.abs()).sum());
        let lags = |list: &Vec<f64>| sums_from(&list.chunks(ratio).map(lag).collect::<Vec<_>>(), 0.0);
        Some(Self { beyond: taps.iter().map(lags).collect() })
    }

    /// Number of lags that are known one by one.
    pub(super) fn count(&self) -> usize {
        self.beyond.iter().map(|list| list.len() - 1).max().unwrap_or(0)
    }

    /// Bounds the norm of the column of channel `i` without its first `kept` lags.
    pub(super) fn beyond(&self, i: usize, kept: usize) -> f64 {
        self.beyond[i][kept.min(self.beyond[i].len() - 1)]
    }

    /// F = d + sum_k c a^k b z^-(k+1).
    fn recursive(form: &BlockForm, negligible: f64) -> Option<Self> {
        let growth = growth(&form.a)?;
        let columns = |m: &Matrix| -> Vec<f64> {
            m.column_iter().map(|column| column.iter().fold(0.0, |sum, x| sum + x.magnitude())).collect()
        };
        let output = ball::row_sum(&form.c) * form.c.nrows() as f64;
        // a^k b as an exact matrix; each column lacks at most the largest rounding error of a step times the
        // growth of the transposed powers.
        let growth_of_columns = outward(growth_of_transposed(&form.a)?);
        let mut rounding = ball::radius_sum(&form.b.transpose());
        let mut moved = midpoint(&form.b);
        let mut lags: Vec<Vec<f64>> = columns(&form.d).into_iter().map(|lag| vec![lag]).collect();
        let mut sizes = columns(&form.d);
        for _ in 0..MAX_PERIODS {
            let missing = outward(rounding * growth_of_columns);
            let rests: Vec<f64> =
                columns(&moved).iter().map(|x| outward((x + missing) * output * growth)).collect();
            let small =
                rests.iter().zip(&sizes).all(|(rest, size)| *rest <= negligible * size.max(negligible));
            // Below the rounding errors the remainder stays as it is.
            if small || columns(&moved).iter().all(|x| *x < missing) {
                let beyond = lags.iter().zip(&rests).map(|(lags, &rest)| sums_from(lags, rest));
                return Some(Self { beyond: beyond.collect() });
            }
            for (i, lag) in columns(&ball::product(&form.c, &moved)).into_iter().enumerate() {
                let lag = outward(lag + output * missing);
                lags[i].push(lag);
                sizes[i] += lag;
            }
            let next = ball::product(&form.a, &moved);
            rounding = ball::nan_max(rounding, ball::radius_sum(&next.transpose()));
            moved = midpoint(&next);
        }
        None
    }
}
