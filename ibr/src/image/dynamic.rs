//! Conversion from and to the types of the `image` crate.

use super::{Image, ImageError, Levels};
use ::image::{DynamicImage, ImageBuffer};

/// An image with 8 bits per value: RGB, or grey.
impl From<&Image> for DynamicImage {
    fn from(image: &Image) -> Self {
        image.to_dynamic(Levels::Eight)
    }
}

/// Grey or RGB, 8 or 16 bits or floats (white is 1), with or without alpha, which is ignored.
///
/// # Errors
/// [`ImageError::Buffer`] for an image without pixels.
impl TryFrom<&DynamicImage> for Image {
    type Error = ImageError;

    fn try_from(picture: &DynamicImage) -> Result<Self, ImageError> {
        super::read::whole_image(picture, 1.0)
    }
}

impl Image {
    /// The image with so many levels per value, rounded half up.
    pub fn to_dynamic(&self, levels: Levels) -> DynamicImage {
        let (width, height) = (self.width as u32, self.height as u32);
        let shallow = || self.to_bytes();
        let deep = || self.data.iter().map(|v| super::write::deep_level(*v)).collect::<Vec<u16>>();
        let made = match (self.channels, levels) {
            (3, Levels::Eight) => {
                ImageBuffer::from_raw(width, height, shallow()).map(DynamicImage::ImageRgb8)
            }
            (3, Levels::Sixteen) => {
                ImageBuffer::from_raw(width, height, deep()).map(DynamicImage::ImageRgb16)
            }
            (_, Levels::Eight) => {
                ImageBuffer::from_raw(width, height, shallow()).map(DynamicImage::ImageLuma8)
            }
            (_, Levels::Sixteen) => {
                ImageBuffer::from_raw(width, height, deep()).map(DynamicImage::ImageLuma16)
            }
        };
        // The buffer has width * height * channels values by construction.
        made.unwrap_or_default()
    }
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
