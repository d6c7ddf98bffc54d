//! Segmentation of an image by mean shift (Comaniciu and Meer, IEEE Trans. PAMI 24(5), 2002).

mod filter;
mod regions;

use crate::image::Image;

/// Settings of the mean-shift segmentation; the defaults are those of the authors' own program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanShift {
    /// h_s: half side of the window in pixels, at most 7.
    pub spatial: usize,
    /// h_r: radius of the window in CIE Luv.
    pub range: f32,
    /// Regions with fewer pixels are merged into the neighbour of nearest colour; 1 keeps all.
    pub smallest: usize,
    /// Most steps per pixel.
    pub steps: usize,
}

impl Default for MeanShift {
    fn default() -> Self {
        Self { spatial: 7, range: 6.5, smallest: 20, steps: 20 }
    }
}

/// Settings of the segmentation outside their range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SegmentError {
    /// The window in the image.
    #[error("the spatial window is {spatial} px: it must be 1 to {largest}")]
    Spatial {
        /// Value given.
        spatial: usize,
        /// Largest window.
        largest: usize,
    },
    /// The window in colour.
    #[error("the colour window is {range}: it must be a positive number")]
    Range {
        /// Value given.
        range: f32,
    },
}

/// Segments of an image: one label per pixel, 0.., in the order of their first pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segments {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Label of each pixel, row by row.
    pub labels: Vec<u32>,
    /// Number of segments.
    pub count: usize,
}

/// Largest half side of the spatial window: 2 * 7 + 1 columns fill two vectors of eight.
const LARGEST_WINDOW: usize = 7;

impl MeanShift {
    /// Segments an image: filter, link, merge.
    ///
    /// Pixels move to the mode of the density of (x/h_s, y/h_s, L/h_r, u/h_r, v/h_r) with a flat kernel;
    /// neighbours whose modes differ by less than h_r / 2 in colour (and h_s in position) belong to one
    /// segment. Parallel over rows, same result for any number of threads.
    ///
    /// # Errors
    /// [`SegmentError`].
    pub fn segment(&self, image: &Image) -> Result<Segments, SegmentError> {
        let (spatial, range) = (self.spatial, self.range);
        if spatial == 0 || spatial > LARGEST_WINDOW {
            return Err(SegmentError::Spatial { spatial, largest: LARGEST_WINDOW });
        }
        if !(range.is_finite() && range > 0.0) {
            return Err(SegmentError::Range { range });
        }
        let modes = filter::modes(image, self);
        Ok(regions::connect(image.size(), &modes, self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(width: usize, height: usize) -> Image {
        let pixel = |i: usize| {
            let (x, y) = (i % width, i / width);
            let noise = ((i * 7919) % 5) as f32;
            match (x < width / 2, y < height / 2) {
                (true, true) => [200.0 + noise, 30.0, 30.0],
                (true, false) => [30.0, 200.0 + noise, 30.0],
                (false, true) => [30.0, 30.0, 200.0 + noise],
                (false, false) => [220.0, 220.0 + noise, 220.0],
            }
        };
        Image::new(width, height, 3, (0..width * height).flat_map(pixel).collect()).unwrap()
    }

    #[test]
    fn four_noisy_blocks_are_four_segments() {
        let segments = MeanShift::default().segment(&blocks(40, 30)).unwrap();
        assert_eq!(segments.count, 4);
        for y in 0..30 {
            for x in 0..40 {
                let want = segments.labels[if y < 15 { 0 } else { 29 * 40 } + if x < 20 { 0 } else { 39 }];
                assert_eq!(segments.labels[y * 40 + x], want, "({x}, {y})");
            }
        }
    }

    #[test]
    fn a_flat_image_is_one_segment_and_a_speck_is_merged() {
        let mut image = Image::filled(25, 9, 1, 90.0);
        assert_eq!(MeanShift::default().segment(&image).unwrap().count, 1);
        image.data_mut()[4 * 25 + 12] = 250.0;
        let keep = MeanShift { smallest: 1, ..MeanShift::default() };
        assert_eq!(keep.segment(&image).unwrap().count, 2);
        assert_eq!(MeanShift::default().segment(&image).unwrap().count, 1);
        assert_eq!(MeanShift::default().segment(&Image::filled(1, 1, 3, 5.0)).unwrap().count, 1);
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let image = blocks(33, 21);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| MeanShift::default().segment(&image).unwrap())
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn windows_have_limits() {
        let image = Image::filled(3, 3, 1, 0.0);
        for spatial in [0, 8] {
            let odd = MeanShift { spatial, ..MeanShift::default() };
            assert!(matches!(odd.segment(&image), Err(SegmentError::Spatial { .. })));
        }
        let odd = MeanShift { range: f32::NAN, ..MeanShift::default() };
        assert!(matches!(odd.segment(&image), Err(SegmentError::Range { .. })));
    }
}
