//! Bundle adjustment in a projective frame: all cameras and points together.
//!
//! Levenberg-Marquardt on the distances between the images of points and where they are seen, with robust
//! weights (Hartley and Zisserman, *Multiple View Geometry*, 2nd ed., appendix 6; Triggs et al., *Bundle
//! Adjustment: A Modern Synthesis*, 1999). Cameras are 3 x 4 matrices and points 4-vectors, all up to scale,
//! and the frame is free: its 15 directions change no image, so the damping alone decides along them. The
//! points are eliminated from the normal equations (Schur complement), which leaves 12 unknowns for each
//! camera.

mod normal;
#[cfg(test)]
mod tests;

use super::Point;
use super::normalise::Normalisation;
use super::refine::descend;
use nalgebra::{Matrix3x4, Matrix4, Vector4};
use normal::NormalEquations;

/// A point seen by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The camera, from 0.
    pub camera: usize,
    /// The point, from 0.
    pub point: usize,
    /// Where it is seen, in pixels.
    pub image: Point,
}

/// Cameras, points and what the cameras see.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    /// 3 x 4 matrices, in pixels.
    pub cameras: Vec<Matrix3x4<f64>>,
    /// Homogeneous points of the frame.
    pub points: Vec<Vector4<f64>>,
    /// In the order of the points.
    pub observations: Vec<Observation>,
}

impl Bundle {
    /// Adjusts all cameras and points. A sighting with the distance d counts as `scale`^2 ln(1 + d^2 /
    /// `scale`^2), so that mistakes far beyond `scale` pixels hardly count (Cauchy).
    ///
    /// Cameras and points keep their signs; their scales are those of before. Returns whether no step lowers
    /// the cost any more; `None`, and nothing changed, if an observation names no camera or point, or the
    /// start is not finite.
    pub fn adjust(&mut self, scale: f64) -> Option<bool> {
        let frame = Frame::of(self)?;
        let (problem, start) = frame.normalised(self, scale);
        let (found, converged) =
            descend(start, |found| problem.cost(found), |found, damping| problem.moved(found, damping))?;
        frame.restore(&found, self);
        Some(converged)
    }
}

/// Cameras and points.
type Unknowns = (Vec<Matrix3x4<f64>>, Vec<Vector4<f64>>);

/// The problem in coordinates near one.
struct Problem {
    observations: Vec<Sight>,
    /// Of the robust cost, in pixels.
    scale: f64,
}

/// An observation in normalised coordinates.
struct Sight {
    camera: usize,
    point: usize,
    image: Point,
    /// Pixels per normalised unit.
    pixels: f64,
    /// The sign of the third coordinate of the image at the beginning: no point crosses the focal plane.
    sign: f64,
}

impl Problem {
    /// Mean cost per observation; `None` if a point crosses a focal plane or a number is not finite.
    fn cost(&self, (cameras, points): &Unknowns) -> Option<f64> {
        let square = self.scale * self.scale;
        let mut sum = 0.0;
        for o in &self.observations {
            let p = cameras[o.camera] * points[o.point];
            let miss = (p.xy() / p.z - o.image).norm_squared() * o.pixels * o.pixels;
            if !(p.z * o.sign > 0.0 && miss.is_finite()) {
                return None;
            }
            sum += square * (miss / square).ln_1p();
        }
        Some(sum / self.observations.len().max(1) as f64)
    }

    /// Cameras and points after one damped step, all of unit norm.
    fn moved(&self, (cameras, points): &Unknowns, damping: f64) -> Option<Unknowns> {
        let step = NormalEquations::of(self, cameras, points).solve(damping)?;
        let camera = |(camera, step): (&Matrix3x4<f64>, &nalgebra::SVector<f64, 12>)| {
            let moved = camera + Matrix3x4::from_row_slice(step.as_slice());
            moved / moved.norm()
        };
        let point = |(point, step): (&Vector4<f64>, &Vector4<f64>)| {
            let moved = point + step;
            moved / moved.norm()
        };
        let moved = cameras.iter().zip(&step.cameras).map(camera).collect();
        Some((moved, points.iter().zip(&step.points).map(point).collect()))
    }
}

/// Coordinates in which images and points are spread evenly.
struct Frame {
    images: Vec<Normalisation>,
    /// X = `space` X', for which the mean of X' X'' is the identity.
    space: Matrix4<f64>,
    inverse: Matrix4<f64>,
}

impl Frame {
    fn of(bundle: &Bundle) -> Option<Self> {
        let known = |o: &Observation| o.camera < bundle.cameras.len() && o.point < bundle.points.len();
        if !bundle.observations.iter().all(known) {
            return None;
        }
        let of_camera = |i: usize| {
            let own = bundle.observations.iter().filter(|o| o.camera == i);
            Normalisation::of(own.map(|o| &o.image).collect::<Vec<_>>().into_iter())
        };
        let unit = bundle.points.iter().map(Vector4::normalize);
        let spread: Matrix4<f64> =
            unit.map(|x| x * x.transpose()).sum::<Matrix4<f64>>() / bundle.points.len() as f64;
        let space = spread.cholesky()?.l();
        let inverse = space.try_inverse()?;
        Some(Self { images: (0..bundle.cameras.len()).map(of_camera).collect(), space, inverse })
    }

    fn normalised(&self, bundle: &Bundle, scale: f64) -> (Problem, Unknowns) {
        let camera = |(camera, image): (&Matrix3x4<f64>, &Normalisation)| {
            let camera = image.matrix() * camera * self.space;
            camera / camera.norm()
        };
        let cameras: Vec<_> = bundle.cameras.iter().zip(&self.images).map(camera).collect();
        let points: Vec<_> = bundle.points.iter().map(|x| (self.inverse * x).normalize()).collect();
        let sight = |o: &Observation| Sight {
            camera: o.camera,
            point: o.point,
            image: self.images[o.camera].apply(&o.image),
            pixels: 1.0 / self.images[o.camera].scale(),
            sign: (cameras[o.camera] * points[o.point]).z.signum(),
        };
        let observations = bundle.observations.iter().map(sight).collect();
        (Problem { observations, scale }, (cameras, points))
    }

    fn restore(&self, (cameras, points): &Unknowns, bundle: &mut Bundle) {
        for ((camera, found), image) in bundle.cameras.iter_mut().zip(cameras).zip(&self.images) {
            let found = image.inverse() * found * self.inverse;
            *camera = found * (camera.norm() / found.norm());
        }
        for (point, found) in bundle.points.iter_mut().zip(points) {
            let found = self.space * found;
            *point = found * (point.norm() / found.norm());
        }
    }
}
