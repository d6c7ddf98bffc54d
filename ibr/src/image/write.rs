//! Encoding images in the format of the file extension.

use super::{Image, ImageError, pfm};
use hybank::files::AtomicFile;
use image::{ColorType, ImageFormat};
use std::io::{Cursor, Write};
use std::path::Path;

/// The bytes of a file in the format of the extension of `path`.
///
/// 8 bits per value, rounded half up; .pfm keeps floats with white = 1.
///
/// # Errors
/// [`ImageError::UnknownFormat`] for another extension, [`ImageError::Write`] if the encoder fails.
pub fn encode(image: &Image, path: &Path) -> Result<Vec<u8>, ImageError> {
    encode_to(image, path, Levels::Eight)
}

/// Bits per value of a PNG file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Levels {
    /// 256 levels.
    #[default]
    Eight,
    /// 65536 levels: white is 65535.
    Sixteen,
}

/// As [`encode`], with so many levels per value; more than 256 in PNG only.
///
/// # Errors
/// As [`encode`], and [`ImageError::Levels`] for 16 bits in another format.
pub fn encode_to(image: &Image, path: &Path, levels: Levels) -> Result<Vec<u8>, ImageError> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let format = match ending.as_str() {
        "png" => ImageFormat::Png,
        "jpg" | "jpeg" => ImageFormat::Jpeg,
        "ppm" | "pgm" | "pnm" => ImageFormat::Pnm,
        "pfm" => return Ok(encode_float(image)),
        _ => return Err(ImageError::UnknownFormat { path: path.into() }),
    };
    if levels == Levels::Sixteen {
        let png = format == ImageFormat::Png;
        return if png { encode_deep(image, path) } else { Err(ImageError::Levels { path: path.into() }) };
    }
    // A .ppm is always written in colour, a .pgm in grey.
    match ending.as_str() {
        "ppm" => encode_whole(&image.to_rgb(), format, path),
        "pgm" => encode_whole(&image.to_grey(), format, path),
        _ => encode_whole(image, format, path),
    }
}

/// Writes the image to a file that appears only when it is whole, in the place of one that exists.
///
/// # Errors
/// As [`encode`], and [`ImageError::File`] if the system fails.
pub fn save(image: &Image, path: &Path) -> Result<(), ImageError> {
    Ok(begin(image, path, true)?.commit()?)
}

/// As [`save`], without giving the file its name yet: several of them are committed together by
/// [`commit_all`](hybank::files::commit_all).
///
/// # Errors
/// As [`save`], and [`ImageError::File`] if the file exists and `replace` is not set.
pub fn begin(image: &Image, path: &Path, replace: bool) -> Result<AtomicFile, ImageError> {
    begin_bytes(&encode(image, path)?, path, replace)
}

/// As [`begin`], for encoded bytes.
///
/// # Errors
/// [`ImageError::File`] and [`ImageError::Write`].
pub fn begin_bytes(bytes: &[u8], path: &Path, replace: bool) -> Result<AtomicFile, ImageError> {
    let mut file = AtomicFile::create(path, replace)?;
    file.write_all(bytes).map_err(|e| ImageError::Write { path: path.into(), reason: e.to_string() })?;
    Ok(file)
}

fn encode_float(image: &Image) -> Vec<u8> {
    let data = image.data().iter().map(|v| v / 255.0).collect();
    let (width, height) = image.size();
    pfm::encode(&pfm::FloatMap { width, height, channels: image.channels(), data })
}

/// A value 0..=255 as one of 65536 levels, rounded half up. 65535 / 255 = 257.
pub(super) fn deep_level(value: f32) -> u16 {
    (value.clamp(0.0, 255.0) * 257.0 + 0.5) as u16
}

/// The encoder takes the numbers in the order of this machine.
fn deep_bytes(levels: impl Iterator<Item = u16>) -> Vec<u8> {
    levels.flat_map(u16::to_ne_bytes).collect()
}

fn encode_deep(image: &Image, path: &Path) -> Result<Vec<u8>, ImageError> {
    let colour = if image.channels() == 3 { ColorType::Rgb16 } else { ColorType::L16 };
    let bytes = deep_bytes(image.data().iter().map(|v| deep_level(*v)));
    write_buffer(&bytes, image.size(), colour, ImageFormat::Png, path)
}

/// The bytes of a PNG file of whole numbers, one per pixel; `path` appears in messages.
///
/// # Errors
/// [`ImageError::Write`] if the encoder fails, [`ImageError::Buffer`] if the numbers do not fill the size.
pub fn encode_levels(
    numbers: &[u16],
    (width, height): (usize, usize),
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let expected = width.saturating_mul(height);
    if numbers.len() != expected {
        return Err(ImageError::Buffer { width, height, channels: 1, expected, given: numbers.len() });
    }
    let bytes = deep_bytes(numbers.iter().copied());
    write_buffer(&bytes, (width, height), ColorType::L16, ImageFormat::Png, path)
}

/// The bytes of a PNG file with an alpha channel, 0 to 1; colours are not multiplied by it. `path` appears
/// in messages.
///
/// # Errors
/// As [`encode_levels`].
pub fn encode_with_alpha(
    image: &Image,
    alpha: &[f32],
    path: &Path,
    levels: Levels,
) -> Result<Vec<u8>, ImageError> {
    let ((width, height), channels) = (image.size(), image.channels());
    if alpha.len() != width * height {
        return Err(ImageError::Buffer {
            width,
            height,
            channels: 1,
            expected: width * height,
            given: alpha.len(),
        });
    }
    let pixels = image.data().chunks_exact(channels).zip(alpha);
    let values = pixels.flat_map(|(pixel, alpha)| pixel.iter().copied().chain([255.0 * alpha]));
    let (bytes, colour) = match (levels, channels) {
        (Levels::Eight, 3) => (values.map(super::to_byte).collect(), ColorType::Rgba8),
        (Levels::Eight, _) => (values.map(super::to_byte).collect(), ColorType::La8),
        (Levels::Sixteen, 3) => (deep_bytes(values.map(deep_level)), ColorType::Rgba16),
        (Levels::Sixteen, _) => (deep_bytes(values.map(deep_level)), ColorType::La16),
    };
    write_buffer(&bytes, (width, height), colour, ImageFormat::Png, path)
}

fn encode_whole(image: &Image, format: ImageFormat, path: &Path) -> Result<Vec<u8>, ImageError> {
    let colour = if image.channels() == 3 { ColorType::Rgb8 } else { ColorType::L8 };
    write_buffer(&image.to_bytes(), image.size(), colour, format, path)
}

fn write_buffer(
    values: &[u8],
    (width, height): (usize, usize),
    colour: ColorType,
    format: ImageFormat,
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    let (width, height) = (width as u32, height as u32);
    image::write_buffer_with_format(&mut bytes, values, width, height, colour, format)
        .map_err(|e| ImageError::Write { path: path.into(), reason: e.to_string() })?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::super::read_image;
    use super::*;

    #[test]
    fn lossless_formats_come_back_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let values = |n: usize| (0..n).map(|i| ((i * 37) % 256) as f32).collect::<Vec<_>>();
        let rgb = Image::new(5, 4, 3, values(60)).unwrap();
        let grey = Image::new(5, 4, 1, values(20)).unwrap();
        for (image, name) in [
            (&rgb, "a.png"),
            (&rgb, "a.ppm"),
            (&rgb, "a.pfm"),
            (&grey, "g.png"),
            (&grey, "g.PGM"),
            (&grey, "g.pfm"),
        ] {
            let path = dir.path().join(name);
            save(image, &path).unwrap();
            let back = read_image(&path).unwrap();
            assert_eq!((back.size(), back.channels()), (image.size(), image.channels()), "{name}");
            assert!(back.data().iter().zip(image.data()).all(|(a, b)| (a - b).abs() < 1e-4), "{name}");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 6, "no temporary file is left");
    }

    /// 16 bits keep what 8 round away, and a map reads back as stored.
    #[test]
    fn sixteen_bits_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep.png");
        for channels in [1, 3] {
            let values = (0..6 * channels).map(|i| 7.3 + 11.117 * i as f32).collect();
            let image = Image::new(3, 2, channels, values).unwrap();
            std::fs::write(&path, encode_to(&image, &path, Levels::Sixteen).unwrap()).unwrap();
            let back = read_image(&path).unwrap();
            assert_eq!(back.channels(), channels);
            assert!(back.data().iter().zip(image.data()).all(|(a, b)| (a - b).abs() < 0.0025), "{back:?}");
        }
        let image = Image::filled(2, 2, 1, 7.0);
        let refused = encode_to(&image, Path::new("x.jpg"), Levels::Sixteen);
        assert!(matches!(refused, Err(ImageError::Levels { .. })));
    }

    #[test]
    fn unknown_endings_and_folders_are_refused() {
        let image = Image::filled(2, 2, 1, 7.0);
        assert!(matches!(encode(&image, Path::new("x.gif")), Err(ImageError::UnknownFormat { .. })));
        assert!(matches!(encode(&image, Path::new("x")), Err(ImageError::UnknownFormat { .. })));
        assert!(matches!(save(&image, Path::new("/nowhere/x.png")), Err(ImageError::File(_))));
    }
}
