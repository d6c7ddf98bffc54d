//! Conversion from and to the types of the `image` crate.

use super::Image;
use crate::files::InputError;
use ::image::{DynamicImage, ImageBuffer};

/// Bits per value of a PNG file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Levels {
    /// 256 levels.
    #[default]
    #[value(name = "8")]
    Eight,
    /// 65536 levels: white is 65535.
    #[value(name = "16")]
    Sixteen,
}

/// An image with 8 bits per value: RGB, or grey.
impl From<&Image> for DynamicImage {
    fn from(image: &Image) -> Self {
        image.to_dynamic(Levels::Eight)
    }
}

/// Grey or RGB, 8 or 16 bits or floats (white is 1), with or without alpha, which is ignored.
///
/// # Errors
/// [`InputError::Buffer`] for an image without pixels.
impl TryFrom<&DynamicImage> for Image {
    type Error = InputError;

    fn try_from(picture: &DynamicImage) -> Result<Self, InputError> {
        Ok(super::read::Stored::of(picture)?.intensities())
    }
}

impl Image {
    /// The image with so many levels per value, rounded half up.
    pub fn to_dynamic(&self, levels: Levels) -> DynamicImage {
        picture(self.data.iter().copied(), self.size(), self.channels, levels)
    }
}

/// A picture of values 0..255: grey, grey with alpha, RGB, or RGB with alpha.
pub(super) fn picture(
    values: impl Iterator<Item = f32>,
    size: (usize, usize),
    channels: usize,
    levels: Levels,
) -> DynamicImage {
    let (width, height) = (size.0 as u32, size.1 as u32);
    let made = match levels {
        Levels::Eight => {
            let data: Vec<u8> = values.map(super::to_byte).collect();
            match channels {
                1 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageLuma8),
                2 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageLumaA8),
                3 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageRgb8),
                _ => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageRgba8),
            }
        }
        Levels::Sixteen => {
            // 65535 / 255 = 257.
            let data: Vec<u16> = values.map(|v| (v.clamp(0.0, 255.0) * 257.0 + 0.5) as u16).collect();
            match channels {
                1 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageLuma16),
                2 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageLumaA16),
                3 => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageRgb16),
                _ => ImageBuffer::from_raw(width, height, data).map(DynamicImage::ImageRgba16),
            }
        }
    };
    // The buffer has width * height * channels values by construction.
    made.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_come_back_as_they_were() {
        for channels in [1, 3] {
            let values: Vec<f32> = (0..12 * channels).map(|i| (i * 7 % 256) as f32).collect();
            let image = Image::new(4, 3, channels, values).unwrap();
            for levels in [Levels::Eight, Levels::Sixteen] {
                let picture = image.to_dynamic(levels);
                assert_eq!((picture.width(), picture.height()), (4, 3));
                assert_eq!(picture.color().has_color(), channels == 3);
                assert_eq!(Image::try_from(&picture).unwrap(), image);
            }
            assert_eq!(Image::try_from(&DynamicImage::from(&image)).unwrap(), image);
        }
    }

    #[test]
    fn floats_and_alpha_are_read() {
        let floats = ImageBuffer::from_raw(1, 1, vec![1.0_f32, 0.5, 0.0]).map(DynamicImage::ImageRgb32F);
        assert_eq!(Image::try_from(&floats.unwrap()).unwrap().data(), [255.0, 127.5, 0.0]);
        let alpha = ImageBuffer::from_raw(1, 1, vec![7, 9]).map(DynamicImage::ImageLumaA8);
        assert_eq!(Image::try_from(&alpha.unwrap()).unwrap().data(), [7.0]);
        assert!(Image::try_from(&DynamicImage::new_rgb8(0, 0)).is_err());
    }
}
