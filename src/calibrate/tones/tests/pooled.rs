//! Several acquisitions of the same converters, tones beyond half the fast rate, and quantised tones that
//! repeat.

use super::{SKEWS, by_tones, find, hertz};
use crate::calibrate::testbench::{
    assert_covers, errors, interleaved, random_errors, tones, trials, with_errors,
};
use crate::calibrate::{
    Acquisition, CalibrateError, Calibration, CalibrationSettings, CalibrationSignal, CalibrationWarning,
    Record, calibrate_pooled,
};
use crate::random::Random;
use crate::spec::Spec;
use crate::units::{FastPeriods, Hertz};

/// One tone for each acquisition.
const LIST: [f64; 6] = [41e3, 203e3, 97e3, 301e3, 166e3, 467e3];
const NAMES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

fn pooled(spec: &Spec, all: &[Vec<Record>], given: &[f64]) -> Result<Calibration, CalibrateError> {
    let all: Vec<Acquisition<'_>> =
        all.iter().zip(NAMES).map(|(records, name)| Acquisition { name, records }).collect();
    calibrate_pooled(spec, &all, &CalibrationSignal::Tones(hertz(given)), CalibrationSettings::default())
}

fn acquired(truth: &Spec, dice: &mut Random) -> Vec<Vec<Record>> {
    LIST.iter().map(|&tone| tones(truth, &[Hertz(tone)], 512, 1e-3, dice)).collect()
}

#[test]
fn intervals_of_pooled_acquisitions_are_narrower_and_cover() {
    let (spec, trials) = (interleaved(), trials(120));
    let (mut dice, mut scaled) = (Random(71), Vec::new());
    for trial in 0..trials {
        let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
        let all = acquired(&truth, &mut dice);
        let given = if trial % 2 == 0 { &LIST[..] } else { &[] };
        let found = pooled(&spec, &all, given).unwrap();
        assert_eq!((found.frames, found.tones.len()), (512 * LIST.len(), LIST.len()));
        scaled.extend(errors(&truth, &found).scaled);
        // The weights of independent estimates add up.
        let weight = |found: &Calibration| found.channels[2].delay.unwrap().sigma.0.powi(-2);
        let alone = all.iter().zip(LIST).map(|(one, tone)| by_tones(&spec, one, &[tone]).unwrap());
        let sum: f64 = alone.map(|found| weight(&found)).sum();
        let disagrees =
            found.warnings.iter().any(|warning| matches!(warning, CalibrationWarning::TonesDisagree { .. }));
        let widening = if disagrees { found.misfit.unwrap().powi(2) } else { 1.0 };
        assert!((weight(&found) * widening / sum - 1.0).abs() < 0.02, "{trial}");
    }
    assert_covers(&scaled, trials);
}

/// The acquisitions that contradict the others.
fn outlying(found: &Calibration) -> Vec<&str> {
    let named = found.warnings.iter().filter_map(|warning| match warning {
        CalibrationWarning::Outlying { name, .. } => Some(name.as_str()),
        _ => None,
    });
    named.collect()
}

#[test]
fn an_acquisition_that_contradicts_the_others_is_named() {
    let (spec, mut dice) = (interleaved(), Random(72));
    let shift = |delay: f64| [[0.0, 1.0, 0.0, 1.0], [delay, 1.0, 0.0, 1.0], [0.0; 4], [0.0; 4]];
    let with = |delay| with_errors(&spec, &shift(delay)[..2]);
    let mut all = acquired(&with(0.004), &mut dice);
    let agreeing = pooled(&spec, &all, &LIST).unwrap();
    assert!(outlying(&agreeing).is_empty(), "{agreeing:?}");
    all[3] = tones(&with(-0.03), &[Hertz(LIST[3])], 512, 1e-3, &mut dice);
    let found = pooled(&spec, &all, &LIST).unwrap();
    assert_eq!(outlying(&found), ["d"], "{:?}", found.warnings);
}

#[test]
fn faults_name_the_acquisition() {
    let (spec, mut dice) = (interleaved(), Random(73));
    let mut all = acquired(&spec, &mut dice);
    let nowhere = pooled(&spec, &all, &[&LIST[..], &[71e3]].concat()).unwrap_err();
    assert!(matches!(nowhere, CalibrateError::ToneNowhere { tone: Hertz(71e3), .. }), "{nowhere}");
    all[1].pop();
    let short = pooled(&spec, &all, &LIST).unwrap_err().to_string();
    assert!(short.starts_with("b: captures: 3, but channels in the spec: 4"), "{short}");
    let any = [Acquisition { name: "a", records: &all[0] }; 2];
    let waveform = CalibrationSignal::Waveform { samples: vec![0.0; 64], spacing: FastPeriods(1.0) };
    let refused = calibrate_pooled(&spec, &any, &waveform, CalibrationSettings::default()).unwrap_err();
    assert_eq!(refused, CalibrateError::NotPooled { acquisitions: 2 });
}

/// Four converters that sample an intermediate frequency in the third zone of the fast rate.
fn at_intermediate_frequency() -> Spec {
    let channels: String = (0..4).map(|i| format!("[[channel]]\ndelay_samples = {i}\n")).collect();
    let text = format!(
        "fast_rate = 1e6\nratio = 4\nlatency = 8\n[target]\n\
         filter = {{ family = \"butterworth\", order = 4, band = [1.05e6, 1.45e6] }}\n{channels}"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

#[test]
fn tones_are_found_in_the_zone_that_the_front_ends_pass() {
    let (spec, mut dice) = (at_intermediate_frequency(), Random(74));
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    for tone in [1.13e6, 1.21e6, 1.27e6, 1.39e6] {
        let records = tones(&truth, &[Hertz(tone)], 2048, 1e-4, &mut dice);
        find(&spec, &truth, &records, tone);
    }
}

/// The rounding of tones whose samples repeat is no noise, however many samples repeat.
#[test]
fn quantised_tones_that_repeat_do_not_contradict_each_other() {
    let (spec, mut dice) = (interleaved(), Random(75));
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    let step = 2f64.powi(-20);
    for repeats in [240.0, 600.0] {
        let list = [31.0, 53.0].map(|periods| Hertz(periods / repeats * 250e3));
        let mut records = tones(&truth, &list, 1 << 15, 0.0, &mut dice);
        for x in records.iter_mut().flat_map(|record| &mut record.samples) {
            *x = (*x / step).round() * step;
        }
        let found = by_tones(&spec, &records, &list.map(|tone| tone.0)).unwrap();
        assert!(found.misfit.unwrap() < 2.0, "{repeats}: {:?}", found.misfit);
        assert!(errors(&truth, &found).scaled.iter().all(|x| x.abs() < 5.0), "{repeats}");
    }
}
