//! Virtual experiments against the theorem. `HYBANK_SLOW=1` runs all sizes of the thesis's figures.

use super::scenes::{Hill, camera_at};
use super::triangles::{Corners, Triangles};
use super::{EdgeModel, SpatialRig, trial};
use crate::theory::delaunay::{PoissonDelaunay, superposed_grids};
use crate::theory::flat::Errors;
use crate::theory::flat::tests::log_slope;
use crate::theory::random::{part, seeded, within};
use hybank_ibr::camera::Camera;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector2, Vector3};

fn sweep() -> bool {
    trials::is_slow("all sizes of the figures of chapter 4")
}

fn cameras(count: usize, focal: f64) -> Vec<Camera> {
    let random = &mut seeded(17);
    (0..count).map(|_| camera_at(within(0.6, random), within(0.6, random), focal).unwrap()).collect()
}

struct Setup {
    cameras: Vec<Camera>,
    view: Camera,
    focal: f64,
}

fn setup(pixel: f64) -> Setup {
    let focal = 1.0 / pixel;
    Setup { cameras: cameras(10, focal), view: camera_at(0.07, -0.05, focal).unwrap(), focal }
}

impl Setup {
    fn rig(&self) -> SpatialRig<'_> {
        let half = Vector2::repeat(0.17 * self.focal);
        SpatialRig { scene: &Hill, cameras: &self.cameras, view: &self.view, window: (-half, half) }
    }
}

fn mean(draws: u64, trial: impl Fn(u64) -> Option<f64>) -> f64 {
    (0..draws).map(|seed| trial(seed).unwrap()).sum::<f64>() / draws as f64
}

/// Figure 4.6: the error decays with the number of pixels, which is the square of the spacing of the
/// samples as in the plane; the bound lies above, and so does the estimate, a little.
#[test]
fn errors_decay_with_the_pixels() {
    let sizes: &[f64] = if sweep() { &[0.04, 0.03, 0.02, 0.014, 0.01, 0.007] } else { &[0.04, 0.02, 0.01] };
    let mut measured = Vec::new();
    for pixel in sizes {
        let setup = setup(*pixel);
        let rig = setup.rig();
        let mae = mean(6, |seed| trial::image_space(&rig, Errors::default(), seed));
        let (bound, estimate) = (rig.bound(Errors::default()).total(), rig.estimate());
        println!("pixel {pixel}: MAE {mae:.3e}, estimate {estimate:.3e}, bound {bound:.3e}");
        assert!(mae < bound && (0.85..1.15).contains(&(estimate / mae)), "{pixel}: {mae} {estimate} {bound}");
        measured.push((1.0 / (pixel * pixel), mae));
    }
    let slope = log_slope(&measured);
    assert!((slope + 1.0).abs() < 0.06, "{slope}");
}

/// Figure 4.7: the mean of |sum b_k e_k| over a triangle for uniform e_k is 0.340 of their limit.
#[test]
fn errors_of_intensity_enter_linearly() {
    let setup = setup(0.01);
    let rig = setup.rig();
    for texture in [0.02, 0.05, 0.1] {
        let errors = Errors { texture, depth: 0.0 };
        let mae = mean(1, |seed| trial::image_space(&rig, errors, seed));
        println!("E_T {texture}: MAE / E_T {:.4}", mae / texture);
        assert!((mae / texture - 0.340).abs() < 0.006 && mae < rig.bound(errors).total(), "{texture}: {mae}");
    }
}

/// Figure 4.8: the error is about a fifteenth of the bound, and linear where E_D outweighs the sampling.
#[test]
fn errors_of_depth_enter_linearly() {
    let setup = setup(0.01);
    let rig = setup.rig();
    let mut shares = Vec::new();
    for depth in [0.05, 0.1, 0.2] {
        let errors = Errors { texture: 0.0, depth };
        let mae = mean(2, |seed| trial::image_space(&rig, errors, seed));
        let bound = rig.bound(errors).total();
        println!("E_D {depth}: MAE {mae:.3e}, bound / MAE {:.1}", bound / mae);
        assert!((10.0..20.0).contains(&(bound / mae)), "{depth}: {mae} {bound}");
        shares.push(mae / depth);
    }
    assert!(shares.iter().all(|s| (s / shares[1] - 1.0).abs() < 0.15), "{shares:?}");
}

/// Theorem 4.3 is an expectation too: N cameras at one place with one phase have the samples of one, and
/// break it. The sure bound of the triangles holds, and so does the theorem with phases of their own.
#[test]
fn coincident_cameras_break_the_expectation_and_not_the_sure_bound() {
    let (focal, mut ratios) = (50.0, Vec::new());
    for count in [1, 8, 32] {
        let cameras = vec![camera_at(0.3, 0.1, focal).unwrap(); count];
        let setup = Setup { cameras, ..setup(1.0 / focal) };
        let rig = setup.rig();
        let (mae, sure) = trial::with_phases(&rig, &vec![Vector2::new(0.3, 0.6); count]).unwrap();
        assert!(mae <= sure, "{count}: {mae} {sure}");
        ratios.push(mae / rig.bound(Errors::default()).total());
    }
    println!("measured / Theorem 4.3 for 1, 8, 32 coincident cameras: {ratios:.2?}");
    assert!(ratios[0] < 1.0 && ratios[2] > 1.0 && (ratios[1] / ratios[0] / 8.0 - 1.0).abs() < 0.01);
    let setup = Setup { cameras: vec![camera_at(0.3, 0.1, focal).unwrap(); 8], ..setup(1.0 / focal) };
    let rig = setup.rig();
    let mae = mean(8, |seed| trial::image_space(&rig, Errors::default(), seed));
    assert!(mae < rig.bound(Errors::default()).total());
    assert!((mae / rig.estimate() - 1.0).abs() < 0.15, "{mae} {}", rig.estimate());
}

/// A camera like [`camera_at`] that is turned about its axis and looks a little aside.
fn turned(x: f64, y: f64, focal: f64, turns: [f64; 3]) -> Camera {
    let r = Rotation3::from_euler_angles(turns[0], turns[1], turns[2]);
    let m = Matrix3::new(focal, 0.0, 0.0, 0.0, focal, 0.0, 0.0, 0.0, 1.0) * r.matrix();
    let mut matrix = Matrix3x4::zeros();
    matrix.fixed_columns_mut::<3>(0).copy_from(&m);
    matrix.set_column(3, &(-m * Vector3::new(x, y, 0.0)));
    Camera::metric(matrix, false).unwrap()
}

#[test]
fn unequal_and_rotated_cameras_obey_the_theorem() {
    let random = &mut seeded(31);
    let mut place = || (within(0.6, random), within(0.6, random), within(1.0, random));
    let places: Vec<(f64, f64, f64)> = (0..10).map(|_| place()).collect();
    let unequal = places.iter().map(|(x, y, s)| camera_at(*x, *y, 50.0 * (0.7 * s).exp()).unwrap()).collect();
    let rotated =
        places.iter().map(|(x, y, s)| turned(*x, *y, 50.0, [0.05 * s, -0.04 * s, 3.0 * s])).collect();
    for (name, cameras) in [("unequal", unequal), ("rotated", rotated)] {
        let setup = Setup { cameras, ..setup(0.02) };
        let rig = setup.rig();
        let mae = mean(8, |seed| trial::image_space(&rig, Errors::default(), seed));
        let (bound, estimate) = (rig.bound(Errors::default()).total(), rig.estimate());
        println!("{name}: MAE {mae:.3e}, estimate {estimate:.3e}, bound {bound:.3e}");
        assert!(mae < bound && (estimate / mae - 1.0).abs() < 0.12, "{name}: {mae} {estimate} {bound}");
    }
}

/// The displacement of a sample is at most its cross product, for cameras of unit focal length.
#[test]
fn jitter_is_bounded_by_a_cross_product() {
    let setup = Setup { cameras: cameras(10, 1.0), ..setup(1.0) };
    let rig = setup.rig();
    for (i, camera) in setup.cameras.iter().enumerate() {
        for pixel in rig.grid(5) {
            let delta = 0.2;
            let s = super::PaintedSurface::at(&Hill, rig.parameters(pixel)).point;
            let (d, d_v) = (camera.project(&s).2, setup.view.project(&s).2);
            let moved = s + (s - camera.centre()) * (delta / d);
            let area = (s - camera.centre()).cross(&(s - setup.view.centre())).norm();
            let bound = delta * area / (d * d_v * setup.view.project(&moved).2);
            let got = rig.jitter(i, pixel, delta).norm();
            assert!(got <= bound * (1.0 + 1e-9) && got > 0.9 * bound, "{got} {bound}");
        }
    }
}

/// Saddles, bowls and troughs f = x' H x / 2 on Poisson samples: the curvature that counts.
#[test]
fn saddles_cost_less_than_bowls() {
    let density = 2000.0;
    for (first, second, want) in [(1.0, 1.0, 1.0), (1.0, 0.0, 0.5), (1.0, -1.0, 0.424)] {
        let f = |p: Vector2<f64>| first * p.x * p.x / 2.0 + second * p.y * p.y / 2.0;
        let (mut sum, positions) = (0.0, 15_000);
        for seed in 0..4 {
            let mesh = Triangles::new(points(None, density, seed).iter().map(|p| (*p, f(*p)))).unwrap();
            let random = &mut seeded(seed + 20);
            for _ in 0..positions {
                let at = Vector2::new(part(random), part(random));
                sum += (mesh.value(at).unwrap() - f(at)).abs() / (4.0 * f64::from(positions));
            }
        }
        let share = sum / PoissonDelaunay { density }.mean_quadratic_error();
        assert!((share / want - 1.0).abs() < 0.04, "{first} {second}: {share}");
    }
}

/// Points of N shifted grids, or of a Poisson process, of one density in the unit square with a margin.
fn points(grids: Option<usize>, density: f64, seed: u64) -> Vec<Vector2<f64>> {
    let random = &mut seeded(seed);
    let margin = 6.0 / density.sqrt();
    let side = 1.0 + 2.0 * margin;
    let Some(grids) = grids else {
        // A Poisson process with a given number of points, which is close enough to its mean.
        let count = (density * side * side).round() as usize;
        let point = |_| Vector2::new(part(random), part(random)) * side - Vector2::repeat(margin);
        return (0..count).map(point).collect();
    };
    let step = (grids as f64 / density).sqrt();
    let count = (side / step).ceil() as usize + 1;
    let mut all = Vec::new();
    for _ in 0..grids {
        let start = Vector2::new(part(random) - 1.0, part(random) - 1.0) * step - Vector2::repeat(margin);
        let cell = |k: usize| start + Vector2::new((k % count) as f64, (k / count) as f64) * step;
        all.extend((0..count * count).map(cell));
    }
    all
}

/// R^2, S, S^2, S R^2 and S sum l^2 of the triangles of one draw whose leftmost corner lies in the unit
/// square: sums and the number of triangles. (Which corner the triangulation names first depends on the
/// distance from the centre, so that corner would favour large triangles.)
fn sums(grids: Option<usize>, density: f64, seed: u64) -> ([f64; 5], f64) {
    let mesh = Triangles::new(points(grids, density, seed).into_iter().map(|p| (p, 0.0))).unwrap();
    let inside = |p: Vector2<f64>| p.x > 0.0 && p.x < 1.0 && p.y > 0.0 && p.y < 1.0;
    let (mut sums, mut count) = ([0.0; 5], 0.0);
    let leftmost = |t: &Corners| t.points.into_iter().min_by(|a, b| a.x.total_cmp(&b.x)).is_some_and(inside);
    for t in mesh.all().filter(leftmost) {
        let (s, r2) = (t.area(), t.radius().powi(2));
        let [a, b, c] = t.points;
        let edges = (a - b).norm_squared() + (b - c).norm_squared() + (c - a).norm_squared();
        let terms = [r2, s, s * s, s * r2, s * edges];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        count += 1.0;
    }
    (sums, count)
}

/// Table 4.1, counted on triangulations: E[R^2], E[S], E[S^2], E[S R^2] and the mean error of a parabola.
/// They are those of the theory within four standard errors, which are estimated from the scatter of the
/// draws, and 0.1 % more (for ten grids the theory neglects circles wider than a cell).
#[test]
fn triangles_have_the_moments_of_the_table() {
    // Ten grids repeat one pattern: the square is one cell of them.
    let many = if sweep() { 10 } else { 1 };
    for (grids, density, draws) in [(None, 1000.0, 30 * many), (Some(10), 10.0, 2000 * many)] {
        let all: Vec<([f64; 5], f64)> = (0..draws).map(|seed| sums(grids, density, seed)).collect();
        let count: f64 = all.iter().map(|draw| draw.1).sum();
        let law = PoissonDelaunay { density };
        let factor = |order| grids.map_or(1.0, |n| superposed_grids(n, order));
        let theory = [
            law.moment(0, 1),
            law.moment(1, 0),
            law.moment(2, 0) * factor(2),
            law.moment(1, 1) * factor(2),
            law.area_times_squared_edges() * factor(2),
        ];
        for (k, want) in theory.into_iter().enumerate() {
            let ratio = all.iter().map(|draw| draw.0[k]).sum::<f64>() / count / want;
            // Of a ratio of sums: the scatter of what is left of each draw.
            let scatter: f64 = all.iter().map(|draw| (draw.0[k] / want - ratio * draw.1).powi(2)).sum();
            let error = scatter.sqrt() / count;
            println!("{grids:?}, moment {k}: simulated / theory {ratio:.4} +- {error:.4}");
            assert!(error < if sweep() { 0.004 } else { 0.012 }, "{grids:?} {k}: {error}");
            assert!((ratio - 1.0).abs() < 4.0 * error + 0.001, "{grids:?} {k}: {ratio} {error}");
        }
    }
}

/// A step on a Poisson-Delaunay triangulation: 0.4323 lambda^(-1/2) per unit length of the edge, whether it
/// is straight or round.
#[test]
fn edges_cost_the_root_of_the_density() {
    let densities: &[f64] =
        if sweep() { &[400.0, 1600.0, 6400.0, 25_600.0] } else { &[400.0, 1600.0, 6400.0] };
    let mut measured = Vec::new();
    for density in densities {
        let draws = (16_000.0 / density).ceil().max(8.0) as u64;
        let (reach, positions) = (5.0 / density.sqrt(), 6000);
        let mut sum = [0.0; 2];
        for seed in 0..draws {
            let samples = points(None, *density, seed);
            let random = &mut seeded(seed + 1000);
            let straight = |p: Vector2<f64>| if p.x > 0.5 { 1.0 } else { 0.0 };
            let round = |p: Vector2<f64>| if (p - Vector2::repeat(0.5)).norm() < 0.4 { 1.0 } else { 0.0 };
            let steps: [&dyn Fn(Vector2<f64>) -> f64; 2] = [&straight, &round];
            for (k, step) in steps.iter().enumerate() {
                let mesh = Triangles::new(samples.iter().map(|p| (*p, step(*p)))).unwrap();
                for _ in 0..positions {
                    let (along, across) = (part(random), within(reach, random));
                    let turn = std::f64::consts::TAU * along;
                    let at = match k {
                        0 => Vector2::new(0.5 + across, along),
                        _ => Vector2::repeat(0.5) + (0.4 + across) * Vector2::new(turn.cos(), turn.sin()),
                    };
                    // Round: the ring has more area outside of the edge than inside.
                    let share = if k == 0 { 1.0 } else { (0.4 + across) / 0.4 };
                    let miss = (mesh.value(at).unwrap() - step(at)).abs();
                    sum[k] += share * miss * 2.0 * reach / (positions as f64 * draws as f64);
                }
            }
        }
        let model = EdgeModel { length: 1.0, height: 1.0, area: 1.0, density: *density };
        let ratios = sum.map(|s| s / model.error());
        println!("density {density}: straight and round edge, measured / predicted {ratios:.3?}");
        assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.05), "{density}: {ratios:?}");
        measured.push((*density, sum[0]));
    }
    let slope = log_slope(&measured);
    assert!((slope + 0.5).abs() < 0.03, "{slope}");
}

/// Edges, smooth texture and errors of depth in one view: their parts add up.
#[test]
fn the_parts_of_an_occluded_view_add_up() {
    let density: f64 = 4000.0;
    let (height, rate, jitter) = (0.6, 18.0, 0.004);
    let centre = Vector2::repeat(0.5);
    let texture = |p: Vector2<f64>| 0.1 * (rate * p.x).sin() * (rate * p.y).cos();
    let f = |p: Vector2<f64>| texture(p) + if (p - centre).norm() < 0.3 { height } else { 0.0 };
    let (mut sum, positions, draws) = (0.0, 20_000, 6);
    for seed in 0..draws {
        let random = &mut seeded(seed + 50);
        // Jitter of depth moves a sample along the row, with the colour of where it was.
        let samples: Vec<_> = points(None, density, seed)
            .into_iter()
            .map(|p| (p + Vector2::new(within(jitter, random), 0.0), f(p)))
            .collect();
        let mesh = Triangles::new(samples).unwrap();
        for _ in 0..positions {
            let at = Vector2::new(part(random), part(random));
            sum += (mesh.value(at).unwrap() - f(at)).abs() / (positions as f64 * draws as f64);
        }
    }
    let length = std::f64::consts::TAU * 0.3;
    let edges = EdgeModel { length, height, area: 1.0, density }.error();
    // The Hessian of the product of sines has eigenvalues of the root mean square 0.1 rate^2 / 2, and the
    // slope along the rows a mean of (2 / pi)^2 of its largest value.
    let smooth = 0.05 * rate * rate * PoissonDelaunay { density }.mean_quadratic_error();
    let slope = 0.1 * rate * (2.0 / std::f64::consts::PI).powi(2);
    let depth = 0.340 * jitter * slope;
    let predicted = edges + smooth + depth;
    println!("measured {sum:.4e}: edges {edges:.2e}, smooth {smooth:.2e}, depth {depth:.2e}");
    assert!((sum / predicted - 1.0).abs() < 0.12, "{sum} {predicted}");
}
