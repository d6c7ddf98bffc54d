//! The analog signal for which mean squares hold: white noise in a band, or through the front ends at all
//! frequencies.

use super::deviations::Deviations;
use super::problem::Problem;
use hybank_core::units::RadiansPerFastPeriod;
use hybank_linalg::{CMat, Complex};
use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

/// Which aliases of an unbounded signal count.
struct Settings {
    /// Fast rates up to which every alias of an unbounded signal counts by itself: there the front ends
    /// change fast.
    all_up_to: f64,
    /// The same for ratios above [`LARGE_RATIO`], which have many aliases in a fast rate.
    all_up_to_large: f64,
    /// Beyond, one alias stands for a block of this share of its number: front ends are smooth there.
    alias_block_share: f64,
    /// Aliases are counted up to this multiple of the largest pole. A front end of one pole passes 6e-5 of
    /// its power above, 0.0003 dB.
    beyond_poles: f64,
    /// Where in its block an alias lies: the fractional parts of multiples of the golden ratio, so that
    /// products of channels with different delays average out.
    golden: f64,
}

/// Of every signal.
const SETTINGS: Settings = Settings {
    all_up_to: 8.0,
    all_up_to_large: 2.0,
    alias_block_share: 0.1,
    beyond_poles: 1e4,
    golden: 0.618_033_988_749_894_9,
};

const LARGE_RATIO: usize = 16;

/// A signal that reaches the samples of a problem.
#[derive(Debug, Clone)]
pub(crate) struct SampledSignal {
    problem: Problem,
    /// The frequencies that it occupies with unit density, radians per fast period. `None`: all.
    band: Option<RangeInclusive<f64>>,
    /// For an unbounded signal: numbers k of aliases and how many each stands for.
    aliases: Vec<Alias>,
}

/// One or more multiples of the slow rate.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Alias {
    number: f64,
    count: f64,
}

/// What a signal gives at one angle theta of the slow samples: a column for each analog frequency
/// w = (theta + 2 pi k) / M that aliases there. With the spectrum S of the signal,
///
/// ```text
/// measurement[i, k] = sqrt(S / M) g_i Phi_i(j w) e^{-j w D_i}
/// reference[p, k]   = sqrt(S / M) Phi_0(j w) e^{j w (p - m0)}
/// ```
///
/// The mean over theta of `|reference - F measurement|^2 / M` (Frobenius) is the mean square of the error of
/// the filters F per fast sample.
#[derive(Debug, Clone)]
pub(crate) struct AliasColumns {
    /// w of each column, radians per fast period.
    pub(crate) frequencies: Vec<f64>,
    /// N rows.
    pub(crate) measurement: CMat,
    /// M rows.
    pub(crate) reference: CMat,
}

impl SampledSignal {
    /// That of `problem`: white noise of unit density in its band, or through the filter of its signal at
    /// all frequencies.
    pub(crate) fn of(problem: &Problem) -> Self {
        let Some([low, high]) = problem.band else {
            return Self { problem: problem.clone(), band: None, aliases: aliases(problem) };
        };
        let problem = Problem { signal: None, ..problem.clone() };
        Self { problem, band: Some(low.0..=high.0), aliases: Vec::new() }
    }

    /// The front ends, delays and rates.
    pub(crate) fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Number of columns at an angle, about.
    pub(crate) fn columns(&self) -> usize {
        let in_band = |band: &RangeInclusive<f64>| {
            2 + (self.problem.ratio as f64 * (band.end() - band.start()) / PI) as usize
        };
        self.band.as_ref().map_or(self.aliases.len(), in_band)
    }

    /// Angles at which the columns change abruptly or much: the folded ends of the band, or the folded
    /// resonances of the front ends.
    pub(crate) fn breaks(&self) -> Vec<f64> {
        let folded = |w: f64| {
            let turn = (self.problem.ratio as f64 * w).rem_euclid(TAU);
            turn.min(TAU - turn)
        };
        match &self.band {
            Some(band) => vec![folded(*band.start()), folded(*band.end())],
            None => {
                let upper = self.poles().into_iter().filter(|pole| pole.im > 0.0);
                upper.map(|pole| folded(pole.im / self.problem.ratio as f64)).collect()
            }
        }
    }

    /// The poles of the front ends and of its own filter, for a slow period.
    pub(crate) fn poles(&self) -> Vec<Complex<f64>> {
        let own = self.problem.signal.iter().flat_map(|filter| filter.poles());
        let all = self.problem.front_ends.iter().flat_map(|filter| filter.poles()).chain(own);
        all.map(|pole| pole * self.problem.ratio as f64).collect()
    }

    /// The columns at theta, radians per slow period.
    pub(crate) fn at(&self, theta: f64) -> AliasColumns {
        let Problem { ratio, latency, front_ends, target, channels, .. } = &self.problem;
        let filters = 0..front_ends.len();
        let period = *ratio as f64;
        let aliases: Vec<Alias> = match &self.band {
            Some(band) => aliases_in(band, theta, period),
            None => self.aliases.clone(),
        };
        let frequencies: Vec<f64> =
            aliases.iter().map(|alias| (theta + TAU * alias.number) / period).collect();
        let mut measurement = CMat::zeros(channels.len(), aliases.len());
        let mut reference = CMat::zeros(*ratio, aliases.len());
        for (k, (&w, alias)) in frequencies.iter().zip(&aliases).enumerate() {
            let size = (alias.count / period).sqrt();
            let passed: Vec<Complex<f64>> =
                filters.clone().map(|i| self.problem.response(i, RadiansPerFastPeriod(w)) * size).collect();
            for (i, channel) in channels.iter().enumerate() {
                let delayed = Complex::from_polar(channel.gain, -w * channel.delay.in_fast_periods().0);
                measurement[(i, k)] = passed[channel.front_end] * delayed;
            }
            for p in 0..*ratio {
                let advance = w * (p as f64 - *latency as f64);
                reference[(p, k)] = passed[*target] * Complex::from_polar(1.0, advance);
            }
        }
        AliasColumns { frequencies, measurement, reference }
    }
}

impl AliasColumns {
    /// The mean over errors of the converters, and beside it columns that the samples of one converter alone
    /// have: the mean square over all columns is that over the errors. A delay shared by the samples of a
    /// converter changes nothing between them.
    pub(crate) fn with_errors(mut self, problem: &Problem, deviations: &[Deviations]) -> Self {
        let mut rest = Vec::new();
        for (own, samples) in deviations.iter().zip(problem.converters()) {
            let mut beside = CMat::zeros(self.measurement.nrows(), self.measurement.ncols());
            for (k, &w) in self.frequencies.iter().enumerate() {
                for i in samples.clone() {
                    beside[(i, k)] = self.measurement[(i, k)] * own.power(w).sqrt();
                    self.measurement[(i, k)] *= own.mean_phase(w);
                }
            }
            rest.push(beside);
        }
        let parts: Vec<&CMat> = std::iter::once(&self.measurement).chain(&rest).collect();
        self.measurement = hybank_linalg::hstack(&parts);
        self.reference = self.reference.resize_horizontally(self.measurement.ncols(), Complex::ZERO);
        self
    }
}

/// The aliases of theta within a band and its mirror.
fn aliases_in(band: &RangeInclusive<f64>, theta: f64, period: f64) -> Vec<Alias> {
    let number = |w: f64| (w * period - theta) / TAU;
    let (first, last) = (number(-band.end()).ceil() as i64, number(*band.end()).floor() as i64);
    let all = (first..=last).map(|k| Alias { number: k as f64, count: 1.0 });
    all.filter(|alias| band.contains(&((theta + TAU * alias.number) / period).abs())).collect()
}

/// All aliases of an unbounded signal that count.
fn aliases(problem: &Problem) -> Vec<Alias> {
    let rates = if problem.ratio > LARGE_RATIO { SETTINGS.all_up_to_large } else { SETTINGS.all_up_to };
    let direct = (rates * problem.ratio as f64).ceil();
    let poles = problem.front_ends.iter().flat_map(|filter| filter.poles());
    let fastest = poles.map(|pole| pole.norm()).fold(0.0, f64::max);
    let last = (SETTINGS.beyond_poles * fastest / TAU * problem.ratio as f64).max(direct);
    let mut found: Vec<Alias> =
        (0..=2 * direct as i64).map(|k| Alias { number: k as f64 - direct, count: 1.0 }).collect();
    let (mut start, mut place) = (direct + 1.0, 0.0_f64);
    while start <= last {
        let count = (SETTINGS.alias_block_share * start).ceil();
        place = (place + SETTINGS.golden).fract();
        let number = start + (place * count).floor();
        found.extend([Alias { number, count }, Alias { number: -number, count }]);
        start += count;
    }
    found
}
