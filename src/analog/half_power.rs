//! The edge of a front end's band.

use super::StrictlyProper;
use crate::units::RadiansPerFastPeriod;

/// Frequencies per decade on which the edge is searched.
const PER_DECADE: f64 = 100.0;
/// Halvings of the interval around the edge.
const HALVINGS: usize = 50;

impl StrictlyProper {
    /// The highest frequency at which |Phi'| is 3 dB below its largest value: the -3 dB frequency of a
    /// low-pass, the upper one of a band-pass.
    pub fn half_power_frequency(&self) -> RadiansPerFastPeriod {
        let gain = |w: f64| self.response(RadiansPerFastPeriod(w)).norm();
        let frequencies = self.searched();
        let level = frequencies.iter().map(|&w| gain(w)).fold(gain(0.0), f64::max) * 0.5_f64.sqrt();
        let last = frequencies.iter().rposition(|&w| gain(w) >= level).unwrap_or(0);
        let Some(&above) = frequencies.get(last + 1) else {
            return RadiansPerFastPeriod(frequencies[last]);
        };
        let (mut low, mut high) = (frequencies[last], above);
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if gain(middle) >= level { low = middle } else { high = middle }
        }
        RadiansPerFastPeriod(high)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{Family, FilterSpec};
    use crate::units::{Hertz, Seconds};
    use std::f64::consts::TAU;

    fn edge(filter: &FilterSpec) -> f64 {
        StrictlyProper::new(filter, Seconds(1.0)).unwrap().half_power_frequency().0
    }

    #[test]
    fn butterworth_filters_have_it_at_their_cutoff() {
        for order in [1, 4, 11] {
            for cutoff in [1e-6, 0.03, 700.0] {
                let filter = FilterSpec::Family {
                    family: Family::Butterworth,
                    order: Some(order),
                    cutoff: Hertz(cutoff),
                    ripple_db: None,
                    attenuation_db: None,
                };
                assert!((edge(&filter) / (TAU * cutoff) - 1.0).abs() < 1e-9, "{order} {cutoff}");
            }
        }
    }

    /// s / (s^2 + s/q + 1) has its edges at w = (sqrt(1 + 4 q^2) +- 1) / (2 q).
    #[test]
    fn band_passes_have_the_upper_edge() {
        for q in [0.5, 3.0, 1e4] {
            let filter = FilterSpec::TransferFunction { num: vec![1.0, 0.0], den: vec![1.0, 1.0 / q, 1.0] };
            let want = ((1.0 + 4.0 * q * q).sqrt() + 1.0) / (2.0 * q);
            assert!((edge(&filter) / want - 1.0).abs() < 1e-9, "{q}: {} {want}", edge(&filter));
        }
    }
}
