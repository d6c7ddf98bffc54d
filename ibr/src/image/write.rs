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
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let format = match ending.as_str() {
        "png" => ImageFormat::Png,
        "jpg" | "jpeg" => ImageFormat::Jpeg,
        "ppm" | "pgm" | "pnm" => ImageFormat::Pnm,
        "pfm" => return Ok(encode_float(image)),
        _ => return Err(ImageError::UnknownFormat { path: path.into() }),
    };
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
    let bytes = encode(image, path)?;
    let mut file = AtomicFile::create(path, replace)?;
    file.write_all(&bytes).map_err(|e| ImageError::Write { path: path.into(), reason: e.to_string() })?;
    Ok(file)
}

fn encode_float(image: &Image) -> Vec<u8> {
    let data = image.data().iter().map(|v| v / 255.0).collect();
    let (width, height) = image.size();
    pfm::encode(&pfm::FloatMap { width, height, channels: image.channels(), data })
}

fn encode_whole(image: &Image, format: ImageFormat, path: &Path) -> Result<Vec<u8>, ImageError> {
    let colour = if image.channels() == 3 { ColorType::Rgb8 } else { ColorType::L8 };
    let mut bytes = Cursor::new(Vec::new());
    let (width, height) = (image.width() as u32, image.height() as u32);
    image::write_buffer_with_format(&mut bytes, &image.to_bytes(), width, height, colour, format)
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

    #[test]
    fn unknown_endings_and_folders_are_refused() {
        let image = Image::filled(2, 2, 1, 7.0);
        assert!(matches!(encode(&image, Path::new("x.gif")), Err(ImageError::UnknownFormat { .. })));
        assert!(matches!(encode(&image, Path::new("x")), Err(ImageError::UnknownFormat { .. })));
        assert!(matches!(save(&image, Path::new("/nowhere/x.png")), Err(ImageError::File(_))));
    }
}
