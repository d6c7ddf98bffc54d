//! Comma-separated frequency, gain and phase.

use super::MeasurementError;
use super::text::{MOST_POINTS, Point, hertz, numbers, of_decibels, point};

/// The points with their lines.
pub(super) fn read(text: &str) -> Result<Vec<Point>, MeasurementError> {
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
        if points.len() > MOST_POINTS {
            return Err(MeasurementError::TooMany { most: MOST_POINTS });
        }
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
