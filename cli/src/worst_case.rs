//! The worst case over a box of errors, as text, as JSON, as CSV and as a picture.

use super::design_studies::number;
use super::plot::PictureFormat;
use super::print::Failure;
use super::written::write_bytes;
use hybank::design::uncertainty::{
    Affordable, BoxStudy, ErrorStudy, JitterStudy, Sensitivity, Sweep, SweepCurve,
};
use hybank::plot::{AxisScale, Chart, Series};
use hybank::quantity::readable;
use hybank::units::Seconds;
use hybank::verify::uncertainty::{ErrorBox, ErrorPoint, WorstCase};
use std::fmt::Write;
use std::path::Path;

/// Lines for people.
pub(super) fn text(study: &ErrorStudy) -> String {
    let mut text = String::new();
    if let Some(worst) = &study.worst_case {
        write_worst(&mut text, worst);
    }
    if let Some(JitterStudy { added, jitter }) = &study.jitter {
        let most = jitter.iter().map(|x| x.0).fold(0.0, f64::max);
        let what = if added.is_finite() {
            format!(
                "+{}   at most, by instants that are off by up to {}, differently at each sample",
                number(*added),
                time(most)
            )
        } else {
            "unbounded     a front end of relative degree 1 passes steps, whose instant decides the sample"
                .to_owned()
        };
        let _ = writeln!(text, "jitter       {what}");
    }
    if let Some(sensitivity) = &study.sensitivity {
        write_sensitivity(&mut text, sensitivity);
    }
    text
}

fn write_worst(text: &mut String, worst: &BoxStudy) {
    let BoxStudy { case, floor, errors, .. } = worst;
    let width = 100.0 * (case.upper / case.lower - 1.0);
    let _ = writeln!(text, "box          {}", of_box(errors));
    let _ = writeln!(
        text,
        "worst case   {} to {}   both ends proven, {width:.2} % apart",
        number(case.lower),
        number(case.upper)
    );
    let _ = writeln!(text, "attained     {} at {:.6}", of_point(case, errors), worst.peak_hertz);
    if floor.value() > 0.0 {
        let reason = if floor.common_shift >= floor.noncausal.unwrap_or(0.0) {
            "no bank is better: a shift of all channels cannot be seen"
        } else {
            "no bank is better at the worst errors"
        };
        let _ = writeln!(text, "floor        {}   {reason}", number(floor.value()));
    }
    if let Some(Affordable { loss, factor, errors }) = &worst.affordable {
        let share = 100.0 * loss;
        let line = if *factor > 0.0 {
            format!("{} costs at most {share} % of gamma (proven; {factor:.3e} of the box)", of_box(errors))
        } else {
            format!("no part of the box is proven to cost {share} % of gamma or less")
        };
        let _ = writeln!(text, "accuracy     {line}");
    }
}

fn write_sensitivity(text: &mut String, found: &Sensitivity) {
    let Sensitivity { derivatives, slopes, .. } = found;
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

/// Writes the file that `path` names: SVG or PNG if its extension says so, else CSV.
pub(super) fn write_sweep(sweep: &Sweep, path: &Path, force: bool) -> Result<(), Failure> {
    let bytes = match PictureFormat::of(path) {
        Some(format) => format.file(&chart(sweep), &[]).map_err(Failure::input)?,
        None => csv(sweep).into_bytes(),
    };
    write_bytes(path, &bytes, force)
}

fn csv(sweep: &Sweep) -> String {
    let mut text = String::from("share_of_box");
    for curve in &sweep.curves {
        let _ = write!(text, ",{}", curve.label.replace(", ", " ").replace(' ', "_"));
    }
    text.push('\n');
    for (k, share) in sweep.shares.iter().enumerate() {
        let _ = write!(text, "{share}");
        for curve in &sweep.curves {
            let _ = write!(text, ",{}", curve.gammas[k]);
        }
        text.push('\n');
    }
    text
}

fn chart(sweep: &Sweep) -> Chart {
    let series = |curve: &SweepCurve| Series {
        label: curve.label.clone(),
        points: sweep.shares.iter().copied().zip(curve.gammas.iter().copied()).collect(),
    };
    let widths: Vec<String> = sweep.half_widths.iter().map(|half| format!("{:.3e}", half.0)).collect();
    Chart {
        title: "gamma with delays that are not those of the bank".into(),
        x_label: format!("error, in units of the box ({} s)", widths.join(", ")),
        x_scale: AxisScale::Linear,
        y_label: "gamma".into(),
        series: sweep.curves.iter().map(series).collect(),
    }
}
