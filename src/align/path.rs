//! Where a recording lies beside the reference, piece by piece, whatever was lost between.
//!
//! The reference is cut into short pieces, and each is looked for along lines of lags. The path through the
//! pieces that takes the likeliest line in each, and seldom changes it, is where the recording lies. Where
//! pieces are on no line, one of them is looked for in a wide stretch of the recording, which gives another
//! line.

use super::local::{LocalLag, SearchWindow};
use crate::calibrate::{LagLine, Record};
use crate::sampling::{median, usual_deviation};
use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

/// Samples of a piece: at 2000 ppm the lag moves by four samples within it.
const LONGEST_PIECE: usize = 2048;
const SHORTEST_PIECE: usize = 256;
/// Number of pieces, where the length allows for it.
const LEAST_PIECES: usize = 16;
const MOST_PIECES: usize = 8192;
/// Most lines, and most pieces that are looked for without success: where one recording is near zero or has
/// ended.
const MOST_LINES: usize = 32;
const MOST_IN_VAIN: usize = 16;
/// Pieces of a stretch that is looked for.
const PROBE_PIECES: usize = 4;
/// Log-odds from which on a piece is on a line: of ten thousand lags one is there by chance.
const ON_LINE_ODDS: f64 = 10.0;
/// A piece counts at most so much, so that one alone does not pay for a line of its own.
const MOST_ODDS: f64 = 50.0;
const CHANGE_ODDS: f64 = 30.0;
/// Pieces on each side whose median a piece is to agree with.
const BESIDE: usize = 3;
/// Samples by which it may differ: so many standard deviations, but no less and no more than these.
const NEAR_SIGMAS: f64 = 6.0;
const LEAST_NEAR: f64 = 0.3;
const MOST_NEAR: f64 = 1.5;

/// Share of the pieces that agree, at least.
const LEAST_SHARE: f64 = 0.5;
/// Pieces between those whose lags give the rate: many of all would have steps between them.
const RATE_PIECES: usize = 16;
const PIECES_PER_RATE: usize = 64;

/// A piece whose lag is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownLag {
    /// Sample of the reference in its middle.
    pub(super) at: f64,
    pub(super) lag: f64,
}

/// The pieces whose lags are known, and how those grow per sample.
pub(super) struct Path {
    pub(super) known: Vec<KnownLag>,
    pub(super) rate: f64,
    /// By how many samples lags of pieces in a row differ at most.
    pub(super) near: f64,
    /// -1 for the opposite polarity.
    pub(super) sign: f64,
}

/// Most pieces agree with no line, or not with those beside them.
pub(super) struct Disagree {
    pub(super) agreeing: usize,
    pub(super) pieces: usize,
}

/// The pieces of the reference on all lines.
pub(super) struct PathSearch<'a> {
    reference: &'a Record,
    other: &'a Record,
    length: usize,
    firsts: Vec<usize>,
    /// Their rms.
    levels: Vec<f64>,
    lines: Vec<LagLine>,
    /// Of each line those of all pieces; none where the recording is not there.
    lags: Vec<Vec<Option<LocalLag>>>,
}

impl<'a> PathSearch<'a> {
    /// Of a recording that lies near a line, where samples are whole, and near others parallel to it.
    pub(super) fn new(reference: &'a Record, other: &'a Record, line: LagLine) -> Self {
        let frames = reference.samples.len();
        let most = (frames / LEAST_PIECES).clamp(SHORTEST_PIECE, LONGEST_PIECE);
        let length = 1 << most.ilog2();
        let hop = length.max(frames / MOST_PIECES);
        let firsts: Vec<usize> = (0..=frames.saturating_sub(length)).step_by(hop).collect();
        let level = |first: &usize| reference.part(*first..first + length).rms();
        let (levels, lines, lags) = (firsts.iter().map(level).collect(), Vec::new(), Vec::new());
        let mut search = Self { reference, other, length, firsts, levels, lines, lags };
        search.add(line);
        search.look();
        search
    }

    fn centre(&self, piece: usize) -> f64 {
        self.firsts[piece] as f64 + 0.5 * (self.length as f64 - 1.0)
    }

    fn add(&mut self, line: LagLine) {
        let margin = line.error(0.0, self.reference.samples.len() as f64).ceil() as usize;
        let last = self.other.samples.len() as f64;
        let lag = |piece: usize| {
            let (first, length, expected) =
                (self.firsts[piece], self.length, line.lag_at(self.centre(piece)));
            let is_there = (0.0..last).contains(&(self.centre(piece) + expected));
            let place = SearchWindow { first, length, expected, margin };
            is_there.then(|| LocalLag::new(self.reference, self.other, place))
        };
        let lags = (0..self.firsts.len()).map(lag).collect();
        self.lags.push(lags);
        self.lines.push(line);
    }

    /// Adds the lines of the pieces that are on none.
    fn look(&mut self) {
        let (mut looked_at, mut in_vain) = (vec![false; self.firsts.len()], 0);
        while self.lines.len() < MOST_LINES && in_vain < MOST_IN_VAIN {
            let path = self.path();
            let is_lost = |piece: usize| {
                let lag = &self.lags[path[piece]][piece];
                !looked_at[piece] && lag.as_ref().is_none_or(|lag| lag.odds < ON_LINE_ODDS)
            };
            let runs = runs((0..path.len()).map(is_lost)).into_iter().filter(|run| run.len() > 1);
            let level = |run: &Range<usize>| self.levels[run.clone()].iter().sum::<f64>();
            let Some(run) = runs.max_by(|a, b| level(a).total_cmp(&level(b))) else { break };
            let pieces = run.len().min(PROBE_PIECES);
            let begin = run.start + (run.len() - pieces) / 2;
            looked_at[begin..begin + pieces].fill(true);
            let line = self.lines[path[begin]];
            let samples = self.firsts[begin]..self.firsts[begin] + pieces * self.length;
            match line.parallel(self.reference, self.other, samples) {
                Some(line) => self.add(line),
                None => in_vain += 1,
            }
        }
    }

    /// The line of each piece, such that all together are the likeliest (Viterbi's algorithm).
    fn path(&self) -> Vec<usize> {
        let mut odds: Vec<f64> = vec![0.0; self.lines.len()];
        let mut from = Vec::new();
        for piece in 0..self.firsts.len() {
            let best = (0..odds.len()).max_by(|a, b| odds[*a].total_cmp(&odds[*b])).unwrap_or(0);
            let changed: f64 = odds[best] - CHANGE_ODDS;
            from.push(
                odds.iter()
                    .enumerate()
                    .map(|(line, odds)| if *odds < changed { best } else { line })
                    .collect::<Vec<_>>(),
            );
            for (odds, lags) in odds.iter_mut().zip(&self.lags) {
                *odds = odds.max(changed) + lags[piece].as_ref().map_or(0.0, |lag| lag.odds.min(MOST_ODDS));
            }
        }
        let mut line = (0..odds.len()).max_by(|a, b| odds[*a].total_cmp(&odds[*b])).unwrap_or(0);
        let mut path: Vec<usize> = Vec::new();
        for from in from.iter().rev() {
            path.push(line);
            line = from[line];
        }
        path.reverse();
        path
    }

    /// The pieces whose lags are known and agree with those beside them.
    ///
    /// # Errors
    /// [`Disagree`] if they are less than half of those that are there, each by its level.
    pub(super) fn known(&self) -> Result<Path, Disagree> {
        let path = self.path();
        let lag = |piece: usize| self.lags[path[piece]][piece].as_ref();
        let there: Vec<usize> = (0..path.len()).filter(|piece| lag(*piece).is_some()).collect();
        let known = |piece: usize| {
            let (at, lag) =
                (self.centre(piece), lag(piece).filter(|lag| lag.odds >= ON_LINE_ODDS && lag.is_alone)?);
            Some((piece, KnownLag { at, lag: self.lines[path[piece]].lag_at(at) + lag.beyond }))
        };
        let found: Vec<(usize, KnownLag)> = there.iter().filter_map(|piece| known(*piece)).collect();
        let rate = rate(&found.iter().map(|found| found.1).collect::<Vec<_>>());
        let beyond: Vec<f64> = found.iter().map(|(_, known)| known.lag - rate * known.at).collect();
        let moves = beyond.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let near = (NEAR_SIGMAS * usual_deviation(moves) * FRAC_1_SQRT_2).clamp(LEAST_NEAR, MOST_NEAR);
        let agrees = |k: usize| {
            let beside = k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(beyond.len());
            (beyond[k] - median(beyond[beside].to_vec())).abs() <= near
        };
        let found: Vec<(usize, KnownLag)> =
            (0..found.len()).filter(|k| agrees(*k)).map(|k| found[k]).collect();
        let level =
            |pieces: &mut dyn Iterator<Item = usize>| pieces.map(|piece| self.levels[piece]).sum::<f64>();
        let agreeing = level(&mut found.iter().map(|found| found.0));
        if found.len() < 2 || agreeing < LEAST_SHARE * level(&mut there.iter().copied()) {
            return Err(Disagree { agreeing: found.len(), pieces: there.len() });
        }
        let heights = found.iter().filter_map(|found| lag(found.0)).map(|lag| lag.height);
        let sign = heights.sum::<f64>().signum();
        Ok(Path { known: found.into_iter().map(|found| found.1).collect(), rate, near, sign })
    }
}

/// The slope that most pairs of pieces some way apart have.
fn rate(known: &[KnownLag]) -> f64 {
    let apart = (known.len() / PIECES_PER_RATE).clamp(1, RATE_PIECES);
    let slope = |pair: (&KnownLag, &KnownLag)| (pair.1.lag - pair.0.lag) / (pair.1.at - pair.0.at);
    median(known.iter().zip(known.iter().skip(apart)).map(slope).collect())
}

/// The ranges in which a condition holds.
fn runs(holds: impl Iterator<Item = bool>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (k, _) in holds.enumerate().filter(|(_, holds)| *holds) {
        match runs.last_mut().filter(|run| run.end == k) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    runs
}
