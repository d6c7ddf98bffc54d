//! The values of all channels from the tones of all acquisitions, and what explains tones that disagree.

use super::Tones;
use super::ambiguity::{modulus, nearest_delay};
use super::phasors::TonePhasors;
use super::ratios::solve_ratios;
use crate::calibrate::CalibrationSettings;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::estimates::Fitted;
use crate::calibrate::fit::{ChannelParameter, FittedValues};
use crate::calibrate::model::ChannelModel;
use crate::calibrate::warning::CalibrationWarning;
use crate::spec::{Cutoff, Spec};
use crate::units::FastPeriods;

/// What makes the misfit this many times smaller explains it: an acquisition that is left out, or a cut-off
/// that is fitted.
const EXPLAINED_RATIO: f64 = 4.0;
/// Least acquisitions of which one contradicts the others: two that differ do not show which is wrong.
const OUTLYING_OF: usize = 3;
/// Tones of several acquisitions closer than this share of their frequency are one: they tell nothing of a
/// cut-off together.
const SAME_FREQUENCY: f64 = 1e-2;
/// Tones that a cut-off needs.
pub(super) const CUTOFF_TONES: usize = 3;
/// A delay farther from nominal than this share of its modulus is doubtful: the next value is three times
/// as far at most.
const DOUBTFUL_SHARE: f64 = 0.25;

/// Least squares over the tones of all acquisitions.
pub(super) fn solve(
    model: &ChannelModel,
    all: &[Tones],
    settings: CalibrationSettings,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<Fitted, CalibrateError> {
    let CalibrationSettings { fit, reference } = settings;
    let tones: Vec<&TonePhasors> = all.iter().flat_map(|tones| &tones.measured).collect();
    let frames = all.iter().map(|tones| tones.frames).sum();
    let solution = solve_ratios(model, &all.iter().collect::<Vec<_>>(), settings)?;
    let of_reference = solution.cutoff_sigma(reference);
    let mut fitted = Fitted::new(solution.point, solution.covariance, frames);
    fitted.modulus = modulus(&tones);
    for i in model.others(reference) {
        let delay = nearest_delay(&tones, i, model.ratio as f64);
        if let Some(modulus) = fitted.modulus.filter(|_| fit.delay)
            && delay.abs() > DOUBTFUL_SHARE * modulus.0
        {
            warnings.push(CalibrationWarning::DelayModulo { channel: i + 1, modulus });
        }
    }
    if fit.cutoff.is_some() && of_reference.is_none() {
        warnings.push(CalibrationWarning::CutoffsRelative { reference: reference + 1 });
    }
    if fit.delay && fit.cutoff.is_none() {
        warnings.push(CalibrationWarning::CutoffAssumed { delay: cutoff_effect(model, &tones, reference) });
    }
    let misfit = fitted.widen(solution.squares, solution.freedom);
    fitted.warnings.extend(misfit.map(|misfit| CalibrationWarning::TonesDisagree { misfit }));
    Ok(fitted)
}

/// The acquisitions without which the others agree: the one that explains most of the misfit of all, then
/// among the others as long as at least [`OUTLYING_OF`] are left.
pub(super) fn outlying(
    model: &ChannelModel,
    all: &[Tones],
    names: &[&str],
    settings: CalibrationSettings,
) -> Vec<CalibrationWarning> {
    // Tones that no longer determine the values tell nothing of their agreement.
    let misfit_of = |list: &[usize]| {
        let tones: Vec<&Tones> = list.iter().map(|&k| &all[k]).collect();
        solve_ratios(model, &tones, settings).ok()?.misfit()
    };
    let (mut left, mut warnings): (Vec<usize>, _) = ((0..all.len()).collect(), Vec::new());
    while left.len() >= OUTLYING_OF
        && let Some(misfit) = misfit_of(&left)
    {
        let without = |k: usize| left.iter().copied().filter(|&other| other != k).collect::<Vec<_>>();
        let best = left.iter().filter_map(|&k| Some((k, misfit_of(&without(k))?)));
        let best = best.min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, others)) = best.filter(|(_, others)| misfit > EXPLAINED_RATIO * others.max(1.0)) else {
            break;
        };
        warnings.push(CalibrationWarning::Outlying { name: names[k].to_owned(), misfit, others });
        left = without(k);
    }
    warnings
}

/// The part of the front ends whose cut-offs, if they were fitted too, would make the tones agree. The
/// intervals are widened so that they reach to the values of that fit.
pub(super) fn explained(
    model: &ChannelModel,
    spec: &Spec,
    all: &[Tones],
    settings: CalibrationSettings,
    fitted: &mut Fitted,
) -> Option<CalibrationWarning> {
    if distinct(all.iter().flat_map(|tones| &tones.measured)) < CUTOFF_TONES {
        return None;
    }
    let tones: Vec<&Tones> = all.iter().collect();
    let stages = spec.channels.iter().map(|channel| channel.filter.stages().len()).min().unwrap_or(0);
    let parts = (0..stages).filter(|_| stages > 1).map(Cutoff::Stage).chain([Cutoff::Whole]);
    // A part that cannot be fitted explains nothing.
    let candidate = |part: Cutoff| {
        let fit = FittedValues { cutoff: Some(part), ..settings.fit };
        let model = model.scaling(part, spec).ok()?;
        let solution = solve_ratios(&model, &tones, CalibrationSettings { fit, ..settings }).ok()?;
        Some((fit, solution.misfit()?, solution.point))
    };
    let all = parts.filter(|&part| settings.fit.cutoff != Some(part)).filter_map(candidate);
    let (fit, misfit, point) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    if fitted.misfit? < EXPLAINED_RATIO * misfit.max(1.0) {
        return None;
    }
    // Factors of different filters do not compare.
    let parameters = fitted.point.parameters.clone().into_iter();
    for parameter in parameters.filter(|parameter| parameter.kind != ChannelParameter::Cutoff) {
        fitted.reach(parameter, point.value(parameter) - fitted.point.value(parameter));
    }
    Some(CalibrationWarning::CutoffExplains { fit, misfit })
}

/// The largest change of a delay per per cent of cut-off: the mean of Im(s_it) / w_t over the tones.
fn cutoff_effect(model: &ChannelModel, tones: &[&TonePhasors], reference: usize) -> FastPeriods {
    let of = |i: usize| {
        let sum: f64 = tones.iter().map(|tone| model.cutoff_slope(i, tone.w, 0.0).im / tone.w).sum();
        0.01 * (sum / tones.len() as f64).abs()
    };
    FastPeriods(model.others(reference).map(of).fold(0.0, f64::max))
}

/// Number of different frequencies.
pub(super) fn distinct<'a>(tones: impl Iterator<Item = &'a TonePhasors>) -> usize {
    let mut all: Vec<f64> = tones.map(|tone| tone.frequency.0).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < SAME_FREQUENCY * b.abs());
    all.len()
}
