//! The static nonlinearity of converters: simulated, found by tones, and corrected before the filters.

use crate::calibrate::design;
use crate::pooled::four_converters;
use crate::support::{Desk, number, text, wav};
use hybank::runtime::Nonlinearity;
use hybank::spec::Spec;

/// Four interleaved converters of 250 MS/s and 12 bits.
fn nominal() -> String {
    four_converters("fast_rate = \"1 GS/s\"", "700 MHz", "400 MHz", 48)
}

/// Half a step of 12 bits, of full scale.
const HALF_STEP: f64 = 1.0 / 4096.0;

/// The same with curves of half a step each.
fn bent() -> String {
    let mut spec = Spec::from_toml(&nominal(), "spec.toml").unwrap();
    let shares = [[0.6, 0.3, -0.1], [-0.5, 0.4, 0.1], [0.2, -0.7, 0.1], [0.3, 0.5, -0.2]];
    for (channel, shares) in spec.channels.iter_mut().zip(shares) {
        channel.nonlinearity = Nonlinearity::Polynomial(shares.map(|share| share * HALF_STEP).to_vec());
    }
    spec.to_toml_like(&nominal(), &|_| unreachable!()).unwrap()
}

fn capture(desk: &Desk, source: &str, folder: &str) {
    let simulate = ["simulate", "bent.toml", "--source", source, "--samples", "65536", "--gain", "0.9"];
    desk.good(&[&simulate[..], &["--bits", "12", "--noise", "1e-4", "--seed", "3", "-o", folder]].concat());
}

fn four(folder: &str) -> [String; 4] {
    [1, 2, 3, 4].map(|i| format!("{folder}/ch{i}.wav"))
}

/// SFDR of a tone that `bank.json` fuses.
fn sfdr(desk: &Desk, more: &[&str]) -> f64 {
    let files = four("judged");
    let names = files.each_ref().map(String::as_str);
    desk.good(&[&["fuse", "bank.json"][..], &names, &["-o", "fused.wav", "--force"], more].concat());
    number(&desk.json(&["measure", "fused.wav", "--skip", "500", "--json"]), "/sfdr_db")
}

#[test]
fn a_nonlinearity_of_half_a_step_is_found_and_taken_out() {
    let desk = Desk::with_spec(&nominal());
    desk.write("bent.toml", bent());
    capture(&desk, "tones:61.37MHz", "judged");
    let mut files = Vec::new();
    for tone in ["41.13MHz", "113.57MHz", "207.91MHz", "331.73MHz"] {
        let folder = tone.replace('.', "_");
        capture(&desk, &format!("tones:{tone}"), &folder);
        files.extend(four(&folder));
    }
    let names: Vec<&str> = files.iter().map(String::as_str).collect();
    // Without the curves the tones contradict each other, which is said.
    let calibrate = |output: &str, more: &[&str]| {
        let shown = desk
            .run(&[&["calibrate", "spec.toml"][..], &names, &["-o", output, "--json"], more].concat(), &[]);
        assert!(shown.status.success(), "{shown:?}");
        text(&shown.stdout)
    };
    calibrate("plain.toml", &[]);
    design(&desk, "plain.toml");
    let before = sfdr(&desk, &[]);
    let report = calibrate("straight.toml", &["--nonlinearity", "8"]);
    let found = Spec::from_toml(&String::from_utf8(desk.read("straight.toml")).unwrap(), "straight.toml");
    let truth = Spec::from_toml(&bent(), "bent.toml").unwrap();
    for (found, truth) in found.unwrap().channels.iter().zip(&truth.channels) {
        let error = |k: usize| found.nonlinearity.values()[k] - truth.nonlinearity.values()[k];
        assert!((0..3).all(|k| error(k).abs() < 0.05 * HALF_STEP), "{report}");
    }
    design(&desk, "straight.toml");
    let after = sfdr(&desk, &[]);
    println!("SFDR {before:.1} dB without, {after:.1} dB with the nonlinearity");
    assert!(after > before + 15.0, "{before} {after}");
    // Tables of words have the same curves.
    desk.good(&["design", "straight.toml", "-o", "bank.json", "--bits", "16", "--no-proof", "--force"]);
    let by_tables = sfdr(&desk, &["--bit-true"]);
    println!("{by_tables:.1} dB with integers");
    assert!((by_tables - after).abs() < 2.0, "{by_tables} {after}");
    // Curves have no place in other tools.
    desk.refused(1, &["export", "bank.json", "--format", "c", "-o", "bank.h"], &["nonlinearity"]);
}

/// The codes of a converter of 8 bits by successive approximation, whose bits have errors of weight: its
/// integral nonlinearity, without the line through it, is half a step at most.
struct SuccessiveApproximation {
    /// Least inputs of the codes, in steps.
    thresholds: Vec<f64>,
}

impl SuccessiveApproximation {
    fn new(errors: [f64; 8]) -> Self {
        let of = |code: usize| (0..8).filter(|bit| code >> bit & 1 == 1).map(|bit| errors[bit]).sum::<f64>();
        let codes: Vec<f64> = (0..256).map(|code| code as f64 - 127.5).collect();
        let slope = codes.iter().enumerate().map(|(code, x)| of(code) * x).sum::<f64>()
            / codes.iter().map(|x| x * x).sum::<f64>();
        let mean = errors.iter().sum::<f64>() / 2.0;
        let inl: Vec<f64> = (0..256).map(|code| of(code) - mean - slope * codes[code]).collect();
        let scale = 0.5 / inl.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let threshold = |code: usize| code as f64 - 128.5 + 0.5 * scale * (inl[code] + inl[code - 1]);
        Self { thresholds: (1..256).map(threshold).collect() }
    }

    fn sample(&self, x: f32) -> f32 {
        let steps = 128.0 * f64::from(x);
        (self.thresholds.partition_point(|threshold| *threshold <= steps) as f32 - 128.0) / 128.0
    }
}

/// Nine tones tell the codes, and the tenth is corrected: of steps at the bits of a code a table takes out
/// what no polynomial does.
#[test]
fn a_table_takes_out_the_steps_of_successive_approximation() {
    let desk = Desk::with_spec(&nominal());
    let converters = [
        SuccessiveApproximation::new([0.1, -0.2, 0.1, 0.3, -0.4, 0.3, -0.2, 1.0]),
        SuccessiveApproximation::new([0.0, 0.1, -0.2, 0.2, 0.3, -0.5, 0.8, -0.6]),
        SuccessiveApproximation::new([0.1, 0.1, 0.2, -0.3, 0.2, 0.6, -0.9, 0.1]),
        SuccessiveApproximation::new([-0.1, 0.2, 0.1, 0.1, -0.3, -0.4, 0.2, -0.9]),
    ];
    let capture = |tone: &str, folder: &str| -> [String; 4] {
        let simulate = ["simulate", "spec.toml", "--source", tone, "--samples", "65536", "--gain", "0.9"];
        desk.good(&[&simulate[..], &["--noise", "0.002", "--seed", "5", "-o", folder]].concat());
        let files = four(folder);
        for (file, converter) in files.iter().zip(&converters) {
            let codes: Vec<f32> = wav::samples(&desk, file).iter().map(|x| converter.sample(*x)).collect();
            wav::write(&desk, file, 1, 250_000_000, &codes);
        }
        files
    };
    let judged = capture("tones:61.37MHz", "judged");
    let files: Vec<String> = (0..9)
        .flat_map(|k| {
            let tone = 23.17 + 41.37 * f64::from(k);
            capture(&format!("tones:{tone}MHz"), &format!("tone{k}"))
        })
        .collect();
    let names: Vec<&str> = files.iter().map(String::as_str).collect();
    let sfdr_with = |more: &[&str]| {
        let calibrate = ["calibrate", "spec.toml", "-o", "found.toml", "--force"];
        desk.warned(&[&calibrate[..], &names, more].concat(), &[]);
        design(&desk, "found.toml");
        sfdr(&desk, &[])
    };
    let [raw, polynomial, table] =
        [&[][..], &["--nonlinearity", "9"], &["--nonlinearity", "table"]].map(sfdr_with);
    println!("SFDR {raw:.1} dB without, {polynomial:.1} dB with a polynomial, {table:.1} dB with a table");
    assert_eq!(judged, four("judged"));
    assert!(table > raw + 15.0 && table > polynomial + 3.0, "{raw} {polynomial} {table}");
}
