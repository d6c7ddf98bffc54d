//! Descent on gamma itself: one tap or a pair of taps changes by one step.

use super::lattice::IntegerSpan;
use super::settings::SETTINGS;
use crate::design::DesignError;
use crate::design::limits::Stop;
use crate::lmi::sampled::FrequencyPoint;
use crate::lti::FirMatrix;
use hybank_linalg::{CMat, Complex};

/// Moves tried in pairs: those that lower the error at the worst frequency most.
const MOVES_IN_PAIRS: usize = 48;
/// Rounds of single moves and pairs.
const ROUNDS: usize = 16;

/// A tap by one step up or down.
#[derive(Debug, Clone, Copy)]
struct Move {
    channel: usize,
    /// The tap at the fast rate.
    tap: usize,
    /// +1 or -1.
    steps: f64,
}

/// Integer taps with the error that they leave at the points of a grid.
pub(super) struct Descent<'a> {
    points: &'a [FrequencyPoint],
    ratio: usize,
    step: f64,
    spans: &'a [IntegerSpan],
    /// One list per channel.
    integers: Vec<Vec<f64>>,
    errors: Vec<CMat>,
    gains: Vec<f64>,
    /// The points, the worst ones first.
    order: Vec<usize>,
    /// gamma of the real taps.
    real: f64,
    worst: f64,
}

impl<'a> Descent<'a> {
    /// Integers times `step` are the taps; `fir` has the same taps by lag, `spans` the bounds by tap.
    pub(super) fn new(
        points: &'a [FrequencyPoint],
        spans: &'a [IntegerSpan],
        step: f64,
        integers: Vec<Vec<f64>>,
        fir: &FirMatrix,
        real: f64,
    ) -> Result<Self, DesignError> {
        let errors: Vec<CMat> = points.iter().map(|point| point.error(&fir.response(point.omega))).collect();
        let ratio = fir.shape().0;
        let (gains, order) = (Vec::new(), (0..points.len()).collect());
        let mut descent =
            Self { points, ratio, step, spans, integers, errors, gains, order, real, worst: 0.0 };
        descent.measure()?;
        Ok(descent)
    }

    /// Descends until no move helps, or the relative excess over gamma of the real taps is at most
    /// `negligible`.
    pub(super) fn run(mut self, negligible: f64, stop: &Stop) -> Result<Vec<Vec<f64>>, DesignError> {
        let floor = self.real * (1.0 + negligible);
        for _ in 0..ROUNDS {
            while self.worst > floor && !stop.is_due() && self.sweep()? {}
            if self.worst <= floor || stop.is_due() || !self.pairs()? {
                break;
            }
        }
        Ok(self.integers)
    }

    fn measure(&mut self) -> Result<(), DesignError> {
        self.gains =
            self.errors.iter().map(hybank_linalg::largest_singular_value).collect::<Result<_, _>>()?;
        let gains = &self.gains;
        self.order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]));
        self.worst = gains[self.order[0]];
        Ok(())
    }

    /// All moves within the bits of their taps.
    fn moves(&self) -> Vec<Move> {
        let taps = |channel: usize| {
            (0..self.integers[channel].len())
                .flat_map(move |tap| [-1.0, 1.0].map(|steps| Move { channel, tap, steps }))
        };
        (0..self.integers.len()).flat_map(taps).filter(|&m| self.allowed(m)).collect()
    }

    fn allowed(&self, m: Move) -> bool {
        self.spans[m.tap].contains(self.integers[m.channel][m.tap] + m.steps)
    }

    /// Tries each single move once and makes those that help; whether any did.
    fn sweep(&mut self) -> Result<bool, DesignError> {
        let mut helped = false;
        for m in self.moves() {
            helped |= self.allowed(m) && self.make_if_better(&[m])?;
        }
        Ok(helped)
    }

    /// Makes the first pair of moves that helps; whether there is one.
    fn pairs(&mut self) -> Result<bool, DesignError> {
        let worst_point = self.order[0];
        let mut ranked = Vec::new();
        for m in self.moves() {
            ranked.push((self.gain_after(worst_point, &[m])?, m));
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.truncate(MOVES_IN_PAIRS);
        for (i, &(_, a)) in ranked.iter().enumerate() {
            for &(_, b) in &ranked[..i] {
                if (a.channel, a.tap) != (b.channel, b.tap) && self.make_if_better(&[a, b])? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    fn make_if_better(&mut self, moves: &[Move]) -> Result<bool, DesignError> {
        let bar = self.worst - SETTINGS.least_excess_removed * (self.worst - self.real).max(0.0);
        // The worst points come first, because they reject most moves.
        for &k in &self.order {
            if self.gain_after(k, moves)? > bar {
                return Ok(false);
            }
        }
        for k in 0..self.points.len() {
            self.errors[k] = self.error_after(k, moves);
        }
        for m in moves {
            self.integers[m.channel][m.tap] += m.steps;
        }
        self.measure()?;
        Ok(true)
    }

    fn gain_after(&self, k: usize, moves: &[Move]) -> Result<f64, DesignError> {
        Ok(hybank_linalg::largest_singular_value(&self.error_after(k, moves))?)
    }

    /// `K - e_p delta e^{-i omega j} H_i` for each move.
    fn error_after(&self, k: usize, moves: &[Move]) -> CMat {
        let point = &self.points[k];
        let mut error = self.errors[k].clone();
        for m in moves {
            let (phase, lag) = (m.tap % self.ratio, m.tap / self.ratio);
            let phasor = Complex::from_polar(m.steps * self.step, -point.omega * lag as f64);
            for (e, h) in error.row_mut(phase).iter_mut().zip(point.h.row(m.channel).iter()) {
                *e -= phasor * h;
            }
        }
        error
    }
}
