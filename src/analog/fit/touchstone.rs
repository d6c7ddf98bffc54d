//! Touchstone files, version 1.
//!
//! Source: *Touchstone File Format Specification*, version 1.1, EIA/IBIS Open Forum.

use super::MeasurementError;
use super::text::{MOST_POINTS, Point, hertz, numbers, of_decibels, point, quoted};
use crate::linalg::Complex;

/// How a pair of numbers is a complex one.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Pairs {
    /// Magnitude and degrees.
    MagnitudeAngle,
    /// Decibels and degrees.
    DecibelAngle,
    RealImaginary,
}

impl Pairs {
    fn value(self, a: f64, b: f64) -> Complex<f64> {
        match self {
            Self::MagnitudeAngle => Complex::from_polar(a, b.to_radians()),
            Self::DecibelAngle => of_decibels(a, b),
            Self::RealImaginary => Complex::new(a, b),
        }
    }
}

/// The option line.
#[derive(Debug, Clone, Copy)]
struct Options {
    hertz: f64,
    pairs: Pairs,
}

/// The points of one parameter, with their lines.
pub(super) fn read(
    text: &str,
    ports: usize,
    parameter: Option<&str>,
) -> Result<Vec<Point>, MeasurementError> {
    let column = column(ports, parameter)?;
    let wanted = 1 + 2 * ports * ports;
    let mut options = Options { hertz: 1e9, pairs: Pairs::MagnitudeAngle };
    let mut has_options = false;
    let mut points: Vec<Point> = Vec::new();
    for (line, whole) in (1..).zip(text.lines()) {
        let content = whole.split('!').next().unwrap_or_default().trim();
        if let Some(words) = content.strip_prefix('#') {
            // Only the first option line counts.
            if !has_options {
                options = option_line(line, words)?;
                has_options = true;
            }
            continue;
        }
        if content.starts_with('[') {
            let what = "this is Touchstone version 2; export the measurement as version 1".to_owned();
            return Err(MeasurementError::Unsupported { line, what });
        }
        if content.is_empty() {
            continue;
        }
        let row = numbers(content.split_whitespace());
        // Noise parameters follow the last point of two ports, and begin again at a low frequency.
        let is_noise =
            |row: &Vec<f64>| row.len() == 5 && points.last().is_some_and(|p| row[0] * options.hertz <= p.1.0);
        if ports == 2 && row.as_ref().is_some_and(is_noise) {
            break;
        }
        let made = row.filter(|row| row.len() == wanted).and_then(|row| {
            let value = options.pairs.value(row[1 + 2 * column], row[2 + 2 * column]);
            point(line, row[0] * options.hertz, value)
        });
        points.push(made.ok_or_else(|| MeasurementError::Line {
            line,
            wanted: format!("a frequency and {} numbers", wanted - 1),
            found: quoted(whole),
        })?);
        if points.len() > MOST_POINTS {
            return Err(MeasurementError::TooMany { most: MOST_POINTS });
        }
    }
    Ok(points)
}

/// Where a parameter stands in a line: for two ports S11, S21, S12, S22.
fn column(ports: usize, parameter: Option<&str>) -> Result<usize, MeasurementError> {
    let (names, known): (&[&str], _) =
        if ports == 1 { (&["S11"], "S11") } else { (&["S11", "S21", "S12", "S22"], "S11, S21, S12 and S22") };
    let name = parameter.unwrap_or(if ports == 1 { "S11" } else { "S21" });
    let place = names.iter().position(|known| known.eq_ignore_ascii_case(name));
    place.ok_or_else(|| MeasurementError::Parameter { name: quoted(name), known })
}

/// `# GHz S MA R 50`, its parts in any order and each with a default.
fn option_line(line: usize, words: &str) -> Result<Options, MeasurementError> {
    let mut options = Options { hertz: 1e9, pairs: Pairs::MagnitudeAngle };
    let mut words = words.split_whitespace();
    while let Some(word) = words.next() {
        if let Some(hertz) = hertz(word) {
            options.hertz = hertz;
            continue;
        }
        match word.to_ascii_uppercase().as_str() {
            "S" => {}
            "MA" => options.pairs = Pairs::MagnitudeAngle,
            "DB" => options.pairs = Pairs::DecibelAngle,
            "RI" => options.pairs = Pairs::RealImaginary,
            // The resistance does not matter: a ratio of waves is the gain between matched ports.
            "R" => drop(words.next()),
            "Y" | "Z" | "G" | "H" => {
                let what = format!("{word} parameters are no gains; export scattering parameters (S)");
                return Err(MeasurementError::Unsupported { line, what });
            }
            _ => {
                let wanted = "a unit of frequency, S, MA, DB or RI, and R with a resistance".to_owned();
                return Err(MeasurementError::Line { line, wanted, found: quoted(word) });
            }
        }
    }
    Ok(options)
}
