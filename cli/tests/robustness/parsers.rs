//! Damaged files, by the thousand: every parser gives an answer or a message that names the file, and never
//! panics. The seeds are those of the fuzz targets, the damage is the same in every run.

use crate::support::random::Random;
use crate::support::repository;
use hybank::analog::fit::{MeasuredResponse, vector_fit};
use hybank::bank::Bank;
use hybank::interchange::{taps_of_csv, taps_of_npy};
use hybank::io::table::{TableOptions, TableReader};
use hybank::io::wav::WavReader;
use hybank::io::{LostSamples, SigmfMeta, npy_header, open_mat};
use hybank::messages::shown;
use hybank::spec::Spec;
use std::fs;
use std::io::{Cursor, Read};
use trials::rounds;

/// Damaged copies of each seed.
const COPIES: usize = 3000;

/// One to four faults.
pub(crate) fn damage(dice: &mut Random, seed: &[u8]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    (0..=dice.below(4)).for_each(|_| fault(dice, &mut bytes));
    bytes
}

fn fault(dice: &mut Random, bytes: &mut Vec<u8>) {
    let place = dice.below(bytes.len() + 1);
    let length = (1 + dice.below(8)).min(bytes.len() - place);
    match dice.below(6) {
        0 => bytes.truncate(place),
        1 => drop(bytes.drain(place..place + length)),
        2 => bytes.splice(place..place, bytes[place..place + length].to_vec()).for_each(drop),
        3 => bytes.insert(place, dice.below(256) as u8),
        4 => bytes[place..place + length].fill(dice.of(&[0, 0xFF, 0x7F, 0x80, 0x1B, b'9', b'"'])),
        _ => bytes[place..place + length.min(1)].iter_mut().for_each(|byte| *byte ^= 1 << dice.below(8)),
    }
}

/// Damaged copies of all seeds of a fuzz target, each of which is answered or refused: how many were.
fn tried(target: &str, mut answer: impl FnMut(&[u8]) -> Option<()>) -> [usize; 2] {
    let mut counts = [0; 2];
    damaged(target, |bytes| counts[usize::from(answer(bytes).is_none())] += 1);
    counts
}

/// The same of texts, which are rarely answered: how many were.
fn texts<T, E: std::fmt::Display>(target: &str, parse: impl Fn(&str) -> Result<T, E>) -> usize {
    tried(target, |bytes| answered(parse(&String::from_utf8_lossy(bytes))).map(drop))[0]
}

/// Damaged copies of all seeds of a fuzz target.
fn damaged(target: &str, mut check: impl FnMut(&[u8])) {
    let folder = repository("fuzz/seeds").join(target);
    let mut seeds: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    seeds.sort();
    assert!(!seeds.is_empty());
    let mut dice = Random(1);
    println!("{target}: {} seeds, {} damaged copies of each", seeds.len(), rounds(COPIES));
    for seed in seeds.iter().map(|path| fs::read(path).unwrap()) {
        check(&seed);
        (0..rounds(COPIES)).for_each(|_| check(&damage(&mut dice, &seed)));
    }
}

/// A message is one that names its file, and nothing foreign is left in it; gives whether there was an
/// answer.
fn answered<T, E: std::fmt::Display>(result: Result<T, E>) -> Option<T> {
    let check = |error: E| {
        let message = error.to_string();
        assert!(message.starts_with("seed") && shown(&message) == message, "{message:?}");
    };
    result.map_err(check).ok()
}

#[test]
fn wav_headers() {
    let counts = tried("wav", |bytes| {
        let mut reader = answered(WavReader::new(bytes, "seed"))?;
        let frame = reader.header().frame_bytes();
        let mut samples = Vec::new();
        reader.read_to_end(&mut samples).unwrap();
        assert!(samples.len() <= bytes.len() && frame > 0);
        Some(())
    });
    // Neither all nor nothing may come through.
    assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
}

#[test]
fn metadata_and_lost_samples() {
    let answers = [
        texts("sigmf", |text| SigmfMeta::parse(text, "seed")),
        texts("lost", |text| LostSamples::parse(text, "seed")),
    ];
    assert!(answers.iter().all(|count| (20..rounds(COPIES)).contains(count)), "{answers:?}");
}

#[test]
fn tables_and_arrays_of_samples() {
    let (mut answers, mut refusals) = (0, 0);
    damaged("csv", |bytes| {
        let Some(mut reader) = answered(TableReader::new(bytes, "seed", &TableOptions::default())) else {
            return refusals += 1;
        };
        // Lines that are missing by the times are NaN, and may be many.
        let (mut held, mut reads) = (0, 0);
        while let Some(frame) = answered(reader.next_frame()).flatten().filter(|_| reads < 1000) {
            held += frame.iter().filter(|sample| !sample.is_nan()).count();
            reads += 1;
        }
        answers += reads;
        assert!(held <= bytes.len() + 1);
    });
    assert!(answers > 1000 && refusals > 100, "{answers} {refusals}");
    let counts = tried("npy", |bytes| {
        let header = answered(npy_header(&mut &bytes[..], "seed"))?;
        assert!(header.sample_bytes() > 0 && header.offset <= bytes.len() as u64);
        Some(())
    });
    assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
}

#[test]
fn arrays_of_matlab() {
    let counts = tried("mat", |bytes| {
        let mut array = answered(open_mat(&mut Cursor::new(bytes), None, "seed"))?;
        let header = array.header();
        let mut frames = Vec::new();
        array.read_to_end(&mut frames).unwrap();
        assert_eq!(frames.len() as u64, header.promised.unwrap() * header.frame_bytes() as u64);
        Some(())
    });
    assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
}

#[test]
fn specs_and_banks() {
    let specs = texts("spec", |text| Spec::from_toml(text, "seed"));
    let banks = texts("bank", |text| Bank::from_json(text, "seed"));
    assert!(specs + banks > 20, "{specs} {banks}");
}

#[test]
fn taps_of_other_tools() {
    let (mut answers, mut refusals) = (0, 0);
    damaged("taps", |bytes| {
        for taps in [taps_of_csv(bytes), taps_of_npy(bytes)] {
            match taps {
                Err(error) => refusals += usize::from(!error.to_string().is_empty()),
                Ok(taps) => {
                    answers += 1;
                    assert!(taps.iter().all(|list| list.len() == taps[0].len()));
                    assert!(taps.iter().flatten().all(|tap| tap.is_finite()));
                }
            }
        }
    });
    assert!(answers > 500 && refusals > 1000, "{answers} {refusals}");
}

#[test]
fn measured_responses() {
    let (mut answers, mut refusals, mut models) = (0, 0, 0);
    damaged("response", |bytes| {
        let text = String::from_utf8_lossy(bytes);
        for measured in [
            MeasuredResponse::from_csv(&text),
            MeasuredResponse::from_touchstone(&text, 1, None),
            MeasuredResponse::from_touchstone(&text, 2, None),
        ] {
            match measured {
                Err(error) => refusals += usize::from(!error.to_string().is_empty()),
                Ok(measured) => {
                    answers += 1;
                    assert!(measured.points().windows(2).all(|pair| pair[0].0.0 < pair[1].0.0));
                    // Fits take longer than reading: some of them.
                    if answers % 50 == 0 {
                        models +=
                            usize::from(vector_fit(&measured, 3).is_ok_and(|m| m.filter.check().is_ok()));
                    }
                }
            }
        }
    });
    assert!(answers > 500 && refusals > 1000 && models > 5, "{answers} {refusals} {models}");
}
