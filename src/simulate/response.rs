//! The response of a front end to an analytic source, exact to rounding at any uniformly spaced instants.

use super::source::{Source, Tone};
use crate::analog::StrictlyProper;
use crate::linalg::{self, Complex, Mat};

/// The instants first, first + step, ... in fast periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instants {
    /// First instant.
    pub first: f64,
    /// Spacing, positive.
    pub step: f64,
    /// How many.
    pub count: usize,
}

impl Instants {
    fn at(&self, n: usize) -> f64 {
        self.first + n as f64 * self.step
    }
}

/// (phi * f)(t) at the given instants; time of filter, source and instants in fast periods.
pub fn sample(filter: &StrictlyProper, source: &Source, instants: Instants) -> Vec<f64> {
    match source {
        Source::Step { at, height } => step(filter, *at, *height, instants),
        Source::Tones(list) => tones(filter, list, instants),
        Source::Chirp { length, start, end, .. } => {
            smooth(filter, source, (0.0, *length), start.abs().max(end.abs()), instants)
        }
        Source::Sum(parts) => {
            let mut total = vec![0.0; instants.count];
            for part in parts {
                let samples = sample(filter, part, instants);
                total.iter_mut().zip(samples).for_each(|(sum, x)| *sum += x);
            }
            total
        }
    }
}

/// Steady state: amplitude |Phi(j omega)| cos(omega t + phase + arg Phi(j omega)).
fn tones(filter: &StrictlyProper, tones: &[Tone], instants: Instants) -> Vec<f64> {
    let phasors: Vec<(f64, Complex<f64>)> = tones
        .iter()
        .map(|tone| {
            (tone.omega, filter.response(tone.omega) * Complex::from_polar(tone.amplitude, tone.phase))
        })
        .collect();
    let value = |t: f64| phasors.iter().map(|(omega, p)| (p * Complex::from_polar(1.0, omega * t)).re).sum();
    (0..instants.count).map(|n| value(instants.at(n))).collect()
}

/// x(t) and the constant input as one autonomous system: no inverse of A, no cancellation.
fn step(filter: &StrictlyProper, at: f64, height: f64, instants: Instants) -> Vec<f64> {
    let n = filter.order();
    let mut generator = Mat::zeros(n + 1, n + 1);
    generator.view_mut((0, 0), (n, n)).copy_from(filter.a());
    generator.view_mut((0, n), (n, 1)).copy_from(filter.b());
    let mut output = vec![0.0; instants.count];
    let Some(first) = (0..instants.count).find(|&k| instants.at(k) >= at) else { return output };
    let mut state = Mat::zeros(n + 1, 1);
    state[n] = height;
    state = linalg::expm(&(&generator * (instants.at(first) - at))) * state;
    let advance = linalg::expm(&(generator * instants.step));
    for sample in &mut output[first..] {
        *sample = (filter.c() * state.rows(0, n))[0];
        state = &advance * state;
    }
    output
}

/// Sixteen-point Gauss-Legendre rule on [0, 1]: abscissae below one half (the others mirror them) and weights
/// (Abramowitz & Stegun, table 25.4).
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

/// A smooth source that is zero outside `support` and has no frequency above `band` (cycles a fast
/// period): x(t + l) = e^{A l} x(t) + int_0^l e^{A(l - s)} B f(t + s) ds, the integral by a Gauss-Legendre
/// rule on panels in which neither the source nor the filter moves by more than about one radian; the
/// rule is then exact to rounding.
fn smooth(
    filter: &StrictlyProper,
    source: &Source,
    support: (f64, f64),
    band: f64,
    instants: Instants,
) -> Vec<f64> {
    let rate = panel_rate(filter, band);
    let mut state = Mat::zeros(filter.order(), 1);
    let mut now = support.0.min(instants.first);
    let mut output = Vec::with_capacity(instants.count);
    let mut cached: Option<Panels> = None;
    for k in 0..instants.count {
        let target = instants.at(k);
        // The corners of the support are no smooth points: stop there.
        for corner in [support.0, support.1, target] {
            let length = corner - now;
            if length <= 0.0 || corner > target {
                continue;
            }
            let panels = match cached.take() {
                Some(known) if known.fits(length) => known,
                _ => Panels::new(filter, length, rate),
            };
            panels.advance(&mut state, source, now, support);
            now = corner;
            cached = Some(panels);
        }
        output.push((filter.c() * &state)[0]);
    }
    output
}

/// Panels of the quadrature for each fast period of a source whose highest frequency is `band` (cycles a fast period): what
/// [`sample`] costs.
fn panel_rate(filter: &StrictlyProper, band: f64) -> f64 {
    (filter.a().norm() + std::f64::consts::TAU * band).max(f64::MIN_POSITIVE)
}

/// Panels of the quadrature that [`sample`] needs over `span` fast periods; zero for sources answered in closed form.
pub fn panels(filter: &StrictlyProper, source: &Source, span: f64) -> f64 {
    match source {
        Source::Chirp { start, end, .. } => span * panel_rate(filter, start.abs().max(end.abs())),
        Source::Sum(parts) => parts.iter().map(|part| panels(filter, part, span)).sum(),
        Source::Step { .. } | Source::Tones(_) => 0.0,
    }
}

/// The quadrature of one stretch, cut into equal panels; reused for stretches of equal length.
struct Panels {
    length: f64,
    count: usize,
    transition: Mat,
    /// (abscissa, weight e^{A(l - abscissa)} B) within a panel.
    nodes: Vec<(f64, Mat)>,
}

impl Panels {
    fn new(filter: &StrictlyProper, length: f64, rate: f64) -> Self {
        // Bounded so that every call ends; `panels` tells beforehand where digits or patience would be lost.
        let count = (length * rate).ceil().clamp(1.0, 1e6) as usize;
        let panel = length / count as f64;
        let mirrored = HALF_NODES.iter().map(|&(x, w)| (1.0 - x, w));
        let node = |(x, w): (f64, f64)| {
            (x * panel, linalg::expm(&(filter.a() * (panel * (1.0 - x)))) * filter.b() * (w * panel))
        };
        let nodes = HALF_NODES.iter().copied().chain(mirrored).map(node).collect();
        Self { length, count, transition: linalg::expm(&(filter.a() * panel)), nodes }
    }

    fn fits(&self, length: f64) -> bool {
        (length - self.length).abs() <= 1e-12 * self.length
    }

    fn advance(&self, state: &mut Mat, source: &Source, start: f64, support: (f64, f64)) {
        let panel = self.length / self.count as f64;
        for k in 0..self.count {
            let begin = start + k as f64 * panel;
            *state = &self.transition * &*state;
            if begin + panel <= support.0 || begin >= support.1 {
                continue;
            }
            for (offset, weight) in &self.nodes {
                let value = source.value(begin + offset);
                *state += weight * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::FilterSpec;

    fn rc(pole: f64) -> StrictlyProper {
        StrictlyProper::new(&FilterSpec::TransferFunction { num: vec![pole], den: vec![1.0, pole] }, 1.0)
            .unwrap()
    }

    fn thesis() -> StrictlyProper {
        StrictlyProper::new(&FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] }, 1.0)
            .unwrap()
    }

    const GRID: Instants = Instants { first: -1.2, step: 2.0, count: 40 };

    #[test]
    fn the_step_response_has_its_closed_form() {
        for (n, y) in sample(&thesis(), &"step@0.3".parse().unwrap(), GRID).into_iter().enumerate() {
            let t = GRID.at(n) - 0.3;
            let exact = if t < 0.0 { 0.0 } else { 1.0 - (1.0 + 0.5 * t) * (-0.5 * t).exp() };
            assert!((y - exact).abs() < 1e-13, "{n}: {y} {exact}");
        }
    }

    #[test]
    fn tones_are_in_the_steady_state() {
        for (n, y) in sample(&rc(2.0), &"tones:0.8".parse().unwrap(), GRID).into_iter().enumerate() {
            let t = GRID.at(n);
            let exact = (2.0 * (0.8 * t).cos() + 0.8 * (0.8 * t).sin()) * 2.0 / (4.0 + 0.64);
            assert!((y - exact).abs() < 1e-13, "{n}: {y} {exact}");
        }
    }

    #[test]
    fn a_chirp_that_stands_still_is_a_sine_switched_on_and_off() {
        // End = start makes the closed form elementary: sin(w t) on [0, T) through one pole.
        for pole in [0.1, 2.0, 300.0] {
            let (w, length) = (0.7, 21.3);
            let f = w / std::f64::consts::TAU;
            let chirp = Source::Chirp { start: f, end: f, length, amplitude: 1.0 };
            let on = |t: f64| {
                let steady =
                    |t: f64| pole * (pole * (w * t).sin() - w * (w * t).cos()) / (pole * pole + w * w);
                if t <= 0.0 { 0.0 } else { steady(t) - steady(0.0) * (-pole * t).exp() }
            };
            for (n, y) in sample(&rc(pole), &chirp, GRID).into_iter().enumerate() {
                let t = GRID.at(n);
                let exact = if t <= length { on(t) } else { on(length) * (-pole * (t - length)).exp() };
                assert!((y - exact).abs() < 1e-12, "{pole} {n}: {y} {exact}");
            }
        }
    }

    #[test]
    fn a_chirp_does_not_depend_on_where_it_is_sampled() {
        let chirp: Source = "chirp:0.01Hz..0.4Hz@60s".parse().unwrap();
        let coarse = sample(&thesis(), &chirp, Instants { first: 0.0, step: 2.0, count: 30 });
        let fine = sample(&thesis(), &chirp, Instants { first: 0.0, step: 0.125, count: 480 });
        for (n, y) in coarse.into_iter().enumerate() {
            assert!((y - fine[16 * n]).abs() < 1e-13, "{n}");
        }
    }

    #[test]
    fn a_sum_is_the_sum() {
        let both = sample(&thesis(), &"step@0.3+tones:0.5".parse().unwrap(), GRID);
        let (a, b) = (
            sample(&thesis(), &"step@0.3".parse().unwrap(), GRID),
            sample(&thesis(), &"tones:0.5".parse().unwrap(), GRID),
        );
        assert!(both.iter().zip(a.iter().zip(&b)).all(|(s, (x, y))| (s - x - y).abs() < 1e-15));
    }
}
