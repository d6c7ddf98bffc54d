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

/// Where the captures show a tone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alias {
    /// Cycles per slow sample: 0 to 1/2, of complex samples -1/2 to 1/2.
    pub(super) cycles: f64,
    pub(super) is_complex: bool,
}

impl Alias {
    /// The frequencies below half the fast rate with this alias, in cycles per slow sample, and whether the
    /// phases are turned round there: those of real samples are in odd zones (from 0).
    fn frequencies(self, ratio: usize) -> Vec<(f64, bool)> {
        let alias = self.cycles;
        if self.is_complex {
            let most = 0.5 * ratio as f64;
            let all = (-(ratio as i64)..=ratio as i64).map(|turns| turns as f64 + alias);
            return all.filter(|cycles| cycles.abs() < most).map(|cycles| (cycles, false)).collect();
        }
        let of_zone = |zone: usize| match zone % 2 {
            1 => (zone.div_ceil(2) as f64 - alias, true),
            _ => ((zone / 2) as f64 + alias, false),
        };
        (0..ratio).map(of_zone).collect()
    }
}

/// The frequency, in cycles per slow sample, of a tone that appears at `alias` with `phases`: the one below
/// half the fast rate whose nominal phases agree.
pub(super) fn resolve(
    model: &Model,
    alias: Alias,
    phases: &[f64],
    reference: usize,
) -> Result<f64, CalibrateError> {
    let all = alias.frequencies(model.ratio).into_iter();
    let mut candidates: Vec<Candidate> =
        all.map(|place| candidate(model, place, phases, reference)).collect();
    candidates.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    match candidates[..] {
        [only] => Ok(only.cycles),
        [best, second, ..] if best.distance > CLEAR * second.distance || best.distance > CLOSE => {
            let rate = model.slow_rate();
            let (alias, best, other) = (rate * alias.cycles, rate * best.cycles, rate * second.cycles);
            Err(CalibrateError::AmbiguousZone { alias, best, other })
        }
        [best, ..] => Ok(best.cycles),
        [] => Ok(alias.cycles),
    }
}

fn candidate(model: &Model, (cycles, is_turned): (f64, bool), phases: &[f64], reference: usize) -> Candidate {
    let w = TAU * cycles / model.ratio as f64;
    let off = |i: usize| {
        let measured = phases[i] - phases[reference];
        let measured = if is_turned { -measured } else { measured };
        wrapped(measured - (model.nominal(i, w) / model.nominal(reference, w)).arg())
    };
    let squares: f64 = (0..model.channels()).map(|i| off(i).powi(2)).sum();
    Candidate { cycles, distance: (squares / (model.channels() - 1) as f64).sqrt() }
}
