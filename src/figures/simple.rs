//! The simple ways that a bank must beat, and whether one channel alone does as well as all of them.

use super::LEAST_GAIN;
use super::reconstruction::Reconstruction;
use super::snr::{Ratios, Setting};
use super::spline::Spline;
use crate::design::{DesignError, Problem};
use crate::spec::Spec;
use crate::units::Decibels;
use std::ops::Range;

/// Channels that are tried alone, at most: one of each kind of front end, gain, noise and rate.
const MOST_ALONE: usize = 8;

/// A way to use the slow samples without a bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SimpleWay {
    /// One channel through its best filter: least mean-square error, with samples of all time.
    OneChannel,
    /// Each output sample is the slow sample nearest to its instant; with as many channels as the ratio
    /// only.
    Interleaving,
    /// The cubic spline through all slow samples at their instants.
    CubicSpline,
}

/// What a simple way gives.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct SimpleFigure {
    /// The way.
    pub way: SimpleWay,
    /// The channel that is used alone, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// Its signal-to-noise ratio, with all parts; with converters of 16 bits where the spec states no noise.
    pub snr_db: Decibels,
}

/// All simple ways for a problem.
pub(super) fn ways(problem: &Problem) -> Vec<Reconstruction> {
    let spline = Reconstruction::Spline(Spline::new(problem));
    let alone = kinds(problem)
        .into_iter()
        .map(|(converter, samples)| Reconstruction::OneChannel { converter, samples });
    Reconstruction::interleaving(problem).into_iter().chain([spline]).chain(alone).collect()
}

/// The first channel of each kind: a delay does not change what a channel gives alone. None where there is
/// one channel only: that is the bank.
pub(super) fn kinds(problem: &Problem) -> Vec<(usize, Range<usize>)> {
    let mut kinds: Vec<(usize, Range<usize>)> = Vec::new();
    let kind = |samples: &Range<usize>| {
        let (channel, noise) = (problem.channels[samples.start], problem.noise[samples.start]);
        (channel.front_end, channel.gain, noise, samples.len())
    };
    let converters = problem.converters();
    let choices = if converters.len() > 1 { converters } else { Vec::new() };
    for (converter, samples) in choices.into_iter().enumerate() {
        if kinds.len() < MOST_ALONE && !kinds.iter().any(|(_, other)| kind(other) == kind(&samples)) {
            kinds.push((converter, samples));
        }
    }
    kinds
}

/// The figures of the simple ways among `ways`, the best one first, and of single channels only the best.
pub(super) fn figures(ways: &[Reconstruction], ratios: &[Ratios]) -> Vec<SimpleFigure> {
    let named = |(way, ratios): (&Reconstruction, &Ratios)| {
        let (way, channel) = match way {
            Reconstruction::Bank(_) => return None,
            Reconstruction::Interleaving(_) => (SimpleWay::Interleaving, None),
            Reconstruction::Spline(_) => (SimpleWay::CubicSpline, None),
            Reconstruction::OneChannel { converter, .. } => (SimpleWay::OneChannel, Some(converter + 1)),
        };
        Some(SimpleFigure { way, channel, snr_db: ratios.with_noise() })
    };
    let mut found: Vec<SimpleFigure> = ways.iter().zip(ratios).filter_map(named).collect();
    found.sort_by(|a, b| b.snr_db.0.total_cmp(&a.snr_db.0));
    let mut alone = 0;
    found.retain(|figure| {
        alone += usize::from(figure.way == SimpleWay::OneChannel);
        figure.way != SimpleWay::OneChannel || alone == 1
    });
    found
}

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
        let setting = Setting::new(&spec, 0)?;
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
