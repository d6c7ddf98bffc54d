//! New values in the text of a spec file.

use super::*;
use crate::spec::filter::no_models;
use crate::units::{Decibels, FastPeriods};

fn calibrated(text: &str) -> Spec {
    let mut spec = read(text);
    spec.channels[0].delay = FastPeriods(1.234).in_seconds(spec.fast_period);
    spec.channels[1].delay = FastPeriods(0.1 + 0.2).in_seconds(spec.fast_period);
    spec.channels[1].gain = 1.01;
    spec.channels[1].offset = -1e-3;
    let half_width = FastPeriods(1e-5).in_seconds(spec.fast_period);
    spec.uncertainty = Some(UncertaintySpec {
        delay: Some(OneOrEach::Each(vec![Seconds(0.0), half_width])),
        reference: Some(1),
        ..spec.uncertainty.unwrap_or_default()
    });
    spec
}

#[test]
fn comments_and_layout_stay() {
    let text = THESIS.replace("delay = 1.2", "  delay = 1.2 # measured in spring");
    let edited = calibrated(&text).to_toml_like(&text, &no_models).unwrap();
    assert!(edited.contains("fast_period = 1.0          # h in seconds"), "{edited}");
    assert!(edited.contains("  delay = 1.234 # measured in spring\n"), "{edited}");
    assert!(edited.contains("delay = 0.30000000000000004\n"), "{edited}");
    assert!(edited.contains("gain = 1.01\noffset = -0.001\n"), "{edited}");
    assert!(edited.ends_with("\n[uncertainty]\ndelay = [0.0, 1e-5]\nreference = 1\n"), "{edited}");
    assert_eq!(read(&edited), calibrated(&text));
    // Again, over the table that is there now.
    let again = calibrated(&edited).to_toml_like(&edited, &no_models).unwrap();
    assert_eq!(again, edited);
}

#[test]
fn delays_keep_their_unit() {
    let text = thesis_with("fast_period = 1.0", "fast_rate = 48_000").replace("delay = ", "delay_samples = ");
    let edited = calibrated(&text).to_toml_like(&text, &no_models).unwrap();
    assert!(edited.contains("delay_samples = 1.234\n") && edited.contains("fast_rate = 48_000"), "{edited}");
    assert!(edited.contains("[uncertainty]\ndelay_samples = [0.0, "), "{edited}");
}

#[test]
fn inline_channels_and_filters_are_edited() {
    let text = "fast_period = 1.0\nratio = 2\nlatency = 10 # samples\n\
                target = { filter = { family = \"rc\", cutoff = 0.1 } }\n\
                uncertainty = { cutoff = 1e-3 }\nchannel = [{ delay = 1.2 }, { delay = 0.6, gain = 2 }]\n";
    let mut spec = calibrated(text);
    spec.channels[0].filter = spec.channels[0].filter.with_cutoff_scaled(1.25);
    spec.latency = Some(12);
    let edited = spec.to_toml_like(text, &no_models).unwrap();
    assert_eq!(read(&edited), spec);
    let parts =
        ["latency = 12 # samples\n", "cutoff = 0.125", "gain = 1.01, offset = -0.001 }", "cutoff = 0.001"];
    assert!(parts.iter().all(|part| edited.contains(part)), "{edited}");
}

#[test]
fn what_cannot_be_edited_is_written_anew() {
    let text = THESIS.replace("[[channel]]\ndelay = 1.2", "[[channel]]\n\"delay\" = 1.2");
    let spec = calibrated(&text);
    assert_eq!(read(&spec.to_toml_like(&text, &no_models).unwrap()), spec);
    assert_eq!(read(&spec.to_toml_like("nothing", &no_models).unwrap()), spec);
}

#[test]
fn measurements_stay_with_their_files() {
    let text = "fast_rate = \"96 kHz\"\nratio = 2\nlatency = 10\n\
                target = { filter = { family = \"rc\", cutoff = \"9 kHz\" } }\n\
                [[channel]]\ndelay_samples = 0\nfilter = { response = \"a.csv\", order = 2 }\n\
                [[channel]]\ndelay_samples = 1\nfilter = { response = \"b.csv\", order = 2 } # by lab 2\n";
    let filter = |order| FilterSpec::TransferFunction { num: vec![1.0], den: vec![1e-10, 1e-5 * order, 1.0] };
    let models = |wanted: &MeasuredFilter| {
        let order = if wanted.path == "a.csv" { 1.0 } else { 2.0 };
        Ok(FilterModel { filter: filter(order), error: Decibels(0.1) })
    };
    let read = |text: &str| Spec::from_toml_and_files(text, "", DesignOverrides::default(), &models).unwrap();
    let mut spec = read(text);
    spec.channels[1].delay = FastPeriods(1.01).in_seconds(spec.fast_period);
    let edited = spec.to_toml_like(text, &models).unwrap();
    let measured = "{ response = \"a.csv\", order = 2 }";
    for kept in ["fast_rate = \"96 kHz\"", measured, "# by lab 2\n", "delay_samples = 1.01"] {
        assert!(edited.contains(kept), "{kept}: {edited}");
    }
    // The errors of the models are added where the text is read.
    assert_eq!(read(&edited).uncertainty, read(text).uncertainty);
    // A measurement whose cut-off was fitted is a filter of its own.
    spec.channels[1].filter = spec.channels[1].filter.with_cutoff_scaled(1.01);
    let edited = spec.to_toml_like(text, &models).unwrap();
    assert!(edited.contains("a.csv") && !edited.contains("b.csv") && edited.contains("96 kHz"), "{edited}");
    let moved = with_measurements_renamed(text, |path| (path == "b.csv").then(|| "/lab \"2\"/b.csv".into()));
    let renamed = r#"filter = { response = '/lab "2"/b.csv', order = 2 } # by lab 2"#;
    assert!(moved.contains("\"a.csv\"") && moved.contains(renamed), "{moved}");
}
