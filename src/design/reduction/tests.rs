use super::dynamics::Dynamics;
use super::dynamics::{mean_square, state_covariance_root};
use super::plant_samples::PlantSamples;
use super::*;
use crate::design::Problem;
use crate::design::methods::{Filters, Settings, synthesise};
use crate::design::plant::LiftedPlant;
use crate::linalg::{self, Complex, Mat};
use crate::lti::StateSpace;
use crate::lti::gramian::balanced;
use crate::lti::gramian::h2_norm;
use crate::lti::peak::hinf_norm;
use crate::spec::{Method, Spec};
use std::sync::LazyLock;

static NEVER: LazyLock<Stop> = LazyLock::new(Stop::default);

/// The thesis example with other delays and latency.
fn plant(latency: usize, delays: &str) -> LiftedPlant {
    let text = format!(
        "fast_period = 1.0\nratio = 2\nlatency = {latency}\n\
         target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n\
         channel = [{delays}]\ndesign = {{ method = \"iir\" }}"
    );
    LiftedPlant::new(&Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), latency).unwrap())
}

fn thesis(latency: usize) -> LiftedPlant {
    plant(latency, "{ delay = 1.2 }, { delay = 0.6 }")
}

/// The full bank.
fn bank_of(method: Method, plant: &LiftedPlant) -> StateSpace {
    match synthesise(method, plant, &Settings::default()).unwrap().filters {
        Filters::StateSpace(system) => system,
        Filters::Fir(_) => unreachable!(),
    }
}

fn problem<'a>(plant: &'a LiftedPlant, bank: &'a StateSpace, aim: Aim) -> ReductionProblem<'a> {
    let order = FirWithTail::new(bank).unwrap().realise().order();
    ReductionProblem { plant, bank, order, width: plant.channels(), aim, gamma_margin: 0.0, stop: &NEVER }
}

fn error(plant: &LiftedPlant, bank: &StateSpace) -> StateSpace {
    plant.error_system(bank)
}

/// Largest gain on a dense grid, by one LU factorisation a frequency: a lower bound that knows no level
/// sets.
fn dense_grid(error: &StateSpace) -> f64 {
    let gain = |k: usize| {
        let z = Complex::from_polar(1.0, std::f64::consts::PI * k as f64 / 4000.0);
        linalg::singular_values(&error.response_at(z)).unwrap()[0]
    };
    (0..=4000).map(gain).fold(0.0, f64::max)
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
        let smaller = smaller.unwrap().realise();
        assert!(smaller.order() <= order && record.reduced.order == smaller.order(), "{record:?}");
        let (on_grid, reported) = (dense_grid(&error(&plant, &smaller)), record.reduced.figures.gamma);
        assert!(
            on_grid <= reported * (1.0 + 1e-7) && on_grid > reported * (1.0 - 1e-4),
            "{order}: {on_grid} {reported}"
        );
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
        let (smaller, record) = reduce(&problem, Reduction::Order(problem.order)).unwrap();
        assert!(smaller.is_none() && record.reduced == record.full && record.full.loss_db == 0.0);
        assert_eq!(record.orders.len(), problem.order + 1);
        for pair in record.orders.windows(2) {
            assert!(pair[0].loss_db >= pair[1].loss_db - 1e-4, "{:?}", record.orders);
        }
        // Every one of these states but the last two lowers the error by more than half a decibel.
        assert!(record.orders[..8].windows(2).all(|pair| pair[0].loss_db > pair[1].loss_db + 0.5));
    }
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
        let norm = hinf_norm(&error(&plant, &smaller.unwrap().realise())).unwrap().gain;
        assert!((norm / record.reduced.figures.gamma - 1.0).abs() < 1e-9);
    }
}

/// Both choices of output matrices are optima of convex problems: no direction leads downhill. Judged by
/// exact norms, which the optimisers do not use.
#[test]
fn no_other_outputs_is_better() {
    let plant = thesis(6);
    let bank = bank_of(Method::Iir, &plant);
    for (lags, order) in [(0, 0), (0, 3), (1, 2)] {
        let whole = Dynamics::balanced(&bank, lags, &state_covariance_root(&plant, &bank).unwrap()).unwrap();
        let dynamics = whole.truncated(order);
        let (square, norm) = mean_square(&plant, &dynamics).unwrap();
        let built = |outputs: &Mat| error(&plant, &dynamics.with_outputs(outputs).realise());
        assert!((h2_norm(&built(&square)).unwrap() / norm - 1.0).abs() < 1e-9);
        let best = PlantSamples::new(&plant, &NEVER).unwrap().best_bank(&dynamics, 0.0).unwrap().realise();
        let mut worst = Mat::zeros(2, square.ncols());
        worst.columns_mut(0, best.order()).copy_from(best.c());
        worst.columns_mut(best.order(), 2).copy_from(best.d());
        let gamma = hinf_norm(&built(&worst)).unwrap().gain;
        for seed in 0..24 {
            let direction =
                Mat::from_fn(2, square.ncols(), |i, j| ((seed * 37 + i * 11 + j * 5) as f64).sin());
            for step in [1e-2, -1e-2, 1e-4, -1e-4] {
                let moved = |from: &Mat| built(&(from + &direction * step));
                assert!(h2_norm(&moved(&square)).unwrap() > norm * (1.0 - 1e-12));
                assert!(
                    hinf_norm(&moved(&worst)).unwrap().gain > gamma * (1.0 - 2e-6),
                    "{lags} {order} {seed} {step}"
                );
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

/// A refinement whose computations failed ended as one that had nothing to gain.
#[test]
fn a_refinement_that_fails_says_so() {
    let plant = thesis(4);
    let bank = bank_of(Method::Iir, &plant);
    let root = state_covariance_root(&plant, &bank).unwrap();
    let start = Dynamics::balanced(&bank, 0, &root).unwrap().truncated(2);
    let mut samples = PlantSamples::new(&plant, &NEVER).unwrap();
    let refine =
        |samples: &PlantSamples<'_>| pole_refinement::refined(Aim::WorstCase, samples, &start, 4).unwrap();
    assert_eq!(refine(&samples).failure, None);
    samples.samples[0].w[(0, 0)].re = f64::NAN;
    let failed = refine(&samples);
    assert!(matches!(failed.failure, Some(DesignError::Linalg(_))), "{:?}", failed.failure);
}
