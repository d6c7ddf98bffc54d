//! What the texts of measurements have in common.

use super::MeasurementError;
use hybank_core::units::Hertz;
use hybank_linalg::Complex;

/// A line, counted from 1, with its frequency and value.
pub(super) type ResponseLine = (usize, Hertz, Complex<f64>);

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
pub(super) fn point(line: usize, frequency: f64, value: Complex<f64>) -> Option<ResponseLine> {
    let is_good = (0.0..1e18).contains(&frequency) && value.norm() < 1e30;
    is_good.then_some((line, Hertz(frequency), value))
}

/// The points with their lines.
pub(super) fn read_table(text: &str) -> Result<Vec<ResponseLine>, MeasurementError> {
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    let Some((_, heading)) = lines.next() else { return Err(MeasurementError::Empty) };
    let unit = unit(heading).ok_or_else(|| MeasurementError::Heading { found: heading.to_owned() })?;
    let mut points = Vec::new();
    for (number, line) in lines {
        let row = numbers(cells(line)).and_then(|row| <[f64; 3]>::try_from(row).ok());
        let made = row.and_then(|[f, gain, degrees]| point(number, f * unit, of_decibels(gain, degrees)));
        points.push(made.ok_or_else(|| MeasurementError::Line {
            line: number,
            wanted: "a frequency, a gain in dB and a phase in degrees".to_owned(),
            found: line.to_owned(),
        })?);
    }
    Ok(points)
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split([',', ';', '\t']).map(str::trim)
}

/// The hertz of the unit of the first column, where the others are dB and degrees.
fn unit(heading: &str) -> Option<f64> {
    let mut columns = cells(heading);
    let has = |cell: &str, wanted: &dyn Fn(&str) -> bool| {
        cell.split(|c: char| !c.is_alphanumeric() && c != '°').any(|word| wanted(&word.to_lowercase()))
    };
    let frequency = columns.next()?;
    let unit = frequency.split(|c: char| !c.is_alphanumeric()).find_map(hertz)?;
    let (gain, phase) = (columns.next()?, columns.next()?);
    let is_right =
        has(gain, &|word| word == "db") && has(phase, &|word| word.starts_with("deg") || word == "°");
    (is_right && columns.next().is_none()).then_some(unit)
}
