//! Which of the delays with the same phases.

use super::super::measured::{Measured, Modulus, wrapped};
use crate::units::FastPeriods;
use std::f64::consts::TAU;

/// Most periods of the highest tone that are searched.
const MOST_PERIODS: usize = 1000;
/// Phases that differ by less than this (radians) count as the same: more than front ends bend them.
const SAME_PHASE: f64 = 0.1;
/// A delay farther from nominal must agree with the phases by this much more (radians, rms) than a nearer
/// one.
const CLEARLY_BETTER: f64 = 0.05;

fn highest(tones: &[Measured]) -> f64 {
    tones.iter().map(|tone| tone.w).fold(0.0, f64::max)
}

/// The least change of a delay that leaves all phases as they are.
pub(super) fn modulus(tones: &[Measured]) -> Modulus {
    let period = TAU / highest(tones);
    let agrees = |shift: f64| tones.iter().all(|tone| wrapped(tone.w * shift).abs() < SAME_PHASE);
    let shifts = (1..=MOST_PERIODS).map(|m| m as f64 * period);
    Modulus(shifts.into_iter().find(|&shift| agrees(shift)).map(FastPeriods))
}

/// The deviation of the delay of channel `i` from nominal, roughly: among those within `reach` fast periods
/// the one nearest to 0 that agrees with the phases of all tones about as well as the best.
pub(super) fn nearest(tones: &[Measured], i: usize, reach: f64) -> f64 {
    let w = highest(tones);
    let Some(top) = tones.iter().find(|tone| tone.w == w) else { return 0.0 };
    let first = -top.ratios[i].arg() / w;
    let period = TAU / w;
    let most = if tones.len() == 1 { 0 } else { ((reach / period) as i64).min(MOST_PERIODS as i64) };
    let misfit = |delay: f64| {
        let squares = tones.iter().map(|tone| wrapped(tone.ratios[i].arg() + tone.w * delay).powi(2));
        (squares.sum::<f64>() / tones.len() as f64).sqrt()
    };
    let candidates: Vec<(f64, f64)> =
        (-most..=most).map(|m| first + m as f64 * period).map(|delay| (delay, misfit(delay))).collect();
    let best = candidates.iter().map(|candidate| candidate.1).fold(f64::INFINITY, f64::min);
    let good = candidates.into_iter().filter(|candidate| candidate.1 <= best + CLEARLY_BETTER);
    good.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).map_or(first, |candidate| candidate.0)
}
