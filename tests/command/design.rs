//! The verbs design, analyze, simulate, demo and completions, as a user runs them.

use crate::support::{THESIS, names, text};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder with spec.toml in it.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let desk = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(desk.path("spec.toml"), THESIS).unwrap();
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hybank"));
        command.current_dir(self.folder.path()).args(args);
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Runs, wants success without a word on stderr, and gives stdout.
    fn good(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert!(output.status.success(), "{args:?}: {output:?}");
        assert_eq!(text(&output.stderr), "", "{args:?}");
        text(&output.stdout)
    }

    /// As `good`, with one JSON object on stdout and nothing else.
    fn json(&self, args: &[&str]) -> Value {
        let out = self.good(args);
        assert_eq!(out.trim_end().lines().count(), 1, "{out}");
        let value: Value = serde_json::from_str(&out).unwrap();
        assert!(value.is_object(), "{out}");
        value
    }

    /// Runs and wants exit code `code`, nothing on stdout, a message with all of `parts`, and no new file.
    fn refused(&self, code: i32, args: &[&str], parts: &[&str]) {
        let before = names(self.folder.path());
        let output = self.run(args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert_eq!(text(&output.stdout), "", "{args:?}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert!(message.contains(part), "`{part}` is missing in: {message}");
        }
        if code == 1 {
            assert_eq!(message.matches("hybank: ").count(), 1, "one message only: {message}");
        }
        assert_eq!(names(self.folder.path()), before, "{args:?}");
    }

    /// Designs a changed spec and wants it refused.
    fn bad_spec(&self, from: &str, to: &str, parts: &[&str]) {
        assert!(THESIS.contains(from));
        fs::write(self.path("bad.toml"), THESIS.replacen(from, to, 1)).unwrap();
        self.refused(1, &["design", "bad.toml", "-o", "out.json"], parts);
    }
}

fn wav(path: &Path) -> (u32, Vec<f64>) {
    let mut reader = hound::WavReader::open(path).unwrap();
    let samples = reader.samples::<f32>().map(|x| f64::from(x.unwrap())).collect();
    (reader.spec().sample_rate, samples)
}

/// 20 log10 of target over error, over samples `skip` .. end - `skip`.
fn snr_db(got: &[f64], target: &[f64], skip: usize) -> f64 {
    assert_eq!(got.len(), target.len());
    let judged = skip..target.len() - skip;
    let signal: f64 = judged.clone().map(|n| target[n].powi(2)).sum();
    let error: f64 = judged.map(|n| (got[n] - target[n]).powi(2)).sum();
    10.0 * (signal / error).log10()
}

fn number(value: &Value, path: &str) -> f64 {
    value.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} is no number in {value}"))
}

#[test]
fn a_design_is_reported_and_analysed() {
    let desk = Desk::new();
    let out = desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    for part in
        ["bank.json: fir, 2 channels, ratio 2, 22 taps per channel, latency 10", "gamma      0.039932"]
    {
        assert!(out.contains(part), "{out}");
    }
    let bank: Value = serde_json::from_str(&fs::read_to_string(desk.path("bank.json")).unwrap()).unwrap();
    assert_eq!(bank["format"], "hybank-bank");
    assert_eq!(bank["channels"][0]["taps"].as_array().unwrap().len(), 22);
    let upper = number(&bank, "/gamma/upper");
    // The thesis example; digits from an independent conic solver on the bounded-real LMI.
    assert!((upper / 0.039_932_04 - 1.0).abs() < 1e-6, "{upper}");
    let norm = number(&bank, "/gamma/norm");
    assert!(norm <= upper && upper < norm * (1.0 + 1e-7), "{norm} {upper}");
    let analysis = desk.json(&["analyze", "bank.json", "--certify", "--json"]);
    assert!((number(&analysis, "/gamma") / norm - 1.0).abs() < 1e-9, "{analysis}");
    assert!(number(&analysis, "/certified/gamma") >= norm, "{analysis}");
    let moved = desk.json(&["analyze", "bank.json", "--delay-error", "0,0.1", "--json"]);
    assert!((number(&moved, "/gamma") / 0.043_978 - 1.0).abs() < 0.02, "{moved}");
    assert!(desk.good(&["analyze", "bank.json"]).contains("noise gain"));
}

#[test]
fn the_order_is_reduced_reported_and_proven() {
    let desk = Desk::new();
    let iir = THESIS
        .replace("latency = 10", "latency = 4")
        .replace("method = \"fir\"\ntaps = 22", "method = \"iir\"");
    fs::write(desk.path("iir.toml"), &iir).unwrap();
    let report = desk.json(&["design", "iir.toml", "-o", "two.json", "--order", "2", "--json"]);
    assert_eq!((&report["states"], &report["reduction"]["reduced"]["order"]), (&2.into(), &2.into()));
    let (full, order) =
        (number(&report, "/reduction/full/order"), number(&report, "/reduction/reduced/order"));
    assert_eq!(report["reduction"]["orders"].as_array().unwrap().len() as f64, full + 1.0);
    let ratio = number(&report, "/gamma/upper") / number(&report, "/reduction/full/gamma");
    let loss = number(&report, "/reduction/reduced/loss_db");
    assert!(order < full && (20.0 * ratio.log10() - loss).abs() < 1e-6, "{report}");
    assert!(number(&report, "/proven/upper") >= number(&report, "/gamma/upper"), "{report}");
    let proof = desk.json(&["verify", "two.json", "--json"]);
    assert!((number(&proof, "/upper") / number(&report, "/gamma/upper") - 1.0).abs() < 1e-5, "{proof}");
    let bank: Value = serde_json::from_str(&fs::read_to_string(desk.path("two.json")).unwrap()).unwrap();
    assert_eq!(bank["spec"]["design"]["order"], 2);

    // In the file, the loss; on the command line, something else in its place.
    fs::write(desk.path("loss.toml"), format!("{iir}reduction_loss_db = 6\n")).unwrap();
    let text = desk.good(&["design", "loss.toml", "-o", "loss.json"]);
    assert!(text.contains("dB of gamma lost") && text.contains("states          gamma"), "{text}");
    let report = desk.json(&["design", "loss.toml", "-o", "one.json", "--order", "1", "--json"]);
    assert_eq!(report["states"], 1);
    // A method without states drops it with the method that it belongs to.
    desk.good(&["design", "loss.toml", "-o", "fir.json", "--method", "fir", "--taps", "8"]);
}

#[test]
fn orders_that_mean_nothing_are_refused() {
    let desk = Desk::new();
    for (line, parts) in [
        (
            "order = 4",
            [
                "design.order",
                "order has no meaning for the method fir; remove it or choose the method iir or h2",
            ],
        ),
        ("reduction_loss_db = 1", ["design.reduction_loss_db", "has no meaning for the method fir"]),
        ("order = -1", ["design.order", "zero or more"]),
        ("order = 2.5", ["design.order", "whole number"]),
        ("order = 100000", ["design.order", "0 to 65536"]),
        ("reduction_loss_db = -0.5", ["design.reduction_loss_db", "0 to 400 dB"]),
        ("reduction_loss_db = nan", ["design.reduction_loss_db", "finite"]),
        (
            "order = 4\nreduction_loss_db = 1",
            ["both order and reduction_loss_db are given", "keep one of them"],
        ),
        ("ordre = 4", ["ordre", "did you mean \"order\"?"]),
    ] {
        desk.bad_spec("taps = 22", &format!("taps = 22\n{line}"), &parts);
    }
    let design = ["design", "spec.toml", "-o", "x.json"];
    desk.refused(1, &[&design[..], &["--order", "3"]].concat(), &["order has no meaning for the method fir"]);
    let iir = [&design[..], &["--method", "iir"]].concat();
    desk.refused(1, &[&iir[..], &["--order", "100000"]].concat(), &["100000 states", "0 to 65536"]);
    desk.refused(1, &[&iir[..], &["--reduction-loss-db=-1"]].concat(), &["-1 dB", "0 to 400 dB"]);
    desk.refused(2, &[&iir[..], &["--order", "x"]].concat(), &["--order"]);
    desk.refused(
        2,
        &[&iir[..], &["--order", "3", "--reduction-loss-db", "1"]].concat(),
        &["cannot be used with"],
    );
}

#[test]
fn the_command_line_overrides_the_spec() {
    let desk = Desk::new();
    let report = desk.json(&["design", "spec.toml", "-o", "iir.json", "--method", "iir", "--json"]);
    assert_eq!((&report["method"], &report["taps"]), (&Value::from("iir"), &Value::Null));
    let bank: Value = serde_json::from_str(&fs::read_to_string(desk.path("iir.json")).unwrap()).unwrap();
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
fn integer_taps_are_designed_proven_and_run() {
    let desk = Desk::new();
    let report = desk.json(&["design", "spec.toml", "-o", "bank.json", "--bits", "6", "--json"]);
    let bank: Value = serde_json::from_str(&fs::read_to_string(desk.path("bank.json")).unwrap()).unwrap();
    let step = (-number(&report, "/words/fraction_bits")).exp2();
    for (channel, integers) in
        bank["channels"].as_array().unwrap().iter().zip(bank["fixed_point"]["integers"].as_array().unwrap())
    {
        let (taps, integers) = (channel["taps"].as_array().unwrap(), integers.as_array().unwrap());
        assert_eq!((taps.len(), integers.len()), (22, 22));
        for (tap, integer) in taps.iter().zip(integers) {
            let integer = integer.as_i64().unwrap();
            assert!((-32..32).contains(&integer));
            assert_eq!(tap.as_f64().unwrap(), integer as f64 * step);
        }
    }
    // The golden gamma of the real taps is 0.0399320; rounding costs 1.6 dB.
    assert!(number(&report, "/gamma/upper") < 0.0399320 * 1.001);
    assert!((number(&report, "/gamma/lower") - 0.0399320).abs() < 1e-7);
    let losses = report["words"]["words"].as_array().unwrap();
    assert_eq!(losses.len(), 5);
    assert!(number(&losses[2], "/rounded_loss_db") > 1.0 && number(&losses[2], "/loss_db") < 0.01);
    let proven = desk.json(&["verify", "bank.json", "--json"]);
    assert!(number(&proven, "/upper") <= number(&report, "/gamma/upper") * (1.0 + 1e-6));
    assert!(desk.good(&["verify", "bank.json"]).contains("integers of 6 bits"));
    assert!(desk.good(&["analyze", "bank.json"]).contains("gamma"));

    // A list of bits, a scale, and a spec that says so.
    let list = (0..22).map(|n| if n < 11 { "10" } else { "4" }).collect::<Vec<_>>().join(",");
    desk.good(&["design", "spec.toml", "-o", "list.json", "--bits", &list, "--fraction-bits", "8"]);
    let toml = THESIS.replace("taps = 22", "taps = 22\nbits = 10\nfraction_bits = 9");
    fs::write(desk.path("fixed.toml"), toml).unwrap();
    let report = desk.json(&["design", "fixed.toml", "-o", "fixed.json", "--json"]);
    assert_eq!(number(&report, "/words/fraction_bits"), 9.0);
    desk.good(&["verify", "fixed.json"]);
    // Another method has no use for them.
    desk.good(&["design", "fixed.toml", "-o", "iir.json", "--method", "iir"]);
}

#[test]
fn bits_that_make_no_sense_are_refused() {
    let desk = Desk::new();
    let design = |more: &[&'static str]| [&["design", "spec.toml", "-o", "b.json"], more].concat();
    desk.refused(1, &design(&["--bits", "1"]), &["2 to 32 bits"]);
    desk.refused(1, &design(&["--bits", "8,8"]), &["22 taps"]);
    desk.refused(1, &design(&["--fraction-bits", "4"]), &["bits is missing"]);
    desk.refused(1, &design(&["--bits", "8", "--method", "h2"]), &["bits", "fir"]);
    desk.refused(2, &design(&["--bits", "eight"]), &["eight"]);
}

#[test]
fn what_is_wrong_with_a_flag_names_the_flag() {
    let desk = Desk::new();
    fs::write(desk.path("list.toml"), THESIS.replace("taps = 22", "taps = 2\nbits = [8, 8]")).unwrap();
    fs::write(desk.path("iir.toml"), THESIS.replace("\"fir\"\ntaps = 22", "\"iir\"")).unwrap();
    for (spec, flags, starts, says) in [
        ("spec.toml", &["--taps", "0"][..], "--taps: 0 taps", "1 to 65536"),
        ("spec.toml", &["--taps", "16000"], "--taps: 32000 taps in all", "at most 16384"),
        ("iir.toml", &["--taps", "8"], "--taps: taps has no meaning for the method iir", "fir"),
        ("spec.toml", &["--gamma-margin=-1"], "--gamma-margin: -1", "zero or more"),
        ("spec.toml", &["--bits", "1"], "--bits: 1 bits", "2 to 32"),
        ("spec.toml", &["--bits", "8,8"], "--bits: 2 entries", "each of the 22 taps"),
        ("list.toml", &["--taps", "3"], "--taps: 2 entries", "each of the 3 taps"),
        ("spec.toml", &["--bits", "8", "--fraction-bits=-300"], "--fraction-bits: -300 bits", "-256 to 256"),
        ("spec.toml", &["--fraction-bits", "4"], "--fraction-bits: the key bits is missing", "bits = 16"),
        (
            "spec.toml",
            &["--bits", "8", "--method", "h2"],
            "--bits: bits has no meaning for the method h2",
            "fir",
        ),
        ("iir.toml", &["--method", "fir"], "--method: the key taps is missing", "taps = 22"),
        ("iir.toml", &["--order", "100000"], "--order: 100000 states", "0 to 65536"),
        ("iir.toml", &["--reduction-loss-db=-1"], "--reduction-loss-db: -1 dB", "0 to 400 dB"),
        ("spec.toml", &["--latency", "100000"], "--latency: 100000 fast samples", "at most 65536"),
    ] {
        let args = [&["design", spec, "-o", "b.json"], flags].concat();
        desk.refused(1, &args, &[says]);
        let message = text(&desk.run(&args).stderr);
        assert!(message.starts_with(&format!("hybank: {starts}")), "{message}");
        assert!(!message.contains(".toml"), "the file is not to blame: {message}");
    }
    // What is wrong with the file is shown there all the same.
    fs::write(desk.path("margin.toml"), THESIS.replace("taps = 22", "taps = 22\ngamma_margin = -1")).unwrap();
    let args = ["design", "margin.toml", "-o", "b.json", "--bits", "8"];
    desk.refused(1, &args, &["margin.toml:13:16: design.gamma_margin: -1", "zero or more"]);
}

#[test]
fn integer_taps_that_are_all_zero_are_warned_of() {
    let desk = Desk::new();
    let design = ["design", "spec.toml", "-o", "b.json", "--taps", "4", "--bits", "1,1,1,2"];
    let output = desk.run(&design);
    let (told, bank) = (text(&output.stderr), fs::read_to_string(desk.path("b.json")).unwrap());
    assert!(output.status.success(), "{told}");
    assert!(bank.contains("[[0, 0, 0, 0], [0, 0, 0, 0]]"), "{bank}");
    assert!(told.starts_with("hybank: warning: ") && told.contains("all integer taps are zero"), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    // A scale that was asked for is a mistake.
    desk.refused(
        1,
        &[&design[..], &["--force", "--fraction-bits", "-2"]].concat(),
        &["all integer taps are zero"],
    );
}

#[test]
fn a_bank_without_any_error_loses_nothing_by_integers() {
    let desk = Desk::new();
    let exact = "fast_period = 1.0\nratio = 1\nlatency = 0\nchannel = [{ delay = 0 }]\n\
                 target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n\
                 design = { method = \"fir\", taps = 1, bits = 4 }\n";
    fs::write(desk.path("exact.toml"), exact).unwrap();
    let report = desk.json(&["design", "exact.toml", "-o", "b.json", "--json"]);
    assert_eq!(number(&report, "/gamma/norm"), 0.0);
    assert_eq!(number(&report, "/words/loss_db"), 0.0);
    assert!(
        desk.good(&["design", "exact.toml", "-o", "b.json", "--force"]).contains("gamma is 0.0000 dB above")
    );
}

#[test]
fn the_latency_may_be_left_to_the_designer() {
    let desk = Desk::new();
    fs::write(desk.path("open.toml"), THESIS.replace("latency = 10\n", "")).unwrap();
    let report = desk.json(&["design", "open.toml", "-o", "bank.json", "--json"]);
    assert_eq!(report["latency_chosen"], true);
    assert!(number(&report, "/gamma/upper") < 0.04, "{report}");
    let given = desk.json(&["design", "open.toml", "-o", "b.json", "--latency", "6", "--json"]);
    assert_eq!((&given["latency"], &given["latency_chosen"]), (&Value::from(6), &Value::from(false)));
}

#[test]
fn banks_flow_through_pipes() {
    let desk = Desk::new();
    let designed = desk.run(&["design", "spec.toml", "-o", "-"]);
    assert!(designed.status.success());
    assert!(text(&designed.stderr).contains("gamma"), "the report goes to stderr");
    let mut child = desk
        .command(&["analyze", "-", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(&designed.stdout).unwrap();
    let output = child.wait_with_output().unwrap();
    let analysis: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((number(&analysis, "/gamma") - 0.039_932_04).abs() < 1e-7, "{analysis}");
}

#[test]
fn equal_delays_are_legal() {
    let desk = Desk::new();
    fs::write(desk.path("equal.toml"), THESIS.replace("delay = 1.2", "delay = 0.6")).unwrap();
    for method in ["fir", "iir"] {
        let taps: &[&str] = if method == "fir" { &["--taps", "22"] } else { &[] };
        let args = ["design", "equal.toml", "-o", "b.json", "--force", "--json", "--method", method];
        let report = desk.json(&[&args, taps].concat());
        let (upper, lower) = (number(&report, "/gamma/upper"), number(&report, "/gamma/lower"));
        assert!(lower <= upper && upper < 1.01 * lower, "{report}");
    }
}

#[test]
fn a_wrong_spec_is_answered_with_place_reason_and_remedy() {
    let desk = Desk::new();
    fs::write(desk.path("bad.toml"), "").unwrap();
    desk.bad_spec(
        "latency",
        "latncy",
        &["bad.toml:3:1", "unknown key \"latncy\"", "did you mean \"latency\"?"],
    );
    desk.bad_spec("[1.0, 1.0, 0.25]", "[1.0, -1.0, 0.25]", &["bad.toml", "unstable", "left half plane"]);
    desk.bad_spec("num = [0.25]", "num = [1.0, 0.0, 0.25]", &["bad.toml:5:", "strictly proper", "rc"]);
    desk.bad_spec("delay = 1.2", "delay = -1.2", &["bad.toml:7:", "-1.2 s", "cannot be negative"]);
    desk.bad_spec("ratio = 2", "ratio = 0", &["bad.toml:2:", "1 to 1024"]);
    desk.bad_spec("taps = 22", "taps = 0", &["bad.toml:12:", "1 to 65536"]);
    desk.bad_spec("taps = 22\n", "", &["taps", "missing"]);
    desk.bad_spec("\"fir\"", "\"fri\"", &["bad.toml:11:", "did you mean \"fir\"?"]);
    desk.bad_spec("fast_period = 1.0", "fast_period = nan", &["bad.toml:1:"]);
    desk.bad_spec("fast_period = 1.0", "fast_period = 1.0\nfast_rate = 1.0", &["fast_period", "fast_rate"]);
    desk.bad_spec("ratio = 2", "ratio = ", &["bad.toml:2:"]);
    desk.bad_spec("\"fir\"\ntaps = 22", "\"sinc\"\n[[channel]]\ndelay = 0.1", &["N = M", "3 channels"]);
}

#[test]
fn files_are_named_and_never_overwritten_unasked() {
    let desk = Desk::new();
    desk.refused(1, &["design", "none.toml", "-o", "b.json"], &["none.toml", "cannot read"]);
    desk.refused(1, &["analyze", "none.json"], &["none.json", "cannot read"]);
    desk.refused(1, &["design", "spec.toml", "-o", "no/such/b.json"], &["no/such/b.json", "cannot create"]);
    fs::write(desk.path("mine.json"), "precious").unwrap();
    desk.refused(1, &["design", "spec.toml", "-o", "mine.json"], &["mine.json", "exists", "--force"]);
    assert_eq!(fs::read_to_string(desk.path("mine.json")).unwrap(), "precious");
    desk.refused(1, &["analyze", "mine.json"], &["mine.json"]);
    desk.good(&["design", "spec.toml", "-o", "mine.json", "--force"]);
    desk.good(&["analyze", "mine.json"]);
}

#[test]
fn wrong_usage_is_exit_code_two() {
    let desk = Desk::new();
    desk.refused(2, &[], &["Usage"]);
    desk.refused(2, &["dezign"], &["dezign"]);
    desk.refused(2, &["design"], &["SPEC"]);
    desk.refused(2, &["design", "spec.toml", "-o", "b.json", "--method", "magic"], &["fir, iir, h2"]);
    desk.refused(2, &["design", "spec.toml", "-o", "b.json", "--taps", "many"], &["many"]);
    desk.refused(2, &["design", "spec.toml", "-o", "-", "--json"], &["--json", "standard output"]);
    desk.refused(2, &["simulate", "spec.toml", "--source", "stp@1", "-o", "x"], &["stp@1", "step@0.3"]);
    desk.refused(2, &["simulate", "spec.toml", "--source", "tones:1,x", "-o", "x"], &["`x`"]);
    desk.good(&["design", "spec.toml", "-o", "b.json"]);
    desk.refused(
        1,
        &["analyze", "b.json", "--delay-error", "0.1"],
        &["b.json", "1 delay errors", "2 channels"],
    );
    desk.refused(2, &["analyze", "b.json", "--delay-error", "0.1,nan"], &["finite"]);
    desk.refused(2, &["analyze", "b.json", "--certify", "--delay-error", "0,0"], &["--certify"]);
}

#[test]
fn every_source_is_captured_and_fused() {
    let desk = Desk::new();
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    // Worst-case gain 0.04 for white spectra; these live where the bank is much better.
    for (source, least) in [("step@20.3", 55.0), ("tones:0.3,0.8", 45.0), ("chirp:0.01Hz..0.05Hz@300s", 50.0)]
    {
        let captured = desk.json(&[
            "simulate",
            "bank.json",
            "--source",
            source,
            "-o",
            "cap",
            "--force",
            "--json",
            "--samples",
            "400",
        ]);
        assert_eq!((&captured["frames"], &captured["latency"]), (&Value::from(200), &Value::from(10)));
        assert_eq!(captured["files"].as_array().unwrap().len(), 3);
        let args =
            ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav", "--keep-latency", "--force"];
        desk.good(&args);
        let ((rate, fused), (_, target)) = (wav(&desk.path("y.wav")), wav(&desk.path("cap/target.wav")));
        assert_eq!((rate, fused.len()), (48_000, 400));
        let snr = snr_db(&fused, &target, 60);
        assert!(snr > least, "{source}: {snr:.1} dB");
    }
    desk.refused(
        1,
        &["simulate", "bank.json", "--source", "step@0.3", "-o", "cap"],
        &["cap/ch1.wav", "file exists", "--force"],
    );
}

#[test]
fn a_simulated_step_is_the_closed_form() {
    let desk = Desk::new();
    desk.good(&["simulate", "spec.toml", "--source", "step@0.3", "-o", "cap", "--gain", "0.5"]);
    // Step response of 0.25 / (s + 0.5)^2.
    let step = |t: f64| if t < 0.0 { 0.0 } else { 1.0 - (1.0 + 0.5 * t) * (-0.5 * t).exp() };
    for (name, delay, period) in [("ch1", 1.2, 2.0), ("ch2", 0.6, 2.0), ("target", 10.0, 1.0)] {
        let (_, samples) = wav(&desk.path(&format!("cap/{name}.wav")));
        for (k, x) in samples.iter().enumerate() {
            let expected = 0.5 * step(k as f64 * period - delay - 0.3);
            assert!((x - expected).abs() < 1e-7, "{name}[{k}]: {x} instead of {expected}");
        }
    }
}

#[test]
fn a_recording_is_a_source() {
    let desk = Desk::new();
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(desk.path("tone.wav"), spec).unwrap();
    // A whole number of periods, so that the periodic continuation is the tone itself.
    let omega = std::f64::consts::TAU * 30.0 / 800.0;
    (0..800).for_each(|n| writer.write_sample((omega * n as f64).sin() as f32).unwrap());
    writer.finalize().unwrap();
    let report = desk.json(&["simulate", "spec.toml", "--source", "tone.wav", "-o", "cap", "--json"]);
    assert_eq!(report["frames"], 400);
    // The response of 0.25 / (j w + 0.5)^2 has gain 0.25 / (w^2 + 0.25).
    let (gain, phase) = (0.25 / (omega * omega + 0.25), -2.0 * (omega / 0.5).atan());
    let (_, samples) = wav(&desk.path("cap/ch1.wav"));
    for (k, x) in samples.iter().enumerate() {
        let expected = gain * (omega * (2.0 * k as f64 - 1.2) + phase).sin();
        assert!((x - expected).abs() < 1e-6, "{k}: {x} instead of {expected}");
    }
    desk.refused(1, &["simulate", "spec.toml", "--source", "none.wav", "-o", "c2"], &["none.wav"]);
}

#[test]
fn the_demo_shows_the_order_of_the_methods() {
    let desk = Desk::new();
    let report = desk.json(&["demo", "-o", "shown", "--json"]);
    let snr = |k: usize| number(&report, &format!("/contenders/{k}/snr_db"));
    assert!(snr(0) > 66.0 && snr(1) > 66.0, "{report}");
    assert!((2..5).all(|k| snr(k) < 40.0), "{report}");
    for file in
        ["ch1.wav", "ch2.wav", "target.wav", "fused-fir.wav", "fused-iir.wav", "step.svg", "error.svg"]
    {
        assert!(fs::metadata(desk.path("shown").join(file)).unwrap().len() > 1000, "{file}");
    }
    desk.refused(1, &["demo", "-o", "shown"], &["shown", "--force"]);
}

#[test]
fn completions_know_the_verbs() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = desk.good(&["completions", shell]);
        assert!(script.contains("analyze") && script.contains("simulate"), "{shell}");
    }
    desk.refused(2, &["completions", "csh"], &["csh"]);
}

#[test]
fn help_and_version() {
    let desk = Desk::new();
    assert_eq!(desk.good(&["--version"]), format!("hybank {}\n", env!("CARGO_PKG_VERSION")));
    for verb in ["design", "analyze", "simulate", "fuse", "stream", "demo", "completions"] {
        let help = desk.good(&[verb, "--help"]);
        assert!(help.contains("Examples:") && help.contains("Usage:"), "{verb}");
    }
}

/// Two captures of a speech recording with the wanted signal, made elsewhere in the frequency domain.
#[test]
fn captures_made_elsewhere_are_fused() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let (captures, speech) = (data.join("captures/speech-2x"), data.join("audio/Front_Center.wav"));
    if !captures.is_dir() || !speech.is_file() {
        println!("skipped: no data in {}", data.display());
        return;
    }
    let desk = Desk::new();
    let at = |name: &str| captures.join(name).to_string_lossy().into_owned();
    desk.good(&["design", &at("spec.toml"), "-o", "bank.json"]);
    desk.good(&["fuse", "bank.json", &at("ch1.wav"), &at("ch2.wav"), "-o", "y.wav", "--keep-latency"]);
    let (fused, target) = (wav(&desk.path("y.wav")).1, wav(&captures.join("target.wav")).1);
    let snr = snr_db(&fused, &target, 200);
    assert!(snr >= 65.0, "{snr:.2} dB");
    let source = speech.to_string_lossy().into_owned();
    desk.good(&["simulate", "bank.json", "--source", &source, "-o", "cap"]);
    for name in ["ch1.wav", "ch2.wav", "target.wav"] {
        let (ours, theirs) = (wav(&desk.path("cap").join(name)).1, wav(&captures.join(name)).1);
        let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6 && ours.len().abs_diff(theirs.len()) <= 2, "{name}: {worst:e}");
    }
}
