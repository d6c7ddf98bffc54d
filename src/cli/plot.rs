//! `hybank plot`: a bank as pictures.

use super::Failure;
use super::bank_file::{begin_file, load, name};
use super::folder::write_together;
use super::say::name_leftovers;
use crate::bank::Bank;
use crate::design::responses::{fir_response, front_end_gains, impulse_responses};
use crate::design::{self, DesignError};
use crate::files::refuse_overlaps;
use crate::plot::{Chart, Series};
use crate::quantity::scale_of;
use crate::units::{Hertz, RadiansPerFastPeriod};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Frequencies of a curve.
const POINTS: usize = 601;
/// Gains below this are drawn there, in decibels.
const FLOOR_DB: f64 = -200.0;
/// Group delays are drawn where the gain is within this many decibels of the largest.
const PASS_BAND_DB: f64 = 60.0;
/// Channels that a picture shows.
const MOST_CHANNELS: usize = 6;

/// Draws the front ends, the filters and the error of a bank
///
/// Writes five pictures (SVG): front-ends, filters, group-delay, impulse-responses and error. The error is
/// the largest gain from the analog input to the error, by frequency modulo the slow rate; its maximum is
/// gamma.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank plot bank.json -o pictures")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// The folder for the pictures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Replace existing pictures
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let bank = load(&args.bank)?;
    let named = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", name(&args.bank)));
    let mut pictures = Vec::new();
    for (file, chart) in charts(&bank).map_err(|error| named(&error))? {
        pictures.push((args.output.join(file), chart.to_svg().map_err(|error| named(&error))?));
    }
    write_all(args, &pictures)?;
    let lines: String = pictures.iter().map(|(path, _)| format!("{}\n", path.display())).collect();
    super::print(&lines)
}

/// The pictures appear together.
fn write_all(args: &Args, pictures: &[(PathBuf, String)]) -> Result<(), Failure> {
    let paths: Vec<&Path> = pictures.iter().map(|(path, _)| path.as_path()).collect();
    refuse_overlaps(&paths, &[&args.bank]).map_err(Failure::input)?;
    name_leftovers(&paths);
    write_together(&args.output, pictures.iter().map(Ok), |(path, text)| {
        begin_file(path, text.as_bytes(), args.force)
    })
}

fn charts(bank: &Bank) -> Result<Vec<(&'static str, Chart)>, DesignError> {
    let responses = impulse_responses(bank)?;
    Ok(vec![
        ("front-ends.svg", front_ends(bank)?),
        ("filters.svg", gains(bank, &responses)),
        ("group-delay.svg", group_delays(bank, &responses)),
        ("impulse-responses.svg", impulses(&responses)),
        ("error.svg", error(bank)?),
    ])
}

fn decibels(gain: f64) -> f64 {
    (20.0 * gain.log10()).max(FLOOR_DB)
}

fn channel(i: usize) -> String {
    format!("channel {}", i + 1)
}

/// The unit of a frequency axis up to `most`, and the factor that brings hertz there.
fn axis(most: Hertz) -> (f64, String) {
    let (factor, unit) = scale_of(most.0, "Hz");
    (factor, format!("frequency, {unit}"))
}

fn nyquist(bank: &Bank) -> Hertz {
    Hertz(0.5 / bank.fast_period.0)
}

fn front_ends(bank: &Bank) -> Result<Chart, DesignError> {
    let all = front_end_gains(bank, POINTS)?;
    let (factor, x_label) = axis(nyquist(bank));
    let curve = |index: usize| Series {
        label: index.checked_sub(1).map_or_else(|| "target".to_owned(), channel),
        points: all.iter().map(|(f, gains)| (f.0 * factor, decibels(gains[index]))).collect(),
    };
    let count = 1 + bank.channel_count().min(MOST_CHANNELS - 1);
    Ok(Chart {
        title: "Front ends".into(),
        x_label,
        y_label: "gain, dB".into(),
        series: (0..count).map(curve).collect(),
    })
}

/// One curve per channel of a function of its response and group delay.
fn by_frequency(
    bank: &Bank,
    responses: &[Vec<f64>],
    value: impl Fn(f64, f64) -> f64,
) -> (String, Vec<Series>) {
    let (factor, x_label) = axis(nyquist(bank));
    let curve = |(i, taps): (usize, &Vec<f64>)| {
        let point = |k: usize| {
            let share = k as f64 / (POINTS - 1) as f64;
            let (response, delay) = fir_response(taps, RadiansPerFastPeriod(PI * share));
            (share * nyquist(bank).0 * factor, value(response.norm(), delay))
        };
        Series { label: channel(i), points: (0..POINTS).map(point).collect() }
    };
    (x_label, responses.iter().enumerate().take(MOST_CHANNELS).map(curve).collect())
}

fn gains(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let (x_label, series) = by_frequency(bank, responses, |gain, _| decibels(gain));
    Chart { title: "Synthesis filters".into(), x_label, y_label: "gain, dB".into(), series }
}

fn group_delays(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let (_, gains) = by_frequency(bank, responses, |gain, _| gain);
    let largest = gains.iter().flat_map(|curve| &curve.points).map(|point| point.1).fold(0.0, f64::max);
    let least = largest * 10f64.powf(-PASS_BAND_DB / 20.0);
    let delay = |gain: f64, delay: f64| if gain >= least { delay } else { f64::NAN };
    let (x_label, series) = by_frequency(bank, responses, delay);
    let y_label = "group delay, fast samples".to_owned();
    Chart { title: "Synthesis filters, where they pass".into(), x_label, y_label, series }
}

fn impulses(responses: &[Vec<f64>]) -> Chart {
    let curve = |(i, taps): (usize, &Vec<f64>)| Series {
        label: channel(i),
        points: taps.iter().enumerate().map(|(n, tap)| (n as f64, *tap)).collect(),
    };
    Chart {
        title: "Impulse responses of the synthesis filters".into(),
        x_label: "fast samples".into(),
        y_label: "tap".into(),
        series: responses.iter().enumerate().take(MOST_CHANNELS).map(curve).collect(),
    }
}

fn error(bank: &Bank) -> Result<Chart, DesignError> {
    let response = design::error_response(bank, POINTS)?;
    let (factor, x_label) = axis(Hertz(0.5 / bank.slow_period().0));
    let mut series = vec![Series {
        label: "error".into(),
        points: response.iter().map(|(f, gain)| (f.0 * factor, decibels(*gain))).collect(),
    }];
    let ends = [Hertz(0.0), Hertz(0.5 / bank.slow_period().0)];
    for (label, bound) in [("gamma, upper bound", bank.gamma.upper), ("lower bound", bank.gamma.lower)] {
        series.extend(bound.filter(|bound| *bound > 0.0).map(|bound| Series {
            label: label.into(),
            points: ends.iter().map(|f| (f.0 * factor, decibels(bound))).collect(),
        }));
    }
    let title = "Largest gain from the analog input to the error".to_owned();
    Ok(Chart {
        title,
        x_label: x_label + ", modulo the slow rate",
        y_label: "gain, dB (h = 1)".into(),
        series,
    })
}
