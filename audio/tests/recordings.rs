//! Recordings made by ffmpeg and sox (make.sh) against the formula of their samples.

use hybank_audio::{AudioError, AudioReader};
use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};

const FRAMES: usize = 3000;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// Sample n of both channels, full scale 1.
fn formula(n: usize) -> [f64; 2] {
    [1000.0, 1700.0].map(|f| (16000.0 * (TAU * f * n as f64 / 24e3).sin()).round() / 32768.0)
}

fn read(path: &Path) -> Result<(AudioReader, Vec<f64>), AudioError> {
    let mut reader = AudioReader::open(path)?;
    let (mut all, mut block) = (Vec::new(), Vec::new());
    while reader.next_block(&mut block)? {
        assert!(!block.is_empty() && block.len() % reader.channels() == 0);
        all.append(&mut block);
    }
    Ok((reader, all))
}

#[test]
fn lossless_recordings_keep_every_bit() {
    let want: Vec<f64> = (0..FRAMES).flat_map(formula).collect();
    for name in ["two.flac", "two.aiff"] {
        let (reader, samples) = read(&fixture(name)).unwrap();
        assert_eq!((reader.rate(), reader.channels(), reader.promised()), (24_000, 2, Some(3000)), "{name}");
        assert!(samples == want, "{name}");
    }
}

/// The padding that an encoder adds at both ends is cut off, so that the samples are at their place.
#[test]
fn lossy_recordings_are_near_and_in_time() {
    for (name, least) in [("two.mp3", 25.0), ("two.ogg", 20.0)] {
        let (reader, samples) = read(&fixture(name)).unwrap();
        assert_eq!((reader.rate(), reader.channels(), reader.promised()), (24_000, 2, None), "{name}");
        assert_eq!(samples.len(), 2 * FRAMES, "{name}");
        let (mut signal, mut error) = (0.0, 0.0);
        for n in 200..FRAMES - 200 {
            for (channel, want) in formula(n).into_iter().enumerate() {
                signal += want * want;
                error += (samples[2 * n + channel] - want).powi(2);
            }
        }
        let snr = 10.0 * f64::log10(signal / error);
        assert!(snr > least, "{name}: {snr:.1} dB");
    }
}

#[test]
fn what_cannot_be_decoded_is_refused() {
    let folder = std::env::temp_dir().join(format!("hybank-audio-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let message = |path: &Path| read(path).unwrap_err().to_string();
    let text = message(&write("text.flac", b"no recording at all"));
    assert!(text.contains("no FLAC, MP3, AIFF or Ogg"), "{text}");
    let whole = fs::read(fixture("two.flac")).unwrap();
    let cut = message(&write("cut.flac", &whole[..whole.len() - 1000]));
    assert!(cut.contains("damaged after"), "{cut}");
    let absent = message(&folder.join("absent.flac"));
    assert!(absent.contains("cannot read it"), "{absent}");
    fs::remove_dir_all(&folder).unwrap();
}

/// Damaged copies: an answer or a message, never a panic. `HYBANK_CAMPAIGN=N` damages N times as many.
#[test]
fn damaged_recordings_are_answered() {
    let path = std::env::temp_dir().join(format!("hybank-audio-damaged-{}", std::process::id()));
    let rounds = 150 * std::env::var("HYBANK_CAMPAIGN").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    // Knuth's generator of linear congruences; its upper bits are used.
    let mut state = 1u64;
    let mut below = move |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    let (mut answers, mut refusals) = (0, 0);
    for name in ["two.flac", "two.aiff", "two.mp3", "two.ogg"] {
        let whole = fs::read(fixture(name)).unwrap();
        for _ in 0..rounds {
            let mut bytes = whole.clone();
            for _ in 0..=below(4) {
                // Half of the faults are in the header.
                let room = if below(2) == 0 { bytes.len().min(200) } else { bytes.len() };
                let place = below(room.max(1)).min(bytes.len() - 1);
                match below(4) {
                    0 => bytes.truncate(place.max(1)),
                    1 => bytes[place] ^= 1 << below(8),
                    2 => bytes[place] = [0, 0xFF, 0x7F, 0x80][below(4)],
                    _ => drop(bytes.drain(place..(place + 1 + below(8)).min(bytes.len() - 1).max(place))),
                }
            }
            fs::write(&path, &bytes).unwrap();
            match read(&path) {
                Ok((reader, samples)) => {
                    answers += 1;
                    assert_eq!(samples.len() % reader.channels(), 0);
                }
                Err(error) => refusals += usize::from(!error.to_string().is_empty()),
            }
        }
    }
    fs::remove_file(&path).unwrap();
    assert!(answers > rounds / 3 && refusals > rounds / 3, "{answers} {refusals}");
}
