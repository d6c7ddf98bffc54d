//! Views from damaged depth: scenes with true views, whose maps are damaged by a seeded generator. Skipped,
//! with a note, where the data are not there.

mod case;
mod damage;
mod sky;

use case::Case;
use damage::Damage;

/// Renders a scene of the data with damages, each of which must give so many dB.
fn check(name: &str, truth: &str, least: &[(Damage, f64)]) {
    let Some(case) = Case::of_data(name, truth).unwrap() else { return };
    let folder = tempfile::tempdir().unwrap();
    let all = trials::is_slow(&format!("damages of {name} after the first"));
    for (damage, least) in least.iter().take(if all { least.len() } else { 1 }) {
        let found = case.rendered(*damage, folder.path()).unwrap().psnr;
        println!("{name}, {}: {found:.2} dB", damage.name());
        assert!(found >= *least, "{name}, {}: {found} below {least}", damage.name());
    }
}

/// Before maps were restored these were 26.5 dB with outliers, 29.2 and 26.3 with noise, and 26.2 scattered.
/// Before clusters and samples were put to the vote, 30.7 with blobs, and 30.4 with outliers among samples.
#[test]
fn a_rig_with_damaged_disparities() {
    let least = [
        (Damage::Clean, 34.18),
        (Damage::Outliers(0.05), 33.8),
        (Damage::Blobs(0.05), 33.0),
        (Damage::Flying, 33.2),
        (Damage::Blurred, 32.85),
        (Damage::Noise(0.5), 33.9),
        (Damage::Noise(1.0), 33.4),
        (Damage::Scattered(0.03), 33.4),
        (Damage::ScatteredOutliers(0.03, 0.05), 33.2),
        (Damage::Lattice, 33.0),
        // OpenCV's matcher: 32.9.
        (Damage::Matched, 33.0),
    ];
    check("poster1", "im4.png", &least);
}

/// One photograph darker by a uniform factor, or of another white balance, which its true view does not
/// have. When drift ended at 4 % by a jump, a factor of 0.95 gave 32.7 dB and 0.965 gave 33.4.
#[test]
fn a_photograph_of_another_exposure() {
    let least = [
        (Damage::Exposure([0.95; 3]), 34.05),
        (Damage::Exposure([0.965; 3]), 33.5),
        (Damage::Exposure([0.98; 3]), 33.85),
        (Damage::Exposure([0.9, 1.0, 1.1]), 34.15),
    ];
    check("poster1", "im4.png", &least);
}

/// Before maps were restored it was 25.2 dB with outliers, and 24.8 scattered; before clusters and samples
/// were put to the vote, 28.3 with blobs, 32.7 with flying pixels, and 27.6 with outliers among samples.
#[test]
fn general_cameras_with_damaged_depths() {
    let least = [
        (Damage::Clean, 39.35),
        (Damage::Outliers(0.05), 38.7),
        // Meshes that are warped: 37.9 and 36.4.
        (Damage::Noise(0.5), 39.6),
        (Damage::Noise(1.0), 39.1),
        (Damage::Blobs(0.05), 34.9),
        (Damage::Flying, 34.4),
        (Damage::Scattered(0.03), 34.1),
        (Damage::ScatteredOutliers(0.03, 0.05), 33.0),
    ];
    check("spheres", "truth.png", &least);
}

/// Bars of a pixel and a half are not taken for outliers. With the samples of each view alone the scattered
/// depths gave 22.9 dB, and the lattice 25.8.
#[test]
fn a_thin_grid_is_kept() {
    let least = [
        (Damage::Clean, 34.05),
        (Damage::Outliers(0.05), 33.0),
        (Damage::Noise(0.5), 32.5),
        (Damage::Noise(1.0), 31.8),
        (Damage::Blobs(0.05), 30.5),
        (Damage::Scattered(0.03), 28.1),
        (Damage::Lattice, 29.2),
    ];
    check("grid", "truth.png", &least);
}

/// A sky at infinity is drawn behind everything, also where the maps do not say that it is far away.
#[test]
fn a_sky_is_far_away() {
    let folder = tempfile::tempdir().unwrap();
    let (path, truth) = sky::write(folder.path()).unwrap();
    let case = Case::read(&path, &truth).unwrap();
    let of = |value: f32| case.rendered(Damage::Sky(value), folder.path()).unwrap();
    let (far, unknown) = (of(f32::INFINITY), of(f32::NAN));
    assert!(far.psnr > 34.5 && far.coverage > 0.97, "{} {}", far.psnr, far.coverage);
    // Filled from its neighbours it was 23.5 dB.
    assert!((far.psnr - unknown.psnr).abs() < 0.1, "{} {}", far.psnr, unknown.psnr);
    if trials::is_slow("a sky that is a large number or zero") {
        let (number, zero) = (of(1e10), of(0.0));
        assert!((far.psnr - number.psnr).abs() < 1e-9, "{}", number.psnr);
        assert_eq!((unknown.psnr, unknown.coverage), (zero.psnr, zero.coverage));
    }
    // Points of a lidar, of which the sky returns none, and as many with the sky among them.
    let scattered = |damage: Damage| case.rendered(damage, folder.path()).unwrap();
    let (empty, whole) = (scattered(Damage::ScatteredSky(0.03)), scattered(Damage::Scattered(0.03)));
    println!("scattered: seen {:.3}, with the sky {:.3}", empty.coverage, whole.coverage);
    assert!(empty.coverage < 0.6 && whole.coverage > 0.92, "{} {}", empty.coverage, whole.coverage);
}
