//! The channels of a spec as a calibration sees them: nominal values and responses, time in fast periods.

use super::error::CalibrateError;
use crate::analog::StrictlyProper;
use crate::linalg::Complex;
use crate::spec::Spec;
use crate::units::{FastPeriods, Hertz, RadiansPerFastPeriod, Seconds};

/// Step of ln(cut-off) for central differences: the error of the difference, its square over six, and the
/// rounding, eps over it, are both far below a per cent of the slope.
const CUTOFF_STEP: f64 = 1e-4;

/// Front ends, delays, gains and offsets of the channels, as the spec says.
///
/// With w in rad per fast period, channel i delivers of the analog signal e^{jwt} the samples
///
/// ```text
/// g_i Phi_i(j w / c_i) e^{jw(kM - D_i)} + o_i,   c_i = 1
/// ```
///
/// where c_i scales the cut-off frequency of its front end.
#[derive(Debug, Clone)]
pub struct Model {
    /// M.
    pub ratio: usize,
    /// h.
    pub fast_period: Seconds,
    /// D_i.
    pub delays: Vec<FastPeriods>,
    /// g_i.
    pub gains: Vec<f64>,
    /// o_i.
    pub offsets: Vec<f64>,
    pub(super) front_ends: Vec<StrictlyProper>,
}

impl Model {
    /// The model of `spec`.
    ///
    /// # Errors
    /// [`CalibrateError::Analog`] for a filter that cannot be realised.
    pub fn new(spec: &Spec) -> Result<Self, CalibrateError> {
        let realise = |(i, channel): (usize, &crate::spec::ChannelSpec)| {
            StrictlyProper::new(&channel.filter, spec.fast_period)
                .map_err(|source| CalibrateError::Analog { channel: i + 1, source: Box::new(source) })
        };
        Ok(Self {
            ratio: spec.ratio,
            fast_period: spec.fast_period,
            delays: spec.delays_in_fast_periods(),
            gains: spec.channels.iter().map(|channel| channel.gain).collect(),
            offsets: spec.channels.iter().map(|channel| channel.offset).collect(),
            front_ends: spec.channels.iter().enumerate().map(realise).collect::<Result<_, _>>()?,
        })
    }

    /// N.
    pub fn channels(&self) -> usize {
        self.delays.len()
    }

    /// 1 / (M h).
    pub fn slow_rate(&self) -> Hertz {
        (self.fast_period * self.ratio as f64).rate()
    }

    /// Phi_i(j w / c) with c = e^`ln_cutoff`.
    pub(super) fn response(&self, i: usize, w: f64, ln_cutoff: f64) -> Complex<f64> {
        self.front_ends[i].response(RadiansPerFastPeriod(w * (-ln_cutoff).exp()))
    }

    /// The derivative of ln Phi_i(j w / c) by ln c.
    pub(super) fn cutoff_slope(&self, i: usize, w: f64, ln_cutoff: f64) -> Complex<f64> {
        let at = |step: f64| self.response(i, w, ln_cutoff + step);
        (at(CUTOFF_STEP) / at(-CUTOFF_STEP)).ln() / (2.0 * CUTOFF_STEP)
    }

    /// g_i Phi_i(jw) e^{-jw D_i}, nominal.
    pub(crate) fn nominal(&self, i: usize, w: f64) -> Complex<f64> {
        self.response(i, w, 0.0) * Complex::from_polar(1.0, -w * self.delays[i].0) * self.gains[i]
    }
}
