//! What the phases of tones leave open: the Nyquist zone of a tone, and whole periods of a delay.

use super::phasors::TonePhasors;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::model::ChannelModel;
use crate::sine_fit::wrapped;
use crate::units::FastPeriods;
use std::f64::consts::TAU;

/// A zone is clear if its phases are off by less than this share of those of the next one,
const CLEAR_SHARE: f64 = 0.35;
/// and by less than this (radians, rms).
const CLEAR_PHASE: f64 = 0.6;
/// Most periods of the highest tone that are searched.
const MOST_PERIODS: usize = 1000;
/// Phases that differ by less than this (radians) count as the same: more than errors of front ends change
/// them.
const SAME_PHASE: f64 = 0.1;
/// A delay farther from nominal must agree with the phases by this much more (radians, rms) than a nearer
/// one.
const CLEARLY_BETTER: f64 = 0.05;

/// Where the captures show a tone.
#[derive(Debug, Clone, Copy)]
pub(super) struct ObservedTone {
    /// Cycles per slow sample: 0 to 1/2, of complex samples -1/2 to 1/2.
    pub(super) cycles: f64,
    pub(super) is_complex: bool,
}

/// A frequency that a tone may have.
#[derive(Debug, Clone, Copy)]
struct AliasCandidate {
    /// Cycles per slow sample.
    cycles: f64,
    /// Whether the captures show the conjugate: real samples do in odd zones (from 0).
    is_conjugate: bool,
}

impl ObservedTone {
    /// The frequencies with this alias in a Nyquist zone (from 0) of the fast rate.
    fn candidates(self, ratio: usize, fast_zone: usize) -> Vec<AliasCandidate> {
        let (alias, zones) = (self.cycles, ratio * fast_zone..ratio * (fast_zone + 1));
        if self.is_complex {
            let (least, most) = (0.5 * zones.start as f64, 0.5 * zones.end as f64);
            let wholes = -(zones.end as i64)..=zones.end as i64;
            let inside =
                wholes.map(|whole| whole as f64 + alias).filter(|x| (least..most).contains(&x.abs()));
            return inside.map(|cycles| AliasCandidate { cycles, is_conjugate: false }).collect();
        }
        let of_zone = |zone: usize| match zone % 2 {
            1 => AliasCandidate { cycles: zone.div_ceil(2) as f64 - alias, is_conjugate: true },
            _ => AliasCandidate { cycles: (zone / 2) as f64 + alias, is_conjugate: false },
        };
        zones.map(of_zone).collect()
    }
}

impl AliasCandidate {
    /// How far measured phases are from the nominal ones (radians, rms).
    fn distance(self, model: &ChannelModel, phases: &[f64], reference: usize) -> f64 {
        let w = TAU * self.cycles / model.ratio as f64;
        let off = |i: usize| {
            let measured = phases[i] - phases[reference];
            let measured = if self.is_conjugate { -measured } else { measured };
            wrapped(measured - (model.nominal(i, w) / model.nominal(reference, w)).arg())
        };
        let squares: f64 = (0..model.channels()).map(|i| off(i).powi(2)).sum();
        (squares / (model.channels() - 1) as f64).sqrt()
    }
}

/// The frequency, in cycles per slow sample, of a tone that appears at `alias` with `phases`: the one in the
/// signal's zone of the fast rate whose nominal phases agree.
pub(super) fn zone_of(
    model: &ChannelModel,
    alias: ObservedTone,
    phases: &[f64],
    reference: usize,
) -> Result<f64, CalibrateError> {
    let all = alias.candidates(model.ratio, model.fast_zone()).into_iter();
    let mut all: Vec<(f64, f64)> =
        all.map(|candidate| (candidate.distance(model, phases, reference), candidate.cycles)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    match all[..] {
        [best, second, ..] if best.0 > CLEAR_SHARE * second.0 || best.0 > CLEAR_PHASE => {
            let [alias, best, other] = [alias.cycles, best.1, second.1].map(|x| model.slow_rate() * x);
            let ends = [model.fast_zone(), model.fast_zone() + 1];
            let zone = ends.map(|end| model.slow_rate() * (0.5 * (model.ratio * end) as f64));
            Err(CalibrateError::AmbiguousZone { alias, best, other, zone })
        }
        [best, ..] => Ok(best.1),
        [] => Ok(alias.cycles),
    }
}

/// The tone of the highest frequency.
fn highest<'a>(tones: &[&'a TonePhasors]) -> Option<&'a TonePhasors> {
    tones.iter().copied().max_by(|a, b| a.w.total_cmp(&b.w))
}

/// The least change of a delay that leaves all phases as they are.
pub(super) fn modulus(tones: &[&TonePhasors]) -> Option<FastPeriods> {
    let period = TAU / highest(tones)?.w;
    let agrees = |shift: &f64| tones.iter().all(|tone| wrapped(tone.w * shift).abs() < SAME_PHASE);
    (1..=MOST_PERIODS).map(|m| m as f64 * period).find(agrees).map(FastPeriods)
}

/// The deviation of the delay of channel `i` from nominal, roughly: among those within `reach` fast periods
/// the one nearest to 0 that agrees with the phases of all tones about as well as the best.
pub(super) fn nearest_delay(tones: &[&TonePhasors], i: usize, reach: f64) -> f64 {
    let Some(top) = highest(tones) else { return 0.0 };
    let (first, period) = (-top.ratios[i].arg() / top.w, TAU / top.w);
    let most = if tones.len() == 1 { 0 } else { ((reach / period) as i64).min(MOST_PERIODS as i64) };
    let misfit = |delay: f64| {
        let squares = tones.iter().map(|tone| wrapped(tone.ratios[i].arg() + tone.w * delay).powi(2));
        (squares.sum::<f64>() / tones.len() as f64).sqrt()
    };
    let delays = (-most..=most).map(|m| first + m as f64 * period);
    let candidates: Vec<(f64, f64)> = delays.map(|delay| (delay, misfit(delay))).collect();
    let best = candidates.iter().map(|candidate| candidate.1).fold(f64::INFINITY, f64::min);
    let good = candidates.into_iter().filter(|candidate| candidate.1 <= best + CLEARLY_BETTER);
    good.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).map_or(first, |candidate| candidate.0)
}
