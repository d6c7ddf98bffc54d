//! The usual ways beside a bank, and whether one channel alone does as well as all of them.

use super::LEAST_GAIN;
use super::correction::Correction;
use super::reconstruction::Reconstruction;
use super::snr::{Ratios, Setting};
use super::spline::Spline;
use crate::design::filters::FilterResponse;
use crate::design::{DesignError, Problem, least_squares_taps};
use hybank_core::bank::{Bank, SynthesisFilters};
use hybank_core::spec::{Method, Spec};
use hybank_core::units::{CyclesPerFastPeriod, Decibels};
use std::ops::Range;

/// The end of the widest band in which a spline through converters in turn is tried: 0.7 of half the output
/// rate. Beyond it none is drawn.
const WIDEST_OF_A_SPLINE: CyclesPerFastPeriod = CyclesPerFastPeriod(0.35);

/// Most samples of all channels that least-squares taps see here: a design of some seconds.
const MOST_SAMPLES_SEEN: usize = 512;

/// Channels that are tried alone, at most: one of each kind of front end, gain, noise and rate.
const MOST_ALONE: usize = 8;

/// A way to use the slow samples without a bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UsualWay {
    /// One channel through its best filter: least mean-square error, with samples of all time.
    OneChannel,
    /// Each output sample is the slow sample nearest to its instant; with as many channels as the ratio
    /// only.
    Interleaving,
    /// The same after each channel's own correction of its gain, offset and skew with 32 taps.
    OwnCorrection,
    /// The cubic spline through all slow samples at their instants; not for converters in turn whose signal
    /// comes near half the output rate.
    CubicSpline,
    /// FIR filters of least mean-square error, as long as the bank's.
    LeastSquares,
}

/// What a usual way gives.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct UsualFigure {
    /// The way.
    pub way: UsualWay,
    /// The channel that is used alone, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// Its signal-to-noise ratio, with all parts; with converters of 16 bits where the spec states no noise.
    pub snr_db: Decibels,
    /// The distance of its largest image from the tone, with uncertain delays and gains as for the bank;
    /// `None` of one channel, which leaves its images, and where a tone of the band is lost altogether.
    pub sfdr_db: Option<Decibels>,
}

/// The ways for a problem that need no design.
pub(super) fn ways(problem: &Problem) -> Vec<Reconstruction> {
    let spline = Reconstruction::Spline(Spline::new(problem));
    let alone = kinds(problem)
        .into_iter()
        .map(|(converter, samples)| Reconstruction::OneChannel { converter, samples });
    Reconstruction::interleaving(problem).into_iter().chain([spline]).chain(alone).collect()
}

/// The usual ways beside `bank`: those that need no design, each channel's own correction for signals in a
/// band, and least-squares taps.
///
/// # Errors
/// As [`crate::design::Problem::new`].
pub(super) fn usual_ways(
    bank: &Bank,
    spec: &Spec,
    problem: &Problem,
    band: [CyclesPerFastPeriod; 2],
) -> Result<Vec<Reconstruction>, DesignError> {
    let mut all = ways(problem);
    if let Some(correction) = Correction::new(problem, band) {
        let is_splined = spec.signal.is_none() || band[1] <= WIDEST_OF_A_SPLINE;
        all.retain(|way| is_splined || !matches!(way, Reconstruction::Spline(_)));
        all.push(Reconstruction::Corrected(correction));
    }
    all.extend(least_squares(bank, spec)?);
    Ok(all)
}

/// Taps of least mean-square error for exact channels, as many as the taps of the bank; `None` where the
/// bank has them, has no taps, or has very many.
fn least_squares(bank: &Bank, spec: &Spec) -> Result<Option<Reconstruction>, DesignError> {
    let SynthesisFilters::Fir(own) = &bank.filters else { return Ok(None) };
    let taps = own.first().map_or(0, Vec::len);
    if bank.method == Method::H2 || own.len() * taps.div_ceil(bank.ratio) > MOST_SAMPLES_SEEN {
        return Ok(None);
    }
    let best = SynthesisFilters::Fir(least_squares_taps(spec, bank.latency, taps)?);
    Ok(Some(Reconstruction::LeastSquares(FilterResponse::new(&best, bank.ratio)?)))
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

/// The figures of the usual ways, the best one first, and of single channels only the best; least-squares
/// taps, which are a bank too, come last. `sfdr` gives that of a way.
pub(super) fn figures(
    ways: &[Reconstruction],
    ratios: &[Ratios],
    sfdr: impl Fn(&Reconstruction) -> Option<Decibels>,
) -> Vec<UsualFigure> {
    let named = |(of, ratios): (&Reconstruction, &Ratios)| {
        let (way, channel) = match of {
            Reconstruction::Bank(_) => return None,
            Reconstruction::Interleaving(_) => (UsualWay::Interleaving, None),
            Reconstruction::Spline(_) => (UsualWay::CubicSpline, None),
            Reconstruction::Corrected(_) => (UsualWay::OwnCorrection, None),
            Reconstruction::LeastSquares(_) => (UsualWay::LeastSquares, None),
            Reconstruction::OneChannel { converter, .. } => (UsualWay::OneChannel, Some(converter + 1)),
        };
        Some(UsualFigure { way, channel, snr_db: ratios.with_noise(), sfdr_db: sfdr(of) })
    };
    let mut found: Vec<UsualFigure> = ways.iter().zip(ratios).filter_map(named).collect();
    let is_bank = |figure: &UsualFigure| figure.way == UsualWay::LeastSquares;
    found.sort_by(|a, b| is_bank(a).cmp(&is_bank(b)).then(b.snr_db.0.total_cmp(&a.snr_db.0)));
    let mut alone = 0;
    found.retain(|figure| {
        alone += usize::from(figure.way == UsualWay::OneChannel);
        figure.way != UsualWay::OneChannel || alone == 1
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
