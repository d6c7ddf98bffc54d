//! Cameras of photographs that were resized after their calibration.

use super::{Camera, CameraError};
use nalgebra::Matrix3;

/// Width and height in pixels.
pub type Size = (usize, usize);

/// The factors by which an image was resized from one size to another, columns and rows; `None` unless one
/// factor gives both sides up to less than a pixel, as programs round them.
pub fn factors(from: Size, to: Size) -> Option<[f64; 2]> {
    let range = |from: usize, to: usize| [to as f64 - 1.0, to as f64 + 1.0].map(|side| side / from as f64);
    let ([low, high], [least, most]) = (range(from.0, to.0), range(from.1, to.1));
    let sides = [from.0, from.1, to.0, to.1].iter().all(|side| *side > 0);
    (sides && low.max(least) < high.min(most))
        .then(|| [to.0 as f64 / from.0 as f64, to.1 as f64 / from.1 as f64])
}

impl Camera {
    /// The camera of the same photograph, resized by the factors s of columns and rows. The border of the
    /// image at -1/2 stays, so that x' = s (x + 1/2) - 1/2.
    ///
    /// # Errors
    /// [`CameraError`] of factors that are 0 or not finite.
    pub fn resized(&self, [sx, sy]: [f64; 2]) -> Result<Self, CameraError> {
        let shift = |s: f64| 0.5 * s - 0.5;
        let map = Matrix3::new(sx, 0.0, shift(sx), 0.0, sy, shift(sy), 0.0, 0.0, 1.0);
        let camera = Self::projective(map * self.matrix)?;
        Ok(self.lens.map_or(camera, |lens| camera.with_lens(lens.resized([sx, sy]))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use nalgebra::{Matrix3x4, Vector3};

    #[test]
    fn one_factor_up_to_rounding_is_a_resize() {
        assert_eq!(factors((120, 90), (60, 45)), Some([0.5, 0.5]));
        // A quarter of 4946 x 3286 is 1236.5 x 821.5, which is rounded or cut off.
        for to in [(1236, 821), (1237, 822), (1236, 822), (9892, 6572)] {
            assert!(factors((4946, 3286), to).is_some(), "{to:?}");
        }
        for to in [(90, 120), (120, 80), (60, 90), (0, 0)] {
            assert_eq!(factors((120, 90), to), None, "{to:?}");
        }
    }

    /// A point projects to the same place of the photograph: the same share of its width and height.
    #[test]
    fn points_keep_their_place_in_the_photograph() {
        let matrix = Matrix3x4::new(100.0, 0.0, 59.5, 12.0, 0.0, 110.0, 44.5, -7.0, 0.0, 0.0, 1.0, 0.3);
        let lens = Lens::new([100.0, 110.0], [59.5, 44.5], [-0.1, 0.02], [1e-3, 2e-3]);
        let plain = Camera::metric(matrix, false).unwrap();
        for camera in [plain, plain.with_lens(lens)] {
            let small = camera.resized([0.5, 0.25]).unwrap();
            for point in [Vector3::new(0.4, -0.3, 2.0), Vector3::new(-1.0, 0.5, 4.0)] {
                let ((x, y, d), (u, v, e)) = (camera.project(&point), small.project(&point));
                assert!(((x + 0.5) * 0.5 - (u + 0.5)).abs() < 1e-9 && (d - e).abs() < 1e-12, "{x} {u}");
                assert!(((y + 0.5) * 0.25 - (v + 0.5)).abs() < 1e-9, "{y} {v}");
            }
        }
        assert!(plain.resized([0.0, 1.0]).is_err());
    }
}
