//! Figures 5.8 to 5.14: analysis filters, synthesis filters, the error beside the signal, the norm.

use crate::signals::{STEP, Signal};
use crate::{Banks, Figure, Outcome};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::error_response;
use hybank::design::responses::{analysis_gains, fir_response, front_end_gains, impulse_responses};
use hybank::plot::{Chart, Series};
use hybank::units::{Hertz, RadiansPerFastPeriod};
use std::f64::consts::{PI, TAU};

/// Frequencies of a curve.
const POINTS: usize = 401;
const FREQUENCY: &str = "frequency, radians per fast sample";

pub(super) fn figures(banks: &Banks) -> Outcome<Vec<Figure>> {
    let (iir, fir) = (&banks.iir, &banks.fir);
    let order = states(iir);
    let ((iir_error, iir_most), (fir_error, fir_most)) =
        (error_beside_signal(iir)?, error_beside_signal(fir)?);
    let own_phi =
        "The thesis has another Phi here, which our sources do not give; this is the Phi of its FIR example.";
    Ok(vec![
        Figure {
            number: "5.8",
            title: "IIR example: front end and norm-equivalent analysis filters",
            charts: vec![analysis(iir)?],
            thesis: own_phi,
            found: "All three filters are alike, so their row norms are one curve: Phi with its aliases."
                .into(),
        },
        Figure {
            number: "5.9",
            title: "IIR example: synthesis filters",
            charts: synthesis(iir)?.to_vec(),
            thesis: "Filters of order 28, ||K|| about 4.68 %, for a Phi that our sources do not give.",
            found: format!("gamma {}, a block filter of {order} states.", percent(iir)),
        },
        Figure {
            number: "5.10",
            title: "IIR example: error beside the wanted signal, step at 0.3",
            charts: vec![iir_error],
            thesis: own_phi,
            found: format!("The signal rises to 1, and the error is at most {iir_most:.1e}."),
        },
        Figure {
            number: "5.11",
            title: "FIR example: front end and norm-equivalent analysis filters",
            charts: vec![analysis(fir)?],
            thesis: "Phi(s) = 0.25 / (s + 0.5)^2, h = 1, M = N = 2, m0 = 10, delays 1.2 and 0.6.",
            found: "As figure 5.8, which has the same Phi here.".into(),
        },
        Figure {
            number: "5.12",
            title: "FIR example: synthesis filters",
            charts: synthesis(fir)?.to_vec(),
            thesis: "n = 10 slow samples of memory: 22 taps per channel.",
            found: format!("gamma {} with 22 taps per channel.", percent(fir)),
        },
        Figure {
            number: "5.13",
            title: "FIR example: error beside the wanted signal, step at 0.3",
            charts: vec![fir_error],
            thesis: "The same example; our sources give no number.",
            found: format!("The signal rises to 1, and the error is at most {fir_most:.1e}."),
        },
        Figure {
            number: "5.14",
            title: "Largest singular value of the error system by frequency",
            charts: vec![error(banks)?],
            thesis: "||K|| is about 4 %.",
            found: format!("gamma {}; no bank is below {}.", percent(fir), noncausal(fir)),
        },
    ])
}

fn percent(bank: &Bank) -> String {
    bank.gamma.norm.map_or_else(|| "unknown".into(), |gamma| format!("{:.4} %", 100.0 * gamma))
}

fn noncausal(bank: &Bank) -> String {
    bank.gamma.noncausal.map_or_else(|| "an unknown bound".into(), |gamma| format!("{:.4} %", 100.0 * gamma))
}

fn decibels(gain: f64) -> f64 {
    20.0 * gain.log10()
}

fn frequency(k: usize) -> f64 {
    PI * k as f64 / (POINTS - 1) as f64
}

/// |Phi| and the row norms of the norm-equivalent H_i. H_i itself depends on the choice of a square
/// root, its row norm does not.
fn analysis(bank: &Bank) -> Outcome<Chart> {
    let frequencies: Vec<Hertz> = (0..POINTS).map(|k| Hertz(frequency(k) / TAU)).collect();
    let analog = front_end_gains(bank, &frequencies)?;
    let equivalent = analysis_gains(bank, &frequencies)?;
    let curve = |all: &[Vec<f64>], index: usize| {
        frequencies.iter().zip(all).map(|(f, gains)| (TAU * f.0, decibels(gains[index]))).collect()
    };
    let mut curves = vec![("front end Phi".to_owned(), curve(&analog, 0))];
    curves.extend((0..=bank.channel_count()).map(|i| (format!("H_{i}"), curve(&equivalent, i))));
    Ok(chart("Front end and equivalent analysis filters", FREQUENCY, "gain, dB", curves))
}

/// Magnitude and phase of F_1 and F_2.
fn synthesis(bank: &Bank) -> Outcome<[Chart; 2]> {
    let responses = impulse_responses(bank);
    let curve = |value: &dyn Fn(&[f64]) -> Vec<f64>| {
        let points =
            |taps: &Vec<f64>| value(taps).into_iter().enumerate().map(|(k, y)| (frequency(k), y)).collect();
        let curves = responses.iter().zip(1..).map(|(taps, i)| (format!("F_{i}"), points(taps)));
        curves.collect::<Vec<_>>()
    };
    let at = |taps: &[f64], k: usize| fir_response(taps, RadiansPerFastPeriod(frequency(k))).0;
    let gains = |taps: &[f64]| (0..POINTS).map(|k| decibels(at(taps, k).norm())).collect();
    let phases = |taps: &[f64]| unwrapped((0..POINTS).map(|k| at(taps, k).arg()));
    Ok([
        chart("Synthesis filters: magnitude", FREQUENCY, "gain, dB", curve(&gains)),
        chart("Synthesis filters: phase", FREQUENCY, "phase, rad", curve(&phases)),
    ])
}

/// Phases without jumps of whole turns.
fn unwrapped(phases: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last = 0.0;
    let next = |phase: f64| {
        last = phase + TAU * ((last - phase) / TAU).round();
        last
    };
    phases.map(next).collect()
}

/// The chart, and the largest error.
fn error_beside_signal(bank: &Bank) -> Outcome<(Chart, f64)> {
    let signal = Signal::capture(STEP)?;
    let error = signal.error(bank)?;
    let curve = |samples: &[f64]| samples.iter().take(50).enumerate().map(|(n, y)| (n as f64, *y)).collect();
    let curves =
        vec![("wanted y_0".to_owned(), curve(signal.target())), ("error e".to_owned(), curve(&error))];
    let most = error.iter().fold(0.0, |most: f64, e| most.max(e.abs()));
    Ok((chart("Error beside the wanted signal", "fast sample", "amplitude", curves), most))
}

fn error(banks: &Banks) -> Outcome<Chart> {
    let curve = |bank: &Bank| -> Outcome<Vec<(f64, f64)>> {
        let response = error_response(bank, POINTS)?;
        // From hertz at h = 1 s, M = 2, to radians per slow sample.
        Ok(response.iter().map(|(f, gain)| (TAU * 2.0 * f.0, *gain)).collect())
    };
    let curves =
        vec![("FIR, 22 taps".to_owned(), curve(&banks.fir)?), ("IIR".to_owned(), curve(&banks.iir)?)];
    Ok(chart(
        "Largest gain from the input to the error",
        "frequency, radians per slow sample",
        "gain",
        curves,
    ))
}

/// A chart of named curves.
pub(super) fn chart(title: &str, x: &str, y: &str, curves: Vec<(String, Vec<(f64, f64)>)>) -> Chart {
    let series = curves.into_iter().map(|(label, points)| Series { label, points }).collect();
    Chart { title: title.into(), x_label: x.into(), y_label: y.into(), series, ..Chart::default() }
}

/// States of a recursive bank.
fn states(bank: &Bank) -> usize {
    match &bank.filters {
        SynthesisFilters::StateSpace(block) => block.a.len(),
        SynthesisFilters::Fir(_) => 0,
    }
}
