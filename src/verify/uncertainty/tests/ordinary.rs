//! Boxes around ordinary filters: none is refused, the ends are as close as asked, and no point of the box
//! is above them by a sum over aliases, which shares nothing with the proof.

use super::super::*;
use crate::analog::StrictlyProper;
use crate::bank::{StateSpace, SynthesisFilters};
use crate::design::{Options, design};
use crate::linalg::{self, CMat, Complex};
use crate::random::Random;
use crate::spec::Spec;
use crate::units::RadiansPerFastPeriod;
use std::f64::consts::{PI, TAU};

type C = Complex<f64>;

/// Aliases on each side. Those that are left out would add to a gain, so it is one from below.
const ALIASES: i32 = 100;

fn bank(text: &str) -> Bank {
    design(&Spec::from_toml(text, "spec.toml").unwrap(), &Options::without_proof()).unwrap().bank
}

/// M = 2, h = 1, delays 1.2 and 0.6.
fn two_channels(family: &str, method: &str) -> Bank {
    bank(&format!(
        "fast_period = 1.0\nratio = 2\nlatency = 8\ntarget = {{ filter = {{ {family} }} }}\n\
         channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ {method} }}"
    ))
}

/// F(e^{j omega}), M x N.
fn filters(bank: &Bank, omega: f64) -> CMat {
    match &bank.filters {
        SynthesisFilters::Fir(taps) => CMat::from_fn(bank.ratio, taps.len(), |p, i| {
            let lags = taps[i].iter().skip(p).step_by(bank.ratio).enumerate();
            lags.map(|(lag, tap)| C::from_polar(*tap, -omega * lag as f64)).sum()
        }),
        SynthesisFilters::StateSpace(StateSpace { a, b, c, d }) => {
            let of = |m: &[Vec<f64>], i: usize, j: usize| C::from(m[i][j]);
            let z = C::from_polar(1.0, omega);
            let shifted =
                CMat::from_fn(a.len(), a.len(), |i, j| if i == j { z - a[i][j] } else { -of(a, i, j) });
            let inputs = CMat::from_fn(a.len(), d[0].len(), |i, j| of(b, i, j));
            let outputs = CMat::from_fn(d.len(), a.len(), |i, j| of(c, i, j));
            let direct = CMat::from_fn(d.len(), d[0].len(), |i, j| of(d, i, j));
            outputs * linalg::solve(&shifted, &inputs) + direct
        }
    }
}

/// The gain at a frequency by its definition.
fn gain(bank: &Bank, omega: f64, point: &ErrorPoint) -> f64 {
    let (spec, m) = (bank.spec.as_ref().unwrap(), bank.ratio);
    let made = |filter| StrictlyProper::new(filter, spec.fast_period).unwrap();
    let (target, front_ends) =
        (made(&spec.target), spec.channels.iter().map(|c| made(&c.filter)).collect::<Vec<_>>());
    let f = filters(bank, omega);
    let k = CMat::from_fn(m, (2 * ALIASES + 1) as usize, |p, column| {
        let nu = (omega + TAU * f64::from(column as i32 - ALIASES)) / m as f64;
        let of = |filter: &StrictlyProper, x: f64| filter.response(RadiansPerFastPeriod(nu / x));
        let reference = of(&target, 1.0) * C::from_polar(1.0, nu * (p as f64 - bank.latency as f64));
        (0..f.ncols()).fold(reference, |sum, i| {
            let size = (1.0 + point.gains[i]) * spec.channels[i].gain;
            let delay = (spec.channels[i].delay + point.delays[i]).0;
            sum - f[(p, i)] * of(&front_ends[i], 1.0 + point.cutoffs[i]) * C::from_polar(size, -nu * delay)
        })
    });
    linalg::largest_singular_value(&k).unwrap() / (m as f64).sqrt()
}

/// Proves the box from candidates at its centre, and compares it with random points.
fn check(bank: &Bank, errors: &ErrorBox, accuracy: f64, points: usize) -> WorstCase {
    let centre = ErrorPoint::none(bank.channel_count());
    let found = worst_case(bank, errors, accuracy, &[(centre, RadiansPerSlowPeriod(1.0))]).unwrap();
    assert!(found.upper <= found.lower * (1.0 + accuracy) * (1.0 + 1e-9), "{errors:?} {found:?}");
    let mut random = Random(9);
    for trial in 0..points {
        // Corners, insides and points near the worst one.
        let mut draw = |half: f64, worst: f64| match trial % 3 {
            0 => half * random.sample().signum(),
            1 => half * random.sample(),
            _ => (worst + 0.1 * half * random.sample()).clamp(-half, half),
        };
        let n = bank.channel_count();
        let point = ErrorPoint {
            delays: (0..n).map(|i| Seconds(draw(errors.delays[i].0, found.point.delays[i].0))).collect(),
            gains: (0..n).map(|i| draw(errors.gains[i], found.point.gains[i])).collect(),
            cutoffs: (0..n).map(|i| draw(errors.cutoffs[i], found.point.cutoffs[i])).collect(),
        };
        let omega =
            if trial % 2 == 0 { found.frequency.0 + 0.02 * random.sample() } else { PI * random.part() };
        let gain = gain(bank, omega, &point);
        assert!(gain <= found.upper * (1.0 + 1e-9), "{gain} at {omega}, {point:?}: {found:?}");
    }
    found
}

fn delays(half: f64) -> ErrorBox {
    ErrorBox { delays: vec![Seconds(0.0), Seconds(half)], ..ErrorBox::none(2) }
}

/// Banks that were refused or had ends far apart: balls that followed the powers of resonant front ends,
/// remainders of front ends that pass steps, the second derivative in the cut-off near poles, and filters
/// whose states are badly scaled.
#[test]
fn boxes_around_ordinary_filters_are_proven_as_closely_as_asked() {
    let chebyshev = "family = \"chebyshev1\", ripple_db = 0.5";
    let fir = "method = \"fir\", taps = 24";
    let resonant = two_channels(&format!("{chebyshev}, order = 5, cutoff = 0.1"), fir);
    check(&resonant, &delays(1e-9), 0.01, 30);
    check(&resonant, &ErrorBox { cutoffs: vec![0.0, 1e-3], ..ErrorBox::none(2) }, 0.01, 30);
    let stepping = "family = \"elliptic\", order = 3, cutoff = 0.2, ripple_db = 1, attenuation_db = 40";
    let stepping = two_channels(stepping, fir);
    check(&stepping, &delays(1e-2), 0.01, 100);
    let steep = two_channels("family = \"butterworth\", order = 6, cutoff = 0.05", "method = \"iir\"");
    check(&steep, &ErrorBox { cutoffs: vec![0.0, 1e-3], ..ErrorBox::none(2) }, 0.01, 30);
    let scaled = two_channels(&format!("{chebyshev}, order = 8, cutoff = 0.05"), "method = \"h2\"");
    check(&scaled, &ErrorBox { gains: vec![0.0, 1e-3], ..ErrorBox::none(2) }, 0.01, 30);
}

/// Errors of all kinds in three channels without a reference.
#[test]
fn errors_of_three_channels_are_proven_within_half_a_per_cent() {
    let bank = bank(
        "fast_period = 1.0\nratio = 2\nlatency = 8\n\
         target = { filter = { family = \"butterworth\", order = 4, cutoff = 0.1875 } }\n\
         channel = [{ delay = 1.2 }, { delay = 0.6 }, { delay = 0.1 }]\ndesign = { method = \"fir\", taps = 12 }",
    );
    let errors = ErrorBox { delays: vec![Seconds(0.01); 3], gains: vec![5e-3; 3], cutoffs: vec![3e-3; 3] };
    check(&bank, &errors, 0.005, 300);
}

/// A bank and a box of this number.
fn random_case(trial: u64) -> (Bank, ErrorBox) {
    let mut random = Random(1000 + trial);
    let mut part = || random.part();
    let pick = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
    // The last two have a direct term for even orders.
    let families: [(&str, &str, &[usize]); 5] = [
        ("butterworth", "", &[2, 3, 4, 5, 6, 7]),
        ("bessel", "", &[2, 3, 4, 5, 6]),
        ("chebyshev1", ", ripple_db = 0.5", &[2, 3, 4, 5, 6, 7, 8]),
        ("chebyshev2", ", attenuation_db = 50", &[3, 5]),
        ("elliptic", ", ripple_db = 0.5, attenuation_db = 50", &[3, 5]),
    ];
    let (family, more, orders) = families[pick(part(), families.len())];
    let order = orders[pick(part(), orders.len())];
    let (ratio, cutoff) = (1 + pick(part(), 3), 0.03 + 0.4 * part());
    let n = ratio + pick(part(), 2);
    let channels: Vec<String> = (0..n)
        .map(|i| format!("{{ delay = {} }}", (i as f64 + 0.8 * part()) * ratio as f64 / n as f64))
        .collect();
    let method = ["method = \"fir\", taps = 16", "method = \"iir\"", "method = \"h2\""][pick(part(), 3)];
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = {}\n\
         target = {{ filter = {{ family = \"{family}\", order = {order}, cutoff = {cutoff}{more} }} }}\n\
         channel = [{}]\ndesign = {{ {method} }}",
        4 + pick(part(), 6),
        channels.join(", ")
    );
    let kind = pick(part(), 4);
    let size = |most: f64, part: f64| most * 10f64.powf(-4.0 * part);
    let mut errors = ErrorBox::none(n);
    // Channel 1 is the reference, if there are others.
    for i in (0..n).skip(usize::from(n > 1)) {
        if kind == 0 || kind == 3 {
            errors.delays[i] = Seconds(size(0.02, part()));
        }
        if kind == 1 || kind == 3 {
            errors.gains[i] = size(0.02, part());
        }
        if kind == 2 || kind == 3 {
            errors.cutoffs[i] = size(0.002, part());
        }
    }
    (bank(&text), errors)
}

/// `HYBANK_TRIALS=0..100` makes as many, in minutes.
#[test]
fn random_boxes_are_proven_as_closely_as_asked() {
    for trial in crate::trials::trials(3) {
        let (bank, errors) = random_case(trial);
        println!("{trial}: {errors:?}");
        let begin = std::time::Instant::now();
        let found = check(&bank, &errors, 0.01, 20);
        println!(
            "{trial}: {:.3e} to {:.3e}, {:.1} s",
            found.lower,
            found.upper,
            begin.elapsed().as_secs_f64()
        );
    }
}
