//! Lens distortion: radial with two coefficients and tangential with two (Brown 1966, as in OpenCV and
//! COLMAP).
//!
//! With u = ((x - cx) / fx, (y - cy) / fy) the undistorted position and r = |u|, the distorted position is
//!
//! ```text
//! u (1 + k1 r^2 + k2 r^4) + (2 p1 u v + p2 (r^2 + 2 u^2), 2 p2 u v + p1 (r^2 + 2 v^2)).
//! ```

use nalgebra::{Matrix2, Vector2};

/// Most steps of Newton's method; real lenses need three or four.
const STEPS: usize = 30;
/// Residual, in units of the focal length, at which the iteration has converged: about a billionth of a
/// pixel.
const RESIDUAL: f64 = 1e-12;

/// The distortion of a lens, with the calibration that defines its coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    focal: Vector2<f64>,
    centre: Vector2<f64>,
    radial: [f64; 2],
    tangential: [f64; 2],
    /// Square of the radius up to which the distortion is monotone; beyond it the image folds back.
    reach: f64,
}

impl Lens {
    /// A lens from focal lengths and principal point in pixels (centres at integers), (k1, k2) and (p1, p2).
    pub fn new(focal: [f64; 2], centre: [f64; 2], radial: [f64; 2], tangential: [f64; 2]) -> Self {
        let (focal, centre) = (Vector2::from(focal), Vector2::from(centre));
        Self { focal, centre, radial, tangential, reach: reach(radial) }
    }

    /// The lens of the same photograph, resized by factors of columns and rows.
    pub(super) fn resized(self, factors: [f64; 2]) -> Self {
        let factors = Vector2::from(factors);
        let half = Vector2::new(0.5, 0.5);
        let centre = (self.centre + half).component_mul(&factors) - half;
        Self { focal: self.focal.component_mul(&factors), centre, ..self }
    }

    /// The distorted position of an undistorted one, in pixels; `None` beyond the radius where the image
    /// folds back.
    pub fn record(&self, ideal: Vector2<f64>) -> Option<Vector2<f64>> {
        let u = (ideal - self.centre).component_div(&self.focal);
        (u.norm_squared() < self.reach).then(|| self.bend(&u).0.component_mul(&self.focal) + self.centre)
    }

    /// The undistorted position of a distorted one, in pixels, by Newton's method; `None` where there is
    /// none.
    pub fn ideal(&self, recorded: Vector2<f64>) -> Option<Vector2<f64>> {
        let goal = (recorded - self.centre).component_div(&self.focal);
        let mut u = goal;
        for _ in 0..STEPS {
            let (bent, slope) = self.bend(&u);
            let miss = goal - bent;
            if miss.norm() <= RESIDUAL * (1.0 + goal.norm()) {
                let inside = u.norm_squared() < self.reach;
                return inside.then(|| u.component_mul(&self.focal) + self.centre);
            }
            u += slope.try_inverse()? * miss;
        }
        None
    }

    /// The distorted position and its derivative, in units of the focal length.
    fn bend(&self, u: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let ([k1, k2], [p1, p2]) = (self.radial, self.tangential);
        let (x, y, r2) = (u.x, u.y, u.norm_squared());
        let stretch = 1.0 + k1 * r2 + k2 * r2 * r2;
        let bent = Vector2::new(
            x * stretch + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * stretch + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
        );
        // d stretch / d r^2, twice.
        let growth = 2.0 * (k1 + 2.0 * k2 * r2);
        let cross = x * y * growth + 2.0 * p1 * x + 2.0 * p2 * y;
        let slope = Matrix2::new(
            stretch + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            stretch + y * y * growth + 2.0 * p2 * x + 6.0 * p1 * y,
        );
        (bent, slope)
    }
}

/// The least positive root s of d/dr r (1 + k1 r^2 + k2 r^4) = 1 + 3 k1 s + 5 k2 s^2, s = r^2; infinite if
/// none.
fn reach([k1, k2]: [f64; 2]) -> f64 {
    let (b, a) = (3.0 * k1, 5.0 * k2);
    let square = b * b - 4.0 * a;
    if square < 0.0 {
        return f64::INFINITY;
    }
    // The roots as 2 / (-b +- sqrt), which needs no case for a = 0.
    let roots = [2.0 / (-b + square.sqrt()), 2.0 / (-b - square.sqrt())];
    roots.into_iter().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lens(k: [f64; 2], p: [f64; 2]) -> Lens {
        Lens::new([500.0, 510.0], [320.0, 240.0], k, p)
    }

    #[test]
    fn known_positions() {
        // u = (0.4, 0), r^2 = 0.16: 0.4 (1 - 0.2 * 0.16 + 0.05 * 0.0256) + p2 * 3 * 0.16, and p1 * 0.16.
        let got = lens([-0.2, 0.05], [0.01, 0.02]).record(Vector2::new(520.0, 240.0)).unwrap();
        let want = (0.4 * (1.0 - 0.032 + 0.00128) + 0.0096, 0.0016);
        assert!((got - Vector2::new(320.0 + 500.0 * want.0, 240.0 + 510.0 * want.1)).norm() < 1e-10, "{got}");
    }

    #[test]
    fn the_fold_is_not_crossed() {
        // 1 - 0.9 r^2 = 0 at r = 1.054, where 0.7027 is recorded.
        let barrel = lens([-0.3, 0.0], [0.0; 2]);
        assert!(barrel.record(Vector2::new(320.0 + 500.0 * 1.05, 240.0)).is_some());
        assert_eq!(barrel.record(Vector2::new(320.0 + 500.0 * 1.06, 240.0)), None);
        assert!(barrel.ideal(Vector2::new(320.0 + 500.0 * 0.70, 240.0)).is_some());
        assert_eq!(barrel.ideal(Vector2::new(320.0 + 500.0 * 0.71, 240.0)), None);
        assert_eq!(barrel.ideal(Vector2::new(f64::NAN, 0.0)), None);
        assert_eq!(lens([0.1, 0.1], [0.0; 2]).reach, f64::INFINITY);
        // Of two roots the smaller one is the limit.
        let waved = lens([-1.0, 0.3], [0.0; 2]).reach;
        assert!((1.0 - 3.0 * waved + 1.5 * waved * waved).abs() < 1e-12 && waved < 1.0, "{waved}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn there_and_back_and_the_slope(
            k1 in -0.25..0.4_f64, k2 in -0.02..0.1_f64, p1 in -0.01..0.01_f64, p2 in -0.01..0.01_f64,
            x in 0.0..640.0_f64, y in 0.0..480.0_f64
        ) {
            let lens = lens([k1, k2], [p1, p2]);
            let ideal = Vector2::new(x, y);
            let back = lens.ideal(lens.record(ideal).unwrap()).unwrap();
            prop_assert!((back - ideal).norm() < 1e-6, "{}", back);
            let u = Vector2::new((x - 320.0) / 500.0, (y - 240.0) / 510.0);
            let (_, slope) = lens.bend(&u);
            for (k, step) in [Vector2::new(1e-6, 0.0), Vector2::new(0.0, 1e-6)].into_iter().enumerate() {
                let numeric = (lens.bend(&(u + step)).0 - lens.bend(&(u - step)).0) / 2e-6;
                prop_assert!((slope.column(k) - numeric).norm() < 1e-7);
            }
        }
    }
}
