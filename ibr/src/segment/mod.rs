//! Segmentation of an image by mean shift (Comaniciu and Meer, IEEE Trans. PAMI 24(5), 2002).

mod filter;
mod regions;

use crate::image::Image;

/// Settings of the segmentation; the defaults are those of the authors' own program.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MeanShift {
    /// h_s: half side of the window in pixels, 1 to 7: 2 * 7 + 1 columns fill two vectors of eight.
    spatial: usize,
    /// h_r: radius of the window in CIE Luv.
    range: f32,
    /// Regions with fewer pixels are merged into the neighbour of nearest colour; 1 keeps all.
    smallest: usize,
    /// Most steps per pixel.
    steps: usize,
}

impl Default for MeanShift {
    fn default() -> Self {
        Self { spatial: 7, range: 6.5, smallest: 20, steps: 20 }
    }
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

/// Segments an image: filter, link, merge.
///
/// Pixels move to the mode of the density of (x/h_s, y/h_s, L/h_r, u/h_r, v/h_r) with a flat kernel;
/// neighbours whose modes differ by less than h_r / 2 in colour (and h_s in position) belong to one
/// segment. Parallel over rows, same result for any number of threads.
pub fn segment(image: &Image) -> Segments {
    MeanShift::default().segment(image)
}

impl MeanShift {
    fn segment(&self, image: &Image) -> Segments {
        regions::connect(image.size(), &filter::modes(image, self), self)
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
        let segments = segment(&blocks(40, 30));
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
        assert_eq!(segment(&image).count, 1);
        image.data_mut()[4 * 25 + 12] = 250.0;
        let keep = MeanShift { smallest: 1, ..MeanShift::default() };
        assert_eq!(keep.segment(&image).count, 2);
        assert_eq!(segment(&image).count, 1);
        assert_eq!(segment(&Image::filled(1, 1, 3, 5.0)).count, 1);
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let image = blocks(33, 21);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| segment(&image))
        };
        assert_eq!(run(1), run(3));
    }
}
