//! Outputs that a formula gives.

use super::support::{
    FIR_ALGORITHMS, Noise, by, definition, fir_bank, precise, random_taps, rotation_bank, run, worst,
};
use crate::{Algorithm, Options, Precision};

#[test]
fn an_impulse_anywhere_brings_out_the_taps_and_nothing_else() {
    let taps = vec![(1..=11).map(f64::from).collect(), (1..=7).map(|i| -f64::from(i)).collect()];
    let bank = fir_bank(taps.clone(), 3);
    for algorithm in FIR_ALGORITHMS {
        // Small integers, halves and quarters: only transforms round anything.
        let bound = if algorithm == Algorithm::OverlapSave { 1e-5 } else { 0.0 };
        for index in 0..2 * 130 {
            let mut input = vec![0f32; 2 * 140];
            input[index] = 1.0;
            for (t, y) in run(&bank, by(algorithm), &input).into_iter().enumerate() {
                let tap = t.checked_sub(index / 2 * 3).and_then(|t| taps[index % 2].get(t));
                let error = (f64::from(y) - tap.unwrap_or(&0.0)).abs();
                assert!(error <= bound, "{algorithm:?}: impulse at {index}: {y} at {t}");
            }
        }
    }
}

#[test]
fn a_state_space_bank_has_the_response_of_its_matrices() {
    let out = run(&rotation_bank(), Options::default(), &[1f32, 0.0, 0.0, 0.0]);
    assert_eq!(out[..3], [0.5, 0.0, -1.0]);
    for k in 1..4 {
        let (s, c) = (k as f64 - 1.0).sin_cos();
        let r = 0.9f64.powi(k as i32 - 1);
        for (got, want) in out[3 * k..].iter().zip([r * c, r * s, r * (c + s)]) {
            assert!((f64::from(*got) - want).abs() < 1e-7, "frame {k}: {got} for {want}");
        }
    }
}

#[test]
fn empty_filters_give_zeros() {
    let bank = fir_bank(vec![vec![], vec![]], 2);
    for algorithm in FIR_ALGORITHMS {
        assert_eq!(run(&bank, by(algorithm), &[1f32; 20]), [0.0; 20]);
    }
}

#[test]
fn double_precision_is_double() {
    let mut noise = Noise(43);
    let taps = random_taps(4, 500, &mut noise);
    let input: Vec<f64> = (0..4 * 3000).map(|_| f64::from(noise.next() as f32)).collect();
    let want = definition(&taps, 4, &input);
    // As in f32, with the norms of numbers below 1: for each of four channels 125 taps and as many inputs;
    // all 500 taps of a phase and the inputs of 1024 frames for transforms.
    let algorithms =
        [(Algorithm::Direct, 3.0 * 500.0), (Algorithm::OverlapSave, 9.0 * 500f64.sqrt() * 4096f64.sqrt())];
    for (algorithm, bound) in algorithms {
        let got = run(&fir_bank(taps.clone(), 4), precise(algorithm, Precision::Double), &input);
        let error = worst(&want, &got) / f64::EPSILON;
        assert!(error < bound, "{algorithm:?}: {error} eps");
    }
}
