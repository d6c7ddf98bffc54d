//! The edges of a front end's band.

use super::StableFilter;
use hybank_core::units::RadiansPerFastPeriod;

/// Frequencies per decade on which the edges are searched.
const PER_DECADE: f64 = 100.0;
/// Halvings of the interval around an edge.
const HALVINGS: usize = 50;

impl StableFilter {
    /// The band within 3 dB of the largest gain.
    pub fn half_power_band(&self) -> [RadiansPerFastPeriod; 2] {
        let gain = |w: f64| self.response(RadiansPerFastPeriod(w)).norm();
        let frequencies = self.searched();
        let level = frequencies.iter().map(|&w| gain(w)).fold(gain(0.0), f64::max) * 0.5_f64.sqrt();
        let passes = |w: f64| gain(w) >= level;
        let first = frequencies.iter().position(|&w| passes(w)).unwrap_or(0);
        let last = frequencies.iter().rposition(|&w| passes(w)).unwrap_or(0);
        let below = if passes(0.0) { None } else { first.checked_sub(1) };
        let low = match below {
            Some(below) => edge(passes, frequencies[first], frequencies[below]),
            None => 0.0,
        };
        let high = match frequencies.get(last + 1) {
            Some(&above) => edge(passes, frequencies[last], above),
            None => frequencies[last],
        };
        [low, high].map(RadiansPerFastPeriod)
    }

    /// Frequencies from far below the slowest pole to far above the fastest, and those of the poles.
    fn searched(&self) -> Vec<f64> {
        let sizes: Vec<f64> = self.poles().iter().map(|pole| pole.norm()).collect();
        let slowest = 1e-3 * sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let decades = (1e3 * sizes.iter().copied().fold(0.0, f64::max) / slowest).log10();
        let count = (PER_DECADE * decades).ceil() as usize;
        let mut frequencies: Vec<f64> =
            (0..=count).map(|k| slowest * 10f64.powf(k as f64 / PER_DECADE)).chain(sizes).collect();
        frequencies.sort_by(f64::total_cmp);
        frequencies
    }
}

/// Where `passes` ends between a frequency `inside` the band and one `outside` it.
fn edge(passes: impl Fn(f64) -> bool, mut inside: f64, mut outside: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = (inside * outside).sqrt();
        *if passes(middle) { &mut inside } else { &mut outside } = middle;
    }
    outside
}

#[cfg(test)]
mod tests {
    use crate::analog::StrictlyProper;
    use hybank_core::spec::{Family, FilterSpec, Passband};
    use hybank_core::units::{Hertz, Seconds};
    use std::f64::consts::TAU;

    fn upper_edge(filter: &FilterSpec) -> f64 {
        StrictlyProper::new(filter, Seconds(1.0)).unwrap().half_power_band()[1].0
    }

    #[test]
    fn butterworth_filters_have_it_at_their_cutoff() {
        for order in [1, 4, 11] {
            for cutoff in [1e-6, 0.03, 700.0] {
                let filter = FilterSpec::Family {
                    family: Family::Butterworth,
                    order: Some(order),
                    passband: Passband::LowPass { cutoff: Hertz(cutoff) },
                    ripple_db: None,
                    attenuation_db: None,
                };
                assert!((upper_edge(&filter) / (TAU * cutoff) - 1.0).abs() < 1e-9, "{order} {cutoff}");
            }
        }
    }

    /// s / (s^2 + s/q + 1) has its edges at w = (sqrt(1 + 4 q^2) +- 1) / (2 q).
    #[test]
    fn band_passes_have_both_edges() {
        for q in [0.5, 3.0, 1e4] {
            let filter = FilterSpec::TransferFunction { num: vec![1.0, 0.0], den: vec![1.0, 1.0 / q, 1.0] };
            let band = StrictlyProper::new(&filter, Seconds(1.0)).unwrap().half_power_band();
            let want = [-1.0, 1.0].map(|sign| ((1.0 + 4.0 * q * q).sqrt() + sign) / (2.0 * q));
            for (found, want) in band.map(|w| w.0).into_iter().zip(want) {
                assert!((found / want - 1.0).abs() < 1e-9, "{q}: {found} {want}");
            }
        }
    }
}
