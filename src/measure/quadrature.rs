//! The two parts of a complex record.

use crate::sine_fit::{Direction, Estimate, SineFit};
use crate::units::{Decibels, Radians};
use std::f64::consts::FRAC_PI_2;

/// What the parts of a complex record lack of equal gains, of quadrature and of offsets of 0 (I/Q
/// imbalance).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Quadrature {
    /// The constant of the imaginary parts.
    pub offset: Estimate<f64>,
    /// One per tone, at its frequency.
    pub imbalances: Vec<Imbalance>,
}

/// The imbalance of the parts at a tone. With the gain g and the phase error p the imaginary part of
/// e^{j w t} is g sin(w t + p), and the image of the tone has the relative size
///
/// ```text
/// abs(b / a) = sqrt( (1 - 2 g cos p + g^2) / (1 + 2 g cos p + g^2) )
/// ```
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Imbalance {
    /// g, the gain of the imaginary part relative to that of the real part.
    pub gain: Estimate<f64>,
    /// p, the error of the quadrature.
    #[serde(rename = "phase_radians")]
    pub phase: Estimate<Radians>,
    /// Tone over image.
    #[serde(rename = "image_rejection_db")]
    pub image_rejection: Decibels,
}

impl Quadrature {
    /// Of the fit of both parts.
    pub(super) fn of(fit: &SineFit) -> Self {
        let imbalances = (0..fit.tones()).map(|tone| Imbalance::of(fit, tone)).collect();
        Self { offset: fit.channels[1].constant, imbalances }
    }
}

impl Imbalance {
    fn of(fit: &SineFit, tone: usize) -> Self {
        let difference = fit.phase_between(1, 0, tone);
        let size = |direction| fit.exponential([0, 1], tone, direction).amplitude.value;
        Self {
            gain: fit.gain_between(1, 0, tone),
            phase: Estimate { value: quadrature_error(difference.value), sigma: difference.sigma },
            image_rejection: Decibels::of_amplitude(size(Direction::Forward) / size(Direction::Backward)),
        }
    }
}

/// The difference of phases beyond minus a quarter of a turn, in -pi ..= pi.
fn quadrature_error(difference: Radians) -> Radians {
    let turned = difference.0 + FRAC_PI_2;
    Radians(turned.sin().atan2(turned.cos()))
}
