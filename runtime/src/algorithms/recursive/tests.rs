//! Recursions against their state equations.

use super::*;
use crate::adapters::Interleaved;
use crate::tests::support::{Noise, state_space_definition, worst};

fn run(filter: &StateMatrices, n: usize, m: usize, isa: Isa, input: &[f64], cut: usize) -> (Vec<f64>, bool) {
    let plan = Recursive::new(filter, n, m, isa).unwrap();
    let mut state = plan.state();
    let mut out = vec![0.0; input.len() / n * m];
    for (x, mut y) in input.chunks(cut * n).zip(out.chunks_mut(cut * m)) {
        plan.process(&mut state, &Interleaved::new(x, n).unwrap(), &mut y);
    }
    (out, plan.is_parallel())
}

fn random(order: usize, n: usize, m: usize, blocks: Option<&[usize]>, noise: &mut Noise) -> StateMatrices {
    let mut matrix = |rows: usize, cols: usize, scale: f64| -> Vec<Vec<f64>> {
        (0..rows).map(|_| (0..cols).map(|_| scale * noise.next()).collect()).collect()
    };
    let mut a = matrix(order, order, 0.9 / order.max(1) as f64);
    if let Some(blocks) = blocks {
        let mut owner = Vec::new();
        blocks.iter().enumerate().for_each(|(b, &size)| owner.extend(vec![b; size]));
        for (i, row) in a.iter_mut().enumerate() {
            row.iter_mut().enumerate().filter(|(j, _)| owner[*j] != owner[i]).for_each(|(_, x)| *x = 0.0);
        }
    }
    StateMatrices { a, b: matrix(order, n, 1.0), c: matrix(m, order, 1.0), d: matrix(m, n, 1.0) }
}

#[test]
fn every_shape_follows_its_definition_with_the_same_bits_for_every_cut() {
    let mut noise = Noise(21);
    let parallel: [&[usize]; 6] = [&[1], &[2], &[1, 2], &[2, 1, 1, 2], &[1, 1, 1, 2, 2, 1, 2, 2], &[2; 16]];
    let dense = [0, 1, 3, 5, 8, 17].map(|order| (order, None));
    let shapes = parallel.map(|blocks| (blocks.iter().sum(), Some(blocks))).into_iter().chain(dense);
    for (order, blocks) in shapes {
        for (n, m) in [(1, 1), (2, 3), (4, 4), (3, 9)] {
            let filter = random(order, n, m, blocks, &mut noise);
            let input: Vec<f64> = (0..n * 300).map(|_| noise.next()).collect();
            let want = state_space_definition(&filter, &input);
            let (whole, is_parallel) = run(&filter, n, m, Isa::detect(), &input, 300);
            // Small dense matrices are block-diagonal too.
            assert!(is_parallel || (blocks.is_none() && order > 2), "{order} {blocks:?}");
            let error = worst(&want, &whole);
            assert!(error < 1e-12, "order {order} N {n} M {m}: {error:e}");
            for cut in [1, 7, 63, 64, 65, 129] {
                assert_eq!(run(&filter, n, m, Isa::detect(), &input, cut).0, whole, "cut {cut}");
            }
            let portable = run(&filter, n, m, Isa::portable(), &input, 300).0;
            let apart = worst(&whole, &portable);
            assert!(apart < 1e-12, "{apart:e}");
        }
    }
}

/// The same filter with its inputs `frames` frames late, in a delay line that the output reads too: the form
/// of designed banks.
fn delayed(core: &StateMatrices, frames: usize, noise: &mut Noise) -> StateMatrices {
    let (states, n) = (core.a.len(), core.d[0].len());
    let order = states + frames * n;
    let mut a = vec![vec![0.0; order]; order];
    for (i, row) in a.iter_mut().enumerate() {
        match core.a.get(i) {
            Some(own) => {
                row[..states].copy_from_slice(own);
                row[states..states + n].copy_from_slice(&core.b[i]);
            }
            None if i + n < order => row[i + n] = 1.0,
            None => {}
        }
    }
    let newest = |i: usize, u: usize| f64::from(u8::from(i == order - n + u));
    let b = (0..order).map(|i| (0..n).map(|u| newest(i, u)).collect()).collect();
    let read = |row: &Vec<f64>| row.iter().copied().chain((0..frames * n).map(|_| noise.next())).collect();
    StateMatrices { a, b, c: core.c.iter().map(read).collect(), d: core.d.clone() }
}

#[test]
fn delay_lines_before_the_states_follow_the_definition() {
    let mut noise = Noise(22);
    for (order, blocks) in [(0, None), (2, Some(&[2][..])), (5, Some(&[2, 1, 2])), (4, None)] {
        for (n, m, frames) in [(1, 1, 3), (1, 3, 1), (2, 2, 5), (3, 2, 4), (4, 4, 17), (5, 9, 2)] {
            let filter = delayed(&random(order, n, m, blocks, &mut noise), frames, &mut noise);
            let input: Vec<f64> = (0..n * 300).map(|_| noise.next()).collect();
            let (whole, is_parallel) = run(&filter, n, m, Isa::detect(), &input, 300);
            assert!(is_parallel || (blocks.is_none() && order > 2));
            let error = worst(&whole, &state_space_definition(&filter, &input));
            assert!(error < 1e-12, "order {order} N {n} M {m} delayed by {frames}: {error:e}");
            for cut in [1, 63, 65] {
                assert_eq!(run(&filter, n, m, Isa::detect(), &input, cut).0, whole, "cut {cut}");
            }
        }
    }
}

#[test]
fn zero_columns_of_triangles_are_not_multiplied() {
    let mut noise = Noise(24);
    let mut filter = random(24, 1, 2, None, &mut noise);
    (0..24).for_each(|i| filter.a[i][..i].fill(0.0));
    let plan = Recursive::new(&filter, 1, 2, Isa::detect()).unwrap();
    let RecursionForm::Dense(tiles) = &plan.recursion.form else { panic!("a triangle is no section") };
    let columns: Vec<usize> = tiles.iter().map(|tile| tile.columns.len()).collect();
    assert_eq!(columns[0], 24);
    assert!(columns[1..].iter().all(|&count| count < 24), "{columns:?}");
    let input: Vec<f64> = (0..300).map(|_| noise.next()).collect();
    let got = run(&filter, 1, 2, Isa::detect(), &input, 300).0;
    assert!(worst(&got, &state_space_definition(&filter, &input)) < 1e-12);
}

#[test]
fn a_state_that_fades_away_becomes_zero() {
    let filter =
        StateMatrices { a: vec![vec![0.5]], b: vec![vec![1.0]], c: vec![vec![1.0]], d: vec![vec![0.0]] };
    let plan = Recursive::new(&filter, 1, 1, Isa::detect()).unwrap();
    let mut state = plan.state();
    let mut input = vec![0.0; 1200];
    input[0] = 1.0;
    let mut out = vec![0f64; 1200];
    plan.process(&mut state, &Interleaved::new(input.as_slice(), 1).unwrap(), &mut out.as_mut_slice());
    // 2^-900 is 1e-271, still there; 2^-960 is below the limit, and never denormal (2^-1022).
    assert!(out[900] > 0.0 && out[1100] == 0.0);
    assert!(out.iter().all(|y| *y == 0.0 || y.is_normal()));
}
