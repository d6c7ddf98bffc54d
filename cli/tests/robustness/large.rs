//! Inputs of very many parts: the time and the memory that they take grow with their length, not with its
//! square, and where the memory ends there is a message.

use crate::support::{Desk, THESIS};
use serde_json::json;

/// A kind of part that a file may have many of.
pub(crate) struct Large {
    /// What there is many of.
    pub(crate) parts: &'static str,
    pub(crate) file: &'static str,
    /// The run that reads it.
    pub(crate) line: &'static str,
    /// The file with so many of them.
    pub(crate) make: fn(usize) -> Vec<u8>,
}

const FUSE_WAV: &str = "fuse bank.json large.wav b.wav -o out.wav --force";
const FUSE_SIGMF: &str = "fuse bank.json large.sigmf-meta -o out.sigmf-meta --force --gaps zero";
const LOST: &str = "stream bank.json --input raw --gaps zero --lost large.lost -o out.raw --force";
const VERIFY: &str = "verify large.json";
const SIMULATE: &str = "simulate large.toml --source step@3 --samples 50 -o captures --force";
const IMPORT: &str = "import spec.toml large.csv -o imported.json --force";

/// Everything that the readers count.
pub(crate) const LARGE: [Large; 22] = [
    Large { parts: "lists before fmt", file: "large.wav", line: FUSE_WAV, make: |n| wav(b"LIST", n, 0) },
    Large { parts: "notes before fmt", file: "large.wav", line: FUSE_WAV, make: |n| wav(b"iXML", n, 0) },
    Large { parts: "unknown chunks", file: "large.wav", line: FUSE_WAV, make: |n| wav(b"what", n, 0) },
    Large {
        parts: "notes after the samples",
        file: "large.wav",
        line: FUSE_WAV,
        make: |n| wav(b"iXML", 0, n),
    },
    Large { parts: "captures", file: "large.sigmf-meta", line: FUSE_SIGMF, make: |n| sigmf(n, 1, 0) },
    Large { parts: "annotations", file: "large.sigmf-meta", line: FUSE_SIGMF, make: |n| sigmf(1, n, 0) },
    Large { parts: "both", file: "large.sigmf-meta", line: FUSE_SIGMF, make: |n| sigmf(n / 2, n / 2, 0) },
    Large { parts: "extensions", file: "large.sigmf-meta", line: FUSE_SIGMF, make: |n| sigmf(1, 1, n) },
    Large {
        parts: "invalid samples",
        file: "large.lost",
        line: LOST,
        make: |n| lines(n, |k| format!("{{\"channel\":{},\"first\":{},\"length\":1}}", 1 + k % 2, n - k)),
    },
    Large {
        parts: "samples left out",
        file: "large.lost",
        line: LOST,
        make: |n| lines(n, |k| format!("{{\"sample_start\":{k},\"global_index\":{}}}", 2 * k)),
    },
    Large {
        parts: "rows of a table",
        file: "large.csv",
        line: "fuse bank.json large.csv -o out.wav --force",
        make: |n| lines(n, |k| format!("{},0.5", k % 7)),
    },
    Large {
        parts: "columns of a table",
        file: "large.csv",
        line: "fuse bank.json large.csv -o out.wav --force",
        make: |n| "1,".repeat(n).into_bytes(),
    },
    Large {
        parts: "variables",
        file: "large.mat",
        line: "fuse bank.json large.mat -o out.wav --force",
        make: variables,
    },
    Large { parts: "taps", file: "large.json", line: VERIFY, make: |n| bank(2, n / 2) },
    Large { parts: "channels of a bank", file: "large.json", line: VERIFY, make: |n| bank(n, 1) },
    Large {
        parts: "channels",
        file: "large.toml",
        line: SIMULATE,
        make: |n| (THESIS.to_owned() + &"[[channel]]\ndelay = 0.5\n".repeat(n)).into_bytes(),
    },
    Large {
        parts: "unknown keys",
        file: "large.toml",
        line: SIMULATE,
        make: |n| [lines(n, |k| format!("key{k} = 1")), THESIS.into()].concat(),
    },
    Large {
        parts: "coefficients",
        file: "large.toml",
        line: SIMULATE,
        make: |n| THESIS.replace("num = [0.25]", &format!("num = [{}]", "1.0, ".repeat(n))).into_bytes(),
    },
    Large {
        parts: "comments",
        file: "large.toml",
        line: SIMULATE,
        make: |n| ("# nothing\n".repeat(n) + THESIS).into_bytes(),
    },
    Large {
        parts: "rows of taps",
        file: "large.csv",
        line: IMPORT,
        make: |n| lines(n, |k| format!("{k},0.5")),
    },
    Large {
        parts: "columns of taps",
        file: "large.csv",
        line: IMPORT,
        make: |n| "1,".repeat(n).into_bytes(),
    },
    Large {
        parts: "points of a response",
        file: "response.csv",
        line: "simulate measured.toml --source step@3 --samples 50 -o captures --force",
        make: |n| {
            let rows = lines(n, |k| format!("{},{},0", k + 1, -1e-5 * k as f64));
            [b"frequency (Hz), gain (dB), phase (deg)\n".to_vec(), rows].concat()
        },
    },
];

/// What the runs read besides.
pub(crate) fn desk() -> Desk {
    let desk = crate::work::desk(40);
    desk.write("raw", (0..320u32).map(|i| (i * 37 % 251) as u8).collect::<Vec<u8>>());
    let measured = "{ response = \"response.csv\", order = 2 }";
    desk.write("measured.toml", THESIS.replace("{ num = [0.25], den = [1.0, 1.0, 0.25] }", measured));
    desk
}

fn lines(n: usize, line: impl Fn(usize) -> String) -> Vec<u8> {
    (0..n).map(|k| line(k) + "\n").collect::<String>().into_bytes()
}

/// Eight samples after `before` chunks and before `after` ones.
fn wav(id: &[u8; 4], before: usize, after: usize) -> Vec<u8> {
    let chunk =
        |id: &[u8; 4], content: &[u8]| [&id[..], &(content.len() as u32).to_le_bytes(), content].concat();
    let fmt = [1u16, 1, 24_000, 0, 48_000, 0, 2, 16].map(u16::to_le_bytes).concat();
    let note = chunk(id, b"INFO");
    let parts =
        [note.repeat(before), chunk(b"fmt ", &fmt), chunk(b"data", &[7; 16]), note.repeat(after)].concat();
    chunk(b"RIFF", &[&b"WAVE"[..], &parts].concat())
}

fn sigmf(captures: usize, annotations: usize, extensions: usize) -> Vec<u8> {
    let list = |n: usize, item: fn(usize) -> serde_json::Value| (0..n).map(item).collect::<Vec<_>>();
    let meta = json!({
        "global": { "core:datatype": "ri8", "core:num_channels": 2, "core:sample_rate": 24_000.0, "core:dataset": "raw",
            "core:version": "1.0.0", "core:extensions": list(extensions, |k| json!({ "name": k.to_string(), "optional": true })) },
        "captures": list(captures, |k| json!({ "core:sample_start": k, "core:global_index": 2 * k, "core:frequency": k })),
        "annotations": list(annotations, |k| json!({ "core:sample_start": k % 100, "core:comment": k.to_string() })),
    });
    meta.to_string().into_bytes()
}

/// Numbers called a0, a1, ..
fn variables(n: usize) -> Vec<u8> {
    let element = |kind: u32, content: &[u8]| {
        let padding = vec![0; content.len().next_multiple_of(8) - content.len()];
        [&kind.to_le_bytes()[..], &(content.len() as u32).to_le_bytes(), content, &padding[..]].concat()
    };
    let number = |k: usize| {
        let class = element(6, &[6u32, 0].map(u32::to_le_bytes).concat());
        let shape = element(5, &[1u32, 1].map(u32::to_le_bytes).concat());
        let name = element(1, format!("a{k}").as_bytes());
        element(14, &[class, shape, name, element(9, &1.0f64.to_le_bytes())].concat())
    };
    let mut header = b"MATLAB 5.0 MAT-file".to_vec();
    header.resize(124, b' ');
    header.extend([0, 1, b'I', b'M']);
    [header, (0..n).flat_map(number).collect()].concat()
}

pub(crate) fn bank(channels: usize, taps: usize) -> Vec<u8> {
    let taps: Vec<f64> = (0..taps).map(|k| (k % 5) as f64).collect();
    let channel = json!({ "delay": 0.0, "taps": taps });
    let bank = json!({ "format": "hybank-bank", "version": 1, "spec": null, "fast_period": 1.0, "ratio": 2, "latency": 3,
        "method": "fir", "channels": vec![channel; channels], "state_space": null,
        "gamma": { "upper": null, "lower": null, "noncausal": null } });
    bank.to_string().into_bytes()
}
