//! The worst case over a box of errors, as text, as JSON, as CSV and as a picture.

use super::design_studies::number;
use super::plot::PictureFormat;
use super::print::Failure;
use super::written::write_bytes;
use crate::bank::Bank;
use crate::design::DesignError;
use crate::design::uncertainty::{self, DelayDerivatives, Floor, norm_at};
use crate::plot::{AxisScale, Chart, Series};
use crate::quantity::readable;
use crate::units::{Hertz, Seconds};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Slopes, Taps, WorstCase, slopes};
use std::fmt::Write;
use std::path::Path;

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
        let of_box = || slopes(bank, errors.as_ref().unwrap_or(&ErrorBox::none(bank.channel_count())));
        let known = (sensitivity || jitter.is_some()).then(of_box).transpose()?;
        let jitter = jitter
            .zip(known.as_ref())
            .map(|(jitter, slopes)| Jitter { added: slopes.jitter(&jitter, bank.fast_period), jitter });
        let sensitivity =
            known.filter(|_| sensitivity).map(|slopes| Sensitivity::new(bank, slopes)).transpose()?;
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
                    "+{}   at most, by instants that are off by up to {}, differently at each sample",
                    number(*added),
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
        let case = uncertainty::worst_case(bank, &errors, Taps::Fixed, accuracy)?;
        let floor = uncertainty::floor(bank, &errors, &case.point)?;
        let affordable = loss.map(|loss| {
            let factor = uncertainty::affordable(bank, &errors, loss)?;
            Ok::<_, DesignError>(Affordable { loss, factor, errors: errors.scaled(factor) })
        });
        let affordable = affordable.transpose()?;
        Ok(Self { peak_hertz: case.frequency.in_hertz(bank.slow_period()), errors, case, floor, affordable })
    }

    fn write(&self, text: &mut String) {
        let Self { case, floor, errors, .. } = self;
        let width = 100.0 * (case.upper / case.lower - 1.0);
        let _ = writeln!(text, "box          {}", of_box(errors));
        let _ = writeln!(
            text,
            "worst case   {} to {}   both ends proven, {width:.2} % apart",
            number(case.lower),
            number(case.upper)
        );
        let _ = writeln!(text, "attained     {} at {:.6}", of_point(case, errors), self.peak_hertz);
        if floor.value() > 0.0 {
            let reason = if floor.common_shift >= floor.noncausal.unwrap_or(0.0) {
                "no bank is better: a shift of all channels cannot be seen"
            } else {
                "no bank is better at the worst errors"
            };
            let _ = writeln!(text, "floor        {}   {reason}", number(floor.value()));
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
    fn new(bank: &Bank, slopes: Slopes) -> Result<Self, DesignError> {
        let derivatives = uncertainty::delay_derivatives(bank)?;
        let per_second = derivatives.per_fast_period.iter().map(|x| x / bank.fast_period.0).collect();
        Ok(Self { derivatives, per_second, slopes })
    }

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

/// The box, a value per channel for each kind of error.
fn of_box(errors: &ErrorBox) -> String {
    let kinds = kinds(errors, &errors.delays, &errors.gains, &errors.cutoffs);
    let parts: Vec<String> = kinds.map(|(what, values)| format!("{what} ±({values})")).collect();
    if parts.is_empty() { "no errors".to_owned() } else { parts.join(", ") }
}

/// The worst point of a box.
fn of_point(case: &WorstCase, errors: &ErrorBox) -> String {
    let ErrorPoint { delays, gains, cutoffs, .. } = &case.point;
    let parts: Vec<String> = kinds(errors, delays, gains, cutoffs)
        .map(|(what, values)| format!("{what} off by {values}"))
        .collect();
    if parts.is_empty() { "without errors".to_owned() } else { parts.join(", ") }
}

/// Values of the kinds of errors that a box has, with their names.
fn kinds(
    errors: &ErrorBox,
    delays: &[Seconds],
    gains: &[f64],
    cutoffs: &[f64],
) -> impl Iterator<Item = (&'static str, String)> {
    let any = |shares: &[f64]| shares.iter().any(|x| *x > 0.0);
    let delays_differ = errors.delays.iter().any(|x| x.0 > 0.0);
    let all = [
        delays_differ.then(|| ("delays", list(delays, |x| time(x.0)))),
        any(&errors.gains).then(|| ("gains", list(gains, |x| percent(*x)))),
        any(&errors.cutoffs).then(|| ("cut-offs", list(cutoffs, |x| percent(*x)))),
    ];
    all.into_iter().flatten()
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

/// Points per curve; an odd number has the nominal delays among them.
const POINTS: usize = 41;

/// Curves of gamma over the share of the box, from -1 to 1.
pub(super) struct Sweep {
    half_widths: Vec<Seconds>,
    shares: Vec<f64>,
    /// One per channel whose delay is uncertain, then the one through the worst point.
    curves: Vec<Curve>,
}

struct Curve {
    label: String,
    gammas: Vec<f64>,
}

impl Sweep {
    /// Moves each channel alone, and all together towards `worst`.
    pub(super) fn new(bank: &Bank, errors: &ErrorBox, worst: &ErrorPoint) -> Result<Self, DesignError> {
        let shares: Vec<f64> = (0..POINTS).map(|k| 2.0 * k as f64 / (POINTS - 1) as f64 - 1.0).collect();
        let along = |label: String, delays: &[Seconds]| -> Result<Curve, DesignError> {
            let gamma = |share: &f64| {
                let delays = delays.iter().map(|&delay| delay * *share).collect();
                let point = ErrorPoint { delays, ..ErrorPoint::none(bank.channel_count()) };
                norm_at(bank, &point, Taps::Fixed).map(|(gamma, _)| gamma)
            };
            Ok(Curve { label, gammas: shares.iter().map(gamma).collect::<Result<_, _>>()? })
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

    /// Writes the file that `path` names: SVG or PNG if its extension says so, else CSV.
    pub(super) fn write(&self, path: &Path, force: bool) -> Result<(), Failure> {
        let bytes = match PictureFormat::of(path) {
            Some(format) => format.file(&self.chart(), &[]).map_err(Failure::input)?,
            None => self.csv().into_bytes(),
        };
        write_bytes(path, &bytes, force)
    }

    fn csv(&self) -> String {
        let mut text = String::from("share_of_box");
        for curve in &self.curves {
            let _ = write!(text, ",{}", curve.label.replace(", ", " ").replace(' ', "_"));
        }
        text.push('\n');
        for (k, share) in self.shares.iter().enumerate() {
            let _ = write!(text, "{share}");
            for curve in &self.curves {
                let _ = write!(text, ",{}", curve.gammas[k]);
            }
            text.push('\n');
        }
        text
    }

    fn chart(&self) -> Chart {
        let series = |curve: &Curve| Series {
            label: curve.label.clone(),
            points: self.shares.iter().copied().zip(curve.gammas.iter().copied()).collect(),
        };
        let widths: Vec<String> = self.half_widths.iter().map(|half| format!("{:.3e}", half.0)).collect();
        Chart {
            title: "gamma with delays that are not those of the bank".into(),
            x_label: format!("error, in units of the box ({} s)", widths.join(", ")),
            x_scale: AxisScale::Linear,
            y_label: "gamma".into(),
            series: self.curves.iter().map(series).collect(),
        }
    }
}
