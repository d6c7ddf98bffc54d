//! Complex captures.

use super::*;
use crate::calibrate::testbench::complex_tones;

#[test]
fn errors_are_at_the_bound_of_an_exponential_and_intervals_cover() {
    let (frames, trials) = (256, trials(150));
    let both_signs = &[41e3, -41e3, 301e3, -467e3, -718e3];
    BoundCampaign { tones: both_signs, frames, trials, capture: complex_tones, p: 1.0, least: 0.85 }
        .run(Random(15));
}

/// Signs and zones follow from the samples and the nominal delays.
#[test]
fn tones_of_both_signs_are_found() {
    let spec = interleaved();
    let mut dice = Random(4);
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    for tone in [41e3, -41e3, 203e3, -301e3, 467e3, -467e3] {
        let records = complex_tones(&truth, &[Hertz(tone)], 2048, 1e-4, &mut dice);
        let zone = (tone.abs() / 125e3) as usize + 1;
        assert_eq!(find(&spec, &truth, &records, tone).tones[0].zone, zone);
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
        let off = (estimate.value - cutoff).abs();
        assert!(off < 5.0 * estimate.sigma && estimate.sigma < 1e-3, "{i}: {estimate:?}, {cutoff}");
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
