//! Methods to compare with (thesis 5.6.3): what is done today without a worst-case design.

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::fir::{SecondObjective, design_fir};
use super::problem::{Channel, Problem};
use crate::sampling::Recurrent;
use crate::spec::Spec;
use crate::units::FastPeriods;

/// Taps a channel where the spec names none: 23 for M = 2, as in the thesis.
pub fn default_taps(ratio: usize) -> usize {
    12 * ratio - 1
}

/// Yen's interpolation of the recurrent nonuniform samples, as if front ends were ideal, truncated to
/// `length` taps a channel.
///
/// # Errors
/// [`DesignError::SincNeedsNyquist`] unless N = M; [`DesignError::Sampling`] for delays that coincide
/// modulo the slow period.
pub fn sinc_taps(problem: &Problem, length: usize) -> Result<Vec<Vec<f64>>, DesignError> {
    let (channels, ratio) = (problem.channels.len(), problem.ratio);
    if channels != ratio {
        return Err(DesignError::SincNeedsNyquist { channels, ratio });
    }
    let offsets: Vec<f64> = problem.channels.iter().map(|channel| -channel.delay.0).collect();
    let sets = Recurrent::new(&offsets, ratio)?;
    Ok((0..channels).map(|i| sets.taps(i, problem.latency as f64, length)).collect())
}

/// Two steps: a fractional-delay filter for each channel, designed alone at the slow rate, brings its samples
/// onto the fast grid; a bank designed for integer delays fuses them. `length` taps a channel in all.
pub fn separation_taps(spec: &Spec, problem: &Problem, length: usize) -> Result<Vec<Vec<f64>>, DesignError> {
    let split = Split::new(problem, length);
    let grid = grid_delays(problem);
    let mut on_grid = problem.clone();
    on_grid.latency -= split.ticks * problem.ratio;
    for (channel, &delay) in on_grid.channels.iter_mut().zip(&grid) {
        channel.delay = FastPeriods(delay as f64);
    }
    let bank = plain_fir(&on_grid, split.bank_taps)?;
    let at_slow_rate = Spec { fast_period: spec.fast_period * spec.ratio as f64, ..spec.clone() };
    let (slow, _) = Problem::new(&at_slow_rate, split.ticks)?.without_duplicates();
    let mut taps = Vec::with_capacity(bank.len());
    for (i, synthesis) in bank.iter().enumerate() {
        let channel = slow.channels[i];
        let delay = channel.delay - FastPeriods(grid[i] as f64 / problem.ratio as f64);
        let alone = Problem {
            ratio: 1,
            target: channel.front_end,
            channels: vec![Channel { delay, ..channel }],
            noise: vec![0.0],
            ..slow.clone()
        };
        let fractional = plain_fir(&alone, split.delay_taps)?;
        taps.push(cascade(&fractional[0], synthesis, problem.ratio));
    }
    Ok(taps)
}

/// The taps of least gamma, without regard to noise.
fn plain_fir(problem: &Problem, taps: usize) -> Result<Vec<Vec<f64>>, DesignError> {
    let second = SecondObjective::new(&vec![0.0; problem.channels.len()], None);
    Ok(design_fir(&BlockedPlant::new(problem), taps, second)?.taps)
}

/// How taps and latency are shared between the two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Split {
    /// Latency of the fractional-delay filters, slow ticks.
    ticks: usize,
    /// Their taps, at the slow rate.
    delay_taps: usize,
    /// Taps of the integer-delay bank, at the fast rate.
    bank_taps: usize,
}

impl Split {
    /// A quarter of the latency goes to the fractional delays, as far as the taps allow.
    fn new(problem: &Problem, length: usize) -> Self {
        let ticks = (problem.latency / (4 * problem.ratio)).min((length - 1) / (4 * problem.ratio));
        let delay_taps = 2 * ticks + 1;
        Self { ticks, delay_taps, bank_taps: length - problem.ratio * (delay_taps - 1) }
    }
}

/// For each channel the nearest whole delay whose place in the slow period is still free (when all are taken,
/// the nearest).
fn grid_delays(problem: &Problem) -> Vec<usize> {
    let mut taken = vec![false; problem.ratio];
    problem
        .channels
        .iter()
        .map(|channel| {
            let last = channel.delay.0.ceil() as usize + problem.ratio;
            let distance = |&a: &usize| (a as f64 - channel.delay.0).abs();
            let nearest = |free: &dyn Fn(usize) -> bool| {
                (0..=last).filter(|&a| free(a)).min_by(|a, b| distance(a).total_cmp(&distance(b)))
            };
            let chosen = nearest(&|a| !taken[a % problem.ratio]).or_else(|| nearest(&|_| true)).unwrap_or(0);
            taken[chosen % problem.ratio] = true;
            chosen
        })
        .collect()
}

/// (slow filter, upsampled by M) * (fast filter).
fn cascade(slow: &[f64], fast: &[f64], ratio: usize) -> Vec<f64> {
    let mut product = vec![0.0; fast.len() + ratio * (slow.len() - 1)];
    for (k, s) in slow.iter().enumerate() {
        for (n, f) in fast.iter().enumerate() {
            product[k * ratio + n] += s * f;
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cascade_is_the_convolution_with_the_upsampled_filter() {
        assert_eq!(cascade(&[1.0, 2.0], &[1.0, 0.0, 5.0], 2), vec![1.0, 0.0, 7.0, 0.0, 10.0]);
    }
}
