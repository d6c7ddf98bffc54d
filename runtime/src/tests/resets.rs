//! A stream that is reset, made from another one or cloned.

use super::support::{Bank, FIR_ALGORITHMS, Noise, by, fir_bank, random_taps, rotation_bank, run, start};
use crate::{Options, Stream};

/// Every algorithm with a bank that it runs.
fn banks(noise: &mut Noise) -> Vec<(Bank, Options)> {
    let mut banks = vec![(rotation_bank(), Options::default())];
    for (n, m) in [(3, 4), (1, 2)] {
        let bank = fir_bank(random_taps(n, 50, noise), m);
        banks.extend(FIR_ALGORITHMS.map(|algorithm| (bank.clone(), by(algorithm))));
    }
    banks
}

#[test]
fn resets_fresh_streams_and_clones_have_the_bits_of_a_new_one() {
    let mut noise = Noise(5);
    for (bank, options) in banks(&mut noise) {
        let (n, m) = (bank.channel_count(), bank.ratio);
        let input = noise.samples(n * 777);
        let mut stream = start(&bank, options).unwrap();
        let mut want = vec![0.0; m * 777];
        stream.process(&input, &mut want).unwrap();
        let mut out = vec![0.0; want.len()];
        for cut in [100, 101, 102, 103] {
            stream.process(&noise.samples(n * 333), &mut out).unwrap();
            Stream::new(stream.plan()).process(&input, &mut out).unwrap();
            assert_eq!(out, want, "{:?}", options.algorithm);
            stream.reset();
            stream.process(&input[..n * cut], &mut out).unwrap();
            let mut twin = stream.clone();
            for stream in [&mut stream, &mut twin] {
                assert_eq!(stream.position(), cut as u64);
                stream.process(&input[n * cut..], &mut out).unwrap();
                assert_eq!(out[..m * (777 - cut)], want[m * cut..], "{:?}", options.algorithm);
            }
        }
    }
}

#[test]
fn a_used_stream_that_is_reset_has_no_counts_and_no_history() {
    let mut noise = Noise(6);
    for (bank, options) in banks(&mut noise) {
        let n = bank.channel_count();
        let mut stream = start(&bank, options).unwrap();
        let mut out = vec![0.0; 200 * bank.ratio];
        stream.process(&vec![f32::NAN; 200 * n], &mut out).unwrap();
        stream.process(&noise.samples(200 * n), &mut out).unwrap();
        stream.reset();
        assert_eq!((stream.position(), stream.replaced(), stream.state_resets()), (0, 0, 0));
        stream.process(&vec![0.0f32; 200 * n], &mut out).unwrap();
        assert!(out.iter().all(|&y| y == 0.0), "{:?}", options.algorithm);
        assert_eq!(run(&bank, options, &vec![0.0f32; 200 * n]), vec![0.0; 200 * bank.ratio]);
    }
}

#[test]
fn streams_may_change_threads() {
    fn check<T: Send + Sync>() {}
    check::<Stream>();
}
