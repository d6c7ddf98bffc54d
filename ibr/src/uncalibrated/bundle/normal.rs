//! The normal equations of a bundle, from which the points are eliminated.

use super::{Problem, Sight};
use crate::linear;
use nalgebra::{Matrix3x4, Matrix4, SMatrix, SVector, Vector2, Vector4};

/// Numbers of a camera.
const CAMERA: usize = 12;

type CameraMatrix = SMatrix<f64, CAMERA, CAMERA>;
type CameraVector = SVector<f64, CAMERA>;
/// Cross terms of a camera and a point.
type Cross = SMatrix<f64, CAMERA, 4>;

/// J' W J and J' W r, in the blocks of cameras and points.
pub(super) struct NormalEquations {
    cameras: Vec<(CameraMatrix, CameraVector)>,
    points: Vec<(Matrix4<f64>, Vector4<f64>)>,
    /// Of each point, its cameras.
    crosses: Vec<Vec<(usize, Cross)>>,
}

/// A step of all cameras and points.
pub(super) struct Step {
    pub(super) cameras: Vec<CameraVector>,
    pub(super) points: Vec<Vector4<f64>>,
}

/// The residual in pixels and its derivatives by the camera (row by row) and by the point.
pub(super) fn residual(
    camera: &Matrix3x4<f64>,
    point: &Vector4<f64>,
    sight: &Sight,
) -> (Vector2<f64>, SMatrix<f64, 2, CAMERA>, SMatrix<f64, 2, 4>) {
    let p = camera * point;
    let at = p.xy() / p.z;
    let unit = sight.pixels / p.z;
    let by_camera = SMatrix::<f64, 2, CAMERA>::from_fn(|r, k| match k {
        8.. => -at[r] * point[k - 8] * unit,
        _ if k / 4 == r => point[k % 4] * unit,
        _ => 0.0,
    });
    let by_point = SMatrix::<f64, 2, 4>::from_fn(|r, c| (camera[(r, c)] - at[r] * camera[(2, c)]) * unit);
    ((sight.image - at) * sight.pixels, by_camera, by_point)
}

impl NormalEquations {
    pub(super) fn of(problem: &Problem) -> Self {
        let mut all = Self {
            cameras: vec![(CameraMatrix::zeros(), CameraVector::zeros()); problem.cameras.len()],
            points: vec![(Matrix4::zeros(), Vector4::zeros()); problem.points.len()],
            crosses: vec![Vec::new(); problem.points.len()],
        };
        for sight in &problem.observations {
            let (i, j) = (sight.camera, sight.point);
            let (r, by_camera, by_point) = residual(&problem.cameras[i], &problem.points[j], sight);
            let weight = 1.0 / (1.0 + r.norm_squared() / (problem.scale * problem.scale));
            let weighted = weight * by_camera.transpose();
            all.cameras[i].0 += weighted * by_camera;
            all.cameras[i].1 += weighted * r;
            all.points[j].0 += weight * by_point.transpose() * by_point;
            all.points[j].1 += weight * by_point.transpose() * r;
            all.crosses[j].push((i, weighted * by_point));
        }
        all.pin_scales(problem);
        all
    }

    /// The norms of cameras and points are free; a weight like that of their other directions keeps them.
    fn pin_scales(&mut self, problem: &Problem) {
        for ((matrix, _), camera) in self.cameras.iter_mut().zip(&problem.cameras) {
            let own = CameraVector::from_fn(|k, _| camera[(k / 4, k % 4)]);
            *matrix += own * own.transpose() * (matrix.trace() / CAMERA as f64);
        }
        for ((matrix, _), point) in self.points.iter_mut().zip(&problem.points) {
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
        let mut matrix = vec![0.0; side * side];
        let mut rhs: Vec<f64> = self.cameras.iter().flat_map(|(_, b)| b.iter().copied()).collect();
        let mut add = |i: usize, k: usize, block: &CameraMatrix, sign: f64| {
            for (row, column) in (0..CAMERA).flat_map(|r| (0..CAMERA).map(move |c| (r, c))) {
                matrix[(i * CAMERA + row) * side + k * CAMERA + column] += sign * block[(row, column)];
            }
        };
        for (i, (block, _)) in self.cameras.iter().enumerate() {
            add(i, i, block, 1.0);
        }
        for ((seen, inverse), (_, c)) in self.crosses.iter().zip(inverses).zip(&self.points) {
            for (i, w) in seen {
                let eliminated = w * inverse;
                seen.iter().for_each(|(k, other)| add(*i, *k, &(eliminated * other.transpose()), -1.0));
                let change = eliminated * c;
                (0..CAMERA).for_each(|row| rhs[i * CAMERA + row] -= change[row]);
            }
        }
        let steps = linear::positive_solution(&matrix, &rhs)?;
        Some(steps.chunks_exact(CAMERA).map(CameraVector::from_column_slice).collect())
    }
}
