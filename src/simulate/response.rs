//! The response of a front end to an analytic source, exact to rounding at any uniformly spaced instants.

use super::source::{NormalisedSource, Source};
use super::walk::{panel_rate, sample_at, sum};
use crate::analog::StrictlyProper;
use crate::linalg::{self, Mat};
use crate::units::FastPeriods;

/// The instants first + n step, n = 0 .. count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instants {
    /// First instant.
    pub first: FastPeriods,
    /// Spacing, positive.
    pub step: FastPeriods,
    /// Number of instants.
    pub count: usize,
}

impl Instants {
    /// Instant `n`.
    pub fn at(&self, n: usize) -> FastPeriods {
        FastPeriods(self.first.0 + n as f64 * self.step.0)
    }
}

/// (phi * f)(t) at the given instants, accurate to rounding.
///
/// Steps and tones have closed forms. A chirp costs the panels of its quadrature, as in
/// [`sample_at`]; [`frames`](super::frames) refuses too many. Beyond a million panels between two instants
/// digits are lost.
pub fn sample(filter: &StrictlyProper, source: &NormalisedSource, instants: Instants) -> Vec<f64> {
    match source {
        Source::Step { at, height } => step(filter, at.0, *height, instants),
        Source::Tones(_) | Source::Chirp { .. } => {
            let times: Vec<FastPeriods> = (0..instants.count).map(|n| instants.at(n)).collect();
            sample_at(filter, source, &times)
        }
        Source::Sum(terms) => sum(instants.count, terms.iter().map(|term| sample(filter, term, instants))),
    }
}

/// The state and the constant input form one autonomous system, (x, u)' = [A B; 0 0] (x, u), so A need not
/// be inverted and nothing cancels.
fn step(filter: &StrictlyProper, at: f64, height: f64, instants: Instants) -> Vec<f64> {
    let n = filter.order();
    let mut generator = Mat::zeros(n + 1, n + 1);
    generator.view_mut((0, 0), (n, n)).copy_from(filter.a());
    generator.view_mut((0, n), (n, 1)).copy_from(filter.b());
    let mut output = vec![0.0; instants.count];
    let Some(first) = (0..instants.count).find(|&k| instants.at(k).0 >= at) else { return output };
    let mut state = Mat::zeros(n + 1, 1);
    state[n] = height;
    state = linalg::expm(&(&generator * (instants.at(first).0 - at))) * state;
    let advance = linalg::expm(&(generator * instants.step.0));
    for sample in &mut output[first..] {
        *sample = (filter.c() * state.rows(0, n))[0];
        state = &advance * state;
    }
    output
}

/// Number of quadrature panels that [`sample`] needs over `span`; 0 for sources with a closed form. At
/// instants without a common distance (`jittered`, [`sample_at`](super::sample_at)) a step needs them too.
pub(super) fn panels(
    filter: &StrictlyProper,
    source: &NormalisedSource,
    span: FastPeriods,
    jittered: bool,
) -> f64 {
    match source {
        Source::Chirp { start, end, .. } => span.0 * panel_rate(filter, start.0.abs().max(end.0.abs())),
        Source::Step { .. } if jittered => span.0 * panel_rate(filter, 0.0),
        Source::Sum(terms) => terms.iter().map(|term| panels(filter, term, span, jittered)).sum(),
        Source::Step { .. } | Source::Tones(_) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::FilterSpec;
    use crate::units::{CyclesPerFastPeriod, Seconds};

    fn filter(num: &[f64], den: &[f64]) -> StrictlyProper {
        let written = FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() };
        StrictlyProper::new(&written, Seconds(1.0)).unwrap()
    }

    fn rc(pole: f64) -> StrictlyProper {
        filter(&[pole], &[1.0, pole])
    }

    fn thesis() -> StrictlyProper {
        filter(&[0.25], &[1.0, 1.0, 0.25])
    }

    /// The source with a fast period of one second.
    fn source(text: &str) -> NormalisedSource {
        text.parse::<Source>().unwrap().normalised(Seconds(1.0))
    }

    fn grid(first: f64, step: f64, count: usize) -> Instants {
        Instants { first: FastPeriods(first), step: FastPeriods(step), count }
    }

    const GRID: Instants = Instants { first: FastPeriods(-1.2), step: FastPeriods(2.0), count: 40 };

    #[test]
    fn the_step_response_has_its_closed_form() {
        for (n, y) in sample(&thesis(), &source("step@0.3"), GRID).into_iter().enumerate() {
            let t = GRID.at(n).0 - 0.3;
            let exact = if t < 0.0 { 0.0 } else { 1.0 - (1.0 + 0.5 * t) * (-0.5 * t).exp() };
            assert!((y - exact).abs() < 1e-13, "{n}: {y} {exact}");
        }
    }

    #[test]
    fn tones_are_in_the_steady_state() {
        for (n, y) in sample(&rc(2.0), &source("tones:0.8"), GRID).into_iter().enumerate() {
            let t = GRID.at(n).0;
            let exact = (2.0 * (0.8 * t).cos() + 0.8 * (0.8 * t).sin()) * 2.0 / (4.0 + 0.64);
            assert!((y - exact).abs() < 1e-13, "{n}: {y} {exact}");
        }
    }

    #[test]
    fn a_chirp_of_constant_frequency_is_a_sine_burst() {
        // End = start makes the closed form elementary: sin(w t) on [0, T) through one pole.
        for pole in [0.1, 2.0, 300.0] {
            let (w, length) = (0.7, 21.3);
            let f = CyclesPerFastPeriod(w / std::f64::consts::TAU);
            let chirp = Source::Chirp { start: f, end: f, length: FastPeriods(length), amplitude: 1.0 };
            let on = |t: f64| {
                let steady =
                    |t: f64| pole * (pole * (w * t).sin() - w * (w * t).cos()) / (pole * pole + w * w);
                if t <= 0.0 { 0.0 } else { steady(t) - steady(0.0) * (-pole * t).exp() }
            };
            for (n, y) in sample(&rc(pole), &chirp, GRID).into_iter().enumerate() {
                let t = GRID.at(n).0;
                let exact = if t <= length { on(t) } else { on(length) * (-pole * (t - length)).exp() };
                assert!((y - exact).abs() < 1e-12, "{pole} {n}: {y} {exact}");
            }
        }
    }

    #[test]
    fn a_chirp_response_does_not_depend_on_the_instants() {
        let chirp = source("chirp:0.01Hz..0.4Hz@60s");
        let coarse = sample(&thesis(), &chirp, grid(0.0, 2.0, 30));
        let fine = sample(&thesis(), &chirp, grid(0.0, 0.125, 480));
        for (n, y) in coarse.into_iter().enumerate() {
            assert!((y - fine[16 * n]).abs() < 1e-13, "{n}");
        }
    }

    #[test]
    fn the_response_to_a_sum_is_the_sum_of_responses() {
        let both = sample(&thesis(), &source("step@0.3+tones:0.5"), GRID);
        let (a, b) =
            (sample(&thesis(), &source("step@0.3"), GRID), sample(&thesis(), &source("tones:0.5"), GRID));
        assert!(both.iter().zip(a.iter().zip(&b)).all(|(s, (x, y))| (s - x - y).abs() < 1e-15));
    }
}
