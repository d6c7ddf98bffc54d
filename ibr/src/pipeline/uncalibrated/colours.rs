//! The order of depth from the photographs themselves.

use super::reconstruction::Reconstruction;
use super::synthesis::{camera, chi_range, features, propagate_chi};
use crate::image::Image;
use crate::pipeline::RenderError;
use crate::propagate::Frame;
use crate::sample::Sample;
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::mesh;

/// Share of the range of chi by which two points lie on different surfaces.
const APART: f64 = 0.2;

/// Largest difference of colours that counts, in grey levels.
const LARGEST: f32 = 60.0;

/// Fewest pixels for a verdict.
const FEWEST: usize = 40;

/// Standard deviations that a verdict needs. Neighbouring pixels err together, so they are many.
const DEVIATIONS: f64 = 5.0;

/// Mean advantage that a verdict needs, in grey levels: folds of the meshes at outlines favour one order by
/// less.
const LEAST: f64 = 12.0;

/// How much better the colours fit if the order is kept, over all pixels on which two surfaces fall.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Advantage {
    sum: f64,
    squares: f64,
    count: usize,
}

impl Advantage {
    /// From both photographs of the base pair.
    pub(super) fn of(images: &[&Image], scene: &Reconstruction) -> Result<Self, RenderError> {
        let mut all = Self::default();
        for (from, to) in [(0, 1), (1, 0)] {
            for advantage in advantages(images, scene, from, to)? {
                all.sum += advantage;
                all.squares += advantage * advantage;
                all.count += 1;
            }
        }
        Ok(all)
    }

    /// Mean over the pixels in grey levels, positive if the order is kept.
    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    /// The sum in standard deviations.
    pub(super) fn deviations(&self) -> f64 {
        self.sum / self.squares.max(f64::MIN_POSITIVE).sqrt()
    }

    /// Pixels.
    pub(super) fn pixels(&self) -> usize {
        self.count
    }

    /// The order under which the photographs show the nearer of two points that fall on one of their pixels.
    /// `None` if there are few such pixels, or both orders fit alike: then it hardly matters.
    pub(super) fn order(&self) -> Option<Handedness> {
        let sure = self.deviations().abs() >= DEVIATIONS && self.mean().abs() >= LEAST;
        let hand = if self.sum > 0.0 { Handedness::Kept } else { Handedness::Reversed };
        (self.pixels() >= FEWEST && sure).then_some(hand)
    }
}

/// For each pixel of view `to` on which points of two surfaces of view `from` fall: by how much the one that
/// is nearer if the order is kept has the better colour.
fn advantages(
    images: &[&Image],
    scene: &Reconstruction,
    from: usize,
    to: usize,
) -> Result<Vec<f64>, RenderError> {
    let source = camera(&scene.cameras[from], || scene.name(from))?;
    let target = camera(&scene.cameras[to], || scene.name(to))?;
    let known = features(scene, from);
    let chi = mesh::dense_chi(&known, images[from].size());
    let (width, height) = images[to].size();
    let sign = chirality::order_sign(&scene.cameras[to], Handedness::Kept);
    let mut samples: Vec<Sample<3>> = Vec::new();
    let frame = Frame::whole(width, height, 0.0, 0.0);
    propagate_chi(images[from], &chi, 0, &source.relative_to(&target), sign, &frame, &mut samples);
    let apart = (APART * chi_range(&features(scene, to))) as f32;
    let mut ends: Vec<Option<(Sample<3>, Sample<3>)>> = vec![None; width * height];
    for s in samples {
        let p = (s.y + 0.5) as usize * width + (s.x + 0.5) as usize;
        let Some(slot) = ends.get_mut(p) else { continue };
        *slot = Some(match *slot {
            None => (s, s),
            Some((near, far)) => {
                (if s.depth < near.depth { s } else { near }, if s.depth > far.depth { s } else { far })
            }
        });
    }
    let advantage = |(p, slot): (usize, &Option<(Sample<3>, Sample<3>)>)| {
        let (near, far) = slot.as_ref().filter(|(near, far)| far.depth - near.depth > apart)?;
        let shown = images[to].pixel::<3>(p);
        let miss = |s: &Sample<3>| {
            let sum: f32 = s.value.iter().zip(shown).map(|(a, b)| (a - b).abs()).sum();
            (sum / 3.0).min(LARGEST)
        };
        Some(f64::from(miss(far) - miss(near)))
    };
    Ok(ends.iter().enumerate().filter_map(advantage).collect())
}
