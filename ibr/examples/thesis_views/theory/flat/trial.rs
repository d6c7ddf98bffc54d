//! Virtual experiments in the plane: cameras take samples with errors, and the view rendered from them is
//! compared with the exact one.

use super::{Errors, FlatCamera, FlatRig, parameter_at};
use crate::theory::piecewise_linear::{Knot, PiecewiseLinear};
use crate::theory::random::{part, seeded};
use rand_pcg::Pcg64;

/// Positions at which a view is compared.
const POSITIONS: usize = 3000;

/// The mean absolute error of one view with image-space interpolation: propagated samples joined by lines.
/// Phases and errors are drawn from the seed; errors are uniform within their bounds. `None` if no sample
/// falls on the curve.
pub(crate) fn image_space(rig: &FlatRig<'_>, errors: Errors, seed: u64) -> Option<f64> {
    let random = &mut seeded(seed);
    let phases: Vec<f64> = rig.cameras.iter().map(|_| part(random)).collect();
    let line = PiecewiseLinear::new(capture(rig, &phases, errors, random))?;
    Some(mean_error(rig, |x| line.value(x)))
}

/// The samples of all cameras in the virtual image: pixel n of camera i lies at n + phases\[i\].
fn capture(rig: &FlatRig<'_>, phases: &[f64], errors: Errors, random: &mut Pcg64) -> Vec<Knot> {
    let mut samples = Vec::new();
    for (camera, phase) in rig.cameras.iter().zip(phases) {
        for pixel in pixels(rig, camera, *phase) {
            let u = parameter_at(rig.scene, camera, pixel);
            let c = rig.scene.at(u);
            let mut error = |limit: f64| limit * (2.0 * part(random) - 1.0);
            let depth = camera.project(&c.point).1 + error(errors.depth);
            let (x, _) = rig.view.project(&camera.unproject(pixel, depth));
            samples.push(Knot { x, value: c.texture[0] + error(errors.texture) });
        }
    }
    samples
}

/// The pixel centres of a camera that see the curve.
fn pixels(rig: &FlatRig<'_>, camera: &FlatCamera, phase: f64) -> impl Iterator<Item = f64> + use<> {
    let (a, b) = rig.scene.range();
    let (p, q) = (camera.see(&rig.scene.at(a)).x, camera.see(&rig.scene.at(b)).x);
    let (low, high) = (p.min(q), p.max(q));
    let first = (low - phase).ceil();
    (0..).map(move |n| first + f64::from(n) + phase).take_while(move |x| *x <= high)
}

/// Mean of |rendered - f_v| over the pixels of the window.
fn mean_error(rig: &FlatRig<'_>, rendered: impl Fn(f64) -> f64) -> f64 {
    let (a, b) = rig.window;
    let (mut sum, mut pixels) = (0.0, 0.0);
    for k in 0..POSITIONS {
        let c = rig.scene.at(a + (b - a) * (k as f64 + 0.5) / POSITIONS as f64);
        let seen = rig.view.see(&c);
        sum += seen.first.abs() * (rendered(seen.x) - c.texture[0]).abs();
        pixels += seen.first.abs();
    }
    sum / pixels
}
