//! The Nyquist zone of a tone.

use super::super::error::CalibrateError;
use super::super::measured::wrapped;
use super::super::model::Model;
use std::f64::consts::TAU;

/// A zone is clear if its phases are off by less than this share of those of the next one,
const CLEAR: f64 = 0.35;
/// and by less than this (radians, rms).
const CLOSE: f64 = 0.6;

/// A candidate and how far it is from the nominal phases.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    /// Cycles per slow sample.
    cycles: f64,
    /// Radians, rms.
    distance: f64,
}

/// The frequency, in cycles per slow sample, of a tone that appears at `alias` (0 to 1/2) with `phases`:
/// the zone below half the fast rate whose nominal phases agree. Odd zones (from 0) turn the phases round.
pub(super) fn resolve(
    model: &Model,
    alias: f64,
    phases: &[f64],
    reference: usize,
) -> Result<f64, CalibrateError> {
    let mut candidates: Vec<Candidate> =
        (0..model.ratio).map(|zone| candidate(model, alias, zone, phases, reference)).collect();
    candidates.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    match candidates[..] {
        [only] => Ok(only.cycles),
        [best, second, ..] if best.distance > CLEAR * second.distance || best.distance > CLOSE => {
            let rate = model.slow_rate();
            let (alias, best, other) = (rate * alias, rate * best.cycles, rate * second.cycles);
            Err(CalibrateError::AmbiguousZone { alias, best, other })
        }
        [best, ..] => Ok(best.cycles),
        [] => Ok(alias),
    }
}

fn candidate(model: &Model, alias: f64, zone: usize, phases: &[f64], reference: usize) -> Candidate {
    let is_turned = zone % 2 == 1;
    let cycles = if is_turned { zone.div_ceil(2) as f64 - alias } else { (zone / 2) as f64 + alias };
    let w = TAU * cycles / model.ratio as f64;
    let off = |i: usize| {
        let measured = phases[i] - phases[reference];
        let measured = if is_turned { -measured } else { measured };
        wrapped(measured - (model.nominal(i, w) / model.nominal(reference, w)).arg())
    };
    let squares: f64 = (0..model.channels()).map(|i| off(i).powi(2)).sum();
    Candidate { cycles, distance: (squares / (model.channels() - 1) as f64).sqrt() }
}
