//! What recordings say besides their samples, and what of it comes out. As a user runs it.

use crate::support::{Desk, THESIS, bytes, channel, frames, text, wav, words};
use serde_json::{Value, json};

/// A recording of one channel: three samples are lost before its sample 40.
fn meta(more: &str, annotations: &str) -> String {
    format!(
        r#"{{ "global": {{ "core:datatype": "rf32_le", "core:sample_rate": 24000, "core:version": "1.0.0",
        "core:author": "A. Listener", "core:hw": "two receivers", "antenna:gain": 3.5, "core:sha512": "ab",
        "core:extensions": [{{ "name": "antenna", "version": "1.0.0", "optional": true }}] }},
        "captures": [
        {{ "core:sample_start": 0, "core:global_index": 1000, "core:frequency": 1e8{more} }},
        {{ "core:sample_start": 40, "core:global_index": 1043, "core:frequency": 2e8 }}],
        "annotations": [{annotations}] }}"#
    )
}

/// The first channel says more than the second, and an annotation of its own.
fn desk() -> Desk {
    let desk = Desk::with_spec(THESIS);
    desk.report(&["design", "spec.toml", "-o", "bank.json"]);
    let input = frames(100);
    let shared = r#"{ "core:sample_start": 10, "core:sample_count": 5, "core:label": "burst" }"#;
    let own = r#", { "core:sample_start": 38, "core:sample_count": 4 }, { "core:sample_start": -1 },
        { "core:sample_start": 97, "core:sample_count": 50, "core:comment": "to the end" }"#;
    let time = r#", "core:datetime": "2026-01-02T03:04:05Z""#;
    for (name, meta) in [("a", meta(time, &[shared, own].concat())), ("b", meta("", shared))] {
        desk.write(&format!("{name}.sigmf-meta"), meta);
    }
    desk.write("a.sigmf-data", bytes(&channel(&input, 0)));
    desk.write("b.sigmf-data", bytes(&channel(&input, 1)));
    desk
}

/// (start, count, label or comment) of each annotation.
fn annotations(meta: &Value) -> Vec<(u64, u64, String)> {
    let list = meta["annotations"].as_array().unwrap();
    let word = |annotation: &Value, key: &str| annotation[key].as_str().map(str::to_owned);
    let of = |annotation: &Value| {
        let count = |key: &str| annotation[key].as_u64().unwrap();
        let said = word(annotation, "core:comment").or_else(|| word(annotation, "core:label"));
        (count("core:sample_start"), count("core:sample_count"), said.unwrap_or_default())
    };
    list.iter().map(of).collect()
}

#[test]
fn sigmf_keeps_what_it_is_for() {
    let desk = desk();
    let inputs = ["--gaps", "--force"];
    let fuse = ["fuse", "bank.json", "a.sigmf-meta", "b.sigmf-meta", "-o", "fused.sigmf-meta"];
    let stream = ["stream", "bank.json", "--input", "a.sigmf-meta", "--input", "b.sigmf-meta"];
    let live = [&stream[..], &["-o", "live.sigmf-meta"]].concat();
    for (args, name, shift, samples) in
        [(&fuse[..], "fused.sigmf-meta", 0, 206), (&live, "live.sigmf-meta", 10, 206)]
    {
        desk.warned(&[args, &inputs].concat(), &[]);
        let meta = desk.read_json(name);
        let global = &meta["global"];
        assert_eq!(global["core:author"], "A. Listener");
        assert_eq!((&global["core:hw"], &global["antenna:gain"]), (&json!("two receivers"), &json!(3.5)));
        assert!(global.get("core:sha512").is_none(), "that of another file");
        assert_eq!(global["hybank:bank_digest"], desk.read_json("bank.json")["digest"]);
        let names: Vec<_> = global["core:extensions"]
            .as_array()
            .unwrap()
            .iter()
            .map(|extension| &extension["name"])
            .collect();
        assert_eq!(names, ["antenna", "hybank"]);
        // Sample 40 of the input is frame 43, two output samples each.
        let mut captures = vec![
            json!({ "core:sample_start": shift, "core:frequency": 1e8, "core:datetime": "2026-01-02T03:04:05Z" }),
            json!({ "core:sample_start": 86 + shift, "core:frequency": 2e8 }),
        ];
        if shift > 0 {
            captures.insert(0, json!({ "core:sample_start": 0, "core:frequency": 1e8 }));
        }
        assert_eq!(meta["captures"], Value::Array(captures));
        let gap = |channel: u64| (80 + shift, 6, format!("channel {channel}: 3 samples missing"));
        let want = [
            (20 + shift, 10, "burst".to_owned()),
            // Two samples before the break and two after it.
            (76 + shift, 14, String::new()),
            gap(1),
            gap(2),
            (200 + shift, (samples - 200_u64).saturating_sub(shift), "to the end".to_owned()),
        ];
        let mut found = annotations(&meta);
        found.sort();
        assert_eq!(found, want.into_iter().filter(|note| note.0 < samples).collect::<Vec<_>>());
    }
}

/// A chunk with its pad byte.
fn chunk(id: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = [&id[..], &(content.len() as u32).to_le_bytes(), content].concat();
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    bytes
}

#[test]
fn what_a_wav_file_says_of_the_recording_survives() {
    let desk = Desk::new();
    let input = frames(51);
    wav::write_pair(&desk, &channel(&input, 0), &channel(&input, 1));
    let plain = desk.read("a.wav");
    let mut bext = vec![b'x'; 603];
    bext[338..346].copy_from_slice(&48_000_u64.to_le_bytes());
    let info = [&b"INFO"[..], &chunk(b"INAM", b"a tone\0")].concat();
    // Before the format, after the samples, and what holds positions or is unknown.
    let (before, after) = (
        [chunk(b"bext", &bext), chunk(b"cue ", &[0; 4])],
        [chunk(b"LIST", &info), chunk(b"LIST", b"adtl1234")],
    );
    let content = [&plain[..12], &before.concat(), &plain[12..], &after.concat()].concat();
    let size = (content.len() as u32 - 8).to_le_bytes();
    desk.write("noted.wav", [&content[..4], &size, &content[8..]].concat());
    desk.good(&["fuse", "bank.json", "a.wav", "b.wav", "-o", "plain-out.wav"]);
    desk.good(&["fuse", "bank.json", "noted.wav", "b.wav", "-o", "out.wav"]);
    assert_eq!(wav::samples(&desk, "out.wav"), wav::samples(&desk, "plain-out.wav"));
    let found = desk.read("out.wav");
    let count = |needle: &[u8]| found.windows(needle.len()).filter(|window| *window == needle).count();
    // One sample of the input is two of the output.
    bext[338..346].copy_from_slice(&96_000_u64.to_le_bytes());
    assert_eq!((count(&chunk(b"bext", &bext)), count(&chunk(b"LIST", &info))), (1, 1));
    assert_eq!((count(b"cue "), count(b"adtl")), (0, 0));
    assert_eq!(found[4..8], (found.len() as u32 - 8).to_le_bytes());
    // A file on standard input has an end too.
    let stdin = std::fs::File::open(desk.path("noted.wav")).unwrap();
    let args = words("stream bank.json --format wav --input - --input b.wav -o live.wav");
    assert!(desk.command(&args).stdin(stdin).status().unwrap().success());
    assert!(desk.read("live.wav").windows(6).any(|window| window == b"a tone"));
    // The causal output begins earlier by the latency of 3 samples.
    desk.good(&["fuse", "bank.json", "noted.wav", "b.wav", "-o", "causal.wav", "--keep-latency"]);
    let causal = desk.read("causal.wav");
    let at = causal.windows(4).position(|window| window == b"bext").unwrap() + 8 + 338;
    assert_eq!(causal[at..at + 8], 95_997_u64.to_le_bytes());
}

/// The samples and what their metadata state of them, SHA-512; trailing bytes are part of the file.
#[test]
fn a_digest_of_the_samples_is_checked() {
    let desk = desk();
    let zeros = "af3a1e15594a0bf08ae34a5948037ef492e71ee33d5d4ac9f24b18adf99a3456\
                 3ab40ba8f47f2adff5d928f18d8a8cd60fc78e654e4d6cf962292d2f606def66";
    let meta = |digest: &str, trailing: usize| {
        json!({ "global": { "core:datatype": "rf32_le", "core:num_channels": 2, "core:version": "1.0.0",
            "core:sample_rate": 24_000, "core:trailing_bytes": trailing, "core:sha512": digest } })
    };
    let fuse = ["fuse", "bank.json", "x.sigmf-meta", "-o", "x.wav", "--strict"];
    let strict = [&fuse[..], &["--force"]].concat();
    let altered = ["x.sigmf-meta", "core:sha512", "changed or damaged"];
    let said = |args: &[&str]| text(&desk.run(args, &[]).stderr);
    desk.write("x.sigmf-data", [0; 400]);
    for (digest, trailing) in [(zeros.to_owned(), 0), (zeros.to_uppercase(), 80)] {
        desk.write("x.sigmf-meta", meta(&digest, trailing).to_string());
        desk.report(&fuse);
    }
    let mut changed = [0; 400];
    changed[399] = 1;
    for bytes in [&changed[..], &[0; 392]] {
        desk.write("x.sigmf-data", bytes);
        desk.refused(1, &strict, &altered);
        let warned = said(&[&fuse[..5], &["--force"]].concat());
        assert!(altered.iter().all(|word| warned.contains(word)), "{warned}");
    }
}
