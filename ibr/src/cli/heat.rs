//! Maps of a quantity as pictures: black is zero, then violet, red and yellow, and white is the largest.

use super::failure::Failure;
use super::output::{self, Encoded, ends_with};
use crate::image::{Image, Levels, pfm};
use std::path::Path;

/// The colours from zero to one, evenly spaced.
const COLOURS: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [80.0, 10.0, 110.0], [210.0, 50.0, 50.0], [250.0, 190.0, 40.0], [255.0, 255.0, 255.0]];

/// The file of a quantity: its `numbers` (.pfm), or the picture of its `values` and the value that is white.
pub(super) fn encoded<'a>(
    values: &[f32],
    size: (usize, usize),
    path: &'a Path,
    numbers: impl FnOnce() -> Image,
) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    if ends_with(path, "pfm") {
        return Ok((Encoded { bytes: pfm::encode(&numbers()), path }, None));
    }
    let (map, white) = map(values, size);
    Ok((output::encoded(&map, path, Levels::Eight)?, Some(white)))
}

/// A picture of values that are not negative, and the value that is white: all but one in a hundred are not
/// larger.
fn map(values: &[f32], (width, height): (usize, usize)) -> (Image, f32) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let white = sorted[(sorted.len() - 1) * 99 / 100].max(f32::MIN_POSITIVE);
    let mut image = Image::filled(width, height, 3, 0.0);
    for (pixel, value) in image.data_mut().chunks_exact_mut(3).zip(values) {
        pixel.copy_from_slice(&colour(value / white));
    }
    (image, white)
}

fn colour(part: f32) -> [f32; 3] {
    let last = COLOURS.len() - 1;
    let at = part.clamp(0.0, 1.0) * last as f32;
    let below = (at as usize).min(last - 1);
    let rest = at - below as f32;
    std::array::from_fn(|c| COLOURS[below][c] * (1.0 - rest) + COLOURS[below + 1][c] * rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_black_and_the_largest_white() {
        let values: Vec<f32> = (0..200).map(|i| i as f32).collect();
        let (image, white) = map(&values, (20, 10));
        assert_eq!(white, 197.0);
        assert_eq!(image.pixel::<3>(0), [0.0; 3]);
        assert_eq!(image.pixel::<3>(199), [255.0; 3]);
        let brightness = |p: usize| image.pixel::<3>(p).iter().sum::<f32>();
        assert!((1..200).all(|p| brightness(p) >= brightness(p - 1)));
        assert_eq!(map(&[0.0; 4], (2, 2)).0.pixel::<3>(3), [0.0; 3]);
    }
}
