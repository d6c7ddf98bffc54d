//! The judge against numbers that were computed elsewhere, and against brute force.

use super::bounds::{causal, noncausal};
use super::fronts::Front;
use super::judge::{Judge, on_circle};
use super::optimum::optimum;
use super::plant::{Errors, Library, Plant};
use super::real::{Complex, pi, real};
use crate::support::random::Random;
use crate::support::repository;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::fs;

/// A spec as a bank file writes it, h = 1, one filter for all.
fn alike(filter: &Value, ratio: usize, delays: &[f64]) -> Value {
    let channels: Vec<Value> =
        delays.iter().map(|delay| json!({ "delay": delay, "filter": filter })).collect();
    json!({ "fast_period": 1.0, "ratio": ratio, "target": { "filter": filter }, "channel": channels })
}

fn thesis_filter() -> Value {
    json!({ "num": [0.25], "den": [1.0, 1.0, 0.25] })
}

/// A cutoff in hertz for radians per fast period.
fn butterworth(order: usize, omega: f64) -> Value {
    json!({ "family": "butterworth", "order": order, "cutoff": omega / TAU })
}

fn plant(spec: &Value, latency: usize) -> Plant {
    let channels = spec["channel"].as_array().unwrap().len();
    Plant::new(spec, latency, &Errors::none(channels), &mut Library::default())
}

fn close(name: &str, found: f64, wanted: f64, accuracy: f64) {
    assert!((found / wanted - 1.0).abs() < accuracy, "{name}: {found:.9} for {wanted:.9}");
}

/// The golden numbers whose optimum is the noncausal bound, those of low latency, and those of few taps.
#[test]
fn the_judge_finds_the_golden_numbers() {
    let thesis = alike(&thesis_filter(), 2, &[1.2, 0.6]);
    close("G1", noncausal(&plant(&thesis, 10)).gain, 0.039_932_0, 1e-5);
    close("G4b, 0", causal(&plant(&thesis, 0), 12), 0.187_045, 1e-5);
    close("G4b, 1", causal(&plant(&thesis, 1), 12), 0.069_447_0, 1e-5);
    close("G3", optimum(vec![plant(&thesis, 10)], 10).unwrap().norm, 0.093_452_5, 1e-5);
    close("G4b, 12 taps", optimum(vec![plant(&thesis, 1)], 12).unwrap().norm, 0.069_447_031, 1e-5);
    let ten = alike(&butterworth(4, 1.2), 4, &[0.0, 1.3, 2.1, 2.95]);
    close("G10", noncausal(&plant(&ten, 12)).gain, 0.016_514_0, 1e-5);
    let eleven = alike(&thesis_filter(), 3, &[0.2, 1.9]);
    close("G11", optimum(vec![plant(&eleven, 6)], 18).unwrap().norm, 0.059_446_562, 1e-5);
}

/// K K* is the mean over aliases of v v*, v the error that e^{j nu t} leaves; and G13's bank of `filters`.
#[test]
fn the_judge_agrees_with_brute_force() {
    let folder = repository("filters");
    for (name, norm) in [("thesis-fir.json", 0.039_932_04), ("thesis-iir.json", 0.039_932_0)] {
        let bank: Value = serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap();
        close(name, Judge::of(&bank).norm(&[]).gain, norm, 1e-5);
    }
    let filters = [
        json!({ "family": "elliptic", "order": 5, "cutoff": 0.11, "ripple_db": 0.4, "attenuation_db": 50.0 }),
        json!({ "zeros": [[0.0, 1.1], [0.0, -1.1]], "poles": [[-0.4, 0.9], [-0.4, -0.9], [-0.7, 0.0], [-0.7, 0.0]], "gain": 0.3 }),
    ];
    let spec = json!({ "fast_period": 2.0, "ratio": 3, "target": { "filter": filters[0] },
        "signal": { "filter": { "num": [1.0, 1.0], "den": [1.0, 0.3, 0.2] } },
        "channel": [{ "delay": 3.1, "filter": filters[1], "gain": 1.7 }, { "delay": 0.2, "filter": filters[0] }] });
    let (plant, turn) = (plant(&spec, 2), pi() * real(2.0));
    let z = on_circle(0.7);
    let gram = plant.gram(&z);
    let n = plant.order();
    let mut sum = vec![vec![Complex::zero(); n]; n];
    // The angle of z, so that no rounding of it is left.
    let angle = real(2.0) * real(0.35);
    for k in -400..=400 {
        let nu = (&angle + &turn * real(f64::from(k))) / real(3.0);
        let rows: Vec<Complex> = (0..n).map(|a| plant.response(a, &nu)).collect();
        for a in 0..n {
            for b in 0..n {
                sum[a][b] = &sum[a][b] + &(&rows[a] * &rows[b].conj()).times(&(real(1.0) / real(3.0)));
            }
        }
    }
    for a in 0..n {
        for b in 0..n {
            // The aliases left out fall as 1 / nu^2 or faster in amplitude.
            let error = (&gram[a][b] - &sum[a][b]).size();
            assert!(error < 1e-7, "entry {a}, {b}: {error:e}");
        }
    }
}

/// The families against zeros and poles of `scipy.signal` (the file that the product's tests read too).
#[test]
fn the_families_have_the_poles_of_scipy() {
    let text = fs::read_to_string(repository("verify/src/analog/families/reference.txt"));
    let mut dice = Random(0xA0D1);
    let mut tried = 0;
    for line in text.unwrap().lines().filter(|line| line.starts_with("scipy ")) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let order: usize = words[2].parse().unwrap();
        if order > 9 || dice.part() > 0.1 {
            continue;
        }
        let number = |k: usize| words[k].parse::<f64>().unwrap();
        let mut filter = json!({ "family": words[1], "order": order, "ripple_db": number(3),
            "attenuation_db": number(4) });
        let has_band = words[6] == "e";
        if has_band {
            filter["band"] = json!([number(7), number(8)]);
        } else {
            filter["cutoff"] = json!(1.0 / TAU);
        }
        let front = Front::read(&filter, &real(1.0));
        let mut at = if has_band { 9 } else { 6 };
        while at < words.len() {
            let pole = Complex::new(real(number(at + 1)), real(number(at + 2)));
            let nearest = front.poles.iter().map(|p| (p - &pole).size()).fold(f64::INFINITY, f64::min);
            assert!(words[at] != "p" || nearest < 1e-7 * pole.size(), "{line}: {nearest:e}");
            at += 3;
        }
        tried += 1;
    }
    assert!(tried > 10, "{tried} families");
}
