//! Calls on several threads have the bits of calls on one.

use super::support::{Bank, Noise, by, fir_bank, precise, random_taps, rotation_bank, start};
use crate::{
    Algorithm, Interleaved, Options, PcmFormat, PcmFrames, PcmOutput, Precision, SampleLayout, SideBySide,
    Stream, ThreadPool,
};

/// Calls of one thread and of several have the same bits, about calls of `long` frames, and count the same.
fn threads_agree(bank: &Bank, options: Options, pools: &[ThreadPool], long: usize, noise: &mut Noise) {
    let mut one = start(bank, options).unwrap();
    let (n, m) = (one.channels(), one.ratio());
    let mut many = vec![Stream::new(one.plan()); pools.len()];
    for frames in [1, long, 4096, 2, long - 12_345] {
        let mut input = noise.samples(n * frames);
        input[n * frames / 2] = f32::NAN;
        let mut want = vec![0.0; m * frames];
        one.process(&input, &mut want).unwrap();
        for (stream, pool) in many.iter_mut().zip(pools) {
            let mut out = vec![0.0; m * frames];
            let input = Interleaved::new(&input, n).unwrap();
            assert_eq!(stream.run_parallel(&input, &mut out.as_mut_slice(), pool), Ok(m * frames));
            assert!(out == want, "N {n} M {m} {:?}, {frames} frames, {pool:?}", options.algorithm);
            assert_eq!(one.replaced(), stream.replaced());
        }
    }
}

/// Calls long enough for several chunks of a million multiply-adds each: N, M, taps, frames.
const LONG_CALLS: [(usize, usize, usize, usize); 7] = [
    (1, 1, 33, 120_000),
    (1, 4, 64, 70_000),
    (2, 2, 24, 130_001),
    (3, 1, 41, 80_001),
    (5, 3, 50, 25_000),
    (2, 2, 2000, 40_000),
    (3, 4, 5, 400_000),
];

/// The algorithm that shares its calls, in one precision.
fn threads_agree_in(precision: Precision) {
    let mut noise = Noise(31);
    let pools: Vec<_> = [1, 2, 3].into_iter().map(|threads| ThreadPool::new(threads).unwrap()).collect();
    for (n, m, taps, long) in LONG_CALLS {
        let bank = fir_bank(random_taps(n, taps, &mut noise), m);
        threads_agree(&bank, precise(Algorithm::Direct, precision), &pools, long, &mut noise);
    }
    // One tap per phase.
    let bank = fir_bank(random_taps(3, 1, &mut noise), 4);
    threads_agree(&bank, precise(Options::default().algorithm, precision), &pools, 400_000, &mut noise);
}

#[test]
fn threads_do_not_change_a_bit_of_single_sums() {
    threads_agree_in(Precision::Single);
}

#[test]
fn threads_do_not_change_a_bit_of_double_sums() {
    threads_agree_in(Precision::Double);
}

#[test]
fn overlap_save_and_recursions_stay_on_their_thread() {
    let mut noise = Noise(34);
    let overlap_save = by(Algorithm::OverlapSave);
    let fir = fir_bank(random_taps(2, 90, &mut noise), 2);
    for (bank, options) in [(fir, overlap_save), (rotation_bank(), Options::default())] {
        let input = noise.samples(50_000);
        let mut one = start(&bank, options).unwrap();
        let mut many = Stream::new(one.plan());
        let mut out = [(); 2].map(|()| vec![0.0; input.len() / one.channels() * one.ratio()]);
        one.process(&input, &mut out[0]).unwrap();
        let frames = Interleaved::new(&input, one.channels()).unwrap();
        many.run_parallel(&frames, &mut out[1].as_mut_slice(), &ThreadPool::new(3).unwrap()).unwrap();
        assert!(out[0] == out[1], "{:?}", options.algorithm);
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let mut noise = Noise(33);
    let pools = ThreadPool::new(3).unwrap();
    for (n, m, format, out_format) in
        [(2, 3, PcmFormat::S16Le, PcmFormat::S16Le), (3, 2, PcmFormat::S24Be, PcmFormat::F64Le)]
    {
        // Loud enough to clip.
        let mut one = start(&fir_bank(random_taps(n, 80, &mut noise), m), Options::default()).unwrap();
        let mut many = Stream::new(one.plan());
        let bytes: Vec<u8> =
            (0..n * 70_001 * format.bytes()).map(|_| (128.0 * noise.next()) as i8 as u8).collect();
        let layout = SampleLayout::packed(format);
        let rows: Vec<Vec<u8>> = (0..n)
            .map(|i| bytes.chunks_exact(format.bytes()).skip(i).step_by(n).flatten().copied().collect())
            .collect();
        let frames: Vec<_> = rows.iter().map(|row| PcmFrames { layout, channels: 1, bytes: row }).collect();
        let mut out = [vec![0; 70_001 * m * out_format.bytes()], vec![0; 70_001 * m * out_format.bytes()]];
        let [want, got] = &mut out;
        let mut want = PcmOutput::packed(out_format, want);
        let mut got = PcmOutput::packed(out_format, got);
        (want.clipped, got.clipped) = (5, 5);
        one.run(&SideBySide::new(&frames[..]), &mut want).unwrap();
        many.run_parallel(&SideBySide::new(&frames[..]), &mut got, &pools).unwrap();
        assert_eq!(want.clipped, got.clipped);
        assert!(want.clipped > 5 || out_format == PcmFormat::F64Le);
        assert!(want.bytes == got.bytes, "{format} to {out_format}");
    }
}
