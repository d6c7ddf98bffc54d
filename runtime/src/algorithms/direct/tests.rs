//! The direct algorithm against a scalar twin with the same bits, and against the definition of the sum.

use crate::tests::support::{Noise, definition, fir_bank, fuses, random_taps, run, worst};
use crate::{Isa, Options};

/// The steps of a window in the order of use. Phases beside each other take the newest first. A single phase
/// takes pairs c apart, the older first, where c steps are a whole number of frames and of groups.
fn order(n: usize, ratio: usize, depth: usize, steps: usize) -> Vec<usize> {
    if ratio > 1 {
        return (0..steps).collect();
    }
    let apart = (1..).find(|&c| [n, 8].iter().all(|&k| (c * depth).is_multiple_of(k))).unwrap();
    let mut order = Vec::new();
    for block in (0..steps).step_by(2 * apart) {
        for s in block..(block + apart).min(steps) {
            order.extend((s + apart < steps).then_some(s + apart).into_iter().chain([s]));
        }
    }
    order
}

/// The scalar twin: the same sums in the same order, fused if the kernels fuse. The window of a frame is cut
/// into steps of D samples; each of D lanes sums its place of the steps, and the lanes are added as a tree.
fn twin(taps: &[Vec<f64>], ratio: usize, input: &[f32], fused: bool) -> Vec<f32> {
    let n = taps.len();
    let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap().max(1);
    let depth = if [1, 2, 4].contains(&n) { n } else { 8 };
    let order = order(n, ratio, depth, (lags * n).div_ceil(depth));
    let output = |k: usize, p: usize| {
        let end = (k + 1) * n;
        let mut lanes = [0f32; 8];
        for &s in &order {
            for (d, lane) in lanes.iter_mut().enumerate().take(depth) {
                let Some(at) = end.checked_sub((s + 1) * depth - d) else { continue };
                let (x, c) =
                    (input[at], taps[at % n].get(p + (k - at / n) * ratio).map_or(0.0, |&c| c as f32));
                *lane = if fused { x.mul_add(c, *lane) } else { x * c + *lane };
            }
        }
        let four = |l: &[f32]| (l[0] + l[2]) + (l[1] + l[3]);
        match depth {
            1 => lanes[0],
            2 => lanes[0] + lanes[1],
            4 => four(&lanes),
            _ => four(&lanes) + four(&lanes[4..]),
        }
    };
    (0..input.len() / n).flat_map(|k| (0..ratio).map(move |p| (k, p))).map(|(k, p)| output(k, p)).collect()
}

/// A bank of N channels with M outputs a frame, and the frames that it runs.
struct Shape {
    n: usize,
    m: usize,
    taps: usize,
    frames: usize,
}

fn has_the_bits_of_the_twin(shape: Shape, noise: &mut Noise) {
    let Shape { n, m, taps: count, frames } = shape;
    let taps = random_taps(n, count, noise);
    let input = noise.samples(n * frames);
    for isa in Isa::available() {
        let got = run(&fir_bank(taps.clone(), m), Options { isa, ..Options::default() }, &input);
        assert_eq!(got, twin(&taps, m, &input, fuses(isa)), "N {n} M {m}, {count} taps, {isa}");
    }
}

#[test]
fn small_shapes_every_tap_count_and_large_shapes_have_the_bits_of_the_scalar_twin() {
    let small = (1..=9).flat_map(|n| {
        (1..=17).map(move |m| {
            let taps = 1 + (7 * n + 5 * m) % 40;
            Shape { n, m, taps, frames: 100 + 13 * m }
        })
    });
    let counts = (1..=70).map(|count| Shape { n: 2, m: 2, taps: count, frames: count });
    let large = [(40, 3), (3, 40), (33, 33)].map(|(n, m)| Shape { n, m, taps: 3 * m + 1, frames: 300 });
    let mut noise = Noise(1);
    small.chain(counts).chain(large).for_each(|shape| has_the_bits_of_the_twin(shape, &mut noise));
}

/// Filters that look back exactly as far as a block is long, or about, leave no whole vector of the first
/// segment after it.
#[test]
fn filters_as_long_as_a_block_follow_their_definition() {
    let mut noise = Noise(97);
    for (n, m) in [(16, 5), (24, 7), (4, 4), (3, 1), (16, 1)] {
        for lags in [96, 97, 98, 193] {
            let taps = random_taps(n, lags * m, &mut noise);
            let input = noise.samples(n * (2 * lags + 1));
            let got = run(&fir_bank(taps.clone(), m), Options::default(), &input);
            let most = taps.iter().flatten().map(|tap| tap.abs()).sum::<f64>();
            let error = worst(&definition(&taps, m, &input), &got);
            assert!(error <= 1e-5 * most, "N {n} M {m} K {lags}: {error:e}");
        }
    }
}
