//! The plainest view from tracks: what the rendering without cameras is compared with.

use hybank_ibr::image::Image;
use hybank_ibr::uncalibrated::Point;
use spade::{DelaunayTriangulation, FloatTriangulation, HasPosition, Point2, Triangulation};

/// A point in the virtual view and in two photographs.
#[derive(Clone, Copy)]
pub(crate) struct Corner {
    pub(crate) place: Point,
    pub(crate) shown: [Point; 2],
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.place.x, self.place.y)
    }
}

/// The mean of two photographs by the affine maps of Delaunay triangles, and where it is: in the hull of the
/// corners, where a photograph shows something.
pub(crate) fn morph(images: &[Image], corners: &[Corner], size: (usize, usize)) -> (Image, Vec<bool>) {
    let mut mesh: DelaunayTriangulation<Corner> = DelaunayTriangulation::new();
    corners.iter().for_each(|corner| _ = mesh.insert(*corner).unwrap());
    let (mesh, channels) = (mesh.barycentric(), images[0].channels());
    let (mut values, mut region) = (vec![0.0; size.0 * size.1 * channels], vec![false; size.0 * size.1]);
    for (pixel, value) in values.chunks_exact_mut(channels).enumerate() {
        let at = Point2::new((pixel % size.0) as f64, (pixel / size.0) as f64);
        let place = |i: usize, k: usize| mesh.interpolate(|corner| corner.data().shown[i][k], at);
        let shown = |(i, image)| bilinear(image, place(i, 0)?, place(i, 1)?);
        let colours: Vec<Vec<f32>> = images.iter().enumerate().filter_map(shown).collect();
        colours
            .iter()
            .flat_map(|c| c.iter().enumerate())
            .for_each(|(k, v)| value[k] += v / colours.len() as f32);
        region[pixel] = !colours.is_empty();
    }
    (Image::new(size.0, size.1, channels, values).unwrap(), region)
}

/// The colour between four pixels; `None` outside of the image.
fn bilinear(image: &Image, x: f64, y: f64) -> Option<Vec<f32>> {
    let (width, height) = image.size();
    if !(x >= 0.0 && y >= 0.0 && x <= width as f64 - 1.0 && y <= height as f64 - 1.0) {
        return None;
    }
    let (left, top) = ((x as usize).min(width - 2), (y as usize).min(height - 2));
    let (a, b) = ((x - left as f64) as f32, (y - top as f64) as f32);
    let pixel = |i: usize, j: usize, k: usize| image.row(top + j)[(left + i) * image.channels() + k];
    let row = |j: usize, k: usize| (1.0 - a) * pixel(0, j, k) + a * pixel(1, j, k);
    Some((0..image.channels()).map(|k| (1.0 - b) * row(0, k) + b * row(1, k)).collect())
}
