use super::*;
use crate::io::block::NumberFrames;
use crate::io::{PcmFormat, SampleLayout};
use crate::random::Random;
use crate::runtime::PcmFrames;

/// A block of as many frames as the bytes hold.
fn block(header: &StreamHeader, bytes: &[u8]) -> Block {
    let mut block = Block::default();
    block.begin(header);
    block.decode(&PcmFrames { layout: header.layout, channels: header.channels, bytes }).unwrap();
    block
}

/// Frames of big-endian 16-bit samples 0, 1, 2, ..
fn input(channels: usize, breaks: &[(u64, u64)], dropouts: &[(usize, std::ops::Range<u64>)]) -> AlignedInput {
    let layout = SampleLayout::packed(PcmFormat::S16Be);
    let mut input = AlignedInput::new(StreamHeader::real(layout, channels));
    let dropout = |(channel, frames): &(usize, std::ops::Range<u64>)| Dropout {
        channel: Some(*channel),
        frames: frames.clone(),
    };
    let lost = LostInInput { dropouts: dropouts.iter().map(dropout).collect(), ..LostInInput::default() };
    input.lose(breaks.iter().map(|&(frame, lost)| Break { frame, lost }).collect(), lost);
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
fn lost_frames_and_invalid_samples_come_out_as_nan_however_they_are_cut() {
    let breaks = [(0, 2), (3, 2893)];
    // Frames 2, 3, 4 of time are frames 0, 1, 2 of the input; 2898 is its frame 3.
    let dropouts = [(1, 0..3), (0, 4..2899), (1, 2898..2900), (1, 2899..2901)];
    let mut want = vec![None; 4];
    want.extend([Some(0), None, Some(2), Some(3), None, Some(5)]);
    want.extend(vec![None; 2 * 2893]);
    want.extend([None, None, Some(8), None, Some(10), None, Some(12), Some(13)]);
    for (block, step) in [(1, 1), (2, 3), (5, 1000), (7, usize::MAX)] {
        assert_eq!(run(input(2, &breaks, &dropouts), 7, block, step), want, "{block} {step}");
    }
}

#[test]
fn an_input_that_ends_early_leaves_later_timestamps_unreached() {
    let mut short = input(1, &[(9, 4)], &[]);
    assert_eq!(run(input(1, &[(3, 1)], &[]), 3, 2, 9), [Some(0), Some(1), Some(2), None]);
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

#[test]
fn covered_is_what_some_dropout_contains() {
    let mut dice = Random(18);
    for trial in 0..500 {
        let channels = dice.count(1, 4);
        let mut list: Vec<Dropout> = (0..dice.below(30))
            .map(|_| {
                let first = dice.below(100) as u64;
                let channel = dice.below(channels + 1);
                let frames = first..first + dice.count(1, 40) as u64;
                Dropout { channel: (channel < channels).then_some(channel), frames }
            })
            .collect();
        list.sort_by_key(|dropout| dropout.frames.start);
        let mut dropouts = Dropouts { ahead: list.clone().into(), ..Dropouts::default() };
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::S16Be), channels);
        while dropouts.time < 200 {
            let (time, step) = (dropouts.time, dice.count(1, 10));
            let mut block = block(&header, &vec![0; 2 * channels * (step + 1)]);
            dropouts.mark(&mut block, 1, step);
            let NumberFrames::F32(frames) = block.view(1..step + 1, 1).real else {
                panic!("16 bits are f32")
            };
            for (frame, samples) in (time..).zip(frames.samples().chunks(channels)) {
                for (c, sample) in samples.iter().enumerate() {
                    let contains = |dropout: &Dropout| {
                        dropout.channel.is_none_or(|channel| channel == c) && dropout.frames.contains(&frame)
                    };
                    let wanted = list.iter().any(contains);
                    assert_eq!(sample.is_nan(), wanted, "trial {trial}, frame {frame}, channel {c}");
                }
            }
            // Some frames may wait for other inputs, or be lost.
            dropouts.advance(dice.count(1, step));
        }
    }
}

#[test]
fn overlapping_dropouts_are_one() {
    let ahead = (0..100_000).map(|k| Dropout { channel: None, frames: k..k + 100_000 }).collect();
    let mut dropouts = Dropouts { ahead, ..Dropouts::default() };
    let header = StreamHeader::real(SampleLayout::packed(PcmFormat::S16Be), 2);
    dropouts.mark(&mut block(&header, &vec![0; 4 * 150_000]), 0, 150_000);
    assert_eq!(dropouts.begun, [Dropout { channel: None, frames: 0..199_999 }]);
    dropouts.advance(199_999);
    assert!(dropouts.begun.is_empty());
}
