//! The best integer taps of a small bank, by trying all of them.
//!
//! The row of phase p of the error depends on the taps of that phase alone, and no row of a matrix has a
//! larger norm than the matrix. So the integers of each phase are tried apart, and those whose row is
//! already too large are dropped. What is left is tried in all combinations.

use hybank::design::LiftedPlant;
use hybank::linalg::{CMat, Complex};
use std::ops::RangeInclusive;

/// Intervals of the frequencies.
const GRID: usize = 96;
/// Fraction bits that matter.
pub(super) const SCALES: RangeInclusive<i32> = -17..=24;
/// A bank counts as better if it is by this fraction.
const BETTER: f64 = 1e-3;

/// The plant on a grid of frequencies.
pub(super) struct BruteForce {
    omegas: Vec<f64>,
    /// W, M x q, and H, N x q, at each frequency.
    responses: Vec<(CMat, CMat)>,
    ratio: usize,
    channels: usize,
    taps: usize,
    bits: u32,
}

/// The rows of the error of one phase, as functions of its taps.
struct Phase<'a> {
    of: &'a BruteForce,
    /// Channel and number of each tap.
    taps: Vec<(usize, usize)>,
    /// At each frequency the Gram matrix of the rows (W_p, then the response of each tap), real part.
    grams: Vec<Vec<f64>>,
    phase: usize,
}

impl BruteForce {
    pub(super) fn new(plant: &LiftedPlant, taps: usize, bits: u32) -> Self {
        // The ends come first: they reject most.
        let order = (0..=GRID).map(|k| (k * 37) % (GRID + 1));
        let omegas: Vec<f64> = order.map(|k| std::f64::consts::PI * k as f64 / GRID as f64).collect();
        let responses = omegas.iter().map(|&omega| {
            let point = plant.at(omega);
            (point.w, point.h)
        });
        let responses = responses.collect();
        Self { omegas, responses, ratio: plant.ratio(), channels: plant.channels(), taps, bits }
    }

    /// The taps of least gamma on the grid with so many fraction bits, if that is below `gamma`.
    pub(super) fn better_than(&self, gamma: f64, scales: RangeInclusive<i32>) -> Option<Vec<Vec<f64>>> {
        let phases: Vec<Phase<'_>> = (0..self.ratio).map(|phase| Phase::new(self, phase)).collect();
        let mut bar = gamma * (1.0 - BETTER);
        let mut best = None;
        for scale in scales {
            let step = (-f64::from(scale)).exp2();
            let lists: Vec<Vec<Vec<f64>>> = phases.iter().map(|phase| phase.below(step, bar)).collect();
            if lists.iter().any(Vec::is_empty) {
                continue;
            }
            let mut chosen = Vec::new();
            self.combine(&phases, &lists, &mut chosen, &mut bar, &mut best);
        }
        best
    }

    /// Tries all combinations of the rows; `chosen` holds those of the first phases.
    fn combine(
        &self,
        phases: &[Phase<'_>],
        lists: &[Vec<Vec<f64>>],
        chosen: &mut Vec<Vec<f64>>,
        bar: &mut f64,
        best: &mut Option<Vec<Vec<f64>>>,
    ) {
        let Some(list) = lists.get(chosen.len()) else {
            let worst = (0..self.omegas.len()).map(|k| self.largest(phases, chosen, k)).fold(0.0, f64::max);
            *bar = worst * (1.0 - BETTER);
            *best = Some(self.filters(phases, chosen));
            return;
        };
        for taps in list {
            chosen.push(taps.clone());
            let below = (0..self.omegas.len()).all(|k| self.largest(phases, chosen, k) <= *bar);
            if below {
                self.combine(phases, lists, chosen, bar, best);
            }
            chosen.pop();
        }
    }

    /// The largest singular value of the first rows of the error at a frequency.
    fn largest(&self, phases: &[Phase<'_>], chosen: &[Vec<f64>], k: usize) -> f64 {
        let rows: Vec<Vec<Complex<f64>>> =
            chosen.iter().zip(phases).map(|(taps, phase)| phase.row(k, taps)).collect();
        let columns = rows[0].len();
        let matrix = CMat::from_fn(rows.len(), columns, |r, c| rows[r][c]);
        hybank::linalg::largest_singular_value(&matrix).unwrap()
    }

    fn filters(&self, phases: &[Phase<'_>], chosen: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut filters = vec![vec![0.0; self.taps]; self.channels];
        for (phase, values) in phases.iter().zip(chosen) {
            for (&(channel, n), value) in phase.taps.iter().zip(values) {
                filters[channel][n] = *value;
            }
        }
        filters
    }
}

impl<'a> Phase<'a> {
    fn new(of: &'a BruteForce, phase: usize) -> Self {
        let taps: Vec<(usize, usize)> = (phase..of.taps)
            .step_by(of.ratio)
            .flat_map(|n| (0..of.channels).map(move |channel| (channel, n)))
            .collect();
        let mut found = Self { of, taps, grams: Vec::new(), phase };
        found.grams = (0..of.omegas.len()).map(|k| found.gram(k)).collect();
        found
    }

    /// The response of a tap of value one.
    fn response(&self, k: usize, (channel, n): (usize, usize)) -> Vec<Complex<f64>> {
        let lag = Complex::from_polar(1.0, -self.of.omegas[k] * (n / self.of.ratio) as f64);
        self.of.responses[k].1.row(channel).iter().map(|h| lag * h).collect()
    }

    fn row(&self, k: usize, taps: &[f64]) -> Vec<Complex<f64>> {
        let mut row: Vec<Complex<f64>> = self.of.responses[k].0.row(self.phase).iter().copied().collect();
        for (tap, &value) in self.taps.iter().zip(taps) {
            row.iter_mut().zip(self.response(k, *tap)).for_each(|(sum, response)| *sum -= response * value);
        }
        row
    }

    fn gram(&self, k: usize) -> Vec<f64> {
        let mut rows = vec![self.row(k, &[])];
        rows.extend(self.taps.iter().map(|&tap| self.response(k, tap)));
        let inner = |a: &[Complex<f64>], b: &[Complex<f64>]| {
            a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum::<f64>()
        };
        rows.iter().flat_map(|a| rows.iter().map(|b| inner(a, b)).collect::<Vec<_>>()).collect()
    }

    /// All taps of this phase whose row stays below `bar` at every frequency.
    fn below(&self, step: f64, bar: f64) -> Vec<Vec<f64>> {
        let (least, count) = (-(1i64 << (self.of.bits - 1)), 1usize << self.of.bits);
        let cells = self.taps.len();
        let mut found = Vec::new();
        let mut first = 0;
        for code in 0..count.pow(cells as u32) {
            let value =
                |cell: usize| (least + ((code / count.pow(cell as u32)) % count) as i64) as f64 * step;
            let taps: Vec<f64> = (0..cells).map(value).collect();
            // The frequency that rejected the last taps probably rejects these, too.
            if self.square(first, &taps) > bar * bar {
                continue;
            }
            match (0..self.grams.len()).find(|&k| self.square(k, &taps) > bar * bar) {
                Some(rejecting) => first = rejecting,
                None => found.push(taps),
            }
        }
        found
    }

    /// The squared norm of the row.
    fn square(&self, k: usize, taps: &[f64]) -> f64 {
        let gram = &self.grams[k];
        let size = taps.len() + 1;
        let mut sum = gram[0];
        for (i, a) in taps.iter().enumerate() {
            let mut inner = -2.0 * gram[i + 1];
            for (j, b) in taps.iter().enumerate() {
                inner += b * gram[(i + 1) * size + j + 1];
            }
            sum += a * inner;
        }
        sum
    }
}
