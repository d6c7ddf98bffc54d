use super::*;
use crate::calibrate::testbench::gaussian;
use crate::random::Random;

/// The line of two whole recordings.
fn found(reference: &[f64], other: &[f64]) -> Result<LagLine, Vec<i64>> {
    let [reference, other] = [reference, other].map(|samples| Record::new(samples.to_vec()));
    line(&reference, &other, f64::INFINITY)
}

fn noise(count: usize, dice: &mut Random) -> Vec<f64> {
    (0..count).map(|_| gaussian(dice)).collect()
}

#[test]
fn lags_are_found_at_any_distance_and_length() {
    let mut dice = Random(71);
    let event = noise(400_000, &mut dice);
    let recorded = |first: usize, count: usize, gain: f64, dice: &mut Random| -> Vec<f64> {
        event[first..first + count].iter().map(|x| gain * (x + 0.3 * gaussian(dice)) + 0.2).collect()
    };
    for (a, b) in
        [((0, 1024), (100, 1100)), ((0, 300_000), (250_000, 150_000)), ((90_000, 9_000), (0, 200_000))]
    {
        let one = recorded(a.0, a.1, 1.0, &mut dice);
        let two = recorded(b.0, b.1, -0.1, &mut dice);
        let line = found(&one, &two).unwrap();
        let lag = line.lag_at(a.1 as f64 / 2.0);
        assert!((lag - (a.0 as f64 - b.0 as f64)).abs() < 1.5, "{a:?} {b:?} {line:?}");
    }
}

#[test]
fn recordings_without_anything_in_common_have_no_lag() {
    let mut dice = Random(72);
    for count in [1024, 5000, 200_000] {
        let [a, b] = [(); 2].map(|()| noise(count, &mut dice));
        assert_eq!(found(&a, &b), Err(Vec::new()), "{count}");
    }
}

#[test]
fn what_repeats_has_many_lags() {
    let tone = |count: usize, early: f64| -> Vec<f64> {
        (0..count).map(|k| (0.7 * (k as f64 + early)).sin()).collect()
    };
    let alike = found(&tone(200_000, 0.0), &tone(200_000, 70.3)).unwrap_err();
    assert!(alike.len() > 1, "{alike:?}");
    let mut dice = Random(73);
    let once = noise(9_000, &mut dice);
    let again: Vec<f64> = once.iter().cycle().take(150_000).copied().collect();
    let alike = found(&again, &again[4_000..]).unwrap_err();
    assert!(alike.len() > 1, "{alike:?}");
}
