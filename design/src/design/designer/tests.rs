mod signal;

use super::*;
use crate::tests::{after_thesis_filter, designed};
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::Method;
use hybank_core::units::Seconds;

fn spec(design: &str, channels: &str) -> Spec {
    after_thesis_filter(2, 10, channels, design)
}

const THESIS: &str = "{ delay = 1.2 }, { delay = 0.6 }";

#[test]
fn a_spec_made_in_memory_is_checked_first() {
    let is_refused =
        |spec: &Spec| matches!(design(spec, &DesignOptions::default()), Err(DesignError::Spec(_)));
    // taps = 0 underflowed in `separation`.
    for method in [Method::Fir, Method::Sinc, Method::Separation] {
        let mut spec = spec("method = \"fir\", taps = 22", THESIS);
        (spec.design.method, spec.design.taps) = (method, Some(0));
        assert!(is_refused(&spec), "{}", method.name());
    }
    let mut ratio = spec("method = \"iir\"", THESIS);
    ratio.ratio = 0;
    let mut delay = spec("method = \"iir\"", THESIS);
    delay.channels[0].delay = Seconds(f64::NAN);
    assert!(is_refused(&ratio) && is_refused(&delay));
}

#[test]
fn taps_that_the_designer_chose_are_stated() {
    for method in ["sinc", "separation"] {
        let open = spec(&format!("method = \"{method}\""), THESIS);
        let found = designed(&open);
        assert_eq!((found.sizing.taps, found.sizing.taps_chosen), (23, true));
        // The bank says what was asked, and beside it what was chosen.
        assert_eq!(found.bank.spec, Some(open));
        let SynthesisFilters::Fir(taps) = &found.bank.filters else { unreachable!() };
        assert!(taps.iter().all(|filter| filter.len() == 23));
        // With nothing left to choose the bank is the same.
        let sized = found.bank.sized_spec().unwrap();
        let again = designed(&sized);
        assert!(!again.sizing.taps_chosen && !again.sizing.latency_chosen);
        assert_eq!(again.bank, Bank { spec: Some(sized), ..found.bank });
    }
    let recursive = designed(&spec("method = \"iir\"", THESIS));
    assert!(!recursive.sizing.taps_chosen && recursive.sizing.taps == 0);
}

#[test]
fn a_design_carries_its_proof_or_the_reason_why_there_is_none() {
    for method in ["method = \"fir\", taps = 22", "method = \"iir\"", "method = \"sinc\""] {
        let spec = spec(method, THESIS);
        let found = design(&spec, &DesignOptions::default()).unwrap();
        let proven = found.proof.unwrap();
        assert!(found.bank.proof.is_some());
        assert_eq!(found.bank.gamma.upper, Some(proven.upper));
        assert!(found.bank.gamma.norm.unwrap() < proven.upper, "{proven:?}");
        let skipped = designed(&spec);
        assert_eq!(skipped.proof, Err(DesignError::ProofSkipped));
        assert!(skipped.bank.proof.is_none() && skipped.bank.filters == found.bank.filters);
    }
}

#[test]
fn channels_that_are_alike_share_one_filter_by_their_noise() {
    let alone = spec("method = \"fir\", taps = 14", "{ delay = 1.2 }, { delay = 0.6 }");
    let twice = spec(
        "method = \"fir\", taps = 14",
        "{ delay = 1.2 }, { delay = 0.6, noise = 1e-9 }, { delay = 0.6, noise = 2e-9 }",
    );
    let taps = |spec: &Spec| match designed(spec).bank.filters {
        SynthesisFilters::Fir(taps) => taps,
        SynthesisFilters::StateSpace(_) => unreachable!(),
    };
    let (one, three) = (taps(&alone), taps(&twice));
    assert_eq!((one.len(), three.len()), (2, 3));
    for (quiet, loud) in three[1].iter().zip(&three[2]) {
        // Shares in inverse proportion to the powers, 4 : 1.
        assert!((quiet - 4.0 * loud).abs() <= 1e-15 + 1e-12 * quiet.abs(), "{quiet} {loud}");
    }
    let norm = |spec: &Spec| designed(spec).bank.gamma.norm.unwrap();
    assert!((norm(&alone) / norm(&twice) - 1.0).abs() < 2e-3);
}

/// Ended before the first round the exchange has that round's taps, and gamma-iteration its first filter: no
/// worse than half as good again, and between honest bounds.
#[test]
fn a_design_that_is_ended_has_its_best_bank_so_far() {
    for method in ["method = \"fir\", taps = 22", "method = \"iir\""] {
        let spec = spec(method, THESIS);
        let complete = designed(&spec).bank.gamma;
        let stop = Stop::default();
        let at_filters = |stage| {
            if stage == Stage::Filters {
                stop.now()
            }
        };
        let options = DesignOptions { observer: &at_filters, stop: stop.clone(), ..DesignOptions::default() };
        let ended = design(&spec, &options).unwrap();
        assert_eq!(ended.proof, Err(DesignError::Stopped));
        let (norm, least) = (ended.bank.gamma.norm.unwrap(), complete.norm.unwrap());
        assert!(norm >= least * (1.0 - 1e-6) && norm < 1.5 * least, "{method}: {norm} {least}");
        assert!(ended.bank.gamma.lower.unwrap() <= least, "{method}");
    }
}

#[test]
fn a_design_that_is_ended_before_it_has_a_bank_says_so() {
    let mut open = spec("method = \"fir\"", THESIS);
    open.latency = None;
    let options = DesignOptions::default();
    options.stop.now();
    let refused = design(&open, &options).unwrap_err();
    assert!(matches!(refused, DesignError::StoppedWithoutBank { .. }), "{refused}");
    assert!(refused.to_string().ends_with("use fewer taps, a smaller ratio or fewer channels"), "{refused}");
}

/// Every search ends when it is told to: those of the filters, of fewer states, of integers and of the
/// proof. The bank is whole, and no better than the complete one unless that gave up gamma for fewer states.
#[test]
fn a_design_ends_at_every_stage_with_a_bank() {
    let designs = [
        "method = \"fir\", taps = 22",
        "method = \"fir\", taps = 22, bits = 9",
        "method = \"iir\"",
        "method = \"iir\", order = 4",
        "method = \"iir\", reduction_loss_db = 0.5",
        "method = \"h2\"",
    ];
    for text in designs {
        let spec = spec(text, THESIS);
        let complete = designed(&spec).bank;
        for last in [Stage::Filters, Stage::Realisation, Stage::Proof] {
            let stop = Stop::default();
            let observer = |stage| {
                if stage == last {
                    stop.now()
                }
            };
            let options =
                DesignOptions { observer: &observer, stop: stop.clone(), ..DesignOptions::default() };
            let ended = design(&spec, &options).unwrap();
            assert_eq!(ended.proof, Err(DesignError::Stopped), "{text} {last}");
            assert_eq!(ended.bank.check(), Ok(()), "{text} {last}");
            let [norm, least] = [&ended.bank, &complete].map(|bank| bank.gamma.norm.unwrap());
            let may_be_better = ["h2", "loss"].iter().any(|word| text.contains(word));
            let is_worse = norm >= least * (1.0 - 1e-6);
            assert!(norm < 0.5 && (may_be_better || is_worse), "{text} {last}: {norm} {least}");
            if let (SynthesisFilters::StateSpace(block), true) = (&ended.bank.filters, text.contains("order"))
            {
                assert!(block.a.len() <= 4, "{text} {last}");
            }
        }
    }
}

#[test]
fn a_design_that_takes_longer_than_its_limit_is_ended() {
    let limit = Duration::from_secs(3);
    let spec = spec("method = \"fir\", taps = 22", THESIS);
    let late = |stage| {
        if stage == Stage::Filters {
            std::thread::sleep(limit);
        }
    };
    let options = DesignOptions { observer: &late, time_limit: Some(limit), ..DesignOptions::default() };
    assert_eq!(design(&spec, &options).unwrap().proof, Err(DesignError::Stopped));
    let unlimited = DesignOptions { time_limit: None, ..DesignOptions::default() };
    assert!(design(&spec, &unlimited).unwrap().proof.is_ok());
}

/// Other units of the converters' samples and of the output change no relative figure, whether the error is
/// as large as the target or a small difference.
#[test]
fn the_stated_accuracy_does_not_depend_on_units() {
    // The slow rate is all but enough for the second target.
    for (numerator, denominator) in [(0.25, "[1.0, 1.0, 0.25]"), (1.0, "[4e11, 1.2e6, 1.0]")] {
        let figures = |input: f64, output: f64| {
            let filter = |gain: f64| format!("{{ num = [{:e}], den = {denominator} }}", numerator * gain);
            let channel = |delay: f64| format!("{{ delay = {delay}, filter = {} }}", filter(input));
            let text = format!(
                "fast_period = 1.0\nratio = 2\nlatency = 4\ntarget = {{ filter = {} }}\n\
                 channel = [{}, {}]\ndesign = {{ method = \"iir\" }}",
                filter(output),
                channel(1.2),
                channel(0.6),
            );
            let gamma = designed(&Spec::from_toml(&text, "spec.toml").unwrap()).bank.gamma;
            (gamma.norm.unwrap() / output, gamma.upper.unwrap() / gamma.norm.unwrap())
        };
        let plain = figures(1.0, 1.0);
        for (input, output) in [(1e-9, 1.0), (1e9, 1.0), (1.0, 1e6), (1.0, 1e9), (1.0, 1e-9), (1e9, 1e-9)] {
            let scaled = figures(input, output);
            println!("{input:e} {output:e}: {scaled:?} {plain:?}");
            assert!((scaled.0 / plain.0 - 1.0).abs() < plain.1 - 1.0 + 1e-9, "{scaled:?} {plain:?}");
            assert!(((scaled.1 - 1.0) / (plain.1 - 1.0) - 1.0).abs() < 0.01, "{scaled:?} {plain:?}");
        }
    }
}
