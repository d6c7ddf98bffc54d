//! Latencies that the program chooses, against the least mean-square error of explicit banks at every
//! latency.

use super::plant::{Correlation, Errors, Library, Plant};
use super::plants::family;
use super::statements::{Tally, campaign, designed};
use crate::support::Desk;
use crate::support::random::Random;
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

const SEED: u64 = 0xA0D1_1000;
/// Plants of the short form.
const PLANTS: usize = 2;
/// What "within 0.1 dB of the least" means for an rms value, and the accuracy of the comparison.
const WORTHWHILE: f64 = 0.011_58;
const COMPARED: f64 = 3e-4;
/// Fast samples that a bank remembers beyond its latency where it stands for a recursive one.
const MEMORY: usize = 240;
/// Latencies that are tried for a recursive bank beyond twice the chosen one.
const BEYOND: usize = 24;

/// The correlations of all rows of a plant of latency 0.
struct Correlations(Vec<Vec<Correlation>>);

impl Correlations {
    fn new(plant: &Plant) -> Self {
        let rows = 0..plant.order();
        Self(rows.clone().map(|a| rows.clone().map(|b| plant.correlation(a, b)).collect()).collect())
    }

    /// Row `a` sampled `later` fast periods later than it is, with row `b`.
    fn of(&self, a: usize, b: usize, later: i64) -> f64 {
        let time = self.0[a][b].distance + later as f64;
        if time >= 0.0 { self.0[a][b].at(time) } else { self.0[b][a].at(-time) }
    }
}

/// The least rms error at each latency with `taps` taps per channel and white noise of rms `noise` on each.
fn errors(plant: &Plant, taps: usize, noise: f64, latencies: usize) -> Vec<f64> {
    let known = Correlations::new(plant);
    let m = plant.ratio;
    let mut squares = vec![0.0; latencies];
    for phase in 0..m {
        let samples: Vec<(usize, i64)> = (0..plant.channels)
            .flat_map(|i| (phase..taps).step_by(m).enumerate().map(move |(j, _)| (m + i, j as i64)))
            .collect();
        let entry = |k: usize, l: usize| {
            let ((a, j), (b, i)) = (samples[k], samples[l]);
            known.of(a, b, (i - j) * m as i64) + if k == l { noise * noise } else { 0.0 }
        };
        // The noise keeps the condition number below 1e9, so doubles suffice from here on.
        let matrix =
            DMatrix::from_fn(samples.len(), samples.len(), |k, l| if k >= l { entry(k, l) } else { 0.0 });
        let root = matrix.cholesky().expect("noise on every channel").unpack();
        for (latency, square) in squares.iter_mut().enumerate() {
            let later = phase as i64 - latency as i64;
            let right = DVector::from_fn(samples.len(), |k, _| {
                known.of(0, samples[k].0, later + samples[k].1 * m as i64)
            });
            *square +=
                known.of(0, 0, 0) - root.solve_lower_triangular(&right).expect("a root").norm_squared();
        }
    }
    squares.into_iter().map(|square: f64| square.max(0.0).sqrt()).collect()
}

fn audited(seed: u64) -> Result<Tally, Tally> {
    let mut dice = Random(SEED + seed);
    let ratio = dice.count(1, 3);
    let channels = dice.count(1, 3);
    let share = 0.05 + 0.3 * dice.part();
    let filter = family(&mut dice, share);
    let noise = 10f64.powf(-2.0 - 2.0 * dice.part());
    let spread = if dice.part() < 0.3 { 10.0 } else { 2.0 };
    let list: Vec<Value> = (0..channels)
        .map(|_| json!({ "delay": spread * ratio as f64 * dice.part(), "filter": filter, "noise": noise }))
        .collect();
    let design = match dice.below(3) {
        0 => json!({ "method": "fir", "taps": ratio * dice.count(1, 8) }),
        1 => json!({ "method": "h2", "taps": ratio * dice.count(1, 8) }),
        _ => json!({ "method": "h2" }),
    };
    let spec = json!({ "fast_period": 1.0, "ratio": ratio, "target": { "filter": filter }, "channel": list, "design": design });
    let name = format!("latency {seed}: {spec}");
    let mut tally = Tally { cases: 1, ..Tally::default() };
    let (_, report) = designed(&Desk::empty(), &name, &spec)?;
    let chosen = report["latency"].as_u64().expect("a latency") as usize;
    let plant = Plant::new(&spec, 0, &Errors::none(channels), &mut Library::default());
    let oldest = (spread * ratio as f64).ceil() as usize;
    let taps = design["taps"].as_u64().map(|taps| taps as usize);
    let range = taps.map_or(2 * chosen + BEYOND, |taps| (taps + oldest).max(chosen + 1));
    let count = taps.unwrap_or(range + MEMORY);
    let errors = errors(&plant, count, noise, range);
    let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
    // FIR banks take the latency of the least error.
    let worthwhile = if taps.is_some() { 0.0 } else { WORTHWHILE };
    let shorter = errors[..chosen].iter().position(|error| *error <= best * (1.0 + worthwhile - COMPARED));
    if errors[chosen] > best * (1.0 + worthwhile + COMPARED) || shorter.is_some() {
        let at = errors.iter().position(|error| *error == best);
        tally.refuted.push(format!(
            "{name}: chosen {chosen} with {:.6e}; best {best:.6e} at {at:?}; first as good before it {shorter:?}",
            errors[chosen]
        ));
    }
    tally.excesses.push(errors[chosen] / best - 1.0);
    Ok(tally)
}

#[test]
fn chosen_latencies_are_the_best() {
    campaign(PLANTS, "chosen latencies", audited);
}
