//! Cameras on the way from one camera to another.

use super::{Camera, CameraError};
use nalgebra::{Matrix3, Matrix3x4, Rotation3, UnitQuaternion, Vector3};

/// M = K R with K upper triangular and K_33 = 1, R a rotation, and the centre.
struct Parts {
    k: Matrix3<f64>,
    rotation: UnitQuaternion<f64>,
    centre: Vector3<f64>,
}

impl Parts {
    /// With the matrix E that exchanges the first and the last row, (E M)' = Q R gives M = (E R' E) (E Q').
    /// The signs are those of a rotation and of positive K_22 and K_33; in a left-handed world K_11 is
    /// negative.
    fn of(camera: &Camera) -> Self {
        let exchange = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
        let (q, r) = (exchange * camera.m()).transpose().qr().unpack();
        let (k, rotation) = (exchange * r.transpose() * exchange, exchange * q.transpose());
        let (second, third) = (k[(1, 1)].signum(), k[(2, 2)].signum());
        let signs =
            Matrix3::from_diagonal(&Vector3::new(second * third * rotation.determinant(), second, third));
        let (k, rotation) = (k * signs, Rotation3::from_matrix_unchecked(signs * rotation));
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Self { k: k / k[(2, 2)], rotation, centre: camera.centre() }
    }
}

impl Camera {
    /// The camera whose pose is the inverse of this one's: that of a matrix which maps to the world; `None`
    /// if it is singular.
    pub(crate) fn inverted(&self) -> Option<Self> {
        let Parts { k, rotation, centre } = Parts::of(self);
        let m = k * rotation.inverse().to_rotation_matrix().matrix();
        let mut matrix = Matrix3x4::zeros();
        matrix.fixed_columns_mut::<3>(0).copy_from(&m);
        matrix.set_column(3, &(m * (rotation * centre)));
        self.with_matrix(matrix)
    }

    /// The camera with another focal length and the same principal point; `None` if it is singular.
    pub(crate) fn zoomed(&self, factor: f64) -> Option<Self> {
        let mut k = Parts::of(self).k;
        let inverse = k.try_inverse()?;
        k.fixed_view_mut::<2, 2>(0, 0).scale_mut(factor);
        self.with_matrix(k * inverse * self.matrix)
    }

    /// The metric camera at the share t of the way to another one, 0 to 1: centre and calibration change
    /// linearly, and the rotation about one axis at constant speed. The lens is that of this camera.
    ///
    /// # Errors
    /// [`CameraError::Singular`] half-way between calibrations of opposite sign.
    pub fn towards(&self, other: &Self, t: f64) -> Result<Self, CameraError> {
        let (a, b) = (Parts::of(self), Parts::of(other));
        let k = a.k * (1.0 - t) + b.k * t;
        // Half a turn has no shortest way; any will do.
        let rotation = a.rotation.try_slerp(&b.rotation, t, 1e-9).unwrap_or(a.rotation);
        let m = k * rotation.to_rotation_matrix().matrix();
        let mut matrix = Matrix3x4::zeros();
        matrix.fixed_columns_mut::<3>(0).copy_from(&m);
        matrix.set_column(3, &(-m * (a.centre * (1.0 - t) + b.centre * t)));
        let mirrored = self.determinant() < 0.0;
        let camera = Self::metric(matrix, mirrored)?;
        Ok(self.lens.map_or(camera, |lens| camera.with_lens(lens)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(focal: f64, turn: f64, centre: [f64; 3], mirror: f64) -> Camera {
        let k = Matrix3::new(focal, 0.3, 50.0, 0.0, 1.1 * focal, 40.0, 0.0, 0.0, 1.0);
        let r = Rotation3::from_axis_angle(&Vector3::y_axis(), turn).matrix()
            * Matrix3::from_diagonal(&Vector3::new(mirror, 1.0, 1.0));
        let mut matrix = Matrix3x4::zeros();
        matrix.fixed_columns_mut::<3>(0).copy_from(&(k * r));
        matrix.set_column(3, &(-(k * r) * Vector3::from(centre)));
        Camera::metric(matrix, mirror < 0.0).unwrap()
    }

    #[test]
    fn ends_are_the_cameras_and_the_middle_is_half_way() {
        for mirror in [1.0, -1.0] {
            let at = |focal, turn, centre| camera(focal, turn, centre, mirror);
            let (a, b) = (at(100.0, 0.1, [0.0, 1.0, 2.0]), at(140.0, 0.5, [4.0, 1.0, 0.0]));
            let close = |x: &Camera, y: &Camera| (x.matrix() - y.matrix()).norm() < 1e-9 * y.matrix().norm();
            assert!(close(&a.towards(&b, 0.0).unwrap(), &a) && close(&a.towards(&b, 1.0).unwrap(), &b));
            assert!(close(&a.towards(&b, 0.5).unwrap(), &at(120.0, 0.3, [2.0, 1.0, 1.0])), "{mirror}");
        }
    }
}
