//! gamma along the delays of a box.

use super::norm_at;
use crate::bank::Bank;
use crate::design::DesignError;
use crate::units::Seconds;
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Taps};

/// Points per curve; an odd number has the nominal delays among them.
const POINTS: usize = 41;

/// Curves of gamma over the share of the box, from -1 to 1.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Sweep {
    /// Half-widths of the delays.
    pub half_widths: Vec<Seconds>,
    /// Shares of the box, in ascending order.
    pub shares: Vec<f64>,
    /// One per channel whose delay is uncertain, then the one through the worst point.
    pub curves: Vec<SweepCurve>,
}

/// gamma at each share.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SweepCurve {
    /// What moves.
    pub label: String,
    /// gamma there.
    pub gammas: Vec<f64>,
}

impl Sweep {
    /// Moves each channel alone, and all together towards `worst`.
    ///
    /// # Errors
    /// As [`norm_at`].
    pub fn new(bank: &Bank, errors: &ErrorBox, worst: &ErrorPoint) -> Result<Self, DesignError> {
        let shares: Vec<f64> = (0..POINTS).map(|k| 2.0 * k as f64 / (POINTS - 1) as f64 - 1.0).collect();
        let along = |label: String, delays: &[Seconds]| -> Result<SweepCurve, DesignError> {
            let gamma = |share: &f64| {
                let delays = delays.iter().map(|&delay| delay * *share).collect();
                let point = ErrorPoint { delays, ..ErrorPoint::none(bank.channel_count()) };
                norm_at(bank, &point, Taps::Fixed).map(|(gamma, _)| gamma)
            };
            Ok(SweepCurve { label, gammas: shares.iter().map(gamma).collect::<Result<_, _>>()? })
        };
        let mut curves = Vec::new();
        for i in (0..bank.channel_count()).filter(|&i| errors.delays[i].0 > 0.0) {
            let mut alone = vec![Seconds(0.0); bank.channel_count()];
            alone[i] = errors.delays[i];
            curves.push(along(format!("channel {}", i + 1), &alone)?);
        }
        curves.push(along("all, towards the worst point".into(), &worst.delays)?);
        Ok(Self { half_widths: errors.delays.clone(), shares, curves })
    }
}
