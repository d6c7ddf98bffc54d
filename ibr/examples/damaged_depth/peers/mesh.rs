//! Warped meshes: each photograph is a mesh of triangles between its pixels. Triangles that stretch count
//! less, as in view synthesis for immersive video (MPEG's RVS). The front of the meshes is the depth of the
//! virtual view by which colours are fetched backwards.

use super::{Canvas, Photograph, Virtual, colour};
use hybank_ibr::image::Image;
use hybank_ibr::propagate::Viewpoint;
use std::error::Error;

/// A corner of a triangle in the virtual view.
#[derive(Clone, Copy)]
struct Corner {
    at: [f64; 2],
    number: f64,
    colour: [f64; 3],
}

/// The front of one photograph's mesh at a pixel.
#[derive(Clone, Copy)]
struct Front {
    parallax: f64,
    colour: [f64; 3],
    quality: f64,
}

const NOTHING: Front = Front { parallax: f64::MIN, colour: [0.0; 3], quality: 0.0 };

/// All photographs in the virtual view.
pub(super) struct Mesh {
    canvas: Canvas,
    /// Parallax of what is seen at each pixel; the least number where nothing is.
    front: Vec<f64>,
}

impl Mesh {
    pub(super) fn of<P: Viewpoint>(
        photographs: &[Photograph<P>],
        to: &Virtual<P>,
        weights: &[f64],
        same: f64,
    ) -> Self {
        let fronts: Vec<Vec<Front>> = photographs.iter().map(|p| drawn(p, to)).collect();
        let mut canvas = Canvas::new(to.size);
        let mut front = vec![f64::MIN; to.size.0 * to.size.1];
        for (pixel, front) in front.iter_mut().enumerate() {
            let here = || fronts.iter().map(|f| &f[pixel]).zip(weights).filter(|(f, _)| f.quality > 0.0);
            // What stretches from one surface to the next is in front of nothing that is seen well.
            let best = here().map(|(f, _)| f.quality).fold(0.0, f64::max);
            let well = here().filter(|(f, _)| f.quality >= 0.1 * best);
            *front = well.map(|(f, _)| f.parallax).fold(f64::MIN, f64::max);
            for (f, weight) in here() {
                canvas.add(
                    pixel,
                    f.colour,
                    weight * f.quality * ((f.parallax - *front) / same).min(0.0).exp(),
                );
            }
        }
        Self { canvas, front }
    }

    pub(super) fn view(&self) -> Result<Image, Box<dyn Error>> {
        self.canvas.clone().image()
    }

    /// Each pixel takes its colour from the photographs that see its surface, by bicubic interpolation.
    pub(super) fn backward<P: Viewpoint>(
        &self,
        photographs: &[Photograph<P>],
        to: &Virtual<P>,
        weights: &[f64],
        same: f64,
    ) -> Result<Image, Box<dyn Error>> {
        let mut canvas = Canvas::new(to.size);
        for (photograph, weight) in photographs.iter().zip(weights) {
            let map = to.camera.map_to(&photograph.camera);
            let size = photograph.image.size();
            for (pixel, parallax) in self.front.iter().enumerate().filter(|(_, p)| **p > f64::MIN) {
                let number = if to.is_depth { 1.0 / parallax } else { *parallax };
                let at = [(pixel % to.size.0) as f64 - to.offset, (pixel / to.size.0) as f64];
                let (x, y, there) = map(at[0], at[1], number);
                if !(x >= 0.0 && y >= 0.0 && x <= size.0 as f64 - 1.0 && y <= size.1 as f64 - 1.0) {
                    continue;
                }
                let shown = photograph.numbers[y.round() as usize * size.0 + x.round() as usize];
                let hidden_by = (to.parallax(shown) - to.parallax(there)).max(0.0);
                canvas.add(
                    pixel,
                    bicubic(&photograph.image, x, y),
                    weight * (-hidden_by / same).exp().max(1e-9),
                );
            }
        }
        canvas.image()
    }
}

/// The mesh of a photograph, drawn with the nearest surface in front.
fn drawn<P: Viewpoint>(photograph: &Photograph<P>, to: &Virtual<P>) -> Vec<Front> {
    let (map, (width, height)) = (photograph.camera.map_to(&to.camera), photograph.image.size());
    let corner = |x: usize, y: usize| {
        let pixel = y * width + x;
        let (u, v, number) = map(x as f64, y as f64, photograph.numbers[pixel]);
        Corner {
            at: [u + to.offset, v],
            number: to.parallax(number),
            colour: colour(&photograph.image, pixel),
        }
    };
    let corners: Vec<Corner> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| corner(x, y)).collect();
    let mut fronts = vec![NOTHING; to.size.0 * to.size.1];
    for y in 0..height - 1 {
        for x in 0..width - 1 {
            let [a, b, c, d] =
                [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| corners[y * width + x]);
            triangle([a, b, c], to.size, &mut fronts);
            triangle([d, c, b], to.size, &mut fronts);
        }
    }
    fronts
}

fn triangle(corners: [Corner; 3], (width, height): (usize, usize), fronts: &mut [Front]) {
    let [a, b, c] = corners.map(|c| c.at);
    let cross =
        |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let area = cross(a, b, c);
    // A triangle that turns its back lies on no surface.
    if !(area > 1e-9 && area.is_finite()) {
        return;
    }
    let edge = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
    let longest = edge(a, b).max(edge(b, c)).max(edge(c, a));
    let quality = 1.0 / (longest / 2_f64.sqrt()).max(1.0).powi(4);
    let ends = |k: usize, most: usize| {
        let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
        (low.ceil().max(0.0) as usize, (high.floor() + 1.0).clamp(0.0, most as f64) as usize)
    };
    let ((left, right), (top, bottom)) = (ends(0, width), ends(1, height));
    for y in top..bottom {
        for x in left..right {
            let p = [x as f64, y as f64];
            let parts = [cross(b, c, p), cross(c, a, p), cross(a, b, p)].map(|part| part / area);
            if parts.iter().any(|part| *part < -1e-9) {
                continue;
            }
            let of = |value: &dyn Fn(&Corner) -> f64| -> f64 {
                corners.iter().zip(parts).map(|(corner, part)| part * value(corner)).sum()
            };
            let front = &mut fronts[y * width + x];
            let parallax = of(&|corner| corner.number);
            if parallax > front.parallax {
                let colour = std::array::from_fn(|k| of(&|corner| corner.colour[k]));
                *front = Front { parallax, colour, quality };
            }
        }
    }
}

/// Catmull and Rom's interpolation; pixels beyond the border are those of the border.
fn bicubic(image: &Image, x: f64, y: f64) -> [f64; 3] {
    let weights = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        [-t + 2.0 * t2 - t3, 2.0 - 5.0 * t2 + 3.0 * t3, t + 4.0 * t2 - 3.0 * t3, t3 - t2].map(|w| w / 2.0)
    };
    let (across, down) = (weights(x.fract()), weights(y.fract()));
    let within =
        |start: f64, k: usize, most: usize| (start.floor() as usize + k).saturating_sub(1).min(most - 1);
    let mut sum = [0.0; 3];
    for (j, wy) in down.iter().enumerate() {
        for (i, wx) in across.iter().enumerate() {
            let (row, column) = (within(y, j, image.height()), within(x, i, image.width()));
            let seen = colour(image, row * image.width() + column);
            sum.iter_mut().zip(seen).for_each(|(s, c)| *s += wx * wy * c);
        }
    }
    sum
}
