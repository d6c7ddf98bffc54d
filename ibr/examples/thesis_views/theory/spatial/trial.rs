//! Virtual experiments in space: cameras take samples with errors, and the view rendered from them is
//! compared with the exact one.

use super::triangles::Triangles;
use super::{SpatialRig, parameters_at, see};
use crate::theory::flat::Errors;
use crate::theory::random::{part, seeded, within};
use hybank_ibr::camera::Camera;
use nalgebra::Vector2;
use rand_pcg::Pcg64;

/// Positions per side at which a view is compared.
const SIDE: usize = 100;

/// Share of the window's size by which the sampled part is wider than the judged one.
const MARGIN: f64 = 0.15;

/// The mean absolute error of one view by linear interpolation on Delaunay triangles. Phases and errors are
/// drawn from the seed; errors are uniform within their bounds. `None` if the samples do not cover the
/// window.
pub(crate) fn image_space(rig: &SpatialRig<'_>, errors: Errors, seed: u64) -> Option<f64> {
    let random = &mut seeded(seed);
    let phases: Vec<Vector2<f64>> =
        rig.cameras.iter().map(|_| Vector2::new(part(random), part(random))).collect();
    mean_error(&Triangles::new(capture(rig, errors, &phases, random))?, rig)
}

/// The samples of all cameras in the virtual image, with their values.
fn capture(
    rig: &SpatialRig<'_>,
    errors: Errors,
    phases: &[Vector2<f64>],
    random: &mut Pcg64,
) -> Vec<(Vector2<f64>, f64)> {
    let mut samples = Vec::new();
    for (camera, phase) in rig.cameras.iter().zip(phases) {
        let mut near = Vector2::zeros();
        for pixel in pixels(rig, camera, *phase) {
            let Some(at) = parameters_at(rig.scene, camera, pixel, near) else { continue };
            near = at;
            let s = rig.scene.at(at);
            let depth = camera.project(&s.point).2 + within(errors.depth, random);
            let (x, y, _) = rig.view.project(&camera.unproject(pixel.x, pixel.y, depth));
            samples.push((Vector2::new(x, y), s.texture + within(errors.texture, random)));
        }
    }
    samples
}

/// The pixel centres of a camera that see the window with its margin.
fn pixels(
    rig: &SpatialRig<'_>,
    camera: &Camera,
    phase: Vector2<f64>,
) -> impl Iterator<Item = Vector2<f64>> + use<> {
    let margin = (rig.window.1 - rig.window.0) * MARGIN;
    let wide = SpatialRig { window: (rig.window.0 - margin, rig.window.1 + margin), ..*rig };
    let seen = wide.grid(12).map(|pixel| see(camera, &rig.scene.at(wide.parameters(pixel))).0);
    let limits = (Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN));
    let (low, high) = seen.fold(limits, |(low, high), p| (low.inf(&p), high.sup(&p)));
    let first = (low - phase).map(f64::ceil) + phase;
    let (columns, rows) = ((high.x - first.x).max(0.0) as usize, (high.y - first.y).max(0.0) as usize);
    (0..=rows).flat_map(move |j| (0..=columns).map(move |i| first + Vector2::new(i as f64, j as f64)))
}

fn mean_error(mesh: &Triangles, rig: &SpatialRig<'_>) -> Option<f64> {
    let mut sum = 0.0;
    for pixel in rig.grid(SIDE) {
        sum += (mesh.value(pixel)? - rig.intensity(pixel)).abs();
    }
    Some(sum / (SIDE * SIDE) as f64)
}
