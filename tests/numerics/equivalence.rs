//! The exact equivalent against brute force: a finely discretised continuous-time system.
//!
//! Inputs are sums of short pulses of unit energy over a finite stretch of time, outputs the error samples
//! that the definition gives for them (analog step responses, sample instants, convolution with the taps).
//! Fewer inputs and fewer outputs can only lower the largest gain, so it must approach the computed norm
//! from below.

use crate::support::specs::{alike, low_pass_at, tf, thesis_filter};
use hybank::bank::SynthesisFilters;
use hybank::design::LiftedPlant;
use hybank::design::filters::lifted;
use hybank::design::problem::Problem;
use hybank::linalg::{Mat, singular_values};
use hybank::simulate::{Instants, Source, sample};
use hybank::spec::{Family, FilterSpec};
use hybank::units::FastPeriods;

struct Case {
    problem: Problem,
    taps: Vec<Vec<f64>>,
}

fn case(ratio: usize, latency: usize, front_ends: &[FilterSpec], channels: &[(usize, f64)]) -> Case {
    let delays: Vec<f64> = channels.iter().map(|(_, delay)| *delay).collect();
    let mut spec = alike(&front_ends[0], ratio, latency, &delays);
    for (channel, (front_end, _)) in spec.channels.iter_mut().zip(channels) {
        channel.filter = front_ends[*front_end].clone();
    }
    let problem = Problem::new(&spec, latency).unwrap();
    // Any taps will do: the equivalence does not care whether they are good.
    let taps = (0..channels.len())
        .map(|i| (0..3 * ratio + 1).map(|n| ((1 + i * 5 + n * 3) as f64).sin() * 0.6).collect())
        .collect();
    Case { problem, taps }
}

/// e[n] for each pulse, rows n = 0 .. frames M, columns pulses of width 1 / fineness over the same time.
fn pulse_errors(case: &Case, frames: usize, fineness: usize) -> Mat {
    let Problem { ratio, latency, .. } = case.problem;
    let width = 1.0 / fineness as f64;
    let columns = frames * ratio * fineness;
    let scale = 1.0 / width.sqrt();
    // (phi * pulse_c)(t) for t = k step + offset is a difference of step responses on a lattice of `width`.
    let responses = |front_end: usize, offset: f64| -> Vec<f64> {
        let step = Source::Step { at: FastPeriods(0.0), height: 1.0 };
        let first = FastPeriods(offset - columns as f64 * width);
        let instants = Instants { first, step: FastPeriods(width), count: 2 * columns + 2 };
        sample(&case.problem.front_ends[front_end], &step, instants)
    };
    let pulse = |table: &[f64], steps: usize, c: usize| {
        let at = columns + steps - c;
        scale * (table[at] - table[at - 1])
    };
    let reference = responses(case.problem.target, -(latency as f64));
    let mut errors = Mat::from_fn(frames * ratio, columns, |n, c| pulse(&reference, n * fineness, c));
    for (channel, taps) in case.problem.channels.iter().zip(&case.taps) {
        let table = responses(channel.front_end, -channel.delay.in_fast_periods().0);
        for n in 0..frames * ratio {
            for k in 0..=n / ratio {
                let Some(tap) = taps.get(n - k * ratio) else { continue };
                for c in 0..columns {
                    errors[(n, c)] -= tap * pulse(&table, k * ratio * fineness, c);
                }
            }
        }
    }
    errors
}

fn brute_force(case: &Case, frames: usize, fineness: usize) -> f64 {
    let errors = pulse_errors(case, frames, fineness);
    singular_values(&(&errors * errors.transpose())).unwrap()[0].sqrt()
}

fn computed(case: &Case) -> f64 {
    let plant = LiftedPlant::new(&case.problem);
    let filters = SynthesisFilters::Fir(case.taps.clone());
    plant.norm(&lifted(&filters, case.problem.ratio)).unwrap().gain
}

fn check(name: &str, case: &Case) {
    let norm = computed(case);
    let ratio = case.problem.ratio;
    let (coarse, fine) = (brute_force(case, 24 / ratio, 3), brute_force(case, 144 / ratio, 16));
    assert!(fine <= norm * (1.0 + 1e-9), "{name}: {coarse} {fine} above {norm}");
    assert!(coarse < fine, "{name}: {coarse} {fine} do not grow");
    assert!(fine > 0.985 * norm, "{name}: {fine} stays away from {norm}");
}

#[test]
fn as_many_channels_as_the_ratio() {
    check("N = M", &case(2, 3, &[thesis_filter()], &[(0, 1.2), (0, 0.6)]));
}

#[test]
fn oversampled_with_different_filters_and_equal_delays() {
    let filters = [thesis_filter(), tf(&[1.0], &[1.0, 1.0]), tf(&[0.36], &[1.0, 0.84, 0.36])];
    check("N > M", &case(2, 0, &filters, &[(1, 0.2), (2, 0.2), (0, 1.6)]));
}

#[test]
fn undersampled() {
    check("N < M", &case(3, 2, &[thesis_filter()], &[(0, 0.0), (0, 1.9)]));
}

#[test]
fn delays_of_many_periods_and_whole_ones() {
    let filters = [thesis_filter(), tf(&[2.0], &[1.0, 2.0])];
    check("long delays", &case(2, 1, &filters, &[(0, 5.3), (1, 2.0), (0, 0.0)]));
}

#[test]
fn one_channel_that_only_resamples() {
    // One pole: the worst input jumps at the sample instants, so these lie on the lattice of pulses.
    check("N = M = 1", &case(1, 0, &[tf(&[2.0], &[1.0, 2.0])], &[(0, 0.375)]));
}

#[test]
fn a_steep_front_end() {
    let mut elliptic = low_pass_at(Family::Elliptic, 5, 0.25);
    if let FilterSpec::Family { attenuation_db, .. } = &mut elliptic {
        *attenuation_db = Some(40.0);
    }
    check("elliptic", &case(2, 2, &[elliptic], &[(0, 0.31), (0, 1.44)]));
}
