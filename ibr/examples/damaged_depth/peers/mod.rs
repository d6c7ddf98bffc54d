//! What the rendering is compared with: the plain ways to a virtual view from photographs and depth, which
//! take the damaged maps as they are.

mod mesh;
mod splat;

use hybank_ibr::image::{Image, MOST_PIXELS, read_image, read_map};
use hybank_ibr::propagate::Viewpoint;
use hybank_ibr::scene::SceneSpec;
use spade::{DelaunayTriangulation, FloatTriangulation, HasPosition, Point2, Triangulation};
use std::error::Error;
use std::path::Path;

/// Depths of infinity are this far away here.
const FAR: f64 = 1e10;
/// Surfaces whose parallax differs by less than this share of its range are one.
const SAME: f64 = 0.02;

/// A photograph in colour with a number at each pixel: its disparity or depth.
pub(crate) struct Photograph<P> {
    image: Image,
    numbers: Vec<f64>,
    camera: P,
}

/// A virtual view that is to be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Virtual<P> {
    pub(crate) camera: P,
    pub(crate) size: (usize, usize),
    pub(crate) offset: f64,
    pub(crate) is_depth: bool,
}

impl<P> Virtual<P> {
    /// Larger is nearer, and affine on planes.
    fn parallax(&self, number: f64) -> f64 {
        if self.is_depth { 1.0 / number } else { number }
    }
}

/// The views of a scene with its maps as they stand. `cameras` are those of the views; every `step`-th value
/// of the maps is known.
pub(crate) fn photographs<P: Copy>(
    spec: &SceneSpec,
    path: &Path,
    step: usize,
    cameras: &[P],
) -> Result<Vec<Photograph<P>>, Box<dyn Error>> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let mut found = Vec::new();
    for (view, camera) in spec.view.iter().zip(cameras) {
        let image = read_image(&beside.join(&view.image), MOST_PIXELS)?.to_rgb();
        let Some(map) = view.depth.as_ref().or(view.disparity.as_ref()) else { continue };
        let (width, _, values) = read_map(&beside.join(map), MOST_PIXELS)?;
        let scale = view.depth_scale.or(view.disparity_scale).or(spec.disparity_scale).unwrap_or(1.0);
        let is_known = |pixel: usize, v: f32| {
            v > 0.0 && (pixel % width).is_multiple_of(step) && (pixel / width).is_multiple_of(step)
        };
        let number =
            |(pixel, v): (usize, &f32)| is_known(pixel, *v).then(|| (f64::from(*v) / scale).min(FAR));
        let known: Vec<Option<f64>> = values.iter().enumerate().map(number).collect();
        found.push(Photograph { image, numbers: interpolated(&known, width)?, camera: *camera });
    }
    Ok(found)
}

/// A known number of a map.
struct Known {
    at: Point2<f64>,
    number: f64,
}

impl HasPosition for Known {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Unknown numbers by Delaunay triangles of known ones; outside of their hull by the nearest one.
fn interpolated(known: &[Option<f64>], width: usize) -> Result<Vec<f64>, Box<dyn Error>> {
    let at = |pixel: usize| Point2::new((pixel % width) as f64, (pixel / width) as f64);
    if known.iter().all(Option::is_some) {
        return Ok(known.iter().copied().flatten().collect());
    }
    let corners = known.iter().enumerate().filter_map(|(k, n)| Some(Known { at: at(k), number: (*n)? }));
    let mesh = DelaunayTriangulation::<Known>::bulk_load(corners.collect())?;
    let between = mesh.barycentric();
    let nearest = |at| mesh.nearest_neighbor(at).map_or(FAR, |corner| corner.data().number);
    let value = |(pixel, known): (usize, &Option<f64>)| {
        known
            .or_else(|| between.interpolate(|c| c.data().number, at(pixel)))
            .unwrap_or_else(|| nearest(at(pixel)))
    };
    Ok(known.iter().enumerate().map(value).collect())
}

/// The peers with the views that they draw.
pub(crate) fn views<P: Viewpoint>(
    photographs: &[Photograph<P>],
    to: &Virtual<P>,
) -> Result<Vec<(&'static str, Image)>, Box<dyn Error>> {
    let numbers = || photographs.iter().flat_map(|p| &p.numbers).map(|n| to.parallax(*n));
    let range = numbers().fold(f64::MIN, f64::max) - numbers().fold(f64::MAX, f64::min);
    let weights: Vec<f64> =
        photographs.iter().map(|p| 1.0 / p.camera.distance(&to.camera).max(1e-6)).collect();
    let mesh = mesh::Mesh::of(photographs, to, &weights, SAME * range);
    let mut blend = Canvas::new(to.size);
    for (photograph, weight) in photographs.iter().zip(&weights).filter(|(p, _)| p.image.size() == to.size) {
        (0..to.size.0 * to.size.1).for_each(|k| blend.add(k, colour(&photograph.image, k), *weight));
    }
    Ok(vec![
        ("blend", blend.image()?),
        ("splat", splat::nearest(photographs, to)?),
        ("soft splat", splat::soft(photographs, to, &weights, SAME * range)?),
        ("mesh", mesh.view()?),
        ("backward", mesh.backward(photographs, to, &weights, SAME * range)?),
    ])
}

/// Colours, and how much each one weighs.
#[derive(Clone)]
struct Canvas {
    width: usize,
    sums: Vec<[f64; 4]>,
}

impl Canvas {
    fn new((width, height): (usize, usize)) -> Self {
        Self { width, sums: vec![[0.0; 4]; width * height] }
    }

    fn add(&mut self, pixel: usize, colour: [f64; 3], weight: f64) {
        let sum = &mut self.sums[pixel];
        colour.iter().zip(sum.iter_mut()).for_each(|(c, s)| *s += weight * c);
        sum[3] += weight;
    }

    /// The mean colours; where there is none, the mean of the nearest ones around, ring by ring.
    fn image(mut self) -> Result<Image, Box<dyn Error>> {
        let (width, height) = (self.width, self.sums.len() / self.width);
        self.sums.iter_mut().filter(|s| s[3] > 0.0).for_each(|s| *s = s.map(|v| v / s[3]));
        for _ in 0..width.max(height) {
            let before = self.sums.clone();
            if before.iter().all(|s| s[3] > 0.0) {
                break;
            }
            for pixel in (0..before.len()).filter(|k| before[*k][3] == 0.0) {
                let (x, y) = (pixel % width, pixel / width);
                let beside = [(x > 0, pixel.wrapping_sub(1)), (x + 1 < width, pixel + 1)];
                let above = [(y > 0, pixel.wrapping_sub(width)), (y + 1 < height, pixel + width)];
                let seen = beside.into_iter().chain(above).filter(|(is_inside, _)| *is_inside);
                let seen: Vec<[f64; 4]> = seen.map(|(_, k)| before[k]).filter(|s| s[3] > 0.0).collect();
                let mean = |k: usize| seen.iter().map(|s| s[k]).sum::<f64>() / seen.len().max(1) as f64;
                self.sums[pixel] = std::array::from_fn(mean);
            }
        }
        let data = self.sums.iter().flat_map(|s| [s[0] as f32, s[1] as f32, s[2] as f32]).collect();
        Ok(Image::new(width, height, 3, data)?)
    }
}

/// The colour of a pixel.
fn colour(image: &Image, pixel: usize) -> [f64; 3] {
    image.pixel::<3>(pixel).map(f64::from)
}
