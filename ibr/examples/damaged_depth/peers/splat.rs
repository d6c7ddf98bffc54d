//! Forward splats: each pixel is drawn where it lies in the virtual view.

use super::{Canvas, Photograph, Virtual, colour};
use hybank_ibr::image::Image;
use hybank_ibr::propagate::Viewpoint;
use std::error::Error;

/// A pixel of a photograph, in the virtual view.
struct Splat {
    at: [f64; 2],
    parallax: f64,
    colour: [f64; 3],
    view: usize,
}

fn splats<P: Viewpoint>(photographs: &[Photograph<P>], to: &Virtual<P>) -> Vec<Splat> {
    let mut all = Vec::new();
    for (view, photograph) in photographs.iter().enumerate() {
        let (map, width) = (photograph.camera.map_to(&to.camera), photograph.image.width());
        for (pixel, number) in photograph.numbers.iter().enumerate() {
            let (x, y, there) = map((pixel % width) as f64, (pixel / width) as f64, *number);
            let colour = colour(&photograph.image, pixel);
            all.push(Splat { at: [x + to.offset, y], parallax: to.parallax(there), colour, view });
        }
    }
    all
}

/// The four pixels around a place, with the weights of a bilinear footprint.
fn footprint([x, y]: [f64; 2], (width, height): (usize, usize)) -> impl Iterator<Item = (usize, f64)> {
    let (left, top) = (x.floor(), y.floor());
    let corners = [[left, top], [left + 1.0, top], [left, top + 1.0], [left + 1.0, top + 1.0]];
    corners.into_iter().filter_map(move |[cx, cy]| {
        let weight = (1.0 - (x - cx).abs()) * (1.0 - (y - cy).abs());
        let is_inside = cx >= 0.0 && cy >= 0.0 && cx < width as f64 && cy < height as f64;
        (is_inside && weight > 1e-3).then(|| (cy as usize * width + cx as usize, weight))
    })
}

/// The nearest surface at the nearest pixel.
pub(super) fn nearest<P: Viewpoint>(
    photographs: &[Photograph<P>],
    to: &Virtual<P>,
) -> Result<Image, Box<dyn Error>> {
    let mut canvas = Canvas::new(to.size);
    let mut front = vec![f64::MIN; to.size.0 * to.size.1];
    for splat in splats(photographs, to) {
        for (pixel, _) in footprint(splat.at.map(f64::round), to.size) {
            if splat.parallax > front[pixel] {
                front[pixel] = splat.parallax;
                canvas.sums[pixel] = [0.0; 4];
                canvas.add(pixel, splat.colour, 1.0);
            }
        }
    }
    canvas.image()
}

/// Bilinear footprints of all views that are near the front, the nearer ones exponentially more.
pub(super) fn soft<P: Viewpoint>(
    photographs: &[Photograph<P>],
    to: &Virtual<P>,
    weights: &[f64],
    same: f64,
) -> Result<Image, Box<dyn Error>> {
    let splats = splats(photographs, to);
    let mut front = vec![f64::MIN; to.size.0 * to.size.1];
    for splat in &splats {
        for (pixel, _) in footprint(splat.at, to.size) {
            front[pixel] = front[pixel].max(splat.parallax);
        }
    }
    let mut canvas = Canvas::new(to.size);
    for splat in &splats {
        for (pixel, part) in footprint(splat.at, to.size) {
            let nearness = ((splat.parallax - front[pixel]) / same).exp();
            canvas.add(pixel, splat.colour, part * nearness * weights[splat.view]);
        }
    }
    canvas.image()
}
