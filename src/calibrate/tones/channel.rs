//! The values of one channel from the ratios of its tones.

use super::phasors::TonePhasors;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::estimates::WORST_CONDITION;
use crate::calibrate::fit::{ChannelParameter, FittedValues};
use crate::calibrate::model::ChannelModel;
use crate::linalg::least_squares::{LeastSquares, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::{Complex, Mat};

/// A cut-off that is known to less than this share of itself is not known.
const LARGEST_CUTOFF_ERROR: f64 = 0.1;
/// The iteration ends when all steps are below this share of the standard deviation ..
const SMALL_STEP: f64 = 1e-6;
/// .. or below this: the rounding of responses and phases.
const RESPONSE_ROUNDING: f64 = 1e-12;

/// One tone in the channel.
struct ToneEquation {
    /// Rad per fast period.
    w: f64,
    /// ln of the ratio, its phase without whole cycles of the nearest delay.
    ln_ratio: Complex<f64>,
    /// The standard deviations of both parts.
    sigmas: Complex<f64>,
}

/// The equations of a channel at the present values.
pub(super) struct RatioFit<'a> {
    model: &'a ChannelModel,
    /// From 0.
    channel: usize,
    fit: FittedValues,
    kinds: Vec<ChannelParameter>,
    rows: Vec<ToneEquation>,
    /// In the order of `kinds`.
    values: Vec<f64>,
}

/// The values in the order of [`FittedValues::kinds`].
pub(super) struct ChannelSolution {
    pub(super) values: Vec<f64>,
    pub(super) covariance: Mat,
    /// Chi squared, and its degrees of freedom.
    pub(super) squares: f64,
    pub(super) freedom: usize,
}

impl LeastSquares for RatioFit<'_> {
    type Error = CalibrateError;
    /// The equations are linear in all values but the cut-off, which takes three to eight steps.
    const MOST_STEPS: usize = 40;
    const WORST_CONDITION: f64 = WORST_CONDITION;

    fn equations(&mut self) -> Result<NormalEquations, CalibrateError> {
        let ln_cutoff = self.ln_cutoff();
        let mut equations = NormalEquations::new(self.kinds.len());
        let with_cutoff = self.fit.cutoff.is_some();
        let (magnitudes, phases) = (self.fit.gain || with_cutoff, self.fit.delay || with_cutoff);
        for row in &self.rows {
            let response = |ln_cutoff| self.model.response(self.channel, row.w, ln_cutoff);
            let effect = |&kind: &ChannelParameter| match kind {
                ChannelParameter::Delay => Complex::new(0.0, -row.w),
                ChannelParameter::Gain => Complex::ONE,
                ChannelParameter::Cutoff => self.model.cutoff_slope(self.channel, row.w, ln_cutoff),
            };
            let effects: Vec<Complex<f64>> = self.kinds.iter().map(effect).collect();
            let values = self.kinds.iter().zip(&effects).zip(&self.values);
            let linear = values.filter(|((kind, _), _)| **kind != ChannelParameter::Cutoff);
            let explained = linear.map(|((_, effect), value)| effect * *value).sum::<Complex<f64>>()
                + (response(ln_cutoff) / response(0.0)).ln();
            let left = row.ln_ratio - explained;
            let mut add = |part: fn(&Complex<f64>) -> f64| {
                let sigma = part(&row.sigmas);
                let derivatives: Vec<f64> = effects.iter().map(|effect| part(effect) / sigma).collect();
                equations.add(&derivatives, part(&left) / sigma);
            };
            if magnitudes {
                add(|x| x.re);
            }
            if phases {
                add(|x| x.im);
            }
        }
        Ok(equations)
    }

    fn advance(&mut self, step: &[f64]) -> bool {
        self.values.iter_mut().zip(step).for_each(|(value, step)| *value += step);
        true
    }

    /// A cut-off that moves by more than a factor of e is refused anyway.
    fn limits(&self, k: usize, sigma: f64) -> StepLimits {
        let largest = if self.kinds[k] == ChannelParameter::Cutoff { 1.0 } else { f64::INFINITY };
        StepLimits { largest, negligible: (SMALL_STEP * sigma).max(RESPONSE_ROUNDING) }
    }

    fn error(&self, why: NoMinimum) -> CalibrateError {
        why.into()
    }
}

impl<'a> RatioFit<'a> {
    /// Of the tones in a channel whose delay is near `delay` after its nominal one.
    pub(super) fn new(
        model: &'a ChannelModel,
        channel: usize,
        fit: FittedValues,
        tones: &[&TonePhasors],
        delay: f64,
    ) -> Self {
        let row = |tone: &&TonePhasors| {
            let (ratio, phase) = (tone.ratios[channel], tone.w * delay);
            // Whole cycles of the delay are taken out before the angle is measured.
            let angle = (ratio * Complex::from_polar(1.0, phase)).arg() - phase;
            ToneEquation {
                w: tone.w,
                ln_ratio: Complex::new(ratio.norm().ln(), angle),
                sigmas: tone.sigmas[channel],
            }
        };
        let (kinds, rows) = (fit.kinds(), tones.iter().map(row).collect());
        Self { model, channel, fit, values: vec![0.0; kinds.len()], kinds, rows }
    }

    pub(super) fn solve(mut self) -> Result<ChannelSolution, CalibrateError> {
        if self.kinds.is_empty() {
            return Ok(ChannelSolution {
                values: self.values,
                covariance: Mat::zeros(0, 0),
                squares: 0.0,
                freedom: 0,
            });
        }
        let found = minimise(&mut self)?;
        let sigma = self.kinds.iter().position(|&kind| kind == ChannelParameter::Cutoff);
        let sigma = sigma.map_or(0.0, |k| found.inverse[(k, k)].sqrt());
        if sigma > LARGEST_CUTOFF_ERROR || self.ln_cutoff().abs() > 1.0 {
            return Err(CalibrateError::CutoffLooksLikeDelay { channel: self.channel + 1, sigma });
        }
        let (squares, rows) = (found.equations.squares, found.equations.rows);
        let freedom = rows.saturating_sub(self.values.len());
        Ok(ChannelSolution { values: self.values, covariance: found.inverse, squares, freedom })
    }

    fn ln_cutoff(&self) -> f64 {
        let at = self.kinds.iter().position(|&kind| kind == ChannelParameter::Cutoff);
        at.map_or(0.0, |k| self.values[k])
    }
}
