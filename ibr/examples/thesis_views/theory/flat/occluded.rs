//! Scenes of the plane in which curves hide each other (thesis 4.3).
//!
//! The virtual image jumps where the nearer of two curves ends. Between the jumps the error decays with the
//! square of the number of pixels, at the jumps with the number itself:
//!
//! ```text
//! MAE <= (3/4) sup|f_v''| <lambda^-2> + E_T + E_D B_v sup|f_v'|
//!        + (1/W) sum |J| ((1/l + 1/r) / 2 + 2 E_D B_v) + (1/W) sum |J'| / (2 l r)
//! ```
//!
//! J and J' are the jumps of f_v and f_v', l and r the densities of samples on the two sides, W the width of
//! the window. A density counts the cameras that see the place: the background beside a jump is seen by
//! fewer of them.

use super::{ErrorBound, Errors, FlatCamera, FlatRig, PaintedCurve, parameter_at};
use crate::theory::jump::jump_error;
use crate::theory::periodic::PeriodicSets;
use crate::theory::piecewise_linear::PiecewiseLinear;
use crate::theory::random::{part, seeded};
use hybank_sampling::nonuniform::Measured;

/// Pixels at which means over the view are taken.
const NODES: usize = 1500;

/// Mean intervals to each side of a jump within which a view is compared closely.
const BESIDE: f64 = 4.0;

/// Positions there.
const FINE: usize = 200;

/// Curves, the cameras that see them, and the virtual camera.
#[derive(Clone, Copy)]
pub struct OccludedRig<'a> {
    /// The curves, each of which every camera sees monotonically.
    pub curves: &'a [&'a dyn PaintedCurve],
    /// The actual cameras.
    pub cameras: &'a [FlatCamera],
    /// The virtual camera.
    pub view: FlatCamera,
    /// The part of the virtual image that is judged, in pixels.
    pub window: (f64, f64),
}

/// What a camera sees at a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    curve: usize,
    u: f64,
    depth: f64,
}

/// A jump of the virtual image.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    /// Its pixel.
    pub x: f64,
    /// J, of the intensity.
    pub height: f64,
    /// J', of its slope per pixel.
    pub slope: f64,
    /// Samples per pixel of each camera that sees the curve that ends.
    pub front: Vec<f64>,
    /// Samples per pixel of each camera that sees what lies behind it.
    pub back: Vec<f64>,
}

impl OccludedRig<'_> {
    /// The nearest curve on the ray of pixel x, without the curve `except`.
    fn look(&self, camera: &FlatCamera, x: f64, except: Option<usize>) -> Option<Seen> {
        let of_curve = |(curve, scene): (usize, &&dyn PaintedCurve)| {
            let (a, b) = scene.range();
            let (p, q) = (camera.see(&scene.at(a)).x, camera.see(&scene.at(b)).x);
            if Some(curve) == except || x < p.min(q) || x > p.max(q) {
                return None;
            }
            let u = parameter_at(*scene, camera, x);
            Some(Seen { curve, u, depth: camera.see(&scene.at(u)).depth })
        };
        self.curves.iter().enumerate().filter_map(of_curve).min_by(|a, b| a.depth.total_cmp(&b.depth))
    }

    /// Whether a camera sees the point u of a curve.
    fn sees(&self, camera: &FlatCamera, curve: usize, u: f64) -> bool {
        let seen = camera.see(&self.curves[curve].at(u));
        self.look(camera, seen.x, Some(curve)).is_none_or(|other| other.depth > seen.depth)
    }

    /// Samples per virtual pixel of each camera that sees the point u of a curve.
    pub fn densities(&self, curve: usize, u: f64) -> Vec<f64> {
        let c = self.curves[curve].at(u);
        let stretch = self.view.see(&c).first.abs();
        let seeing = self.cameras.iter().filter(|camera| self.sees(camera, curve, u));
        seeing.map(|camera| camera.see(&c).first.abs() / stretch).collect()
    }

    /// f_v' and f_v''.
    fn derivatives(&self, seen: &Seen) -> (f64, f64) {
        let c = self.curves[seen.curve].at(seen.u);
        let h = self.view.see(&c);
        let slope = c.texture[1] / h.first;
        (slope, (c.texture[2] - slope * h.second) / (h.first * h.first))
    }

    /// The jumps of the virtual image within the window: the visible ends of curves before others.
    pub fn jumps(&self) -> Vec<Jump> {
        let ends = self.curves.iter().enumerate().flat_map(|(k, c)| [(k, c.range().0), (k, c.range().1)]);
        ends.filter_map(|(curve, u)| self.jump(curve, u)).collect()
    }

    fn jump(&self, curve: usize, u: f64) -> Option<Jump> {
        let here = self.curves[curve].at(u);
        let seen = self.view.see(&here);
        let inside = seen.x > self.window.0 && seen.x < self.window.1;
        let behind = self.look(&self.view, seen.x, Some(curve)).filter(|b| inside && b.depth > seen.depth)?;
        let front = Seen { curve, u, depth: seen.depth };
        Some(Jump {
            x: seen.x,
            height: here.texture[0] - self.curves[behind.curve].at(behind.u).texture[0],
            slope: self.derivatives(&front).0 - self.derivatives(&behind).0,
            front: self.densities(curve, u),
            back: self.densities(behind.curve, behind.u),
        })
    }

    fn nodes(&self) -> impl Iterator<Item = Seen> {
        let (a, b) = self.window;
        let at = move |k: usize| a + (b - a) * (k as f64 + 0.5) / NODES as f64;
        (0..NODES).filter_map(move |k| self.look(&self.view, at(k), None))
    }

    /// The bound above; jumps are in `sampling`, except for the part that jitter displaces.
    pub fn bound(&self, errors: Errors) -> ErrorBound {
        let width = self.window.1 - self.window.0;
        let nodes: Vec<Seen> = self.nodes().collect();
        let (mut slope, mut curvature, mut mean) = (0.0_f64, 0.0_f64, 0.0);
        for seen in &nodes {
            let (first, second) = self.derivatives(seen);
            (slope, curvature) = (slope.max(first.abs()), curvature.max(second.abs()));
            mean += self.densities(seen.curve, seen.u).iter().sum::<f64>().powi(-2) / nodes.len() as f64;
        }
        let jitter = errors.depth * self.jitter_factor(errors.depth);
        let mut bound =
            ErrorBound { sampling: 0.75 * curvature * mean, texture: errors.texture, depth: jitter * slope };
        for jump in self.jumps() {
            let (l, r) = (jump.front.iter().sum::<f64>(), jump.back.iter().sum::<f64>());
            let height = jump.height.abs();
            bound.sampling +=
                height * (1.0 / l + 1.0 / r) / 2.0 / width + jump.slope.abs() / (2.0 * l * r * width);
            bound.depth += 2.0 * height * jitter / width;
        }
        bound
    }

    /// The same as an estimate for exact inputs, by parts: the smooth part and that of the jumps, with the
    /// exact moments of as many cameras as there are.
    pub fn estimate(&self) -> (f64, f64) {
        let sets = |densities: Vec<f64>| PeriodicSets::new(densities.iter().map(|d| 1.0 / d).collect()).ok();
        let smooth = |seen: Seen| {
            let moment = sets(self.densities(seen.curve, seen.u)).map(|s| s.density() * s.moment(3) / 12.0);
            self.derivatives(&seen).1.abs() * moment.unwrap_or(0.0) / NODES as f64
        };
        let jump = |jump: Jump| {
            let sides = sets(jump.front).zip(sets(jump.back));
            jump.height.abs() * sides.map_or(0.0, |(front, back)| jump_error(&front, &back))
        };
        let jumps = self.jumps().into_iter().map(jump).sum::<f64>() / (self.window.1 - self.window.0);
        (self.nodes().map(smooth).sum(), jumps)
    }

    fn jitter_factor(&self, depth_error: f64) -> f64 {
        let of_curve = |scene: &&dyn PaintedCurve| {
            let window = scene.range();
            let rig = FlatRig { scene: *scene, cameras: self.cameras, view: self.view, window };
            rig.jitter_factor(depth_error)
        };
        self.curves.iter().map(of_curve).fold(0.0, f64::max)
    }

    /// The mean absolute error of one view whose phases are drawn from the seed: samples with exact depth,
    /// exact occlusion removal, linear interpolation. `None` if no sample is visible.
    pub fn trial(&self, seed: u64) -> Option<f64> {
        let (random, mut samples) = (&mut seeded(seed), Vec::new());
        for camera in self.cameras {
            let phase = part(random);
            for x in self.pixels(camera, phase) {
                let Some(seen) = self.look(camera, x, None) else { continue };
                if self.sees(&self.view, seen.curve, seen.u) {
                    let c = self.curves[seen.curve].at(seen.u);
                    let x = self.view.see(&c).x;
                    samples.push(Measured { x, value: c.texture[0], error: 0.0, jitter: 0.0 });
                }
            }
        }
        let line = PiecewiseLinear::new(samples).ok()?;
        let miss = |x: f64| {
            let seen = self.look(&self.view, x, None)?;
            Some((line.value(x) - self.curves[seen.curve].at(seen.u).texture[0]).abs())
        };
        let places = self.places().into_iter();
        let misses = places.filter_map(|(x, width)| Some((miss(x)? * width, width)));
        let (sum, width) = misses.fold((0.0, 0.0), |(sum, all), (miss, width)| (sum + miss, all + width));
        Some(sum / width)
    }

    /// Pixels at which a view is compared with the width that each stands for. They lie close together
    /// beside jumps: an even grid would meet the few intervals there at one fixed distance from the jump.
    fn places(&self) -> Vec<(f64, f64)> {
        let (a, b) = self.window;
        let mut cuts = vec![(a, false), (b, false)];
        for jump in self.jumps() {
            let interval = 1.0 / jump.front.iter().sum::<f64>() + 1.0 / jump.back.iter().sum::<f64>();
            let low = (jump.x - BESIDE * interval).max(a);
            cuts.extend([(low, true), ((jump.x + BESIDE * interval).min(b), false)]);
        }
        cuts.sort_by(|p, q| p.0.total_cmp(&q.0));
        let piece = |pair: &[(f64, bool)]| {
            let (from, to) = (pair[0].0, pair[1].0);
            let fine = if pair[0].1 { FINE } else { 0 };
            let count = fine.max((4.0 * NODES as f64 * (to - from) / (b - a)).ceil() as usize);
            let width = (to - from) / count.max(1) as f64;
            (0..count).map(move |k| (from + width * (k as f64 + 0.5), width))
        };
        cuts.windows(2).flat_map(piece).collect()
    }

    /// The pixel centres of a camera that see any curve.
    fn pixels(&self, camera: &FlatCamera, phase: f64) -> impl Iterator<Item = f64> + use<> {
        let ends = self.curves.iter().flat_map(|c| [c.at(c.range().0), c.at(c.range().1)]);
        let seen = ends.map(|end| camera.see(&end).x);
        let (low, high) = seen.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        let first = (low - phase).ceil();
        (0..).map(move |n| first + f64::from(n) + phase).take_while(move |x| *x <= high)
    }
}
