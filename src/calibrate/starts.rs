//! Whether the captures of a spec's channels began together and have the polarities and gains of the spec.
//!
//! A capture that began d samples too early, with the sign s, holds s x_i[k - d]: at the slow frequency W
//! it has the factor s e^{-jWd}, whichever alias it shows. With the column a_i = g_i Phi_i(j nu) e^{-j nu
//! D_i} of the alias nu = (W + 2 pi k) / M and the spectral matrix R of a band,
//!
//! ```text
//! u = sum over bands of min over k of (tr R - a* R a / |a|^2), over the sum of tr R
//! ```
//!
//! is the share of the power that one alias per band leaves unexplained. It is near 0 for captures of the
//! spec whose aliases do not overlap, and near 1 - 1/N for captures that do not belong together. Where it
//! is large, other starts and signs are tried, one channel after another: the peaks of the
//! cross-correlations.

use super::blind::{Spectra, SpectralBand};
use super::fit::FittedValues;
use super::model::{ChannelModel, ChannelValues};
use super::record::{Record, longest_run};
use crate::linalg::{CMat, Complex, fourier};
use crate::sine_fit::Channel;
use std::f64::consts::TAU;

/// Fewest frames that are compared.
const LEAST_FRAMES: usize = 1024;
/// Captures that leave no more unexplained are those of the spec.
const UNEXPLAINED_SHARE: f64 = 0.02;
/// Other starts must leave at most this share of what the nominal ones leave.
const CLEARLY_LESS: f64 = 0.1;
/// What a change of one channel must leave at most to be followed by that of another.
const WORTH_GOING_ON: f64 = 0.7;
/// Starts that leave at most so many times what the best ones leave explain the captures as well, and so do
/// those that leave this share of what was left before: a periodic signal has many.
const ALIKE_FACTOR: f64 = 3.0;
const ALIKE_SHARE: f64 = 0.01;
/// The nearest start is taken if all others that explain the captures are so many times as far.
const DISTINCT: i64 = 8;
/// Starts this near to each other are one, which a narrow band does not resolve.
const NEIGHBOURS: i64 = 2;
/// First step of the search for the best start near a peak, which is as wide as the band is narrow.
const FIRST_STEP: i64 = 64;
const MOST_STEPS: usize = 20;
/// Share of the frames that must overlap: of short overlaps too many look alike.
const OVERLAP: usize = 2;
/// An alias is plausible if the front ends pass it with this share of the gain of the strongest one.
const PLAUSIBLE_GAIN_SHARE: f64 = 0.05;
/// With a signal in fewer bands any alias is possible: it may be a tone in any Nyquist zone.
const BROAD_SIGNAL_BANDS: f64 = 8.0;
/// A signal in fewer bands, one tone or two, tells nothing of starts.
const LEAST_BANDS: f64 = 2.5;
/// Farthest aliases that are looked at, and farthest zones whose correlations are searched.
const FARTHEST_ALIAS: usize = 16;
const FARTHEST_ZONE: usize = 4;
/// Starts of a channel that are tried.
const MOST_STARTS: usize = 6;
/// A correlation peak of this share of the largest may be that of a nearer period.
const LIKELY_PEAK_SHARE: f64 = 0.9;

/// Starts and signs of all channels, and how well they explain the captures.
#[derive(Clone)]
pub(super) struct Starts {
    /// Samples by which each capture began too early.
    pub(super) early: Vec<i64>,
    /// -1 for an inverted capture.
    pub(super) signs: Vec<f64>,
    /// Gains relative to those of the spec, up to a common factor.
    pub(super) gains: Vec<f64>,
    /// u, of any alias if the signal is narrow.
    pub(super) unexplained: f64,
    /// The same of plausible aliases.
    pub(super) implausible: f64,
    /// Bands that the signal occupies.
    width: f64,
}

/// The starts that explain the captures clearly better than the nominal ones, or these. `None` where the
/// captures do not tell: too few frames, no signal, or many starts alike.
pub(super) fn starts(model: &ChannelModel, records: &[Record]) -> Option<Starts> {
    let (first, frames) = longest_run(records);
    if frames < LEAST_FRAMES {
        return None;
    }
    let captures = records.iter().map(|record| &record.samples[first..first + frames]).collect();
    let search = StartSearch {
        model,
        nominal: ChannelValues::nominal(model, FittedValues::default(), 0),
        captures,
        frames,
    };
    let nominal = search.judged(vec![0; records.len()], vec![1.0; records.len()])?;
    if nominal.unexplained <= UNEXPLAINED_SHARE {
        return Some(nominal);
    }
    let found = search.improved(&nominal)?;
    let is_resolved = found.width >= LEAST_BANDS || found.early == nominal.early;
    let is_clear = found.unexplained <= CLEARLY_LESS * nominal.unexplained && is_resolved;
    Some(if is_clear { found } else { nominal })
}

struct StartSearch<'a> {
    model: &'a ChannelModel,
    nominal: ChannelValues,
    captures: Vec<&'a [f64]>,
    frames: usize,
}

impl StartSearch<'_> {
    /// The nominal starts changed channel by channel as long as that explains more; `None` if a channel has
    /// several starts that explain the captures alike.
    fn improved(&self, nominal: &Starts) -> Option<Starts> {
        let peaks: Vec<Vec<i64>> = (1..self.captures.len()).map(|i| self.peaks(i)).collect();
        let mut present = nominal.clone();
        for _ in 0..self.captures.len() {
            // Two channels have one difference.
            let channels = usize::from(self.captures.len() == 2)..self.captures.len();
            let changes = channels.flat_map(|i| self.changes(i, &present, &peaks));
            let changes: Vec<(usize, Starts)> = changes.collect();
            let least = changes.iter().min_by(|a, b| a.1.unexplained.total_cmp(&b.1.unexplained));
            let Some((channel, best)) = least else { break };
            if best.unexplained > WORTH_GOING_ON * present.unexplained {
                break;
            }
            let limit = (ALIKE_FACTOR * best.unexplained).max(ALIKE_SHARE * present.unexplained);
            let alike = changes.iter().filter(|(i, change)| i == channel && change.unexplained <= limit);
            let nearest = nearest(alike.map(|(_, change)| change), *channel, &present)?;
            present = self.refined(*channel, nearest)?;
            if present.unexplained <= UNEXPLAINED_SHARE * nominal.unexplained {
                break;
            }
        }
        Some(present)
    }

    /// The changes of one channel that are tried.
    fn changes(&self, i: usize, from: &Starts, peaks: &[Vec<i64>]) -> Vec<(usize, Starts)> {
        let mut starts = match i {
            0 => (1..).zip(peaks).flat_map(|(j, of)| of.iter().map(move |d| from.early[j] - d)).collect(),
            _ => peaks[i - 1].iter().map(|d| from.early[0] + d).collect::<Vec<i64>>(),
        };
        starts.insert(0, from.early[i]);
        starts.dedup();
        starts.truncate(MOST_STARTS + 1);
        let both = starts.into_iter().flat_map(|start| [(start, 1.0), (start, -1.0)]);
        let changed = both.filter(|change| *change != (from.early[i], 1.0)).filter_map(|(start, sign)| {
            let (mut early, mut signs) = (from.early.clone(), from.signs.clone());
            early[i] = start;
            signs[i] *= sign;
            Some((i, self.judged(early, signs)?))
        });
        changed.collect()
    }

    /// The best start near that of a change, if it is clearly better. `None` if it lies farther away than
    /// peaks do that the signal resolves.
    fn refined(&self, i: usize, change: &Starts) -> Option<Starts> {
        let (mut best, mut step) = (change.clone(), FIRST_STEP);
        for _ in 0..MOST_STEPS {
            if step == 0 {
                break;
            }
            let beside = [-step, step].into_iter().filter_map(|step| {
                let mut early = best.early.clone();
                early[i] += step;
                self.judged(early, best.signs.clone())
            });
            match beside.min_by(|a, b| a.unexplained.total_cmp(&b.unexplained)) {
                Some(moved) if moved.unexplained < best.unexplained => best = moved,
                _ => step /= 2,
            }
        }
        if ALIKE_FACTOR * best.unexplained >= change.unexplained {
            return Some(change.clone());
        }
        ((best.early[i] - change.early[i]).abs() <= NEIGHBOURS).then_some(best)
    }

    /// The spectral matrices of the captures from the assumed starts on.
    fn bands(&self, early: &[i64]) -> Option<Vec<SpectralBand>> {
        let least = early.iter().min()?;
        let skips = early.iter().map(|d| usize::try_from(d - least).unwrap_or(usize::MAX));
        let skips: Vec<usize> = skips.collect();
        let length = fast_length(self.frames.saturating_sub(*skips.iter().max()?));
        if length < LEAST_FRAMES || (OVERLAP + 1) * length < self.frames {
            return None;
        }
        let cut: Vec<&[f64]> =
            self.captures.iter().zip(&skips).map(|(samples, skip)| &samples[*skip..skip + length]).collect();
        Some(Spectra::new(&cut, &self.model.delays, self.model.ratio).bands(&self.model.delays))
    }

    /// How well starts and signs explain the captures.
    fn judged(&self, early: Vec<i64>, signs: Vec<f64>) -> Option<Starts> {
        let mut bands = self.bands(&early)?;
        let powers: Vec<f64> = bands.iter().map(SpectralBand::power).collect();
        let width = powers.iter().sum::<f64>().powi(2) / powers.iter().map(|p| p * p).sum::<f64>();
        let columns: Vec<Vec<CMat>> = bands.iter().map(|band| self.columns(band.w)).collect();
        let gains = self.gains(&bands, &columns);
        let (mut any, mut plausible, mut all) = (0.0, 0.0, 0.0);
        for (band, columns) in bands.iter_mut().zip(&columns) {
            let scaled = |i: usize| signs[i] / gains[i];
            let n = band.matrix.nrows();
            band.matrix = CMat::from_fn(n, n, |i, j| band.matrix[(i, j)] * (scaled(i) * scaled(j)));
            let least = |columns: &[CMat]| {
                columns.iter().map(|column| band.unexplained(column)).fold(band.power(), f64::min)
            };
            let weakest = columns.first().map_or(0.0, |strongest| PLAUSIBLE_GAIN_SHARE * strongest.norm());
            any += least(columns);
            plausible += least(&columns[..columns.partition_point(|a| a.norm() >= weakest)]);
            all += band.power();
        }
        let implausible = plausible / all;
        let unexplained = if width < BROAD_SIGNAL_BANDS { any / all } else { implausible };
        let starts = Starts { early, signs, gains, unexplained, implausible, width };
        unexplained.is_finite().then_some(starts)
    }

    /// The power of each channel over that which the spec expects of the mean signal, as a factor of the
    /// gain.
    fn gains(&self, bands: &[SpectralBand], columns: &[Vec<CMat>]) -> Vec<f64> {
        let gain = |i: usize| {
            let (mut found, mut expected) = (0.0, 0.0);
            for (band, columns) in bands.iter().zip(columns) {
                let Some(a) = columns.first() else { continue };
                found += band.count as f64 * band.matrix[(i, i)].re;
                expected += band.power() / a.norm_squared() * a[(i, 0)].norm_sqr();
            }
            (found / expected).sqrt()
        };
        (0..self.captures.len()).map(gain).collect()
    }

    /// The columns of the aliases at W, that of the strongest first.
    fn columns(&self, w: f64) -> Vec<CMat> {
        let reach = self.model.ratio.min(FARTHEST_ALIAS) as i32;
        let mut all: Vec<CMat> =
            (-reach..=reach).map(|k| self.model.steering(&self.nominal, w, &[k])).collect();
        all.sort_by(|a, b| b.norm_squared().total_cmp(&a.norm_squared()));
        all.retain(|a| a.norm() > 0.0);
        all
    }

    /// Likely starts of channel `i` relative to the first one: the peaks of the cross-correlations, each
    /// with the phases of a Nyquist zone removed.
    fn peaks(&self, i: usize) -> Vec<i64> {
        let size = (2 * self.frames).next_power_of_two();
        let [x, r] = [i, 0].map(|i| {
            let mut padded = Channel::new(self.captures[i]).deviations();
            padded.resize(size, 0.0);
            fourier::real_spectrum(&padded)
        });
        let cross = fourier::half_whitened(&x, &r);
        let apart = self.model.delays[i] - self.model.delays[0];
        let zones = self.model.ratio.min(FARTHEST_ZONE) as i32;
        let mut peaks: Vec<(f64, i64)> = Vec::new();
        for zone in -zones..=zones {
            let nu = |b: usize| self.model.alias(b as f64 * (TAU / size as f64), zone);
            let phased = |b: usize| cross[b] * Complex::from_polar(1.0, nu(b) * apart);
            let spectrum: Vec<Complex<f64>> = (0..x.len()).map(phased).collect();
            peaks.extend(highest(&fourier::real_sequence(&spectrum, size), self.frames / OVERLAP));
        }
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut starts: Vec<i64> = Vec::new();
        for (_, start) in peaks {
            if starts.iter().all(|other| (other - start).abs() > NEIGHBOURS) {
                starts.push(start);
            }
        }
        starts
    }
}

/// The nearest of the changes of a channel that explain the captures alike, if the others are far.
fn nearest<'a>(alike: impl Iterator<Item = &'a Starts>, i: usize, from: &Starts) -> Option<&'a Starts> {
    let mut alike: Vec<&Starts> = alike.collect();
    let moved = |change: &Starts| (change.early[i] - from.early[i]).abs();
    alike.sort_by(|a, b| moved(a).cmp(&moved(b)).then(a.unexplained.total_cmp(&b.unexplained)));
    let first = *alike.first()?;
    // Among starts that a narrow band does not resolve the best one counts.
    let is_same =
        |other: &Starts| (other.early[i] - first.early[i]).abs() <= NEIGHBOURS && other.signs == first.signs;
    let is_far = |other: &Starts| moved(other) >= DISTINCT * moved(first).max(1);
    alike.iter().all(|other| is_same(other) || is_far(other)).then_some(first)
}

/// The two largest local maxima of |c| at lags up to `most` in both directions, and the nearest one that is
/// nearly as large.
fn highest(c: &[f64], most: usize) -> Vec<(f64, i64)> {
    let at = |lag: i64| c[lag.rem_euclid(c.len() as i64) as usize].abs();
    let most = most as i64;
    let is_peak = |lag: &i64| at(*lag) >= at(lag - 1) && at(*lag) >= at(lag + 1);
    let mut peaks: Vec<(f64, i64)> = (-most..=most).filter(is_peak).map(|lag| (at(lag), lag)).collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = peaks.first().map_or(0.0, |(height, _)| LIKELY_PEAK_SHARE * height);
    let likely = peaks.iter().take_while(|(height, _)| *height >= least);
    let nearest = likely.min_by_key(|(_, lag)| lag.abs()).copied();
    peaks.into_iter().take(2).chain(nearest).collect()
}

/// The largest length up to `length` whose transform is fast: few bits times a power of two.
fn fast_length(length: usize) -> usize {
    let step = 1 << length.max(1).ilog2().saturating_sub(6);
    length / step * step
}
