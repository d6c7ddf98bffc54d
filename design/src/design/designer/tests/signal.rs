//! Designs with a `[signal]`, against the same filter written as a stage of every front end.

use crate::design::analyze;
use crate::design::designer::*;
use crate::tests::designed;
use hybank_verify::verify;

/// Two channels with different front ends and gains, in two ways: a signal, and W in cascade by hand.
fn both(w: &str, design: &str) -> [Spec; 2] {
    let filters = [
        "family = \"butterworth\", order = 3, cutoff = 0.4",
        "family = \"butterworth\", order = 2, cutoff = 0.5",
        "family = \"rc\", cutoff = 0.6",
    ];
    let text = |signal: &str, [target, first, second]: [String; 3]| {
        format!(
            "fast_period = 1.0\nratio = 2\nlatency = 9\n{signal}\ntarget = {{ filter = {target} }}\n\
             channel = [{{ delay = 1.2, filter = {first}, gain = 1.1 }}, {{ delay = 0.5, filter = {second} }}]\n\
             design = {{ {design} }}"
        )
    };
    let plain = filters.map(|filter| format!("{{ {filter} }}"));
    let shaped = filters.map(|filter| format!("{{ cascade = [{{ {w} }}, {{ {filter} }}] }}"));
    [text(&format!("signal = {{ filter = {{ {w} }} }}"), plain), text("", shaped)]
        .map(|text| Spec::from_toml(&text, "spec.toml").unwrap())
}

/// Odd and even orders: without and with a direct term.
const SIGNALS: [&str; 2] = [
    "family = \"elliptic\", order = 5, cutoff = 0.3, ripple_db = 1, attenuation_db = 50",
    "family = \"elliptic\", order = 4, cutoff = 0.25, ripple_db = 1, attenuation_db = 40",
];

#[test]
fn a_signal_is_a_stage_that_all_front_ends_share() {
    for w in SIGNALS {
        for method in ["method = \"fir\", taps = 16", "method = \"iir\"", "method = \"h2\""] {
            let [with_signal, by_hand] = both(w, method).map(|spec| designed(&spec));
            let norms = [&with_signal, &by_hand].map(|design| design.bank.gamma.norm.unwrap());
            assert!((norms[0] / norms[1] - 1.0).abs() < 2e-6, "{w} {method}: {norms:?}");
            // The bank of one way has the same error when the other way judges it.
            let mut other = with_signal.bank.clone();
            other.spec.as_mut().unwrap().signal = None;
            let spec = by_hand.bank.spec.as_ref().unwrap();
            let own = other.spec.as_mut().unwrap();
            (own.target, own.channels) = (spec.target.clone(), spec.channels.clone());
            let judged = analyze(&other, &[]).unwrap().gamma;
            assert!((judged / norms[0] - 1.0).abs() < 1e-7, "{w} {method}: {judged} {norms:?}");
        }
    }
}

#[test]
fn gammas_are_proven_relative_to_the_signal() {
    for w in SIGNALS {
        let [spec, _] = both(w, "method = \"fir\", taps = 16");
        let design = design(&spec, &DesignOptions::default()).unwrap();
        let proven = design.proof.unwrap();
        let gamma = design.bank.gamma;
        let norm = gamma.norm.unwrap();
        assert!(gamma.upper.unwrap() < norm * (1.0 + 1e-6), "{gamma:?}");
        assert!(proven.upper >= norm * (1.0 - 1e-9), "{proven:?} {norm}");
        assert!(gamma.lower.unwrap() > gamma.norm.unwrap() * (1.0 - 1e-5), "{w}: {gamma:?}");
        // Another spectrum, and the proof is worth nothing.
        let mut altered = design.bank;
        altered.spec.as_mut().unwrap().signal = None;
        assert!(verify::verify(&altered).is_err());
    }
}

/// The table of the theory: FIR banks of a band by the rule against banks without a signal.
#[test]
fn a_band_is_designed_for() {
    let spec = |signal: &str| {
        let text = format!(
            "fast_rate = \"48 kS/s\"\nratio = 2\nlatency = 12\n{signal}\n\
             target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = \"9 kHz\" }} }}\n\
             channel = [{{ delay = \"25 us\" }}, {{ delay = \"12.5 us\" }}]\ndesign = {{ method = \"fir\", taps = 24 }}"
        );
        Spec::from_toml(&text, "spec.toml").unwrap()
    };
    let gamma = |signal: &str| {
        let design = designed(&spec(signal));
        (design.bank.gamma.norm.unwrap(), design.bank.spec.unwrap().signal.map(|signal| signal.floor_db))
    };
    assert_eq!(gamma("").1, None);
    let (norm, floor) = gamma("signal = { band = \"8 kHz\" }");
    assert_eq!(floor, Some(Some(80.0)));
    assert!(norm < 1e-3 * gamma("").0, "{norm}");
}

/// Where the band limits a bank, a sharp W is better, if the noise does not limit it before; a floor that is
/// stated stays.
#[test]
fn a_band_that_limits_a_bank_has_a_sharp_filter() {
    let floor = |more: &str, bits: &str, method: &str| {
        let front = "{ family = \"butterworth\", order = 2, cutoff = 0.4167 }";
        let text = format!(
            "fast_rate = 1.0\nratio = 2\nlatency = 24\ntarget = {{ filter = {front} }}\n\
             signal = {{ band = 0.4167{more} }}\n\
             channel = [{{ delay = 1.2{bits} }}, {{ delay = 0.6{bits} }}]\ndesign = {{ {method} }}"
        );
        let bank = designed(&Spec::from_toml(&text, "spec.toml").unwrap()).bank;
        bank.spec.and_then(|spec| spec.signal?.floor_db).unwrap()
    };
    let fir = "method = \"fir\", taps = 48";
    assert!((110.0..120.0).contains(&floor("", "", fir)));
    assert!((110.0..120.0).contains(&floor("", ", bits = 16", fir)));
    assert_eq!(floor("", ", bits = 12", fir), 80.0);
    assert_eq!(floor(", floor_db = 80", "", fir), 80.0);
    assert_eq!(floor("", "", "method = \"h2\", taps = 48"), 80.0);
}
