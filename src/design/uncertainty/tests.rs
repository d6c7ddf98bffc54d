use super::*;
use crate::design::{Options, design};
use crate::spec::Spec;
use crate::units::Seconds;
use crate::verify::uncertainty::ErrorPoint;

fn bank(name: &str) -> Bank {
    match name {
        "thesis" => Bank::from_json(include_str!("../../../filters/thesis-fir.json"), name).unwrap(),
        _ => interleaved(),
    }
}

/// The interleaved converters for inputs of any frequency, with 32 taps: the bank of the digits below.
fn interleaved() -> Bank {
    let text = include_str!("../../../filters/interleaved-4x250M.toml");
    let mut spec = Spec::from_toml(text, "interleaved-4x250M.toml").unwrap();
    (spec.signal, spec.latency, spec.design.taps) = (None, Some(16), Some(32));
    design(&spec, &Options::without_proof()).unwrap().bank
}

/// Against differences of fourth order; the thesis bank with three settings of its delays, where
/// its peak is simple.
#[test]
fn derivatives_are_those_of_differences() {
    for [first, second] in [[0.0, 0.0], [0.06, -0.03], [-0.04, -0.08]] {
        let mut bank = bank("thesis");
        for (channel, error) in bank.spec.as_mut().unwrap().channels.iter_mut().zip([first, second]) {
            channel.delay += Seconds(error);
        }
        let found = delay_derivatives(&bank).unwrap();
        assert!(found.simple, "{found:?}");
        for i in 0..2 {
            let at = |shift: f64| {
                let mut point = ErrorPoint::none(2);
                point.delays[i] = Seconds(shift);
                norm_at(&bank, &point).unwrap().0
            };
            let h = 2e-3;
            let difference = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            let size = found.per_fast_period.iter().fold(0.0, |most: f64, slope| most.max(slope.abs()));
            let slope = found.per_fast_period[i];
            assert!((slope - difference).abs() < 1e-6 * size, "{i} {difference} {found:?}");
        }
    }
}

/// By numpy, with 800 aliases and 800 frequencies.
#[test]
fn floors_are_those_of_a_common_shift() {
    let interleaved = bank("interleaved");
    let errors = ErrorBox { delays: vec![Seconds(10e-12); 4], ..ErrorBox::none(4) };
    let found = floor(&interleaved, &errors, &ErrorPoint::none(4)).unwrap();
    assert!((found.common_shift / 0.0118695554 - 1.0).abs() < 1e-5, "{found:?}");
    for (half, want) in [(0.05, 0.0129157987), (0.1, 0.0256530064)] {
        let errors = ErrorBox { delays: vec![Seconds(half); 2], ..ErrorBox::none(2) };
        let found = floor(&bank("thesis"), &errors, &ErrorPoint::none(2)).unwrap();
        assert!((found.common_shift / want - 1.0).abs() < 1e-5, "{found:?}");
    }
    let relative = ErrorBox { delays: vec![Seconds(0.0), Seconds(0.1)], ..ErrorBox::none(2) };
    assert_eq!(floor(&bank("thesis"), &relative, &ErrorPoint::none(2)).unwrap().common_shift, 0.0);
}

/// The worst case of the interleaved converters at 10 ps: 0.01190629 by numpy on 65 frequencies; no bank
/// beats the floor.
#[test]
fn ten_picoseconds_cost_what_no_bank_can_save() {
    let bank = bank("interleaved");
    let errors = ErrorBox { delays: vec![Seconds(10e-12); 4], ..ErrorBox::none(4) };
    let found = worst_case(&bank, &errors, 0.01).unwrap();
    assert!(found.lower >= 0.01190 && found.upper <= 1.0101 * found.lower, "{found:?}");
    let floor = floor(&bank, &errors, &found.point).unwrap();
    assert!(floor.value() <= found.upper && floor.value() > 0.99 * found.lower, "{floor:?}");
}

/// Gains are worst at vertices; here with the delays of the spec.
#[test]
fn gains_are_worst_at_a_vertex() {
    let bank = bank("thesis");
    let errors = ErrorBox { gains: vec![0.02; 2], ..ErrorBox::none(2) };
    let found = worst_case(&bank, &errors, 0.001).unwrap();
    let at = |gains: [f64; 2]| {
        norm_at(&bank, &ErrorPoint { gains: gains.to_vec(), ..ErrorPoint::none(2) }).unwrap().0
    };
    let most =
        [[0.02, 0.02], [0.02, -0.02], [-0.02, 0.02], [-0.02, -0.02]].map(at).into_iter().fold(0.0, f64::max);
    assert!((found.lower / most - 1.0).abs() < 1e-6 && found.upper <= 1.0011 * most, "{most} {found:?}");
}

#[test]
fn the_affordable_box_costs_what_was_granted() {
    let bank = bank("thesis");
    let errors = ErrorBox { delays: vec![Seconds(0.1); 2], ..ErrorBox::none(2) };
    let factor = affordable(&bank, &errors, 0.02).unwrap();
    let nominal = norm_at(&bank, &ErrorPoint::none(2)).unwrap().0;
    let worst = |factor: f64| worst_case(&bank, &errors.scaled(factor), 0.002).unwrap();
    assert!(worst(factor).lower <= 1.02 * nominal, "{factor}");
    assert!(worst(1.15 * factor).upper > 1.02 * nominal, "{factor}");
    assert!(factor > 0.05 && factor < 0.9, "{factor}");
}
