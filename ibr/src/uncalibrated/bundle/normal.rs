//! The normal equations of a bundle, from which the points are eliminated.

use super::Problem;
use crate::uncalibrated::refine::reprojection;
use hybank_linalg::{Mat, solve_positive};
use nalgebra::{Matrix3x4, Matrix4, SMatrix, SVector, Vector4};

const CAMERA: usize = 12;

type CameraMatrix = SMatrix<f64, CAMERA, CAMERA>;
type CameraVector = SVector<f64, CAMERA>;
type Cross = SMatrix<f64, CAMERA, 4>;

/// J' W J and J' W r, in the blocks of cameras and points.
pub(super) struct NormalEquations {
    cameras: Vec<(CameraMatrix, CameraVector)>,
    points: Vec<(Matrix4<f64>, Vector4<f64>)>,
    /// Of each point, its cameras.
    crosses: Vec<Vec<(usize, Cross)>>,
}

pub(super) struct Step {
    pub(super) cameras: Vec<CameraVector>,
    pub(super) points: Vec<Vector4<f64>>,
}

impl NormalEquations {
    pub(super) fn of(problem: &Problem, cameras: &[Matrix3x4<f64>], points: &[Vector4<f64>]) -> Self {
        let mut all = Self {
            cameras: vec![(CameraMatrix::zeros(), CameraVector::zeros()); cameras.len()],
            points: vec![(Matrix4::zeros(), Vector4::zeros()); points.len()],
            crosses: vec![Vec::new(); points.len()],
        };
        for sight in &problem.observations {
            let (i, j) = (sight.camera, sight.point);
            let (r, by_camera, by_point) = reprojection(&cameras[i], &points[j], &sight.image);
            let square = sight.pixels * sight.pixels;
            let weight = square / (1.0 + square * r.norm_squared() / (problem.scale * problem.scale));
            let weighted = weight * by_camera.transpose();
            all.cameras[i].0 += weighted * by_camera;
            all.cameras[i].1 += weighted * r;
            all.points[j].0 += weight * by_point.transpose() * by_point;
            all.points[j].1 += weight * by_point.transpose() * r;
            all.crosses[j].push((i, weighted * by_point));
        }
        all.pin_scales(cameras, points);
        all
    }

    /// The norms of cameras and points are free; a weight like that of their other directions keeps them.
    fn pin_scales(&mut self, cameras: &[Matrix3x4<f64>], points: &[Vector4<f64>]) {
        for ((matrix, _), camera) in self.cameras.iter_mut().zip(cameras) {
            let own = CameraVector::from_fn(|k, _| camera[(k / 4, k % 4)]);
            *matrix += own * own.transpose() * (matrix.trace() / CAMERA as f64);
        }
        for ((matrix, _), point) in self.points.iter_mut().zip(points) {
            *matrix += point * point.transpose() * (matrix.trace() / 4.0);
        }
    }

    /// The step of the damped equations; `None` if they are not positive definite.
    pub(super) fn solve(mut self, damping: f64) -> Option<Step> {
        let damp = |diagonal: &mut f64, mean: f64| *diagonal += damping * (*diagonal + 1e-3 * mean);
        for (matrix, _) in &mut self.cameras {
            let mean = matrix.trace() / CAMERA as f64;
            (0..CAMERA).for_each(|k| damp(&mut matrix[(k, k)], mean));
        }
        for (matrix, _) in &mut self.points {
            let mean = matrix.trace() / 4.0;
            (0..4).for_each(|k| damp(&mut matrix[(k, k)], mean));
        }
        let inverses: Option<Vec<Matrix4<f64>>> = self.points.iter().map(|(v, _)| v.try_inverse()).collect();
        let inverses = inverses?;
        let cameras = self.reduced(&inverses)?;
        let point = |(j, inverse): (usize, &Matrix4<f64>)| {
            let known: Vector4<f64> = self.crosses[j].iter().map(|(i, w)| w.transpose() * cameras[*i]).sum();
            inverse * (self.points[j].1 - known)
        };
        let points = inverses.iter().enumerate().map(point).collect();
        Some(Step { cameras, points })
    }

    /// The steps of the cameras: (U - W V^{-1} W') a = b - W V^{-1} c.
    fn reduced(&self, inverses: &[Matrix4<f64>]) -> Option<Vec<CameraVector>> {
        let side = CAMERA * self.cameras.len();
        let (mut matrix, mut rhs) = (Mat::zeros(side, side), Mat::zeros(side, 1));
        for (i, (block, b)) in self.cameras.iter().enumerate() {
            let at = i * CAMERA;
            matrix.fixed_view_mut::<CAMERA, CAMERA>(at, at).copy_from(block);
            rhs.fixed_view_mut::<CAMERA, 1>(at, 0).copy_from(b);
        }
        for ((seen, inverse), (_, c)) in self.crosses.iter().zip(inverses).zip(&self.points) {
            for (i, w) in seen {
                let eliminated = w * inverse;
                for (k, other) in seen {
                    let mut block = matrix.fixed_view_mut::<CAMERA, CAMERA>(i * CAMERA, k * CAMERA);
                    block -= eliminated * other.transpose();
                }
                let mut change = rhs.fixed_view_mut::<CAMERA, 1>(i * CAMERA, 0);
                change -= eliminated * c;
            }
        }
        let steps = solve_positive(&matrix, &rhs).ok()?;
        Some(steps.as_slice().chunks_exact(CAMERA).map(CameraVector::from_column_slice).collect())
    }
}
