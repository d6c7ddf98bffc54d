//! Virtual experiments in the plane: cameras take samples with errors, and the view rendered from them is
//! compared with the exact one.

use super::{Errors, FlatCamera, FlatRig, parameter_at};
use crate::theory::piecewise_linear::PiecewiseLinear;
use crate::theory::random::{part, seeded};
use hybank_sampling::nonuniform::Measured;
use rand_pcg::Pcg64;

/// Positions at which a view is compared.
const POSITIONS: usize = 3000;

/// A sample of the virtual image and what it came from.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Propagated {
    /// Position in the virtual image.
    x: f64,
    depth: f64,
    value: f64,
}

/// The mean absolute error of one view with image-space interpolation: propagated samples joined by lines.
/// Phases and errors are drawn from the seed; errors are uniform within their bounds. `None` if no sample
/// falls on the curve.
pub fn image_space(rig: &FlatRig<'_>, errors: Errors, seed: u64) -> Option<f64> {
    let random = &mut seeded(seed);
    let phases: Vec<f64> = rig.cameras.iter().map(|_| part(random)).collect();
    let samples = capture(rig, &phases, errors, random);
    let jitter = errors.depth * rig.jitter_factor(errors.depth);
    let measured = |s: &Propagated| Measured { x: s.x, value: s.value, error: errors.texture, jitter };
    let line = PiecewiseLinear::new(samples.iter().map(measured).collect()).ok()?;
    Some(mean_error(rig, |x| line.value(x)))
}

/// The same with given phases of the cameras' pixels and no errors, with the sure bound of the samples at
/// hand beside it: (1/12) sup|f_v''| sum D^3 / sum D.
pub fn with_phases(rig: &FlatRig<'_>, phases: &[f64]) -> Option<(f64, f64)> {
    let samples = capture(rig, phases, Errors::default(), &mut seeded(0));
    let measured = |s: &Propagated| Measured { x: s.x, value: s.value, error: 0.0, jitter: 0.0 };
    let line = PiecewiseLinear::new(samples.iter().map(measured).collect()).ok()?;
    let limits = rig.smoothness();
    Some((mean_error(rig, |x| line.value(x)), line.mean_error_bound(limits)?))
}

/// The mean absolute error of one view with object-space interpolation: reconstructed points joined by
/// chords, on which intensity is linear.
pub fn object_space(rig: &FlatRig<'_>, errors: Errors, seed: u64) -> Option<f64> {
    let random = &mut seeded(seed);
    let phases: Vec<f64> = rig.cameras.iter().map(|_| part(random)).collect();
    let mut samples = capture(rig, &phases, errors, random);
    samples.sort_by(|a, b| a.x.total_cmp(&b.x));
    (samples.len() > 1).then(|| mean_error(rig, |x| on_chord(&samples, x)))
}

/// The intensity where the ray of pixel x meets its chord. With a = x_m d_m the chord projects to
/// ((1 - s) a_1 + s a_2) / ((1 - s) d_1 + s d_2), which is x at s = r_1 / (r_1 - r_2), r = a - x d.
fn on_chord(samples: &[Propagated], x: f64) -> f64 {
    let right = samples.partition_point(|s| s.x < x).clamp(1, samples.len() - 1);
    let (a, b) = (&samples[right - 1], &samples[right]);
    let residual = |p: &Propagated| (p.x - x) * p.depth;
    let span = residual(a) - residual(b);
    if span == 0.0 { a.value } else { a.value + (b.value - a.value) * residual(a) / span }
}

/// The samples of all cameras in the virtual image: pixel n of camera i lies at n + phases\[i\].
fn capture(rig: &FlatRig<'_>, phases: &[f64], errors: Errors, random: &mut Pcg64) -> Vec<Propagated> {
    let mut samples = Vec::new();
    for (camera, phase) in rig.cameras.iter().zip(phases) {
        for pixel in pixels(rig, camera, *phase) {
            let u = parameter_at(rig.scene, camera, pixel);
            let c = rig.scene.at(u);
            let mut error = |limit: f64| limit * (2.0 * part(random) - 1.0);
            let depth = camera.project(&c.point).1 + error(errors.depth);
            let (x, depth) = rig.view.project(&camera.unproject(pixel, depth));
            samples.push(Propagated { x, depth, value: c.texture[0] + error(errors.texture) });
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
