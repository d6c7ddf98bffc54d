//! What any bank can reach: at any latency by one matrix per frequency, and causally by finitely many
//! samples.

use super::judge::{Peak, largest, on_circle, peaks};
use super::plant::{Plant, Row};
use super::real::{Complex, Real, double, real, sqrt};
use nalgebra::{Complex as C64, DMatrix};

/// The lower triangle L of a Hermitian matrix L L*, row by row; `None` if it is not positive definite.
pub(crate) fn cholesky(matrix: &[Vec<Complex>]) -> Option<Vec<Vec<Complex>>> {
    let mut lower: Vec<Vec<Complex>> = Vec::new();
    for (i, row) in matrix.iter().enumerate() {
        let mut next: Vec<Complex> = Vec::new();
        for j in 0..i {
            let rest = (0..j).fold(row[j].clone(), |sum, k| &sum - &(&next[k] * &lower[j][k].conj()));
            next.push(rest.times(&(real(1.0) / &lower[j][j].re)));
        }
        let pivot = next.iter().fold(row[i].re.clone(), |sum, x| sum - x.square_size());
        if pivot <= real(0.0) {
            return None;
        }
        next.push(Complex::real(sqrt(&pivot)));
        lower.push(next);
    }
    Some(lower)
}

/// The least gain of any bank at one frequency: S_ww - S_wh S_hh^-1 S_hw with the channels first, so that
/// the Cholesky factor's last block is a root of it.
fn noncausal_gain(plant: &Plant, omega: f64) -> f64 {
    let gram = plant.gram(&on_circle(omega));
    let (m, n) = (plant.ratio, plant.channels);
    let order: Vec<usize> = (m..m + n).chain(0..m).collect();
    let hh: Vec<Vec<Complex>> =
        order[..n].iter().map(|&a| order[..n].iter().map(|&b| gram[a][b].clone()).collect()).collect();
    let lower = cholesky(&hh).expect("channels that differ");
    // Rows of S_wh L^-*.
    let row = |p: usize| {
        let mut x: Vec<Complex> = Vec::new();
        for j in 0..n {
            let rest = (0..j).fold(gram[p][m + j].clone(), |sum, k| &sum - &(&x[k] * &lower[j][k].conj()));
            x.push(rest.times(&(real(1.0) / &lower[j][j].re)));
        }
        x
    };
    let rows: Vec<Vec<Complex>> = (0..m).map(row).collect();
    let entry = |p: usize, q: usize| {
        let pairs = rows[p].iter().zip(&rows[q]);
        pairs.fold(gram[p][q].clone(), |sum, (x, y)| &sum - &(x * &y.conj())).rounded()
    };
    largest(DMatrix::from_fn(m, m, entry))
}

/// The largest of these over all frequencies: no bank has a smaller norm.
pub(crate) fn noncausal(plant: &Plant) -> Peak {
    peaks(&|omega| noncausal_gain(plant, omega), &plant.resonances(), &[])[0]
}

/// A sample of a row: e^{p t} for the poles of its front end, and for each front end the factors that e^{p
/// t} of a later sample takes.
struct Sample<'a> {
    row: &'a Row,
    time: Real,
    growth: Vec<Complex>,
    factors: Vec<Vec<Complex>>,
}

impl<'a> Sample<'a> {
    fn new(plant: &'a Plant, row: &'a Row, period: i64) -> Self {
        let time = &row.time + real(plant.ratio as f64 * period as f64);
        let own = &plant.modes[row.front];
        let growth = own.exponentials(&time);
        // For an input from time 0 on: the stationary r e^{-p t} less residue(p) sum_q residue(q) e^{q t} /
        // -(p + q).
        let factors = plant.modes.iter().map(|later| {
            let back = later.exponentials(&-&time);
            let strengths = later.strengths(own);
            let of = |k: usize| {
                let pole = &later.front.poles[k];
                let before = (0..growth.len()).fold(Complex::zero(), |sum, j| {
                    let term = &own.residues[j] * &growth[j];
                    &sum + &term.over(&-&(pole + &own.front.poles[j]))
                });
                &(&strengths[k] * &back[k]) - &(&later.residues[k] * &before)
            };
            (0..back.len()).map(of).collect()
        });
        Self { row, factors: factors.collect(), growth, time }
    }

    /// The correlation of two samples of white noise that begins at time 0.
    fn with(&self, other: &Self) -> Complex {
        let (late, early) = if self.time >= other.time { (self, other) } else { (other, self) };
        let pairs = late.growth.iter().zip(&early.factors[late.row.front]);
        let sum = pairs.fold(real(0.0), |sum, (x, y)| sum + (x * y).re);
        Complex::real(sum * &late.row.gain * &early.row.gain)
    }
}

/// A gamma below which no causal bank lies: the largest ||e|| of an input of unit energy from time 0 on that
/// leaves the samples of `periods` slow periods zero. By Parrott's theorem the least norm over causal banks
/// is the supremum of these over the number of periods.
pub(crate) fn causal(plant: &Plant, periods: i64) -> f64 {
    let zero = real(0.0);
    let samples = |rows: &'_ [Row]| -> Vec<(usize, i64)> {
        let all = (0..rows.len()).flat_map(|a| (0..periods).map(move |k| (a, k)));
        all.filter(|(a, k)| &rows[*a].time + real(plant.ratio as f64 * *k as f64) > zero).collect()
    };
    let (targets, channels) = plant.rows.split_at(plant.ratio);
    let made = |rows: &[Row], offset: usize| -> Vec<Sample<'_>> {
        samples(rows).iter().map(|(a, k)| Sample::new(plant, &plant.rows[offset + a], *k)).collect()
    };
    let (targets, channels) = (made(targets, 0), made(channels, plant.ratio));
    let row = |a: &Sample<'_>, list: &[Sample<'_>]| list.iter().map(|b| a.with(b)).collect::<Vec<_>>();
    let hh: Vec<Vec<Complex>> = channels.iter().enumerate().map(|(k, a)| row(a, &channels[..=k])).collect();
    let Some(lower) = cholesky(&hh) else { return 0.0 };
    let projected: Vec<Vec<Real>> = targets
        .iter()
        .map(|a| {
            let known = row(a, &channels);
            let mut x: Vec<Real> = Vec::new();
            for (j, known) in known.into_iter().enumerate() {
                let rest = (0..j).fold(known.re, |sum, k| sum - &x[k] * &lower[j][k].re);
                x.push(rest / &lower[j][j].re);
            }
            x
        })
        .collect();
    let entry = |p: usize, q: usize| {
        let pairs = projected[p].iter().zip(&projected[q]);
        let whole = targets[p].with(&targets[q]).re;
        C64::new(double(&pairs.fold(whole, |sum, (x, y)| sum - x * y)), 0.0)
    };
    let n = targets.len();
    let lower_half = DMatrix::from_fn(n, n, |p, q| if p >= q { entry(p, q) } else { C64::default() });
    let square = DMatrix::from_fn(n, n, |p, q| lower_half[(p.max(q), p.min(q))]);
    largest(square)
}
