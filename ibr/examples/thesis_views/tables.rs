//! Tables 3.1 and 4.1: moments of intervals and triangles, simulated and derived.

use crate::page::{Table, Verdict};
use crate::theory::delaunay::{PoissonDelaunay, superposed_grids};
use crate::theory::periodic::PeriodicSets;
use crate::theory::spatial::triangles::{Corners, Triangles};
use crate::{Effort, Outcome};
use nalgebra::Vector2;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Cameras in both tables.
const CAMERAS: usize = 10;

/// Uniform in \[0, 1).
fn part(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Table 3.1: lambda^k E\[D^k\] of ten periodic sets with random phases, against a Poisson process.
pub(crate) fn intervals(effort: Effort) -> Outcome<Table> {
    let sets = PeriodicSets::new(vec![CAMERAS as f64; CAMERAS])?;
    let random = &mut Pcg64::seed_from_u64(31);
    let (mut sums, mut count) = ([0.0; 4], 0.0);
    for _ in 0..effort.of(20_000, 2000) {
        let phases: Vec<f64> = (0..CAMERAS).map(|_| part(random)).collect();
        // One period holds one sample of each set, and all that follows repeats it.
        let samples = sets.samples(&phases, 0.0..2.0 * CAMERAS as f64);
        for pair in samples.windows(2).take(CAMERAS) {
            let interval = pair[1] - pair[0];
            sums.iter_mut().enumerate().for_each(|(k, sum)| *sum += interval.powi(k as i32 + 1));
            count += 1.0;
        }
    }
    let mut table = Table {
        title: "Table 3.1: moments of the intervals between the samples of ten cameras",
        heads: ["moment", "Poisson process", "ten cameras, exact", "ten cameras, simulated"]
            .map(String::from)
            .into(),
        rows: Vec::new(),
        verdicts: Vec::new(),
    };
    let mut worst: f64 = 0.0;
    for (k, sum) in (1..).zip(sums) {
        let (exact, simulated) = (sets.moment(k), sum / count);
        worst = worst.max((simulated / exact - 1.0).abs());
        let poisson: f64 = (1..=k).map(f64::from).product();
        let name = format!("lambda^{k} E[D^{k}]");
        table.rows.push(vec![name, format!("{poisson}"), format!("{exact:.4}"), format!("{simulated:.4}")]);
    }
    table.verdicts.push(Verdict::new(
        "the samples of several cameras are nearly a Poisson process",
        format!("E[D^3] of ten cameras is {:.3} of Poisson's", sets.poisson_ratio(3)),
        sets.poisson_ratio(3) > 0.7,
    ));
    table.verdicts.push(Verdict::new(
        "the exact moments, prod N / (N + j) k!, are those of the simulation",
        format!("within {:.1} %", 100.0 * worst),
        worst < effort.of(0.02, 0.05),
    ));
    Ok(table)
}

/// Table 4.1: moments of the Delaunay triangles of ten shifted grids, against a Poisson process.
pub(crate) fn triangles(effort: Effort) -> Outcome<Table> {
    let density = 200.0;
    let (mut sums, mut count) = ([0.0; 4], 0.0);
    for seed in 0..effort.of(400, 25) {
        let mesh = Triangles::new(grids(density, seed).into_iter().map(|p| (p, 0.0)));
        let inside = |p: Vector2<f64>| p.x > 0.0 && p.x < 1.0 && p.y > 0.0 && p.y < 1.0;
        // A triangle belongs to the square by its leftmost corner.
        let leftmost =
            |t: &Corners| t.points.into_iter().min_by(|a, b| a.x.total_cmp(&b.x)).is_some_and(inside);
        for t in mesh.ok_or("a triangulation failed")?.all().filter(leftmost) {
            let (area, radius) = (t.area(), t.radius().powi(2));
            let terms = [radius, area, area * area, area * radius];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            count += 1.0;
        }
    }
    let law = PoissonDelaunay { density };
    let poisson = [law.moment(0, 1), law.moment(1, 0), law.moment(2, 0), law.moment(1, 1)];
    let names = ["lambda E[R^2]", "lambda E[S]", "lambda^2 E[S^2]", "lambda^2 E[S R^2]"];
    let powers = [1, 1, 2, 2];
    let mut table = Table {
        title: "Table 4.1: moments of the Delaunay triangles of ten cameras",
        heads: ["moment", "Poisson process", "ten cameras, derived", "ten cameras, simulated"]
            .map(String::from)
            .into(),
        rows: Vec::new(),
        verdicts: Vec::new(),
    };
    let mut worst: f64 = 0.0;
    for k in 0..4 {
        let scale = density.powi(powers[k]);
        let factor = if powers[k] == 2 { superposed_grids(CAMERAS, 2) } else { 1.0 };
        let (derived, simulated) = (poisson[k] * factor * scale, sums[k] / count * scale);
        worst = worst.max((simulated / derived - 1.0).abs());
        let cells = [poisson[k] * scale, derived, simulated].map(|v| format!("{v:.4}"));
        table.rows.push([vec![names[k].to_string()], cells.into()].concat());
    }
    table.verdicts.push(Verdict::new(
        "triangles of several cameras are nearly those of a Poisson process",
        format!("E[S^2] of ten cameras is {:.3} of Poisson's", superposed_grids(CAMERAS, 2)),
        superposed_grids(CAMERAS, 2) > 0.85,
    ));
    table.verdicts.push(Verdict::new(
        "the derived moments are those of the simulation",
        format!("within {:.1} %", 100.0 * worst),
        worst < effort.of(0.03, 0.15),
    ));
    Ok(table)
}

/// Points of ten shifted grids of one density together, over the unit square with a margin.
fn grids(density: f64, seed: u64) -> Vec<Vector2<f64>> {
    let random = &mut Pcg64::seed_from_u64(seed);
    let margin = 6.0 / density.sqrt();
    let step = (CAMERAS as f64 / density).sqrt();
    let count = ((1.0 + 2.0 * margin) / step).ceil() as usize + 1;
    let mut all = Vec::new();
    for _ in 0..CAMERAS {
        let start = Vector2::new(part(random) - 1.0, part(random) - 1.0) * step - Vector2::repeat(margin);
        all.extend(
            (0..count * count).map(|k| start + Vector2::new((k % count) as f64, (k / count) as f64) * step),
        );
    }
    all
}
