use super::plant_samples::PlantSamples;
use super::truncation::{self, ReducedRecursion, mean_square_bank};
use super::*;
use crate::design::filters::lifted;
use crate::design::methods::{MethodSettings, synthesise};
use crate::design::plant::LiftedPlant;
use crate::lti::gramian::{balanced, h2_norm};
use crate::lti::peak::hinf_norm;
use crate::lti::{FirWithTail, StateSpace};
use crate::tests::{self, after_thesis_filter, dense_grid, largest_on_grid};
use hybank_core::spec::Method;
use hybank_linalg::Mat;
use std::sync::LazyLock;

static NEVER: LazyLock<Stop> = LazyLock::new(Stop::default);

/// The thesis example with other delays and latency.
fn plant(latency: usize, delays: &str) -> LiftedPlant {
    tests::plant(&after_thesis_filter(2, latency, delays, "method = \"iir\""))
}

fn thesis(latency: usize) -> LiftedPlant {
    plant(latency, "{ delay = 1.2 }, { delay = 0.6 }")
}

/// The full bank.
fn bank_of(method: Method, plant: &LiftedPlant) -> StateSpace {
    lifted(&synthesise(method, plant, &MethodSettings::default()).unwrap().filters, plant.ratio())
}

fn problem<'a>(plant: &'a LiftedPlant, bank: &'a StateSpace, aim: Aim) -> ReductionProblem<'a> {
    let order = FirWithTail::new(bank).unwrap().realise().order();
    ReductionProblem { plant, bank, order, aim, gamma_margin: 0.0, stop: &NEVER }
}

fn error(plant: &LiftedPlant, bank: &StateSpace) -> StateSpace {
    plant.error_system(bank)
}

/// The plain truncation of a bank to so many states.
fn truncated(bank: &StateSpace, order: usize) -> StateSpace {
    let plain = balanced(bank, 0.0).unwrap();
    let first = |m: &Mat, r: usize, c: usize| m.view((0, 0), (r, c)).into_owned();
    let (a, b, c) = (first(plain.a(), order, order), first(plain.b(), order, 2), first(plain.c(), 2, order));
    StateSpace::new(a, b, c, plain.d().clone())
}

#[test]
fn every_order_has_the_gamma_that_is_reported_and_beats_truncation() {
    let plant = thesis(6);
    let bank = bank_of(Method::Iir, &plant);
    for order in [0, 3] {
        let (smaller, record) =
            reduce(&problem(&plant, &bank, Aim::WorstCase), Reduction::Order(order)).unwrap();
        let smaller = smaller.unwrap();
        assert!(smaller.order() <= order && record.reduced.order == smaller.order(), "{record:?}");
        let (on_grid, reported) = (dense_grid(&error(&plant, &smaller)), record.reduced.figures.gamma);
        let share = on_grid / reported;
        assert!(share <= 1.0 + 1e-7 && share > 1.0 - 1e-4, "{order}: {on_grid} {reported}");
        let rms = h2_norm(&error(&plant, &smaller)).unwrap() / 2f64.sqrt();
        assert!((rms / record.reduced.figures.rms_error - 1.0).abs() < 1e-12);
        // Truncation has neither the weight nor the best output matrices.
        let plain = hinf_norm(&error(&plant, &truncated(&bank, order))).unwrap().gain;
        println!("{order} states: truncated {plain}, here {reported}");
        assert!(reported < 0.9 * plain, "{order}: {record:?} {plain}");
    }
}

#[test]
fn more_states_are_never_worse_and_all_are_the_full_bank() {
    let plant = thesis(10);
    for (aim, bank) in
        [(Aim::WorstCase, bank_of(Method::Iir, &plant)), (Aim::MeanSquare, bank_of(Method::H2, &plant))]
    {
        let problem = problem(&plant, &bank, aim);
        let reduced = |order| reduce(&problem, Reduction::Order(order)).unwrap();
        let (smaller, record) = reduced(problem.order);
        assert!(smaller.is_none() && record.reduced == record.full && record.full.loss_db == 0.0);
        let losses: Vec<f64> = (0..problem.order).map(|order| reduced(order).1.reduced.loss_db).collect();
        assert!(losses.windows(2).all(|pair| pair[0] >= pair[1] - 1e-4), "{losses:?}");
        // Every one of these states but the last two lowers the error by more than half a decibel.
        assert!(losses[..8].windows(2).all(|pair| pair[0] > pair[1] + 0.5), "{losses:?}");
        // The trade-off shows two orders on each side and the full bank.
        let shown: Vec<usize> = reduced(4).1.orders.iter().map(|point| point.order).collect();
        assert_eq!(shown, [2, 3, 4, 5, 6, problem.order]);
    }
}

#[test]
fn the_fewest_states_for_a_loss_are_those_of_trying_all() {
    let plant = thesis(6);
    let bank = bank_of(Method::H2, &plant);
    let problem = problem(&plant, &bank, Aim::MeanSquare);
    let loss = |order| reduce(&problem, Reduction::Order(order)).unwrap().1.reduced.loss_db;
    for db in [0.1, 1.0, 6.0] {
        let fewest = (0..problem.order).find(|&order| loss(order) <= db).unwrap_or(problem.order);
        let (_, record) = reduce(&problem, Reduction::Loss(db)).unwrap();
        assert_eq!(record.reduced.order, fewest, "{db} dB: {record:?}");
    }
}

/// Largest gain of (F - F_r) H on a dense grid.
fn weighted_gap(plant: &LiftedPlant, full: &StateSpace, reduced: &StateSpace) -> f64 {
    let h = plant.measurement();
    largest_on_grid(1000, |z| (full.response_at(z) - reduced.response_at(z)) * h.response_at(z))
}

/// The systems side by side, with the sum of their outputs.
fn parallel(systems: &[&StateSpace]) -> StateSpace {
    let all = |part: fn(&StateSpace) -> &Mat| systems.iter().map(|system| part(system)).collect::<Vec<_>>();
    let (a, b) =
        (hybank_linalg::block_diagonal(&all(StateSpace::a)), hybank_linalg::vstack(&all(StateSpace::b)));
    let d = systems.iter().map(|system| system.d().clone()).sum();
    StateSpace::new(a, b, hybank_linalg::hstack(&all(StateSpace::c)), d)
}

/// A delay line of six inputs, three equal poles in a chain, a pole near the unit circle that a zero 1e-9
/// away cancels, and one that rings where the plant has little signal. The weighted truncation, judged by
/// brute force on a grid, leaves out first what matters least, and every truncation is stable.
#[test]
fn truncation_is_judged_where_the_plant_has_signal() {
    let plant = thesis(6);
    let ones = |r, c| Mat::from_element(r, c, 1.0);
    let chain = Mat::from_row_slice(3, 3, &[0.5, 1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.5]);
    let full = parallel(&[
        &StateSpace::delay_line(2, 6).select_outputs(0..2),
        &StateSpace::new(chain, ones(3, 2), ones(2, 3), Mat::zeros(2, 2)),
        &StateSpace::new(ones(1, 1) * 0.999, ones(1, 2), ones(2, 1) * 1e-9, Mat::identity(2, 2)),
        &StateSpace::new(ones(1, 1) * -0.9, ones(1, 2), ones(2, 1) * 0.1, Mat::zeros(2, 2)),
    ]);
    let weighted = truncation::balanced(&plant, &full).unwrap();
    let first = |system: &StateSpace, order: usize| {
        let recursion = ReducedRecursion::of(system, order);
        let c = system.c().columns(0, order).into_owned();
        recursion.with_outputs(&hybank_linalg::hstack(&[&c, system.d()]))
    };
    let plain = balanced(&full, 0.0).unwrap();
    let size = weighted_gap(&plant, &full, &StateSpace::gain(Mat::zeros(2, 2)));
    let mut gains = 0.0;
    for order in 0..weighted.order() {
        let reduced = first(&weighted, order);
        assert!(reduced.spectral_radius().unwrap() < 1.0, "{order}");
        let (own, other) =
            [&weighted, &plain].map(|system| weighted_gap(&plant, &full, &first(system, order))).into();
        println!("{order} states: {:.2e} of F H lost, {:.2e} without the weight", own / size, other / size);
        gains += (other / own).ln();
    }
    assert!(gains > 0.0, "{gains}");
    assert!(weighted_gap(&plant, &full, &weighted) < 1e-9 * size);
    assert!(weighted_gap(&plant, &full, &first(&weighted, weighted.order() - 1)) < 1e-5 * size);
}

/// F with redundant states: uncontrollable ones, unobservable ones, and the same recursion three times, of
/// which two cancel.
fn padded(bank: &StateSpace) -> StateSpace {
    let (n, m, p) = (bank.order(), bank.inputs(), bank.outputs());
    let extra = Mat::from_row_slice(3, 3, &[0.5, 0.3, 0.0, -0.3, 0.5, 0.0, 0.0, 0.1, 0.9]);
    let blocks = [bank.a(), bank.a(), bank.a(), &extra, &extra];
    let order = 3 * n + 6;
    let (mut a, mut b, mut c) = (Mat::zeros(order, order), Mat::zeros(order, m), Mat::zeros(p, order));
    let mut at = 0;
    for (k, block) in blocks.into_iter().enumerate() {
        let size = block.nrows();
        a.view_mut((at, at), (size, size)).copy_from(block);
        match k {
            0..3 => {
                b.rows_mut(at, size).copy_from(bank.b());
                c.columns_mut(at, size).copy_from(&(bank.c() * [1.0, 0.75, -0.75][k]));
            }
            3 => b.rows_mut(at, size).fill(1.0),
            _ => c.columns_mut(at, size).fill(1.0),
        }
        at += size;
    }
    StateSpace::new(a, b, c, bank.d().clone())
}

#[test]
fn redundant_states_are_removed_without_loss() {
    let plant = thesis(3);
    for (aim, bank) in
        [(Aim::WorstCase, bank_of(Method::Iir, &plant)), (Aim::MeanSquare, bank_of(Method::H2, &plant))]
    {
        let (_, bare) = reduce(&problem(&plant, &bank, aim), Reduction::Loss(0.0)).unwrap();
        let padded = padded(&bank);
        let problem = ReductionProblem { order: padded.order(), ..problem(&plant, &padded, aim) };
        let (smaller, record) = reduce(&problem, Reduction::Loss(0.0)).unwrap();
        assert_eq!(record.reduced.order, bare.reduced.order, "{record:?} {bare:?}");
        assert!(record.reduced.loss_db.abs() < 1e-4 && record.reduced.order <= 4, "{record:?}");
        let norm = hinf_norm(&error(&plant, &smaller.unwrap())).unwrap().gain;
        assert!((norm / record.reduced.figures.gamma - 1.0).abs() < 1e-9);
    }
}

/// Both choices of output matrices are optima of convex problems: no direction leads downhill. Judged by
/// exact norms, which the optimisers do not use.
#[test]
fn no_other_outputs_is_better() {
    let plant = thesis(6);
    let bank = bank_of(Method::Iir, &plant);
    let balanced = truncation::balanced(&plant, &bank).unwrap();
    for order in [0, 3] {
        let recursion = ReducedRecursion::of(&balanced, order);
        let of_least_square = mean_square_bank(&plant, &recursion).unwrap();
        let norm = h2_norm(&error(&plant, &of_least_square)).unwrap();
        let of_least_gamma = PlantSamples::new(&plant, &NEVER).unwrap().best_bank(&recursion, 0.0).unwrap();
        let gamma = hinf_norm(&error(&plant, &of_least_gamma)).unwrap().gain;
        for seed in 0..24 {
            let direction = Mat::from_fn(2, order + 2, |i, j| ((seed * 37 + i * 11 + j * 5) as f64).sin());
            for step in [1e-2, -1e-2, 1e-4, -1e-4] {
                let moved = |bank: &StateSpace| {
                    let outputs = hybank_linalg::hstack(&[bank.c(), bank.d()]) + &direction * step;
                    error(&plant, &recursion.with_outputs(&outputs))
                };
                assert!(h2_norm(&moved(&of_least_square)).unwrap() > norm * (1.0 - 1e-12));
                let other = hinf_norm(&moved(&of_least_gamma)).unwrap().gain;
                assert!(other > gamma * (1.0 - 2e-6), "{order} {seed} {step}");
            }
        }
    }
}

#[test]
fn a_bank_without_error_keeps_what_it_needs() {
    // The measurement is the reference, six fast samples earlier: gamma is zero up to rounding errors.
    let plant = plant(6, "{ delay = 0.0 }, { delay = 1.0 }");
    let bank = bank_of(Method::Iir, &plant);
    let problem = problem(&plant, &bank, Aim::WorstCase);
    let (_, record) = reduce(&problem, Reduction::Loss(0.0)).unwrap();
    assert!(record.full.figures.gamma < 1e-11 && record.reduced.figures.gamma < 1e-11, "{record:?}");
    assert!(record.reduced.loss_db < 1e-3 && record.reduced.order >= 5, "{record:?}");
}

#[test]
fn the_same_bits_every_time() {
    let plant = thesis(3);
    let bank = bank_of(Method::Iir, &plant);
    let once = || reduce(&problem(&plant, &bank, Aim::WorstCase), Reduction::Order(2)).unwrap();
    assert_eq!(once(), once());
}
