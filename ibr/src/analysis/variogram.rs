//! How much the intensity differs between two pixels of a row, by their distance: what a guess costs.

use crate::image::Image;

/// Largest distance, in pixels.
const FARTHEST: usize = 64;

/// Mean of |I(x) - I(x + d)| over the pixels and channels of images.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variogram {
    differences: Vec<f64>,
}

impl Variogram {
    pub(super) fn of(images: &[Image]) -> Self {
        let mut sums = vec![(0.0, 0.0); FARTHEST + 1];
        for image in images {
            let channels = image.channels();
            for row in (0..image.height()).step_by(4).map(|y| image.row(y)) {
                for (d, sum) in sums.iter_mut().enumerate().take(image.width()).skip(1) {
                    let pairs = row.iter().zip(&row[d * channels..]);
                    sum.0 += pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
                    sum.1 += (row.len() - d * channels) as f64;
                }
            }
        }
        Self { differences: sums.iter().map(|(sum, count)| sum / f64::max(*count, 1.0)).collect() }
    }

    /// The mean difference at a distance, that of the largest beyond it.
    pub(super) fn at(&self, distance: usize) -> f64 {
        self.differences[distance.min(FARTHEST)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_differs_in_proportion_to_the_distance() {
        let ramp = Image::new(100, 8, 1, (0..800).map(|i| (i % 100) as f32).collect()).unwrap();
        let variogram = Variogram::of(&[ramp]);
        for d in [0, 1, 5, 64] {
            assert!((variogram.at(d) - d as f64).abs() < 1e-9);
        }
        assert_eq!(variogram.at(500), variogram.at(64));
    }
}
