//! Coarse disparities made dense by bilinear interpolation: what the spline of the crate is compared with.

use hybank_ibr::depth::{DepthMap, fill_unknown};
use hybank_ibr::image::Image;

/// A map with one value every `step` pixels, as large as `image`.
pub(crate) fn bilinear(coarse: &DepthMap, step: usize, image: &Image) -> DepthMap {
    let (width, height) = image.size();
    let mut coarse = coarse.clone();
    fill_unknown(&mut coarse);
    let (columns, rows) = coarse.size();
    let at = |i: usize, j: usize| coarse.data()[j.min(rows - 1) * columns + i.min(columns - 1)];
    let value = |p: usize| {
        let (x, y) = (p % width, p / width);
        let part = |v: usize| (v % step) as f32 / step as f32;
        let along = |j: usize| {
            let i = x / step;
            at(i, j) * (1.0 - part(x)) + at(i + 1, j) * part(x)
        };
        along(y / step) * (1.0 - part(y)) + along(y / step + 1) * part(y)
    };
    let data = (0..width * height).map(value).collect();
    DepthMap::new((width, height), data, 1.0, coarse.measure()).unwrap()
}
