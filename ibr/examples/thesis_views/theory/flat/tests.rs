//! Virtual experiments against the theorems, at all sizes of the thesis's figures. `HYBANK_SLOW=1` makes
//! more draws.

use super::scenes::{Board, Wave, board_before_wall, cameras, virtual_camera};
use super::{Errors, FlatCamera, FlatRig, PaintedCurve, occluded::OccludedRig, trial};

const WINDOW: (f64, f64) = (-1.2, 1.2);

fn rig<'a>(scene: &'a dyn PaintedCurve, cameras: &'a [FlatCamera], focal: f64) -> FlatRig<'a> {
    FlatRig { scene, cameras, view: virtual_camera(focal), window: WINDOW }
}

fn mean(draws: u64, trial: impl Fn(u64) -> Option<f64>) -> f64 {
    (0..draws).map(|seed| trial(seed).unwrap()).sum::<f64>() / draws as f64
}

/// Powers of two.
fn focals(first: i32, last: i32) -> impl Iterator<Item = f64> {
    (first..=last).map(|k| 2.0_f64.powi(k))
}

/// So many draws, or eight times as many if asked for.
fn draws(few: f64) -> u64 {
    let many = trials::is_slow("all draws of the figures of chapter 3");
    (if many { 8.0 * few } else { few }).ceil() as u64
}

/// Slope of the least-squares line through the logarithms.
pub(crate) fn log_slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (mx, my) = logs().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (top, bottom) =
        logs().fold((0.0, 0.0), |(t, b), (x, y)| (t + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    top / bottom
}

/// Figure 3.5: the error decays with the square of the number of pixels, the bound is 4 to 7 times larger,
/// and the estimate is right.
#[test]
fn errors_decay_with_the_square_of_the_pixels() {
    let (mut measured, mut object) = (Vec::new(), Vec::new());
    for focal in focals(5, 10) {
        let cameras = cameras(10, focal);
        let rig = rig(&Wave, &cameras, focal);
        let (bound, estimate) = (rig.image_space(Errors::default()).total(), rig.estimate());
        // The error of one view scatters more where its pixels are few.
        let draws = draws((4000.0 / focal).max(6.0));
        let mae = mean(draws, |seed| trial::image_space(&rig, Errors::default(), seed));
        println!("focal {focal}: MAE {mae:.3e}, estimate {estimate:.3e}, bound {bound:.3e}");
        assert!(bound / mae > 4.0 && bound / mae < 7.0, "{focal}: {bound} {mae}");
        assert!((estimate / mae - 1.0).abs() < 0.1, "{focal}: {estimate} {mae}");
        measured.push((focal, mae));
        let mae = mean(draws / 2, |seed| trial::object_space(&rig, Errors::default(), seed));
        let bound = rig.object_space(Errors::default()).total();
        assert!(bound > 3.0 * mae && bound < 8.0 * mae, "{focal}: {bound} {mae}");
        object.push((focal, mae));
    }
    let slopes = [log_slope(&measured), log_slope(&object)];
    println!("slopes {slopes:.3?}");
    assert!(slopes.iter().all(|s| (s + 2.0).abs() < 0.05), "{slopes:?}");
}

/// The exact moments of few cameras: a Poisson process would be wrong by a factor of two at N = 4.
#[test]
fn few_cameras_have_shorter_intervals_than_a_poisson_process() {
    for count in [4, 8, 16] {
        let cameras = cameras(count, 64.0);
        let rig = rig(&Wave, &cameras, 64.0);
        let mae = mean(24, |seed| trial::image_space(&rig, Errors::default(), seed));
        let estimate = rig.estimate();
        assert!((estimate / mae - 1.0).abs() < 0.12, "{count}: {estimate} {mae}");
    }
}

/// Figures 3.6 and 3.7: errors of intensity and depth enter linearly, and jitter attains its bound.
#[test]
fn errors_of_intensity_and_depth_enter_linearly() {
    let focal = 256.0;
    let cameras = cameras(10, focal);
    let rig = rig(&Wave, &cameras, focal);
    for texture in [0.02, 0.1] {
        let errors = Errors { texture, depth: 0.0 };
        let mae = mean(4, |seed| trial::image_space(&rig, errors, seed));
        let share = mae / texture / super::UNIFORM_ERROR_SHARE;
        assert!((share - 1.0).abs() < 0.03 && mae < rig.image_space(errors).total(), "{texture}: {share}");
    }
    let mut shares = Vec::new();
    for depth in [0.02, 0.1, 0.2] {
        let errors = Errors { texture: 0.0, depth };
        let mae = mean(4, |seed| trial::image_space(&rig, errors, seed));
        assert!(mae < rig.image_space(errors).total(), "{depth}: {mae}");
        shares.push(mae / depth);
        let jitter = |u: f64| (0..10).map(move |i| (i, u)).map(|(i, u)| rig.jitter(i, u, -depth).abs());
        let worst = (0..400).flat_map(|k| jitter(-1.2 + 0.006 * f64::from(k))).fold(0.0, f64::max);
        let promised = depth * rig.jitter_factor(depth);
        assert!(worst <= promised * 1.001 && worst > 0.97 * promised, "{worst} {promised}");
    }
    assert!(shares.iter().all(|s| (s / shares[0] - 1.0).abs() < 0.1), "{shares:?}");
}

#[test]
fn pixels_are_found_on_the_curve() {
    let camera = FlatCamera::looking([0.4, 0.1], -0.1, 700.0);
    for u in [-1.9, -0.7, 0.0, 1.1, 1.9] {
        let x = camera.see(&Wave.at(u)).x;
        assert!((super::parameter_at(&Wave, &camera, x) - u).abs() < 1e-9, "{u}");
    }
    assert!((super::parameter_at(&Wave, &camera, 1e5) - 1.9).abs() < 1e-6);
}

/// The formula of the jitter is the displacement of the projection itself.
#[test]
fn jitter_is_a_displacement() {
    let mut cameras = cameras(4, 200.0);
    cameras.push(FlatCamera::looking([0.4, -0.3], 0.3, 150.0));
    let rig = rig(&Wave, &cameras, 200.0);
    for (i, camera) in cameras.iter().enumerate() {
        for (u, delta) in [(-1.0, 0.2), (0.3, -0.1), (1.1, 1e-3)] {
            let s = Wave.at(u).point;
            let (x, d) = camera.project(&s);
            let moved = rig.view.project(&camera.unproject(x, d + delta)).0 - rig.view.project(&s).0;
            assert!((rig.jitter(i, u, delta) - moved).abs() < 1e-9, "{i} {u} {delta}");
        }
    }
}

/// Theorem 3.1 is an expectation over phases: N cameras at one place with one phase are one camera, and
/// break it from N = 4 on. The sure bound holds.
#[test]
fn coincident_cameras_break_the_expectation_and_not_the_sure_bound() {
    let wall = Board { distance: 5.0, ends: (-1.9, 1.9), level: 0.5, height: 0.4, rate: 9.0, phase: 0.2 };
    let mut ratios = Vec::new();
    for count in [1, 4, 8] {
        let cameras = vec![FlatCamera::looking([0.4, 0.0], 0.0, 128.0); count];
        let rig = rig(&wall, &cameras, 128.0);
        let (mae, sure) = trial::with_phases(&rig, &vec![0.3; count]).unwrap();
        assert!(mae <= sure, "{count}: {mae} {sure}");
        ratios.push(mae / rig.image_space(Errors::default()).total());
    }
    println!("measured / Theorem 3.1 for 1, 4, 8 coincident cameras: {ratios:.2?}");
    assert!(ratios[0] < 1.0 && ratios[1] > 1.05 && ratios[2] > 4.2, "{ratios:?}");
    // Independent phases mend it, also at one place.
    let cameras = vec![FlatCamera::looking([0.4, 0.0], 0.0, 128.0); 8];
    let rig = rig(&wall, &cameras, 128.0);
    let mae = mean(40, |seed| trial::image_space(&rig, Errors::default(), seed));
    assert!(mae < rig.image_space(Errors::default()).total());
    assert!((mae / rig.estimate() - 1.0).abs() < 0.12, "{mae} {}", rig.estimate());
}

#[test]
fn unequal_and_rotated_cameras_obey_the_theorem() {
    let unequal: Vec<FlatCamera> = (0..10)
        .map(|i| {
            let spread = (f64::from(i) * 2.7).sin();
            FlatCamera::looking([-1.0 + 0.2 * f64::from(i), 0.0], 0.0, 128.0 * spread.exp())
        })
        .collect();
    let rotated: Vec<FlatCamera> = (0..10)
        .map(|i| {
            let x = -1.0 + 0.21 * f64::from(i);
            FlatCamera::looking([x, 0.2 * (f64::from(i) * 1.3).sin()], 0.15 * x, 128.0)
        })
        .collect();
    for cameras in [unequal, rotated] {
        let rig = rig(&Wave, &cameras, 128.0);
        let mae = mean(16, |seed| trial::image_space(&rig, Errors::default(), seed));
        let (bound, estimate) = (rig.image_space(Errors::default()).total(), rig.estimate());
        assert!(mae < bound && (estimate / mae - 1.0).abs() < 0.1, "{mae} {estimate} {bound}");
    }
}

/// Section 4.3: jumps make the error decay with the number of pixels itself, and the estimate knows how many
/// cameras see the background beside them.
#[test]
fn occluded_scenes_decay_with_the_pixels() {
    let boards = board_before_wall();
    let curves: Vec<&dyn PaintedCurve> = boards.iter().map(|b| b as &dyn PaintedCurve).collect();
    let mut measured = Vec::new();
    for focal in focals(5, 11) {
        let cameras: Vec<FlatCamera> = (0..10)
            .map(|i| FlatCamera::looking([-1.0 + 0.2 * (f64::from(i) + 0.5), 0.0], 0.0, focal))
            .collect();
        let window = (-0.3 * focal, 0.3 * focal);
        let rig = OccludedRig { curves: &curves, cameras: &cameras, view: virtual_camera(focal), window };
        let jumps = rig.jumps();
        assert_eq!(jumps.len(), 2);
        assert!(jumps.iter().all(|j| j.front.len() == 10 && (3..=7).contains(&j.back.len())), "{jumps:?}");
        let mae = mean(draws(30.0), |seed| rig.trial(seed));
        let (smooth, edges) = rig.estimate();
        let bound = rig.bound(Errors::default()).total();
        println!("focal {focal}: MAE {mae:.3e}, smooth {smooth:.2e} + jumps {edges:.3e}, bound {bound:.3e}");
        assert!(((smooth + edges) / mae - 1.0).abs() < 0.15, "{focal}: {mae} {smooth} {edges}");
        assert!(mae < bound && edges > 5.0 * smooth);
        measured.push((focal, mae));
    }
    let slope = log_slope(&measured);
    println!("slope {slope:.3}");
    assert!((slope + 1.0).abs() < 0.05, "{slope}");
}
