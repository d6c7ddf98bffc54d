//! The worst case over a box of errors, as text and as JSON.

use crate::bank::Bank;
use crate::design::DesignError;
use crate::design::uncertainty::{self, DelayDerivatives, Floor};
use crate::quantity::readable;
use crate::units::{Hertz, Seconds};
use crate::verify::VerifyError;
use crate::verify::uncertainty::{ErrorBox, Slopes, WorstCase, slopes};
use std::fmt::Write;

/// Relative distance of the two ends that is asked for.
const ACCURACY: f64 = 0.01;
/// The same for banks of many channels.
const ACCURACY_OF_MANY: f64 = 0.05;
/// Channels up to which the ends are asked for closely.
const FEW_CHANNELS: usize = 4;

/// What is known of a box of errors.
#[derive(Debug, serde::Serialize)]
pub(super) struct Report {
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_case: Option<Worst>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensitivity: Option<Sensitivity>,
    #[serde(skip_serializing_if = "Option::is_none")]
    jitter: Option<Jitter>,
}

#[derive(Debug, serde::Serialize)]
struct Worst {
    errors: ErrorBox,
    #[serde(flatten)]
    case: WorstCase,
    peak_hertz: Hertz,
    floor: Floor,
    #[serde(skip_serializing_if = "Option::is_none")]
    affordable: Option<Affordable>,
}

/// The box that costs a share of gamma.
#[derive(Debug, serde::Serialize)]
struct Affordable {
    loss: f64,
    factor: f64,
    errors: ErrorBox,
}

#[derive(Debug, serde::Serialize)]
struct Sensitivity {
    #[serde(flatten)]
    derivatives: DelayDerivatives,
    per_second: Vec<f64>,
    #[serde(flatten)]
    slopes: Slopes,
}

#[derive(Debug, serde::Serialize)]
struct Jitter {
    jitter: Vec<Seconds>,
    /// No jitter up to that adds more to gamma; null for front ends of relative degree 1.
    added: f64,
}

/// What is asked for.
pub(super) struct Questions {
    pub(super) errors: Option<ErrorBox>,
    pub(super) jitter: Option<Vec<Seconds>>,
    pub(super) sensitivity: bool,
    pub(super) loss: Option<f64>,
}

impl Report {
    /// Answers `questions` for `bank`.
    pub(super) fn new(bank: &Bank, questions: Questions) -> Result<Self, DesignError> {
        let Questions { errors, jitter, sensitivity, loss } = questions;
        let none = || ErrorBox::none(bank.channel_count());
        let known = if sensitivity || jitter.is_some() {
            Some(slopes(bank, errors.as_ref().unwrap_or(&none()))?)
        } else {
            None
        };
        let jitter = match (jitter, &known) {
            (Some(jitter), Some(slopes)) => {
                Some(Jitter { added: slopes.jitter(&jitter, bank.fast_period), jitter })
            }
            _ => None,
        };
        let sensitivity = match known {
            Some(slopes) if sensitivity => {
                let derivatives = uncertainty::delay_derivatives(bank)?;
                let per_second = derivatives.per_fast_period.iter().map(|x| x / bank.fast_period.0).collect();
                Some(Sensitivity { derivatives, per_second, slopes })
            }
            _ => None,
        };
        let worst_case = errors.map(|errors| Worst::new(bank, errors, loss)).transpose()?;
        Ok(Self { worst_case, sensitivity, jitter })
    }

    /// The worst case, if it was asked for.
    pub(super) fn case(&self) -> Option<(&ErrorBox, &WorstCase)> {
        self.worst_case.as_ref().map(|worst| (&worst.errors, &worst.case))
    }

    /// Lines for people.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        if let Some(worst) = &self.worst_case {
            worst.write(&mut text);
        }
        if let Some(Jitter { added, jitter }) = &self.jitter {
            let most = jitter.iter().map(|x| x.0).fold(0.0, f64::max);
            let what = if added.is_finite() {
                format!(
                    "+{added:.9}   at most, by instants that are off by up to {}, differently at each sample",
                    time(most)
                )
            } else {
                "unbounded     a front end of relative degree 1 passes steps, whose instant decides the sample".to_owned()
            };
            let _ = writeln!(text, "jitter       {what}");
        }
        if let Some(sensitivity) = &self.sensitivity {
            sensitivity.write(&mut text);
        }
        text
    }
}

impl Worst {
    fn new(bank: &Bank, errors: ErrorBox, loss: Option<f64>) -> Result<Self, DesignError> {
        let accuracy = if bank.channel_count() <= FEW_CHANNELS { ACCURACY } else { ACCURACY_OF_MANY };
        let case = uncertainty::worst_case(bank, &errors, accuracy)?;
        let floor = uncertainty::floor(bank, &errors, &case.point)?;
        let affordable = match loss {
            None => None,
            Some(loss) => {
                let factor = uncertainty::affordable(bank, &errors, loss)?;
                Some(Affordable { loss, factor, errors: errors.scaled(factor) })
            }
        };
        Ok(Self { peak_hertz: case.frequency.in_hertz(bank.slow_period()), errors, case, floor, affordable })
    }

    fn write(&self, text: &mut String) {
        let Self { case, floor, errors, .. } = self;
        let width = 100.0 * (case.upper / case.lower - 1.0);
        let _ = writeln!(text, "box          {}", of_box(errors));
        let _ = writeln!(
            text,
            "worst case   {:.9} to {:.9}   both ends proven, {width:.2} % apart",
            case.lower, case.upper
        );
        let _ = writeln!(text, "attained     {} at {:.6}", of_point(case, errors), self.peak_hertz);
        if floor.value() > 0.0 {
            let reason = if floor.common_shift >= floor.noncausal.unwrap_or(0.0) {
                "no bank is better: a shift of all channels cannot be seen"
            } else {
                "no bank is better at the worst errors"
            };
            let _ = writeln!(text, "floor        {:.9}   {reason}", floor.value());
        }
        if let Some(Affordable { loss, factor, errors }) = &self.affordable {
            let share = 100.0 * loss;
            let line = if *factor > 0.0 {
                format!(
                    "{} costs at most {share} % of gamma (proven; {factor:.3e} of the box)",
                    of_box(errors)
                )
            } else {
                format!("no part of the box is proven to cost {share} % of gamma or less")
            };
            let _ = writeln!(text, "accuracy     {line}");
        }
    }
}

impl Sensitivity {
    fn write(&self, text: &mut String) {
        let Self { derivatives, slopes, .. } = self;
        let note = if derivatives.simple { "" } else { "; one of several equal peaks" };
        let _ = writeln!(
            text,
            "sensitivity  of gamma to each delay, per fast sample (peak at {:.6}{note})",
            derivatives.peak_hertz
        );
        for (i, (slope, most)) in derivatives.per_fast_period.iter().zip(&slopes.lipschitz).enumerate() {
            let _ = writeln!(text, "  channel {:<3} {slope:+.6}   never more than {most:.6}", i + 1);
        }
    }
}

fn of_box(errors: &ErrorBox) -> String {
    let mut parts = Vec::new();
    if errors.delays.iter().any(|x| x.0 > 0.0) {
        parts.push(format!("delays ±({})", list(&errors.delays, |x| time(x.0))));
    }
    for (what, shares) in [("gains", &errors.gains), ("cut-offs", &errors.cutoffs)] {
        if shares.iter().any(|x| *x > 0.0) {
            parts.push(format!("{what} ±({})", list(shares, |x| percent(*x))));
        }
    }
    if parts.is_empty() { "no errors".to_owned() } else { parts.join(", ") }
}

fn of_point(case: &WorstCase, errors: &ErrorBox) -> String {
    let point = &case.point;
    let mut parts = Vec::new();
    if errors.delays.iter().any(|x| x.0 > 0.0) {
        parts.push(format!("delays off by {}", list(&point.delays, |x| time(x.0))));
    }
    for (what, most, shares) in
        [("gains", &errors.gains, &point.gains), ("cut-offs", &errors.cutoffs, &point.cutoffs)]
    {
        if most.iter().any(|x| *x > 0.0) {
            parts.push(format!("{what} off by {}", list(shares, |x| percent(*x))));
        }
    }
    if parts.is_empty() { "without errors".to_owned() } else { parts.join(", ") }
}

fn list<T>(values: &[T], text: impl Fn(&T) -> String) -> String {
    values.iter().map(text).collect::<Vec<_>>().join(", ")
}

fn percent(share: f64) -> String {
    format!("{} %", rounded(100.0 * share))
}

/// A time in four significant digits.
fn time(seconds: f64) -> String {
    readable(rounded(seconds), "s")
}

/// Four significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// The place of an error of the proof in the command line.
pub(super) fn explained(error: &DesignError) -> String {
    match error {
        DesignError::Verify(VerifyError::WideBox) => {
            format!("--delay-box, --gain-box, --cutoff-box: {error}")
        }
        _ => error.to_string(),
    }
}
