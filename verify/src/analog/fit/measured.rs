//! A response on a list of frequencies.

use super::MeasurementError;
use super::text::{ResponseLine, read_table};
use super::touchstone;
use hybank_core::units::{Hertz, Seconds};
use hybank_linalg::Complex;
use std::f64::consts::TAU;

/// Most frequencies of a measurement.
const MOST_POINTS: usize = 100_000;

/// Values H(j 2 pi f) at frequencies that rise.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredResponse {
    points: Vec<(Hertz, Complex<f64>)>,
}

impl MeasuredResponse {
    /// A scattering parameter of a Touchstone file, version 1, of one or two ports; `parameter` is S11, S21,
    /// S12 or S22, and by default S21, with one port S11.
    ///
    /// # Errors
    /// [`MeasurementError`] with the line of the first thing that is wrong.
    pub fn from_touchstone(
        text: &str,
        ports: usize,
        parameter: Option<&str>,
    ) -> Result<Self, MeasurementError> {
        touchstone::read(text, ports, parameter).and_then(Self::new)
    }

    /// Comma-separated frequency, gain in decibels and phase in degrees; the headings name the unit of the
    /// frequency.
    ///
    /// # Errors
    /// [`MeasurementError`] with the line of the first thing that is wrong.
    pub fn from_csv(text: &str) -> Result<Self, MeasurementError> {
        read_table(text).and_then(Self::new)
    }

    /// Of lines with their numbers.
    fn new(points: Vec<ResponseLine>) -> Result<Self, MeasurementError> {
        if points.is_empty() {
            return Err(MeasurementError::Empty);
        }
        if points.len() > MOST_POINTS {
            return Err(MeasurementError::TooMany { most: MOST_POINTS });
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[1].1 <= pair[0].1) {
            return Err(MeasurementError::Order { line: pair[1].0, value: pair[1].1 });
        }
        Ok(Self { points: points.into_iter().map(|(_, frequency, value)| (frequency, value)).collect() })
    }

    /// Frequencies and values.
    pub fn points(&self) -> &[(Hertz, Complex<f64>)] {
        &self.points
    }

    /// The same measurement with a delay taken out: H e^(j 2 pi f delay).
    #[must_use]
    pub fn without_delay(&self, delay: Seconds) -> Self {
        let turned =
            |&(f, value): &(Hertz, Complex<f64>)| (f, value * Complex::from_polar(1.0, TAU * f.0 * delay.0));
        Self { points: self.points.iter().map(turned).collect() }
    }

    /// By how much the phase falls per unit of angular frequency, on average: the delay if there is nothing
    /// else.
    pub(super) fn mean_delay(&self) -> Seconds {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return Seconds(0.0);
        };
        let turns = self.points.windows(2).map(|pair| (pair[1].1 * pair[0].1.conj()).arg());
        let span = TAU * (last.0.0 - first.0.0);
        Seconds(if span > 0.0 { -turns.sum::<f64>() / span } else { 0.0 })
    }
}
