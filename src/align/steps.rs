//! Places where a recording lacks samples, or has some that the reference has not.
//!
//! The lags of a recording are a line with steps of whole samples. Each step is put where the samples before
//! it fit the reference best at the one lag, and those after it at the other.

use super::clock::{ClockCourse, ClockStep};
use super::path::{Disagree, KnownLag, Path, PathSearch};
use crate::calibrate::{LagLine, Record, interpolated, stretch};
use crate::sampling::median;
use crate::simulate::Instants;
use crate::units::FastPeriods;

/// Pieces on each side of a step whose median is the lag there.
const BESIDE: usize = 4;
/// By how much a rate may wander while a recording is near zero: 5 ppm.
const RATE_WANDERS: f64 = 5e-6;
/// Samples on each side of the two pieces beside a step that say how well the lags fit.
const SURE: f64 = 1024.0;
/// A place of a step is possible if its log-odds against the best one are no worse: much, because errors are
/// correlated where front ends differ.
const PLACE_ODDS: f64 = 20.0;

/// A recording whose steps are mended.
pub(super) struct Mended {
    /// Lost samples are NaN.
    pub(super) record: Record,
    pub(super) steps: Vec<ClockStep>,
    pub(super) lags: Lags,
}

/// The lags of a recording whose steps are mended, over the samples of the reference.
#[derive(Debug, Clone)]
pub(super) struct Lags {
    /// At least two.
    known: Vec<KnownLag>,
    /// By how much they grow per sample: the slope of the line of least squares.
    pub(super) rate: f64,
    /// -1 for the opposite polarity.
    pub(super) sign: f64,
    /// Whether the lags are so exact that those in a row say by how much they grow there.
    is_exact: bool,
}

/// By how much lags grow per sample around one.
struct Slope {
    at: f64,
    rate: f64,
}

impl Lags {
    fn new(path: Path, jumps: &[Jump]) -> Self {
        let lost =
            |at: f64| jumps.iter().filter(|jump| jump.after.at <= at).map(|jump| jump.lost).sum::<i64>();
        let whole = |known: &KnownLag| KnownLag { lag: known.lag + lost(known.at) as f64, ..*known };
        let known: Vec<KnownLag> = path.known.iter().map(whole).collect();
        let mean = |of: fn(&KnownLag) -> f64| known.iter().map(of).sum::<f64>() / known.len() as f64;
        let (at, lag) = (mean(|known| known.at), mean(|known| known.lag));
        let squares: f64 = known.iter().map(|known| (known.at - at).powi(2)).sum();
        let rate = known.iter().map(|known| (known.at - at) * (known.lag - lag)).sum::<f64>() / squares;
        Self { known, rate, sign: path.sign, is_exact: false }
    }

    /// Of the reference itself.
    pub(super) fn none() -> Self {
        Self {
            known: [0.0, 1.0].map(|at| KnownLag { at, lag: 0.0 }).to_vec(),
            rate: 0.0,
            sign: 1.0,
            is_exact: false,
        }
    }

    /// Those of the same recording by its clock, known at instants of the reference.
    pub(super) fn by(&self, clock: &ClockCourse, instants: impl Iterator<Item = f64>) -> Self {
        let known = instants.map(|at| KnownLag { at, lag: clock.sample_at(at) - at }).collect();
        Self { known, is_exact: true, ..*self }
    }

    /// By how much the lag grows per sample around a sample of the reference.
    pub(super) fn rate_at(&self, sample: f64) -> f64 {
        if self.is_exact { self.slope(self.segment(sample)).rate } else { self.rate }
    }

    /// What the mean of the lags over so many samples is above the one in their middle: the lags bend.
    pub(super) fn bend_over(&self, sample: f64, length: f64) -> f64 {
        let segment = self.segment(sample);
        let (first, last) = (segment.max(2) - 1, (segment + 1).min(self.known.len() - 1));
        if !self.is_exact || first == last {
            return 0.0;
        }
        let (before, after) = (self.slope(first), self.slope(last));
        (after.rate - before.rate) / (after.at - before.at) * length * length / 24.0
    }

    /// The later one of the two known lags between which a sample lies.
    fn segment(&self, sample: f64) -> usize {
        self.known.partition_point(|known| known.at <= sample).clamp(1, self.known.len() - 1)
    }

    fn slope(&self, segment: usize) -> Slope {
        let (a, b) = (self.known[segment - 1], self.known[segment]);
        Slope { at: 0.5 * (a.at + b.at), rate: (b.lag - a.lag) / (b.at - a.at) }
    }

    /// The lag at a sample of the reference: on the line between two pieces, and on that of all beyond them.
    pub(super) fn at(&self, sample: f64) -> f64 {
        let right = self.known.partition_point(|known| known.at <= sample);
        let (left, right) = (self.known.get(right.wrapping_sub(1)), self.known.get(right));
        match (left, right) {
            (Some(a), Some(b)) => a.lag + (b.lag - a.lag) * (sample - a.at) / (b.at - a.at),
            (Some(known), None) | (None, Some(known)) => known.lag + self.rate * (sample - known.at),
            (None, None) => 0.0,
        }
    }
}

/// The lags before a step and after it.
struct Jump {
    before: KnownLag,
    after: KnownLag,
    lost: i64,
}

/// Finds the steps of a recording that lies near a line.
pub(super) fn mended(reference: &Record, other: &Record, line: LagLine) -> Result<Mended, Disagree> {
    let path = PathSearch::new(reference, other, line).known()?;
    let jumps = jumps(&path);
    let mut steps: Vec<ClockStep> = Vec::new();
    for jump in &jumps {
        let begin = steps.last().map_or(0, |step| step.samples.end);
        steps.push(place(reference, other, jump, path.rate, begin));
    }
    let record = Record {
        samples: spliced(&other.samples, &steps, f64::NAN),
        imaginary: None,
        keep: spliced(&other.keep, &steps, false),
        clipped: other.clipped,
    };
    Ok(Mended { record, steps, lags: Lags::new(path, &jumps) })
}

/// The samples of a recording without its steps: a filler takes the place of those that are lost, or that
/// belong to neither side of a step.
pub(super) fn spliced<T: Copy>(samples: &[T], steps: &[ClockStep], filler: T) -> Vec<T> {
    let (mut whole, mut begin) = (Vec::with_capacity(samples.len()), 0);
    for ClockStep { samples: at, lost } in steps {
        whole.extend_from_slice(&samples[begin..at.start]);
        let missing = at.len() as i64 + lost;
        whole.resize(whole.len() + missing.max(0) as usize, filler);
        begin = at.end;
    }
    whole.extend_from_slice(&samples[begin..]);
    whole
}

/// Where lags of pieces in a row differ by more than clocks do.
fn jumps(path: &Path) -> Vec<Jump> {
    let Path { known, rate, near, .. } = path;
    let beyond: Vec<f64> = known.iter().map(|known| known.lag - rate * known.at).collect();
    let is_jump = |k: &usize| {
        let apart = known[*k].at - known[k - 1].at;
        (beyond[*k] - beyond[k - 1]).abs() > 2.0 * near + RATE_WANDERS * apart
    };
    let mut cuts = vec![0];
    cuts.extend((1..known.len()).filter(is_jump));
    cuts.push(known.len());
    let near = |pieces: &[f64], at: f64| KnownLag { at, lag: median(pieces.to_vec()) + rate * at };
    let jump = |cuts: &[usize]| {
        let (left, right) = (&beyond[cuts[0]..cuts[1]], &beyond[cuts[1]..cuts[2]]);
        let before = near(&left[left.len().saturating_sub(BESIDE)..], known[cuts[1] - 1].at);
        let after = near(&right[..right.len().min(BESIDE)], known[cuts[1]].at);
        let grown = after.lag - before.lag - rate * (after.at - before.at);
        Jump { before, after, lost: -(grown.round() as i64) }
    };
    cuts.windows(3).map(jump).filter(|jump| jump.lost != 0).collect()
}

/// A jump with its place: from sample `begin` of the recording on, the first sample after those of the one
/// lag, such that the errors of all samples by their own lags are least.
fn place(reference: &Record, other: &Record, jump: &Jump, rate: f64, begin: usize) -> ClockStep {
    let Jump { before, after, lost } = jump;
    let last = other.samples.len();
    let first = ((before.at + before.lag - SURE).max(0.0) as usize).max(begin).min(last);
    let end = ((after.at + after.lag + SURE) as usize).clamp(first, last);
    let surplus = ((-lost).max(0) as usize).min(end - first);
    let own = stretch(other, first as i64, end - first);
    let [early, late] = [before, after].map(|known| {
        let instant = known.at + (first as f64 - known.at - known.lag) / (1.0 + rate);
        let step = FastPeriods(1.0 / (1.0 + rate));
        interpolated(reference, Instants { first: FastPeriods(instant), step, count: own.len() })
    });
    let sure = (SURE as usize).min(own.len());
    let products = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (start, rest) = (&early[..sure], &late[own.len() - sure..]);
    let gain = (products(start, &own) + products(rest, &own[own.len() - sure..]))
        / (products(start, start) + products(rest, rest));
    let errors = |expected: Vec<f64>| -> Vec<f64> {
        let kept = other.keep[first..end].iter().map(|keep| f64::from(*keep));
        own.iter().zip(expected).zip(kept).map(|((x, y), keep)| keep * (x - gain * y).powi(2)).collect()
    };
    let costs = costs(&errors(early), &errors(late), surplus);
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let variance = least / costs.len().max(1) as f64;
    let possible = |cost: &f64| *cost <= least + 2.0 * PLACE_ODDS * variance;
    let from = costs.iter().position(possible).unwrap_or(0);
    let to = costs.iter().rposition(possible).unwrap_or(0);
    ClockStep { samples: first + from..(first + to + surplus).min(last), lost: *lost }
}

/// The sum of the errors for each number of samples before a step, after which so many belong to neither
/// side.
fn costs(early: &[f64], late: &[f64], surplus: usize) -> Vec<f64> {
    let mut cost: f64 = late.iter().skip(surplus).sum();
    let mut costs = vec![cost];
    for (early, late) in early.iter().zip(late.iter().skip(surplus)) {
        cost += early - late;
        costs.push(cost);
    }
    costs
}
