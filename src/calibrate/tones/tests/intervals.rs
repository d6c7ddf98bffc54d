//! Campaigns: 95 % intervals hold the truth also where the noise is not that of a plain model.

use super::{hertz, with_cutoff};
use crate::analog::StrictlyProper;
use crate::calibrate::testbench::{
    assert_holds, errors, gaussian, interleaved, random_errors, tones, with_errors,
};
use crate::calibrate::{Calibration, CalibrationSettings, CalibrationSignal, Record, calibrate};
use crate::linalg::Complex;
use crate::random::Random;
use crate::spec::{OneOrEach, Spec, UncertaintySpec};
use crate::units::RadiansPerFastPeriod;
use std::f64::consts::TAU;

fn draws(what: &str) -> usize {
    if trials::is_slow(what) { 100 } else { 12 }
}

/// Tones of amplitude 1 sampled at instants that err by Gaussian numbers of `jitter` fast periods: their
/// real parts, or the exponentials themselves.
fn jittered(
    truth: &Spec,
    list: &[f64],
    is_complex: bool,
    [noise, jitter]: [f64; 2],
    dice: &mut Random,
) -> Vec<Record> {
    let h = truth.fast_period.0;
    let phases: Vec<f64> = list.iter().map(|_| TAU * dice.part()).collect();
    let channel = |channel: &crate::spec::ChannelSpec| {
        let filter = StrictlyProper::new(&channel.filter, truth.fast_period).unwrap();
        let delay = channel.delay.0 / h;
        let sample = |k: usize| {
            let instant = (truth.ratio * k) as f64 - delay + jitter * gaussian(dice);
            let tone = |(frequency, phase): (&f64, &f64)| {
                let w = TAU * frequency * h;
                let response = filter.response(RadiansPerFastPeriod(w)) * channel.gain;
                Complex::from_polar(response.norm(), w * instant + response.arg() + phase)
            };
            let exact: Complex<f64> = list.iter().zip(&phases).map(tone).sum();
            exact + Complex::new(channel.offset + noise * gaussian(dice), noise * gaussian(dice))
        };
        let (real, imaginary): (Vec<f64>, Vec<f64>) = (0..2048).map(sample).map(|x| (x.re, x.im)).unzip();
        match is_complex {
            true => Record::complex(Record::new(real), Record::new(imaginary)),
            false => Record::new(real),
        }
    };
    truth.channels.iter().map(channel).collect()
}

/// The noise of jitter is largest where the slope is, which is where a delay shows.
#[test]
fn intervals_of_delays_cover_with_jitter() {
    let (spec, draws) = (interleaved(), draws("jitter of 100 draws"));
    let eight = [31e3, 91e3, 163e3, 211e3, 287e3, 333e3, 402e3, 467e3];
    for (list, is_complex) in [
        (&[417e3][..], false),
        (&[61e3, 203e3, 467e3], false),
        (&eight, false),
        (&[417e3], true),
        (&[61e3, -203e3, 467e3], true),
        (&eight, true),
    ] {
        let (mut dice, mut scaled) = (Random(19), Vec::new());
        for _ in 0..draws {
            let truth = with_errors(&spec, &random_errors(&mut dice, 4, [0.01, 0.01, 0.002, 0.0]));
            let records = jittered(&truth, list, is_complex, [1e-4, 2e-3], &mut dice);
            let signal = CalibrationSignal::Tones(hertz(list));
            let found = calibrate(&spec, &records, &signal, CalibrationSettings::default()).unwrap();
            let delays = errors(&truth, &found).delays.into_iter().zip(&found.channels[1..]);
            scaled.extend(delays.map(|(error, channel)| error / channel.delay.unwrap().sigma.0));
        }
        assert_holds(
            &scaled,
            draws,
            &format!("delays of {} tones with jitter, complex {is_complex}", list.len()),
        );
    }
}

/// Errors of cut-offs, those of the reference included, and of the delays over their standard deviations.
fn of_cutoffs(truth: &Spec, factors: &[[f64; 4]], found: &Calibration) -> Vec<f64> {
    let own = found.channels.iter().zip(factors);
    let cutoffs = own.filter_map(|(channel, factors)| channel.cutoff.map(|cutoff| (cutoff, factors[3])));
    let mut scaled: Vec<f64> =
        cutoffs.map(|(cutoff, factor)| (cutoff.value - factor) / cutoff.sigma).collect();
    let delays = errors(truth, found).delays.into_iter().zip(&found.channels[1..]);
    scaled.extend(delays.map(|(error, channel)| error / channel.delay.unwrap().sigma.0));
    scaled
}

const LIST: [f64; 6] = [61e3, 203e3, 341e3, 467e3, 718e3, 1306e3];

/// All cut-offs are wrong by one more factor: tones of a high signal-to-noise ratio tell it.
#[test]
fn intervals_cover_with_a_cutoff_that_all_channels_have_in_common() {
    let (spec, draws) = (interleaved(), draws("common cut-offs of 100 draws"));
    let (mut dice, mut scaled) = (Random(20), Vec::new());
    for _ in 0..draws {
        let mut factors = random_errors(&mut dice, 4, [0.01, 0.01, 0.002, 0.03]);
        let common = 1.0 + 0.07 * dice.sample();
        factors.iter_mut().for_each(|one| one[3] *= common);
        let truth = with_errors(&spec, &factors);
        let records = tones(&truth, &hertz(&LIST), 4096, 1e-5, &mut dice);
        let found = with_cutoff(&spec, &records, &LIST).unwrap();
        assert!(found.misfit.is_some_and(|misfit| misfit < 2.0), "{:?}", found.misfit);
        scaled.extend(of_cutoffs(&truth, &factors, &found));
    }
    assert_holds(&scaled, draws, "a common cut-off that the tones tell");
}

/// What the tones do not tell of the reference is as uncertain as the spec says, and the others with it.
#[test]
fn intervals_cover_with_the_stated_uncertainty_of_the_references_cutoff() {
    let (mut spec, draws) = (interleaved(), draws("stated cut-offs of 100 draws"));
    let half_width = 0.06;
    spec.uncertainty =
        Some(UncertaintySpec { cutoff: Some(OneOrEach::Same(half_width)), ..UncertaintySpec::default() });
    let (mut dice, mut scaled) = (Random(21), Vec::new());
    for _ in 0..draws {
        let mut factors = random_errors(&mut dice, 4, [0.01, 0.01, 0.002, 0.01]);
        let common = (half_width / 1.96 * gaussian(&mut dice)).exp();
        factors.iter_mut().for_each(|one| one[3] *= common);
        let truth = with_errors(&spec, &factors);
        let records = tones(&truth, &hertz(&LIST), 4096, 1e-4, &mut dice);
        let found = with_cutoff(&spec, &records, &LIST).unwrap();
        scaled.extend(of_cutoffs(&truth, &factors, &found));
    }
    // The channels of one draw have one reference, so there are fewer draws than intervals.
    let inside = scaled.iter().filter(|x| x.abs() < 1.96).count() as f64 / scaled.len() as f64;
    println!("stated cut-offs: {:.1} % of {} intervals", 100.0 * inside, scaled.len());
    assert!(inside > 0.85, "{inside}");
}
