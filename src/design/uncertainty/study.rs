//! What a user asks of the errors of a bank, answered at once.

use super::{DelayDerivatives, Floor, affordable, delay_derivatives, floor, norm_at, worst_case};
use crate::bank::Bank;
use crate::design::DesignError;
use crate::units::{Hertz, Seconds};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Slopes, WorstCase, slopes};

/// Relative distance of the two ends that is asked for.
const BOUND_ACCURACY: f64 = 0.01;
/// The same for banks of many channels.
const BOUND_ACCURACY_OF_MANY: f64 = 0.05;
/// Channels up to which the ends are asked for closely.
const FEW_CHANNELS: usize = 4;

/// What is asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Questions {
    /// The worst case over this box.
    pub errors: Option<ErrorBox>,
    /// What a jitter of each channel adds at most.
    pub jitter: Option<Vec<Seconds>>,
    /// The derivatives of gamma.
    pub sensitivity: bool,
    /// The part of the box that costs at most this share of gamma.
    pub loss: Option<f64>,
}

/// What is known of a box of errors.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ErrorStudy {
    /// The worst case over the box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<BoxStudy>,
    /// The derivatives of gamma.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
    /// What jitter adds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter: Option<JitterStudy>,
}

/// The worst case over a box.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct BoxStudy {
    /// The box.
    pub errors: ErrorBox,
    /// The worst case, proven from both sides.
    #[serde(flatten)]
    pub case: WorstCase,
    /// The frequency of the worst case, modulo the slow rate.
    pub peak_hertz: Hertz,
    /// What no bank can do better.
    pub floor: Floor,
    /// The part of the box that costs a given share of gamma.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub affordable: Option<Affordable>,
}

/// The box that costs a share of gamma.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Affordable {
    /// The share.
    pub loss: f64,
    /// The part of the box; 0 if none is proven to cost so little.
    pub factor: f64,
    /// The box times the factor.
    pub errors: ErrorBox,
}

/// The derivatives of gamma with respect to the delays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Sensitivity {
    /// Per fast period, where gamma is.
    #[serde(flatten)]
    pub derivatives: DelayDerivatives,
    /// The same per second.
    pub per_second: Vec<f64>,
    /// Their bounds for all delays.
    #[serde(flatten)]
    pub slopes: Slopes,
}

/// What jitter adds to gamma at most.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct JitterStudy {
    /// The jitter of each channel.
    pub jitter: Vec<Seconds>,
    /// No jitter up to that adds more to gamma; infinite, in JSON null, for front ends of relative degree 1.
    pub added: f64,
}

impl ErrorStudy {
    /// Answers `questions` for `bank`.
    ///
    /// # Errors
    /// As [`worst_case`].
    pub fn new(bank: &Bank, questions: Questions) -> Result<Self, DesignError> {
        let Questions { errors, jitter, sensitivity, loss } = questions;
        let of_box = || slopes(bank, errors.as_ref().unwrap_or(&ErrorBox::none(bank.channel_count())));
        let known = (sensitivity || jitter.is_some()).then(of_box).transpose()?;
        let jitter = jitter
            .zip(known.as_ref())
            .map(|(jitter, slopes)| JitterStudy { added: slopes.jitter(&jitter, bank.fast_period), jitter });
        let sensitivity =
            known.filter(|_| sensitivity).map(|slopes| Sensitivity::new(bank, slopes)).transpose()?;
        let worst_case = errors.map(|errors| BoxStudy::new(bank, errors, loss)).transpose()?;
        Ok(Self { worst_case, sensitivity, jitter })
    }
}

impl BoxStudy {
    fn new(bank: &Bank, errors: ErrorBox, loss: Option<f64>) -> Result<Self, DesignError> {
        let accuracy =
            if bank.channel_count() <= FEW_CHANNELS { BOUND_ACCURACY } else { BOUND_ACCURACY_OF_MANY };
        let case = worst_case(bank, &errors, accuracy)?;
        let floor = floor(bank, &errors, &case.point)?;
        let affordable = loss.map(|loss| {
            let factor = affordable(bank, &errors, loss)?;
            Ok::<_, DesignError>(Affordable { loss, factor, errors: errors.scaled(factor) })
        });
        let affordable = affordable.transpose()?;
        Ok(Self { peak_hertz: case.frequency.in_hertz(bank.slow_period()), errors, case, floor, affordable })
    }
}

impl Sensitivity {
    fn new(bank: &Bank, slopes: Slopes) -> Result<Self, DesignError> {
        let derivatives = delay_derivatives(bank)?;
        let per_second = derivatives.per_fast_period.iter().map(|x| x / bank.fast_period.0).collect();
        Ok(Self { derivatives, per_second, slopes })
    }
}

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
                norm_at(bank, &point).map(|(gamma, _)| gamma)
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
