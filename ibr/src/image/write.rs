//! Encoding images in the format of the file extension.

use super::dynamic::{Levels, picture};
use super::{Image, pfm};
use crate::files::InputError;
use hybank_core::files::AtomicFile;
use image::{DynamicImage, ImageFormat};
use std::io::{Cursor, Write};
use std::path::Path;

/// The bytes of a file in the format of the extension of `path`.
///
/// Values are rounded half up, to more than 256 levels in PNG only; .pfm keeps floats with white = 1.
///
/// # Errors
/// [`InputError`] for another extension or 16 bits in another format, or if the encoder fails.
pub fn encode(image: &Image, path: &Path, levels: Levels) -> Result<Vec<u8>, InputError> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let format = match ending.as_str() {
        "png" => ImageFormat::Png,
        "jpg" | "jpeg" => ImageFormat::Jpeg,
        "ppm" | "pgm" | "pnm" => ImageFormat::Pnm,
        "pfm" => {
            let values = image.data().iter().map(|v| v / 255.0).collect();
            return Ok(pfm::encode(&Image { data: values, ..*image }));
        }
        _ => {
            let remedy = "use .png, .jpg, .ppm, .pgm or .pfm";
            return Err(InputError::file(path, format!("the extension is not an image format; {remedy}")));
        }
    };
    if levels == Levels::Sixteen && format != ImageFormat::Png {
        let reason = "16 bits per value are written to .png files only; .pfm files have floats";
        return Err(InputError::file(path, reason));
    }
    // A .ppm is always written in colour, a .pgm in grey.
    match ending.as_str() {
        "ppm" => write_picture(&image.to_rgb().to_dynamic(levels), format, path),
        "pgm" => write_picture(&image.to_grey().to_dynamic(levels), format, path),
        _ => write_picture(&image.to_dynamic(levels), format, path),
    }
}

/// Writes the image to a file that appears only when it is whole, in the place of one that exists.
///
/// # Errors
/// As [`encode`], and [`InputError::File`] if the system fails.
pub fn save(image: &Image, path: &Path) -> Result<(), InputError> {
    write_file(&encode(image, path, Levels::Eight)?, path, true)
}

/// Writes bytes to a file that appears when it is whole; one that exists is refused unless `replace` is set.
pub(crate) fn write_file(bytes: &[u8], path: &Path, replace: bool) -> Result<(), InputError> {
    let mut file = AtomicFile::create(path, replace)?;
    file.write_all(bytes).map_err(|e| InputError::file(path, e))?;
    Ok(file.commit()?)
}

/// The bytes of a PNG file with an alpha channel, 0 to 1; colours are not multiplied by it. `path` appears
/// in messages.
///
/// # Errors
/// [`InputError::Buffer`] unless there is one alpha for each pixel, and [`InputError`] if the encoder fails.
pub fn encode_with_alpha(
    image: &Image,
    alpha: &[f32],
    path: &Path,
    levels: Levels,
) -> Result<Vec<u8>, InputError> {
    let Image { width, height, .. } = *image;
    if alpha.len() != width * height {
        let (expected, given) = (width * height, alpha.len());
        return Err(InputError::Buffer { width, height, channels: 1, expected, given });
    }
    let pixels = image.data().chunks_exact(image.channels()).zip(alpha);
    let values = pixels.flat_map(|(pixel, alpha)| pixel.iter().copied().chain([255.0 * alpha]));
    let picture = picture(values, image.size(), image.channels() + 1, levels);
    write_picture(&picture, ImageFormat::Png, path)
}

fn write_picture(picture: &DynamicImage, format: ImageFormat, path: &Path) -> Result<Vec<u8>, InputError> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).map_err(|e| InputError::file(path, e))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::super::{MOST_PIXELS, read_image};
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
            let back = read_image(&path, MOST_PIXELS).unwrap();
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
            std::fs::write(&path, encode(&image, &path, Levels::Sixteen).unwrap()).unwrap();
            let back = read_image(&path, MOST_PIXELS).unwrap();
            assert_eq!(back.channels(), channels);
            assert!(back.data().iter().zip(image.data()).all(|(a, b)| (a - b).abs() < 0.0025), "{back:?}");
        }
        let image = Image::filled(2, 2, 1, 7.0);
        let refused = encode(&image, Path::new("x.jpg"), Levels::Sixteen);
        assert!(
            refused.unwrap_err().to_string().contains("16 bits per value are written to .png files only")
        );
    }

    #[test]
    fn unknown_endings_and_folders_are_refused() {
        let image = Image::filled(2, 2, 1, 7.0);
        for name in ["x.gif", "x"] {
            let refused = encode(&image, Path::new(name), Levels::Eight).unwrap_err().to_string();
            assert!(refused.contains("the extension is not an image format; use .png"), "{refused}");
        }
        assert!(matches!(save(&image, Path::new("/nowhere/x.png")), Err(InputError::File(_))));
    }
}
