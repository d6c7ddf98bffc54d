//! Reading images and depth maps from files.

use super::source::Source;
use super::{Image, colmap_map, float, pfm};
use crate::files::{self, CHECK_THE_PATH, InputError};
use image::{DynamicImage, ImageReader};
use std::io::Cursor;
use std::path::Path;

/// Default of the most pixels of an image or map: 5792 x 5792, whose rendering takes 2 to 4 gigabytes.
pub const MOST_PIXELS: usize = 1 << 25;

/// Reads a grey or RGB image of at most `most` pixels; 16-bit values are scaled to 0..255, PFM values
/// (white = 1) times 255.
///
/// An alpha channel is ignored.
///
/// # Errors
/// [`InputError`], naming the file.
pub fn read_image(path: &Path, most: usize) -> Result<Image, InputError> {
    Ok(load(path, most)?.intensities())
}

/// The same with the pixels that are transparent; none are listed of an opaque image.
///
/// # Errors
/// As [`read_image`].
pub(crate) fn read_photograph(path: &Path, most: usize) -> Result<(Image, Vec<bool>), InputError> {
    let mut stored = load(path, most)?;
    let transparent = std::mem::take(&mut stored.transparent);
    Ok((stored.intensities(), transparent))
}

/// Width and height of an image; its pixels are not unpacked where the format allows that.
///
/// # Errors
/// As [`read_image`].
pub(crate) fn image_size(path: &Path) -> Result<(usize, usize), InputError> {
    let header = ImageReader::open(path).and_then(ImageReader::with_guessed_format).ok();
    match header.and_then(|reader| reader.into_dimensions().ok()) {
        Some((width, height)) => Ok((width as usize, height as usize)),
        None => Ok(read_image(path, MOST_PIXELS)?.size()),
    }
}

/// Reads a map of one value per pixel and of at most `most` pixels, as stored: 0..255, 0..65535 or floats.
///
/// Returns width, height and the values, rows from the top.
///
/// # Errors
/// As [`read_image`], and for an RGB file whose channels differ.
pub fn read_map(path: &Path, most: usize) -> Result<(usize, usize, Vec<f32>), InputError> {
    single_channel(path, load(path, most)?.numbers)
}

fn single_channel(path: &Path, image: Image) -> Result<(usize, usize, Vec<f32>), InputError> {
    let (width, height) = image.size();
    if image.channels() == 1 {
        return Ok((width, height, image.data));
    }
    let coloured = |p: &[f32]| p[0].to_bits() != p[1].to_bits() || p[1].to_bits() != p[2].to_bits();
    if let Some(i) = image.data.chunks_exact(3).position(coloured) {
        let (x, y) = (i % width, i / width);
        let reason = format!(
            "a depth or disparity map has one value per pixel, but pixel ({x}, {y}) has different red, green and blue; save it as a grey image"
        );
        return Err(InputError::file(path, reason));
    }
    Ok((width, height, image.data.iter().copied().step_by(3).collect()))
}

/// The numbers of a file as they are stored.
pub(super) struct Stored {
    numbers: Image,
    /// The number that is white: 1 of floats.
    white: f32,
    /// Pixels of which less than half is opaque; empty if there are none.
    transparent: Vec<bool>,
}

/// Half of the largest number of 16 bits.
const HALF: u16 = 1 << 15;

fn transparent(picture: &DynamicImage) -> Vec<bool> {
    let has_alpha = picture.color().has_alpha();
    let pixels = has_alpha.then(|| picture.to_luma_alpha16());
    let found: Vec<bool> = pixels.iter().flat_map(|image| image.pixels().map(|p| p.0[1] < HALF)).collect();
    if found.contains(&true) { found } else { Vec::new() }
}

impl Stored {
    pub(super) fn of(picture: &DynamicImage) -> Result<Self, InputError> {
        use DynamicImage::{ImageLuma16, ImageLumaA16, ImageRgb16, ImageRgb32F, ImageRgba16, ImageRgba32F};
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let is_float = matches!(picture, ImageRgb32F(_) | ImageRgba32F(_));
        let is_deep = matches!(picture, ImageLuma16(_) | ImageLumaA16(_) | ImageRgb16(_) | ImageRgba16(_));
        let numbers = |bytes: Vec<u8>| bytes.into_iter().map(f32::from).collect();
        let deep = |words: Vec<u16>| words.into_iter().map(f32::from).collect();
        let (white, channels, data) = match (is_float, is_deep, picture.color().has_color()) {
            (true, ..) => (1.0, 3, picture.to_rgb32f().into_raw()),
            (_, true, false) => (65535.0, 1, deep(picture.to_luma16().into_raw())),
            (_, true, true) => (65535.0, 3, deep(picture.to_rgb16().into_raw())),
            (_, false, false) => (255.0, 1, numbers(picture.to_luma8().into_raw())),
            (_, false, true) => (255.0, 3, numbers(picture.to_rgb8().into_raw())),
        };
        let numbers = Image::new(width, height, channels, data)?;
        Ok(Self { numbers, white, transparent: transparent(picture) })
    }

    /// The image on the scale 0..255.
    pub(super) fn intensities(mut self) -> Image {
        let scaled = |v: f32| if self.white == 1.0 { v * 255.0 } else { v / (self.white / 255.0) };
        self.numbers.data.iter_mut().for_each(|v| *v = scaled(*v));
        self.numbers
    }
}

/// The numbers of a format that only maps have.
fn float_map(file: &Source<'_>) -> Result<Option<Image>, InputError> {
    let decoded = match file.bytes {
        [b'P', b'F' | b'f', ..] => pfm::decode(file.bytes),
        bytes if colmap_map::is_map(bytes) => colmap_map::decode(bytes),
        bytes if float::is_exr(bytes) => return float::exr(file).map(Some),
        bytes if float::is_npy(bytes) => return float::npy(file).map(Some),
        _ => return float::tiff(file),
    };
    let map = decoded.map_err(|reason| file.wrong(reason))?;
    file.check_size(map.width(), map.height()).map(|()| Some(map))
}

fn load(path: &Path, most: usize) -> Result<Stored, InputError> {
    let bytes = files::read_bytes(path, CHECK_THE_PATH)?;
    let source = Source { path, bytes: &bytes, most };
    if let Some(numbers) = float_map(&source)? {
        return Ok(Stored { numbers, white: 1.0, transparent: Vec::new() });
    }
    let wrong = |e: image::ImageError| source.wrong(e.to_string());
    let open = || {
        let reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
        reader.map_err(|e| source.wrong(e.to_string()))
    };
    // Before the pixels are unpacked.
    let (width, height) = open()?.into_dimensions().map_err(wrong)?;
    source.check_size(width as usize, height as usize)?;
    let mut reader = open()?;
    // The size was checked; the decoders have limits of their own, without a way to allow more.
    reader.no_limits();
    Stored::of(&reader.decode().map_err(wrong)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn temporary(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (dir, path)
    }

    #[test]
    fn sixteen_bits_read_as_stored_and_as_intensity() {
        let (_dir, path) = temporary("d.pgm", b"P5 2 1 65535\n\x01\x00\xff\xff");
        assert_eq!(read_map(&path, MOST_PIXELS).unwrap(), (2, 1, vec![256.0, 65535.0]));
        let image = read_image(&path, MOST_PIXELS).unwrap();
        assert_eq!(image.data()[1], 255.0);
        assert!((image.data()[0] - 256.0 / 257.0).abs() < 1e-6);
    }

    #[test]
    fn colour_is_no_depth() {
        let (_dir, path) = temporary("d.ppm", b"P6 2 1 255\n\x05\x05\x05\x07\x08\x09");
        let message = read_map(&path, MOST_PIXELS).unwrap_err().to_string();
        assert!(message.contains("pixel (1, 0)") && message.contains("d.ppm"), "{message}");
        let (_dir, path) = temporary("d.ppm", b"P6 2 1 255\n\x05\x05\x05\x07\x07\x07");
        assert_eq!(read_map(&path, MOST_PIXELS).unwrap().2, [5.0, 7.0]);
    }

    #[test]
    fn what_is_too_large_is_refused_before_it_is_converted() {
        let mut bytes = b"P5 33554433 1 255\n".to_vec();
        bytes.resize(bytes.len() + MOST_PIXELS + 1, 7);
        let (_dir, path) = temporary("wide.pgm", &bytes);
        for message in [
            read_image(&path, MOST_PIXELS).unwrap_err().to_string(),
            read_map(&path, MOST_PIXELS).unwrap_err().to_string(),
        ] {
            let parts = ["33554433 x 1", "the limit of 33554432", "--max-pixels"];
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
        let (_dir, small) = temporary("small.pgm", b"P5 3 1 255\n\x01\x02\x03");
        assert!(read_image(&small, 2).unwrap_err().to_string().contains("the limit of 2;"));
        assert_eq!(read_image(&small, 3).unwrap().width(), 3);
    }

    #[test]
    fn missing_and_damaged_files_are_named() {
        let missing = read_image(Path::new("/nowhere/at all.png"), MOST_PIXELS).unwrap_err().to_string();
        assert!(missing.contains("/nowhere/at all.png"), "{missing}");
        let (_dir, path) = temporary("x.png", b"not an image");
        let damaged = read_image(&path, MOST_PIXELS).unwrap_err().to_string();
        assert!(damaged.contains("x.png: ") && damaged.contains("the readable formats are PNG"), "{damaged}");
    }
}
