//! Cameras: 3 x 4 matrices, d x~ = Pi X~ (thesis eq. 2.1), pixel centres at integers.

mod camera_path;
pub mod colmap;
mod lens;
mod list;
pub mod names;
mod path;
pub mod resize;
pub mod transforms;

pub use lens::Lens;
pub use list::{CameraList, Frame, ListedCamera};

use crate::depth::or_far;
use nalgebra::{Matrix3, Matrix3x4, Vector2, Vector3};

/// A 3 x 3 part whose determinant is this small against its norm cubed does not map rays to pixels.
const SMALLEST_DETERMINANT: f64 = 1e-12;

/// Errors of cameras.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The left 3 x 3 part is singular.
    #[error(
        "the camera is singular: the determinant of its left 3 x 3 part is {determinant:e} at a norm of {norm:e}, so its pixels have no viewing rays; check the matrix (rows of 4 numbers, in pixels)"
    )]
    Singular {
        /// det M.
        determinant: f64,
        /// ||M||.
        norm: f64,
    },
    /// An entry is NaN or infinite.
    #[error("entry ({row}, {column}) of the camera is {value}: all twelve must be finite numbers")]
    NotFinite {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The entry.
        value: f64,
    },
}

/// A camera Pi = \[M | m\] with non-singular M, and the distortion of its lens if it has any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    matrix: Matrix3x4<f64>,
    inverse: Matrix3<f64>,
    lens: Option<Lens>,
}

impl Camera {
    /// A camera without rescaling, projective or metric: depth d = pi3 . X~ in the scale of the matrix.
    ///
    /// # Errors
    /// [`CameraError::NotFinite`] and [`CameraError::Singular`].
    pub fn projective(matrix: Matrix3x4<f64>) -> Result<Self, CameraError> {
        if let Some(at) = matrix.iter().position(|v| !v.is_finite()) {
            let (row, column) = (at % 3, at / 3);
            return Err(CameraError::NotFinite { row, column, value: matrix[(row, column)] });
        }
        let m: Matrix3<f64> = matrix.fixed_columns::<3>(0).into_owned();
        let (determinant, norm) = (m.determinant(), m.norm());
        // Rows of a camera in pixels differ by a factor of the focal length, so they are normalised first.
        let rows = [0, 1, 2].map(|i| m.row(i).norm());
        let volume = rows[0] * rows[1] * rows[2];
        match m.try_inverse() {
            Some(inverse) if determinant.abs() > SMALLEST_DETERMINANT * volume => {
                Ok(Self { matrix, inverse, lens: None })
            }
            _ => Err(CameraError::Singular { determinant, norm }),
        }
    }

    /// A metric camera, scaled so that d is the Euclidean depth: Pi sign(det M) / ||pi3(1:3)||.
    ///
    /// `mirrored` states that the world frame is left-handed, in which a proper camera has det M < 0.
    ///
    /// # Errors
    /// As [`Camera::projective`].
    pub fn metric(matrix: Matrix3x4<f64>, mirrored: bool) -> Result<Self, CameraError> {
        let given = Self::projective(matrix)?;
        let hand = if mirrored { -1.0 } else { 1.0 };
        let sign = given.determinant().signum() * hand;
        Self::projective(matrix * (sign / given.m().row(2).norm()))
    }

    /// The same camera with a lens: its pixels are distorted positions, while Pi maps to undistorted ones.
    pub fn with_lens(self, lens: Lens) -> Self {
        Self { lens: Some(lens), ..self }
    }

    /// The same camera without its lens.
    pub(crate) fn without_lens(&self) -> Self {
        Self { lens: None, ..*self }
    }

    /// A metric camera of the same hand and lens with another matrix; `None` if that is singular.
    pub(crate) fn with_matrix(&self, matrix: Matrix3x4<f64>) -> Option<Self> {
        let camera = Self::metric(matrix, self.determinant() < 0.0).ok()?;
        Some(Self { lens: self.lens, ..camera })
    }

    /// Pi.
    pub fn matrix(&self) -> &Matrix3x4<f64> {
        &self.matrix
    }

    /// M, the left 3 x 3 part.
    pub fn m(&self) -> Matrix3<f64> {
        self.matrix.fixed_columns::<3>(0).into_owned()
    }

    /// det M.
    pub fn determinant(&self) -> f64 {
        self.m().determinant()
    }

    /// The centre C = -M^{-1} m.
    pub fn centre(&self) -> Vector3<f64> {
        -self.inverse * self.matrix.column(3)
    }

    /// The direction in which the camera looks, of length one, for a metric camera.
    pub fn axis(&self) -> Vector3<f64> {
        self.m().row(2).transpose().normalize()
    }

    /// The point at depth d on the ray of pixel (x, y): M^{-1} (d x~ - m) (eq. 2.2); NaN outside the
    /// domain of the lens.
    pub fn unproject(&self, x: f64, y: f64, d: f64) -> Vector3<f64> {
        let (x, y) = through(self.lens.as_ref(), x, y, Lens::ideal);
        self.inverse * (Vector3::new(x, y, 1.0) * d - self.matrix.column(3))
    }

    /// Pixel and depth (x, y, d) of a point (eq. 2.3); d <= 0 means behind the camera, the pixel is NaN
    /// outside the domain of the lens.
    pub fn project(&self, point: &Vector3<f64>) -> (f64, f64, f64) {
        let p = self.matrix * point.push(1.0);
        let (x, y) = through(self.lens.as_ref(), p.x / p.z, p.y / p.z, Lens::record);
        (x, y, p.z)
    }

    /// The map of pixels with depth from this camera to another one.
    pub fn relative_to(&self, other: &Self) -> Relative {
        let a = other.m() * self.inverse;
        let b = other.matrix.column(3) - a * self.matrix.column(3);
        Relative { a, b, from: self.lens, to: other.lens }
    }
}

/// A position mapped by a lens; unchanged without a lens, NaN outside its domain.
#[inline]
fn through(
    lens: Option<&Lens>,
    x: f64,
    y: f64,
    way: impl Fn(&Lens, Vector2<f64>) -> Option<Vector2<f64>>,
) -> (f64, f64) {
    match lens {
        None => (x, y),
        Some(lens) => way(lens, Vector2::new(x, y)).map_or((f64::NAN, f64::NAN), |p| (p.x, p.y)),
    }
}

/// Pi_v X~ = d (A x~) + b: the map of pixels with depth from one camera to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative {
    /// A = M_v M_i^{-1}, the infinite homography.
    pub a: Matrix3<f64>,
    /// b = m_v - A m_i, the scaled epipole.
    pub b: Vector3<f64>,
    from: Option<Lens>,
    to: Option<Lens>,
}

impl Relative {
    /// Whether no lens bends the map.
    #[inline]
    pub fn is_linear(&self) -> bool {
        self.from.is_none() && self.to.is_none()
    }

    /// Pixel and depth at the other camera of pixel (x, y) with depth d; the pixel is NaN outside the
    /// domain of a lens.
    #[inline]
    pub fn map(&self, x: f64, y: f64, d: f64) -> (f64, f64, f64) {
        let (x, y) = through(self.from.as_ref(), x, y, Lens::ideal);
        let p = self.a * Vector3::new(x, y, 1.0) * d + self.b;
        let (x, y) = through(self.to.as_ref(), p.x / p.z, p.y / p.z, Lens::record);
        (x, y, or_far(p.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn camera(angles: [f64; 3], t: [f64; 3]) -> Matrix3x4<f64> {
        let k = Matrix3::new(500.0, 0.3, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0);
        let r = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        rt.set_column(3, &Vector3::from(t));
        k * rt
    }

    #[test]
    fn scale_and_sign_of_the_matrix_do_not_matter() {
        let plain = camera([0.1, -0.2, 0.05], [0.3, 0.1, 2.0]);
        for factor in [1.0, -1.0, 7.3, -1e-4] {
            let metric = Camera::metric(plain * factor, false).unwrap();
            assert!((metric.matrix() - plain).norm() < 1e-9, "{factor}");
        }
        let mirrored = plain * nalgebra::Matrix4::from_diagonal(&[1.0, 1.0, -1.0, 1.0].into());
        let kept = Camera::metric(mirrored * 3.0, true).unwrap();
        assert!((kept.matrix() - mirrored).norm() < 1e-9);
    }

    #[test]
    fn singular_and_broken_cameras_are_refused() {
        let mut m = camera([0.0; 3], [0.0; 3]);
        m.set_row(1, &(m.row(0) * 2.0));
        assert!(matches!(Camera::projective(m), Err(CameraError::Singular { .. })));
        assert!(matches!(Camera::projective(Matrix3x4::zeros()), Err(CameraError::Singular { .. })));
        m[(2, 1)] = f64::NAN;
        assert!(matches!(Camera::projective(m), Err(CameraError::NotFinite { row: 2, column: 1, .. })));
    }

    #[test]
    fn the_centre_projects_to_nothing() {
        let c = Camera::projective(camera([0.3, 0.2, -0.4], [1.0, 2.0, 3.0])).unwrap();
        assert!((c.matrix() * c.centre().push(1.0)).norm() < 1e-10);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn there_and_back_is_the_identity(
            a in prop::array::uniform3(-0.4..0.4_f64), t in prop::array::uniform3(-0.5..0.5_f64),
            x in 0.0..640.0_f64, y in 0.0..480.0_f64, d in 2.0..50.0_f64
        ) {
            let one = Camera::metric(camera([0.0; 3], [0.0; 3]), false).unwrap();
            let two = Camera::metric(camera(a, t), false).unwrap();
            let (u, v, e) = one.relative_to(&two).map(x, y, d);
            let (x2, y2, d2) = two.relative_to(&one).map(u, v, e);
            prop_assert!((x2 - x).abs() < 1e-7 && (y2 - y).abs() < 1e-7 && (d2 - d).abs() < 1e-9 * d);
            let direct = two.project(&one.unproject(x, y, d));
            prop_assert!((direct.0 - u).abs() < 1e-7 && (direct.2 - e).abs() < 1e-9 * d);
        }

        #[test]
        fn lenses_are_undone_and_applied(
            a in prop::array::uniform3(-0.2..0.2_f64), k in -0.1..0.1_f64,
            x in 0.0..640.0_f64, y in 0.0..480.0_f64, d in 5.0..50.0_f64
        ) {
            let lens = |k| Lens::new([500.0, 510.0], [320.0, 240.0], [k, 0.01], [1e-3, -2e-3]);
            let one = Camera::metric(camera([0.0; 3], [0.0; 3]), false).unwrap().with_lens(lens(k));
            let two = Camera::metric(camera(a, [0.1, 0.2, 0.3]), false).unwrap().with_lens(lens(-k));
            let (u, v, e) = one.relative_to(&two).map(x, y, d);
            let (x2, y2, d2) = two.relative_to(&one).map(u, v, e);
            prop_assert!((x2 - x).abs() < 1e-5 && (y2 - y).abs() < 1e-5 && (d2 - d).abs() < 1e-7 * d);
            let direct = two.project(&one.unproject(x, y, d));
            prop_assert!((direct.0 - u).abs() < 1e-7 && (direct.2 - e).abs() < 1e-9 * d);
        }

        #[test]
        fn a_plane_moves_by_its_homography(
            a in prop::array::uniform3(-0.3..0.3_f64), t in prop::array::uniform3(-0.5..0.5_f64),
            x in 0.0..640.0_f64, y in 0.0..480.0_f64
        ) {
            // Points n.X = 4 seen by [K|0] have depth 4 / (n . K^-1 x~); H = A + b n^T K^-1 / 4.
            let one = Camera::metric(camera([0.0; 3], [0.0; 3]), false).unwrap();
            let two = Camera::metric(camera(a, t), false).unwrap();
            let n = Vector3::new(0.2, -0.1, 1.0);
            let row = n.transpose() * one.inverse;
            let d = 4.0 / (row * Vector3::new(x, y, 1.0)).x;
            let map = one.relative_to(&two);
            let h = map.a + map.b * row / 4.0;
            let p = h * Vector3::new(x, y, 1.0);
            let (u, v, _) = map.map(x, y, d);
            prop_assert!((p.x / p.z - u).abs() < 1e-8 && (p.y / p.z - v).abs() < 1e-8);
        }
    }
}
