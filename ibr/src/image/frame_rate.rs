//! Frames per second of a film, as a ratio of whole numbers.

use std::str::FromStr;

/// Most frames per second, and most seconds per frame.
const MOST: u64 = 1000;

/// Frames per second: 25, 2997/100 or 30000/1001, in lowest terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRate {
    /// Frames in `seconds` seconds.
    pub frames: u32,
    /// Seconds.
    pub seconds: u32,
}

impl FrameRate {
    /// A ratio in lowest terms; `None` outside 1/1000 to 1000 frames per second.
    pub fn new(frames: u64, seconds: u64) -> Option<Self> {
        let (most, longest) = (seconds.checked_mul(MOST)?, frames.checked_mul(MOST)?);
        if frames == 0 || frames > most || seconds > longest {
            return None;
        }
        let divisor = common_divisor(frames, seconds);
        let term = |n: u64| u32::try_from(n / divisor).ok();
        Some(Self { frames: term(frames)?, seconds: term(seconds)? })
    }
}

/// Euclid's algorithm, of positive numbers.
fn common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

impl FromStr for FrameRate {
    type Err = String;

    /// Reads `25`, `29.97` or `30000/1001`. A decimal number is taken as it is written, so that 29.97 is
    /// 2997/100.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let whole = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?;
        let (before, after) = text.split_once('.').unwrap_or((text, ""));
        let rate = match text.split_once('/') {
            Some((frames, seconds)) => whole(frames).zip(whole(seconds)),
            None if before.is_empty() => None,
            None => whole(&[before, after].concat()).zip(10_u64.checked_pow(after.len() as u32)),
        };
        rate.and_then(|(frames, seconds)| Self::new(frames, seconds))
            .ok_or_else(|| format!("write it as 25, 29.97 or 30000/1001, from 1/{MOST} to {MOST}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_ratios_in_lowest_terms() {
        for (text, frames, seconds) in [
            ("25", 25, 1),
            ("25.0", 25, 1),
            ("29.97", 2997, 100),
            ("23.976", 2997, 125),
            ("30000/1001", 30000, 1001),
            ("50/2", 25, 1),
            ("0.5", 1, 2),
            ("1000", 1000, 1),
        ] {
            assert_eq!(text.parse(), Ok(FrameRate { frames, seconds }), "{text}");
        }
        for text in
            ["", "0", "-1", "+5", "1e3", "1001", "25fps", "1/0", "0/1", "/", "1/2/3", ".5", "25,5", "nan"]
        {
            assert!(text.parse::<FrameRate>().unwrap_err().contains("30000/1001"), "{text}");
        }
        assert!("99999999999999999999".parse::<FrameRate>().is_err());
        assert!("0.0000001".parse::<FrameRate>().is_err() && "1/1001".parse::<FrameRate>().is_err());
    }
}
