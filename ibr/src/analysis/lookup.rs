//! The local limit of a view: what the photographs show at the places of its pixels.
//!
//! The influences h_s of the samples on a pixel of the fit are not computed. They are taken to be positive
//! with the sum one, to balance, and to have a second moment of half a square pixel along each axis. Then
//! the limit is
//!
//! ```text
//! |J - f| <= E + |f'| m + (1/4) (|f_xx| + |f_yy|)
//! ```
//!
//! E is the largest residual |J - v_s| nearby, which is found by looking pixels up in every photograph that
//! shows their depth. m is the displacement of the sample under an error of depth of three standard
//! deviations. Slopes and second differences are those of the photographs nearby, per pixel of the virtual
//! view.

use crate::depth::Measure;
use crate::pipeline::{Rendering, same_depth};
use crate::propagate::{View, Viewpoint};
use rayon::prelude::*;

/// Pixels to each side over which local suprema are taken.
const NEAR: usize = 3;

/// Errors of depth reach this many standard deviations.
const TAIL: f64 = 3.0;

/// The limit and the bound of a pixel that no view shows.
pub(super) const UNSEEN: f32 = 255.0;

/// What the photographs show at a pixel: the largest over views and channels, in grey levels per virtual
/// pixel.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    residual: f32,
    slope: f32,
    curvature: f32,
    /// Largest displacement by errors of depth, in pixels; not a number where no view shows the pixel.
    moved: f32,
}

impl Shown {
    const NOTHING: Self = Self { residual: 0.0, slope: 0.0, curvature: 0.0, moved: f32::NAN };

    fn largest(self, other: Self) -> Self {
        Self {
            residual: self.residual.max(other.residual),
            slope: self.slope.max(other.slope),
            curvature: self.curvature.max(other.curvature),
            moved: self.moved.max(other.moved),
        }
    }
}

/// The local limit of every pixel, in grey levels; `noise` is the standard deviation of the errors of
/// disparities, or of depths as shares of them.
pub(super) fn local_limits<P: Viewpoint>(
    views: &[View<'_, P>],
    camera: &P,
    rendering: &Rendering,
    noise: f64,
) -> Vec<f32> {
    let ((width, height), deviation) = (rendering.image.size(), TAIL * noise);
    let at = |p: usize| {
        let all = views.iter().filter_map(|view| Lookup { view, camera, rendering, deviation }.at(p));
        all.fold(Shown::NOTHING, Shown::largest)
    };
    let shown: Vec<Shown> = (0..width * height).into_par_iter().map(at).collect();
    let nearby = largest_nearby(&shown, (width, height));
    let limit = |p: usize| {
        if rendering.mask[p].is_hole() || shown[p].moved.is_nan() {
            return UNSEEN;
        }
        let Shown { residual, slope, curvature, .. } = nearby[p];
        (residual + slope * shown[p].moved + curvature / 4.0).min(UNSEEN)
    };
    (0..width * height).map(limit).collect()
}

/// The largest over windows of 7 x 7 pixels, smaller at the border.
fn largest_nearby(shown: &[Shown], (width, height): (usize, usize)) -> Vec<Shown> {
    let range = |at: usize, side: usize| at.saturating_sub(NEAR)..(at + NEAR + 1).min(side);
    let largest = |all: &mut dyn Iterator<Item = Shown>| all.fold(Shown::default(), Shown::largest);
    let of_rows: Vec<Shown> = (0..width * height)
        .map(|p| largest(&mut range(p % width, width).map(|x| shown[p / width * width + x])))
        .collect();
    let of_columns =
        |p: usize| largest(&mut range(p / width, height).map(|y| of_rows[y * width + p % width]));
    (0..width * height).map(of_columns).collect()
}

/// A view in which the pixels of a rendering are looked up.
struct Lookup<'a, P> {
    view: &'a View<'a, P>,
    camera: &'a P,
    rendering: &'a Rendering,
    deviation: f64,
}

impl<P: Viewpoint> Lookup<'_, P> {
    /// What the view shows at a pixel; nothing if it does not see its point.
    fn at(&self, p: usize) -> Option<Shown> {
        let width = self.rendering.image.width();
        let (x, y) = ((p % width) as f64, (p / width) as f64);
        let depth = f64::from(self.rendering.depth.data()[p]);
        let there = self.camera.map_to(&self.view.camera);
        let (u, v, d) = there(x, y, depth);
        if !self.shows(u, v, d) {
            return None;
        }
        let moved = match self.view.map.measure() {
            Measure::Disparity => d + self.deviation,
            Measure::Depth => d * (1.0 + self.deviation),
        };
        let (a, b, _) = self.view.camera.map_to(self.camera)(u, v, moved);
        let mut shown = Shown { moved: (a - x).hypot(b - y) as f32, ..Shown::default() };
        let image = self.view.image;
        let steps = [(0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)];
        let places = steps.map(|(dx, dy)| there(x + dx, y + dy, depth));
        for channel in 0..image.channels() {
            let values = places.map(|(u, v, _)| image.value_at(u, v, channel));
            if values.iter().any(|value| value.is_nan()) {
                return None;
            }
            let [here, left, right, up, down] = values;
            let rendered = self.rendering.image.data()[p * image.channels() + channel];
            let steps = [here - left, right - here, here - up, down - here].map(f32::abs);
            let curvature = (left - 2.0 * here + right).abs() + (up - 2.0 * here + down).abs();
            let slope = steps[0].max(steps[1]).hypot(steps[2].max(steps[3]));
            shown = shown.largest(Shown { residual: (rendered - here).abs(), slope, curvature, moved: 0.0 });
        }
        Some(shown)
    }

    /// Whether the map has this depth around a place.
    fn shows(&self, u: f64, v: f64, d: f64) -> bool {
        let map = self.view.map;
        let (width, height) = map.size();
        let inside = u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0;
        // Also false for unknown depths.
        inside && same_depth(d as f32, map.row(v.round() as usize)[u.round() as usize], map)
    }
}
