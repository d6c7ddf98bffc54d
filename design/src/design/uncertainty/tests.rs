//! Bounds over boxes against sums over aliases, which share nothing with the proof, at random points.

use super::*;
use crate::design::filters::FilterResponse;
use crate::design::{DesignError, norm_at};
use crate::tests::designed;
use hybank_core::bank::Bank;
use hybank_core::spec::{ErrorBox, ErrorPoint, Spec};
use hybank_core::units::{FastPeriods, RadiansPerFastPeriod};
use hybank_linalg::{CMat, Complex};
use hybank_verify::analog::StrictlyProper;
use hybank_verify::verify::VerifyError;
use std::f64::consts::{PI, TAU};
use trials::random::Random;

type C = Complex<f64>;

/// Aliases on each side. Those that are left out would add to a gain, so it is one from below.
const ALIASES: i32 = 100;

fn thesis() -> Bank {
    Bank::from_json(include_str!("../../../../filters/thesis-fir.json"), "thesis-fir.json").unwrap()
}

fn bank(text: &str) -> Bank {
    designed(&Spec::from_toml(text, "spec.toml").unwrap()).bank
}

fn delays(half: f64) -> ErrorBox {
    ErrorBox { delays: vec![FastPeriods(half); 2], ..ErrorBox::none(2) }
}

/// The gain at an angle by its definition.
fn gain(bank: &Bank, omega: f64, point: &ErrorPoint) -> f64 {
    let spec = bank.spec.as_ref().unwrap().with_errors(point);
    let signal = hybank_verify::analog::signal(&spec).unwrap();
    let made = |filter| StrictlyProper::driven_by(signal.as_ref(), filter, spec.fast_period).unwrap();
    let (target, m) = (made(&spec.target), bank.ratio);
    let front_ends: Vec<_> = spec.channels.iter().map(|channel| made(&channel.filter)).collect();
    let times = spec.layout().waited_delays(&spec.delays());
    let owners = spec.layout().owners();
    let f = FilterResponse::new(&bank.filters, bank.ratio).unwrap().at(omega);
    let k = CMat::from_fn(m, (2 * ALIASES + 1) as usize, |p, column| {
        let nu = (omega + TAU * f64::from(column as i32 - ALIASES)) / m as f64;
        let of = |filter: &StrictlyProper| {
            let w = RadiansPerFastPeriod(nu);
            filter.response(w) * signal.as_ref().map_or(C::from(1.0), |signal| signal.response(w))
        };
        let reference = of(&target) * C::from_polar(1.0, nu * (p as f64 - bank.latency as f64));
        (0..f.ncols()).fold(reference, |sum, i| {
            let (size, delay) = (spec.channels[owners[i]].gain, times[i].in_fast_periods().0);
            sum - f[(p, i)] * of(&front_ends[owners[i]]) * C::from_polar(size, -nu * delay)
        })
    });
    hybank_linalg::largest_singular_value(&k).unwrap() / (m as f64).sqrt()
}

/// The study of a box. No random point exceeds the bound, and the bound exceeds what is attained by at
/// most the factor `most`.
fn check(bank: &Bank, errors: &ErrorBox, points: usize, most: f64) -> BoxStudy {
    let found = BoxStudy::new(bank, errors).unwrap();
    assert!(found.upper <= most * found.attained, "{found:?}");
    let mut random = Random(9);
    let peak = found.peak_hertz.0 * TAU * bank.slow_period().0;
    let h = bank.fast_period;
    for trial in 0..points {
        // Corners, insides and points near the worst one.
        let mut draw = |half: f64, worst: f64| match trial % 3 {
            0 => half * random.sample().signum(),
            1 => half * random.sample(),
            _ => (worst + 0.1 * half * random.sample()).clamp(-half, half),
        };
        let mut point = ErrorPoint::none(bank.channel_count());
        for i in 0..bank.channel_count() {
            let worst = found.point.delays[i].in_fast_periods(h).0;
            point.delays[i] = FastPeriods(draw(errors.delays[i].0, worst));
            point.gains[i] = draw(errors.gains[i], found.point.gains[i]);
            point.cutoffs[i] = draw(errors.cutoffs[i], found.point.cutoffs[i]);
        }
        let omega = if trial % 2 == 0 { peak + 0.02 * random.sample() } else { PI * random.part() };
        let gain = gain(bank, omega, &point);
        assert!(gain <= found.upper * (1.0 + 1e-9), "{gain} at {omega}, {point:?}: {found:?}");
    }
    found
}

/// Errors of both delays of the thesis bank: what is attained are the digits of branch and bound.
#[test]
fn boxes_of_the_thesis_bank_have_their_known_worst_cases() {
    for (half, attained, most) in [(0.05, 0.0421799, 1.52), (0.1, 0.0478338, 1.95), (0.2, 0.0682090, 2.5)] {
        let found = check(&thesis(), &delays(half), 200, most);
        assert!((found.attained / attained - 1.0).abs() < 1e-5, "{found:?}");
    }
}

/// Errors of all kinds in three channels without a reference, with and without a signal.
#[test]
fn errors_of_all_kinds_are_bounded() {
    for signal in ["", "signal = { band = 0.2 }"] {
        let bank = bank(&format!(
            "fast_period = 1.0\nratio = 2\nlatency = 8\n{signal}\n\
             target = {{ filter = {{ family = \"elliptic\", order = 3, cutoff = 0.1875, ripple_db = 1, attenuation_db = 40 }} }}\n\
             channel = [{{ delay = 1.2 }}, {{ delay = 0.6, gain = 1.1 }}, {{ delay = 0.1 }}]\n\
             design = {{ method = \"fir\", taps = 12 }}",
        ));
        let (delays, gains, cutoffs) = (vec![FastPeriods(0.01); 3], vec![5e-3; 3], vec![3e-3; 3]);
        check(&bank, &ErrorBox { delays, gains, cutoffs }, 300, 3.0);
    }
}

/// A common error of the samples that one converter takes in a frame.
#[test]
fn samples_of_one_converter_share_their_error() {
    let bank = bank(
        "fast_rate = 6.0\ntarget = { filter = { family = \"butterworth\", order = 4, cutoff = 1.0 } }\n\
         channel = [{ rate = 3.0, delay = 0.2 }, { rate = 2.0, delay = 0.1 }]\nlatency = 12\n\
         design = { method = \"fir\", taps = 24 }",
    );
    check(
        &bank,
        &ErrorBox { delays: vec![FastPeriods(0.0), FastPeriods(0.02)], ..ErrorBox::none(2) },
        100,
        1.7,
    );
}

/// Gains are exact to first order.
#[test]
fn gains_are_worst_at_a_vertex() {
    let bank = thesis();
    let found = check(&bank, &ErrorBox { gains: vec![0.02; 2], ..ErrorBox::none(2) }, 100, 2.0);
    let at = |gains: [f64; 2]| {
        norm_at(&bank, &ErrorPoint { gains: gains.to_vec(), ..ErrorPoint::none(2) }).unwrap()
    };
    let most =
        [[0.02, 0.02], [0.02, -0.02], [-0.02, 0.02], [-0.02, -0.02]].map(at).into_iter().fold(0.0, f64::max);
    assert!((found.attained / most - 1.0).abs() < 1e-6, "{most} {found:?}");
}

/// Resonant front ends, front ends that pass steps, recursive filters, and errors from 1e-12 on.
#[test]
fn boxes_around_ordinary_filters_are_bounded() {
    let two_channels = |family: &str, method: &str| {
        bank(&format!(
            "fast_period = 1.0\nratio = 2\nlatency = 8\ntarget = {{ filter = {{ {family} }} }}\n\
             channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ {method} }}"
        ))
    };
    let second =
        |half: f64| ErrorBox { delays: vec![FastPeriods(0.0), FastPeriods(half)], ..ErrorBox::none(2) };
    let cutoff = |half: f64| ErrorBox { cutoffs: vec![0.0, half], ..ErrorBox::none(2) };
    let (fir, chebyshev) = ("method = \"fir\", taps = 24", "family = \"chebyshev1\", ripple_db = 0.5");
    let resonant = two_channels(&format!("{chebyshev}, order = 5, cutoff = 0.1"), fir);
    check(&resonant, &second(1e-12), 30, 1.1);
    check(&resonant, &second(1e-6), 30, 2.0);
    check(&resonant, &cutoff(1e-3), 30, 2.0);
    let stepping = two_channels("family = \"rc\", cutoff = 0.2", fir);
    check(&stepping, &second(1e-2), 100, 4.0);
    let steep = two_channels("family = \"butterworth\", order = 6, cutoff = 0.05", "method = \"iir\"");
    check(&steep, &cutoff(1e-3), 30, 2.0);
    let h2 = two_channels(&format!("{chebyshev}, order = 8, cutoff = 0.05"), "method = \"h2\"");
    check(&h2, &ErrorBox { gains: vec![0.0, 1e-3], ..ErrorBox::none(2) }, 30, 2.0);
}

/// A bank and a box of this number.
fn random_case(trial: u64) -> (Bank, ErrorBox) {
    let mut random = Random(1000 + trial);
    let mut part = || random.part();
    let pick = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
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
            errors.delays[i] = FastPeriods(size(0.02, part()));
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
fn random_boxes_are_bounded() {
    for trial in trials::trials(3) {
        let (bank, errors) = random_case(trial);
        let found = check(&bank, &errors, 20, 6.0);
        println!("{trial}: {:.3e} of {:.3e}, {errors:?}", found.upper / found.attained, found.attained);
    }
}

#[test]
fn boxes_that_do_not_fit_are_refused() {
    let refused = |errors: ErrorBox| match BoxStudy::new(&thesis(), &errors) {
        Err(DesignError::Verify(VerifyError::ErrorBox { rule })) => rule,
        other => panic!("{other:?}"),
    };
    assert!(refused(ErrorBox::none(3)).contains("2 channels"));
    assert!(refused(delays(-0.1)).contains("zero or more"));
    assert!(refused(ErrorBox { cutoffs: vec![0.5, 0.0], ..ErrorBox::none(2) }).contains("50 %"));
}
