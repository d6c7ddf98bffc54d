//! Length and latency of all outputs of a stream, and the frames that it is processed by.

use super::support::{
    Bank, FIR_ALGORITHMS, Filters, Noise, definition, fir_bank, precise, random_taps, rotation_bank, start,
    state_space_definition, worst,
};
use crate::{Algorithm, Options, Precision, ProcessError, Stream};

/// All outputs by the definition, zeros after the input.
fn outputs(bank: &Bank, input: &[f64]) -> Vec<f64> {
    match &bank.filters {
        Filters::Fir(taps) => definition(taps, bank.ratio, input),
        Filters::StateSpace(filter) => state_space_definition(filter, input),
    }
}

/// Every algorithm with banks that it runs, designed to be 0 to 3 output samples late.
fn banks(noise: &mut Noise) -> Vec<(Bank, Options)> {
    let mut banks = Vec::new();
    for ((n, m, count), latency) in [(1, 1, 9), (2, 3, 30), (5, 2, 64), (3, 4, 90)].into_iter().zip(0..) {
        let bank = Bank { latency, ..fir_bank(random_taps(n, count, noise), m) };
        banks.extend(FIR_ALGORITHMS.map(|algorithm| (bank.clone(), algorithm)));
    }
    banks.extend((0..4).map(|latency| (Bank { latency, ..rotation_bank() }, Algorithm::Direct)));
    banks.into_iter().map(|(bank, algorithm)| (bank, precise(algorithm, Precision::Double))).collect()
}

/// All outputs of calls of at most `call` frames and of the flush.
fn flushed(stream: &mut Stream, input: &[f64], call: usize) -> Vec<f64> {
    let (n, m) = (stream.channels(), stream.ratio());
    let mut out = vec![f64::NAN; input.len() / n * m];
    for (x, y) in input.chunks(call * n).zip(out.chunks_mut(call * m)) {
        assert_eq!(stream.process(x, y), Ok(y.len()));
    }
    let mut tail = vec![f64::NAN; stream.plan().flush_frames() * m];
    assert_eq!(stream.flush(&mut tail.as_mut_slice()), Ok(tail.len()));
    out.extend(tail);
    out
}

#[test]
fn flushing_brings_out_all_outputs_of_the_definition_and_no_more() {
    let mut noise = Noise(46);
    for (bank, options) in banks(&mut noise) {
        let (n, m) = (bank.channel_count(), bank.ratio);
        let stream = start(&bank, options).unwrap();
        let plan = stream.plan();
        let late = plan.extra_latency();
        assert_eq!(plan.latency(), bank.latency + late);
        for frames in [0, 1, 150, 701] {
            let input: Vec<f64> = (0..n * frames).map(|_| noise.next()).collect();
            let mut padded = input.clone();
            padded.resize((frames + plan.flush_frames()) * n, 0.0);
            let want = outputs(&bank, &padded);
            for call in [1, 7, 64, 65, 1000] {
                let case = format!("{} N {n} M {m}, {frames} frames by {call}", plan.algorithm());
                let mut stream = Stream::new(stream.plan());
                let all = flushed(&mut stream, &input, call);
                // The samples of the whole input, moved by the latency; the last frame may have some more.
                assert!((0..m).contains(&(all.len() - m * frames - plan.latency())), "{case}: {}", all.len());
                assert_eq!(stream.position() as usize * m, all.len(), "{case}");
                assert!(all[..late.min(all.len())].iter().all(|&y| y == 0.0), "{case}");
                let error = worst(&want[..all.len() - late], &all[late..]);
                assert!(error < 1e-12, "{case}: {error:e}");
            }
        }
    }
}

#[test]
fn a_flush_without_room_leaves_the_stream_as_it_was() {
    let mut noise = Noise(47);
    for (bank, options) in banks(&mut noise).into_iter().filter(|(bank, _)| bank.latency > 0) {
        let mut stream = start(&bank, options).unwrap();
        let wanted = stream.plan().flush_frames() * bank.ratio;
        let refused = stream.flush(&mut vec![0.0; wanted - 1].as_mut_slice());
        assert_eq!(refused, Err(ProcessError::OutputTooShort { given: wanted - 1, wanted }));
        assert_eq!(stream.position(), 0);
    }
}

/// The outputs that belong to the frames from `from` on, of a stream that begins at frame `begin` of the
/// input.
fn outputs_from(stream: &Stream, input: &[f64], begin: usize, from: usize) -> Vec<f64> {
    let (n, m) = (stream.channels(), stream.ratio());
    let all = flushed(&mut Stream::new(stream.plan()), &input[begin * n..], 64);
    all[stream.plan().extra_latency() + (from - begin) * m..].to_vec()
}

#[test]
fn streams_that_begin_an_alignment_apart_have_the_same_bits() {
    let mut noise = Noise(48);
    for (bank, options) in banks(&mut noise) {
        let stream = start(&bank, options).unwrap();
        let Some(history) = stream.plan().history() else { continue };
        let alignment = stream.plan().alignment();
        let frames = 3 * alignment + history + 300;
        let input: Vec<f64> = (0..bank.channel_count() * frames).map(|_| noise.next()).collect();
        // A whole number of alignments that the history fits in.
        let known = history.next_multiple_of(alignment);
        let same = |begin: usize| {
            let from = begin + known;
            outputs_from(&stream, &input, 0, from) == outputs_from(&stream, &input, begin, from)
        };
        for begin in [alignment, 2 * alignment] {
            assert!(same(begin), "{} aligned at {begin}", stream.plan().algorithm());
        }
        assert!(alignment == 1 || !same(1), "{}: one frame off", stream.plan().algorithm());
    }
}

#[test]
fn recursions_from_a_zero_state_have_the_same_bits_an_alignment_apart() {
    let mut noise = Noise(49);
    let stream = start(&rotation_bank(), Options::default()).unwrap();
    let alignment = stream.plan().alignment();
    assert_eq!((alignment, stream.plan().history()), (64, None));
    let input: Vec<f64> = (0..500).map(|k| if k < 2 * alignment { 0.0 } else { noise.next() }).collect();
    let from = 2 * alignment;
    assert_eq!(outputs_from(&stream, &input, 0, from), outputs_from(&stream, &input, from, from));
}
