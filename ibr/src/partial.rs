//! Partial depth (thesis 2.4): a depth at every k-th pixel only, made dense before propagation.

use crate::depth::{DepthError, DepthMap};
use crate::image::Image;
use crate::restore::from_scattered;

/// Makes a map with one value every `step` pixels (the first at pixel (0, 0)) as large as its image. With a
/// step of one, a map most of whose values are unknown becomes dense, and another one stays as it is.
///
/// Between the samples is a spline with edges where the colours of the image change, in disparity or
/// reciprocal depth, in which planes are affine.
///
/// # Errors
/// [`DepthError`] of a map that does not fit the image.
pub fn densify(sparse: &DepthMap, step: usize, image: &Image) -> Result<DepthMap, DepthError> {
    sparse.fits(image.size(), step)?;
    Ok(match step {
        1 if sparse.is_scattered() => from_scattered(sparse, image),
        1 => sparse.clone(),
        _ => from_scattered(&placed(sparse, step, image), image),
    })
}

/// The samples at their pixels of an image, all others unknown.
pub(crate) fn placed(sparse: &DepthMap, step: usize, image: &Image) -> DepthMap {
    let (width, height) = image.size();
    let mut data = vec![f32::NAN; width * height];
    for (k, value) in sparse.data().iter().enumerate() {
        let (column, row) = (k % sparse.width(), k / sparse.width());
        data[row * step * width + column * step] = *value;
    }
    sparse.with_values((width, height), data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Measure;

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
            let dense = densify(&sparse, 6, &image).unwrap();
            assert_eq!(dense.measure(), measure);
            for (i, (a, b)) in dense.data().iter().zip(full.data()).enumerate() {
                // The weak smoothing bends the plane at the border.
                assert!((a / b - 1.0).abs() < 4e-3, "{measure:?} {i}: {a} {b}");
            }
        }
    }

    /// A bright square 20 px nearer than its dark background: the spline finds the edge to the pixel.
    #[test]
    fn depth_edges_follow_the_image() {
        let inside = |x: usize, y: usize| (13..33).contains(&x) && (9..28).contains(&y);
        let data = (0..48 * 40).map(|i| if inside(i % 48, i / 48) { 220.0 } else { 40.0 }).collect();
        let image = Image::new(48, 40, 1, data).unwrap();
        let full = map(48, 40, Measure::Disparity, |x, y| if inside(x, y) { 30.0 } else { 10.0 });
        let sparse = full.decimated(6).unwrap();
        let dense = densify(&sparse, 6, &image).unwrap();
        let wrong = dense.data().iter().zip(full.data()).filter(|(a, b)| (*a - *b).abs() > 1.0);
        assert_eq!(wrong.count(), 0);
    }

    #[test]
    fn unknown_samples_are_filled() {
        let image = Image::filled(13, 7, 1, 9.0);
        let mut data = vec![5.0; 3 * 2];
        data[0] = f32::NAN;
        let sparse = DepthMap::new((3, 2), data, 1.0, Measure::Depth).unwrap();
        let dense = densify(&sparse, 6, &image).unwrap();
        assert!(dense.data().iter().all(|d| (d - 5.0).abs() < 1e-3), "{:?}", dense.data());
    }

    #[test]
    fn a_map_of_another_step_is_refused() {
        let image = Image::filled(13, 7, 1, 9.0);
        let sparse = map(3, 2, Measure::Depth, |_, _| 1.0);
        assert!(densify(&sparse, 6, &image).is_ok());
        assert!(matches!(densify(&sparse, 4, &image), Err(DepthError::Size { .. })));
        assert!(matches!(densify(&sparse, 0, &image), Err(DepthError::Setting(_))));
        let whole = map(13, 7, Measure::Depth, |x, _| 1.0 + x as f32);
        assert_eq!(densify(&whole, 1, &image).unwrap(), whole);
    }
}
