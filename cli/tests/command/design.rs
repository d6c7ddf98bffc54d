//! The command `design`: what it reports, what it writes, and what overrides the spec.

mod integer_taps;
mod length;
mod order;
mod refusals;

use crate::support::{Desk, THESIS, number, text};
use serde_json::Value;

#[test]
fn a_design_is_reported_and_analysed() {
    let desk = Desk::with_spec(THESIS);
    let out = desk.good(&["design", "--prove", "spec.toml", "-o", "bank.json"]);
    let names: Vec<&str> = out.lines().map(|line| line.split("  ").next().unwrap_or_default()).collect();
    let heading = "bank.json: fir, 2 channels, ratio 2, 22 taps per channel, latency 10";
    assert_eq!(names[..2], [heading, "SNR"], "{out}");
    // The spec has no band, which is said in a line of its own.
    assert_eq!(out.lines().count(), 8, "{out}");
    let parts = ["\nsignal     without [signal]", "\ngamma      0.039932"];
    assert!(parts.iter().all(|part| out.contains(part)), "{out}");
    let all = desk.good(&["design", "--prove", "spec.toml", "-o", "bank.json", "--force", "--verbose"]);
    assert!(all.lines().count() > 11 && all.contains("\nnoncausal  "), "{all}");
    let bank = desk.read_json("bank.json");
    assert_eq!(bank["format"], "hybank-bank");
    assert_eq!(bank["channels"][0]["taps"].as_array().unwrap().len(), 22);
    let upper = number(&bank, "/gamma/upper");
    // The thesis example; digits from an independent conic solver on the bounded-real LMI.
    assert!((upper / 0.039_932_04 - 1.0).abs() < 1e-6, "{upper}");
    let norm = number(&bank, "/gamma/norm");
    assert!(norm <= upper && upper < norm * (1.0 + 1e-7), "{norm} {upper}");
    let analysis = desk.json(&["analyze", "bank.json", "--json"]);
    assert!((number(&analysis, "/gamma") / norm - 1.0).abs() < 1e-9, "{analysis}");
    let moved = desk.json(&["analyze", "bank.json", "--delay-error", "0,0.1", "--json"]);
    assert!((number(&moved, "/gamma") / 0.043_978 - 1.0).abs() < 0.02, "{moved}");
    assert!(desk.good(&["analyze", "bank.json"]).contains("noise gain"));
}

/// The signal below 0.18 of the output rate is within reach of both converters together, and of neither
/// alone.
#[test]
fn figures_in_the_terms_of_the_user_are_reported() {
    let spec = |delay: &str, table: &str| {
        format!(
            "fast_rate = 48000.0\nratio = 2\nlatency = 24\n{table}\n\
             target = {{ filter = {{ family = \"butterworth\", order = 2, cutoff = 20000.0 }} }}\n\
             channel = [{{ delay_samples = {delay} }}, {{ delay_samples = 0.1 }}]\n\
             design = {{ method = \"fir\", taps = 48 }}\n"
        )
    };
    let desk = Desk::with_spec(&spec("1.2", "signal = { band = \"16 kHz\" }"));
    let report = desk.json(&["design", "spec.toml", "-o", "b.json", "--json"]);
    let figures = &report["figures"];
    assert_eq!(figures["band"]["high_hertz"], 16000.0);
    let snr = number(figures, "/snr/total_db");
    assert!(snr > 90.0 && number(figures, "/image/db") < -80.0, "{figures}");
    assert!(number(figures, "/image/hertz") <= 16000.0 && number(figures, "/gain_error/db") < -80.0);
    assert!(number(figures, "/any_input") > 10.0 * number(&report, "/gamma/norm"), "{report}");
    assert_eq!(desk.json(&["analyze", "b.json", "--json"])["figures"], *figures);
    let out = desk.good(&["analyze", "b.json"]);
    assert!(out.contains("for white noise in 0 to 16 kHz") && out.contains("a cubic spline ("), "{out}");
    assert!(out.contains("least-squares taps of this length ("), "{out}");
    // Delays that are known to a third of a sample only.
    let vague = "signal = { band = \"6 kHz\" }\nuncertainty = { delay_samples = 0.3 }";
    desk.write("vague.toml", spec("1.2", vague));
    let out = desk.good(&["design", "vague.toml", "-o", "vague.json"]);
    let line = out.lines().find(|line| line.starts_with("compared")).unwrap();
    let parts = ["against channel 1 alone at best", ": this bank does not pay;"];
    assert!(parts.iter().all(|part| line.contains(part)), "{out}");
    assert!(out.lines().count() == 8 && out.contains("uncertain delays"), "{out}");
}

#[test]
fn a_bank_without_its_proof_is_the_same_bank() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "--prove", "spec.toml", "-o", "proven.json"]);
    let out = desk.good(&["design", "--no-proof", "spec.toml", "-o", "bank.json"]);
    assert!(out.contains("computed, not proven, as asked"), "{out}");
    let (bank, proven) = (desk.read_json("bank.json"), desk.read_json("proven.json"));
    assert!(bank["proof"].is_null() && proven["proof"].is_object());
    for key in ["channels", "latency", "method", "spec"] {
        assert_eq!(bank[key], proven[key], "{key}");
    }
    desk.refused(2, &["design", "spec.toml", "-o", "no.json", "--prove", "--no-proof"], &["--no-proof"]);
}

#[test]
fn the_command_line_overrides_the_spec() {
    let desk = Desk::with_spec(THESIS);
    let report = desk.json(&["design", "spec.toml", "-o", "iir.json", "--method", "iir", "--json"]);
    assert_eq!((&report["method"], &report["taps"]), (&Value::from("iir"), &Value::Null));
    let bank = desk.read_json("iir.json");
    assert!(bank["state_space"]["a"].is_array() && bank["channels"][0].get("taps").is_none());
    let report = desk.json(&["design", "spec.toml", "-o", "ten.json", "--taps", "10", "--json"]);
    // G3 of the golden numbers: ten taps are too few.
    assert!((number(&report, "/gamma/upper") / 0.093_452_5 - 1.0).abs() < 1e-5, "{report}");
    for method in ["h2", "sinc", "separation"] {
        let report =
            desk.json(&["design", "spec.toml", "-o", "x.json", "--force", "--method", method, "--json"]);
        assert!(number(&report, "/gamma/upper") >= number(&report, "/gamma/noncausal"), "{report}");
    }
}

#[test]
fn banks_flow_through_pipes() {
    let desk = Desk::with_spec(THESIS);
    let designed = desk.run(&["design", "spec.toml", "-o", "-"], &[]);
    assert!(designed.status.success());
    assert!(text(&designed.stderr).contains("gamma"), "the report goes to stderr");
    let output = desk.run(&["analyze", "-", "--json"], &designed.stdout);
    let analysis: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((number(&analysis, "/gamma") - 0.039_932_04).abs() < 1e-7, "{analysis}");
}

/// Delays that nearly coincide need large taps of opposite sign.
#[test]
fn a_large_noise_gain_is_warned_of_and_unresolved_delays_have_no_bounds() {
    let desk = Desk::with_spec(THESIS);
    let apart = |by: f64| THESIS.replace("delay = 1.2", &format!("delay = {:?}", 0.6 + by));
    let designed = |by: f64| {
        desk.write("near.toml", apart(by));
        let flags = ["--force", "--verbose", "--taps", "4", "--latency", "2"];
        let output = desk.run(&[&["design", "near.toml", "-o", "near.json"][..], &flags].concat(), &[]);
        assert!(output.status.success(), "{output:?}");
        (text(&output.stdout), text(&output.stderr))
    };
    let (_, message) = designed(1e-4);
    assert!(message.contains("warning: noise gain") && message.contains("rounding of f32"), "{message}");
    let (report, message) = designed(3e-12);
    // They are two instants, however near.
    let parts = ["channels 1 and 2 sample 3.0e-12", "noise gain"];
    assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    // A bound may still be proven, but none is computed.
    assert!(report.contains("proven     [") || report.contains("lower      unknown (two delays"), "{report}");
}
