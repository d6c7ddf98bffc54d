//! Narrow filters in all forms, nearly equal instants, order reductions, integer taps and forged files.

use super::judge::{Filters, Judge, on_circle};
use super::optimum::optimum;
use super::plants::{as_coefficients, as_roots, plant};
use super::statements::{Tally, at, campaign, designed, examined, judged, verified};
use crate::support::Desk;
use crate::support::forgery::{forged, numbers, parts, sealed};
use crate::support::random::Random;
use nalgebra::{Complex, DMatrix};
use serde_json::{Value, json};
use std::f64::consts::PI;

const SEED: u64 = 0xA0D1_5000;
/// Cases of the short form.
const NARROW: usize = 2;
const NEAR: usize = 1;
const REDUCTIONS: usize = 1;
const INTEGERS: usize = 2;
const FORGED: usize = 1;
/// Forgeries of each bank.
const FORGERIES: usize = 12;
/// The printed gamma of a reduced bank against its norm.
const PRINTED: f64 = 1e-8;
/// Frequencies for the exhaustive search, and the candidates that are judged exactly.
const FREQUENCIES: usize = 48;
const CANDIDATES: usize = 4;

/// A band-pass of Q up to 10,000, its target in one form and its channel in another.
fn narrow(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + seed);
    let (centre, width) = (0.05 + 0.35 * dice.part(), 10f64.powf(-1.0 - 3.0 * dice.part()));
    let mut family = json!({ "family": dice.of(&["butterworth", "chebyshev1"]), "order": dice.count(1, 6),
        "band": [centre * (1.0 - 0.5 * width), centre * (1.0 + 0.5 * width)] });
    if family["family"] == "chebyshev1" {
        family["ripple_db"] = (0.2 + dice.part()).into();
    }
    let forms = [family.clone(), as_coefficients(&family), as_roots(&family)];
    let (target, own) = (dice.of(&[0, 1, 1, 2]), dice.of(&[0, 1, 2]));
    let ratio = dice.count(1, 2);
    let delay = if dice.part() < 0.5 { 1.0 } else { 2.0 * dice.part() };
    let list: Vec<Value> =
        (0..ratio).map(|i| json!({ "delay": delay + 0.9 * i as f64, "filter": forms[own] })).collect();
    let spec = json!({ "fast_period": 1.0, "ratio": ratio, "latency": dice.count(1, 3),
        "target": { "filter": forms[target] }, "channel": list,
        "design": { "method": "fir", "taps": ratio * dice.count(1, 4) } });
    let name = format!("narrow {seed}, Q {:.0}: {spec}", 1.0 / width);
    examined(&Desk::empty(), &name, &spec).map(|(.., tally)| tally)
}

/// Two like channels whose samples are 1.2e-10 fast periods apart: taps of 1e9, of which little is left.
fn near(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + 0x1000 + seed);
    let share = 0.03 * 15f64.powf(dice.part());
    let filter = super::plants::family(&mut dice, share);
    let (ratio, first) = (dice.count(1, 3), 0.2 + dice.part());
    let list: Vec<Value> = [first, first + 1.2e-10, 2.0 * dice.part()][..dice.count(2, 3)]
        .iter()
        .map(|delay| json!({ "delay": delay, "filter": filter }))
        .collect();
    let design = match dice.below(3) {
        0 => json!({ "method": "iir" }),
        _ => json!({ "method": "fir", "taps": ratio * dice.count(1, 6) }),
    };
    let spec = json!({ "fast_period": 1.0, "ratio": ratio, "latency": dice.count(0, 8),
        "target": { "filter": filter }, "channel": list, "design": design });
    examined(&Desk::empty(), &format!("near {seed}: {spec}"), &spec).map(|(.., tally)| tally)
}

/// Gamma as small as the rounding of the instants: what is proven holds for the delays of the file, in
/// seconds.
#[test]
fn a_tiny_gamma_is_that_of_the_delays_in_the_file() {
    let filter =
        |order: u32, cutoff: f64| json!({ "family": "butterworth", "order": order, "cutoff": cutoff });
    let spec = json!({ "fast_rate": 44_100.0, "ratio": 1, "latency": 1,
        "target": { "filter": filter(4, 5_962.986_950_303_371_5) },
        "channel": [
            { "delay_samples": 0.999_999_979_345_919_1 },
            { "delay_samples": 0.999_999_993_385_549_1, "filter": filter(2, 4_149.794_117_256_607) },
            { "delay_samples": 9.629_698_492_389_24e-5 },
        ],
        "design": { "method": "fir", "taps": 12 } });
    let desk = Desk::empty();
    let Ok((bank, _)) = designed(&desk, "tiny", &spec) else { panic!("no bank") };
    let proven = verified(&desk).expect("a proof");
    let [attained, upper] = ["/attained", "/upper"].map(|key| at(&proven, key).expect("a bound"));
    let norm = Judge::of(&bank).norm(&[]).gain;
    assert!(attained <= norm * (1.0 + 1e-9) && norm <= upper, "{norm:e} {proven}");
    assert!(norm < 1e-14, "{norm:e}");
}

/// What is printed of a reduced bank; without states against the best taps that see one frame.
fn reduced(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + 0x400 + seed);
    let mut spec = plant(&mut dice);
    let order = dice.of(&[0, 0, 1, 2, 4, 6]);
    spec["design"] = json!({ "method": "iir", "order": order });
    let name = format!("reduction {seed}: {spec}");
    let (bank, report, tally) = examined(&Desk::empty(), &name, &spec)?;
    let mut tally = tally.without_figures();
    let judge = Judge::of(&bank);
    let norm = judge.norm(&[]).gain;
    if let Some(printed) = at(&report, "/reduction/reduced/gamma")
        && (printed - norm).abs() > PRINTED * norm + 1e-13
    {
        tally.refuted.push(format!("{name}: printed {printed:e}, true {norm:e}"));
    }
    let states = bank["state_space"]["a"].as_array().map_or(0, Vec::len);
    if states as u64 > order {
        tally.refuted.push(format!("{name}: {states} states"));
    }
    if states == 0
        && let Some(best) = optimum(vec![judge.plant], spec["ratio"].as_u64().unwrap_or(1) as usize)
    {
        tally.excesses.push(norm / best.norm - 1.0);
        if norm > best.norm * 1.001 {
            tally.notes.push(format!("{name}: norm {norm:e}, {:e} with the taps {:?}", best.norm, best.taps));
        }
    }
    Ok(tally)
}

/// Integer taps against all integer taps, ratio 1.
fn integer(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + 0x800 + seed);
    let share = 0.05 + 0.3 * dice.part();
    let filter = super::plants::family(&mut dice, share);
    let (channels, taps, bits) = dice.of(&[(1usize, 3usize, 4u32), (2, 2, 3), (1, 2, 6)]);
    let list: Vec<Value> =
        (0..channels).map(|_| json!({ "delay": 1.5 * dice.part(), "filter": filter })).collect();
    let fraction = bits - dice.count(1, 2) as u32;
    let spec = json!({ "fast_period": 1.0, "ratio": 1, "latency": dice.count(0, 2), "target": { "filter": filter },
        "channel": list, "design": { "method": "fir", "taps": taps, "bits": bits, "fraction_bits": fraction } });
    let name = format!("integers {seed}: {spec}");
    let (bank, _, tally) = examined(&Desk::empty(), &name, &spec)?;
    let mut tally = tally.without_figures();
    let mut judge = Judge::of(&bank);
    let norm = judge.norm(&[]).gain;
    let best = exhaustive(&mut judge, taps, bits, fraction);
    tally.excesses.push(norm / best - 1.0);
    if norm > best * 1.01 {
        tally.notes.push(format!("{name}: norm {norm:e}, best {best:e}"));
    }
    Ok(tally)
}

/// The least norm of all integer taps: all by a grid in doubles, the best of these by the judge.
fn exhaustive(judge: &mut Judge, taps: usize, bits: u32, fraction: u32) -> f64 {
    let (n, unit) = (judge.plant.channels, 0.5f64.powi(fraction as i32));
    let grams: Vec<(Complex<f64>, DMatrix<Complex<f64>>)> = (0..=FREQUENCIES)
        .map(|k| {
            let z = on_circle(PI * k as f64 / FREQUENCIES as f64);
            let gram = judge.plant.gram(&z);
            (z.conj().rounded(), DMatrix::from_fn(n + 1, n + 1, |a, b| gram[a][b].rounded()))
        })
        .collect();
    let values = 1i64 << bits;
    let unknowns = (n * taps) as u32;
    let of = |number: i64| -> Vec<Vec<f64>> {
        let digit = |k: usize| (number / values.pow(k as u32) % values - values / 2) as f64 * unit;
        (0..n).map(|i| (0..taps).map(|k| digit(i * taps + k)).collect()).collect()
    };
    let worst = |number: i64| {
        let lists = of(number);
        let square = |(back, gram): &(Complex<f64>, DMatrix<Complex<f64>>)| {
            let filter = |list: &Vec<f64>| {
                list.iter().rev().fold(Complex::default(), |sum: Complex<f64>, tap| sum * back + *tap)
            };
            let row = |a: usize| if a == 0 { Complex::from(1.0) } else { -filter(&lists[a - 1]) };
            let rows: Vec<_> = (0..=n).map(row).collect();
            let pairs = (0..=n).flat_map(|a| (0..=n).map(move |b| (a, b)));
            pairs.map(|(a, b)| (rows[a] * gram[(a, b)] * rows[b].conj()).re).sum::<f64>()
        };
        grams.iter().map(square).fold(0.0, f64::max)
    };
    let mut all: Vec<(f64, i64)> = (0..values.pow(unknowns)).map(|number| (worst(number), number)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let exact = |(_, number): &(f64, i64)| {
        judge.filters = Filters::of_taps(&of(*number));
        judge.norm(&[]).gain
    };
    all.iter().take(CANDIDATES).map(exact).fold(f64::INFINITY, f64::min)
}

/// Files whose numbers were changed and whose digest is right: refused, or all that they say is true.
fn forgeries(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + 0xC00 + seed);
    let mut spec = plant(&mut dice);
    let taps = spec["ratio"].as_u64().unwrap_or(1) * dice.count(1, 3) as u64;
    let designs = [json!({ "method": "fir", "taps": taps }), json!({ "method": "iir" })];
    spec["design"] = designs[dice.below(2)].clone();
    let name = format!("forged {seed}");
    let desk = Desk::empty();
    let (bank, _) = designed(&desk, &name, &spec)?;
    let mut tally = Tally::default();
    for trial in 0..FORGERIES {
        let mut document = bank.clone();
        let mut parts = parts(&mut document);
        let count = parts.len();
        let mut numbers = numbers(parts[dice.below(count)]);
        let count = numbers.len();
        let number = &mut *numbers[dice.below(count)];
        *number = forged(&mut dice, number);
        tally.cases += 1;
        let name = format!("{name}, {trial}");
        let Some(text) = sealed(&document) else {
            tally.refused.push(format!("{name}: not read"));
            continue;
        };
        desk.write("bank.json", &text);
        match verified(&desk) {
            None => tally.refused.push(format!("{name}: refused")),
            Some(proven) => {
                let found = judged(&name, &serde_json::from_str(&text).expect("a file"), Some(&proven));
                tally.add(Tally { cases: 0, ..found.without_figures() });
            }
        }
    }
    // Refusals are what is wanted here.
    println!("{name}: {} of {} refused", tally.refused.len(), tally.cases);
    tally.refused.clear();
    Ok(tally)
}

#[test]
fn no_statement_about_a_narrow_filter_is_false() {
    campaign(NARROW, "narrow band-passes", narrow);
}

#[test]
fn no_statement_about_nearly_equal_instants_is_false() {
    campaign(NEAR, "instants 1.2e-10 apart", near);
}

#[test]
fn no_statement_about_a_reduced_bank_is_false() {
    campaign(REDUCTIONS, "order reductions", reduced);
}

#[test]
fn integer_taps_are_near_the_best_of_all() {
    campaign(INTEGERS, "integer taps", integer);
}

#[test]
fn forged_files_are_refused_or_true() {
    campaign(FORGED, "forged files", forgeries);
}
