//! Captures as tables, NumPy arrays, raw and complex samples. As a user runs it.

use crate::support::{
    Desk, THESIS, bytes, channel, floats, frames, fused, interleaved, repository, text, wav,
};
use serde_json::Value;
use std::fmt::Write as _;

/// A NumPy array, version 1.
fn npy(descr: &str, is_fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if is_fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let length = (header.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), data].concat()
}

/// A table with one column per channel.
fn table(heading: &str, channels: &[&[f32]]) -> String {
    let mut text = heading.to_owned();
    for k in 0..channels[0].len() {
        let cells: Vec<_> = channels.iter().map(|samples| f64::from(samples[k]).to_string()).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

#[test]
fn captures_of_every_kind_give_the_same_samples() {
    let desk = Desk::new();
    // More than one block of a table.
    let both: Vec<f32> = frames(3000).iter().map(|x| x / 16.0).collect();
    let (a, b) = (channel(&both, 0), channel(&both, 1));
    desk.write("a.csv", table("", &[&a]));
    desk.write("b.CSV", table("# from a scope\nvolts\n", &[&b]));
    desk.write("both.csv", table("left,right\n", &[&a, &b]));
    desk.write("a.npy", npy("<f4", false, "(3000,)", &bytes(&a)));
    let doubles: Vec<u8> = b.iter().flat_map(|&x| f64::from(x).to_be_bytes()).collect();
    desk.write("b.npy", npy(">f8", false, "(3000, 1)", &doubles));
    let planar = [bytes(&a), bytes(&b)].concat();
    desk.write("rows.npy", npy("<f4", false, "(2, 3000)", &planar));
    desk.write("columns.npy", npy("<f4", false, "(3000, 2)", &bytes(&both)));
    desk.write("fortran-rows.npy", npy("<f4", true, "(2, 3000)", &bytes(&both)));
    desk.write("fortran-columns.npy", npy("<f4", true, "(3000, 2)", &planar));
    desk.write("both.raw", bytes(&both));
    desk.write("a.raw", bytes(&a));
    desk.write("b.raw", bytes(&b));
    desk.write("turns.csv", table("", &[&both]));
    wav::write(&desk, "wide.wav", 2, 24_000, &interleaved(&b, &a));
    wav::write(&desk, "wider.wav", 2, 24_000, &interleaved(&[7.0; 3000], &b));
    for (inputs, more) in [
        (&["a.csv", "b.CSV"][..], &[][..]),
        (&["both.csv"], &[]),
        (&["a.npy", "b.npy"], &[]),
        (&["a.csv", "b.npy"], &[]),
        (&["rows.npy"], &[]),
        (&["columns.npy"], &[]),
        (&["fortran-rows.npy"], &[]),
        (&["fortran-columns.npy"], &[]),
        (&["both.raw"], &["--format", "f32le"]),
        (&["a.raw", "b.raw"], &["--format", "f32le"]),
        (&["turns.csv"], &["--interleaved", "2"]),
        (&["both.raw", "both.raw"], &["--format", "f32le", "--channels", "2", "--channel", "1"]),
        (&["wide.wav", "wider.wav"], &["--channel", "2"]),
    ] {
        let fuse = ["fuse", "bank.json", "-o", "out.wav", "--keep-latency"];
        let report = desk.report(&[&fuse[..], inputs, more].concat());
        assert_eq!((report["samples"].as_u64(), &report["warnings"]), (Some(6000), &serde_json::json!([])));
        let want = match inputs[0] == inputs[inputs.len() - 1] && inputs.len() == 2 {
            true => fused(&interleaved(&a, &a)),
            false => fused(&both),
        };
        assert!(wav::samples(&desk, "out.wav") == want, "{inputs:?} {more:?}");
    }
    // Live, too, and line by line.
    let streamed = desk.piped(&["stream", "bank.json", "--input", "a.csv", "--input", "b.npy"], &[]);
    assert!(floats(&streamed) == fused(&both));
    for (args, parts) in [
        (&["a.raw", "b.raw", "--channel", "1", "--interleaved", "2"][..], &["--interleaved"][..]),
        (&["wide.wav", "--channels", "2"], &["--channels", "--format"]),
    ] {
        desk.refused(2, &[&["fuse", "bank.json", "-o", "no.wav"], args].concat(), parts);
    }
    let third = ["fuse", "bank.json", "wide.wav", "wider.wav", "-o", "no.wav", "--channel", "3"];
    desk.refused(1, &third, &["channel 3", "2 channels, counted from 1"]);
}

/// Files that SciPy wrote (tools/mat_fixtures.py): the two channels of one array, and two arrays of one
/// file.
#[test]
fn captures_of_matlab_are_fused() {
    let desk = Desk::new();
    let seeds = repository("core/tests/fixtures/mat");
    for name in ["compressed.mat", "several.mat", "complex.mat"] {
        std::fs::copy(seeds.join(name), desk.path(name)).unwrap();
    }
    let formula = |k: usize, c: usize| ((7 * k + 3 * c) % 11) as f32 / 8.0 - 0.625;
    let want = fused(&(0..40).flat_map(|k| [formula(k, 0), formula(k, 1)]).collect::<Vec<_>>());
    for inputs in [&["compressed.mat"][..], &["several.mat:left", "several.mat:right"]] {
        desk.report(&[&["fuse", "bank.json"], inputs, &["-o", "y.wav", "--keep-latency"]].concat());
        let (spec, got) = wav::read(&desk.path("y.wav"));
        // Only one of the files states a rate.
        let rate = if inputs.len() == 1 { 48_000 } else { 1 };
        assert_eq!((got, spec.sample_rate), (want.clone(), rate), "{inputs:?}");
    }
    let streamed = desk.run(&["stream", "bank.json", "--input", "compressed.mat"], &[]);
    assert!(floats(&streamed.stdout) == want, "{streamed:?}");
    let measured = desk.report(&["measure", "compressed.mat", "--channel", "1", "--harmonics", "1"]);
    assert_eq!(measured["rate_hertz"], 24_000.0, "{measured}");
    let several = ["fuse", "bank.json", "several.mat", "-o", "n.wav"];
    desk.refused(1, &several, &["choose one, as several.mat:left"]);
    let same = ["fuse", "bank.json", "several.mat:left", "several.mat:right", "-o", "several.mat", "--force"];
    desk.refused(1, &same, &["several.mat"]);
}

/// A recording made by ffmpeg (tools/flac_fixture.sh), as a capture that keeps every bit.
#[test]
fn flac_recordings_are_captures() {
    let desk = Desk::new();
    let sample =
        |n: usize, f: f64| (16e3 * (std::f64::consts::TAU * f * n as f64 / 24e3).sin()).round() as f32;
    let input: Vec<f32> =
        (0..3000).flat_map(|n| [sample(n, 1e3), sample(n, 1.7e3)].map(|x| x / 32768.0)).collect();
    std::fs::copy(repository("core/tests/fixtures/two.flac"), desk.path("two.flac")).unwrap();
    let report = desk.report(&["fuse", "bank.json", "two.flac", "-o", "y.wav", "--keep-latency"]);
    assert_eq!(report["samples"], 6000);
    assert!(wav::read(&desk.path("y.wav")).1 == fused(&input));
    desk.refused(2, &["fuse", "bank.json", "two.flac", "-o", "y.flac"], &[]);
}

/// Complex frames of two channels, and their real and imaginary parts as real frames.
fn complex(count: usize) -> (Vec<f32>, [Vec<f32>; 2]) {
    let parts = [frames(count), frames(count + 100)[200..].to_vec()];
    (interleaved(&parts[0], &parts[1]), parts)
}

#[test]
fn complex_samples_run_through_both_parts() {
    let desk = Desk::new();
    let (input, parts) = complex(3000);
    let want = interleaved(&fused(&parts[0]), &fused(&parts[1]));
    assert!(floats(&desk.piped(&["stream", "bank.json", "--format", "cf32"], &bytes(&input))) == want);
    // Integers, with clipping of either part counted.
    let coded: Vec<u8> = input.iter().flat_map(|x| ((x * 8.0) as i16).to_be_bytes()).collect();
    desk.write("coded", &coded);
    let args = ["stream", "bank.json", "--input", "coded", "--format", "cs16be", "-o", "out"];
    let report = desk.report(&[&args[..], &["--output-format", "cf32le"]].concat());
    assert_eq!((report["samples"].as_u64(), report["clipped"].as_u64()), (Some(6000), Some(0)));
    let scaled: Vec<f32> = want.iter().map(|y| y / 4096.0).collect();
    assert!(floats(&desk.read("out")) == scaled);
    let real = [&args[..], &["--force", "--output-format", "cf32"]].concat();
    let real: Vec<&str> = real.iter().map(|&arg| if arg == "cs16be" { "s16be" } else { arg }).collect();
    desk.refused(2, &real, &["--output-format", "real"]);
}

#[test]
fn complex_recordings_are_fused() {
    let desk = Desk::with_model();
    let (_, parts) = complex(500);
    let meta = |datatype: &str| {
        format!(
            r#"{{ "global": {{ "core:datatype": "{datatype}", "core:sample_rate": 24000, "core:version": "1.0.0" }},
            "captures": [{{ "core:sample_start": 0, "core:global_index": 9 }},
            {{ "core:sample_start": 40, "core:global_index": 52 }}] }}"#
        )
    };
    let samples = |i: usize| interleaved(&channel(&parts[0], i), &channel(&parts[1], i));
    for i in 0..2 {
        desk.write(&format!("{i}.sigmf-meta"), meta("cf32_le"));
        desk.write(&format!("{i}.sigmf-data"), bytes(&samples(i)));
    }
    let lost = |part: &[f32]| fused(&[&part[..80], &[0.0; 6], &part[80..]].concat());
    let want = interleaved(&lost(&parts[0]), &lost(&parts[1]));
    let args = ["fuse", "bank.json", "0.sigmf-meta", "1.sigmf-meta", "--keep-latency", "--gaps"];
    let report = desk.report(&[&args[..], &["-o", "out.sigmf-meta", "--mask", "mask"]].concat());
    assert_eq!(report["gaps"]["missing"], 6);
    let (got, mask) = (floats(&desk.read("out.sigmf-data")), desk.read("mask"));
    let untouched = (0..got.len()).filter(|n| mask[n / 2] == 0);
    assert!(got.len() == want.len() && untouched.clone().count() > 1900);
    assert!(untouched.into_iter().all(|n| got[n] == want[n]));
    assert_eq!(desk.read_json("out.sigmf-meta")["global"]["core:datatype"], "cf32_le");
    assert_eq!(desk.read("mask").len(), 1006);
    // In WAV the parts are two channels.
    desk.report(&[&args[..], &["-o", "out.wav"]].concat());
    let (spec, got) = wav::read(&desk.path("out.wav"));
    assert!((spec.channels, spec.sample_rate) == (2, 48_000) && got == floats(&desk.read("out.sigmf-data")));
    // As an array of NumPy.
    let rows = [samples(0), samples(1)].map(|samples| bytes(&samples)).concat();
    desk.write("both.npy", npy("<c8", false, "(2, 500)", &rows));
    let streamed = desk.run(&["stream", "bank.json", "--input", "both.npy"], &[]);
    assert!(floats(&streamed.stdout) == interleaved(&fused(&parts[0]), &fused(&parts[1])), "{streamed:?}");
    desk.write("1.sigmf-meta", meta("rf32_le"));
    let mixed = ["fuse", "bank.json", "0.sigmf-meta", "1.sigmf-meta", "-o", "no.wav"];
    desk.refused(1, &mixed, &["0.sigmf-meta: complex samples, and 1.sigmf-meta holds real ones"]);
    let report: Value = desk.report(&["fuse", "bank.json", "both.npy", "-o", "x.wav", "--threads", "2"]);
    assert_eq!(report["samples"], 1000);
}

/// A tone as whole numbers of a converter, with `middle` for 0, one per line.
fn codes(middle: i32) -> String {
    let code = |k: u32| middle + (100.0 * (0.7 * f64::from(k)).sin()).round() as i32;
    (0..4096).map(|k| format!("{}\n", code(k))).collect()
}

#[test]
fn full_scale_of_tables_is_stated_or_warned_of() {
    let desk = Desk::new();
    desk.write("signed.txt", codes(0));
    desk.write("unsigned.dat", codes(128));
    let figures = |args: &[&str]| {
        let args = [&["measure", "--rate", "1MHz", "--json"][..], args].concat();
        serde_json::from_str::<Value>(&text(&desk.run(&args, &[]).stdout)).unwrap()
    };
    let level = 20.0 * (100.0f64 / 128.0).log10();
    for args in [
        &["signed.txt", "--full-scale", "8bits"][..],
        &["signed.txt", "--full-scale", "128"],
        &["unsigned.dat", "--full-scale", "u8bits"],
        &["signed.txt", "--format", "csv", "--full-scale", "128"],
    ] {
        let found = figures(args);
        let tone = found["tones"][0]["level_dbfs"].as_f64().unwrap();
        assert!((tone - level).abs() < 0.01, "{args:?}: {tone}");
        assert!(found["offset"]["value"].as_f64().unwrap().abs() < 1e-3, "{args:?}");
    }
    for (file, scale) in [("signed.txt", "8bits"), ("unsigned.dat", "u8bits")] {
        desk.warned(&["measure", "--rate", "1MHz", file], &[file, &format!("full scale of {scale}")]);
    }
}

#[test]
fn a_spec_states_the_full_scale_of_its_captures() {
    let desk = Desk::with_spec(THESIS);
    desk.write("codes.toml", THESIS.replacen("ratio", "full_scale = \"u8bits\"\nratio", 1));
    desk.good(&["design", "spec.toml", "-o", "plain.json"]);
    desk.good(&["design", "codes.toml", "-o", "codes.json"]);
    let code = |k: u32| (k * 37) % 256;
    let rows = |cell: &dyn Fn(u32) -> f64| -> String {
        (0..500).map(|k| format!("{},{}\n", cell(2 * k), cell(2 * k + 1))).collect()
    };
    desk.write("codes.csv", rows(&|k| f64::from(code(k))));
    desk.write("scaled.csv", rows(&|k| (f64::from(code(k)) - 128.0) / 128.0));
    desk.good(&["fuse", "plain.json", "scaled.csv", "-o", "scaled.wav"]);
    desk.good(&["fuse", "codes.json", "codes.csv", "-o", "codes.wav"]);
    desk.good(&["fuse", "plain.json", "codes.csv", "-o", "option.wav", "--full-scale", "u8bits"]);
    let read = |name: &str| std::fs::read(desk.path(name)).unwrap();
    assert!(read("scaled.wav") == read("codes.wav") && read("scaled.wav") == read("option.wav"));
}
