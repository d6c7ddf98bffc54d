//! Views: photographs with their maps and cameras.

use crate::camera::Camera;
use crate::depth::DepthMap;
use crate::image::Image;

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
    /// Distance of the centres of two cameras.
    fn distance(&self, other: &Self) -> f64;

    /// The map of pixels with the numbers of their map from this camera to another one.
    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync;
}

impl Viewpoint for f64 {
    fn distance(&self, other: &Self) -> f64 {
        (self - other).abs()
    }

    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync {
        let shift = self - other;
        move |x, y, disparity| (x + shift * disparity, y, disparity)
    }
}

impl Viewpoint for Camera {
    fn distance(&self, other: &Self) -> f64 {
        (self.centre() - other.centre()).norm()
    }

    fn map_to(&self, other: &Self) -> impl Fn(f64, f64, f64) -> (f64, f64, f64) + Sync {
        let map = self.relative_to(other);
        move |x, y, depth| map.map(x, y, depth)
    }
}

impl<P: Viewpoint> View<'_, P> {
    /// Of the views before one, by number, the one that is nearest to it.
    pub(crate) fn nearest_before(views: &[Self], view: usize) -> Option<usize> {
        let distance = |other: &usize| views[*other].camera.distance(&views[view].camera);
        (0..view).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}
