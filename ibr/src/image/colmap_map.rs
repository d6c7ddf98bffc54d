//! The maps of COLMAP's dense reconstruction (`stereo/depth_maps/*.bin`): width, height and channels in
//! decimal, each followed by `&`, then little-endian floats row by row from the top.

use super::Image;

/// Longest header: three numbers of up to ten digits.
const HEADER: usize = 33;

/// Whether a file may be such a map: digits up to an ampersand.
pub(super) fn is_map(bytes: &[u8]) -> bool {
    let digits = bytes.iter().take(HEADER).take_while(|b| b.is_ascii_digit()).count();
    digits > 0 && bytes.get(digits) == Some(&b'&')
}

/// Reads a map of one channel.
///
/// # Errors
/// A message, for an invalid header or another number of values than the header states.
pub(super) fn decode(bytes: &[u8]) -> Result<Image, String> {
    let mut rest = bytes;
    let mut number = |name: &str| -> Result<usize, String> {
        let end = rest.iter().take(HEADER).position(|b| *b == b'&');
        let end = end.ok_or_else(|| format!("the {name} of the COLMAP map is missing"))?;
        let text = std::str::from_utf8(&rest[..end]).ok().and_then(|t| t.parse().ok());
        rest = &rest[end + 1..];
        text.filter(|n| *n > 0)
            .ok_or_else(|| format!("the {name} of the COLMAP map is not a positive number"))
    };
    let (width, height, channels) = (number("width")?, number("height")?, number("number of channels")?);
    if channels != 1 {
        return Err(format!("the COLMAP map has {channels} channels: a depth map has one"));
    }
    let values = rest.as_chunks::<4>().0;
    if width.checked_mul(height) != Some(values.len()) {
        return Err(format!(
            "the header of the COLMAP map states {width} x {height} values, but the file holds {}",
            values.len()
        ));
    }
    let data = values.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok(Image::from_values((width, height), channels, data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_from_the_top() {
        let mut bytes = b"2&3&1&".to_vec();
        (0..6).for_each(|v| bytes.extend((v as f32).to_le_bytes()));
        assert!(is_map(&bytes) && !is_map(b"Pf 2 3") && !is_map(b"&1") && !is_map(b"123"));
        let map = decode(&bytes).unwrap();
        assert_eq!((map.size(), map.data()), ((2, 3), &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0][..]));
    }

    #[test]
    fn damage_is_described() {
        for (bytes, words) in [
            (&b"2&3&1&1234"[..], "2 x 3 values"),
            (b"2&3&3&", "3 channels"),
            (b"2&0&1&", "height"),
            (b"2&", "height of the COLMAP map is missing"),
            (b"99999999999999999999&1&1&", "width"),
        ] {
            let message = decode(bytes).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
    }
}
