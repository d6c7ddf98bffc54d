//! Means over the unit circle by adaptive Gauss-Kronrod quadrature.
//!
//! Source: R. Piessens et al., *QUADPACK*, Springer 1983, rule QK15 (seven Gauss and fifteen Kronrod
//! points).

use std::f64::consts::PI;

/// Positive abscissae of the fifteen-point rule on [-1, 1], and the point 0 last. Every second one, from the
/// second on, is a Gauss point.
const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
/// Weights of the fifteen points.
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];
/// Weights of the seven Gauss points.
const GAUSS: [f64; 4] =
    [0.129_484_966_168_869_7, 0.279_705_391_489_276_64, 0.381_830_050_505_118_9, 0.417_959_183_673_469_4];

/// Relative error of each mean at which refinement ends: 0.0004 dB of a power, far below what is printed.
const MEAN_ACCURACY: f64 = 1e-4;
/// Errors below this share of the largest mean are those of rounding, and no refinement takes them away.
const ROUNDING_SHARE: f64 = 1e-28;

/// Integrals of some functions over an interval, with the difference of the two rules.
#[derive(Debug, Clone)]
struct Panel {
    low: f64,
    high: f64,
    values: Vec<f64>,
    errors: Vec<f64>,
}

impl Panel {
    fn new(low: f64, high: f64, of: &mut dyn FnMut(f64) -> Vec<f64>) -> Self {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let mut panel = Self { low, high, values: Vec::new(), errors: Vec::new() };
        for (i, &node) in NODES.iter().enumerate() {
            let gauss = if i % 2 == 1 { GAUSS[i / 2] } else { 0.0 };
            panel.add(&of(middle - half * node), half * KRONROD[i], half * gauss);
            if node > 0.0 {
                panel.add(&of(middle + half * node), half * KRONROD[i], half * gauss);
            }
        }
        panel
    }

    fn add(&mut self, values: &[f64], kronrod: f64, gauss: f64) {
        self.values.resize(values.len(), 0.0);
        self.errors.resize(values.len(), 0.0);
        for ((sum, error), value) in self.values.iter_mut().zip(&mut self.errors).zip(values) {
            *sum += kronrod * value;
            *error += (kronrod - gauss) * value;
        }
    }

    /// Whether some function is less accurate here than this panel's share of the interval allows.
    fn is_rough(&self, totals: &[f64]) -> bool {
        let floor = ROUNDING_SHARE * totals.iter().copied().fold(0.0, f64::max);
        let share = (self.high - self.low) / PI;
        let is_rough =
            |(error, total): (&f64, &f64)| error.abs() > share * (MEAN_ACCURACY * total).max(floor);
        self.high - self.low > 1e-12 && self.errors.iter().zip(totals).any(is_rough)
    }
}

/// The means `(1 / pi) int_0^pi of(theta) d theta` of nonnegative functions, each with the relative accuracy
/// 1e-4 unless about `most` evaluations do not suffice for it.
///
/// `breaks` are angles at which the functions may jump or have narrow peaks; those outside 0 to pi are left
/// out.
pub(super) fn mean_over_circle(breaks: &[f64], most: usize, of: &mut dyn FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let mut ends: Vec<f64> =
        breaks.iter().copied().filter(|x| *x > 0.0 && *x < PI).chain([0.0, PI]).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|b, a| *b - *a < 1e-12);
    let mut panels: Vec<Panel> = ends.windows(2).map(|end| Panel::new(end[0], end[1], of)).collect();
    let mut evaluations = 15 * panels.len();
    loop {
        let totals = sums(&panels);
        let (rough, mut fine): (Vec<_>, Vec<_>) =
            panels.into_iter().partition(|panel| panel.is_rough(&totals));
        if rough.is_empty() || evaluations >= most {
            return totals.into_iter().map(|total| total / PI).collect();
        }
        evaluations += 30 * rough.len();
        for panel in rough {
            let middle = 0.5 * (panel.low + panel.high);
            fine.push(Panel::new(panel.low, middle, of));
            fine.push(Panel::new(middle, panel.high, of));
        }
        panels = fine;
    }
}

fn sums(panels: &[Panel]) -> Vec<f64> {
    let functions = panels.first().map_or(0, |panel| panel.values.len());
    (0..functions).map(|i| panels.iter().map(|panel| panel.values[i]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poisson's kernel (1 - r^2) / (1 - 2 r cos t + r^2) has the mean 1 for every r: r = 0.9999 is a peak
    /// of the width 1e-4. A jump needs its break.
    #[test]
    fn narrow_peaks_and_jumps_are_integrated() {
        let poisson = |r: f64, t: f64| (1.0 - r * r) / (1.0 - 2.0 * r * t.cos() + r * r);
        let mut calls = 0;
        let means = mean_over_circle(&[1.0], 10_000, &mut |t| {
            calls += 1;
            let jump = if t < 1.0 { 1.0 } else { 0.0 };
            vec![poisson(0.9999, t), poisson(-0.5, t), 1e-25 * t, jump, (40.0 * t).sin().powi(2)]
        });
        for (mean, want) in means.iter().zip([1.0, 1.0, 0.5e-25 * PI, 1.0 / PI, 0.5]) {
            assert!((mean / want - 1.0).abs() < 1e-5, "{means:?}");
        }
        assert!(calls < 3_000, "{calls}");
    }

    /// What is zero up to rounding changes from angle to angle.
    #[test]
    fn rounding_errors_are_not_refined() {
        let mut calls = 0;
        let means = mean_over_circle(&[], 10_000, &mut |t| {
            calls += 1;
            vec![1e-31 * ((1e6 * t).sin() + 1.0), 2.0]
        });
        assert!(calls == 15 && means[0] < 1e-30, "{calls} {means:?}");
    }

    #[test]
    fn evaluations_are_bounded() {
        let mut calls = 0;
        mean_over_circle(&[], 600, &mut |t| {
            calls += 1;
            vec![(1e9 * t).sin() + 1.0]
        });
        assert!(calls < 1_800, "{calls}");
    }
}
