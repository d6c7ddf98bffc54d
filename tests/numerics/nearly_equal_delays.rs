//! Two channels whose delays differ by less than the data's precision. What the samples' difference tells
//! depends on digits that neither the spec nor a double has, so no bound may rest on it.
//! `HYBANK_TRIALS=200` tries that many random plants.

use crate::support::random::Random;
use crate::support::specs::{alike, low_pass, with_taps};
use crate::support::sweep::each;
use hybank::bank::Gamma;
use hybank::design::{DesignError, Options, design};
use hybank::spec::{DesignSpec, Family, Method, Spec};

/// Distances at which doubles resolve the difference of two samples. As the distance shrinks, gamma tends to
/// that of a sample and a sample of the derivative.
const RESOLVED: [f64; 2] = [1e-3, 1e-4];
/// How far gamma may still be from that limit.
const NEAR_THE_LIMIT: f64 = 0.1;
/// Gammas below this are zero.
const ZERO: f64 = 1e-9;

/// A random plant whose first two channels are `apart` fast samples apart.
fn plant(number: u64, apart: f64) -> Spec {
    let mut dice = Random(number);
    let family = dice.of(&[Family::Butterworth, Family::Bessel]);
    let filter = low_pass(family, dice.count(2, 6), 0.1 * 20f64.powf(dice.part()));
    let (ratio, others, taps) = (dice.count(1, 3), dice.count(0, 1), dice.count(1, 8));
    let latency = dice.count(0, taps);
    let first = ratio as f64 * dice.part();
    let mut delays = vec![first, first + apart];
    delays.extend((0..others).map(|_| ratio as f64 * dice.part()));
    let spec = alike(&filter, ratio, latency, &delays);
    match dice.below(4) {
        0 => Spec { design: DesignSpec::new(Method::Iir, None), ..spec },
        _ => with_taps(spec, taps),
    }
}

fn gamma(spec: &Spec) -> Result<Gamma, DesignError> {
    Ok(design(spec, &Options::without_proof())?.bank.gamma)
}

/// The least gamma of banks for plants near the limit.
fn reached(number: u64) -> Option<f64> {
    let norms = RESOLVED.map(|apart| gamma(&plant(number, apart)).ok().and_then(|gamma| gamma.norm));
    norms.into_iter().flatten().min_by(f64::total_cmp)
}

/// How the bounds of a plant ended.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    /// They hold.
    Holds,
    /// None is stated.
    Unstated,
    /// A bank is better than one of them.
    Beaten,
    Refused,
}

fn end_of(number: u64) -> (i32, End) {
    let decade = 6 + (number % 8) as i32;
    let apart = 10f64.powi(-decade) * (1.0 + 9.0 * Random(!number).part());
    let spec = plant(number, apart);
    let (Ok(found), Some(reached)) = (gamma(&spec), reached(number)) else { return (decade, End::Refused) };
    let bar = reached * (1.0 + NEAR_THE_LIMIT) + ZERO;
    let bounds = [found.lower, found.noncausal];
    if bounds.into_iter().flatten().any(|bound| bound > bar) {
        println!("plant {number}: {apart:e} apart, {found:?}, but {reached:e} is reached: {:?}", spec.design);
        return (decade, End::Beaten);
    }
    (decade, if found.lower.is_some() { End::Holds } else { End::Unstated })
}

#[test]
fn no_bound_rests_on_differences_below_the_precision_of_delays() {
    let ends = each(trials::trials(20), end_of);
    for decade in (6..14).rev() {
        let of = |end: End| ends.iter().filter(|found| **found == (decade, end)).count();
        let [holds, unstated, beaten, refused] =
            [End::Holds, End::Unstated, End::Beaten, End::Refused].map(of);
        println!(
            "1e-{decade} apart: {holds} bounds hold, {unstated} not stated, {beaten} beaten, {refused} refused"
        );
    }
    let any = |end: End| ends.iter().any(|(_, found)| *found == end);
    assert!(!any(End::Beaten) && any(End::Holds) && any(End::Unstated));
}

/// The bounds of ordinary plants are stated.
#[test]
fn delays_a_millionth_apart_are_resolved() {
    for apart in [1e-3, 1e-6] {
        let spec = with_taps(alike(&low_pass(Family::Butterworth, 2, 0.5), 2, 4, &[0.6, 0.6 + apart]), 8);
        let found = gamma(&spec).unwrap();
        let (lower, norm) = (found.lower.unwrap(), found.norm.unwrap());
        assert!(lower <= norm && lower > 0.99 * norm, "{apart:e}: {found:?}");
    }
}
