//! The response of a front end to an analytic source at arbitrary instants.
//!
//! x(t + l) = e^{A l} x(t) + int_0^l e^{A (l - s)} B f(t + s) ds. A panel is so short that the exponents
//! change by one at most: then series of [`TERMS`] terms give the exponentials, and a Gauss-Legendre rule
//! gives the integral, both to rounding. No matrix depends on l, so panels of any length cost the same.

use super::source::{NormalisedSource, Source};
use crate::analog::StrictlyProper;
use crate::linalg::Mat;
use crate::units::FastPeriods;
use nalgebra::DVector;
use std::ops::Range;

/// 1 / 19! is below the rounding error.
const TERMS: usize = 19;
/// Most panels between two instants, so that every call ends; callers ask `panels` beforehand.
const MOST_PANELS: f64 = 1e6;
/// Sixteen-point Gauss-Legendre rule on [0, 1]: abscissae below one half (the others mirror them) and
/// weights (Abramowitz & Stegun, table 25.4). On a panel it is exact to rounding.
const HALF_NODES: [(f64, f64); 8] = [
    (0.005299532504175031, 0.013576229705877088),
    (0.0277124884633837, 0.031126761969323728),
    (0.06718439880608412, 0.0475792558412463),
    (0.1222977958224985, 0.062314485627767036),
    (0.19106187779867811, 0.07479799440828835),
    (0.2709916111713863, 0.08457825969750132),
    (0.35919822461037054, 0.09130170752246182),
    (0.4524937450811813, 0.09472530522753432),
];

/// (phi * f)(t) at the given instants in any order, accurate to rounding.
///
/// A tone costs one complex exponential at each instant; steps and chirps a panel for each instant, and
/// otherwise as many as [`sample`](super::sample) takes.
pub fn sample_at(filter: &StrictlyProper, source: &NormalisedSource, times: &[FastPeriods]) -> Vec<f64> {
    match source {
        Source::Tones(tones) => {
            let phasors: Vec<_> = tones.iter().map(|tone| (tone.omega.0, tone.response(filter))).collect();
            let value = |t: &FastPeriods| {
                phasors.iter().map(|(w, p)| p.re * (w * t.0).cos() - p.im * (w * t.0).sin()).sum()
            };
            times.iter().map(value).collect()
        }
        Source::Sum(terms) => sum(times.len(), terms.iter().map(|term| sample_at(filter, term, times))),
        Source::Step { at, .. } => walk(filter, source, at.0..f64::INFINITY, 0.0, times),
        Source::Chirp { length, start, end, .. } => {
            walk(filter, source, 0.0..length.0, start.0.abs().max(end.0.abs()), times)
        }
    }
}

/// The sum of the samples of several terms.
pub(super) fn sum(count: usize, terms: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
    let mut total = vec![0.0; count];
    terms.for_each(|term| total.iter_mut().zip(term).for_each(|(sum, x)| *sum += x));
    total
}

/// Panels of the quadrature per fast period, for a source with no frequency above `band` (cycles per fast
/// period).
pub(super) fn panel_rate(filter: &StrictlyProper, band: f64) -> f64 {
    (filter.a().norm() + std::f64::consts::TAU * band).max(f64::MIN_POSITIVE)
}

/// Follows the state from the beginning of the source's `support` through the instants in their order. The
/// source has no frequency above `band` (cycles per fast period) within its support.
fn walk(
    filter: &StrictlyProper,
    source: &NormalisedSource,
    support: Range<f64>,
    band: f64,
    times: &[FastPeriods],
) -> Vec<f64> {
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&a, &b| times[a].0.total_cmp(&times[b].0));
    let mut walker = Walker::new(filter, source, support, panel_rate(filter, band));
    let mut output = vec![0.0; times.len()];
    for index in order {
        walker.go_to(times[index].0);
        output[index] = walker.output();
    }
    output
}

/// The state of a front end at a moving instant.
struct Walker<'a> {
    source: &'a NormalisedSource,
    support: Range<f64>,
    /// Panels per fast period.
    rate: f64,
    now: f64,
    state: DVector<f64>,
    /// A / rate.
    a: Mat,
    /// (A / rate)^m B / m!.
    inputs: Vec<DVector<f64>>,
    c: &'a Mat,
}

impl<'a> Walker<'a> {
    /// At rest at the beginning of the support.
    fn new(filter: &'a StrictlyProper, source: &'a NormalisedSource, support: Range<f64>, rate: f64) -> Self {
        let a = filter.a() / rate;
        let mut inputs = vec![filter.b().column(0).into_owned()];
        for m in 1..TERMS {
            inputs.push(&a * &inputs[m - 1] / m as f64);
        }
        let state = DVector::zeros(filter.order());
        Self { now: support.start, source, support, rate, state, a, inputs, c: filter.c() }
    }

    fn output(&self) -> f64 {
        (self.c * &self.state)[0]
    }

    /// Moves on to `target`; stays where it is if that is not later.
    fn go_to(&mut self, target: f64) {
        // The source is not smooth at the end of its support, so a panel ends there.
        for corner in [target.min(self.support.end), target] {
            let length = corner - self.now;
            if length > 0.0 {
                let count = (length * self.rate).ceil().clamp(1.0, MOST_PANELS);
                let first = self.now;
                for k in 0..count as usize {
                    self.panel(first + k as f64 * (length / count), length / count);
                }
                self.now = corner;
            }
        }
    }

    /// One panel from `begin` on.
    fn panel(&mut self, begin: f64, length: f64) {
        let mut term = self.state.clone();
        for m in 1..TERMS {
            term = &self.a * term * (length * self.rate / m as f64);
            self.state += &term;
        }
        if begin + 0.5 * length < self.support.end {
            for (moment, input) in self.moments(begin, length).iter().zip(&self.inputs) {
                self.state.axpy(*moment, input, 1.0);
            }
        }
    }

    /// int_0^l f(t + s) (rate (l - s))^m ds for m = 0, 1, ..
    fn moments(&self, begin: f64, length: f64) -> [f64; TERMS] {
        let mut moments = [0.0; TERMS];
        let mirrored = HALF_NODES.into_iter().flat_map(|(x, weight)| [(x, weight), (1.0 - x, weight)]);
        for (abscissa, weight) in mirrored {
            let value = self.source.value(FastPeriods(begin + abscissa * length));
            let left = self.rate * length * (1.0 - abscissa);
            let mut power = weight * length * value;
            for moment in &mut moments {
                *moment += power;
                power *= left;
            }
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Instants, sample};
    use crate::spec::FilterSpec;
    use crate::units::Seconds;

    fn filter(num: &[f64], den: &[f64]) -> StrictlyProper {
        let written = FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() };
        StrictlyProper::new(&written, Seconds(1.0)).unwrap()
    }

    fn source(text: &str) -> NormalisedSource {
        text.parse::<Source>().unwrap().normalised(Seconds(1.0))
    }

    /// Instants in disorder, some of them equal.
    fn times() -> Vec<FastPeriods> {
        (0..300).map(|k| FastPeriods(-3.0 + f64::from(k * 157 % 299) * 0.1303)).collect()
    }

    #[test]
    fn a_step_has_its_closed_form_at_any_instant() {
        for pole in [0.02, 0.5, 7.0, 300.0] {
            let filter = filter(&[pole * pole], &[1.0, 2.0 * pole, pole * pole]);
            for (t, y) in times().iter().zip(sample_at(&filter, &source("step@0.3"), &times())) {
                let age = pole * (t.0 - 0.3).max(0.0);
                let exact = 1.0 - (1.0 + age) * (-age).exp();
                assert!((y - exact).abs() < 1e-13, "{pole} {t}: {y} {exact}");
            }
        }
    }

    #[test]
    fn all_sources_agree_with_the_responses_at_equal_distances() {
        let filter = filter(&[0.4, 0.25], &[1.0, 1.7, 1.3, 0.25]);
        for text in ["tones:0.3,0.8", "chirp:0.01Hz..0.4Hz@17.3s", "step@2+chirp:0.1Hz..0.1Hz@9s+tones:2"] {
            let grid = Instants { first: FastPeriods(-1.2), step: FastPeriods(0.7), count: 60 };
            let want = sample(&filter, &source(text), grid);
            let times: Vec<_> = (0..60).map(|n| FastPeriods(-1.2 + f64::from(n) * 0.7)).collect();
            for (n, y) in sample_at(&filter, &source(text), &times).into_iter().enumerate() {
                assert!((y - want[n]).abs() < 2e-13, "{text} {n}: {y} {}", want[n]);
            }
        }
    }
}
