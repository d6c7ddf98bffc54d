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

use super::blind::{Band, Spectra};
use super::model::Model;
use super::record::{Record, longest_run};
use crate::linalg::{CMat, Complex, fourier};
use std::f64::consts::TAU;

/// Fewest frames that are compared.
const LEAST_FRAMES: usize = 1024;
/// Captures that leave no more unexplained are those of the spec.
const SETTLED: f64 = 0.02;
/// Other starts must leave at most this share of what the nominal ones leave.
const LEFT: f64 = 0.1;
/// What a change of one channel must leave at most to be followed by that of another.
const IMPROVED: f64 = 0.7;
/// Starts that leave at most so many times what the best ones leave explain the captures as well, and so do
/// those that leave this share of what was left before: a periodic signal has many.
const ALIKE: f64 = 3.0;
const NEARLY_NOTHING: f64 = 0.01;
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
const PLAUSIBLE: f64 = 0.05;
/// With a signal in fewer bands any alias is possible: it may be a tone in any Nyquist zone.
const BROAD: f64 = 8.0;
/// A signal in fewer bands, one tone or two, tells nothing of starts.
const LEAST_BANDS: f64 = 2.5;
/// Farthest aliases that are looked at, and farthest zones whose correlations are searched.
const FARTHEST_ALIAS: usize = 16;
const FARTHEST_ZONE: usize = 4;
/// Starts of a channel that are tried.
const MOST_STARTS: usize = 6;
/// A correlation peak of this share of the largest may be that of a nearer period.
const LIKELY: f64 = 0.9;

/// What the captures say of their starts.
pub(super) struct Starts {
    /// Samples by which each capture began too early.
    pub(super) early: Vec<i64>,
    pub(super) inverted: Vec<bool>,
    /// Gains relative to those of the spec, up to a common factor.
    pub(super) gains: Vec<f64>,
    /// u at these starts, of any alias.
    pub(super) unexplained: f64,
    /// The same of plausible aliases.
    pub(super) implausible: f64,
}

/// Starts and signs of all channels.
#[derive(Clone, PartialEq)]
struct Guess {
    early: Vec<i64>,
    signs: Vec<f64>,
}

/// How well a guess explains the captures.
struct Judged {
    unexplained: f64,
    implausible: f64,
    gains: Vec<f64>,
    /// Bands that the signal occupies.
    width: f64,
}

/// A guess that changes one channel.
struct Change {
    channel: usize,
    guess: Guess,
    left: f64,
}

/// The starts that explain the captures clearly better than the nominal ones, or these. `None` where the
/// captures do not tell: too few frames, no signal, or many starts alike.
pub(super) fn starts(model: &Model, records: &[Record]) -> Option<Starts> {
    let (first, frames) = longest_run(records);
    if frames < LEAST_FRAMES {
        return None;
    }
    let captures = records.iter().map(|record| &record.samples[first..first + frames]).collect();
    let search = Search { model, captures, frames };
    let nominal = Guess { early: vec![0; records.len()], signs: vec![1.0; records.len()] };
    let before = search.left(&nominal)?;
    if before <= SETTLED {
        return search.found(nominal);
    }
    let found = search.improved(&nominal, before)?;
    let judged = search.judged(&found)?;
    let is_resolved = judged.width >= LEAST_BANDS || found.early == nominal.early;
    let is_clear = judged.unexplained <= LEFT * before && is_resolved;
    search.found(if is_clear { found } else { nominal })
}

struct Search<'a> {
    model: &'a Model,
    captures: Vec<&'a [f64]>,
    frames: usize,
}

impl Search<'_> {
    fn found(&self, guess: Guess) -> Option<Starts> {
        let Judged { unexplained, implausible, gains, .. } = self.judged(&guess)?;
        let inverted = guess.signs.iter().map(|sign| *sign < 0.0).collect();
        Some(Starts { early: guess.early, inverted, gains, unexplained, implausible })
    }

    fn left(&self, guess: &Guess) -> Option<f64> {
        self.judged(guess).map(|judged| judged.unexplained)
    }

    /// The nominal guess changed channel by channel as long as that explains more; `None` if a channel has
    /// several starts that explain the captures alike.
    fn improved(&self, nominal: &Guess, before: f64) -> Option<Guess> {
        let peaks: Vec<Vec<i64>> = (0..self.captures.len()).map(|i| self.peaks(i)).collect();
        let (mut guess, mut left) = (nominal.clone(), before);
        for _ in 0..self.captures.len() {
            let changes = self.changes(&guess, &peaks);
            let Some(best) = changes.iter().min_by(|a, b| a.left.total_cmp(&b.left)) else { break };
            if best.left > IMPROVED * left {
                break;
            }
            let limit = (ALIKE * best.left).max(NEARLY_NOTHING * left);
            let alike = changes.iter().filter(|c| c.channel == best.channel && c.left <= limit);
            let nearest = nearest(alike, best.channel, &guess)?;
            (guess, left) = self.refined(nearest)?;
            if left <= SETTLED * before {
                break;
            }
        }
        Some(guess)
    }

    /// All changes of one channel that are tried.
    fn changes(&self, guess: &Guess, peaks: &[Vec<i64>]) -> Vec<Change> {
        // Two channels have one difference.
        let first = usize::from(self.captures.len() == 2);
        let channels = first..self.captures.len();
        channels.flat_map(|channel| self.changes_of(channel, guess, peaks)).collect()
    }

    fn changes_of(&self, channel: usize, guess: &Guess, peaks: &[Vec<i64>]) -> Vec<Change> {
        let mut starts: Vec<i64> = if channel == 0 {
            (1..peaks.len()).flat_map(|j| peaks[j].iter().map(move |d| guess.early[j] - d)).collect()
        } else {
            peaks[channel].iter().map(|d| guess.early[0] + d).collect()
        };
        starts.insert(0, guess.early[channel]);
        starts.dedup();
        starts.truncate(MOST_STARTS + 1);
        let guesses = starts.into_iter().flat_map(|start| {
            [1.0, -1.0].map(|sign| {
                let mut changed = guess.clone();
                changed.early[channel] = start;
                changed.signs[channel] *= sign;
                changed
            })
        });
        let judged = guesses.filter(|changed| changed != guess).filter_map(|guess| {
            let left = self.left(&guess)?;
            Some(Change { channel, guess, left })
        });
        judged.collect()
    }

    /// The best start near that of a change, if it is clearly better. `None` if it lies farther away than
    /// peaks do that the signal resolves.
    fn refined(&self, change: &Change) -> Option<(Guess, f64)> {
        let (mut guess, mut left) = (change.guess.clone(), change.left);
        let mut step = FIRST_STEP;
        for _ in 0..MOST_STEPS {
            if step == 0 {
                break;
            }
            let beside = [-step, step].into_iter().filter_map(|step| {
                let mut moved = guess.clone();
                moved.early[change.channel] += step;
                self.left(&moved).map(|left| (moved, left))
            });
            match beside.min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((moved, least)) if least < left => (guess, left) = (moved, least),
                _ => step /= 2,
            }
        }
        if ALIKE * left >= change.left {
            return Some((change.guess.clone(), change.left));
        }
        let moved = (guess.early[change.channel] - change.guess.early[change.channel]).abs();
        (moved <= NEIGHBOURS).then_some((guess, left))
    }

    /// The spectral matrices of the captures from the assumed starts on.
    fn bands(&self, early: &[i64]) -> Option<Vec<Band>> {
        let least = early.iter().min()?;
        let skipped: Vec<usize> =
            early.iter().map(|d| usize::try_from(d - least).unwrap_or(usize::MAX)).collect();
        let length = smooth(self.frames.saturating_sub(*skipped.iter().max()?));
        if length < LEAST_FRAMES || (OVERLAP + 1) * length < self.frames {
            return None;
        }
        let cut: Vec<&[f64]> = self
            .captures
            .iter()
            .zip(&skipped)
            .map(|(samples, skip)| &samples[*skip..skip + length])
            .collect();
        let delays: Vec<f64> = self.model.delays.iter().map(|delay| delay.0).collect();
        Some(Spectra::new(&cut, &delays, self.model.ratio).bands(&delays))
    }

    fn judged(&self, guess: &Guess) -> Option<Judged> {
        let bands = self.bands(&guess.early)?;
        let powers: Vec<f64> = bands.iter().map(|band| band.count as f64 * band.matrix.trace().re).collect();
        let width = powers.iter().sum::<f64>().powi(2) / powers.iter().map(|p| p * p).sum::<f64>();
        let columns: Vec<Vec<CMat>> = bands.iter().map(|band| self.columns(band.w)).collect();
        let gains = self.gains(&bands, &columns);
        let (mut left, mut plausible, mut all) = (0.0, 0.0, 0.0);
        for (band, columns) in bands.iter().zip(&columns) {
            let scaled = |i: usize| guess.signs[i] / gains[i];
            let n = band.matrix.nrows();
            let matrix = CMat::from_fn(n, n, |i, j| band.matrix[(i, j)] * (scaled(i) * scaled(j)));
            let power = matrix.trace().re;
            let explained = |a: &CMat| (a.adjoint() * &matrix * a)[(0, 0)].re / a.norm_squared();
            let strongest = columns.first().map_or(0.0, |a| PLAUSIBLE * a.norm());
            let usual =
                columns.iter().take_while(|a| a.norm() >= strongest).map(explained).fold(0.0, f64::max);
            left += band.count as f64 * (power - columns.iter().map(explained).fold(0.0, f64::max));
            plausible += band.count as f64 * (power - usual);
            all += band.count as f64 * power;
        }
        let implausible = plausible / all;
        let unexplained = if width < BROAD { left / all } else { implausible };
        unexplained.is_finite().then_some(Judged { unexplained, implausible, gains, width })
    }

    /// The power of each channel over that which the spec expects of the mean signal, as a factor of the
    /// gain.
    fn gains(&self, bands: &[Band], columns: &[Vec<CMat>]) -> Vec<f64> {
        let gain = |i: usize| {
            let (mut found, mut expected) = (0.0, 0.0);
            for (band, columns) in bands.iter().zip(columns) {
                let Some(a) = columns.first() else { continue };
                let signal = band.matrix.trace().re / a.norm_squared();
                found += band.count as f64 * band.matrix[(i, i)].re;
                expected += band.count as f64 * signal * a[(i, 0)].norm_sqr();
            }
            (found / expected).sqrt()
        };
        (0..self.captures.len()).map(gain).collect()
    }

    /// The columns of the aliases at W, that of the strongest first; without the phases that the bands lack.
    fn columns(&self, w: f64) -> Vec<CMat> {
        let reach = self.model.ratio.min(FARTHEST_ALIAS) as i32;
        let mut all: Vec<CMat> = (-reach..=reach).map(|k| self.column(w, k)).collect();
        all.sort_by(|a, b| b.norm_squared().total_cmp(&a.norm_squared()));
        all.retain(|a| a.norm() > 0.0);
        all
    }

    fn column(&self, w: f64, alias: i32) -> CMat {
        let (m, turn) = (self.model.ratio as f64, TAU * f64::from(alias));
        CMat::from_fn(self.captures.len(), 1, |i, _| {
            let phase = -turn * self.model.delays[i].0 / m;
            self.model.response(i, (w + turn) / m, 0.0) * Complex::from_polar(self.model.gains[i], phase)
        })
    }

    /// Likely starts of channel `i` relative to the first one: the peaks of the cross-correlations, each
    /// with the phases of a Nyquist zone removed.
    fn peaks(&self, i: usize) -> Vec<i64> {
        if i == 0 {
            return Vec::new();
        }
        let size = (2 * self.frames).next_power_of_two();
        let [x, r] = [i, 0].map(|i| fourier::real_spectrum(&padded(self.captures[i], size)));
        let step = TAU / size as f64;
        // Half whitened: neither the strongest frequencies alone nor the noise between them decides.
        let cross = |b: usize| {
            let product = x[b] * r[b].conj();
            if product.norm() > 0.0 { product / product.norm().sqrt() } else { Complex::ZERO }
        };
        let apart = self.model.delays[i].0 - self.model.delays[0].0;
        let m = self.model.ratio as f64;
        let zones = self.model.ratio.min(FARTHEST_ZONE) as i32;
        let mut peaks: Vec<(f64, i64)> = Vec::new();
        for zone in -zones..=zones {
            let turn = TAU * f64::from(zone);
            let phased = |b: usize| cross(b) * Complex::from_polar(1.0, (b as f64 * step + turn) * apart / m);
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

/// The nearest of the changes that explain the captures alike, if the others are far.
fn nearest<'a>(alike: impl Iterator<Item = &'a Change>, channel: usize, from: &Guess) -> Option<&'a Change> {
    let mut alike: Vec<&Change> = alike.collect();
    let moved = |change: &Change| (change.guess.early[channel] - from.early[channel]).abs();
    alike.sort_by(|a, b| moved(a).cmp(&moved(b)).then(a.left.total_cmp(&b.left)));
    let first = *alike.first()?;
    // Among starts that a narrow band does not resolve the best one counts.
    let is_same = |other: &Change| {
        let apart = other.guess.early[channel] - first.guess.early[channel];
        apart.abs() <= NEIGHBOURS && other.guess.signs == first.guess.signs
    };
    let is_far = |other: &Change| moved(other) >= DISTINCT * moved(first).max(1);
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
    let least = peaks.first().map_or(0.0, |(height, _)| LIKELY * height);
    let likely = peaks.iter().take_while(|(height, _)| *height >= least);
    let nearest = likely.min_by_key(|(_, lag)| lag.abs()).copied();
    peaks.into_iter().take(2).chain(nearest).collect()
}

/// Deviations from the mean, followed by zeros.
fn padded(samples: &[f64], size: usize) -> Vec<f64> {
    let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
    let mut padded: Vec<f64> = samples.iter().map(|x| x - mean).collect();
    padded.resize(size, 0.0);
    padded
}

/// The largest length up to `length` whose transform is fast: few bits times a power of two.
fn smooth(length: usize) -> usize {
    let step = 1 << length.max(1).ilog2().saturating_sub(6);
    length / step * step
}
