use super::*;
use crate::io::block::NumberFrames;
use crate::io::{PcmFormat, SampleLayout};
use crate::runtime::PcmFrames;

/// A block of as many frames as the bytes hold.
fn block(header: &StreamHeader, bytes: &[u8]) -> Block {
    let mut block = Block::default();
    block.begin(header);
    block.decode(&PcmFrames { layout: header.layout, channels: header.channels, bytes }).unwrap();
    block
}

/// Frames of big-endian 16-bit samples 0, 1, 2, ..
fn input(channels: usize, breaks: &[(u64, u64)]) -> AlignedInput {
    let layout = SampleLayout::packed(PcmFormat::S16Be);
    let mut input = AlignedInput::new(StreamHeader::real(layout, channels));
    input.lose(breaks.iter().map(|&(frame, lost)| Break { frame, lost }).collect());
    input
}

/// All frames, from blocks of `block` frames, in steps of at most `step`.
fn run(mut input: AlignedInput, frames: usize, block: usize, step: usize) -> Vec<Option<i16>> {
    let channels = input.header.channels;
    let bytes: Vec<u8> = (0..(frames * channels) as i16).flat_map(i16::to_be_bytes).collect();
    let mut blocks = bytes.chunks(2 * channels * block);
    let mut out = Vec::new();
    loop {
        if input.ready() == 0 && !input.ended() {
            match blocks.next() {
                Some(bytes) => drop(input.refill(self::block(&input.header, bytes))),
                None => input.end(),
            }
            continue;
        }
        if input.is_over() {
            return out;
        }
        let count = input.ready().min(step);
        input.prepare(count);
        let NumberFrames::F32(frames) = input.view(count, 1).real else { panic!("16 bits are f32") };
        out.extend(frames.samples().iter().map(|x| x.is_finite().then_some((x * 32768.0) as i16)));
        input.advance(count);
    }
}

#[test]
fn lost_frames_come_out_as_nan_however_they_are_cut() {
    let breaks = [(0, 2), (3, 2893)];
    let mut want = vec![None; 4];
    want.extend((0..6).map(Some));
    want.extend(vec![None; 2 * 2893]);
    want.extend((6..14).map(Some));
    for (block, step) in [(1, 1), (2, 3), (5, 1000), (7, usize::MAX)] {
        assert_eq!(run(input(2, &breaks), 7, block, step), want, "{block} {step}");
    }
}

#[test]
fn an_input_that_ends_early_leaves_later_timestamps_unreached() {
    let mut short = input(1, &[(9, 4)]);
    assert_eq!(run(input(1, &[(3, 1)]), 3, 2, 9), [Some(0), Some(1), Some(2), None]);
    let two = block(&short.header, &[0; 4]);
    let _ = short.refill(two);
    short.end();
    short.prepare(2);
    short.advance(2);
    assert!(short.is_over() && short.has_unreached_breaks() && short.seen() == 2);
    // From here on all frames are lost.
    short.prepare(5);
    assert_eq!(short.view(5, 1).frames(), 5);
    short.advance(5);
    assert!(short.is_over() && short.seen() == 2);
}
