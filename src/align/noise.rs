//! The noise of the recorders, and what they give alone and together, by samples that are left out and
//! predicted from those around them ([`crate::instants::Model`]).

use super::{AlignError, Alignment, ClockCourse};
use crate::calibrate::Record;
use crate::design::{self, DesignError};
use crate::figures::Alone;
use crate::instants::{FusionSettings, Recording};
use crate::spec::{ChannelSpec, SignalSpec};
use crate::units::{Decibels, FastPeriods};

/// Samples of each recording on either side of an instant.
const REACH: usize = 24;

impl Alignment {
    /// Measures the noise of each recorder and the rms of the signal, and writes both into the spec, if that
    /// states the band of the signal: a sample is predicted from others by the band.
    ///
    /// The noise is all that a recorder does not have in common with the others. What the spec states is
    /// replaced, up to the rounding of its `bits`.
    pub(super) fn measure_noise(&mut self, records: &[Record]) -> Result<(), AlignError> {
        if self.spec.signal.as_ref().and_then(SignalSpec::band).is_none() {
            return Ok(());
        }
        let ratio = self.spec.ratio as f64;
        let recordings: Vec<Recording> = (0..records.len()).map(|i| self.recording(i, records)).collect();
        let settings = FusionSettings {
            first: FastPeriods(self.channels[self.reference].skip as f64 * ratio),
            count: self.frames * self.spec.ratio,
            reach: REACH,
        };
        let deviation = |(clock, record): (&ClockCourse, &Record)| {
            FastPeriods(ratio * clock.usual_deviation(record.samples.len()))
        };
        let deviations = self.clocks.iter().zip(records).map(deviation).collect();
        let model = design::learned_model(&self.spec, &recordings, deviations, settings)?;
        let ways = model.ways(&recordings, settings).map_err(DesignError::from)?;
        for (channel, variance) in self.spec.channels.iter_mut().zip(&model.noise) {
            channel.noise = (variance - channel.rounding().powi(2)).max(0.0).sqrt().min(1.0);
        }
        if let Some(signal) = &mut self.spec.signal {
            signal.rms = model.power.sqrt().clamp(1e-12, 1.0);
        }
        let snr = |error: f64| Decibels::of_power(1.0 / error.max(f64::MIN_POSITIVE));
        let errors = ways.alone.iter().map(|error| error.total()).enumerate();
        let best = errors.min_by(|a, b| a.1.total_cmp(&b.1));
        self.alone = best.map(|(i, error)| Alone {
            channel: i + 1,
            snr_db: snr(error),
            together_db: snr(ways.together.total()),
        });
        Ok(())
    }

    /// The samples of a channel, without its offset and what the signal has at 0 Hz, with their instants in
    /// fast periods.
    fn recording(&self, i: usize, records: &[Record]) -> Recording {
        let usable = |(x, keep): (&f64, &bool)| if *keep { *x } else { f64::NAN };
        let ChannelSpec { gain, offset, .. } = self.spec.channels[self.reference];
        let level = (records[self.reference].mean() - offset) / gain;
        let own = &self.spec.channels[i];
        let straight = |x: f64| own.straightened(x) - own.offset - own.gain * level;
        let samples = records[i].samples.iter().zip(&records[i].keep).map(usable).map(straight);
        self.clocks[i].recording(samples.collect(), i, 1.0, self.spec.ratio as f64)
    }
}
