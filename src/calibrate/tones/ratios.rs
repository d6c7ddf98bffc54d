//! The values of all channels from the ratios of their tones to those of the reference.
//!
//! The noise of the reference is in the ratios of all other channels. Its own cut-off, where that is fitted
//! too, shows in all of them as well, so the equations of a tone are whitened together.

use super::Tones;
use super::ambiguity::nearest_delay;
use super::phasors::TonePhasors;
use crate::calibrate::CalibrationSettings;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::estimates::{WORST_CONDITION, contradiction};
use crate::calibrate::fit::{ChannelParameter, FittedValues};
use crate::calibrate::model::{ChannelModel, ChannelValues, Parameter};
use crate::linalg::least_squares::{LeastSquares, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::{Complex, Mat};

/// A cut-off that is known to less than this share of itself is not known.
const LARGEST_CUTOFF_ERROR: f64 = 0.1;
/// The tones tell the cut-off of the reference if they leave a smaller standard deviation of its logarithm;
/// and if they contradict each other without it only.
const TOLD_CUTOFF: f64 = 1e-3;
/// The iteration ends when all steps are below this share of the standard deviation ..
const SMALL_STEP: f64 = 1e-6;
/// .. or below this: the rounding of responses and phases.
const RESPONSE_ROUNDING: f64 = 1e-12;
/// Least share of the variance of a ratio that is not that of the reference.
const LEAST_OWN_SHARE: f64 = 1e-3;

/// One tone in all channels but the reference.
struct ToneEquations<'a> {
    /// Rad per fast period.
    w: f64,
    /// ln of the ratios, their phases without whole cycles of the nearest delays.
    ln_ratios: Vec<Complex<f64>>,
    tone: &'a TonePhasors,
    /// The variance of the mean instant of each channel, fast periods squared.
    jitter: &'a [f64],
}

/// The magnitudes or the phases of one tone as equations with unit noise.
struct WhiteEquations<'a> {
    /// One row per channel but the reference; the residuals are the last column.
    rows: Mat,
    /// What made the noise white.
    whitening: Mat,
    are_phases: bool,
    of: &'a ToneEquations<'a>,
}

/// The equations of all tones at the present values.
pub(super) struct RatioFit<'a> {
    model: &'a ChannelModel,
    settings: CalibrationSettings,
    others: Vec<usize>,
    point: ChannelValues,
    /// The standard deviation of the logarithm of the reference's cut-off, if it is known from elsewhere.
    stated: Option<f64>,
    tones: Vec<ToneEquations<'a>>,
    is_complex: bool,
}

/// The values, and how well the tones agree with them.
pub(super) struct RatioSolution {
    pub(super) point: ChannelValues,
    pub(super) covariance: Mat,
    /// Chi squared, and its degrees of freedom.
    pub(super) squares: f64,
    pub(super) freedom: usize,
}

impl RatioSolution {
    /// Square root of chi squared per degree of freedom, if there are any.
    pub(super) fn misfit(&self) -> Option<f64> {
        (self.freedom > 0).then(|| (self.squares / self.freedom as f64).sqrt())
    }

    /// The standard deviation of ln c of a channel, if it was fitted.
    pub(super) fn cutoff_sigma(&self, channel: usize) -> Option<f64> {
        let k = self.point.index(channel, ChannelParameter::Cutoff)?;
        Some(self.covariance[(k, k)].sqrt())
    }
}

/// Least squares over the tones of some acquisitions. The cut-off of the reference is fitted with those of
/// the others where the tones tell it, or where the spec says how uncertain it is.
pub(super) fn solve_ratios(
    model: &ChannelModel,
    all: &[&Tones],
    settings: CalibrationSettings,
) -> Result<RatioSolution, CalibrateError> {
    let relative = RatioFit::new(model, all, settings).solve()?;
    for i in model.others(settings.reference) {
        let sigma = relative.cutoff_sigma(i).unwrap_or(0.0);
        if sigma > LARGEST_CUTOFF_ERROR || relative.point.ln_cutoffs[i].abs() > 1.0 {
            return Err(CalibrateError::CutoffLooksLikeDelay { channel: i + 1, sigma });
        }
    }
    if settings.fit.cutoff.is_none() {
        return Ok(relative);
    }
    let disagrees = |one: &RatioSolution| contradiction(one.squares, one.freedom).is_some();
    let is_told = |one: &RatioSolution| {
        let sigma = one.cutoff_sigma(settings.reference).unwrap_or(f64::INFINITY);
        let explains = sigma < LARGEST_CUTOFF_ERROR && disagrees(&relative) && !disagrees(one);
        model.stated_cutoffs[settings.reference].is_some() || sigma < TOLD_CUTOFF || explains
    };
    let absolute = RatioFit::new(model, all, settings).with_the_references_cutoff(&relative.point).solve();
    Ok(absolute.ok().filter(is_told).unwrap_or(relative))
}

impl LeastSquares for RatioFit<'_> {
    type Error = CalibrateError;
    /// The equations are linear in all values but the cut-offs, which take three to eight steps.
    const MOST_STEPS: usize = 40;
    const WORST_CONDITION: f64 = WORST_CONDITION;

    fn equations(&mut self) -> Result<NormalEquations, CalibrateError> {
        let count = self.point.parameters.len();
        let mut equations = NormalEquations::new(count);
        for white in self.white() {
            for row in white.rows.row_iter() {
                let row: Vec<f64> = row.iter().copied().collect();
                equations.add(&row[..count], row[count]);
            }
        }
        let reference = self.settings.reference;
        if let (Some(k), Some(sigma)) = (self.point.index(reference, ChannelParameter::Cutoff), self.stated) {
            let of = |other| if other == k { sigma.recip() } else { 0.0 };
            let derivatives: Vec<f64> = (0..count).map(of).collect();
            equations.add(&derivatives, -self.point.ln_cutoffs[reference] / sigma);
        }
        Ok(equations)
    }

    fn advance(&mut self, step: &[f64]) -> bool {
        self.point.advance(step);
        true
    }

    /// A cut-off that moves by more than a factor of e is refused anyway.
    fn limits(&self, k: usize, sigma: f64) -> StepLimits {
        let is_cutoff = self.point.parameters[k].kind == ChannelParameter::Cutoff;
        let largest = if is_cutoff { 1.0 } else { f64::INFINITY };
        StepLimits { largest, negligible: (SMALL_STEP * sigma).max(RESPONSE_ROUNDING) }
    }

    fn error(&self, why: NoMinimum) -> CalibrateError {
        why.into()
    }
}

impl<'a> RatioFit<'a> {
    fn new(model: &'a ChannelModel, all: &[&'a Tones], settings: CalibrationSettings) -> Self {
        let others: Vec<usize> = model.others(settings.reference).collect();
        let every: Vec<&TonePhasors> = all.iter().flat_map(|tones| &tones.measured).collect();
        let delays: Vec<f64> = others.iter().map(|&i| nearest_delay(&every, i, model.ratio as f64)).collect();
        let one = |tone: &'a TonePhasors, jitter: &'a [f64]| {
            // Whole cycles of the delay are taken out before the angle is measured.
            let ln_ratio = |(&i, delay): (&usize, &f64)| {
                let (ratio, phase) = (tone.ratios[i], tone.w * delay);
                let angle = (ratio * Complex::from_polar(1.0, phase)).arg() - phase;
                Complex::new(ratio.norm().ln(), angle)
            };
            let ln_ratios = others.iter().zip(&delays).map(ln_ratio).collect();
            ToneEquations { w: tone.w, ln_ratios, tone, jitter }
        };
        let tones = all.iter().flat_map(|tones| tones.measured.iter().map(|tone| one(tone, &tones.jitter)));
        let (tones, point) =
            (tones.collect(), ChannelValues::nominal(model, settings.fit, settings.reference));
        let is_complex = all.iter().all(|tones| tones.is_complex);
        Self { model, settings, others, point, stated: None, tones, is_complex }
    }

    /// The same with the cut-off of the reference, from a solution without it: equal filters do not tell it.
    fn with_the_references_cutoff(mut self, relative: &ChannelValues) -> Self {
        let channel = self.settings.reference;
        self.point = relative.clone();
        self.point.parameters.push(Parameter { channel, kind: ChannelParameter::Cutoff });
        self.stated = self.model.stated_cutoffs[channel];
        self
    }

    fn solve(mut self) -> Result<RatioSolution, CalibrateError> {
        if self.point.parameters.is_empty() {
            return Ok(RatioSolution {
                point: self.point,
                covariance: Mat::zeros(0, 0),
                squares: 0.0,
                freedom: 0,
            });
        }
        let found = minimise(&mut self)?;
        let covariance = &found.inverse + &found.inverse * self.of_jitter() * &found.inverse;
        let (squares, rows) = (found.equations.squares, found.equations.rows);
        let freedom = rows.saturating_sub(self.point.parameters.len());
        Ok(RatioSolution { point: self.point, covariance, squares, freedom })
    }

    fn white(&self) -> impl Iterator<Item = WhiteEquations<'_>> {
        let FittedValues { delay, gain, cutoff, .. } = self.settings.fit;
        let parts = [(gain || cutoff.is_some(), false), (delay || cutoff.is_some(), true)];
        let parts = parts.into_iter().filter_map(|(is_used, are_phases)| is_used.then_some(are_phases));
        self.tones.iter().flat_map(move |of| {
            let complex = self.rows(of);
            parts.clone().map(move |are_phases| {
                let part = |z: Complex<f64>| if are_phases { z.im } else { z.re };
                let variance = |&i: &usize| part(of.tone.sigmas[i]).powi(2);
                let variances: Vec<f64> = self.others.iter().map(variance).collect();
                let whitening = whitening(&variances, of.tone.reference_variance);
                let rows =
                    &whitening * Mat::from_fn(complex.len(), complex[0].len(), |i, k| part(complex[i][k]));
                WhiteEquations { rows, whitening, are_phases, of }
            })
        })
    }

    /// The derivatives of ln ratio by the parameters and its residual, per channel.
    fn rows(&self, of: &ToneEquations<'_>) -> Vec<Vec<Complex<f64>>> {
        let (point, model, reference) = (&self.point, self.model, self.settings.reference);
        let slope = |i: usize| model.cutoff_slope(i, of.w, point.ln_cutoffs[i]);
        let moved =
            |i: usize| (model.response(i, of.w, point.ln_cutoffs[i]) / model.response(i, of.w, 0.0)).ln();
        let row = |(&i, &ln_ratio): (&usize, &Complex<f64>)| {
            let effect = |parameter: &Parameter| match parameter.kind {
                _ if parameter.channel == reference => -slope(reference),
                _ if parameter.channel != i => Complex::ZERO,
                ChannelParameter::Delay => Complex::new(0.0, -of.w),
                ChannelParameter::Gain => Complex::ONE,
                ChannelParameter::Cutoff => slope(i),
            };
            let turned = Complex::new(point.ln_gains[i], -of.w * (point.delays[i] - model.delays[i]));
            let left = ln_ratio - turned - moved(i) + moved(reference);
            point.parameters.iter().map(effect).chain([left]).collect()
        };
        self.others.iter().zip(&of.ln_ratios).map(row).collect()
    }

    /// What jitter adds to the covariance of J'r beyond noise of the same power. It errs along the slope of
    /// the signal: with the mean square v of the jitter and N samples the phases of tones t and u have the
    /// covariance
    ///
    /// ```text
    /// v / N (2 w_t w_u - 3/2 w_t^2 [t = u])     and the magnitudes   -v / N 1/2 w_t^2 [t = u]
    /// ```
    ///
    /// more than white noise gives them: jitter is also a delay that all tones have in common. Of complex
    /// samples it is 3/2 w_t w_u - w_t^2 [t = u] for the phases. What their magnitudes have in common is
    /// left out, which makes no interval shorter.
    fn of_jitter(&self) -> Mat {
        let (count, others) = (self.point.parameters.len(), self.others.len());
        let mut sum = Mat::zeros(count, count);
        // Per acquisition and channel: the effect of a common delay.
        let mut common: Vec<(&[f64], Mat)> = Vec::new();
        for WhiteEquations { rows, whitening, are_phases, of } in self.white() {
            // Errors of one channel are in its ratio, those of the reference in all.
            let sources = Mat::from_fn(others, others + 1, |i, k| match k {
                k if k == others => -1.0,
                k => f64::from(i == k),
            });
            let effects = rows.columns(0, count).transpose() * whitening * sources * of.w;
            let channels = self.others.iter().chain([&self.settings.reference]);
            let share = match (are_phases, self.is_complex) {
                (false, _) => -0.5,
                (true, false) => -1.5,
                (true, true) => -1.0,
            };
            for (k, &channel) in channels.enumerate() {
                let effect = effects.column(k);
                sum += effect * effect.transpose() * (share * of.jitter[channel]);
            }
            if are_phases {
                match common.iter_mut().find(|(jitter, _)| std::ptr::eq(*jitter, of.jitter)) {
                    Some((_, total)) => *total += effects,
                    None => common.push((of.jitter, effects)),
                }
            }
        }
        let share = if self.is_complex { 1.5 } else { 2.0 };
        for (jitter, effects) in common {
            for (k, &channel) in self.others.iter().chain([&self.settings.reference]).enumerate() {
                let effect = effects.column(k);
                sum += effect * effect.transpose() * (share * jitter[channel]);
            }
        }
        sum
    }
}

/// The inverse root of the covariance of ratios with these variances, of which the `reference` has a part in
/// all: D^-1/2 (I - c u u') with D the parts of their own and u = root of (reference / D).
fn whitening(variances: &[f64], reference: f64) -> Mat {
    let own = variances.iter().map(|v| (v - reference).max(LEAST_OWN_SHARE * v).max(f64::MIN_POSITIVE));
    let roots: Vec<f64> = own.map(f64::sqrt).collect();
    let u: Vec<f64> = roots.iter().map(|root| reference.sqrt() / root).collect();
    let squares: f64 = u.iter().map(|u| u * u).sum();
    let factor = if squares > 0.0 { (1.0 - (1.0 + squares).sqrt().recip()) / squares } else { 0.0 };
    Mat::from_fn(roots.len(), roots.len(), |i, k| (f64::from(i == k) - factor * u[i] * u[k]) / roots[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitened_ratios_have_unit_covariance() {
        let (variances, reference) = ([3.0, 5.0, 4.5], 2.0);
        let covariance = Mat::from_fn(3, 3, |i, k| if i == k { variances[i] } else { reference });
        let white = whitening(&variances, reference);
        let unit = &white * covariance * white.transpose();
        assert!((unit - Mat::identity(3, 3)).norm() < 1e-14);
    }
}
