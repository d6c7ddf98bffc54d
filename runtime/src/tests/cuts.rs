//! How a stream is cut into calls changes no bit, and neither does NaN in place of zero.

use super::support::{FIR_ALGORITHMS, Noise, fir_bank, in_pieces, precise, random_taps, start};
use crate::{Precision, Stream};
use proptest::prelude::*;

/// Asserts that marked samples give what zeros in their place give, in one call and in calls of `cuts`
/// frames.
fn check_cuts(stream: &mut Stream, input: &[f32], lost: &[usize], cuts: &[usize]) {
    let algorithm = stream.plan().algorithm();
    let with = |value: f32| {
        let sample = |(index, &x): (usize, &f32)| if lost.contains(&index) { value } else { x };
        input.iter().enumerate().map(sample).collect::<Vec<f32>>()
    };
    let (zeros, marked) = (with(0.0), with(f32::NAN));
    let mut whole = vec![0.0; input.len() / stream.channels() * stream.ratio()];
    stream.process(&zeros, &mut whole).unwrap();
    assert_eq!(stream.replaced(), 0);
    let count = marked.iter().filter(|x| x.is_nan()).count() as u64;
    for cuts in [&[cuts.iter().sum()][..], cuts] {
        stream.reset();
        let pieces = in_pieces(stream, &marked, cuts);
        let different = pieces.iter().zip(&whole).position(|(a, b)| a != b);
        assert_eq!((different, stream.replaced()), (None, count), "{algorithm}, calls of {cuts:?} frames");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(192) })]

    /// With one tap per phase there is no history at all.
    #[test]
    fn cuts_do_not_change_a_bit(
        n in 1usize..10, m in 1usize..10, count in prop_oneof![Just(0), 1usize..60], seed: u64,
        cuts in prop::collection::vec(prop_oneof![0usize..20, 0usize..1200], 1..16), double: bool,
        lost in prop::collection::vec(0usize..100_000, 0..4),
    ) {
        let mut noise = Noise(seed);
        let taps = random_taps(n, m + count, &mut noise);
        let input = noise.samples(n * cuts.iter().sum::<usize>());
        let bank = fir_bank(taps, m);
        let precision = if double { Precision::Double } else { Precision::Single };
        for algorithm in FIR_ALGORITHMS {
            check_cuts(&mut start(&bank, precise(algorithm, precision)).unwrap(), &input, &lost, &cuts);
        }
    }
}
