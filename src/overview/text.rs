//! Numbers in sentences.

use std::fmt::Display;

/// A ratio of amplitudes in decibels, with one digit after the point.
pub fn decibels(value: f64, reference: f64) -> String {
    if reference == 0.0 {
        "inf dB".to_owned()
    } else {
        // Adding zero takes the sign from a zero.
        format!("{:.1} dB", (200.0 * (value / reference).log10()).round() / 10.0 + 0.0)
    }
}

/// A number of things, with a plural where it is not 1.
pub fn counted(count: impl Display, name: &str) -> String {
    let count = count.to_string();
    let ending = if count == "1" { "" } else { "s" };
    format!("{count} {name}{ending}")
}
