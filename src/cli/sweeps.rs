//! gamma against latency and taps: pictures that need further designs.

use crate::bank::Bank;
use crate::design::{DesignError, ProofSearch, design_with};
use crate::overview::Picture;
use crate::plot::{Chart, Series};
use crate::spec::{DesignSpec, Spec};

/// Points of a curve.
const MOST_LATENCIES: usize = 17;
/// Lengths of filters, relative to that of the bank.
const LENGTHS: [f64; 8] = [0.25, 0.35, 0.5, 0.7, 0.85, 1.0, 1.4, 2.0];

/// gamma of the best banks of other latencies, and for FIR banks of other lengths, as real taps for exact
/// channels.
pub(super) fn sweeps(bank: &Bank) -> Result<Vec<Picture>, DesignError> {
    let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
    let design = DesignSpec {
        bits: None,
        fraction_bits: None,
        tracking: None,
        reduction: None,
        ..spec.design.clone()
    };
    let plain = Spec { latency: Some(bank.latency), uncertainty: None, design, ..spec.clone() };
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
    let gamma = design_with(spec, ProofSearch::Skip).ok()?.bank.gamma.norm?;
    (gamma > 0.0).then(|| (at as f64, 20.0 * gamma.log10()))
}

fn chart(title: &str, x_label: &str, points: Vec<(f64, f64)>, bank: &Bank) -> Chart {
    let own = bank.gamma.norm.filter(|gamma| *gamma > 0.0).map(|gamma| 20.0 * gamma.log10());
    // At the same places as the curve, so that it is dashed where it would hide the curve.
    let level = |gamma| points.iter().map(|(x, _)| (*x, gamma)).collect();
    let level = own.map(|gamma| Series { label: "this bank".into(), points: level(gamma) });
    let best = Series { label: "the best of each".into(), points };
    let series = std::iter::once(best).chain(level).collect();
    Chart { title: title.into(), x_label: x_label.into(), y_label: "gamma, dB (h = 1)".into(), series }
}
