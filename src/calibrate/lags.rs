//! The lag between two recordings of one event, whatever the signal is and however far apart they began.
//!
//! *Probes*, the loudest stretches of one recording, are correlated with all of the other one, block by
//! block. A clock that runs fast moves the lag along the recording, so each probe has a lag of its own.
//! Those on one line are the lag and its drift.

use super::record::Record;
use crate::linalg::{Complex, fourier};
use crate::simulate::{Instants, Periodic};
use crate::sine_fit::Channel;
use crate::units::FastPeriods;
use std::f64::consts::TAU;
use std::ops::Range;

/// Samples of the longest probes: at 100 ppm the lag moves by three samples within one, and the peak of the
/// correlation is as much lower. Shorter ones find less in noise, but bear 2000 ppm: both are tried.
const LONGEST_PROBES: [usize; 2] = [1 << 15, 1 << 11];
/// A probe is this share of a recording, so that a quarter of it holds one, but no shorter than this.
const PROBE_SHARE: usize = 12;
const SHORTEST_PROBE: usize = 512;
/// Most probes of a recording.
const MOST_PROBES: usize = 8;
/// Length of a transform in probes: longer ones take less work per sample and more memory.
const PROBES_PER_BLOCK: usize = 4;
/// Peaks that are kept of each probe.
const PEAKS: usize = 4;
/// Lags this near to each other, in samples, are one: a narrow band or a drift within the probe blurs them.
const NEIGHBOURS: f64 = 16.0;
/// Largest difference of two clocks. Crystals differ by up to 200 ppm, oscillators without one by 2000.
const MOST_DRIFT: f64 = 2.2e-3;
/// Log-odds against chance from which on lags count as found.
const LEAST_ODDS: f64 = 30.0;
/// With less the lags of other probes, which samples that are lost explain, are to be less likely: the best
/// of many lines has high odds by chance.
const CERTAIN_ODDS: f64 = 120.0;
/// One probe of so many is asked first. If all of these are on one line the others are not asked.
const FIRST_OF: usize = 3;
/// With more neither the other probes nor the shorter ones are asked.
const BEYOND_DOUBT: f64 = 1000.0;
/// Other lags with this share of the log-odds of the best ones explain the recordings as well: voices that
/// say different things correlate far beyond chance, but at many lags.
const ALIKE_ODDS_SHARE: f64 = 0.5;
/// Up to so many samples from the best lag it takes this share: a voice agrees with itself a pitch period
/// later, but less well, and a tone nearly as well.
const PITCH_SAMPLES: f64 = 1024.0;
const ALIKE_WITHIN_PITCH: f64 = 0.9;
/// Share of the largest possible correlation from which on recordings have something in common: different
/// voices have 0.2, tones and loops 0.4.
const IN_COMMON: f64 = 0.3;

/// Samples on each side of the expected lag among which another one is looked for.
const FARTHEST_STEP: usize = 1 << 20;

/// Samples on each side of those between which a recording is interpolated.
const INTERPOLATION_MARGIN: usize = 32;

/// A stretch of a recording that is looked for in another one.
struct Probe {
    /// Its number among all.
    number: usize,
    /// Number of its first sample.
    first: usize,
    /// Its deviations from their mean; 0 where samples are left out.
    samples: Vec<f64>,
}

/// The loudest stretch of each part of a recording that is not zero. Parts are so long that each holds one
/// that begins at a multiple of half its length.
fn probes(record: &Record, longest: usize) -> Vec<Probe> {
    let count = record.samples.len();
    let length = 1 << (count / PROBE_SHARE).clamp(SHORTEST_PROBE.min(count / 2).max(1), longest).ilog2();
    let parts = (2 * count / (3 * length)).clamp(1, MOST_PROBES);
    let part = count / parts;
    let loudest = |number: usize| {
        let firsts =
            (number * part..=((number + 1) * part).saturating_sub(length)).step_by(length.div_ceil(2));
        let probes =
            firsts.map(|first| Probe { number, first, samples: stretch(record, first as i64, length) });
        probes.max_by(|a, b| a.energy().total_cmp(&b.energy())).filter(|probe| probe.energy() > 0.0)
    };
    (0..parts).filter_map(loudest).collect()
}

impl Probe {
    fn energy(&self) -> f64 {
        self.samples.iter().map(|x| x * x).sum()
    }
}

/// The deviations of `length` samples from sample `first` on from their mean; 0 where samples are left out
/// or there are none.
pub(crate) fn stretch(record: &Record, first: i64, length: usize) -> Vec<f64> {
    let inside = |sample: i64| sample.clamp(0, record.samples.len() as i64) as usize;
    let (from, to) = (inside(first), inside(first + length as i64));
    let channel = Channel { keep: Some(&record.keep[from..to]), ..Channel::new(&record.samples[from..to]) };
    let mut stretch = vec![0.0; length.min((from as i64 - first) as usize)];
    stretch.extend(channel.deviations());
    stretch.resize(length, 0.0);
    stretch
}

/// `length` samples from sample `first` on, as a clock takes them that runs as that of the reference does
/// and agrees with it in their middle, where the lag grows by `rate`.
pub(crate) fn steadied(record: &Record, first: usize, length: usize, rate: f64) -> Record {
    let mut part = record.part(first..first + length);
    if rate == 0.0 {
        return part;
    }
    let around =
        stretch(record, first as i64 - INTERPOLATION_MARGIN as i64, length + 2 * INTERPOLATION_MARGIN);
    let begin = INTERPOLATION_MARGIN as f64 - 0.5 * rate * (length as f64 - 1.0);
    let instants = Instants { first: FastPeriods(begin), step: FastPeriods(1.0 + rate), count: length };
    let steady = Periodic::new(&around, FastPeriods(1.0)).sample_through(|_| Complex::ONE, instants);
    for ((sample, steady), own) in part.samples.iter_mut().zip(steady).zip(&around[INTERPOLATION_MARGIN..]) {
        *sample += steady - own;
    }
    part
}

/// The deviations of a record from its mean at these instants, in its samples.
pub(crate) fn interpolated(record: &Record, instants: Instants) -> Vec<f64> {
    let begin = instants.first.0.floor() as i64 - INTERPOLATION_MARGIN as i64;
    let length = (instants.step.0 * instants.count as f64) as usize + 2 * INTERPOLATION_MARGIN + 1;
    let around = stretch(record, begin, length);
    let first = FastPeriods(instants.first.0 - begin as f64);
    Periodic::new(&around, FastPeriods(1.0)).sample_through(|_| Complex::ONE, Instants { first, ..instants })
}

/// The correlations of a stretch of `size` samples with a shorter one: at index l that of its samples from l
/// on, with the sign of the correlation, as shares of the largest one that is possible.
pub(crate) struct Correlation {
    /// Of the shorter one, under the window of Hann: the leakage of strong lines would be whitened with
    /// them.
    spectrum: Vec<Complex<f64>>,
    size: usize,
}

impl Correlation {
    pub(crate) fn with(shorter: &[f64], size: usize) -> Self {
        let step = TAU / shorter.len().max(1) as f64;
        let hann = |(k, x): (usize, &f64)| x * (0.5 - 0.5 * (step * (k as f64 + 0.5)).cos());
        let mut padded: Vec<f64> = shorter.iter().enumerate().map(hann).collect();
        padded.resize(size, 0.0);
        Self { spectrum: fourier::real_spectrum(&padded), size }
    }

    /// With the stretch of this spectrum.
    pub(crate) fn of(&self, spectrum: &[Complex<f64>]) -> Vec<f64> {
        let cross = fourier::half_whitened(spectrum, &self.spectrum);
        let most = 2.0 * cross.iter().map(|bin| bin.norm_sqr().sqrt()).sum::<f64>();
        let mut sums = fourier::real_sequence(&cross, self.size);
        sums.iter_mut().for_each(|x| *x = if most > 0.0 { *x / most } else { 0.0 });
        sums
    }
}

/// The largest correlations of a probe.
#[derive(Default)]
struct Peaks {
    largest: Vec<CorrelationPeak>,
    squares: f64,
    count: usize,
}

#[derive(Clone, Copy)]
struct CorrelationPeak {
    lag: i64,
    /// Share of the largest correlation that is possible.
    height: f64,
}

/// A lag that a probe may have.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lag {
    /// Sample of the reference at which it is.
    at: f64,
    /// Samples by which the other recording comes later.
    lag: f64,
    /// Correlation over that of chance.
    sigmas: f64,
    /// Correlation over the largest possible one.
    height: f64,
    /// Number of the probe, and of lags that were looked at.
    probe: usize,
    looked_at: usize,
}

/// The likely lags of the probes of one recording in another one, `record`, `within` so many samples.
fn lags(probes: &[&Probe], record: &Record, within: f64) -> Vec<Lag> {
    let Some(length) = probes.first().map(|probe| probe.samples.len()) else { return Vec::new() };
    let size = PROBES_PER_BLOCK * length;
    let with = |probe: &&Probe| (Correlation::with(&probe.samples, size), Peaks::default());
    let mut all: Vec<(Correlation, Peaks)> = probes.iter().map(with).collect();
    // A probe may reach beyond both ends of the recording.
    for first in (-(length as i64)..record.samples.len() as i64).step_by(size - length) {
        let spectrum = fourier::real_spectrum(&stretch(record, first, size));
        for (probe, (correlation, peaks)) in probes.iter().zip(&mut all) {
            let heights = correlation.of(&spectrum);
            peaks.take(&heights, first - probe.first as i64, size - length, within);
        }
    }
    let of = |(probe, (_, peaks)): (&&Probe, &(_, Peaks))| {
        peaks.lags(probe.number, probe.first as f64 + 0.5 * length as f64)
    };
    probes.iter().zip(&all).flat_map(of).collect()
}

impl Peaks {
    /// Takes the first `count` correlations of a block, whose first one has the lag `offset`.
    fn take(&mut self, heights: &[f64], offset: i64, count: usize, within: f64) {
        let at = |l: usize| heights[l].abs();
        for l in 0..count {
            let (lag, height) = (offset + l as i64, at(l));
            if (lag as f64).abs() > within {
                continue;
            }
            self.squares += height * height;
            self.count += usize::from(height > 0.0);
            let beside = [l.checked_sub(1).unwrap_or(heights.len() - 1), l + 1];
            if beside.into_iter().all(|l| height >= at(l)) {
                self.offer(CorrelationPeak { lag, height });
            }
        }
    }

    fn offer(&mut self, peak: CorrelationPeak) {
        // Nearly all are lower than those that are kept.
        if self.largest.get(PEAKS - 1).is_some_and(|least| least.height >= peak.height) {
            return;
        }
        let is_near = |other: &CorrelationPeak| ((other.lag - peak.lag) as f64).abs() <= NEIGHBOURS;
        if self.largest.iter().any(|other| is_near(other) && other.height >= peak.height) {
            return;
        }
        self.largest.retain(|other| !is_near(other));
        self.largest.push(peak);
        self.largest.sort_by(|a, b| b.height.total_cmp(&a.height));
        self.largest.truncate(PEAKS);
    }

    /// Those of probe `number` at a sample.
    fn lags(&self, number: usize, at: f64) -> Vec<Lag> {
        let chance = (self.squares / self.count.max(1) as f64).sqrt();
        let lag = |&CorrelationPeak { lag, height }: &CorrelationPeak| Lag {
            at,
            lag: lag as f64,
            sigmas: height / chance,
            height,
            probe: number,
            looked_at: self.count,
        };
        self.largest.iter().filter(|peak| peak.height > 0.0).map(lag).collect()
    }
}

impl Lag {
    /// The same seen from the other recording: its samples are `at`, and the reference comes later.
    fn reversed(self) -> Self {
        Self { at: self.at + self.lag, lag: -self.lag, ..self }
    }
}

/// How a lag changes along the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LagLine {
    /// Sample of the reference at which the lag is `lag`.
    at: f64,
    lag: f64,
    /// Samples per sample.
    rate: f64,
    /// Standard error of the rate, or what it may be at most where one probe alone was found.
    rate_error: f64,
}

impl LagLine {
    /// The line parallel to this one on which some samples of the reference lie in `other`, if one lag
    /// stands out.
    pub(crate) fn parallel(&self, reference: &Record, other: &Record, samples: Range<usize>) -> Option<Self> {
        let (first, length) = (samples.start, samples.len());
        let expected = first as i64 + self.lag_at(first as f64).round() as i64;
        let inside = |sample: i64| sample.clamp(0, other.samples.len() as i64) as usize;
        let farthest = FARTHEST_STEP as i64;
        let near = inside(expected - farthest)..inside(expected + farthest + length as i64);
        let begin = near.start;
        let probe = Probe { number: 0, first, samples: stretch(reference, first as i64, length) };
        let mut found = lags(&[&probe], &other.part(near), f64::INFINITY);
        found.sort_by(|a, b| b.height.total_cmp(&a.height));
        let best = found.first().filter(|best| odds(&[**best]) >= LEAST_ODDS)?;
        let is_alike = |other: &&Lag| other.height >= ALIKE_WITHIN_PITCH * best.height;
        let line = Self { at: best.at, lag: best.lag + begin as f64, ..*self };
        (found.iter().filter(is_alike).count() == 1).then_some(line)
    }

    /// The lag at a sample of the reference.
    pub(crate) fn lag_at(&self, sample: f64) -> f64 {
        self.lag + self.rate * (sample - self.at)
    }

    fn holds(&self, lag: &Lag) -> bool {
        (lag.lag - self.lag_at(lag.at)).abs() <= NEIGHBOURS
    }

    /// Samples by which the lag may differ from the line between two samples of the reference.
    pub(crate) fn error(&self, first: f64, end: f64) -> f64 {
        NEIGHBOURS + self.rate_error * (self.at - first).abs().max((end - self.at).abs())
    }
}

/// How much later `other` comes than `reference`, `within` so many samples. Probes of the shorter recording
/// are looked for in the longer one: they are all there if it is a part.
///
/// # Errors
/// The lags, in samples, that explain the recordings alike; none if no lag stands out.
pub(crate) fn line(reference: &Record, other: &Record, within: f64) -> Result<LagLine, Vec<i64>> {
    let is_shorter = reference.samples.len() <= other.samples.len();
    let (shorter, longer) = if is_shorter { (reference, other) } else { (other, reference) };
    let best = |lags: &[Lag]| lines(lags).first().map_or(0.0, |(odds, _)| *odds);
    let are_on_one = |lags: &[Lag], probes: usize| {
        let is_likely =
            |(odds, line): &(f64, LagLine)| *odds >= BEYOND_DOUBT && on(line, lags).len() == probes;
        probes > 1 && lines(lags).first().is_some_and(is_likely) && likeliest(lags).is_ok()
    };
    let found = |longest: usize| -> Vec<Lag> {
        let probes = probes(shorter, longest);
        let (first, others): (Vec<&Probe>, Vec<&Probe>) =
            probes.iter().partition(|probe| probe.number.is_multiple_of(FIRST_OF));
        let of = |probes: &[&Probe]| -> Vec<Lag> {
            let lags = lags(probes, longer, within);
            if is_shorter { lags } else { lags.into_iter().map(Lag::reversed).collect() }
        };
        let mut found = of(&first);
        if !are_on_one(&found, first.len()) {
            found.extend(of(&others));
        }
        found
    };
    let long = found(LONGEST_PROBES[0]);
    if let (Ok(line), true) = (likeliest(&long), best(&long) >= BEYOND_DOUBT) {
        return Ok(line);
    }
    let short = found(LONGEST_PROBES[1]);
    let [first, second] = if best(&long) >= best(&short) { [&long, &short] } else { [&short, &long] };
    // Claps are alike to short probes, and apart to longer ones.
    likeliest(first).or_else(|alike| likeliest(second).map_err(|_| alike))
}

/// The line on which most of the likely lags lie.
fn likeliest(lags: &[Lag]) -> Result<LagLine, Vec<i64>> {
    let Some(&(best, line)) = lines(lags).first() else { return Err(Vec::new()) };
    // Where samples were lost other probes have other lags: a lag is in doubt where its own probes have
    // more.
    let own = on(&line, lags);
    let beyond = |lag: &Lag| lag.lag - line.lag_at(lag.at);
    let is_rival = |lag: &Lag, own: &Lag| {
        let share = if beyond(lag).abs() <= PITCH_SAMPLES { ALIKE_WITHIN_PITCH } else { ALIKE_ODDS_SHARE };
        lag.probe == own.probe && !line.holds(lag) && lag.sigmas.powi(2) >= share * own.sigmas.powi(2)
    };
    let in_doubt = own.iter().filter(|own| lags.iter().any(|lag| is_rival(lag, own))).count();
    let others: Vec<Lag> = lags.iter().filter(|lag| !line.holds(lag)).copied().collect();
    let is_likely = |(odds, _): &(f64, LagLine)| *odds >= ALIKE_ODDS_SHARE * best;
    let is_chance = best < CERTAIN_ODDS && lines(&others).first().is_some_and(is_likely);
    // Sounds that are alike, as claps are, have other lags for each probe, but share one.
    let is_beside = |other: &LagLine| {
        let apart = (other.lag_at(line.at) - line.lag).abs();
        let share = if apart <= PITCH_SAMPLES { ALIKE_WITHIN_PITCH } else { ALIKE_ODDS_SHARE };
        (apart > 2.0 * NEIGHBOURS).then_some(share)
    };
    let is_alike =
        |(odds, other): &(f64, LagLine)| is_beside(other).is_some_and(|share| *odds >= share * best);
    let stands_out = !lines(&others).iter().any(is_alike);
    if best >= LEAST_ODDS && (stands_out || !is_chance && 2 * in_doubt < own.len()) {
        return Ok(fitted(&own));
    }
    let mut alike = vec![line.lag];
    for rival in lags.iter().filter(|lag| own.iter().any(|own| is_rival(lag, own))) {
        let lag = line.lag + beyond(rival);
        if alike.iter().all(|known| (known - lag).abs() > 2.0 * NEIGHBOURS) {
            alike.push(lag);
        }
    }
    // A signal that repeats correlates with itself at many lags, none of which stands out.
    let highest = lags.iter().map(|lag| lag.height).fold(0.0, f64::max);
    let named = if highest < IN_COMMON { 0 } else { PEAKS };
    Err(alike.iter().take(named).map(|lag| lag.round() as i64).collect())
}

/// The lines through one lag or two, the likeliest first, with their log-odds.
fn lines(lags: &[Lag]) -> Vec<(f64, LagLine)> {
    let through = |a: &Lag, rate: f64| LagLine { at: a.at, lag: a.lag, rate, rate_error: MOST_DRIFT };
    let pairs = lags.iter().flat_map(|a| lags.iter().map(move |b| (a, b)));
    let sloped = pairs.filter(|(a, b)| b.at > a.at).filter_map(|(a, b)| {
        let rate = (b.lag - a.lag) / (b.at - a.at);
        (rate.abs() <= MOST_DRIFT).then(|| through(a, rate))
    });
    let level = lags.iter().map(|a| through(a, 0.0));
    let mut lines: Vec<(f64, LagLine)> =
        level.chain(sloped).map(|line| (odds(&on(&line, lags)), line)).collect();
    lines.sort_by(|a, b| b.0.total_cmp(&a.0));
    lines
}

/// The most likely lag of each probe that lies on a line.
fn on(line: &LagLine, lags: &[Lag]) -> Vec<Lag> {
    let mut near: Vec<Lag> = Vec::new();
    for lag in lags.iter().filter(|lag| line.holds(lag)) {
        match near.iter_mut().find(|other| other.probe == lag.probe) {
            Some(other) if other.sigmas < lag.sigmas => *other = *lag,
            Some(_) => {}
            None => near.push(*lag),
        }
    }
    near
}

/// The logarithm of the odds that lags on one line are none of chance: of Gaussian correlations the first
/// one might have been anywhere, the second within the drifts that clocks have, the others near the line.
fn odds(lags: &[Lag]) -> f64 {
    let choices = |(number, lag): (usize, &Lag)| match number {
        0 => lag.looked_at as f64,
        1 => (2.0 * MOST_DRIFT * (lag.at - lags[0].at).abs() + 2.0 * NEIGHBOURS).min(lag.looked_at as f64),
        _ => 2.0 * NEIGHBOURS,
    };
    let odds = |(number, lag): (usize, &Lag)| {
        0.5 * lag.sigmas * lag.sigmas - choices((number, lag)).max(1.0).ln() - (PEAKS as f64).ln()
    };
    lags.iter().enumerate().map(odds).sum()
}

/// The straight line of least squares.
fn fitted(lags: &[Lag]) -> LagLine {
    let count = lags.len().max(1) as f64;
    let mean = |of: fn(&Lag) -> f64| lags.iter().map(of).sum::<f64>() / count;
    let (at, lag) = (mean(|lag| lag.at), mean(|lag| lag.lag));
    let squares: f64 = lags.iter().map(|one| (one.at - at).powi(2)).sum();
    if squares == 0.0 {
        return LagLine { at, lag, rate: 0.0, rate_error: MOST_DRIFT };
    }
    let rate = lags.iter().map(|one| (one.at - at) * (one.lag - lag)).sum::<f64>() / squares;
    LagLine { at, lag, rate, rate_error: (NEIGHBOURS / squares.sqrt()).min(MOST_DRIFT) }
}

#[cfg(test)]
mod tests;
