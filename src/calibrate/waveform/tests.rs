//! A known waveform against its bound, and what is refused.

use super::*;
use crate::analog::StrictlyProper;
use crate::calibrate::Cutoff;
use crate::calibrate::testbench::{
    assert_covers, errors, gaussian, interleaved, random_errors, trials, with_errors,
};
use crate::calibrate::{CalibrateError, Calibration, CalibrationSignal, FittedValues, calibrate};
use crate::random::Random;
use crate::simulate::Instants;
use crate::spec::ChannelSpec;
use crate::spec::Spec;

/// A noise that fills the band up to half the fast rate and beyond, at 1.5 times that rate.
fn waveform(dice: &mut Random, samples: usize) -> Vec<f64> {
    (0..samples).map(|_| 0.3 * gaussian(dice)).collect()
}

const SPACING: FastPeriods = FastPeriods(1.0 / 1.5);

/// Captures of the waveform, which begins at `start` (fast periods).
fn captures(truth: &Spec, samples: &[f64], start: f64, noise: f64, dice: &mut Random) -> Vec<Record> {
    let recording = Periodic::new(samples, SPACING);
    let ratio = truth.ratio as f64;
    let count = (recording.duration().0 / ratio) as usize + 60;
    let one = |channel: &ChannelSpec| {
        let filter = StrictlyProper::new(&channel.filter, truth.fast_period).unwrap();
        let delay = channel.delay / truth.fast_period;
        let instants = Instants { first: FastPeriods(-delay - start), step: FastPeriods(ratio), count };
        let inside = |k: usize| (0.0..recording.duration().0).contains(&(k as f64 * ratio - delay - start));
        let clean = recording.sample(&filter, instants).into_iter().enumerate();
        // Silence before and after.
        clean.map(|(k, x)| if inside(k) { channel.gain * x } else { 0.0 } + channel.offset).collect()
    };
    let clean: Vec<Vec<f64>> = truth.channels.iter().map(one).collect();
    let noisy = |samples: Vec<f64>, dice: &mut Random| {
        Record::new(samples.into_iter().map(|x| x + noise * gaussian(dice)).collect())
    };
    clean.into_iter().map(|samples| noisy(samples, dice)).collect()
}

fn by_waveform(
    spec: &Spec,
    records: &[Record],
    samples: &[f64],
    cutoff: Option<Cutoff>,
) -> Result<Calibration, CalibrateError> {
    let settings =
        CalibrationSettings { fit: FittedValues { cutoff, ..FittedValues::default() }, reference: 0 };
    calibrate(
        spec,
        records,
        &CalibrationSignal::Waveform { samples: samples.to_vec(), spacing: SPACING },
        settings,
    )
}

/// The standard deviation is s / sqrt(g^2 sum v'^2), and the intervals hold the truth.
#[test]
fn errors_are_at_the_bound_and_intervals_cover() {
    let (spec, mut dice, noise) = (interleaved(), Random(21), 1e-3);
    let (mut scaled, trials) = (Vec::new(), trials(40));
    for trial in 0..trials {
        let samples = waveform(&mut dice, 3000);
        let truth = with_errors(&spec, &random_errors(&mut dice, 4, [0.02, 0.01, 0.002, 0.0]));
        let records = captures(&truth, &samples, 37.3 + (trial % 100) as f64 * 0.37, noise, &mut dice);
        let found = by_waveform(&spec, &records, &samples, None).unwrap();
        scaled.extend(errors(&truth, &found).scaled);
        // White noise after a low-pass of 2 MHz, up to 0.75 MHz: the rms of v' from its spectrum.
        let slope: f64 = (1..750)
            .map(|k| k as f64 * 1e3)
            .map(|f| (f * 1e-6 * std::f64::consts::TAU).powi(2) / (1.0 + (f / 2e6).powi(2)))
            .sum::<f64>()
            / 750.0;
        let bound = noise * (2.0 / (found.frames as f64 * 0.09 * slope)).sqrt();
        let sigma = found.channels[1].delay.unwrap().sigma.0;
        assert!((sigma / bound - 1.0).abs() < 0.15, "{sigma:e}, bound {bound:e}");
    }
    assert_covers(&scaled, trials);
}

#[test]
fn the_cutoff_is_found_with_the_delay() {
    let (spec, mut dice) = (interleaved(), Random(22));
    let samples = waveform(&mut dice, 3000);
    let shift = |delay, cutoff| [delay, 1.0, 0.0, cutoff];
    let truth =
        with_errors(&spec, &[shift(0.0, 1.0), shift(0.01, 1.02), shift(-0.02, 0.99), shift(0.0, 1.01)]);
    let records = captures(&truth, &samples, 11.1, 1e-4, &mut dice);
    let found = by_waveform(&spec, &records, &samples, Some(Cutoff::Whole)).unwrap();
    for (estimate, cutoff) in found.channels.iter().zip([1.0, 1.02, 0.99, 1.01]).skip(1) {
        let estimate = estimate.cutoff.unwrap();
        let off = (estimate.value - cutoff).abs();
        assert!(off < 4.0 * estimate.sigma && estimate.sigma < 2e-3, "{estimate:?}");
    }
    assert!(errors(&truth, &found).scaled.iter().all(|x| x.abs() < 5.0));
}

#[test]
fn another_waveform_is_refused() {
    let (spec, mut dice) = (interleaved(), Random(23));
    let (samples, other) = (waveform(&mut dice, 3000), waveform(&mut dice, 3000));
    let records = captures(&spec, &samples, 11.1, 1e-3, &mut dice);
    let refused = by_waveform(&spec, &records, &other, None).unwrap_err();
    assert!(
        matches!(
            refused,
            CalibrateError::NotTheWaveform { .. }
                | CalibrateError::NoConvergence { .. }
                | CalibrateError::ShortOverlap { .. }
        ),
        "{refused}"
    );
    let few = by_waveform(&spec, &records, &other[..50], None).unwrap_err();
    assert!(matches!(few, CalibrateError::Waveform { samples: 50, .. }), "{few}");
}

#[test]
fn swapped_captures_are_recognised() {
    let (spec, mut dice) = (interleaved(), Random(24));
    let samples = waveform(&mut dice, 3000);
    let mut records = captures(&spec, &samples, 5.0, 1e-3, &mut dice);
    records.swap(0, 3);
    let refused = by_waveform(&spec, &records, &samples, None).unwrap_err();
    assert_eq!(refused, CalibrateError::WrongOrder { order: vec![4, 2, 3, 1] });
}

#[test]
fn correlated_noise_widens_the_intervals() {
    let mut dice = Random(25);
    let white: Vec<f64> = (0..4000).map(|_| gaussian(&mut dice)).collect();
    assert_eq!(correlation_factor(&white), 1.0);
    let correlated: Vec<f64> = white.windows(8).map(|window| window.iter().sum()).collect();
    // The standard deviation of a mean of moving averages of 8 is sqrt(8) times that of white noise.
    let factor = correlation_factor(&correlated);
    assert!((factor - 8f64.sqrt()).abs() < 0.3, "{factor}");
}
