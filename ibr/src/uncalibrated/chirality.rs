//! Projective depth, chi and its order along the viewing rays (thesis eq. 2.6-2.9).
//!
//! With X_p = H X scaled to last coordinate 1 the projective depth is d_p = d / t_p, and chi = -1 / d_p. On
//! the ray of a pixel chi is an affine function of 1/d with one slope for the whole image,
//!
//! ```text
//! chi = -(h4 . C~) / d - h4 . (r, 0),      h4 the last row of H, C the centre, r the ray of unit depth,
//! ```
//!
//! so chi orders depth correctly on the whole image or reverses it on the whole image, while d_p passes
//! through infinity.
//!
//! The sign of [`order_sign`] holds in every frame, and so does the position to which a pixel with given chi
//! propagates. Only a camera centre on the plane t = 0 (det M = 0) has no order of depth and is refused.
//! That plane of the canonical pair is the best fit to the matches, so it lies within the scene, far from
//! the cameras, and a share of the range of chi is a depth threshold.

use nalgebra::{Matrix3, Matrix3x4, Vector4};

/// chi = -(X_p)_4 / (pi3 . X_p): invariant to the scale of the point, but not to that of the camera.
pub fn chi(camera: &Matrix3x4<f64>, point: &Vector4<f64>) -> f64 {
    -point.w / depth(camera, point)
}

/// w = pi3 . X_p for the point's own scale.
pub fn depth(camera: &Matrix3x4<f64>, point: &Vector4<f64>) -> f64 {
    camera.row(2).transpose().dot(point)
}

/// Flips signs so that pi3_i . X_j > 0: each point by the first camera, then each other camera by the
/// majority of the points that it sees according to `seen`.
pub fn orient(
    cameras: &mut [Matrix3x4<f64>],
    points: &mut [Vector4<f64>],
    seen: impl Fn(usize, usize) -> bool,
) {
    let Some((first, others)) = cameras.split_first_mut() else { return };
    for point in points.iter_mut().filter(|p| depth(first, p) < 0.0) {
        *point = -*point;
    }
    for (i, camera) in others.iter_mut().enumerate() {
        let visible = || points.iter().enumerate().filter(|(j, _)| seen(i + 1, *j)).map(|(_, p)| p);
        let negative = visible().filter(|p| depth(camera, p) < 0.0).count();
        if 2 * negative > visible().count() {
            *camera = -*camera;
        }
    }
}

/// det M, which is c_4 of the centre c_k = (-1)^k det(Pi without column k).
pub fn centre_sign(camera: &Matrix3x4<f64>) -> f64 {
    let m: Matrix3<f64> = camera.fixed_columns::<3>(0).into_owned();
    m.determinant().signum()
}

/// The sign of det H, the one bit of the projective frame that decides the order of depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handedness {
    /// det H > 0.
    Kept,
    /// det H < 0.
    Reversed,
}

impl Handedness {
    /// +1 or -1.
    pub fn sign(self) -> f64 {
        if self == Self::Kept { 1.0 } else { -1.0 }
    }

    /// The bit for which chi of this oriented camera grows (`slope` > 0) or falls with 1 / d.
    pub fn from_slope(camera: &Matrix3x4<f64>, slope: f64) -> Self {
        if -slope * centre_sign(camera) > 0.0 { Self::Kept } else { Self::Reversed }
    }
}

/// s such that s chi orders the points of an oriented camera by depth, smaller nearer: sign(det H) sign(det
/// M).
///
/// The slope of chi against 1 / d has the opposite sign (see the module documentation).
pub fn order_sign(camera: &Matrix3x4<f64>, hand: Handedness) -> f64 {
    hand.sign() * centre_sign(camera)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncalibrated::fundamental::tests::Synthetic;
    use hybank_linalg::small;
    use nalgebra::Matrix4;
    use proptest::prelude::*;

    /// A random projective frame of a synthetic scene, with all scales and signs random too.
    struct Frame {
        scene: Synthetic,
        cameras: Vec<Matrix3x4<f64>>,
        points: Vec<Vector4<f64>>,
        hand: Handedness,
    }

    fn frame(entries: &[f64], flips: u64) -> Option<Frame> {
        let scene = Synthetic::new(40, false);
        let mut h = Matrix4::from_column_slice(entries);
        // Scene units differ from pixels by two orders; the frame shall be strongly projective.
        h.row_mut(3).scale_mut(0.5);
        let inverse = h.try_inverse()?;
        let volume: f64 = (0..4).map(|i| h.row(i).norm()).product();
        // Close to singular nothing can be said about signs; rays through the plane t = 0 are fine.
        if h.determinant().abs() < 0.03 * volume {
            return None;
        }
        let sign = |k: usize| if flips >> k & 1 == 1 { -1.0 } else { 1.0 };
        let scale = |k: usize| sign(k) * (0.5 + (k * 7 % 11) as f64);
        let cameras = scene.cameras.iter().enumerate().map(|(i, c)| c * inverse * scale(i)).collect();
        let points = scene.points.iter().enumerate().map(|(j, p)| h * p.push(1.0) * scale(j + 3)).collect();
        let hand = if h.determinant() > 0.0 { Handedness::Kept } else { Handedness::Reversed };
        Some(Frame { scene, cameras, points, hand })
    }

    impl Frame {
        fn true_depth(&self, i: usize, j: usize) -> f64 {
            (self.scene.cameras[i] * self.scene.points[j].push(1.0)).z
        }
    }

    /// Slope of chi against 1 / d in chi ~ (1/d, x, y, 1), and the relative residual of the fit.
    fn regress(f: &Frame, i: usize) -> (f64, f64) {
        let rows: Vec<[f64; 4]> = (0..f.points.len())
            .map(|j| {
                let p = f.scene.image(i, j);
                [1.0 / f.true_depth(i, j), p.x / 500.0, p.y / 500.0, 1.0]
            })
            .collect();
        let values: Vec<f64> = f.points.iter().map(|p| chi(&f.cameras[i], p)).collect();
        let fit = small::least_squares(&rows, &values).unwrap();
        let miss = |(r, v): (&[f64; 4], &f64)| (0..4).map(|k| r[k] * fit[k]).sum::<f64>() - v;
        let residual = rows.iter().zip(&values).map(miss).map(f64::abs).fold(0.0, f64::max);
        (fit[0], residual / values.iter().map(|v| v.abs()).fold(0.0, f64::max))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn chi_is_affine_and_its_order_has_the_predicted_sign(
            entries in prop::collection::vec(-1.0..1.0_f64, 16), flips: u64
        ) {
            let Some(mut f) = frame(&entries, flips) else { return Ok(()) };
            orient(&mut f.cameras, &mut f.points, |_, _| true);
            prop_assert!(f.cameras.iter().all(|c| f.points.iter().all(|p| depth(c, p) > 0.0)));
            for i in 0..3 {
                let (slope, residual) = regress(&f, i);
                prop_assert!(residual < 1e-7, "camera {}: residual {}", i, residual);
                let s = order_sign(&f.cameras[i], f.hand);
                prop_assert!(s * slope < 0.0, "camera {}: slope {}", i, slope);
                prop_assert_eq!(Handedness::from_slope(&f.cameras[i], slope), f.hand);
            }
        }

        #[test]
        fn points_on_one_ray_are_ordered(entries in prop::collection::vec(-1.0..1.0_f64, 16), flips: u64) {
            let Some(mut f) = frame(&entries, flips) else { return Ok(()) };
            // A second point on the ray of each point of camera 2, farther away.
            let camera = crate::camera::Camera::projective(f.scene.cameras[2]).unwrap();
            let n = f.scene.points.len();
            let h = Matrix4::from_column_slice(&entries);
            let mut h = h;
            h.row_mut(3).scale_mut(0.5);
            for j in 0..n {
                let p = f.scene.image(2, j);
                let far = camera.unproject(p.x, p.y, f.true_depth(2, j) * 1.3);
                f.points.push(h * far.push(1.0));
            }
            orient(&mut f.cameras, &mut f.points, |_, _| true);
            let s = order_sign(&f.cameras[2], f.hand);
            for j in 0..n {
                let (near, far) = (chi(&f.cameras[2], &f.points[j]), chi(&f.cameras[2], &f.points[n + j]));
                prop_assert!(s * near < s * far, "{} {}", s * near, s * far);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]
        /// A pixel with given chi propagates to the same position in every frame, even if the plane t = 0
        /// cuts the scene.
        #[test]
        fn positions_do_not_depend_on_the_frame(entries in prop::collection::vec(-1.0..1.0_f64, 16), flips: u64) {
            let Some(mut f) = frame(&entries, flips) else { return Ok(()) };
            orient(&mut f.cameras, &mut f.points, |_, _| true);
            for source in 0..2 {
                let camera = |i: usize| crate::camera::Camera::projective(f.cameras[i]);
                let (Ok(from), Ok(to)) = (camera(source), camera(2)) else { return Ok(()) };
                let map = from.relative_to(&to);
                for (j, point) in f.points.iter().enumerate() {
                    let x = f.scene.image(source, j);
                    let p = map.a * x.push(1.0) - map.b * chi(&f.cameras[source], point);
                    let want = f.scene.image(2, j);
                    prop_assert!((p.xy() / p.z - want).norm() < 1e-5 && p.z > 0.0, "{} {}", p, want);
                    // And chi there, which orders the samples, is that of the point itself.
                    let there = chi(&f.cameras[source], point) / p.z;
                    let own = chi(&f.cameras[2], point);
                    prop_assert!((there - own).abs() < 1e-7 * (1.0 + own.abs()), "{} {}", there, own);
                }
            }
        }
    }

    /// Fig. 2.9: along a calibrated line of sight d_p has a pole where chi is a straight line in 1 / d.
    #[test]
    fn projective_depth_has_a_pole_and_chi_has_none() {
        let scene = Synthetic::new(1, false);
        let camera = crate::camera::Camera::projective(scene.cameras[0]).unwrap();
        // t = 1 - z / 6 vanishes in the middle of the scene.
        let mut h = Matrix4::identity();
        h.set_row(3, &nalgebra::RowVector4::new(0.0, 0.0, -1.0 / 6.0, 1.0));
        let projective = scene.cameras[0] * h.try_inverse().unwrap();
        let line: Vec<(f64, f64)> = (0..80)
            .map(|k| 4.0 + 0.05 * k as f64)
            .map(|d| (1.0 / d, chi(&projective, &(h * camera.unproject(100.0, 200.0, d).push(1.0)))))
            .collect();
        let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
        let first = slope(line[0], line[1]);
        assert!(line.windows(2).all(|w| (slope(w[0], w[1]) / first - 1.0).abs() < 1e-6));
        let depths: Vec<f64> = line.iter().map(|p| -1.0 / p.1).collect();
        assert!(depths.windows(2).any(|w| w[0] * w[1] < 0.0 && w[0].abs() > 100.0), "{depths:?}");
    }
}
