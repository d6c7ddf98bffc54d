//! The samples of one channel.

use super::CaptureError;
use crate::calibrate::Record;
use crate::io::rails_of;
use crate::measure::{MeasureError, Measurement, Settings, measure, measure_complex};
use crate::units::Hertz;

/// The samples of one channel, as numbers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelSamples {
    /// The samples, or the real parts of complex ones; lost ones are NaN.
    pub samples: Vec<f64>,
    /// The imaginary parts of complex samples, as many.
    pub imaginary: Option<Vec<f64>>,
    /// Lowest and highest value of integers and codes; `None` for floats.
    pub rails: Option<(f64, f64)>,
}

impl ChannelSamples {
    /// Leaves out `skip` samples at either end.
    ///
    /// # Errors
    /// [`CaptureError::NothingLeft`].
    pub fn trimmed(mut self, skip: usize) -> Result<Self, CaptureError> {
        let count = self.samples.len();
        if skip > 0 && 2 * skip >= count {
            return Err(CaptureError::NothingLeft { skip, count });
        }
        for part in [Some(&mut self.samples), self.imaginary.as_mut()].into_iter().flatten() {
            part.truncate(count - skip);
            part.drain(..skip);
        }
        Ok(self)
    }

    /// The same if all samples are finite.
    ///
    /// # Errors
    /// [`CaptureError::NotFinite`].
    pub fn finite(self) -> Result<Self, CaptureError> {
        for part in std::iter::once(&self.samples).chain(&self.imaginary) {
            if let Some(sample) = part.iter().position(|x| !x.is_finite()) {
                return Err(CaptureError::NotFinite { sample, value: part[sample] });
            }
        }
        Ok(self)
    }

    /// The samples for a calibration. Those at the ends of their range are clipped, or those of the size
    /// `clip` and beyond.
    pub fn record(&self, clip: Option<f64>) -> Record {
        let part = |samples: &[f64]| {
            let clipped = clip.map(|level| (-level, level));
            match clipped.or_else(|| rails_of(samples.iter().copied(), self.rails)) {
                Some((lowest, highest)) => Record::within(samples.to_vec(), lowest, highest),
                None => Record::new(samples.to_vec()),
            }
        };
        match &self.imaginary {
            Some(imaginary) => Record::complex(part(&self.samples), part(imaginary)),
            None => part(&self.samples),
        }
    }

    /// Measures the samples, taken `rate` times a second. The `rails` of the settings are those of the
    /// samples; of floats they follow from the full scale of the settings.
    ///
    /// # Errors
    /// [`MeasureError`].
    pub fn measured(&self, rate: Hertz, settings: &Settings) -> Result<Measurement, MeasureError> {
        let scale = if self.rails.is_some() { 1.0 } else { settings.full_scale };
        let all = self.samples.iter().chain(self.imaginary.iter().flatten()).map(|x| x / scale);
        let (low, high) = rails_of(all, self.rails).unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let settings = Settings { rails: (low * scale, high * scale), ..settings.clone() };
        match &self.imaginary {
            None => measure(&self.samples, rate, &settings),
            Some(imaginary) => measure_complex(&self.samples, imaginary, rate, &settings),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_clip_at_the_ends_of_their_range_and_floats_at_one() {
        let clipped = |samples: &[f64], rails, clip| {
            ChannelSamples { samples: samples.to_vec(), imaginary: None, rails }.record(clip).clipped
        };
        let s16 = Some((-1.0, 32767.0 / 32768.0));
        assert_eq!(clipped(&[-1.0, 0.0, 32767.0 / 32768.0, 0.99], s16, None), 2);
        // A converter of 12 bits in words of 16.
        assert_eq!(clipped(&[-1.0, 0.0, 2047.0 / 2048.0, 0.5], s16, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 1.0, 0.99], None, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 2047.0 / 2048.0, 0.5], None, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 0.9375, 0.9], None, None), 1);
        assert_eq!(clipped(&[-1.0, 0.0, 1.5, 0.99], None, None), 0);
        assert_eq!(clipped(&[-1.0, 0.0, 1.5, 0.99], None, Some(0.99)), 3);
    }

    #[test]
    fn ends_are_left_out_of_both_parts() {
        let samples = vec![1.0, 2.0, 3.0, 4.0, 5.0];
        let both = ChannelSamples { imaginary: Some(samples.clone()), samples, rails: None };
        let trimmed = both.clone().trimmed(2).unwrap();
        assert_eq!((trimmed.samples, trimmed.imaginary), (vec![3.0], Some(vec![3.0])));
        let refused = both.trimmed(3).unwrap_err().to_string();
        assert!(refused.contains("3 samples at either end leave nothing of 5; leave out fewer than 3"));
    }
}
