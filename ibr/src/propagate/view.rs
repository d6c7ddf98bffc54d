//! Views: photographs with their maps and cameras.

use crate::camera::Camera;
use crate::depth::{DepthMap, FAR};
use crate::image::Image;
use nalgebra::Vector3;

/// A photograph with its map. The camera is the position on the line of a rectified rig, or a matrix.
#[derive(Debug, Clone, Copy)]
pub struct View<'a, P> {
    /// Intensities.
    pub image: &'a Image,
    /// Disparities in pixels for a baseline of one, or depths in the scale of the camera, of the size of the
    /// image.
    pub map: &'a DepthMap,
    /// The camera.
    pub camera: P,
}

/// One view of a rectified rig: the camera centres lie on a line parallel to the image rows, and the camera
/// is its position there in units of the baseline.
pub type RectifiedView<'a> = View<'a, f64>;

/// One view of a general rig.
pub type CalibratedView<'a> = View<'a, Camera>;

/// The camera of a view.
pub trait Viewpoint: Copy + Send + Sync {
    /// The centre: a point, or a place on the x axis.
    fn centre(&self) -> Vector3<f64>;

    /// Distance of the centres of two cameras.
    fn distance(&self, other: &Self) -> f64 {
        (self.centre() - other.centre()).norm()
    }

    /// The map of pixels with the numbers of their map from this camera to another one.
    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync;

    /// Mean displacement in pixels per parallax, disparity or reciprocal depth, at another camera of points
    /// that are far away; 0 at the same place.
    fn displacement(&self, other: &Self, size: (usize, usize)) -> f64;

    /// The camera of the photograph with one pixel for `by` x `by`, and with the same numbers of the map.
    fn reduced(&self, by: usize) -> Self;
}

/// Of some views, by number, the one that is nearest to a view; of several the first.
pub(crate) fn nearest<P: Viewpoint>(
    views: &[View<'_, P>],
    view: usize,
    among: impl Iterator<Item = usize>,
) -> Option<usize> {
    let away = among.map(|other| (other, views[other].camera.distance(&views[view].camera)));
    away.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(other, _)| other)
}

impl Viewpoint for f64 {
    fn centre(&self) -> Vector3<f64> {
        Vector3::new(*self, 0.0, 0.0)
    }

    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync {
        let shift = self - other;
        move |x, y, disparity| (x + shift * disparity, y, disparity)
    }

    fn displacement(&self, other: &Self, _: (usize, usize)) -> f64 {
        (self - other).abs()
    }

    fn reduced(&self, by: usize) -> Self {
        self / by as f64
    }
}

impl Viewpoint for Camera {
    fn centre(&self) -> Vector3<f64> {
        Camera::centre(self)
    }

    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync {
        let map = self.relative_to(other);
        move |x, y, depth| map.map(x, y, depth)
    }

    fn displacement(&self, other: &Self, size: (usize, usize)) -> f64 {
        let map = self.relative_to(other);
        // Of points so far away that depth does not turn their displacement.
        let depth = 1e3 * self.distance(other);
        let moved = |share: f64| {
            let (x, y) = (share * size.0 as f64, share * size.1 as f64);
            let ((a, b, _), (c, d, _)) = (map.map(x, y, f64::from(FAR)), map.map(x, y, depth));
            (c - a).hypot(d - b) * depth
        };
        if depth > 0.0 { [0.25, 0.5, 0.75].map(moved).iter().sum::<f64>() / 3.0 } else { 0.0 }
    }

    fn reduced(&self, by: usize) -> Self {
        // A camera stays one by factors that are positive and finite.
        self.resized([1.0 / by as f64; 2]).unwrap_or(*self)
    }
}
