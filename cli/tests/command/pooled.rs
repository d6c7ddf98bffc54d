//! Captures of interleaved converters as users have them: codes of 8 bits in tables, pooled.

use crate::calibrate::{read_spec, write_bank};
use crate::support::{Desk, number};
use hybank::spec::Spec;
use serde_json::Value;

/// A spec of four converters that sample in turn, with the lines before its tables.
pub(crate) fn four_converters(head: &str, cutoff: &str, band: &str, taps: usize) -> String {
    let channels = [3, 2, 1, 0].map(|i| format!("[[channel]]\ndelay_samples = {i}\n")).concat();
    format!(
        "{head}\nratio = 4\n[target]\nfilter = {{ family = \"butterworth\", order = 2, cutoff = \"{cutoff}\" }}\n\
         {channels}[signal]\nband = \"{band}\"\n[design]\nmethod = \"fir\"\ntaps = {taps}\n"
    )
}

/// What two units really are: skews, gains and offsets of each converter.
const UNITS: [[&str; 3]; 2] = [
    ["1.9ps,-1.3ps,0.8ps,0", "0.9%,-0.6%,0.4%,0", "0.012,-0.007,0.004,-0.01"],
    ["-2.6ps,0.7ps,1.8ps,0", "-0.5%,1.1%,-0.8%,0", "-0.009,0.011,0.003,0.006"],
];
/// Tones of nine captures, and of the one to judge by, MHz.
const TONES: [&str; 9] =
    ["97.13", "241.57", "389.91", "533.77", "701.33", "853.19", "1011.67", "1187.41", "1361.83"];
const HELD_OUT: &str = "1123.61";
/// Samples of a capture of 8 bits, and of the one to judge by.
const SHORT: &str = "32768";
const LONG: &str = "262144";

/// The codes of one unit in a table, one per line, in the order in which they were taken.
fn capture(desk: &Desk, [skews, gains, offsets]: [&str; 3], tone: &str, samples: &str, name: &str) {
    let source = format!("tones:{tone}MHz");
    let seed = (tone.len() + name.len() * 31 + name.bytes().map(usize::from).sum::<usize>()).to_string();
    let simulate = ["simulate", "quad.toml", "--source", &source, "--samples", samples, "--gain", "0.9"];
    let errors = ["--delay-error", skews, "--gain-error", gains, "--offset", offsets];
    // With the rounding 41 dB below the tone.
    let rest = ["--bits", "8", "--noise", "5.2e-3", "--seed", &seed, "--force", "-o", "cap"];
    desk.good(&[&simulate[..], &errors, &rest].concat());
    let codes = |i: usize| -> Vec<i16> {
        let path = desk.path(&format!("cap/ch{i}.wav"));
        let samples = hound::WavReader::open(path).unwrap().into_samples::<i16>();
        samples.map(|x| x.unwrap() >> 8).collect()
    };
    let channels = [1, 2, 3, 4].map(codes);
    let turns = (0..4 * channels[0].len()).map(|n| channels[n % 4][n / 4].to_string() + "\n");
    desk.write(name, turns.collect::<String>());
}

/// The largest spur of interleaving, dBc.
fn worst(measured: &Value) -> f64 {
    let spurs = measured["spurs"].as_array().unwrap();
    let is_own = |spur: &&Value| {
        let kind = &spur["causes"][0]["kind"];
        kind == "offset" || kind == "gain_or_skew" || kind == "harmonic_image"
    };
    spurs.iter().find(is_own).map(|spur| number(spur, "/level_dbc")).unwrap()
}

/// The held-out capture through the bank of a spec.
fn judged(desk: &Desk, spec: &str) -> (f64, f64) {
    // The robust design takes most of the time, and what is left uncertain moves no spur.
    write_bank(desk, &Spec { uncertainty: None, ..read_spec(desk, spec) });
    desk.report(&["fuse", "bank.json", "held.csv", "--interleaved", "4", "-o", "y.wav"]);
    let tone = format!("{HELD_OUT}MHz");
    let found =
        desk.json(&["measure", "y.wav", "--interleaved", "4", "--tone", &tone, "--skip", "200", "--json"]);
    (worst(&found), number(&found, "/sinad_db"))
}

/// Nine captures of 8 bits, each with a tone of its own, say more together than one.
#[test]
fn pooled_captures_of_quad_converters() {
    let is_all =
        trials::is_slow("pooled captures: the second unit, without calibration, and each capture alone");
    let (units, alone) = if is_all { (2, 0..9) } else { (1, 0..0) };
    for (unit, errors) in UNITS.into_iter().enumerate().take(units) {
        let desk = Desk::empty();
        // Of 750 MS/s each.
        let head = "fast_rate = \"3 GS/s\"\nfull_scale = \"8bits\"";
        desk.write("quad.toml", four_converters(head, "2.2 GHz", "1.4 GHz", 64));
        let names: Vec<String> = (0..9).map(|k| format!("z{k}.csv")).collect();
        for (tone, name) in TONES.into_iter().zip(&names) {
            capture(&desk, errors, tone, SHORT, name);
        }
        capture(&desk, errors, HELD_OUT, LONG, "held.csv");
        let calibrated = |captures: &[String]| {
            let captures: Vec<&str> = captures.iter().map(String::as_str).collect();
            let how = ["--interleaved", "4", "--reference", "4", "-o", "m.toml"];
            desk.report(&[&["calibrate", "quad.toml"], &captures[..], &how].concat());
            judged(&desk, "m.toml")
        };
        let before = is_all.then(|| judged(&desk, "quad.toml"));
        let single: Vec<(f64, f64)> = alone.clone().map(|k| calibrated(&names[k..=k])).collect();
        let pooled = calibrated(&names);
        let shown = |found: &(f64, f64)| format!("{:.1} dBc, {:.2} dB", found.0, found.1);
        let each: Vec<String> = single.iter().map(shown).collect();
        println!(
            "unit {}: {} before; {} by all nine",
            unit + 1,
            before.as_ref().map_or_else(String::new, shown),
            shown(&pooled)
        );
        println!("        by one: {}", each.join(" | "));
        let least = single.iter().map(|found| found.0).fold(f64::INFINITY, f64::min);
        assert!(before.is_none_or(|before| before.0 > -45.0 && before.1 < 37.0), "{before:?}");
        assert!(pooled.0 < -76.0 && pooled.0 < least + 3.0, "{single:?} {pooled:?}");
        assert!(pooled.1 > 40.0, "{pooled:?}");
    }
}
