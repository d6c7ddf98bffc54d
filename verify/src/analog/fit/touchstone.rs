//! Touchstone files, version 1.
//!
//! Source: *Touchstone File Format Specification*, version 1.1, EIA/IBIS Open Forum.

use super::MeasurementError;
use super::text::{ResponseLine, hertz, numbers, of_decibels, point};
use hybank_core::messages::Quoted;
use hybank_linalg::Complex;

/// The option line.
#[derive(Debug, Clone, Copy)]
struct OptionLine {
    hertz: f64,
    /// The complex number of a pair.
    value: fn(f64, f64) -> Complex<f64>,
}

impl Default for OptionLine {
    fn default() -> Self {
        Self { hertz: 1e9, value: of_magnitude }
    }
}

fn of_magnitude(gain: f64, degrees: f64) -> Complex<f64> {
    Complex::from_polar(gain, degrees.to_radians())
}

/// The points of one parameter, with their lines.
pub(super) fn read(
    text: &str,
    ports: usize,
    parameter: Option<&str>,
) -> Result<Vec<ResponseLine>, MeasurementError> {
    let mut network = Network { ports, column: column(ports, parameter)?, options: None, points: Vec::new() };
    for (line, whole) in (1..).zip(text.lines()) {
        let content = whole.split('!').next().unwrap_or_default().trim();
        match content.as_bytes().first() {
            None => {}
            Some(b'#') => network.options(line, &content[1..])?,
            Some(b'[') => {
                let what = "this is Touchstone version 2; export the measurement as version 1".to_owned();
                return Err(MeasurementError::Unsupported { line, what });
            }
            Some(_) => {
                let row = numbers(content.split_whitespace());
                if row.as_ref().is_some_and(|row| network.is_noise(row)) {
                    break;
                }
                let point = row.and_then(|row| network.point(line, &row));
                network.points.push(point.ok_or_else(|| network.malformed(line, whole))?);
            }
        }
    }
    Ok(network.points)
}

/// What is known of a file while it is read.
struct Network {
    ports: usize,
    /// Of the parameter, among those of a line.
    column: usize,
    /// Of the option line, once it was there.
    options: Option<OptionLine>,
    points: Vec<ResponseLine>,
}

impl Network {
    /// Only the first option line counts.
    fn options(&mut self, line: usize, words: &str) -> Result<(), MeasurementError> {
        if self.options.is_none() {
            self.options = Some(option_line(line, words)?);
        }
        Ok(())
    }

    fn frequency(&self, row: &[f64]) -> f64 {
        row[0] * self.options.unwrap_or_default().hertz
    }

    /// Numbers of a line: the frequency and a pair per parameter.
    fn width(&self) -> usize {
        1 + 2 * self.ports * self.ports
    }

    /// Noise parameters follow the last point of two ports, and begin again at a low frequency.
    fn is_noise(&self, row: &[f64]) -> bool {
        let last = self.points.last();
        self.ports == 2 && row.len() == 5 && last.is_some_and(|last| self.frequency(row) <= last.1.0)
    }

    /// None for another number of numbers, or numbers that are no point.
    fn point(&self, line: usize, row: &[f64]) -> Option<ResponseLine> {
        if row.len() != self.width() {
            return None;
        }
        let OptionLine { value, .. } = self.options.unwrap_or_default();
        let pair = 1 + 2 * self.column;
        point(line, self.frequency(row), value(row[pair], row[pair + 1]))
    }

    fn malformed(&self, line: usize, found: &str) -> MeasurementError {
        let wanted = format!("a frequency and {} numbers", self.width() - 1);
        MeasurementError::Line { line, wanted, found: found.to_owned() }
    }
}

/// Where a parameter stands in a line: for two ports S11, S21, S12, S22.
fn column(ports: usize, parameter: Option<&str>) -> Result<usize, MeasurementError> {
    let (names, known): (&[&str], _) =
        if ports == 1 { (&["S11"], "S11") } else { (&["S11", "S21", "S12", "S22"], "S11, S21, S12 and S22") };
    let name = parameter.unwrap_or(if ports == 1 { "S11" } else { "S21" });
    let place = names.iter().position(|known| known.eq_ignore_ascii_case(name));
    place.ok_or_else(|| MeasurementError::Parameter { name: name.to_owned(), known })
}

/// `# GHz S MA R 50`, its parts in any order and each with a default.
fn option_line(line: usize, words: &str) -> Result<OptionLine, MeasurementError> {
    let mut options = OptionLine::default();
    let mut words = words.split_whitespace();
    while let Some(word) = words.next() {
        if let Some(hertz) = hertz(word) {
            options.hertz = hertz;
            continue;
        }
        match word.to_ascii_uppercase().as_str() {
            "S" => {}
            "MA" => options.value = of_magnitude,
            "DB" => options.value = of_decibels,
            "RI" => options.value = Complex::new,
            // The resistance does not matter: a ratio of waves is the gain between matched ports.
            "R" => drop(words.next()),
            "Y" | "Z" | "G" | "H" => {
                let what =
                    format!("{} parameters are no gains; export scattering parameters (S)", Quoted(word));
                return Err(MeasurementError::Unsupported { line, what });
            }
            _ => {
                let wanted = "a unit of frequency, S, MA, DB or RI, and R with a resistance".to_owned();
                return Err(MeasurementError::Line { line, wanted, found: word.to_owned() });
            }
        }
    }
    Ok(options)
}
