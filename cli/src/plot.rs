//! `hybank plot`: a bank as pictures, and the files of pictures.

use super::bank_file::load;
use super::print::{Failure, InFile, print};
use super::written::{begin_file, check_folder, check_outputs, write_bytes, write_together};
use hybank::bank::Bank;
use hybank::design::{DesignError, DesignOptions, design};
use hybank::messages::Quoted;
use hybank::overview::{Picture, pictures};
use hybank::plot::{Chart, Series};
use hybank::spec::{DesignSpec, Spec};
use std::path::{Path, PathBuf};

/// Draws the front ends, the filters and the error of a bank
///
/// Writes nine pictures: tones, front-ends, analysis, filters, phase, group-delay, impulse-responses, error
/// and delay-error. The first one shows the largest image and the error of gain of a tone, by its
/// frequency. The error is the largest gain from the signal's source to the error, by frequency modulo the
/// slow rate; its maximum is gamma.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank plot bank.json -o pictures
  hybank plot bank.json -o pictures --sweeps --force")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// The folder for the pictures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Draw gamma against latency too, and for FIR banks against taps. This designs some twenty further
    /// banks
    #[arg(long)]
    sweeps: bool,
    /// Replace existing pictures
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    check_folder(&args.output)?;
    let bank = load(&args.bank)?;
    let mut all = pictures(&bank).in_file(&args.bank)?;
    if args.sweeps {
        all.extend(sweeps(&bank).in_file(&args.bank)?);
    }
    let mut files = Vec::new();
    for Picture { name, chart, .. } in all {
        let picture = chart.to_svg().in_file(&args.bank)?.into_bytes();
        files.push((args.output.join(format!("{name}.svg")), picture));
    }
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    check_outputs(&paths, &[&args.bank])?;
    write_together(&args.output, files.iter().map(Ok), |(path, bytes)| {
        Ok(vec![begin_file(path, bytes, args.force)?])
    })?;
    let lines: String = paths.iter().map(|path| format!("{}\n", path.display())).collect();
    print(&lines)
}

pub(super) fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"))
}

/// Refuses the name of a picture that promises another format than SVG.
pub(super) fn check_picture(path: &Path) -> Result<(), Failure> {
    if path.extension().is_none() || is_svg(path) {
        return Ok(());
    }
    let (name, svg) = (Quoted(path), Quoted(path.with_extension("svg")));
    Err(Failure::Usage(format!("{name}: pictures are written as SVG; name it {svg}")))
}

/// Writes a picture as SVG.
pub(super) fn write_picture(path: &Path, chart: &Chart, force: bool) -> Result<(), Failure> {
    write_bytes(path, chart.to_svg().in_file(path)?.as_bytes(), force)
}

/// Points of a curve.
const MOST_LATENCIES: usize = 17;
/// Lengths of filters, relative to that of the bank.
const LENGTHS: [f64; 8] = [0.25, 0.35, 0.5, 0.7, 0.85, 1.0, 1.4, 2.0];

/// gamma of the best banks of other latencies, and for FIR banks of other lengths, as real taps for exact
/// channels.
fn sweeps(bank: &Bank) -> Result<Vec<Picture>, DesignError> {
    let spec = bank.sized_spec().ok_or(DesignError::NoSpec)?;
    let design = DesignSpec {
        bits: None,
        fraction_bits: None,
        order: None,
        reduction_loss_db: None,
        ..spec.design.clone()
    };
    let plain = Spec { uncertainty: None, design, ..spec.clone() };
    let mut pictures = vec![Picture {
        name: "latency",
        caption: "gamma of the best bank of each latency. More latency lets the filters see later samples.",
        chart: chart("gamma and latency", "latency, fast samples", by_latency(bank, &plain), bank),
    }];
    if let Some(taps) = spec.design.taps {
        pictures.push(Picture {
            name: "taps",
            caption: "gamma of the best filters of each length, at the latency of the bank.",
            chart: chart("gamma and taps", "taps per channel", by_taps(taps, &plain), bank),
        });
    }
    Ok(pictures)
}

fn by_latency(bank: &Bank, plain: &Spec) -> Vec<(f64, f64)> {
    let most = 2 * bank.latency + 2 * bank.ratio;
    let step = most.div_ceil(MOST_LATENCIES - 1).max(1);
    // The bank's own latency is one of them.
    let latencies = (bank.latency % step..=most).step_by(step);
    latencies.filter_map(|m| point(m, &Spec { latency: Some(m), ..plain.clone() })).collect()
}

fn by_taps(taps: usize, plain: &Spec) -> Vec<(f64, f64)> {
    let mut lengths = LENGTHS.map(|share| ((share * taps as f64).round() as usize).max(1)).to_vec();
    lengths.dedup();
    let of = |taps: usize| DesignSpec { taps: Some(taps), ..plain.design.clone() };
    lengths.into_iter().filter_map(|taps| point(taps, &Spec { design: of(taps), ..plain.clone() })).collect()
}

/// gamma of a design in decibels; none where there is no such bank, as for latencies that the taps do not
/// reach.
fn point(at: usize, spec: &Spec) -> Option<(f64, f64)> {
    let gamma = design(spec, &DesignOptions::without_proof()).ok()?.bank.gamma.norm?;
    (gamma > 0.0).then(|| (at as f64, 20.0 * gamma.log10()))
}

fn chart(title: &str, x_label: &str, points: Vec<(f64, f64)>, bank: &Bank) -> Chart {
    let own = bank.gamma.norm.filter(|gamma| *gamma > 0.0).map(|gamma| 20.0 * gamma.log10());
    // At the same places as the curve, so that it is dashed where it would hide the curve.
    let level = |gamma| points.iter().map(|(x, _)| (*x, gamma)).collect();
    let level = own.map(|gamma| Series { label: "this bank".into(), points: level(gamma) });
    let best = Series { label: "the best of each".into(), points };
    Chart::lines(title, x_label, "gamma, dB (h = 1)", std::iter::once(best).chain(level).collect())
}
