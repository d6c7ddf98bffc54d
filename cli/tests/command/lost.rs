//! Samples that were lost: what tells of them, what stands in for them, what they touch. As a user runs it.

use crate::support::{Desk, bytes, channel, floats, frames, fused, interleaved, number, text, wav, words};
use serde_json::{Value, json};
use trials::random::Random;

const COUNT: usize = 3000;

/// Channel 1 joins two frames late and loses frame 7 and frames 100..1500; channel 2 is whole.
const SEQUENCE: &str = r#"
{"channel": 1, "sample_start": 0, "global_index": 1002}
{"channel": 1, "sample_start": 5, "global_index": 1008}

{"channel": 1, "sample_start": 97, "global_index": 2500}
{"channel": 2, "sample_start": 0, "global_index": 1000}
"#;

fn is_lost(frame: usize) -> bool {
    frame < 2 || frame == 7 || (100..1500).contains(&frame)
}

/// Channel, first sample and length of each gap.
pub(crate) fn places(gaps: &Value) -> Vec<[u64; 3]> {
    let place = |gap: &Value| ["channel", "first", "length"].map(|key| gap[key].as_u64().unwrap());
    gaps["list"].as_array().unwrap().iter().map(place).collect()
}

fn kept(whole: &[f32]) -> Vec<f32> {
    let kept = channel(whole, 0).into_iter().enumerate().filter(|(k, _)| !is_lost(*k));
    kept.map(|(_, x)| x).collect()
}

/// The mask must be exact: what it leaves out is as if nothing had been lost, what it marks is not.
fn check_mask(mask: &[u8], got: &[f32], whole: &[f32]) {
    assert_eq!(mask.len(), got.len());
    for (t, ((mask, got), want)) in mask.iter().zip(got).zip(whole).enumerate() {
        // f_1 has no zero tap, and no lost sample of the test is estimated exactly.
        assert_eq!(*mask == 0, got == want, "sample {t}");
    }
}

/// Samples that nothing around them tells.
fn whole() -> Vec<f32> {
    (0..2 * COUNT).map(|i| (1 + i % 1021) as f32).collect()
}

#[test]
fn samples_that_were_left_out_are_bridged_reported_and_masked() {
    let desk = Desk::with_model();
    let whole = whole();
    desk.write("a", bytes(&kept(&whole)));
    desk.write("b", bytes(&channel(&whole, 1)));
    wav::write(&desk, "a.wav", 1, 24_000, &kept(&whole));
    wav::write(&desk, "b.wav", 1, 24_000, &channel(&whole, 1));
    desk.write("lost.jsonl", SEQUENCE);
    let lost = ["--lost", "lost.jsonl", "--mask", "mask"];
    let stream = ["stream", "bank.json", "--input", "a", "--input", "b", "-o", "out"];
    let fuse = ["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--keep-latency"];
    let mut outputs = Vec::new();
    for command in [&stream[..], &fuse] {
        let report = desk.report(&[command, &lost, &["--gaps"]].concat());
        assert_eq!(places(&report["gaps"]), [[1, 0, 2], [1, 7, 1], [1, 100, 1400]]);
        assert_eq!((report["gaps"]["missing"].as_u64(), report["frames"].as_u64()), (Some(1403), Some(3000)));
        assert_eq!(report["replaced"], 0);
        let got = match command[0] {
            "stream" => floats(&desk.read("out")),
            _ => wav::samples(&desk, "out.wav"),
        };
        check_mask(&desk.read("mask"), &got, &fused(&whole));
        outputs.push((got, desk.read("mask")));
    }
    assert!(outputs[0] == outputs[1]);
}

#[test]
fn void_samples_of_an_interleaved_stream_are_in_the_report_of_another_run() {
    let desk = Desk::with_model();
    let clean = frames(500);
    let mut marked = clean.clone();
    for (channel, range) in [(0, 0..1), (1, 40..43), (0, 41..300), (1, 499..500)] {
        range.for_each(|k: usize| marked[2 * k + channel] = f32::NAN);
    }
    desk.write("marked", bytes(&marked));
    let args = ["stream", "bank.json", "--gaps", "--mask", "mask", "-o", "out"];
    let report = desk.report(&[&args[..], &["--input", "marked"]].concat());
    let list = report["gaps"]["list"].as_array().unwrap();
    assert_eq!(list.len(), 4);
    let (out, mask) = (desk.read("out"), desk.read("mask"));
    // The same gaps with anything else in their place, as integers that cannot say NaN.
    let lines: Vec<_> = list.iter().map(Value::to_string).collect();
    desk.write("void.jsonl", lines.join("\n"));
    let coded: Vec<u8> = clean.iter().flat_map(|x| ((x * 1024.0) as i16).to_be_bytes()).collect();
    desk.write("coded", coded);
    let format = words("--input coded --format s16be --output-format f32le --lost void.jsonl");
    let again = desk.report(&[&args[..], &format].concat());
    assert_eq!(again["gaps"], report["gaps"]);
    let scaled: Vec<f32> = floats(&out).iter().map(|y| y / 32.0).collect();
    assert_eq!((floats(&desk.read("out")), desk.read("mask")), (scaled, mask));
}

#[test]
fn channels_that_end_early_may_be_bridged_to_the_end_of_the_longest() {
    let desk = Desk::with_model();
    let whole = frames(5000);
    desk.write("a", bytes(&channel(&whole, 0)[..4000]));
    desk.write("b", bytes(&channel(&whole, 1)));
    let args = ["stream", "bank.json", "--input", "a", "--input", "b", "-o", "out", "--gaps"];
    let report = desk.report(&args);
    assert_eq!((report["frames"].as_u64(), report["gaps"]["count"].as_u64()), (Some(4000), Some(0)));
    assert_eq!(report["warnings"].as_array().unwrap().len(), 1);
    let report = desk.report(&[&args[..], &["--longest", "--strict"]].concat());
    assert_eq!((report["frames"].as_u64(), &report["warnings"]), (Some(5000), &json!([])));
    assert_eq!(places(&report["gaps"]), [[1, 4000, 1000]]);
    assert!(floats(&desk.read("out"))[..8000] == fused(&whole)[..8000]);
    desk.refused(2, &["stream", "bank.json", "--longest"], &["--gaps"]);
}

fn meta(datatype: &str, channels: usize, captures: &str) -> String {
    format!(
        r#"{{ "global": {{ "core:datatype": "{datatype}", "core:sample_rate": 24000.5, "core:num_channels": {channels},
        "core:version": "1.0.0" }}, "captures": [{captures}], "annotations": [] }}"#
    )
}

/// What the metadata say of bytes that are no samples, of samples that are not there, and of what a reader
/// must know.
#[test]
fn sigmf_that_is_not_all_samples_is_read_or_refused() {
    let desk = Desk::new();
    let input = frames(50);
    let meta = |more: &str| {
        format!(r#"{{"global": {{"core:datatype": "rf32_le", "core:num_channels": 2, {more}}}}}"#)
    };
    desk.write("in.sigmf-data", [bytes(&input), vec![7; 80]].concat());
    desk.write("in.sigmf-meta", meta(r#""core:trailing_bytes": 80"#));
    let stream = ["stream", "bank.json", "--input", "in.sigmf-meta", "--output-format", "f32le"];
    assert_eq!(floats(&desk.run(&stream, &[]).stdout), fused(&input));
    for (more, parts) in [
        (r#""core:trailing_bytes": 481"#, ["core:trailing_bytes is 481", "480 bytes"]),
        (r#""core:metadata_only": true"#, ["core:metadata_only", "no samples"]),
        (
            r#""core:extensions": [{"name": "x", "optional": true}, {"name": "crypt", "optional": false}]"#,
            ["the extension \"crypt\"", "unknown"],
        ),
    ] {
        desk.write("in.sigmf-meta", meta(more));
        desk.refused(1, &stream, &parts);
    }
}

#[test]
fn captures_tell_stream_what_was_lost() {
    let desk = Desk::with_model();
    let whole = whole();
    let captures = r#"{ "core:sample_start": 10, "core:global_index": 1002 },
        { "core:sample_start": 15, "core:global_index": 1008 }, { "core:sample_start": 50 },
        { "core:sample_start": 107, "core:global_index": 2500 }"#;
    // The recording is the second part of a longer one.
    let offset = meta("rf32_le", 1, captures).replace("\"core:num", "\"core:offset\": 10, \"core:num");
    desk.write("a.sigmf-meta", offset);
    desk.write("a.sigmf-data", bytes(&kept(&whole)));
    desk.write(
        "b.sigmf-meta",
        meta("rf32_le", 1, r#"{ "core:sample_start": 0, "core:global_index": 1000 }"#),
    );
    desk.write("b.sigmf-data", bytes(&channel(&whole, 1)));
    let args = ["stream", "bank.json", "--input", "a.sigmf-meta", "--input", "b.sigmf-meta", "-o", "out"];
    let report = desk.report(&[&args[..], &["--gaps", "--mask", "mask"]].concat());
    assert_eq!(places(&report["gaps"]), [[1, 0, 2], [1, 7, 1], [1, 100, 1400]]);
    let got = floats(&desk.read("out"));
    check_mask(&desk.read("mask"), &got, &fused(&whole));
    // What is void is reported beside the captures; what is left out only once.
    desk.write("lost", r#"{"channel": 2, "first": 2990, "length": 3}"#);
    let both = [&args[..], &["--gaps", "--lost", "lost"]].concat();
    assert_eq!(places(&desk.report(&both)["gaps"])[3], [2, 2990, 3]);
    desk.write("lost", r#"{"channel": 2, "sample_start": 0, "global_index": 3}"#);
    desk.refused(1, &[&both[..], &["--force"]].concat(), &["b.sigmf-meta", "captures of its own"]);
}

/// Two converters of 24 kS/s, with their bank for a band of 18 kHz.
fn two_converters(delay: &str) -> Desk {
    let desk = Desk::with_spec(&format!(
        "fast_rate = 48000\nratio = 2\n[signal]\nband = 18000\n[design]\nmethod = \"h2\"\ntaps = 64\n\
         [target]\nfilter = {{ family = \"butterworth\", order = 4, cutoff = 14000 }}\n\
         [[channel]]\ndelay = 0\n[[channel]]\ndelay = \"{delay}\"\n"
    ));
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    desk
}

/// A signal in the band of a bank whose converters lost samples: one alone, ten of one converter, three of
/// both. The predicted ratio of each gap is the measured one.
#[test]
fn lost_samples_of_a_signal_are_estimated_as_well_as_predicted() {
    let desk = two_converters("1.1 samples");
    let mut random = Random(3);
    let tones: Vec<[f64; 3]> = (0..400)
        .map(|_| {
            let frequency: f64 = 9000.0 * (random.sample() + 1.0);
            let passed = 1.0 / (1.0 + (frequency / 14000.0).powi(8)).sqrt();
            [frequency, random.sample() * passed, std::f64::consts::PI * random.sample()]
        })
        .collect();
    let power: f64 = tones.iter().map(|tone| tone[1] * tone[1] / 2.0).sum();
    let scale = 0.25 / power.sqrt();
    let value = |t: f64| -> f64 {
        let tone = |[frequency, size, phase]: &[f64; 3]| {
            size * (std::f64::consts::TAU * frequency * t + phase).cos()
        };
        scale * tones.iter().map(tone).sum::<f64>()
    };
    let rounded = |t: f64| ((value(t) * 32768.0).round() / 32768.0) as f32;
    let mut a: Vec<f32> = (0..12_200).map(|k| rounded(f64::from(k) / 24000.0)).collect();
    let mut b: Vec<f32> = (0..12_200).map(|k| rounded(f64::from(k) / 24000.0 - 1.1 / 48000.0)).collect();
    // Every 100 frames a gap; its kind by its number.
    let kinds = [(1, true, false), (10, false, true), (3, true, true)];
    for number in 0..117 {
        let (first, (length, of_a, of_b)) = (200 + 100 * number, kinds[number % 3]);
        let lose = |samples: &mut [f32]| samples[first..first + length].fill(f32::NAN);
        if of_a {
            lose(&mut a);
        }
        if of_b {
            lose(&mut b);
        }
    }
    wav::write(&desk, "a.wav", 1, 24_000, &a);
    wav::write(&desk, "b.wav", 1, 24_000, &b);
    let report =
        desk.report(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "out.wav", "--gaps", "--mask", "mask"]);
    let (out, mask) = (wav::samples(&desk, "out.wav"), desk.read("mask"));
    let error = |n: usize| (f64::from(out[n]) - value(n as f64 / 48000.0)).powi(2);
    let ratio = |places: &[usize]| {
        10.0 * (0.0625 * places.len() as f64 / places.iter().map(|&n| error(n)).sum::<f64>()).log10()
    };
    for (kind, (length, _, of_b)) in kinds.into_iter().enumerate() {
        let gaps = (kind..117).step_by(3).map(|number| 200 + 100 * number);
        // The place in the gap where the error is largest.
        let of_place = |place: usize| ratio(&gaps.clone().map(|first| 2 * first + place).collect::<Vec<_>>());
        let worst = (0..2 * length).map(of_place).fold(f64::INFINITY, f64::min);
        let channel = if of_b { 2 } else { 1 };
        let list = report["gaps"]["list"].as_array().unwrap();
        let gap = list.iter().find(|gap| gap["channel"] == channel && gap["length"] == length).unwrap();
        let predicted = gap["snr_db"].as_f64().unwrap();
        assert!((worst - predicted).abs() < 3.0, "{length}: {worst} measured, {predicted} predicted");
    }
    let clean: Vec<usize> = (200..23_400).filter(|&n| mask[n] == 0).collect();
    assert!(ratio(&clean) > 85.0, "{}", ratio(&clean));
}

/// Gain and offset of the second channel change; with them in the table the result is that without.
fn follow_levels(desk: &Desk, steady: &[f32]) {
    let level = |frame: usize| {
        let time = (frame as f64 / 24e3).min(2.0);
        (1.0 + 0.03 * time, 0.01 - 0.004 * time)
    };
    let moved = |(frame, x): (usize, &f32)| {
        let (gain, offset) = level(frame);
        (gain * f64::from(*x) + offset) as f32
    };
    let channel: Vec<f32> = wav::samples(desk, "cap/ch2.wav").iter().enumerate().map(moved).collect();
    wav::write(desk, "moved.wav", 1, 24_000, &channel);
    desk.write(
        "levels.csv",
        "time,a,b,gain a,gain b,offset a,offset b\n0,0,1e-5,1,1,0,0.01\n2,0,2e-5,1,1.06,0,0.002\n",
    );
    let args = ["fuse", "bank.json", "cap/ch1.wav", "moved.wav", "-o", "m.wav", "--track", "levels.csv"];
    let report = desk.report(&args);
    assert!((report["levels"]["gain"].as_f64().unwrap() - 0.06).abs() < 1e-12, "{report}");
    assert!((report["levels"]["offset"].as_f64().unwrap() - 0.008).abs() < 1e-12, "{report}");
    let followed = wav::samples(desk, "m.wav");
    let error = followed.iter().zip(steady).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(followed.len() == steady.len() && error < 1e-6, "{error}");
    let said = desk.good(&[&args[..], &["--force"]].concat());
    assert!(said.contains("gains change by up to 6.000 %, offsets by up to 8.00e-3"), "{said}");
    desk.write("zero.csv", "time,a,b,gain a,gain b\n0,0,1e-5,1,0\n");
    desk.refused(1, &[&args[..7], &["zero.csv", "--force"]].concat(), &["zero.csv", "gain of channel 2"]);
}

/// What the samples of a file are against those of the target, away from the ends, dB.
fn snr_of(desk: &Desk, file: &str) -> f64 {
    wav::snr_db(&wav::samples(desk, file), &wav::samples(desk, "cap/target.wav"), 500)
}

/// Two converters whose clocks drift by 5 ppm over 2 s, with their captures.
fn drifting() -> Desk {
    let desk = two_converters("10us");
    let tones = "tones:440Hz,3.1kHz,7.3kHz,11.9kHz,16.1kHz";
    desk.good(&words(&format!("simulate bank.json --source {tones} --samples 96000 --drift 0,5 -o cap")));
    desk
}

/// The same clocks by one of the tones.
#[test]
fn a_stream_follows_a_pilot() {
    let desk = drifting();
    let args =
        words("stream bank.json --input cap/ch1.wav --input cap/ch2.wav --format wav -o y.wav --force");
    let with = |more: &[&'static str]| [&args[..], more].concat();
    desk.good(&with(&["--pilot", "440Hz"]));
    let found = snr_of(&desk, "y.wav");
    assert!(found > 50.0, "{found}");
    // Nothing is at this frequency: said, and the delays stay.
    desk.warned(&with(&["--pilot", "5kHz"]), &["not found in 23 of 23 blocks"]);
    assert!(snr_of(&desk, "y.wav") < 40.0);
    for (more, part) in [
        (&["--pilot", "0"][..], "above 0"),
        (&["--pilot", "1", "--flush"], "--flush"),
        (&["--pilot", "1", "--track", "x.csv"], "--track"),
    ] {
        desk.refused(2, &with(more), &[part]);
    }
}

/// Clocks that drift by 5 ppm over 2 s: the taps follow the delays of a table, of either kind.
#[test]
fn a_table_of_delays_is_followed() {
    let desk = drifting();
    desk.write("delays.csv", "time,a,b\n0,0,1e-5\n2,0,2e-5\n");
    desk.write(
        "drift.jsonl",
        "{\"frame\": 0, \"delay\": [0, 1e-5]}\n{\"frame\": 9, \"delay\": [0, null]}\n{\"frame\": 48000, \"delay\": [0, 2e-5]}\n",
    );
    let snr = |more: &[&str]| {
        let args = ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"];
        let report = desk.report(&[&args[..], more].concat());
        (snr_of(&desk, "y.wav"), report)
    };
    let (fixed, _) = snr(&[]);
    for table in ["delays.csv", "drift.jsonl"] {
        let (followed, report) = snr(&["--track", table]);
        let predicted = report["predicted_snr_db"].as_f64().unwrap();
        assert!(followed > 75.0 && predicted > 75.0 && fixed < 40.0, "{followed}, {predicted}, {fixed}");
    }
    // A stream gives the same samples, whatever it reads at a time.
    let fused = wav::samples(&desk, "y.wav");
    follow_levels(&desk, &fused);
    let files = ["--input", "cap/ch1.wav", "--input", "cap/ch2.wav", "--format", "wav"];
    let report = desk
        .report(&[&["stream", "bank.json", "-o", "s.wav", "--track", "drift.jsonl"], &files[..]].concat());
    assert!(report["worst_second_db"].as_f64().unwrap() > 75.0 && report["interrupted"] == false);
    assert_eq!(wav::samples(&desk, "s.wav"), fused);
    let channels = ["cap/ch1.wav", "cap/ch2.wav"].map(|file| wav::samples(&desk, file));
    let raw = bytes(&interleaved(&channels[0], &channels[1]));
    assert!(desk.run(&["stream", "bank.json", "--track", "drift.jsonl"], &raw).stdout == bytes(&fused));
    desk.refused(2, &["stream", "bank.json", "--track", "drift.jsonl", "--flush"], &["--flush"]);
    let args = ["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "no.wav", "--track"];
    desk.refused(2, &[&args[..], &["delays.csv", "--gaps"]].concat(), &["--gaps"]);
    for (table, content, parts) in [
        ("one.csv", "time,a\n0,0\n", ["1 column of delays", "2 channels"]),
        ("jump.csv", "time,a,b\n0,0,0\n1,0,1.5\n", ["frame 24000", "channel 2"]),
        ("none.jsonl", "{\"frame\": 0, \"delay\": [0, null]}\n", ["none.jsonl", "no line with the delays"]),
        ("bad.jsonl", "{\"frame\": 0, \"delay\": [0]}\n", ["line 1", "1 delay for 2 channels"]),
    ] {
        desk.write(table, content);
        desk.refused(1, &[&args[..], &[table]].concat(), &[&[table][..], &parts].concat());
    }
    // Integers cannot hold what is beyond full scale.
    let loud: Vec<f32> = wav::samples(&desk, "cap/ch1.wav").iter().map(|x| 9.0 * x).collect();
    wav::write(&desk, "loud.wav", 1, 24_000, &loud);
    let args = words("fuse bank.json loud.wav loud.wav -o loud16.wav --bits 16 --track delays.csv");
    let warnings = desk.report(&args)["warnings"].to_string();
    assert!(warnings.contains("clipped") && warnings.contains("--bits 32f"), "{warnings}");
    desk.refused(1, &[&args[..], &["--strict", "--force"]].concat(), &["clipped", "--strict"]);
}

/// A clock that is 3 ppm fast, a gain that grows by 1 % and an offset that grows by 0.5 %: calibrated while
/// they change, by tones and by any signal, and corrected.
#[test]
fn what_changes_is_calibrated_and_corrected() {
    let desk = two_converters("10us");
    let simulate = "simulate bank.json --samples 96000 --drift 0,3 --gain 0.1 -o cap --force --source";
    let tones = "440Hz,3.1kHz,7.3kHz,9.9kHz";
    desk.good(&[&words(simulate)[..], &[&format!("tones:{tones}")]].concat());
    let mut random = Random(8);
    let files = ["a.wav", "b.wav"];
    for (i, file) in files.iter().enumerate() {
        let moved = |(frame, x): (usize, &f32)| {
            let share = i as f64 * frame as f64 / 48e3;
            ((1.0 + 0.01 * share) * f64::from(*x) + 0.005 * share + 1e-4 * random.sample()) as f32
        };
        let captured = wav::samples(&desk, &format!("cap/ch{}.wav", i + 1));
        wav::write(&desk, file, 1, 24_000, &captured.iter().enumerate().map(moved).collect::<Vec<_>>());
    }
    let calibrate = |more: &[&str]| {
        let args = ["calibrate", "spec.toml", files[0], files[1], "-o", "m.toml", "--drift", "drift.jsonl"];
        desk.json(&[&args[..], &["--force", "--json"], more].concat())
    };
    let snr = |table: &str| {
        let args = ["fuse", "bank.json", files[0], files[1], "-o", "y.wav", "--force", "--track", table];
        desk.good(&args);
        snr_of(&desk, "y.wav")
    };
    // Four lines are little for a calibration by any signal.
    for (signal, least) in [(&["--tone", tones][..], 10.0), (&["--blind"], 3.0)] {
        let report = calibrate(signal);
        let of = |key: &str, channel: usize| number(&report["drift"]["channels"][channel], key);
        assert!((of("/gain", 1) - 0.01).abs() < 1e-3 && of("/gain", 0) == 0.0, "{report}");
        assert!((of("/offset", 1) - 0.005).abs() < 5e-4, "{report}");
        desk.good(&["design", "m.toml", "-o", "bank.json", "--no-proof", "--force"]);
        let lines = text(&desk.read("drift.jsonl"));
        let alone = lines.lines().map(|line| {
            let line: Value = serde_json::from_str(line).unwrap();
            json!({ "frame": line["frame"], "delay": line["delay"] }).to_string() + "\n"
        });
        desk.write("delays.jsonl", alone.collect::<String>());
        let (delays, all) = (snr("delays.jsonl"), snr("drift.jsonl"));
        println!("{signal:?}: SNR {delays:.1} dB with delays, {all:.1} dB with all");
        assert!(all > delays + least && all > 50.0, "{delays} {all}");
    }
    // The same lines, the second without its gains.
    let lines = text(&desk.read("drift.jsonl"));
    let mut lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    lines[1].as_object_mut().unwrap().remove("gain");
    desk.write("mixed.jsonl", lines.iter().map(|line| format!("{line}\n")).collect::<String>());
    let args = ["fuse", "bank.json", files[0], files[1], "-o", "n.wav", "--track", "mixed.jsonl"];
    desk.refused(1, &args, &["mixed.jsonl: line 2", "in all or in none"]);
}
