//! Tones of complex records.

use crate::linalg::Complex;
use crate::random::Random;
use crate::sine_fit::result::wrapped;
use crate::sine_fit::{Channel, ComplexChannel, Component, Sense, SineFit, ToneFit, fit, fit_known};
use crate::units::Hertz;
use std::f64::consts::TAU;

const RATE: Hertz = Hertz(1e6);
const PARTS: ComplexChannel = [0, 1];

fn exponential(fit: &SineFit, direction: Sense) -> ToneFit {
    fit.phasor(Component::Complex(PARTS, direction), 0)
}

/// c + a e^{j w n} + b e^{-j w n} with noise of the standard deviation `sigma` in each part.
fn record(count: usize, cycles: f64, [c, a, b]: [Complex<f64>; 3], sigma: f64, seed: u64) -> [Vec<f64>; 2] {
    let mut random = Random(seed);
    let mut noise = || random.gaussian() * sigma;
    let at = |n: usize| {
        let turn = Complex::from_polar(1.0, TAU * cycles * n as f64);
        c + a * turn + b * turn.conj() + Complex::new(noise(), noise())
    };
    let samples: Vec<Complex<f64>> = (0..count).map(at).collect();
    [samples.iter().map(|z| z.re).collect(), samples.iter().map(|z| z.im).collect()]
}

fn angle(a: f64, b: f64) -> f64 {
    wrapped(a - b).abs()
}

#[test]
fn both_exponentials_are_those_that_are_there() {
    let (a, b) = (Complex::from_polar(0.7, 0.4), Complex::from_polar(0.02, -2.0));
    for cycles in [0.13, -0.31, 0.004, 1.2, -2.4] {
        for count in [300, 511, 2000] {
            let parts = record(count, cycles, [Complex::new(0.1, -0.2), a, b], 0.0, 0);
            let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
            let found = fit(&channels, RATE, &[RATE * (cycles + 0.1 / count as f64)]).unwrap();
            assert!((found.frequencies[0].value / RATE - cycles).abs() < 1e-13, "{cycles} {count}");
            for (direction, z) in [(Sense::Forward, a), (Sense::Backward, b)] {
                let ToneFit { amplitude, phase } = exponential(&found, direction);
                assert!((amplitude.value - z.norm()).abs() < 1e-12, "{cycles} {count} {direction:?}");
                assert!(angle(phase.value.0, z.arg()) < 1e-9, "{cycles} {count} {direction:?}");
            }
            assert!((found.channels[1].constant.value + 0.2).abs() < 1e-12);
        }
    }
}

/// The standard deviations are the closed forms of Rife and Boorstyn, whatever the image.
#[test]
fn standard_deviations_are_the_cramer_rao_bounds_of_an_exponential() {
    let (count, cycles, size, sigma) = (1000, -0.2345, 0.8, 1e-2);
    let parts = record(count, cycles, [0.1.into(), size.into(), (0.1 * size).into()], sigma, 5);
    let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
    let n = count as f64;
    let found = fit(&channels, RATE, &[RATE * cycles]).unwrap();
    let noise = 0.5 * found.channels.iter().map(|part| part.noise.powi(2)).sum::<f64>();
    let snr = size * size / (2.0 * noise);
    let close = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 0.02, "{got} {want}");
    close(
        TAU * (found.frequencies[0].sigma / RATE),
        // The image has a hundredth of the power and tells of the frequency too.
        (6.0 / (snr * 1.01 * n * (n * n - 1.0))).sqrt(),
    );
    let tone = exponential(&found, Sense::Forward);
    close(tone.amplitude.sigma / size, 1.0 / (2.0 * n * snr).sqrt());
    // At the beginning of the record the error of the frequency adds three times the variance.
    close(tone.phase.sigma.0, (4.0 / (2.0 * n * snr)).sqrt());
    let known = exponential(&fit_known(&channels, RATE, &[RATE * cycles]).unwrap(), Sense::Forward);
    close(known.phase.sigma.0, 1.0 / (2.0 * n * snr).sqrt());
    let image = exponential(&found, Sense::Backward);
    close(image.amplitude.sigma, tone.amplitude.sigma);
}

#[test]
fn standard_deviations_are_the_scatter_of_repeated_records() {
    let (count, cycles, trials, sigma) = (64, 0.313_7, 1500, 0.05);
    let a = Complex::from_polar(1.0, 0.9);
    let mut ratios = [0.0; 4];
    for seed in 0..trials {
        let parts = record(count, cycles, [0.0.into(), a, 0.0.into()], sigma, 100 + seed);
        let channels = [Channel::new(&parts[0]), Channel::new(&parts[1])];
        let found = fit(&channels, RATE, &[RATE * cycles]).unwrap();
        let ToneFit { amplitude, phase } = exponential(&found, Sense::Forward);
        let frequency = found.frequencies[0];
        let quadrature = found.ratio(Component::Real(1), Component::Real(0), 0).phase;
        let errors = [
            (frequency.value - RATE * cycles) / frequency.sigma,
            (amplitude.value - 1.0) / amplitude.sigma,
            wrapped(phase.value.0 - 0.9) / phase.sigma.0,
            (quadrature.value.0 + 0.5 * std::f64::consts::PI) / quadrature.sigma.0,
        ];
        ratios.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error / trials as f64);
    }
    // The mean of 1500 squares has a standard deviation of 0.037.
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.13), "{ratios:?}");
}
