//! Random plants of all families, forms and rates, each with a FIR, a recursive and a mean-square bank.

use super::fronts::Front;
use super::real::{Complex, double, real};
use super::roots::expand;
use super::statements::{Tally, campaign, examined};
use crate::support::Desk;
use crate::support::random::Random;
use serde_json::{Value, json};

/// Seeds of the campaigns begin here, so that no other test draws the same cases.
const SEED: u64 = 0xA0D1_7001;
/// Plants of the short form.
const PLANTS: usize = 3;

/// A family as the spec names it, edge at `cutoff` hertz.
pub(crate) fn family(dice: &mut Random, cutoff: f64) -> Value {
    let name = dice.of(&["butterworth", "butterworth", "chebyshev1", "bessel", "elliptic", "rc"]);
    let order = match name {
        "elliptic" => dice.of(&[3, 5, 7]),
        "bessel" => dice.count(1, 6),
        _ => dice.count(1, 8),
    };
    let mut filter = json!({ "family": name, "cutoff": cutoff });
    if name != "rc" {
        filter["order"] = order.into();
    }
    if matches!(name, "chebyshev1" | "elliptic") {
        filter["ripple_db"] = (0.1 + dice.part()).into();
    }
    if name == "elliptic" {
        filter["attenuation_db"] = (40.0 + 20.0 * dice.part()).into();
    }
    filter
}

/// The same filter as coefficients in doubles.
pub(crate) fn as_coefficients(filter: &Value) -> Value {
    let front = Front::read(filter, &real(1.0));
    let list = |polynomial: &[Complex]| polynomial.iter().map(|x| double(&x.re)).collect::<Vec<f64>>();
    json!({ "num": list(&front.numerator), "den": list(&expand(Complex::one(), &front.poles)) })
}

/// The same filter as zeros, poles and gain in doubles.
pub(crate) fn as_roots(filter: &Value) -> Value {
    let front = Front::read(filter, &real(1.0));
    let pair = |x: &Complex| {
        let (re, im) = (double(&x.re), double(&x.im));
        // Roots of a real polynomial: what is left of an imaginary part beside a real root is rounding.
        if im.abs() < 1e-30 * re.abs() { [re, 0.0] } else { [re, im] }
    };
    let poles: Vec<[f64; 2]> = front.poles.iter().map(pair).collect();
    json!({ "zeros": front.zeros().iter().map(pair).collect::<Vec<_>>(), "poles": poles,
        "gain": double(&front.numerator[0].re) })
}

/// A filter in one of three forms.
fn filter(dice: &mut Random, cutoff: f64) -> Value {
    let family = family(dice, cutoff);
    match dice.below(5) {
        0 => as_coefficients(&family),
        1 if family["family"] != "elliptic" => as_roots(&family),
        _ => family,
    }
}

/// A plant without a method.
pub(crate) fn plant(dice: &mut Random) -> Value {
    let h = dice.of(&[1.0, 1e-9, 1.0 / 48_000.0]);
    let ratio = dice.of(&[1, 2, 2, 3, 4]);
    let channels = dice.count(ratio.max(2) - 1, ratio + 1).min(4);
    let share = 0.03 * 15f64.powf(dice.part());
    let target = filter(dice, share / h);
    let alike = dice.part() < 0.6;
    let close = dice.part() < 0.1;
    let first = 2.0 * ratio as f64 * dice.part();
    let list: Vec<Value> = (0..channels)
        .map(|i| {
            let delay = if close { first + 1e-2 * dice.part() } else { 2.0 * ratio as f64 * dice.part() };
            let own = share * (0.7 + 0.8 * dice.part());
            let filter = if alike || i == 0 { target.clone() } else { filter(dice, own / h) };
            let gain = if dice.part() < 0.2 { 0.5 + dice.part() } else { 1.0 };
            json!({ "delay": delay * h, "filter": filter, "gain": gain })
        })
        .collect();
    let mut spec = json!({ "fast_period": h, "ratio": ratio, "latency": dice.count(0, 9),
        "target": { "filter": target }, "channel": list });
    if dice.part() < 0.15 {
        let band = json!({ "family": "butterworth", "order": 2, "cutoff": 1.5 * share / h });
        spec["signal"] = json!({ "filter": band });
    }
    spec
}

/// Three banks of one plant.
fn audited(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + seed);
    let plant = plant(&mut dice);
    let (ratio, channels) =
        (plant["ratio"].as_u64().unwrap_or(1), plant["channel"].as_array().map_or(1, Vec::len));
    let taps = (1 + dice.below(36 / (channels * ratio as usize)) as u64) * ratio;
    let desk = Desk::empty();
    let mut tally = Tally::default();
    for method in ["fir", "iir", "h2"] {
        let mut spec = plant.clone();
        spec["design"] = json!({ "method": method });
        if method == "fir" {
            spec["design"]["taps"] = taps.into();
        }
        let name = format!("plant {seed}, {}", spec["design"]);
        let found = examined(&desk, &name, &spec).map(|(.., found)| match method {
            // It does not minimise the norm.
            "h2" => found.without_figures(),
            _ => found,
        });
        tally.add(found.unwrap_or_else(|refused| refused));
    }
    Ok(tally)
}

#[test]
fn no_statement_about_a_random_plant_is_false() {
    campaign(PLANTS, "random plants, three banks each", audited);
}
