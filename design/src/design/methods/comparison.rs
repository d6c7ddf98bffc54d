//! The comparison methods of thesis 5.6.3: sinc interpolation of recurrent nonuniform samples, and first
//! fractional-delay filters, then a bank for integer delays.

use super::{MethodSettings, Synthesis, fir};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::design::problem::{Channel, Problem};
use hybank_core::units::{FastPeriods, GridTime};
use hybank_sampling::Recurrent;

/// Yen's interpolation of the recurrent nonuniform samples, for ideal front ends and the gains of the
/// converters, truncated to `settings.taps` taps per channel.
///
/// # Errors
/// [`DesignError::SincNeedsNyquist`] unless N = M; [`DesignError::Sampling`] for delays that coincide
/// modulo the slow period.
pub(crate) fn sinc(plant: &LiftedPlant, settings: &MethodSettings) -> Result<Synthesis, DesignError> {
    let (problem, channels, ratio) = (plant.problem(), plant.channels(), plant.ratio());
    if channels != ratio {
        return Err(DesignError::SincNeedsNyquist { channels, ratio });
    }
    let offsets: Vec<f64> = problem.delays().iter().map(|delay| -delay.0).collect();
    let sets = Recurrent::new(&offsets)?;
    let taps = |i: usize| {
        let mut taps = sets.taps(i, problem.latency as f64, settings.taps);
        taps.iter_mut().for_each(|tap| *tap /= problem.channels[i].converter_gain);
        taps
    };
    Synthesis::of_taps(plant, (0..channels).map(taps).collect())
}

/// Two steps: a fractional-delay filter for each channel, designed alone at the slow rate, brings its
/// samples onto the fast grid; a bank designed for integer delays fuses them. Both steps together have
/// `settings.taps` taps per channel.
///
/// # Errors
/// As [`fir::synthesise`]; [`DesignError::NoSlowRate`] without the channels at the slow rate.
pub(crate) fn separation(plant: &LiftedPlant, settings: &MethodSettings) -> Result<Synthesis, DesignError> {
    let problem = plant.problem();
    let split = Split::new(problem, settings.taps);
    let grid = grid_delays(problem);
    let bank = fir_taps(&on_grid(problem, &grid, &split), split.bank_taps)?;
    let slow = settings.at_slow_rate.as_ref().ok_or(DesignError::NoSlowRate)?;
    let mut taps = Vec::with_capacity(bank.len());
    for (i, synthesis) in bank.iter().enumerate() {
        let shift = FastPeriods(grid[i] as f64 / problem.ratio as f64);
        let fractional = fir_taps(&alone(slow, i, shift, split.periods), split.delay_taps)?;
        let unscaled = cascade(&fractional[0], synthesis, problem.ratio);
        taps.push(unscaled.iter().map(|tap| tap / problem.channels[i].gain).collect());
    }
    Synthesis::of_taps(plant, taps)
}

/// The taps of least gamma, without regard to noise.
fn fir_taps(problem: &Problem, taps: usize) -> Result<Vec<Vec<f64>>, DesignError> {
    let noiseless = Problem { noise: vec![0.0; problem.channels.len()], ..problem.clone() };
    let settings = MethodSettings { taps, ..MethodSettings::default() };
    fir::taps_of_least_gamma(&LiftedPlant::new(&noiseless), &settings)
}

/// The channels as inputs of the second step: with integer delays, with the latency that the first step
/// leaves, and without their gains, which the taps undo at the end.
fn on_grid(problem: &Problem, grid: &[usize], split: &Split) -> Problem {
    let mut on_grid = problem.clone();
    on_grid.latency -= split.periods * problem.ratio;
    for (channel, &delay) in on_grid.channels.iter_mut().zip(grid) {
        let delay = GridTime::fast_sample(delay as f64, problem.fast_period);
        *channel = Channel { delay, gain: 1.0, converter_gain: 1.0, ..*channel };
    }
    on_grid
}

/// Channel `i` alone at the slow rate, with its own samples, delayed by `shift` slow periods, as the
/// reference.
fn alone(slow: &Problem, i: usize, shift: FastPeriods, latency: usize) -> Problem {
    let channel = slow.channels[i];
    Problem {
        ratio: 1,
        latency,
        target: channel.front_end,
        channels: vec![Channel {
            delay: channel.delay.moved_by(-shift),
            gain: 1.0,
            converter_gain: 1.0,
            ..channel
        }],
        ..slow.clone()
    }
}

/// Whole fast samples that all channels are late: they delay the result, and no filter undoes them.
fn shared_whole_delay(problem: &Problem) -> usize {
    let least = problem.delays().iter().map(|delay| delay.0).fold(f64::INFINITY, f64::min);
    least.max(0.0) as usize
}

/// How taps and latency are shared between the two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Split {
    /// Latency of the fractional-delay filters, slow periods.
    periods: usize,
    /// Their taps, at the slow rate.
    delay_taps: usize,
    /// Taps of the integer-delay bank, at the fast rate.
    bank_taps: usize,
}

impl Split {
    /// A quarter of the latency beyond the common delay goes to the fractional delays, as far as the taps
    /// allow.
    fn new(problem: &Problem, length: usize) -> Self {
        let latency = problem.latency.saturating_sub(shared_whole_delay(problem));
        let periods = (latency / (4 * problem.ratio)).min(length.saturating_sub(1) / (4 * problem.ratio));
        let delay_taps = 2 * periods + 1;
        Self { periods, delay_taps, bank_taps: length - problem.ratio * (delay_taps - 1) }
    }
}

/// For each channel the nearest integer delay whose phase in the slow period no other channel has (if all
/// phases are taken, the nearest delay).
fn grid_delays(problem: &Problem) -> Vec<usize> {
    let mut taken = vec![false; problem.ratio];
    let common = shared_whole_delay(problem);
    let chosen = |channel: &Channel| {
        let chosen = nearest(channel.delay.in_fast_periods().0 - common as f64, &taken);
        taken[chosen % problem.ratio] = true;
        common + chosen
    };
    problem.channels.iter().map(chosen).collect()
}

/// The integer delay nearest to `delay` whose phase in the slow period is not `taken`; if all are, the
/// nearest integer.
fn nearest(delay: f64, taken: &[bool]) -> usize {
    let last = delay.ceil() as usize + taken.len();
    let distance = |&a: &usize| (a as f64 - delay).abs();
    let least = |free: &dyn Fn(usize) -> bool| {
        (0..=last).filter(|&a| free(a)).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    least(&|a| !taken[a % taken.len()]).or_else(|| least(&|_| true)).unwrap_or(0)
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

    #[test]
    fn every_channel_gets_a_place_of_its_own_as_long_as_there_are_any() {
        let places = |delays: &[f64], ratio: usize| {
            let mut taken = vec![false; ratio];
            let place = |&delay: &f64| {
                let chosen = nearest(delay, &taken);
                taken[chosen % ratio] = true;
                chosen
            };
            delays.iter().map(place).collect::<Vec<_>>()
        };
        assert_eq!(places(&[1.2, 0.6], 2), [1, 0]);
        assert_eq!(places(&[1.2, 0.9, 1.1], 2), [1, 0, 1]);
        assert_eq!(places(&[7.4], 1), [7]);
    }
}
