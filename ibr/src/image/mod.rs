//! Images: intensities 0..255 as f32, one or three interleaved channels, pixel centres at integers.

mod colmap_map;
mod dynamic;
mod float;
pub mod pfm;
pub mod quality;
mod read;
mod source;
mod texture;
mod write;
pub mod y4m;

pub use dynamic::Levels;
pub use read::{MOST_PIXELS, read_image, read_map};
pub(crate) use read::{image_size, read_photograph};
pub use texture::Texture;
pub(crate) use write::write_file;
pub use write::{encode, encode_with_alpha, save};

use crate::files::InputError;

/// A grey or RGB image, rows from the top, channels interleaved; black is 0 and white 255.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<f32>,
}

impl Image {
    /// An image from its values.
    ///
    /// # Errors
    /// [`InputError::Buffer`] unless `channels` is 1 or 3, neither side is 0 and the sizes multiply.
    pub fn new(width: usize, height: usize, channels: usize, data: Vec<f32>) -> Result<Self, InputError> {
        let expected = width.saturating_mul(height).saturating_mul(channels);
        if expected == 0 || !(channels == 1 || channels == 3) || data.len() != expected {
            return Err(InputError::Buffer { width, height, channels, expected, given: data.len() });
        }
        Ok(Self { width, height, channels, data })
    }

    /// An image of values whose number is right by construction.
    pub(crate) fn from_values((width, height): (usize, usize), channels: usize, data: Vec<f32>) -> Self {
        assert_eq!(data.len(), width * height * channels);
        Self { width, height, channels, data }
    }

    /// An image of one value, with sides of at least one pixel; `channels` 3 is RGB, all else grey.
    pub fn filled(width: usize, height: usize, channels: usize, value: f32) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let channels = if channels == 3 { 3 } else { 1 };
        Self { width, height, channels, data: vec![value; width * height * channels] }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// 1 for grey, 3 for RGB.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All values, row by row, channels interleaved.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All values, for writing.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// One row, channels interleaved.
    pub fn row(&self, y: usize) -> &[f32] {
        let stride = self.width * self.channels;
        &self.data[y * stride..(y + 1) * stride]
    }

    /// The value of a pixel in C channels: grey is repeated, RGB asked for as grey gives its first C.
    #[inline]
    pub fn pixel<const C: usize>(&self, index: usize) -> [f32; C] {
        let start = index * self.channels;
        if self.channels == C {
            // The usual case in one piece, without a test for each channel.
            if let Some(pixel) = self.data[start..].first_chunk::<C>() {
                return *pixel;
            }
        }
        std::array::from_fn(|c| self.data[start + c.min(self.channels - 1)])
    }

    /// The number of the pixel at a position.
    #[inline]
    pub(crate) fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {
        let is_inside = x > -0.5 && y > -0.5 && x < self.width as f64 - 0.5 && y < self.height as f64 - 0.5;
        is_inside.then(|| (y + 0.5) as usize * self.width + (x + 0.5) as usize)
    }

    /// A channel at a position, linear between pixels; NaN outside.
    #[inline]
    pub(crate) fn value_at(&self, x: f64, y: f64, channel: usize) -> f32 {
        if !(x >= 0.0 && y >= 0.0 && x <= (self.width - 1) as f64 && y <= (self.height - 1) as f64) {
            return f32::NAN;
        }
        let (column, row) = (x as u32, y as u32);
        let (a, b) = ((x - f64::from(column)) as f32, (y - f64::from(row)) as f32);
        let here = (row as usize * self.width + column as usize) * self.channels + channel;
        let right = if a > 0.0 { self.channels } else { 0 };
        let below = if b > 0.0 { self.width * self.channels } else { 0 };
        let along = |i: usize| self.data[i] * (1.0 - a) + self.data[i + right] * a;
        along(here) * (1.0 - b) + along(here + below) * b
    }

    /// A channel at a position, by cubic interpolation between pixels and linear beside the border; NaN
    /// outside.
    #[inline]
    pub(crate) fn cubic_at(&self, x: f64, y: f64, channel: usize) -> f32 {
        if !(x >= 1.0 && y >= 1.0 && x < self.width as f64 - 2.0 && y < self.height as f64 - 2.0) {
            return self.value_at(x, y, channel);
        }
        let (column, row) = (x as usize, y as usize);
        let (across, down) = (cubic_weights(x.fract() as f32), cubic_weights(y.fract() as f32));
        let first = ((row - 1) * self.width + column - 1) * self.channels + channel;
        let of_row = |k: usize| {
            let start = first + k * self.width * self.channels;
            (0..4).map(|i| across[i] * self.data[start + i * self.channels]).sum::<f32>()
        };
        (0..4).map(|k| down[k] * of_row(k)).sum()
    }

    /// The image after so many quarter turns to the right.
    pub(crate) fn turned(&self, quarters: usize) -> Self {
        (0..quarters).fold(self.clone(), |image, _| image.turned_right())
    }

    fn turned_right(&self) -> Self {
        let columns = (0..self.width).flat_map(|x| (0..self.height).rev().map(move |y| y * self.width + x));
        let pixel = |p: usize| &self.data[p * self.channels..(p + 1) * self.channels];
        let data = columns.flat_map(pixel).copied().collect();
        Self { width: self.height, height: self.width, channels: self.channels, data }
    }

    /// The same image with three channels.
    pub fn to_rgb(&self) -> Self {
        if self.channels == 3 {
            return self.clone();
        }
        let data = self.data.iter().flat_map(|v| [*v; 3]).collect();
        Self { channels: 3, data, ..*self }
    }

    /// Luma with the weights of ITU-R BT.601; a grey image as it is.
    pub fn to_grey(&self) -> Self {
        if self.channels == 1 {
            return self.clone();
        }
        let luma = |p: &[f32]| 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
        Self { channels: 1, data: self.data.chunks_exact(3).map(luma).collect(), ..*self }
    }

    /// One pixel, the mean, for each `by` x `by`; the last column and row are repeated where some are
    /// missing.
    pub fn reduced(&self, by: usize) -> Self {
        let (width, height) = (self.width.div_ceil(by), self.height.div_ceil(by));
        let mean = |i: usize| {
            let (p, c) = (i / self.channels, i % self.channels);
            let (x, y) = (p % width * by, p / width * by);
            let row = |k: usize| self.row((y + k / by).min(self.height - 1));
            let value = |k: usize| row(k)[(x + k % by).min(self.width - 1) * self.channels + c];
            (0..by * by).map(value).sum::<f32>() / (by * by) as f32
        };
        Self { width, height, data: (0..width * height * self.channels).map(mean).collect(), ..*self }
    }

    /// Every value rounded half up to a whole number in 0..=255, as it would be in an 8-bit file.
    pub fn quantised(&self) -> Self {
        let data = self.data.iter().map(|v| f32::from(to_byte(*v))).collect();
        Self { data, ..*self }
    }

    /// Refuses another image of a different size; the names appear in the message.
    ///
    /// # Errors
    /// [`InputError::Sizes`].
    pub fn same_size(&self, name: &str, other: (usize, usize), other_name: &str) -> Result<(), InputError> {
        if self.size() == other {
            return Ok(());
        }
        Err(InputError::Sizes { left: name.into(), right: other_name.into(), sizes: [self.size(), other] })
    }
}

/// Weights of the four pixels around a place, 0 to 1 beyond the second: cubic interpolation of Catmull and
/// Rom.
pub(crate) fn cubic_weights(t: f32) -> [f32; 4] {
    [
        t * (t * (2.0 - t) - 1.0) / 2.0,
        (t * t * (3.0 * t - 5.0) + 2.0) / 2.0,
        t * (t * (4.0 - 3.0 * t) + 1.0) / 2.0,
        t * t * (t - 1.0) / 2.0,
    ]
}

/// Rounds half up into 0..=255; NaN becomes 0.
#[inline]
pub(crate) fn to_byte(value: f32) -> u8 {
    (value + 0.5).floor().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_once() {
        assert!(Image::new(2, 2, 3, vec![0.0; 12]).is_ok());
        assert!(matches!(
            Image::new(2, 2, 3, vec![0.0; 11]),
            Err(InputError::Buffer { expected: 12, given: 11, .. })
        ));
        assert!(Image::new(0, 2, 1, vec![]).is_err());
        assert!(Image::new(1, 1, 2, vec![0.0; 2]).is_err());
    }

    #[test]
    fn bytes_round_half_up_and_saturate() {
        for (value, byte) in
            [(-3.0, 0), (0.49, 0), (0.5, 1), (1.5, 2), (254.5, 255), (300.0, 255), (f32::NAN, 0)]
        {
            assert_eq!(to_byte(value), byte, "{value}");
        }
    }

    #[test]
    fn grey_and_colour_convert_into_each_other() {
        let grey = Image::new(2, 1, 1, vec![10.0, 20.0]).unwrap();
        assert_eq!(grey.to_rgb().data(), [10.0, 10.0, 10.0, 20.0, 20.0, 20.0]);
        let back = grey.to_rgb().to_grey();
        assert!(back.data().iter().zip(grey.data()).all(|(a, b)| (a - b).abs() < 1e-4));
        assert_eq!(grey.pixel::<3>(1), [20.0; 3]);
    }

    /// Quadratic polynomials are interpolated exactly, and pixels have their values.
    #[test]
    fn cubic_interpolation_is_right_to_the_second_order() {
        let value = |x: f64, y: f64| 3.0 + 0.5 * x * x - 0.3 * x * y + 0.2 * y * y;
        let data = (0..10 * 9).map(|p| value(f64::from(p % 10), f64::from(p / 10)) as f32).collect();
        let image = Image::new(10, 9, 1, data).unwrap();
        for (x, y) in [(3.3, 4.7), (1.0, 1.0), (7.9, 6.5), (5.0, 2.25)] {
            assert!((f64::from(image.cubic_at(x, y, 0)) - value(x, y)).abs() < 1e-4, "{x} {y}");
        }
        assert!((image.cubic_at(0.5, 3.0, 0) - image.value_at(0.5, 3.0, 0)).abs() < 1e-6);
        assert!(image.cubic_at(-0.1, 3.0, 0).is_nan());
    }

    #[test]
    fn different_sizes_are_named() {
        let message = Image::filled(4, 3, 1, 0.0).same_size("left", (5, 3), "truth").unwrap_err().to_string();
        assert_eq!(message, "left has 4 x 3 pixels and truth has 5 x 3: they must agree");
    }
}
