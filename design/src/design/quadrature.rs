//! Nodes of an integral over the unit circle whose integrand is known beforehand.

use hybank_linalg::Complex;
use hybank_linalg::GAUSS_LEGENDRE;
use std::f64::consts::{PI, TAU};

/// An angle theta with its share of a mean over 0 to pi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct QuadratureNode {
    pub(crate) theta: f64,
    pub(crate) share: f64,
}

/// What limits the panels of the rule.
pub(crate) struct Integrand<'a> {
    /// Angles at which the integrand may jump.
    pub(crate) breaks: Vec<f64>,
    /// Slow periods between the oldest and the newest instant: e^{j theta n} oscillates up to this n.
    pub(crate) periods: f64,
    /// Its poles, for a slow period.
    pub(crate) poles: &'a [Complex<f64>],
}

impl Integrand<'_> {
    /// The nodes of panels of eight points each. Over a panel nothing oscillates by more than a cycle, and
    /// no pole is nearer than its width: the rule errs by 1e-10.
    pub(crate) fn nodes(&self) -> Vec<QuadratureNode> {
        let mut ends: Vec<f64> =
            self.breaks.iter().copied().filter(|end| *end > 0.0 && *end < PI).chain([0.0, PI]).collect();
        ends.sort_by(f64::total_cmp);
        let mut nodes = Vec::new();
        let widest = |low, high| self.widest(low, high);
        ends.windows(2).for_each(|end| add_panels([end[0], end[1]], &widest, &mut nodes));
        nodes.iter_mut().for_each(|node| node.share /= PI);
        nodes
    }

    /// The widest panel near low to high.
    fn widest(&self, low: f64, high: f64) -> f64 {
        let distance = |pole: &Complex<f64>| {
            let turn = pole.im.rem_euclid(TAU);
            let angle = turn.min(TAU - turn);
            pole.re.hypot((low - angle).max(angle - high).max(0.0))
        };
        self.poles.iter().map(distance).fold(TAU / self.periods.max(1.0), f64::min)
    }
}

/// The nodes of the integral from 0 to `end` over w of a function with these poles in the plane of j w, with
/// their weights; no panel is wider than its distance to a pole.
pub(super) fn half_line(end: f64, poles: &[Complex<f64>]) -> Vec<QuadratureNode> {
    let widest = |low: f64, high: f64| {
        let beside = |at: f64| (low - at).max(at - high).max(0.0);
        poles.iter().map(|pole| pole.re.hypot(beside(pole.im.abs()))).fold(f64::INFINITY, f64::min)
    };
    let mut nodes = Vec::new();
    add_panels([0.0, end], &widest, &mut nodes);
    nodes
}

/// The nodes between two ends, with their weights.
fn add_panels([low, high]: [f64; 2], widest: &dyn Fn(f64, f64) -> f64, nodes: &mut Vec<QuadratureNode>) {
    let width = high - low;
    if width > widest(low, high) {
        let middle = 0.5 * (low + high);
        add_panels([low, middle], widest, nodes);
        add_panels([middle, high], widest, nodes);
    } else if width > 0.0 {
        let node = |(part, share)| QuadratureNode { theta: low + part * width, share: share * width };
        nodes.extend(GAUSS_LEGENDRE.map(node));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of cos(n theta) / |1 - r e^{j theta}|^2 is r^n / (1 - r^2).
    #[test]
    fn a_resonance_under_an_oscillation_is_integrated() {
        for (r, n) in [(0.5_f64, 3), (0.999, 20), (1e-3, 60)] {
            let poles = [Complex::new(r.ln(), 0.0)];
            let integrand = Integrand { breaks: vec![1.0], periods: f64::from(n), poles: &poles };
            let of = |theta: f64| {
                let far = Complex::new(1.0 - r * theta.cos(), r * theta.sin());
                (f64::from(n) * theta).cos() / far.norm_sqr()
            };
            let mean: f64 = integrand.nodes().iter().map(|node| node.share * of(node.theta)).sum();
            let exact = r.powi(n) / (1.0 - r * r);
            assert!((mean - exact).abs() < 1e-9 / (1.0 - r * r), "{r}: {mean} {exact}");
        }
    }
}
