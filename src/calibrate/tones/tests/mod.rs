//! Tones against closed forms: the bound in every zone, coverage, and every trap.

mod complex;
mod intervals;
mod pooled;
mod stages;

use crate::calibrate::testbench::{
    assert_covers, errors, gaussian, interleaved, random_errors, tones, trials, with_errors,
};
use crate::calibrate::{
    CalibrateError, Calibration, CalibrationSettings, CalibrationSignal, CalibrationWarning, Cutoff,
    FittedValues, Record, calibrate,
};
use crate::random::Random;
use crate::spec::Spec;
use crate::units::Hertz;
use std::f64::consts::TAU;

const SKEWS: [f64; 4] = [0.01, 0.01, 0.002, 0.0];

fn by_tones(spec: &Spec, records: &[Record], given: &[f64]) -> Result<Calibration, CalibrateError> {
    calibrate(spec, records, &CalibrationSignal::Tones(hertz(given)), CalibrationSettings::default())
}

fn with_cutoff(spec: &Spec, records: &[Record], given: &[f64]) -> Result<Calibration, CalibrateError> {
    let fit = FittedValues { cutoff: Some(Cutoff::Whole), ..FittedValues::default() };
    let settings = CalibrationSettings { fit, reference: 0 };
    calibrate(spec, records, &CalibrationSignal::Tones(hertz(given)), settings)
}

fn hertz(list: &[f64]) -> Vec<Hertz> {
    list.iter().map(|&f| Hertz(f)).collect()
}

/// Captures of tones of which the error is compared with its bound.
struct BoundCampaign {
    tones: &'static [f64],
    frames: usize,
    trials: usize,
    capture: fn(&Spec, &[Hertz], usize, f64, &mut Random) -> Vec<Record>,
    /// Of the Cramer-Rao bound sqrt(p / (N SNR)) / w.
    p: f64,
    /// The rms error is at least this share of the bound.
    least: f64,
}

impl BoundCampaign {
    /// The rms error of the delays is that of the bound for every tone, and the intervals hold the truth.
    fn run(&self, mut dice: Random) {
        let (spec, noise, mut scaled) = (interleaved(), 1e-3, Vec::new());
        for &tone in self.tones {
            let mut squares = Vec::new();
            for _ in 0..self.trials {
                let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
                let records = (self.capture)(&truth, &[Hertz(tone)], self.frames, noise, &mut dice);
                let found = by_tones(&spec, &records, &[tone]).unwrap();
                let errors = errors(&truth, &found);
                squares.extend(errors.delays.iter().map(|error| error * error));
                scaled.extend(errors.scaled);
            }
            let w = TAU * tone.abs() * 1e-6;
            let amplitude = 1.0 / 1f64.hypot(tone / 2e6);
            let snr = amplitude * amplitude / (2.0 * noise * noise);
            let bound = (self.p / (self.frames as f64 * snr)).sqrt() / w;
            let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
            println!("{tone} Hz: rms error over bound {:.3}", rms / bound);
            assert!(rms < 1.1 * bound, "{tone} Hz: {rms:e} fast periods, bound {bound:e}");
            assert!(rms > self.least * bound, "{tone} Hz: {rms:e} is below the bound {bound:e}");
        }
        assert_covers(&scaled, self.trials);
    }
}

#[test]
fn errors_are_at_the_bound_in_every_zone_and_intervals_cover() {
    // 250 kHz per converter: zones of 125 kHz, the last two above half the fast rate.
    let tones_of_zones = &[41e3, 203e3, 301e3, 467e3, 533e3, 718e3];
    let (frames, trials) = (512, trials(250));
    BoundCampaign { tones: tones_of_zones, frames, trials, capture: tones, p: 2.0, least: 0.8 }
        .run(Random(14));
}

/// The tone is found without its frequency, and so are the delays.
fn find(spec: &Spec, truth: &Spec, records: &[Record], tone: f64) -> Calibration {
    let found = by_tones(spec, records, &[]).unwrap();
    assert!((found.tones[0].frequency.value.0 - tone).abs() < 0.1, "{tone}: {:?}", found.tones);
    assert!(errors(truth, &found).delays.iter().all(|error| error.abs() < 1e-3), "{tone}");
    found
}

#[test]
fn zones_are_found_from_nominal_delays_and_refused_where_they_are_not_clear() {
    let spec = interleaved();
    let mut dice = Random(3);
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    for tone in [41e3, 203e3, 301e3, 467e3] {
        let records = tones(&truth, &[Hertz(tone)], 2048, 1e-4, &mut dice);
        assert_eq!(find(&spec, &truth, &records, tone).tones[0].zone, (tone / 125e3) as usize + 1);
    }
    // Delays in the middle between two zones' phases.
    let lost = with_errors(&spec, &[0.0, 0.9, -0.8, 1.3].map(|delay| [delay, 1.0, 0.0, 1.0]));
    let records = tones(&lost, &[Hertz(301e3)], 2048, 1e-4, &mut dice);
    assert!(matches!(by_tones(&spec, &records, &[]), Err(CalibrateError::AmbiguousZone { .. })));
}

#[test]
fn three_tones_give_the_cutoff_and_fewer_are_refused() {
    let spec = interleaved();
    let (mut dice, mut scaled, mut squares) = (Random(8), Vec::new(), Vec::new());
    let list = [61e3, 203e3, 341e3, 467e3];
    let trials = trials(100);
    for _ in 0..trials {
        let mut shifts = random_errors(&mut dice, 4, [0.01, 0.01, 0.002, 0.01]);
        shifts[0][3] = 1.0;
        let truth = with_errors(&spec, &shifts);
        let records = tones(&truth, &hertz(&list), 1024, 1e-4, &mut dice);
        let found = with_cutoff(&spec, &records, &list).unwrap();
        for (estimate, shift) in found.channels.iter().zip(&shifts).skip(1) {
            let cutoff = estimate.cutoff.unwrap();
            scaled.push((cutoff.value - shift[3]) / cutoff.sigma);
            squares.push(cutoff.sigma);
        }
        scaled.extend(errors(&truth, &found).scaled);
        assert!(found.misfit.is_some_and(|misfit| misfit < 2.0), "{:?}", found.misfit);
    }
    assert!(squares.iter().all(|sigma| *sigma < 2e-3), "{squares:?}");
    assert_covers(&scaled, trials);
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    let records = tones(&truth, &hertz(&list[..2]), 1024, 1e-4, &mut dice);
    let refused = with_cutoff(&spec, &records, &list[..2]).unwrap_err();
    assert_eq!(refused, CalibrateError::TooFewTones { tones: 2 });
}

#[test]
fn a_cutoff_that_looks_like_a_delay_is_refused() {
    // Far below the cut-off of 2 MHz only the delay of the front end is seen.
    let (spec, mut dice) = (interleaved(), Random(5));
    let list = [3e3, 7e3, 11e3];
    let records = tones(&spec, &hertz(&list), 4096, 1e-3, &mut dice);
    let refused = with_cutoff(&spec, &records, &list).unwrap_err();
    assert!(
        matches!(refused, CalibrateError::CutoffLooksLikeDelay { .. } | CalibrateError::NotIdentifiable),
        "{refused}"
    );
}

#[test]
fn a_cutoff_error_that_is_not_fitted_is_noted_and_widens_the_intervals() {
    let (spec, mut dice) = (interleaved(), Random(6));
    let truth = with_errors(&spec, &[1.0, 1.05, 1.0, 1.0].map(|cutoff| [0.0, 1.0, 0.0, cutoff]));
    let list = [61e3, 203e3, 467e3];
    let records = tones(&truth, &hertz(&list), 2048, 1e-4, &mut dice);
    let found = by_tones(&spec, &records, &list).unwrap();
    let disagrees = |r: &_| matches!(r, CalibrationWarning::TonesDisagree { misfit } if *misfit > 3.0);
    assert!(found.warnings.iter().any(disagrees), "{found:?}");
    // One per cent of the cut-off is about 0.01 / (2 pi 2 MHz) = 0.8 ns of delay.
    let assumed = found.warnings.iter().find_map(|r| match r {
        CalibrationWarning::CutoffAssumed { delay } => Some(delay.0),
        _ => None,
    });
    assert!(assumed.is_some_and(|delay| (6e-4..9e-4).contains(&delay)), "{assumed:?}");
}

#[test]
fn tones_at_half_the_slow_rate_are_refused() {
    let (spec, mut dice) = (interleaved(), Random(7));
    let records = tones(&spec, &[Hertz(40e3)], 1024, 1e-3, &mut dice);
    for tone in [0.0, 125e3, 250e3, 375.1e3] {
        let refused = by_tones(&spec, &records, &[tone]).unwrap_err();
        assert!(matches!(refused, CalibrateError::TonePosition { .. }), "{tone}: {refused}");
    }
}

#[test]
fn harmonics_on_the_tone_and_few_phases_are_noted() {
    let (spec, mut dice) = (interleaved(), Random(9));
    let warnings = |tone: f64, dice: &mut Random| {
        let records = tones(&spec, &[Hertz(tone)], 2000, 1e-4, dice);
        by_tones(&spec, &records, &[tone]).unwrap().warnings
    };
    let harmonic = |warnings: &[CalibrationWarning]| {
        warnings.iter().find_map(|r| {
            if let CalibrationWarning::HarmonicOnTone { order, .. } = r { Some(*order) } else { None }
        })
    };
    // A quarter and a third of the slow rate of 250 kHz.
    assert_eq!(harmonic(&warnings(62.5e3, &mut dice)), Some(3));
    assert_eq!(harmonic(&warnings(250e3 / 3.0, &mut dice)), Some(2));
    assert_eq!(harmonic(&warnings(47.11e3, &mut dice)), None);
    let few = warnings(250e3 * 7.0 / 25.0, &mut dice);
    assert!(few.iter().any(|r| matches!(r, CalibrationWarning::FewPhases { phases: 25, .. })), "{few:?}");
}

/// Quantisation to 8 bits of a tone with 25 phases errs by the same amount however long the record is: the
/// intervals say so.
#[test]
fn more_tones_than_are_looked_for_are_named() {
    let spec = interleaved();
    let comb: Vec<f64> = (0..20).map(|k| 7_130.0 + 19_370.0 * f64::from(k)).collect();
    for (count, is_named) in [(20, true), (6, false)] {
        let records = tones(&spec, &hertz(&comb[..count]), 8192, 1e-6, &mut Random(5));
        let found = by_tones(&spec, &records, &[]).unwrap();
        let named = |warning: &_| matches!(warning, CalibrationWarning::MoreTones { most: 16 });
        assert_eq!(found.warnings.iter().any(named), is_named, "{count} tones: {:?}", found.warnings);
    }
}

#[test]
fn intervals_cover_where_quantisation_repeats() {
    let spec = interleaved();
    let (mut dice, mut scaled, tone) = (Random(11), Vec::new(), 250e3 * 7.0 / 25.0);
    for _ in 0..150 {
        let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
        let mut records = tones(&truth, &[Hertz(tone)], 4000, 0.0, &mut dice);
        for record in &mut records {
            record.samples.iter_mut().for_each(|x| *x = (*x * 128.0).round() / 128.0);
        }
        let found = by_tones(&spec, &records, &[tone]).unwrap();
        let delays = found.channels.iter().skip(1).filter_map(|c| c.delay).map(|d| d.sigma.0);
        scaled.extend(errors(&truth, &found).delays.iter().zip(delays).map(|(error, sigma)| error / sigma));
    }
    let inside = scaled.iter().filter(|x| x.abs() < 1.96).count() as f64 / scaled.len() as f64;
    assert!(inside > 0.9, "{inside}");
    // Without the widening nearly none would.
    let narrow = scaled.iter().filter(|x| x.abs() < 1.96 / 8.0).count() as f64 / scaled.len() as f64;
    assert!(narrow < 0.4, "{narrow}");
}

#[test]
fn a_delay_beyond_the_period_of_a_tone_is_found_by_a_lower_one() {
    let (spec, mut dice) = (interleaved(), Random(12));
    let truth = with_errors(&spec, &[0.0, 0.7, 0.0, 0.0].map(|delay| [delay, 1.0, 0.0, 1.0]));
    // 1.06 MHz has a period of 0.94 fast periods: 0.7 looks like -0.24.
    let one = tones(&truth, &[Hertz(1.06e6)], 2048, 1e-4, &mut dice);
    let found = by_tones(&spec, &one, &[1.06e6]).unwrap();
    let delay = |found: &Calibration| found.channels[1].delay.unwrap().value.0;
    assert!((delay(&found) - (1.7 - 1.0 / 1.06)).abs() < 1e-3, "{}", delay(&found));
    assert!(found.modulus.is_some_and(|m| (m.0 - 1.0 / 1.06).abs() < 1e-6));
    let is_modulo = |r: &_| matches!(r, CalibrationWarning::DelayModulo { channel: 2, .. });
    assert!(found.warnings.iter().any(is_modulo), "{found:?}");
    let two = tones(&truth, &hertz(&[1.06e6, 101e3]), 2048, 1e-4, &mut dice);
    let found = by_tones(&spec, &two, &[1.06e6, 101e3]).unwrap();
    assert!((delay(&found) - 1.7).abs() < 1e-3, "{}", delay(&found));
}

/// Noise has a largest line somewhere, and it says nothing of a delay: red noise on a grid of a tenth of a
/// fast period.
#[test]
fn captures_without_tones_are_refused() {
    let spec = interleaved();
    for seed in 0..6 {
        let mut dice = Random(seed);
        let mut level = 0.0;
        let wave: Vec<f64> = (0..41 * 4096)
            .map(|_| {
                level = 0.995 * level + gaussian(&mut dice);
                level
            })
            .collect();
        let of_channel = |i: usize| (1..4096).map(|k| wave[40 * k - 10 * i]).collect::<Vec<_>>();
        let records: Vec<Record> = (0..4).map(|i| Record::new(of_channel(i))).collect();
        let found = by_tones(&spec, &records, &[]);
        assert!(found.is_err(), "{seed}: {:?}", found.map(|found| found.channels));
    }
}

#[test]
fn swapped_and_repeated_captures_are_refused() {
    let (spec, mut dice) = (interleaved(), Random(13));
    let mut records = tones(&spec, &[Hertz(203e3)], 2048, 1e-4, &mut dice);
    records.swap(1, 2);
    let order = vec![1, 3, 2, 4];
    assert_eq!(by_tones(&spec, &records, &[203e3]).unwrap_err(), CalibrateError::WrongOrder { order });
    records[3] = records[0].clone();
    let repeated = CalibrateError::Repeated { first: 1, second: 4 };
    assert_eq!(by_tones(&spec, &records, &[203e3]).unwrap_err(), repeated);
}

#[test]
fn clipped_samples_are_left_out_and_counted() {
    let (spec, mut dice) = (interleaved(), Random(15));
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    let records = tones(&truth, &[Hertz(203e3)], 4096, 1e-4, &mut dice);
    let clip = |record: Record| {
        let samples = record.samples.iter().map(|x| x.clamp(-0.9, 0.9)).collect();
        Record::within(samples, -0.9, 0.9)
    };
    let records: Vec<Record> = records.into_iter().map(clip).collect();
    let found = by_tones(&spec, &records, &[203e3]).unwrap();
    assert!(found.clipped.iter().all(|count| (800..1600).contains(count)), "{:?}", found.clipped);
    let scaled = errors(&truth, &found).scaled;
    assert!(scaled.iter().all(|x| x.abs() < 5.0), "{scaled:?}");
}

#[test]
fn the_reference_keeps_the_values_of_the_spec() {
    let (spec, mut dice) = (interleaved(), Random(16));
    let truth = with_errors(&spec, &random_errors(&mut dice, 4, SKEWS));
    let records = tones(&truth, &[Hertz(203e3)], 2048, 1e-4, &mut dice);
    let settings = CalibrationSettings { reference: 2, ..CalibrationSettings::default() };
    let found = calibrate(&spec, &records, &CalibrationSignal::Tones(vec![Hertz(203e3)]), settings).unwrap();
    assert_eq!((found.channels[2].delay, found.channels[2].gain), (None, None));
    assert!(errors(&truth, &found).scaled.iter().all(|x| x.abs() < 5.0));
    let fit = FittedValues { delay: false, offset: false, ..FittedValues::default() };
    let only_gain = CalibrationSettings { fit, reference: 0 };
    let found = calibrate(&spec, &records, &CalibrationSignal::Tones(vec![Hertz(203e3)]), only_gain).unwrap();
    assert!(found.channels.iter().all(|c| c.delay.is_none() && c.offset.is_none()));
}
