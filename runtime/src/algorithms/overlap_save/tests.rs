//! Overlap-save against the definition of the sum, and its transforms against those of single numbers.

use super::*;
use crate::algorithms::filter::phase_taps;
use crate::tests::support::{
    Noise, by, definition, fir_bank, norm, random_taps, recursive_bank, run, start, worst,
};
use crate::{Algorithm, Options};

/// Every lane has the bits that its numbers have alone, in scalar code.
#[test]
fn lanes_are_transformed_one_by_one() {
    let mut noise = Noise(41);
    for (len, direction) in [128, 256, 1024]
        .into_iter()
        .flat_map(|len| [FftDirection::Forward, FftDirection::Inverse].map(|direction| (len, direction)))
    {
        let lanes: Vec<f32> = noise.samples(2 * 8 * len);
        let (re, im) = lanes.split_at(8 * len);
        let group = |part: &[f32], t: usize| Lanes::of(|lane| part[8 * t + lane]);
        let mut rows: Vec<Row<f32>> = (0..len).map(|t| Row::<f32>::new(group(re, t), group(im, t))).collect();
        let mut got = rows.clone();
        Transform::new(len, direction).process(&mut rows, &mut got);
        for lane in 0..8 {
            let mut alone: Vec<_> =
                (0..len).map(|t| Complex::new(re[8 * t + lane], im[8 * t + lane])).collect();
            let mut want = alone.clone();
            Transform::new(len, direction).process(&mut alone, &mut want);
            let got = got.iter().map(|row| Complex::new(row.re.lanes()[lane], row.im.lanes()[lane]));
            assert!(got.eq(want), "F {len}, lane {lane}");
        }
    }
}

#[test]
fn all_instruction_sets_have_the_same_bits() {
    let mut noise = Noise(42);
    for (n, m) in [(1, 1), (2, 3), (3, 4), (8, 8), (9, 17)] {
        let bank = fir_bank(random_taps(n, 30 * m, &mut noise), m);
        let input = noise.samples(n * 2000);
        let outputs = Isa::available().map(|isa| {
            let options = Options { isa, ..by(Algorithm::OverlapSave) };
            run(&bank, options, &input)
        });
        let outputs: Vec<Vec<f32>> = outputs.collect();
        assert!(outputs.iter().all(|output| *output == outputs[0]), "N {n} M {m}");
    }
}

/// The largest error in units of eps log2 F times the norm of a phase's filters times the norm of the inputs
/// of two blocks.
fn relative_error(taps: &[Vec<f64>], m: usize, len: usize, input: &[f32], eps: f64, got: &[f32]) -> f64 {
    let n = taps.len();
    let filters = (0..m)
        .map(|p| norm(taps.iter().flat_map(|f| f.iter().skip(p).step_by(m).copied())))
        .fold(0.0, f64::max);
    let inputs = input.chunks(n * 2 * len).map(|x| norm(x.iter().map(|&x| f64::from(x)))).fold(0.0, f64::max);
    let scale = eps * f64::from(len.ilog2()) * filters * inputs;
    worst(&definition(taps, m, input), got) / scale
}

#[test]
fn the_error_is_within_the_stated_bound() {
    let mut noise = Noise(43);
    for (n, m) in (1..=9).flat_map(|n| (1..=9).map(move |m| (n, m))) {
        for count in [1, 37, 400] {
            let mut taps = random_taps(n, count, &mut noise);
            if count == 400 {
                // Values from 1e-9 to 1e9.
                taps.iter_mut().flatten().for_each(|tap| *tap *= 10f64.powf(9.0 * noise.next()));
            }
            let len = TransformShape::new(n, m, phase_taps(&taps, m), 8).unwrap().len;
            let input = noise.samples(n * (2 * len + 50));
            let got = run(&fir_bank(taps.clone(), m), by(Algorithm::OverlapSave), &input);
            let error = relative_error(&taps, m, len, &input, f64::from(f32::EPSILON), &got);
            assert!(error < 1.0, "N {n} M {m} {count} taps F {len}: {error}");
        }
    }
}

#[test]
fn long_prime_and_empty_filters_work() {
    let mut noise = Noise(44);
    for count in [0, 1, 2, 509, 4001] {
        let taps = random_taps(2, count, &mut noise);
        let input = noise.samples(2 * 3000);
        let bank = fir_bank(taps.clone(), 2);
        let got = run(&bank, by(Algorithm::OverlapSave), &input);
        let error = worst(&definition(&taps, 2, &input), &got);
        assert!(error < 1e-4 * (count as f64 + 1.0).sqrt(), "{count} taps: {error:e}");
    }
}

#[test]
fn recursive_banks_have_no_transforms() {
    let filter = crate::StateMatrices { a: vec![], b: vec![], c: vec![vec![]], d: vec![vec![1.0]] };
    let bank = recursive_bank(filter);
    let refused = |algorithm| start(&bank, by(algorithm)).err();
    assert_eq!(refused(Algorithm::OverlapSave), Some(BuildError::Recursive { algorithm: "overlap-save" }));
    assert_eq!(refused(Algorithm::Auto), None);
}
