//! Portable float maps: "PF" (RGB) or "Pf" (grey), width, height, scale, then rows from the bottom up.
//!
//! The sign of the scale gives the byte order (negative: little endian); its magnitude is not applied.

use super::Image;
use hybank_core::messages::Quoted;

/// Reads a float map, values as stored.
///
/// # Errors
/// A message, for an invalid header or for fewer values than the header states.
pub fn decode(bytes: &[u8]) -> Result<Image, String> {
    let mut rest = bytes;
    let channels = match word(&mut rest)? {
        "PF" => 3,
        "Pf" => 1,
        other => return Err(format!("starts with \"{}\" instead of \"PF\" or \"Pf\"", Quoted(other))),
    };
    let width = side(word(&mut rest)?, "width")?;
    let height = side(word(&mut rest)?, "height")?;
    let scale: f32 = parse(word(&mut rest)?, "scale")?;
    if scale == 0.0 || !scale.is_finite() {
        return Err(format!(
            "the scale is {scale}; it must be nonzero and finite, since its sign gives the byte order"
        ));
    }
    let values = width.checked_mul(height).and_then(|n| n.checked_mul(channels)).unwrap_or(usize::MAX);
    if rest.len() / 4 < values {
        return Err(format!(
            "the header states {width} x {height} x {channels} values of 4 bytes, but the file holds {} bytes",
            rest.len()
        ));
    }
    let stride = width * channels;
    let mut data = Vec::with_capacity(values);
    for y in (0..height).rev() {
        let row = &rest[4 * y * stride..4 * (y + 1) * stride];
        data.extend(
            row.as_chunks::<4>()
                .0
                .iter()
                .map(|b| if scale < 0.0 { f32::from_le_bytes(*b) } else { f32::from_be_bytes(*b) }),
        );
    }
    Ok(Image::from_values((width, height), channels, data))
}

/// Writes a little-endian float map of the values as they are.
pub fn encode(map: &Image) -> Vec<u8> {
    let kind = if map.channels() == 3 { "PF" } else { "Pf" };
    let mut bytes = format!("{kind}\n{} {}\n-1.0\n", map.width(), map.height()).into_bytes();
    for row in (0..map.height()).rev().map(|y| map.row(y)) {
        bytes.extend(row.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

/// The next word; consumes exactly one whitespace byte after it.
fn word<'a>(rest: &mut &'a [u8]) -> Result<&'a str, String> {
    let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    let bytes = &rest[start..];
    // No header word is longer; the limit keeps binary data out of the message.
    let end = bytes.iter().take(32).position(u8::is_ascii_whitespace).ok_or("the header is cut short")?;
    let word = std::str::from_utf8(&bytes[..end]).map_err(|_| "the header is not text".to_string())?;
    *rest = &bytes[end + 1..];
    Ok(word)
}

fn parse<T: std::str::FromStr>(word: &str, name: &str) -> Result<T, String> {
    word.parse().map_err(|_| format!("the {name} \"{}\" is not a number", Quoted(word)))
}

fn side(word: &str, name: &str) -> Result<usize, String> {
    match parse::<usize>(word, name)? {
        0 => Err(format!("the {name} is 0")),
        n => Ok(n),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rows_are_stored_from_the_bottom() {
        let map = decode(b"Pf\n1 2\n-1\n\x00\x00\x80\x3f\x00\x00\x00\x40").unwrap();
        assert_eq!(map.data(), [2.0, 1.0]);
    }

    #[test]
    fn big_endian_is_told_by_the_sign() {
        let map = decode(b"Pf 1 1 1.0\n\x3f\x80\x00\x00").unwrap();
        assert_eq!(map.data(), [1.0]);
    }

    #[test]
    fn damage_is_described() {
        for (bytes, word) in [
            (&b"P5\n1 1\n-1\n"[..], "instead of"),
            (b"Pf\n0 1\n-1\n", "width is 0"),
            (b"Pf\nx 1\n-1\n", "not a number"),
            (b"Pf\n4 4\n-1\n1234", "holds 4 bytes"),
            (b"Pf\n4 4\n0\n1234", "byte order"),
            (b"Pf\n99999999999 99999999999\n-1\n1", "the header states"),
            (b"Pf\n4", "cut short"),
            (b"", "cut short"),
        ] {
            let message = decode(bytes).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn what_is_written_reads_back(width in 1_usize..6, height in 1_usize..6, rgb: bool, seed: u32) {
            let channels = if rgb { 3 } else { 1 };
            let data = (0..width * height * channels)
                .map(|i| f32::from_bits(seed.wrapping_mul(i as u32 + 1) & 0x7f7f_ffff))
                .collect();
            let map = Image::new(width, height, channels, data).unwrap();
            prop_assert_eq!(decode(&encode(&map)).unwrap(), map);
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
            let _ = decode(&bytes);
            let _ = decode(&[b"PF 2 2 -1 ".as_slice(), &bytes].concat());
        }
    }
}
