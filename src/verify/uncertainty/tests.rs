mod ordinary;

use super::*;
use crate::bank::SynthesisFilters;
use crate::linalg::{self, CMat, Complex};
use crate::random::Random;
use std::f64::consts::{PI, TAU};

type C = Complex<f64>;

fn thesis() -> Bank {
    Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json").unwrap()
}

/// wc^2 / (s + wc)^2 with wc = x / 2.
fn phi(nu: f64, x: f64) -> C {
    let pole = C::new(0.5 * x, nu);
    C::new(0.25 * x * x, 0.0) / (pole * pole)
}

/// The plain definition: the gain of the thesis bank at a frequency, by a sum over aliases.
fn gain(bank: &Bank, omega: f64, point: &ErrorPoint) -> f64 {
    const ALIASES: i32 = 60;
    let SynthesisFilters::Fir(taps) = &bank.filters else { panic!("taps") };
    let columns = (2 * ALIASES + 1) as usize;
    let mut k = CMat::zeros(2, columns);
    for c in 0..columns {
        let nu = (omega + TAU * f64::from(c as i32 - ALIASES)) / 2.0;
        for p in 0..2 {
            k[(p, c)] = phi(nu, 1.0) * C::from_polar(1.0, nu * (p as f64 - bank.latency as f64));
            for (i, list) in taps.iter().enumerate() {
                let row = phi(nu, 1.0 + point.cutoffs[i])
                    * (1.0 + point.gains[i])
                    * C::from_polar(1.0, -nu * (bank.delays[i] + point.delays[i]).0);
                let f: C = list
                    .iter()
                    .skip(p)
                    .step_by(2)
                    .enumerate()
                    .map(|(j, f)| C::from_polar(*f, -omega * j as f64))
                    .sum();
                k[(p, c)] -= f * row;
            }
        }
    }
    linalg::largest_singular_value(&k).unwrap() / 2f64.sqrt()
}

fn square_box(half: f64) -> ErrorBox {
    ErrorBox { delays: vec![Seconds(half); 2], ..ErrorBox::none(2) }
}

/// Largest gains at vertices by a grid of 1,200 frequencies with numpy, four digits, and the bound without
/// splitting.
#[test]
fn the_ends_are_those_of_the_table() {
    for (half, lower, unsplit) in
        [(0.05, 0.0421799, 0.04408), (0.1, 0.0478338, 0.05509), (0.2, 0.0682090, 0.08993)]
    {
        let found = worst_case(&thesis(), &square_box(half), 0.01, &[]).unwrap();
        assert!(found.lower > lower * (1.0 - 1e-3) && found.upper < 1.0101 * lower, "{half}: {found:?}");
        assert!(found.upper >= lower * (1.0 - 1e-6) && found.upper < unsplit && found.lower <= found.upper);
        // A loose accuracy costs less work and stays above.
        let loose = worst_case(&thesis(), &square_box(half), 0.3, &[]).unwrap();
        assert!(
            loose.upper >= lower * (1.0 - 1e-6) && loose.gains_computed < found.gains_computed,
            "{loose:?}"
        );
    }
}

/// Front ends whose transition has entries with sum(|E|) above one: balls that follow its powers grow.
#[test]
fn boxes_are_proven_behind_resonant_front_ends_and_signals() {
    for filters in [
        "signal = { band = 0.2 }\ntarget = { filter = { family = \"butterworth\", order = 3, cutoff = 0.3 } }",
        "target = { filter = { family = \"chebyshev1\", order = 5, cutoff = 0.1, ripple_db = 0.5 } }",
        "target = { filter = { family = \"elliptic\", order = 5, cutoff = 0.1, ripple_db = 1, attenuation_db = 60 } }",
    ] {
        let text = format!(
            "fast_period = 1.0\nratio = 2\nlatency = 8\n{filters}\n\
             channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ method = \"fir\", taps = 24 }}"
        );
        let spec = crate::spec::Spec::from_toml(&text, "spec.toml").unwrap();
        let bank = crate::design::design(&spec, &crate::design::Options::without_proof()).unwrap().bank;
        let found = worst_case(&bank, &square_box(1e-9), 0.01, &[]).unwrap();
        let norm = bank.gamma.norm.unwrap();
        assert!(found.upper <= found.lower * 1.0101, "{filters}: {found:?}");
        assert!(found.upper >= norm && found.lower <= norm * 1.001, "{filters}: {found:?} {norm}");
    }
}

/// With a candidate at the peak the lower end is the norm there.
#[test]
fn a_candidate_is_proven() {
    let point = ErrorPoint { delays: vec![Seconds(0.1), Seconds(0.1)], ..ErrorPoint::none(2) };
    let found =
        worst_case(&thesis(), &square_box(0.1), 0.01, &[(point.clone(), RadiansPerSlowPeriod(0.0))]).unwrap();
    assert!(
        (gain(&thesis(), 0.0, &point) / found.lower - 1.0).abs() < 1e-3 || found.point != point,
        "{found:?}"
    );
    assert!(found.upper <= found.lower * 1.0101);
}

/// Never below any of 10,000 random points of boxes of delays, gains and cut-offs.
#[test]
fn no_random_point_is_above_the_upper_end() {
    let bank = thesis();
    let boxes = [
        square_box(0.1),
        ErrorBox { gains: vec![0.0, 0.02], ..square_box(0.05) },
        ErrorBox {
            delays: vec![Seconds(0.0), Seconds(0.03)],
            gains: vec![0.01; 2],
            cutoffs: vec![0.03, 0.0],
        },
        ErrorBox { cutoffs: vec![0.02; 2], ..ErrorBox::none(2) },
    ];
    let mut random = Random(7);
    for errors in boxes {
        let found = worst_case(&bank, &errors, 0.02, &[]).unwrap();
        let mut most: f64 = gain(&bank, found.frequency.0, &found.point);
        assert!((most / found.lower - 1.0).abs() < 1e-4, "{most} {found:?}");
        for trial in 0..2500 {
            let mut draw = |half: f64| half * random.sample();
            let point = ErrorPoint {
                delays: errors.delays.iter().map(|half| Seconds(draw(half.0))).collect(),
                gains: errors.gains.iter().map(|&half| draw(half)).collect(),
                cutoffs: errors.cutoffs.iter().map(|&half| draw(half)).collect(),
            };
            let omega = if trial % 2 == 0 { found.frequency.0 } else { PI * random.part() };
            most = most.max(gain(&bank, omega, &point));
        }
        assert!(most <= found.upper, "{most} {found:?}");
        assert!(found.upper <= 1.0201 * found.lower, "{found:?}");
    }
}

/// A gamma is certified from the worst case on, and none below it.
#[test]
fn gammas_are_certified_from_the_worst_case_on() {
    let found = worst_case(&thesis(), &square_box(0.1), 0.01, &[]).unwrap();
    assert!(certifies(&thesis(), &square_box(0.1), found.upper).unwrap());
    assert!(!certifies(&thesis(), &square_box(0.1), found.lower * (1.0 - 1e-6)).unwrap());
}

#[test]
fn boxes_that_do_not_fit_are_refused() {
    for errors in [
        ErrorBox::none(3),
        ErrorBox { delays: vec![Seconds(-0.1); 2], ..ErrorBox::none(2) },
        ErrorBox { gains: vec![0.7; 2], ..ErrorBox::none(2) },
        ErrorBox { cutoffs: vec![f64::NAN; 2], ..ErrorBox::none(2) },
    ] {
        assert!(
            matches!(worst_case(&thesis(), &errors, 0.01, &[]), Err(VerifyError::ErrorBox { .. })),
            "{errors:?}"
        );
    }
}

/// L_i by numpy: 0.1979, 0.1916.
#[test]
fn slopes_bound_every_difference() {
    let bank = thesis();
    let found = slopes(&bank, &ErrorBox::none(2)).unwrap();
    for (have, want) in found.lipschitz.iter().zip([0.1979, 0.1916]) {
        assert!(*have > want - 1e-4 && *have < want * 1.006, "{found:?}");
    }
    let mut random = Random(3);
    for _ in 0..500 {
        let mut at = || vec![Seconds(0.4 * random.sample()), Seconds(0.4 * random.sample())];
        let (one, other) = (at(), at());
        let distance: f64 = (0..2).map(|i| (one[i] - other[i]).0.abs() * found.lipschitz[i]).sum();
        let point = |delays: &[Seconds]| ErrorPoint { delays: delays.to_vec(), ..ErrorPoint::none(2) };
        let omega = PI * random.part();
        let change = gain(&bank, omega, &point(&one)) - gain(&bank, omega, &point(&other));
        assert!(change.abs() <= distance, "{change} {distance}");
    }
}

/// Jitter that repeats after 16 slow periods makes a periodic system, whose gain for inputs of that period
/// is the norm of a matrix.
#[test]
fn no_jitter_adds_more_than_its_bound() {
    const PERIODS: usize = 16;
    let bank = thesis();
    let SynthesisFilters::Fir(taps) = &bank.filters else { panic!("taps") };
    let (most, fast) = (0.1, 2 * PERIODS);
    let bound = slopes(&bank, &ErrorBox::none(2)).unwrap().jitter(&[Seconds(most); 2], Seconds(1.0));
    let mut random = Random(11);
    let mut largest: f64 = 0.0;
    for trial in 0..40 {
        let pattern: Vec<[f64; 2]> = (0..PERIODS)
            .map(|k| {
                [0, 1].map(|i| {
                    if (trial + k * (1 + i * trial)) % 3 == 0 {
                        most
                    } else {
                        most * random.sample().signum()
                    }
                })
            })
            .collect();
        // Columns: tones of period 2 PERIODS up to 6 times the fast rate; rows: the fast samples of one
        // period.
        let tones: Vec<f64> =
            (-6 * fast as i32..=6 * fast as i32).map(|q| TAU * f64::from(q) / fast as f64).collect();
        let change = CMat::from_fn(fast, tones.len(), |n, c| {
            let nu = tones[c];
            let mut sum = C::new(0.0, 0.0);
            for (i, list) in taps.iter().enumerate() {
                for (j, f) in list.iter().skip(n % 2).step_by(2).enumerate() {
                    let k = (n / 2 + PERIODS - j % PERIODS) % PERIODS;
                    let time = 2.0 * (n / 2) as f64 - 2.0 * j as f64 - bank.delays[i].0;
                    sum += phi(nu, 1.0)
                        * (C::from_polar(*f, nu * (time - pattern[k][i])) - C::from_polar(*f, nu * time));
                }
            }
            sum
        });
        let gain = linalg::largest_singular_value(&change).unwrap() / (fast as f64).sqrt();
        assert!(gain <= bound, "{gain} {bound}");
        largest = largest.max(gain);
    }
    assert!(largest > 0.4 * bound, "{largest} {bound}");
}

/// Recursive filters have an infinite memory.
#[test]
fn recursive_banks_have_a_worst_case() {
    let bank = Bank::from_json(include_str!("../../../filters/thesis-iir.json"), "thesis-iir.json").unwrap();
    let found = worst_case(&bank, &square_box(0.05), 0.02, &[]).unwrap();
    assert!(found.lower > 0.0399 && found.upper <= 1.0201 * found.lower, "{found:?}");
}
