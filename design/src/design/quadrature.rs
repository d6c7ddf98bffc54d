//! Nodes of an integral over the unit circle whose integrand is known beforehand.

use hybank_linalg::Complex;
use hybank_linalg::GAUSS_LEGENDRE;
use std::f64::consts::{PI, TAU};

/// An angle theta with its share of a mean over 0 to pi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct QuadratureNode {
    pub(super) theta: f64,
    pub(super) share: f64,
}

/// What limits the panels of the rule.
pub(super) struct Integrand<'a> {
    /// Angles at which the integrand may jump.
    pub(super) breaks: Vec<f64>,
    /// Slow periods between the oldest and the newest instant: e^{j theta n} oscillates up to this n.
    pub(super) periods: f64,
    /// Its poles, for a slow period.
    pub(super) poles: &'a [Complex<f64>],
}

impl Integrand<'_> {
    /// The nodes of panels of eight points each. Over a panel nothing oscillates by more than a cycle, and
    /// no pole is nearer than its width: the rule errs by 1e-10.
    pub(super) fn nodes(&self) -> Vec<QuadratureNode> {
        let mut ends: Vec<f64> =
            self.breaks.iter().copied().filter(|end| *end > 0.0 && *end < PI).chain([0.0, PI]).collect();
        ends.sort_by(f64::total_cmp);
        let mut nodes = Vec::new();
        ends.windows(2).for_each(|end| self.add_panels(end[0], end[1], &mut nodes));
        nodes
    }

    fn add_panels(&self, low: f64, high: f64, nodes: &mut Vec<QuadratureNode>) {
        let width = high - low;
        if width > self.widest(low, high) {
            let middle = 0.5 * (low + high);
            self.add_panels(low, middle, nodes);
            self.add_panels(middle, high, nodes);
        } else if width > 0.0 {
            nodes.extend(GAUSS_LEGENDRE.map(|(part, share)| QuadratureNode {
                theta: low + part * width,
                share: share * width / PI,
            }));
        }
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
