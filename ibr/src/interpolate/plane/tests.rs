//! The plane fit against the dense solution of its normal equations, and hole filling.

use super::*;
use crate::sample::Sample;

fn sample(x: f64, y: f64, depth: f32, value: f32) -> Sample<1> {
    Sample { x, y, depth, value: [value], ..Sample::BLANK }
}

/// Irregular samples of one depth with values f(x, y).
fn scattered(size: usize, f: impl Fn(f64, f64) -> f64) -> Vec<Sample<1>> {
    (0..size * size * 2)
        .map(|i| {
            let position = |k: usize| ((i * k + 7) % 1009) as f64 / 1009.0 * (size as f64 - 1.0);
            let (x, y) = (position(389), position(631));
            sample(x, y, 1.0, f(x, y) as f32)
        })
        .collect()
}

fn with(plane: PlaneSettings) -> Settings {
    Settings { plane, ..Settings::default() }
}

fn interpolate(samples: &[Sample<1>], size: (usize, usize), settings: &Settings) -> PlaneFit {
    fn of_order<const ORDER: usize>(
        samples: &[Sample<1>],
        size: (usize, usize),
        settings: &Settings,
    ) -> PlaneFit {
        let mut problem = PlaneProblem::<ORDER, 1>::new(size, settings);
        problem.add(samples);
        problem.solve()
    }
    match settings.plane.degree {
        Degree::Linear => of_order::<2>(samples, size, settings),
        Degree::Cubic => of_order::<4>(samples, size, settings),
    }
}

#[test]
fn a_constant_stays_constant() {
    // Corners without samples hang on the coefficients beyond the image; nothing was continued into them.
    for (plane, error) in [(PlaneSettings::LINEAR, 0.02), (PlaneSettings::CUBIC, 0.1)] {
        let settings = Settings { fill: HoleFill::Bridge, ..with(plane) };
        let fit = interpolate(&scattered(12, |_, _| 91.0), (12, 12), &settings);
        assert!(fit.values.iter().all(|v| (v - 91.0).abs() < error), "{:?}", fit.values);
        assert!(fit.convergence.reached, "{:?}", fit.convergence);
    }
}

/// Half a wave over five pixels, from samples two to a pixel: bilinear splines cannot follow it.
#[test]
fn bicubic_splines_follow_curves() {
    let tone = |x: f64, y: f64| 128.0 + 60.0 * (x * 0.6).sin() * (y * 0.6).cos();
    let worst = |plane: PlaneSettings| {
        let fit = interpolate(&scattered(24, tone), (24, 24), &with(plane));
        let inner = (0..24 * 24).filter(|p| (3..21).contains(&(p % 24)) && (3..21).contains(&(p / 24)));
        let error = |p: usize| (f64::from(fit.values[p]) - tone((p % 24) as f64, (p / 24) as f64)).abs();
        inner.map(error).fold(0.0, f64::max)
    };
    let (linear, cubic) = (worst(PlaneSettings::LINEAR), worst(PlaneSettings::CUBIC));
    assert!(cubic < 1.5 && cubic < 0.5 * linear, "{linear} {cubic}");
}

/// The normal equations by their definition, dense, solved by elimination.
#[test]
fn equal_to_the_dense_solution() {
    let size = 7;
    let samples = scattered(size, |x, y| 128.0 + 60.0 * (x * 1.1).sin() * (y * 0.9).cos());
    let mut settings = with(PlaneSettings::LINEAR);
    settings.plane.tolerance = 1e-9;
    settings.fill = HoleFill::Bridge;
    let fit = interpolate(&samples, (size, size), &settings);
    let n = size * size;
    let mut a = vec![vec![0.0; n + 1]; n];
    for s in &samples {
        let weight = |p: usize| {
            let hat = |t: f64| (1.0 - t.abs()).max(0.0);
            hat(s.x - (p % size) as f64) * hat(s.y - (p / size) as f64)
        };
        for (p, row) in a.iter_mut().enumerate() {
            (0..n).for_each(|q| row[q] += weight(p) * weight(q));
            row[n] += weight(p) * f64::from(s.value[0]);
        }
    }
    let g = settings.plane.stiffness + settings.plane.edge_stiffness;
    for p in 0..n {
        let right = (p % size + 1 < size).then_some(p + 1);
        let down = (p + size < n).then_some(p + size);
        for q in right.into_iter().chain(down) {
            a[p][p] += g;
            a[q][q] += g;
            a[p][q] -= g;
            a[q][p] -= g;
        }
        let bends = [(1, p % size + 2 < size), (size, p + 2 * size < n)];
        for (stride, _) in bends.into_iter().filter(|b| b.1) {
            let triple = [(p, 1.0), (p + stride, -2.0), (p + 2 * stride, 1.0)];
            for (i, x) in triple {
                triple.iter().for_each(|(j, y)| a[i][*j] += settings.plane.bending * x * y);
            }
        }
    }
    for k in 0..n {
        let top = a[k].clone();
        for (i, row) in a.iter_mut().enumerate() {
            if i != k {
                let factor = row[k] / top[k];
                row.iter_mut().zip(&top).for_each(|(x, t)| *x -= factor * t);
            }
        }
    }
    for (p, row) in a.iter().enumerate() {
        let want = row[n] / row[p];
        assert!((f64::from(fit.values[p]) - want).abs() < 2e-3, "{p}: {} {want}", fit.values[p]);
    }
}

#[test]
fn disocclusions_take_the_farther_side() {
    let mut samples = Vec::new();
    for y in 0..12 {
        for x in 0..30 {
            match x {
                0..10 => samples.push(sample(x as f64, y as f64, 1.0, 200.0)),
                20.. => samples.push(sample(x as f64, y as f64, 4.0, 40.0)),
                _ => {}
            }
        }
    }
    for plane in [PlaneSettings::LINEAR, PlaneSettings::CUBIC] {
        let fit = interpolate(&samples, (30, 12), &with(plane));
        let row = &fit.values[150..180];
        assert!(row[11..20].iter().all(|v| (v - 40.0).abs() < 5.0), "{row:?}");
        assert!(row[9] > 190.0, "{row:?}");
        assert!(fit.mask[160..170].iter().all(|c| *c == Cover::Disocclusion));
        let fill = HoleFill::Leave;
        let left = interpolate(&samples, (30, 12), &Settings { fill, ..with(plane) });
        assert!(left.values[160..170].iter().all(|v| *v == 0.0));
    }
}

#[test]
fn bands_add_up() {
    let samples = scattered(9, |x, y| 10.0 * x + y);
    let whole = interpolate(&samples, (9, 9), &Settings::default());
    let mut problem = PlaneProblem::<4, 1>::new((9, 9), &Settings::default());
    let (a, b) = samples.split_at(50);
    problem.add(a);
    problem.add(b);
    assert_eq!(problem.solve(), whole);
}

/// A hole of 200 x 200 pixels that only the smoothing spans: the diagonal preconditioner needs hundreds of
/// steps.
#[test]
fn large_holes_converge_and_are_harmonic_inside() {
    let side = 240;
    let tone = |x: f64, y: f64| 60.0 + 0.3 * x + 0.2 * y;
    let inside = |v: usize| (20..220).contains(&v);
    let samples: Vec<_> = (0..side * side)
        .filter(|p| !(inside(p % side) && inside(p / side)))
        .map(|p| ((p % side) as f64, (p / side) as f64))
        .map(|(x, y)| sample(x, y, 1.0, tone(x, y) as f32))
        .collect();
    let fill = HoleFill::Bridge;
    let fit = interpolate(&samples, (side, side), &Settings { fill, ..Settings::default() });
    assert!(fit.convergence.reached && fit.convergence.steps < 120, "{:?}", fit.convergence);
    // A plane has no second differences, so the smoothing keeps it.
    let (x, y) = (120, 100);
    let got = f64::from(fit.values[y * side + x]);
    assert!((got - tone(x as f64, y as f64)).abs() < 0.5, "{got}");
}
