//! Whether one channel alone does as well as all of them, whatever the filters are.

use super::band::FigureBand;
use super::reconstruction::Reconstruction;
use super::simple::kinds;
use super::snr::{Ratios, Setting};
use super::{LEAST_GAIN, without_signal};
use crate::design::DesignError;
use crate::spec::Spec;
use crate::units::Decibels;

/// The best signal-to-noise ratios of filters of any length and latency, at the delays of a spec: limits of
/// every bank. With converters of 16 bits where the spec states no noise.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Alone {
    /// The channel, from 1, that gives the most alone.
    pub channel: usize,
    /// What it gives.
    pub snr_db: Decibels,
    /// What all channels give together.
    pub together_db: Decibels,
}

impl Alone {
    /// Of the channels of `spec`, whose delays count as known.
    ///
    /// # Errors
    /// As [`crate::design::Problem::new`].
    pub fn new(spec: &Spec) -> Result<Self, DesignError> {
        let spec = Spec { uncertainty: None, ..spec.clone() };
        let band = FigureBand::new(&spec, &without_signal(&spec, 0)?);
        let setting = Setting::new(&spec, 0, &|_| false, &band)?;
        let channels = kinds(setting.problem());
        let way = |converter, samples| Reconstruction::OneChannel { converter, samples };
        let alone = channels.iter().map(|(converter, samples)| way(*converter, samples.clone()));
        // Together they are one converter that has all samples of a frame.
        let all = way(0, 0..setting.problem().channels.len());
        let ways: Vec<Reconstruction> = std::iter::once(all).chain(alone).collect();
        let ratios: Vec<Decibels> = setting.ratios(&ways).iter().map(Ratios::with_noise).collect();
        // Of equal ones the first.
        let best = channels.iter().zip(&ratios[1..]).rev().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let (channel, snr_db) = best.map_or((1, ratios[0]), |((i, _), ratio)| (i + 1, *ratio));
        Ok(Self { channel, snr_db, together_db: ratios[0] })
    }

    /// Whether all channels together gain less than a decibel over the best of them.
    pub fn suffices(&self) -> bool {
        self.together_db - self.snr_db < LEAST_GAIN
    }
}
