//! Samples between samples: a sinc under a Kaiser window.

use std::f64::consts::PI;

/// Samples on each side of an instant.
pub(super) const REACH: usize = 128;
/// Shape of the Kaiser window: -118 dB outside a transition that begins at 0.485 fs.
const BETA: f64 = 12.265;
/// Step of the derivative by the delay, in samples.
const STEP: f64 = 1e-4;

/// Coefficients c_j, j = -REACH ..= REACH, of x(n - phase) = sum over j of x[n - j] c_j, stored for
/// increasing sample index; and their derivative by the phase. A phase of 0 gives the samples themselves.
pub(super) struct Interpolator {
    pub(super) values: Vec<f64>,
    pub(super) slopes: Vec<f64>,
}

impl Interpolator {
    /// For a delay of `phase` samples, -1 < phase < 1.
    pub(super) fn new(phase: f64) -> Self {
        let (before, after) = (kernel(phase - STEP), kernel(phase + STEP));
        let slopes = before.iter().zip(&after).map(|(a, b)| (b - a) / (2.0 * STEP)).collect();
        Self { values: kernel(phase), slopes }
    }
}

/// sinc(t) kaiser(t) at t = j - phase, scaled to keep constants; j falls along the vector.
fn kernel(phase: f64) -> Vec<f64> {
    let reach = REACH as f64;
    let at = |i: usize| {
        let t = reach - i as f64 - phase;
        let share = 1.0 - (t / (reach + 1.0)).powi(2);
        if share <= 0.0 { 0.0 } else { sinc(t) * bessel_i0(BETA * share.sqrt()) }
    };
    let values: Vec<f64> = (0..=2 * REACH).map(at).collect();
    let sum: f64 = values.iter().sum();
    values.iter().map(|x| x / sum).collect()
}

fn sinc(t: f64) -> f64 {
    // Exact zeros at the other samples, where sin(pi t) rounds to something.
    if t == 0.0 {
        1.0
    } else if t.fract() == 0.0 {
        0.0
    } else {
        (PI * t).sin() / (PI * t)
    }
}

/// The modified Bessel function I_0 by its power series; BETA is small.
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let mut term = 1.0;
    let mut sum = 1.0;
    for k in 1..=60 {
        term *= quarter / (k * k) as f64;
        sum += term;
    }
    sum
}
