//! Partial depth (thesis 2.4): a depth at every k-th pixel only, made dense before propagation.

mod grid;
mod segmentwise;

use crate::depth::{DepthError, DepthMap};
use crate::image::Image;
use crate::segment::segment;

/// How a coarse map is made dense.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[non_exhaustive]
pub enum Densify {
    /// Interpolate within segments of image and depth.
    #[default]
    Segmentwise,
    /// Bilinear interpolation everywhere.
    Bilinear,
    /// The value of the nearest sample.
    Nearest,
}

/// Makes a map with one value every `step` pixels (the first at pixel (0, 0)) as large as its image.
///
/// Unknown samples take the nearest known one first. Pixels right of or below the last samples use the last
/// column or row. Disparity is interpolated as it is and depth by its reciprocal, in which planes are
/// affine.
///
/// # Errors
/// [`DepthError`] of a map that does not fit the image.
pub fn densify(
    sparse: &DepthMap,
    step: usize,
    image: &Image,
    method: Densify,
) -> Result<DepthMap, DepthError> {
    sparse.fits(image.size(), step)?;
    if step == 1 {
        return Ok(sparse.clone());
    }
    let grid = grid::Grid::new(sparse, step, image.size());
    let values = match method {
        Densify::Bilinear => grid.bilinear(),
        Densify::Nearest => grid.nearest(),
        Densify::Segmentwise => segmentwise::interpolate(&grid, &segment(image)),
    };
    Ok(grid.into_map(values, sparse))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Measure;

    const METHODS: [Densify; 3] = [Densify::Bilinear, Densify::Nearest, Densify::Segmentwise];

    fn map(width: usize, height: usize, measure: Measure, f: impl Fn(usize, usize) -> f32) -> DepthMap {
        let data = (0..width * height).map(|i| f(i % width, i / width)).collect();
        DepthMap::new((width, height), data, 1.0, measure).unwrap()
    }

    #[test]
    fn a_plane_is_found_again() {
        let image = Image::filled(31, 25, 1, 100.0);
        let plane = |x: usize, y: usize| 20.0 + 0.05 * x as f32 - 0.03 * y as f32;
        for (measure, f) in [
            (Measure::Disparity, Box::new(plane) as Box<dyn Fn(usize, usize) -> f32>),
            (Measure::Depth, Box::new(move |x, y| 1.0 / plane(x, y))),
        ] {
            let full = map(31, 25, measure, &f);
            let sparse = full.decimated(6).unwrap();
            for method in [METHODS[0], METHODS[2]] {
                let dense = densify(&sparse, 6, &image, method).unwrap();
                assert_eq!(dense.measure(), measure);
                for (i, (a, b)) in dense.data().iter().zip(full.data()).enumerate() {
                    // 30 and 24 are sampled: nothing is extrapolated.
                    assert!((a / b - 1.0).abs() < 1e-5, "{measure:?} {i}: {a} {b}");
                }
            }
        }
    }

    /// A bright square 20 px nearer than its dark background: segmentwise finds the edge to the pixel.
    #[test]
    fn depth_edges_follow_the_image() {
        let inside = |x: usize, y: usize| (13..33).contains(&x) && (9..28).contains(&y);
        let data = (0..48 * 40).map(|i| if inside(i % 48, i / 48) { 220.0 } else { 40.0 }).collect();
        let image = Image::new(48, 40, 1, data).unwrap();
        let full = map(48, 40, Measure::Disparity, |x, y| if inside(x, y) { 30.0 } else { 10.0 });
        let sparse = full.decimated(6).unwrap();
        let wrong = |method: Densify| {
            let dense = densify(&sparse, 6, &image, method).unwrap();
            dense.data().iter().zip(full.data()).filter(|(a, b)| (*a - *b).abs() > 1.0).count()
        };
        assert_eq!(wrong(METHODS[2]), 0);
        assert!(wrong(METHODS[0]) > 200 && wrong(METHODS[1]) > 50);
    }

    #[test]
    fn unknown_samples_take_the_nearest_known_one() {
        let image = Image::filled(13, 7, 1, 9.0);
        let mut data = vec![5.0; 3 * 2];
        data[0] = f32::NAN;
        let sparse = DepthMap::new((3, 2), data, 1.0, Measure::Depth).unwrap();
        for method in METHODS {
            let dense = densify(&sparse, 6, &image, method).unwrap();
            assert!(dense.data().iter().all(|d| (d - 5.0).abs() < 1e-5), "{method:?}");
        }
    }

    #[test]
    fn a_map_of_another_step_is_refused() {
        let image = Image::filled(13, 7, 1, 9.0);
        let sparse = map(3, 2, Measure::Depth, |_, _| 1.0);
        assert!(densify(&sparse, 6, &image, METHODS[0]).is_ok());
        assert!(matches!(densify(&sparse, 4, &image, METHODS[0]), Err(DepthError::Size { .. })));
        assert!(matches!(densify(&sparse, 0, &image, METHODS[0]), Err(DepthError::Step)));
        let whole = map(13, 7, Measure::Depth, |x, _| 1.0 + x as f32);
        assert_eq!(densify(&whole, 1, &image, METHODS[2]).unwrap(), whole);
    }
}
