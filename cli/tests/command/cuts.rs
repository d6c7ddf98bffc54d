//! The same bits however a stream is cut.

use crate::support::random::Random;
use crate::support::{Desk, bytes, frames};
use hybank::bank::{Bank, StateSpace, SynthesisFilters};
use hybank::io::{PcmFormat, PcmFrames, SampleLayout};
use hybank::runtime::{Options, PcmOutput, Precision, Stream};
use hybank::units::Seconds;
use std::io::{Read, Write};

/// Lengths that add up to `total`, short and long ones, with zeros among them.
fn pieces(random: &mut Random, total: usize) -> Vec<usize> {
    let mut pieces = Vec::new();
    let mut left = total;
    while left > 0 {
        let longest = random.of(&[1, 3, 40, total]);
        let piece = random.count(0, longest).min(left);
        pieces.push(piece);
        left -= piece;
    }
    pieces
}

fn bank(channels: usize, ratio: usize, filters: SynthesisFilters) -> Bank {
    Bank { latency: 3, delays: vec![Seconds(0.0); channels], ..Bank::bare(filters, ratio) }
}

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random(seed);
    move || random.sample()
}

fn fir(channels: usize, ratio: usize, taps: usize) -> Bank {
    let mut noise = noise(7);
    let filter = |_| (0..taps).map(|_| noise()).collect();
    bank(channels, ratio, SynthesisFilters::Fir((0..channels).map(filter).collect()))
}

fn recursion(channels: usize, ratio: usize, states: usize) -> Bank {
    let mut noise = noise(8);
    let mut matrix = |rows: usize, cols: usize, scale: f64| -> Vec<Vec<f64>> {
        (0..rows).map(|_| (0..cols).map(|_| scale * noise()).collect()).collect()
    };
    let filter = StateSpace {
        // Rows that sum to less than 1 are stable.
        a: matrix(states, states, 0.9 / states as f64),
        b: matrix(states, channels, 1.0),
        c: matrix(ratio, states, 1.0),
        d: matrix(ratio, channels, 1.0),
    };
    bank(channels, ratio, SynthesisFilters::StateSpace(filter))
}

/// One stream as floats and as 16-bit integers, in pieces.
fn run(stream: &mut Stream, input: &[f32], pcm: bool, pieces: &[usize]) -> Vec<u8> {
    let (n, m) = (stream.channels(), stream.ratio());
    let mut out = Vec::new();
    let mut rest = input;
    for &piece in pieces {
        let (frames, after) = rest.split_at(piece * n);
        rest = after;
        if pcm {
            let coded: Vec<u8> = frames.iter().flat_map(|x| ((x * 32767.0) as i16).to_le_bytes()).collect();
            let layout = SampleLayout::packed(PcmFormat::S16Le);
            let mut fast = vec![0; piece * m * 3];
            let mut output = PcmOutput::packed(PcmFormat::S24Be, &mut fast);
            stream.run(&[PcmFrames { layout, channels: n, bytes: &coded }].as_slice(), &mut output).unwrap();
            out.extend(fast);
        } else {
            let mut fast = vec![0.0; piece * m];
            stream.process(frames, &mut fast).unwrap();
            out.extend(fast.iter().flat_map(|y| y.to_bits().to_le_bytes()));
        }
    }
    out
}

#[test]
fn ten_thousand_random_cuts_give_the_same_bits() {
    const FRAMES: usize = 300;
    let banks =
        [fir(2, 2, 24), fir(3, 4, 37), fir(1, 5, 9), fir(8, 8, 128), recursion(2, 2, 6), recursion(3, 2, 5)];
    let mut cuts = Random(1);
    let mut noise = noise(2);
    let mut streams: Vec<_> = banks
        .iter()
        .flat_map(|bank| {
            let precisions = [Precision::Single, Precision::Double];
            precisions.map(|precision| (bank, Options { precision, ..Options::default() }))
        })
        .map(|(bank, options)| {
            let mut stream = Stream::new(&bank.plan(options).unwrap());
            let input: Vec<f32> = (0..FRAMES * bank.delays.len()).map(|_| noise() as f32).collect();
            let whole = [false, true].map(|pcm| {
                stream.reset();
                run(&mut stream, &input, pcm, &[FRAMES])
            });
            (stream, input, whole)
        })
        .collect();
    for turn in 0..10_000 {
        let count = streams.len();
        let (stream, input, whole) = &mut streams[turn % count];
        let pcm = turn / count % 4 == 3;
        let pieces = pieces(&mut cuts, FRAMES);
        stream.reset();
        assert!(run(stream, input, pcm, &pieces) == whole[usize::from(pcm)], "turn {turn}: {pieces:?}");
    }
}

#[test]
fn pipes_that_drip_give_the_same_bytes() {
    let desk = Desk::new();
    let input = bytes(&frames(700));
    let whole = desk.run(&["stream", "bank.json"], &input).stdout;
    let mut cuts = Random(3);
    for turn in 0..30 {
        let mut child = desk.spawn(&["stream", "bank.json"]);
        let mut stdin = child.stdin.take().unwrap();
        let (pieces, input) = (pieces(&mut cuts, input.len()), input.clone());
        let feeder = std::thread::spawn(move || {
            let mut rest = &input[..];
            for piece in pieces {
                let (now, after) = rest.split_at(piece);
                stdin.write_all(now).unwrap();
                rest = after;
            }
        });
        let mut out = Vec::new();
        child.stdout.take().unwrap().read_to_end(&mut out).unwrap();
        feeder.join().unwrap();
        assert!(child.wait().unwrap().success());
        assert!(out == whole, "turn {turn}");
    }
}
