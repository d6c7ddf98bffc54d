//! The figures of a measurement as text.

use hybank::measure::{Comparison, Imbalance, Measurement, Quadrature, Spur};
use hybank::messages::Quoted;
use hybank::overview::{Figure, causes, column};
use hybank::quantity::readable;
use std::fmt::Write as _;

/// Spurs that the text lists.
const MOST_SPURS: usize = 20;

/// What the command found.
#[derive(Debug, serde::Serialize)]
pub(super) struct Report {
    pub(super) file: String,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub(super) measurement: Option<Measurement>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) reference: Option<ReferenceReport>,
    pub(super) warnings: Vec<String>,
}

/// The comparison with a reference.
#[derive(Debug, serde::Serialize)]
pub(super) struct ReferenceReport {
    pub(super) file: String,
    #[serde(flatten)]
    pub(super) comparison: Comparison,
}

/// What the user should know beside the figures.
pub(super) fn warnings(measured: &Measurement) -> Vec<String> {
    let mut warnings = Vec::new();
    if measured.clipped > 0 {
        warnings.push(format!(
            "{} of {} samples are at the limits of the range; SINAD and THD contain their distortion, so lower the level if it is not meant",
            measured.clipped, measured.samples
        ));
    }
    if measured.left_out > 0 {
        warnings.push(format!(
            "{} of {} samples are NaN or infinite and were left out",
            measured.left_out, measured.samples
        ));
    }
    if !measured.hidden.is_empty() {
        let names: Vec<String> = measured.hidden.iter().map(ToString::to_string).collect();
        warnings.push(format!(
            "these spurs fall on the tone, on the constant or on half the rate and cannot be seen: {}; choose another frequency to see them",
            names.join("; ")
        ));
    }
    if let Some(ends) = measured.unsettled_ends {
        warnings.push(format!(
            "the first and the last {} samples raise the noise by {:.1} dB or more: a filter may not have settled there; --skip {} leaves them out",
            ends.samples, ends.raise.0, ends.samples
        ));
    }
    warnings
}

impl Report {
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        if let Some(measured) = &self.measurement {
            write_measurement(&mut text, measured);
        }
        if let Some(reference) = &self.reference {
            write_comparison(&mut text, &reference.file, &reference.comparison);
        }
        text
    }
}

fn write_measurement(text: &mut String, measured: &Measurement) {
    for tone in &measured.tones {
        let _ = writeln!(
            text,
            "tone             {:.6} ± {:.2e} Hz, amplitude {:.6} ({:.2} dBFS)",
            tone.frequency.value.0, tone.frequency.sigma.0, tone.amplitude.value, tone.level.0
        );
        if (tone.alias - tone.frequency.value).0.abs() > 0.5 * measured.rate.0 / measured.samples as f64 {
            let _ = writeln!(text, "                 seen at {:.6}", tone.alias);
        }
    }
    let _ = writeln!(
        text,
        "offset           {} ± {:.2e}",
        six_decimals(measured.offset.value),
        measured.offset.sigma
    );
    if let Some(quadrature) = &measured.quadrature {
        write_quadrature(text, quadrature);
    }
    for Figure { name, value, unit, meaning } in column(measured) {
        let _ = writeln!(text, "{name:<16} {value:>9} {unit:<7}   {meaning}");
    }
    write_spurs(text, measured);
}

/// Of complex recordings.
fn write_quadrature(text: &mut String, quadrature: &Quadrature) {
    let Quadrature { offset, imbalances } = quadrature;
    let _ = writeln!(text, "offset, imag.    {} ± {:.2e}", six_decimals(offset.value), offset.sigma);
    for Imbalance { gain, phase, image_rejection } in imbalances {
        let _ = writeln!(
            text,
            "I/Q imbalance    gain {:.6} ± {:.1e}, phase {:.4} ± {:.1e} degrees, image rejection {:.2} dB",
            gain.value,
            gain.sigma,
            phase.value.0.to_degrees(),
            phase.sigma.0.to_degrees(),
            image_rejection.0
        );
    }
}

fn write_spurs(text: &mut String, measured: &Measurement) {
    let above: Vec<&Spur> = measured.spurs.iter().filter(|spur| spur.above_noise).collect();
    let _ = match above.len() {
        0 => writeln!(text, "no spur above the noise"),
        _ => writeln!(text, "\nspurs above the noise (Hz, dBc, cause):"),
    };
    for spur in above.iter().take(MOST_SPURS) {
        let _ = writeln!(text, "{:>18.3} {:>8.2}   {}", spur.frequency.0, spur.level.0, causes(spur));
    }
    if above.len() > MOST_SPURS {
        let _ = writeln!(text, "  and {} smaller ones (--json lists all)", above.len() - MOST_SPURS);
    }
}

/// Six digits after the point; a zero has no sign.
fn six_decimals(value: f64) -> String {
    let text = format!("{value:.6}");
    if text == "-0.000000" { "0.000000".to_owned() } else { text }
}

fn write_comparison(text: &mut String, file: &str, found: &Comparison) {
    let _ = writeln!(
        text,
        "{}against {}, {} samples:",
        if text.is_empty() { "" } else { "\n" },
        Quoted(file),
        found.compared
    );
    if let Some(ends) = &found.unsettled_ends {
        let _ = writeln!(
            text,
            "ends             {} more samples at either end are left out: something has not settled there, and they \
             raise the error by {:.1} dB",
            ends.samples, ends.raise.0
        );
    }
    let _ = writeln!(
        text,
        "lag              {} ± {:.1e} samples ({})",
        six_decimals(found.lag_samples.value),
        found.lag_samples.sigma,
        readable(found.lag.0 + 0.0, "s")
    );
    let _ = writeln!(text, "gain             {:.8} ± {:.1e}", found.gain.value, found.gain.sigma);
    let _ = writeln!(text, "offset           {:.3e} ± {:.1e}", found.offset.value, found.offset.sigma);
    let _ = writeln!(
        text,
        "SNR              {:.2} dB   reference over error, lag, gain and offset taken out",
        found.snr.0
    );
    let _ = writeln!(
        text,
        "SNR, unaligned   {:.2} dB   sample by sample, nothing taken out",
        found.snr_unaligned.0
    );
    let _ = writeln!(
        text,
        "error            {:.3e} rms, at most {:.3e} (sample {})",
        found.error_rms, found.largest_error, found.largest_error_at
    );
}
