//! Uncompressed films (YUV4MPEG2), which video encoders read from files and pipes.
//!
//! Colour is written as Y'CbCr of ITU-R BT.601 with full chroma resolution (C444), 16 to 235 and 16 to 240;
//! grey as Y' alone (Cmono).
//!
//! ```
//! use hybank_ibr::image::{Image, y4m};
//! let mut film = y4m::header((2, 1), 1, 25);
//! assert!(film.starts_with(b"YUV4MPEG2 W2 H1 F25:1 "));
//! y4m::append_frame(&Image::filled(2, 1, 1, 255.0), &mut film);
//! assert!(film.ends_with(b"FRAME\n\xEB\xEB"));
//! ```

use super::Image;

/// The header of a film of so many frames of this size per second; 3 channels are RGB, all else is grey.
pub fn header((width, height): (usize, usize), channels: usize, rate: u32) -> Vec<u8> {
    let colours = if channels == 3 { "C444" } else { "Cmono" };
    format!("YUV4MPEG2 W{width} H{height} F{rate}:1 Ip A1:1 {colours} XCOLORRANGE=LIMITED\n").into_bytes()
}

/// Appends a frame: its planes one after the other.
pub fn append_frame(image: &Image, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(b"FRAME\n");
    if image.channels() == 1 {
        let luma = |v: &f32| level(16.0 + 219.0 * v.clamp(0.0, 255.0) / 255.0);
        bytes.extend(image.data().iter().map(luma));
        return;
    }
    // Rows of the conversion from R'G'B' of 0 to 1, with the value of black.
    let planes = [
        (16.0, [65.481, 128.553, 24.966]),
        (128.0, [-37.797, -74.203, 112.0]),
        (128.0, [112.0, -93.786, -18.214]),
    ];
    for (black, factors) in planes {
        bytes.extend(image.data().chunks_exact(3).map(|pixel| {
            let parts = pixel.iter().zip(factors).map(|(v, f): (&f32, f32)| v.clamp(0.0, 255.0) / 255.0 * f);
            level(black + parts.sum::<f32>())
        }));
    }
}

fn level(value: f32) -> u8 {
    (value + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White, black and the primaries, from the table of the recommendation.
    #[test]
    fn colours_are_those_of_the_standard() {
        let pixels: [[f32; 3]; 5] =
            [[255.0; 3], [0.0; 3], [255.0, 0.0, 0.0], [0.0, 255.0, 0.0], [0.0, 0.0, 255.0]];
        let image = Image::new(5, 1, 3, pixels.concat()).unwrap();
        let mut bytes = Vec::new();
        append_frame(&image, &mut bytes);
        assert_eq!(
            bytes.strip_prefix(b"FRAME\n"),
            Some(&[235, 16, 81, 145, 41, 128, 128, 90, 54, 240, 128, 128, 240, 34, 110,][..])
        );
    }

    #[test]
    fn grey_has_one_plane() {
        let image = Image::new(2, 1, 1, vec![0.0, 255.0]).unwrap();
        let mut bytes = header(image.size(), 1, 30);
        append_frame(&image, &mut bytes);
        assert_eq!(bytes, b"YUV4MPEG2 W2 H1 F30:1 Ip A1:1 Cmono XCOLORRANGE=LIMITED\nFRAME\n\x10\xeb");
    }
}
