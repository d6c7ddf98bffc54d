//! Complex captures.

use super::*;
use crate::calibrate::testbench::complex_tones;

/// The rms error of the delays is that of the Cramer-Rao bound sqrt(1 / (N SNR)) / w for both signs and in
/// every zone, and the intervals hold the truth.
#[test]
fn errors_are_at_the_bound_of_an_exponential_and_intervals_cover() {
    let (spec, frames, noise, trials) = (interleaved(), 256, 1e-3, trials(150));
    let mut dice = Random(15);
    let mut scaled = Vec::new();
    for tone in [41e3, -41e3, 301e3, -467e3, -718e3] {
        let mut squares = Vec::new();
        for _ in 0..trials {
            let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
            let records = complex_tones(&truth, &[Hertz(tone)], frames, noise, &mut dice);
            let found = by_tones(&spec, &records, &[tone]).unwrap();
            let errors = errors(&truth, &found);
            squares.extend(errors.delays.iter().map(|error| error * error));
            scaled.extend(errors.scaled);
        }
        let w = TAU * tone.abs() * 1e-6;
        let amplitude = 1.0 / 1f64.hypot(tone / 2e6);
        let snr = amplitude * amplitude / (2.0 * noise * noise);
        let bound = (1.0 / (frames as f64 * snr)).sqrt() / w;
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        println!("{tone} Hz: rms error over bound {:.3}", rms / bound);
        assert!(rms < 1.1 * bound, "{tone} Hz: {rms:e} fast periods, bound {bound:e}");
        assert!(rms > 0.85 * bound, "{tone} Hz: {rms:e} is below the bound {bound:e}");
    }
    assert_covers(&scaled, trials);
}

/// Signs and zones follow from the samples and the nominal delays.
#[test]
fn tones_of_both_signs_are_found() {
    let spec = interleaved();
    let mut dice = Random(4);
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    for tone in [41e3, -41e3, 203e3, -301e3, 467e3, -467e3] {
        let records = complex_tones(&truth, &[Hertz(tone)], 2048, 1e-4, &mut dice);
        let found = by_tones(&spec, &records, &[]).unwrap();
        assert!((found.tones[0].frequency.value.0 - tone).abs() < 0.1, "{tone}: {:?}", found.tones);
        assert_eq!(found.tones[0].zone, (tone.abs() / 125e3) as usize + 1);
        assert!(errors(&truth, &found).delays.iter().all(|error| error.abs() < 1e-3), "{tone}");
    }
}

/// Three tones of both signs tell cut-offs from delays.
#[test]
fn cutoffs_are_found_from_tones_of_both_signs() {
    let spec = interleaved();
    let mut dice = Random(5);
    let list = [0.0, 0.01, -0.02, 0.015].map(|x| [0.01 * x, 1.0 + 0.1 * x, 0.0, 1.0 + x]);
    let truth = with_errors(&spec, &list);
    let tones = [61e3, -233e3, 377e3, -489e3];
    let records = complex_tones(&truth, &hertz(&tones), 20_000, 1e-4, &mut dice);
    let found = with_cutoff(&spec, &records, &tones).unwrap();
    for (i, [.., cutoff]) in list.into_iter().enumerate().skip(1) {
        let estimate = found.channels[i].cutoff.unwrap();
        assert!(
            (estimate.value - cutoff).abs() < 5.0 * estimate.sigma,
            "{i}: {estimate:?} instead of {cutoff}"
        );
        assert!(estimate.sigma < 1e-3);
    }
}

#[test]
fn what_complex_captures_do_not_tell_is_said() {
    let spec = interleaved();
    let mut dice = Random(6);
    let truth = with_errors(&spec, &[[0.0, 1.0, 0.25, 1.0]; 4]);
    let records = complex_tones(&truth, &[Hertz(-41e3)], 2048, 1e-4, &mut dice);
    let found = by_tones(&spec, &records, &[-41e3]).unwrap();
    let offsets = found.warnings.iter().find_map(|warning| match warning {
        CalibrationWarning::ComplexOffsets { offsets } => Some(offsets.clone()),
        _ => None,
    });
    assert!(offsets.unwrap().iter().flatten().all(|offset| (offset - 0.25).abs() < 1e-4));
    assert!(found.channels.iter().all(|channel| channel.offset.is_none()));
    let other = by_tones(&spec, &records, &[41e3]);
    assert!(matches!(other, Err(CalibrateError::OtherSign { .. })), "{other:?}");
    let blind = calibrate(&spec, &records, &CalibrationSignal::Any, CalibrationSettings::default());
    assert!(matches!(blind, Err(CalibrateError::ComplexSamples { complex: 4, records: 4 })));
    let mut mixed = records.clone();
    mixed[1].imaginary = None;
    assert!(matches!(by_tones(&spec, &mixed, &[-41e3]), Err(CalibrateError::ComplexSamples { .. })));
    let real = tones(&truth, &[Hertz(41e3)], 2048, 1e-4, &mut dice);
    assert!(matches!(by_tones(&spec, &real, &[-41e3]), Err(CalibrateError::NegativeTone { .. })));
}
