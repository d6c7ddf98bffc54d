//! What the texts of measurements have in common.

use crate::linalg::Complex;
use crate::units::Hertz;

/// Most frequencies of a measurement.
pub(super) const MOST_POINTS: usize = 100_000;

/// A line, counted from 1, with its frequency and value.
pub(super) type Point = (usize, Hertz, Complex<f64>);

/// The hertz of a unit of frequency.
pub(super) fn hertz(unit: &str) -> Option<f64> {
    let units = [("hz", 1.0), ("khz", 1e3), ("mhz", 1e6), ("ghz", 1e9)];
    units.into_iter().find(|(name, _)| unit.eq_ignore_ascii_case(name)).map(|(_, hertz)| hertz)
}

/// From decibels and degrees.
pub(super) fn of_decibels(gain: f64, degrees: f64) -> Complex<f64> {
    Complex::from_polar(10f64.powf(gain / 20.0), degrees.to_radians())
}

/// All numbers of a line, if they are finite numbers and nothing else.
pub(super) fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Option<Vec<f64>> {
    words.map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect()
}

/// A measured point, if frequency and value are in range.
pub(super) fn point(line: usize, frequency: f64, value: Complex<f64>) -> Option<Point> {
    let is_good = (0.0..1e18).contains(&frequency) && value.norm() < 1e30;
    is_good.then_some((line, Hertz(frequency), value))
}
