//! Worst cases over boxes of errors: what is proven, what is printed as found, and what the taps could
//! reach.

use super::judge::Judge;
use super::optimum::optimum;
use super::plant::{Errors, Library, Plant};
use super::plants::family;
use super::statements::{Tally, at, campaign, designed, examined};
use crate::support::random::Random;
use crate::support::{Desk, repository, words};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

const SEED: u64 = 0xA0D1_B000;
/// Boxes and robust designs of the short form.
const BOXES: usize = 2;
const ROBUST: usize = 1;
/// Frequencies that are looked at for each point of a box.
const FREQUENCIES: usize = 16;
/// Vertices that are looked at, and points within.
const VERTICES: usize = 16;
const INSIDE: usize = 4;
/// Vertices for which the judge designs taps.
const SCENARIOS: usize = 12;
/// Rounds of halved steps from the best point.
const ROUNDS: usize = 3;
/// The program's own computed worst case may be below the judge's by this much: both are searches.
const SEARCH: f64 = 1e-3;

/// The largest gain found in a box.
pub(crate) struct Found {
    pub(crate) gain: f64,
    errors: Errors,
    omega: f64,
}

/// All vertices of the box of half-widths, or `most` random ones.
fn vertices(half: &[f64], most: usize, dice: &mut Random) -> Vec<Vec<f64>> {
    let open: Vec<usize> = (0..half.len()).filter(|&k| half[k] > 0.0).collect();
    let all = 1usize << open.len();
    let mut vertex = |k: usize| {
        let number = if all <= most { k } else { dice.below(all) };
        let mut point = vec![0.0; half.len()];
        for (bit, &i) in open.iter().enumerate() {
            point[i] = if number >> bit & 1 == 1 { half[i] } else { -half[i] };
        }
        point
    };
    (0..all.min(most)).map(&mut vertex).collect()
}

/// A search in one box for one bank.
struct Search<'a> {
    bank: &'a Value,
    half: &'a Errors,
    library: Library,
}

/// The list of a box or of a point in the program's report, in the units of [`Errors`].
fn errors_of(value: &Value, h: f64) -> Errors {
    let list = |key: &str| -> Vec<f64> {
        value[key].as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    Errors {
        delays: list("delays").iter().map(|x| x / h).collect(),
        gains: list("gains"),
        cutoffs: list("cutoffs"),
    }
}

impl Errors {
    fn coordinates(&self) -> Vec<f64> {
        [&self.delays[..], &self.gains, &self.cutoffs].concat()
    }

    fn of_coordinates(list: &[f64]) -> Self {
        let n = list.len() / 3;
        Self { delays: list[..n].to_vec(), gains: list[n..2 * n].to_vec(), cutoffs: list[2 * n..].to_vec() }
    }
}

impl Search<'_> {
    fn judge(&mut self, errors: &Errors) -> Judge {
        Judge::off_by(self.bank, errors, &mut self.library)
    }

    /// The best frequency of a list.
    fn best(&mut self, errors: Errors, frequencies: &[f64]) -> Found {
        let judge = self.judge(&errors);
        let gains = frequencies.iter().map(|&omega| (judge.gain(omega), omega));
        let (gain, omega) = gains.fold((0.0, 0.0), |best, next| if next.0 > best.0 { next } else { best });
        Found { gain, errors, omega }
    }

    /// Grid, vertices, random points and `first`, then coordinate steps from the two best.
    fn run(&mut self, first: Option<(Errors, f64)>, dice: &mut Random) -> Found {
        let half = self.half.coordinates();
        let open: Vec<usize> = (0..half.len()).filter(|&k| half[k] > 0.0).collect();
        let centre = self.judge(&Errors::none(self.half.delays.len()));
        let mut frequencies: Vec<f64> =
            (0..=FREQUENCIES).map(|k| PI * k as f64 / FREQUENCIES as f64).collect();
        frequencies.extend(centre.peaks(&[]).iter().take(4).map(|peak| peak.omega));
        let mut points = vec![vec![0.0; half.len()]];
        points.extend(vertices(&half, VERTICES, dice));
        for _ in 0..INSIDE {
            points.push(half.iter().map(|half| half * dice.sample()).collect());
        }
        let mut found: Vec<Found> =
            points.iter().map(|point| self.best(Errors::of_coordinates(point), &frequencies)).collect();
        if let Some((errors, omega)) = first {
            frequencies.push(omega);
            found.push(self.best(errors, &frequencies));
        }
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        found.truncate(2);
        let best = found.into_iter().map(|start| self.climbed(start, &open));
        best.reduce(|a, b| if a.gain > b.gain { a } else { b }).expect("a point")
    }

    fn climbed(&mut self, mut best: Found, open: &[usize]) -> Found {
        let half = self.half.coordinates();
        let mut step = 0.5;
        for _ in 0..ROUNDS {
            let peak = self.judge(&best.errors).norm(&[best.omega]);
            (best.gain, best.omega) = (peak.gain, peak.omega);
            for &k in open {
                for sign in [-1.0, 1.0] {
                    let mut point = best.errors.coordinates();
                    point[k] = (point[k] + sign * step * half[k]).clamp(-half[k], half[k]);
                    let next = self.best(Errors::of_coordinates(&point), &[best.omega]);
                    if next.gain > best.gain {
                        best = next;
                    }
                }
            }
            step *= 0.5;
        }
        let peak = self.judge(&best.errors).norm(&[best.omega]);
        Found { gain: peak.gain.max(best.gain), ..best }
    }
}

/// A plant whose channels differ little, with `taps`.
fn plant(dice: &mut Random) -> Value {
    let ratio = dice.of(&[1, 2, 2, 3]);
    let channels = dice.count(ratio.max(2), ratio + 1).min(3);
    let share = 0.05 * 8f64.powf(dice.part());
    let filter = family(dice, share);
    let list: Vec<Value> = (0..channels)
        .map(|_| json!({ "delay": 2.0 * ratio as f64 * dice.part(), "filter": filter }))
        .collect();
    let taps = (1 + dice.below(24 / (channels * ratio)) as u64) * ratio as u64;
    json!({ "fast_period": 1.0, "ratio": ratio, "latency": dice.count(1, 8), "target": { "filter": filter },
        "channel": list, "design": { "method": "fir", "taps": taps } })
}

/// Half-widths from 1e-9 to 0.1, for delays or for delays and gains.
fn half_widths(dice: &mut Random, channels: usize) -> Errors {
    let size = 10f64.powf(-1.0 - 8.0 * dice.part() * dice.part());
    let gains = if dice.part() < 0.5 { 0.3 * size } else { 0.0 };
    let cutoffs = if dice.part() < 0.2 { 0.2 * size } else { 0.0 };
    Errors { delays: vec![size; channels], gains: vec![gains; channels], cutoffs: vec![cutoffs; channels] }
}

fn boxed(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + seed);
    let spec = plant(&mut dice);
    let desk = Desk::empty();
    let mut tally = Tally { cases: 1, ..Tally::default() };
    let name = format!("box {seed}: {spec}");
    let (bank, _) = designed(&desk, &name, &spec)?;
    let half = half_widths(&mut dice, spec["channel"].as_array().map_or(1, Vec::len));
    let [delay, gain, cutoff] = [&half.delays, &half.gains, &half.cutoffs].map(|list| list[0].to_string());
    let boxes = format!("--delay-box {delay}samples --gain-box {gain} --cutoff-box {cutoff}");
    let analyze = format!("analyze bank.json --json --reference none {boxes}");
    let output = desk.run(&words(&analyze), &[]);
    let Ok(report) = serde_json::from_slice::<Value>(&output.stdout) else {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(Tally::refused(&format!("{name}, {half:?}"), &reason));
    };
    let case = &report["worst_case"];
    let number = |key: &str| at(case, key).unwrap_or(f64::NAN);
    let (lower, upper) = (number("/attained"), number("/upper"));
    let omega = TAU * number("/peak_hertz") * spec["ratio"].as_f64().unwrap_or(1.0);
    let point = errors_of(&case["point"], 1.0);
    let attained = Judge::off_by(&bank, &point, &mut Library::default()).gain(omega);
    let mut search = Search { bank: &bank, half: &half, library: Library::default() };
    let found = search.run(Some((point, omega)), &mut dice);
    if lower > attained * (1.0 + 1e-12) {
        tally.refuted.push(format!("{name}, {half:?}: attained {lower:e}, there {attained:e}"));
    }
    if found.gain > upper {
        let found = format!("found {:e} at {:?}", found.gain, found.errors);
        tally.refuted.push(format!("{name}, {half:?}: bound {upper:e}, {found}"));
    }
    tally.widths.push(upper / lower - 1.0);
    tally.excesses.push(found.gain / lower - 1.0);
    Ok(tally)
}

/// The taps of least worst norm over the centre and the vertices of the box.
fn robust_taps(bank: &Value, half: &Errors, count: usize, dice: &mut Random) -> Option<Value> {
    let widths = half.coordinates();
    let latency = bank["latency"].as_u64()? as usize;
    let mut library = Library::default();
    let mut plant =
        |point: &[f64]| Plant::new(&bank["spec"], latency, &Errors::of_coordinates(point), &mut library);
    let mut plants = vec![plant(&vec![0.0; widths.len()])];
    for point in vertices(&widths, SCENARIOS, dice) {
        plants.push(plant(&point));
    }
    let best = optimum(plants, count)?;
    let mut other = bank.clone();
    for (channel, taps) in other["channels"].as_array_mut()?.iter_mut().zip(best.taps) {
        channel["taps"] = json!(taps);
    }
    Some(other)
}

/// A robust design.
fn uncertain(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + 0x800 + seed);
    let mut spec = plant(&mut dice);
    let channels = spec["channel"].as_array().map_or(1, Vec::len);
    let size = 0.005 * 30f64.powf(dice.part());
    // Each channel has errors of its own size, or all have the same.
    let widths = |dice: &mut Random, size: f64| -> Value {
        if dice.part() < 0.5 {
            json!(size)
        } else {
            json!((0..channels).map(|_| size * dice.part()).collect::<Vec<_>>())
        }
    };
    let mut table = json!({ "delay_samples": widths(&mut dice, size), "reference": dice.below(2) });
    if dice.part() < 0.5 {
        table["gain"] = widths(&mut dice, 0.3 * size);
    }
    if dice.part() < 0.3 {
        table["cutoff"] = widths(&mut dice, 0.2 * size);
    }
    spec["uncertainty"] = table;
    let name = format!("robust {seed}: {spec}");
    let (bank, report, tally) = examined(&Desk::empty(), &name, &spec)?;
    let mut tally = tally.without_figures();
    let study = &report["robust"];
    let half = errors_of(&study["errors"], 1.0);
    let mut search = Search { bank: &bank, half: &half, library: Library::default() };
    let found = search.run(None, &mut dice);
    let there = format!("found {:e} at {:?}", found.gain, found.errors);
    match at(&bank, "/gamma/worst_case") {
        None => tally.unproven.push(format!("{name}: no worst case is stated; found {:e}", found.gain)),
        Some(stated) => {
            tally.widths.push(stated / found.gain - 1.0);
            if found.gain > stated {
                tally.refuted.push(format!("{name}: stated {stated:e}, {there}"));
            }
        }
    }
    let printed = at(study, "/robust/largest_found");
    if let Some(printed) = printed
        && found.gain > printed * (1.0 + SEARCH)
    {
        tally.notes.push(format!("{name}: printed {printed:e}, {there}"));
    }
    let count = bank["channels"][0]["taps"].as_array().map_or(0, Vec::len);
    if let Some(other) = robust_taps(&bank, &half, count, &mut dice) {
        let mut search = Search { bank: &other, half: &half, library: Library::default() };
        let reachable = search.run(Some((found.errors, found.omega)), &mut dice).gain;
        tally.excesses.push(found.gain / reachable - 1.0);
        if found.gain > reachable * 1.01 {
            tally.notes.push(format!("{name}: worst {:e}, reachable {reachable:e}", found.gain));
        }
    }
    Ok(tally)
}

#[test]
fn no_worst_case_over_a_box_is_exceeded() {
    campaign(BOXES, "boxes of `analyze`", boxed);
}

#[test]
fn no_worst_case_of_a_robust_bank_is_exceeded() {
    campaign(ROBUST, "robust banks", uncertain);
}

/// The worst cases of the example of the thesis with both delays off, in docs/figures.md: of the nominal
/// bank by the search, of the best bank by the judge's own taps.
#[test]
fn the_worst_cases_in_the_docs_are_true() {
    let path = repository("filters/thesis-fir.json");
    let bank: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    for (size, nominal, robust) in [(0.1, 0.047_833_8, 0.044_295_9), (0.2, 0.068_209_0, 0.063_542_5)] {
        let half = Errors { delays: vec![size; 2], ..Errors::none(2) };
        let mut dice = Random(SEED);
        let mut worst = |bank: &Value| {
            Search { bank, half: &half, library: Library::default() }.run(None, &mut dice).gain
        };
        let found = worst(&bank);
        assert!((found / nominal - 1.0).abs() < 1e-5, "{size}: {found}");
        let best = worst(&robust_taps(&bank, &half, 22, &mut Random(SEED)).unwrap());
        // The docs' bank is within 2e-4 of its own lower bound.
        assert!((best / robust - 1.0).abs() < 5e-4, "{size}: {best}");
    }
}
