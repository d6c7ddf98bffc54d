//! Numbers in sentences.

use crate::quantity::readable;
use crate::units::Hertz;

/// A number in at most six significant digits.
pub fn six_digits(value: f64) -> String {
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) {
        let decimals = (5.0 - value.abs().max(1e-4).log10().floor()).clamp(1.0, 9.0) as usize;
        let text = format!("{value:.decimals$}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.5e}")
    }
}

/// A ratio of amplitudes in decibels, with one digit after the point.
pub fn decibels(value: f64, reference: f64) -> String {
    if reference == 0.0 {
        "inf dB".to_owned()
    } else {
        // Adding zero takes the sign from a zero.
        format!("{:.1} dB", (200.0 * (value / reference).log10()).round() / 10.0 + 0.0)
    }
}

/// A frequency with its unit; in normalised time it is a share of the output rate.
pub fn frequency(hertz: Hertz, is_normalised: bool) -> String {
    if is_normalised { format!("{:.4} of the output rate", hertz.0) } else { readable(hertz.0, "Hz") }
}

#[cfg(test)]
mod tests {
    use super::six_digits;

    #[test]
    fn numbers_have_six_digits_at_most() {
        for (value, text) in [
            (0.0, "0"),
            (24.0, "24"),
            (0.031_293_64, "0.0312936"),
            (-1.5, "-1.5"),
            (123_456.78, "123456.8"),
            (1e-9, "1.00000e-9"),
        ] {
            assert_eq!(six_digits(value), text);
        }
    }
}
