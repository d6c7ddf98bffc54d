//! The mean-shift filter: every pixel moves to the mode of the density around it.

use super::MeanShift;
use crate::image::{Image, colour};
use rayon::prelude::*;

/// Columns handled together; two of these hold the widest window.
const LANES: usize = 8;
/// The iteration of a pixel ends when half of a normalised step is shorter than this.
const SMALLEST_STEP: f32 = 0.1;

/// The mode of a pixel: position and colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Mode {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) luv: [f32; 3],
}

/// L, u and v, padded by LANES columns that lie outside any colour window.
struct Planes {
    width: usize,
    height: usize,
    stride: usize,
    luv: [Vec<f32>; 3],
}

impl Planes {
    fn new(image: &Image) -> Self {
        let (width, height) = image.size();
        let stride = width + 2 * LANES;
        let pad = |plane: Vec<f32>| {
            let mut padded = vec![1e9; stride * height];
            for (row, source) in padded.chunks_exact_mut(stride).zip(plane.chunks_exact(width)) {
                row[..width].copy_from_slice(source);
            }
            padded
        };
        Self { width, height, stride, luv: colour::luv_planes(image).map(pad) }
    }

    fn colour(&self, x: usize, y: usize) -> [f32; 3] {
        let at = y * self.stride + x;
        [self.luv[0][at], self.luv[1][at], self.luv[2][at]]
    }
}

/// The modes of all pixels, rows in parallel.
pub(super) fn modes(image: &Image, settings: &MeanShift) -> Vec<Mode> {
    let planes = Planes::new(image);
    let mut modes = vec![Mode::default(); planes.width * planes.height];
    modes.par_chunks_exact_mut(planes.width).enumerate().for_each(|(y, row)| {
        for (x, mode) in row.iter_mut().enumerate() {
            *mode = ascend(&planes, x, y, settings);
        }
    });
    modes
}

fn ascend(planes: &Planes, x: usize, y: usize, settings: &MeanShift) -> Mode {
    let mut at = Mode { x: x as f32, y: y as f32, luv: planes.colour(x, y) };
    let (hs, hr) = (settings.spatial as f32, settings.range);
    for _ in 0..settings.steps {
        let sums = window(planes, &at, hs, hr);
        // Rounding of the mean may leave an empty window; the pixel then keeps its position.
        if sums.count < 0.5 {
            break;
        }
        let share = 1.0 / sums.count;
        let (dx, dy) = (sums.x * share - at.x, sums.y * share - at.y);
        let d = sums.luv.map(|s| s * share);
        (at.x, at.y) = (at.x + dx, at.y + dy);
        at.luv.iter_mut().zip(d).for_each(|(c, d)| *c += d);
        let spatial = (dx * dx + dy * dy) / (hs * hs);
        let step = spatial + (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / (hr * hr);
        if step < SMALLEST_STEP * SMALLEST_STEP {
            break;
        }
    }
    at
}

/// Count, sums of positions and sums of colour differences in a window.
struct Sums {
    count: f32,
    x: f32,
    y: f32,
    luv: [f32; 3],
}

/// Sums over the pixels within h_s in both directions and h_r in colour.
fn window(planes: &Planes, at: &Mode, hs: f32, hr: f32) -> Sums {
    let top = (at.y - hs).ceil().max(0.0) as usize;
    let bottom = ((at.y + hs).floor() as usize).min(planes.height - 1);
    let left = (at.x - hs).ceil().max(0.0) as usize;
    let right = ((at.x + hs).floor() as usize).min(planes.width - 1);
    let mut sums = Sums { count: 0.0, x: 0.0, y: 0.0, luv: [0.0; 3] };
    let mut from = left;
    while from <= right {
        let columns = (right + 1 - from).min(LANES);
        add_columns(planes, at, hr, top..bottom + 1, from, columns, &mut sums);
        from += LANES;
    }
    sums
}

/// Adds the first `columns` of LANES neighbouring columns.
fn add_columns(
    planes: &Planes,
    at: &Mode,
    hr: f32,
    rows: std::ops::Range<usize>,
    from: usize,
    columns: usize,
    sums: &mut Sums,
) {
    let (mut count, mut y_sum) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    let mut luv = [[0.0_f32; LANES]; 3];
    // A lane beyond the window gets a radius within which no colour lies.
    let mut radius = [-1.0_f32; LANES];
    radius[..columns].fill(hr * hr);
    for y in rows {
        let start = y * planes.stride + from;
        let row = |c: usize| planes.luv[c][start..start + LANES].as_chunks::<LANES>().0[0];
        let (l, u, v) = (row(0), row(1), row(2));
        for i in 0..LANES {
            let (dl, du, dv) = (l[i] - at.luv[0], u[i] - at.luv[1], v[i] - at.luv[2]);
            let inside = if dl * dl + du * du + dv * dv <= radius[i] { 1.0 } else { 0.0 };
            count[i] += inside;
            y_sum[i] += inside * y as f32;
            luv[0][i] += inside * dl;
            luv[1][i] += inside * du;
            luv[2][i] += inside * dv;
        }
    }
    for i in 0..LANES {
        sums.count += count[i];
        sums.x += count[i] * (from + i) as f32;
        sums.y += y_sum[i];
        sums.luv.iter_mut().zip(&luv).for_each(|(s, l)| *s += l[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patterned(width: usize, height: usize) -> Image {
        let value = |i: usize| ((i * i * 31 + i * 17) % 97) as f32 * 2.0;
        Image::new(width, height, 3, (0..width * height * 3).map(value).collect()).unwrap()
    }

    /// One window sum by its definition.
    #[test]
    fn windows_hold_what_the_definition_says() {
        let image = patterned(23, 17);
        let planes = Planes::new(&image);
        for (x, y, hs, hr) in [(0.0, 0.0, 7.0, 40.0), (11.3, 8.8, 7.0, 60.0), (22.0, 16.0, 3.0, 90.0)] {
            let at = Mode { x, y, luv: planes.colour(x as usize, y as usize) };
            let sums = window(&planes, &at, hs, hr);
            let mut want = [0.0; 3];
            for j in 0..17 {
                for i in 0..23 {
                    let c = planes.colour(i, j);
                    let square: f32 = c.iter().zip(at.luv).map(|(a, b)| (a - b) * (a - b)).sum();
                    let near = (i as f32 - x).abs() <= hs && (j as f32 - y).abs() <= hs;
                    if near && square <= hr * hr {
                        want[0] += 1.0;
                        want[1] += i as f32;
                        want[2] += j as f32;
                    }
                }
            }
            assert_eq!([sums.count, sums.x, sums.y], want);
        }
    }

    #[test]
    fn a_window_as_large_as_colour_finds_the_mean_of_the_image() {
        let image = patterned(7, 7);
        let settings = MeanShift { range: 1e4, ..MeanShift::default() };
        for mode in modes(&image, &settings) {
            assert!((mode.x - 3.0).abs() < 1e-4 && (mode.y - 3.0).abs() < 1e-4, "{mode:?}");
        }
    }
}
