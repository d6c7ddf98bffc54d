//! The norm of a bank by brute force, without a state of any front end.
//!
//! Time in fast periods, z = e^{j omega} per slow period. An input e^{j nu t} with nu = (omega + 2 pi k) / M
//! gives the error samples v_k\[p\] = Phi_0(j nu) e^{j nu (p - m0)} - sum_i F_{p,i}(z) Phi_i(j nu) e^{-j nu
//! D_i}, and so K K* = (1 / M) sum_k v_k v_k*. The sum converges as the front ends fall.

use hybank::bank::{Bank, SynthesisFilters};
use hybank::spec::FilterSpec;
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::{PI, TAU};

/// Aliases on each side; the front ends here fall by 12 dB per octave or more.
const ALIASES: i32 = 150;
/// Points on half the unit circle, next to those close to 0.
const GRID: usize = 150;

/// The greatest gain at any frequency tried, a lower bound of ||K|| up to rounding.
pub(crate) fn norm(bank: &Bank) -> f64 {
    let gain = |omega: f64| gain(bank, omega);
    let grid = (0..=GRID).map(|k| PI * k as f64 / GRID as f64);
    let low = (1..60).map(|k| PI * 0.7f64.powi(k));
    let mut tried: Vec<(f64, f64)> =
        grid.chain(low).chain(proven_peak(bank)).map(|omega| (gain(omega), omega)).collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let width = PI / GRID as f64;
    tried
        .iter()
        .take(4)
        .map(|&(_, omega)| peak(gain, omega - width, omega + width))
        .fold(tried[0].0, f64::max)
}

/// The frequency at which the bank's file says that its gain is greatest, so that no narrow peak is missed.
fn proven_peak(bank: &Bank) -> Option<f64> {
    let [c, s] = bank.proof.as_ref()?.upper.peak.half;
    Some(2.0 * s.atan2(c)).filter(|omega| omega.is_finite())
}

/// Golden section search for the greatest value between a and b.
fn peak(value: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let mut best = 0.0f64;
    for _ in 0..20 {
        let (left, right) = (b - ratio * (b - a), a + ratio * (b - a));
        let (at_left, at_right) = (value(left), value(right));
        best = best.max(at_left).max(at_right);
        if at_left > at_right { b = right } else { a = left }
    }
    best
}

/// sqrt of the greatest eigenvalue of K K* at z = e^{j omega}.
fn gain(bank: &Bank, omega: f64) -> f64 {
    let spec = bank.spec.as_ref().unwrap();
    let (m, h) = (bank.ratio, bank.fast_period.0);
    let filters = synthesis(bank, omega);
    let delays: Vec<f64> = spec.channels.iter().map(|channel| channel.delay.0 / h).collect();
    let mut square = DMatrix::<Complex<f64>>::zeros(m, m);
    let mut error = DVector::<Complex<f64>>::zeros(m);
    for k in -ALIASES..=ALIASES {
        let nu = (omega + TAU * f64::from(k)) / m as f64;
        let target = response(&spec.target, nu / h);
        for (p, error) in error.iter_mut().enumerate() {
            *error = target * Complex::from_polar(1.0, nu * (p as f64 - bank.latency as f64));
        }
        for (i, channel) in spec.channels.iter().enumerate() {
            let measured = response(&channel.filter, nu / h) * Complex::from_polar(1.0, -nu * delays[i]);
            error.iter_mut().enumerate().for_each(|(p, error)| *error -= filters[(p, i)] * measured);
        }
        square.gerc(Complex::from(1.0 / m as f64), &error, &error, Complex::from(1.0));
    }
    if square.iter().any(|x| !(x.re.is_finite() && x.im.is_finite())) {
        return f64::INFINITY;
    }
    square.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// F_{p,i}(e^{j omega}), M x N.
fn synthesis(bank: &Bank, omega: f64) -> DMatrix<Complex<f64>> {
    let (m, n) = (bank.ratio, bank.channel_count());
    let z = Complex::from_polar(1.0, omega);
    let real = |rows: &[Vec<f64>], height: usize, width: usize| {
        DMatrix::from_fn(height, width, |i, j| Complex::from(rows[i][j]))
    };
    match &bank.filters {
        SynthesisFilters::Fir(taps) => DMatrix::from_fn(m, n, |p, i| {
            let lags = taps[i].iter().skip(p).step_by(m).enumerate();
            lags.map(|(j, &tap)| tap * z.powi(-(j as i32))).sum()
        }),
        SynthesisFilters::StateSpace(block) => {
            let order = block.a.len();
            let (a, b) = (real(&block.a, order, order), real(&block.b, order, n));
            let (c, d) = (real(&block.c, m, order), real(&block.d, m, n));
            let resolvent = DMatrix::identity(order, order) * z - a;
            let states = resolvent.lu().solve(&b).unwrap_or_else(|| b.map(|_| Complex::from(f64::INFINITY)));
            c * states + d
        }
    }
}

/// Phi(j omega), rad/s.
fn response(filter: &FilterSpec, omega: f64) -> Complex<f64> {
    let s = Complex::new(0.0, omega);
    let FilterSpec::TransferFunction { num, den } = filter else { panic!("only transfer functions") };
    let value = |c: &[f64]| c.iter().fold(Complex::from(0.0), |sum: Complex<f64>, &x| sum * s + x);
    value(num) / value(den)
}

/// The digits are those of the thesis, which computed them by a general solver.
#[test]
fn the_oracle_agrees_with_digits_of_another_program() {
    use crate::support::specs::{thesis, with_taps};
    // The thesis example with 22 taps and latency 10: gamma 0.0399320 (thesis, table of chapter 5).
    let bank =
        hybank::design::design(&with_taps(thesis(10, &[1.2, 0.6]), 22), &hybank::design::Options::default())
            .unwrap()
            .bank;
    assert!((norm(&bank) - 0.0399320).abs() < 1e-6, "{}", norm(&bank));
}
