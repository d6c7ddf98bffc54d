//! Samples as they lie in files give what the same samples in memory give.

use super::support::{Bank, FIR_ALGORITHMS, Noise, by, fir_bank, random_taps, start};
use crate::{FrameSource, Options, PcmFormat, PcmFrames, PcmOutput, SampleLayout, SideBySide};
use proptest::prelude::*;

/// Random samples of a format.
fn bytes(format: PcmFormat, samples: usize, noise: &mut Noise) -> Vec<u8> {
    let mut bytes = vec![0; samples * format.bytes()];
    for slot in bytes.chunks_exact_mut(format.bytes()) {
        format.encode(noise.next(), slot);
    }
    bytes
}

/// The samples of each channel.
fn columns(bytes: &[u8], channels: usize, size: usize) -> Vec<Vec<u8>> {
    let column = |i| bytes.chunks_exact(size).skip(i).step_by(channels).flatten().copied().collect();
    (0..channels).map(column).collect()
}

/// The outputs in a format, and how many were clipped.
fn encoded(samples: &[f32], format: PcmFormat) -> (Vec<u8>, u64) {
    let mut bytes = vec![0; samples.len() * format.bytes()];
    let slots = bytes.chunks_exact_mut(format.bytes()).zip(samples);
    let clipped = slots.map(|(slot, &y)| u64::from(format.encode(f64::from(y), slot))).sum();
    (bytes, clipped)
}

/// Asserts that one recording of all channels and a recording for each give the same bytes as samples in
/// memory.
fn check_bytes(bank: &Bank, options: Options, [from, to]: [PcmFormat; 2], bytes: &[u8]) {
    let n = bank.channel_count();
    let input: Vec<f32> = bytes.chunks_exact(from.bytes()).map(|b| from.decode(b) as f32).collect();
    let mut stream = start(bank, options).unwrap();
    let mut samples = vec![0.0; input.len() / n * bank.ratio];
    stream.process(&input, &mut samples).unwrap();
    let want = encoded(&samples, to);
    let layout = SampleLayout::packed(from);
    let columns = columns(bytes, n, from.bytes());
    let planar: Vec<_> = columns.iter().map(|bytes| PcmFrames { layout, channels: 1, bytes }).collect();
    let one = PcmFrames { layout, channels: n, bytes };
    for recordings in [&one as &dyn FrameSource, &SideBySide::new(&planar[..])] {
        stream.reset();
        let mut out = vec![0; want.0.len()];
        let mut output = PcmOutput::packed(to, &mut out);
        assert_eq!(stream.run(recordings, &mut output), Ok(samples.len()));
        let clipped = output.clipped;
        assert!((out, clipped) == want, "{from} to {to}, {:?}", options.algorithm);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn bytes_in_any_format_give_the_same_samples(
        n in 1usize..5, m in 1usize..5, from in 0usize..20, to in 0usize..20, seed: u64, frames in 0usize..900,
    ) {
        let formats = [from, to].map(|which| PcmFormat::ALL[which]);
        let mut noise = Noise(seed);
        let bank = fir_bank(random_taps(n, 13, &mut noise), m);
        let bytes = bytes(formats[0], n * frames, &mut noise);
        for algorithm in FIR_ALGORITHMS {
            check_bytes(&bank, by(algorithm), formats, &bytes);
        }
    }
}
