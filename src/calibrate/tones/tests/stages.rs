//! Cut-offs of single stages of the front ends.

use crate::calibrate::testbench::{assert_covers, errors, tones, trials, with_errors};
use crate::calibrate::{
    CalibrateError, Calibration, CalibrationSettings, CalibrationSignal, CalibrationWarning, Cutoff,
    FittedValues, Record, applied, calibrate,
};
use crate::random::Random;
use crate::spec::{FilterSpec, Spec};
use crate::units::Hertz;

/// Tones in a band, up to four times its edge.
const LIST: [f64; 5] = [31e3, 97e3, 166e3, 301e3, 443e3];

/// Two converters behind filters that both have, each with the first-order pole of its switch.
fn switched() -> Spec {
    let stage = "{ family = \"butterworth\", order = 4, cutoff = 450e3 }";
    let filter = format!("filter = {{ cascade = [{stage}, {{ family = \"rc\", cutoff = 600e3 }}] }}\n");
    let channel = |i| format!("[[channel]]\ndelay_samples = {i}\n{filter}");
    let text =
        format!("fast_rate = 1e6\nratio = 2\nlatency = 8\n[target]\n{filter}{}{}", channel(0), channel(1));
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// `spec` with errors of delay and gain, and the pole of the second switch off by `factor`.
fn with_pole(spec: &Spec, dice: &mut Random, factor: f64) -> Spec {
    let mut part = |size: f64| size * dice.sample();
    let mut truth = with_errors(spec, &[[0.0, 1.0, 0.0, 1.0], [part(0.02), 1.0 + part(0.01), 0.0, 1.0]]);
    let channel = &mut truth.channels[1];
    channel.filter = channel.filter.with_stage_scaled(1, factor).unwrap();
    truth
}

fn fitted(spec: &Spec, records: &[Record], cutoff: Option<Cutoff>) -> Result<Calibration, CalibrateError> {
    let settings =
        CalibrationSettings { fit: FittedValues { cutoff, ..FittedValues::default() }, reference: 0 };
    calibrate(spec, records, &CalibrationSignal::Tones(LIST.map(Hertz).to_vec()), settings)
}

#[test]
fn the_cutoff_of_a_stage_is_found_and_written() {
    let (spec, trials) = (switched(), trials(60));
    let (mut dice, mut scaled) = (Random(81), Vec::new());
    for _ in 0..trials {
        let factor = 1.0 + 0.02 * dice.sample();
        let truth = with_pole(&spec, &mut dice, factor);
        let records = tones(&truth, &LIST.map(Hertz), 1024, 1e-4, &mut dice);
        let found = fitted(&spec, &records, Some(Cutoff::Stage(1))).unwrap();
        scaled.extend(errors(&truth, &found).scaled);
        let cutoff = found.channels[1].cutoff.unwrap();
        scaled.push((cutoff.value - factor) / cutoff.sigma);
        let (written, _) = applied(&spec, &found);
        let FilterSpec::Cascade { cascade } = &written.channels[1].filter else { panic!("{written:?}") };
        assert_eq!(cascade[0], spec.target.stages()[0]);
        assert_eq!(cascade[1], spec.target.stages()[1].with_cutoff_scaled(cutoff.value));
    }
    assert_covers(&scaled, trials);
}

/// Without its cut-off the delay takes what it can of the error, and the other tones contradict it. The
/// report says which stage explains that, and the interval reaches to the true delay.
#[test]
fn the_stage_that_explains_a_misfit_is_named() {
    let (spec, mut dice) = (switched(), Random(82));
    let truth = with_pole(&spec, &mut dice, 1.01);
    let records = tones(&truth, &LIST.map(Hertz), 8192, 1e-5, &mut dice);
    for cutoff in [None, Some(Cutoff::Whole), Some(Cutoff::Stage(0))] {
        let found = fitted(&spec, &records, cutoff).unwrap();
        let explained = found.warnings.iter().find_map(|warning| match warning {
            CalibrationWarning::CutoffExplains { fit, misfit } => Some((fit.cutoff, *misfit)),
            _ => None,
        });
        let (part, misfit) = explained.unwrap();
        assert!(part == Some(Cutoff::Stage(1)) && misfit < 2.0 && found.misfit.unwrap() > 10.0, "{found:?}");
        assert!(errors(&truth, &found).scaled.iter().all(|x| x.abs() < 3.0), "{cutoff:?} {found:?}");
        let shown = found.warnings.iter().map(ToString::to_string).collect::<String>();
        let parts = ["stage 2 of the filters", "gain,offset,cutoff:2"];
        assert!(parts.iter().all(|part| shown.contains(part)), "{shown}");
    }
    let found = fitted(&spec, &records, Some(Cutoff::Stage(1))).unwrap();
    assert!(found.misfit.unwrap() < 2.0, "{found:?}");
    assert!(found.warnings.iter().all(CalibrationWarning::is_note), "{found:?}");
}

#[test]
fn stages_that_are_not_there_are_refused() {
    let (spec, mut dice) = (switched(), Random(83));
    let records = tones(&spec, &LIST.map(Hertz), 1024, 1e-4, &mut dice);
    let refused = fitted(&spec, &records, Some(Cutoff::Stage(2))).unwrap_err();
    assert_eq!(refused, CalibrateError::NoSuchStage { channel: 1, stage: 3, stages: 2 });
}
