//! The order of depth from the photographs themselves.

use super::OrderBy;
use super::consistency::Surface;
use super::reconstruction::Reconstruction;
use super::synthesis::{chi_range, propagate_chi};
use crate::image::Image;
use crate::pipeline::RenderError;
use crate::propagate::Frame;
use crate::sample::Sample;
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::order::Order;

/// Share of the range of chi by which two points lie on different surfaces.
const SURFACES_APART: f64 = 0.2;

/// Largest difference of colours that counts, in grey levels.
const LARGEST_DIFFERENCE: f32 = 60.0;

/// Fewest pixels for a verdict.
const FEWEST_PIXELS: usize = 40;

/// Standard deviations of a verdict against guessed calibrations. Neighbouring pixels err together, so
/// they are many.
const DEVIATIONS_ALONE: f64 = 8.0;

/// Standard deviations of a verdict that guessed calibrations share, or of an objection against them.
const DEVIATIONS_TOGETHER: f64 = 5.0;

/// Mean advantage of a verdict, in grey levels: folds of the meshes at outlines favour one order by less.
const LEAST_ADVANTAGE: f64 = 10.0;

/// How much better the colours fit if the order is kept, over all pixels on which two surfaces fall.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Advantage {
    sum: f64,
    squares: f64,
    /// Pixels.
    pub(super) count: usize,
}

impl Advantage {
    /// From both photographs of the base pair.
    pub(super) fn of(
        images: &[&Image],
        surfaces: &[Surface],
        scene: &Reconstruction,
    ) -> Result<Self, RenderError> {
        let mut all = Self::default();
        for (from, to) in [(0, 1), (1, 0)] {
            for advantage in advantages(images, &surfaces[from], scene, from, to)? {
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

    /// The order of depth by the photographs and the guessed calibrations. Each of them errs now and
    /// then, the ones by folded meshes and the others by principal points beside the middle, so a verdict
    /// of 5 deviations needs both. Weaker hints of both together were wrong in 3 of 100 cropped pairs.
    pub(super) fn order(&self, guess: &Order) -> (Handedness, OrderBy) {
        let shown = if self.sum > 0.0 { Handedness::Kept } else { Handedness::Reversed };
        let clear = self.count >= FEWEST_PIXELS && self.mean().abs() >= LEAST_ADVANTAGE;
        let (deviations, agree) = (self.deviations().abs(), shown == guess.hand);
        let firm = clear && deviations >= DEVIATIONS_TOGETHER;
        if clear && deviations >= DEVIATIONS_ALONE {
            (shown, OrderBy::Colours)
        } else if agree && firm {
            (shown, OrderBy::Both)
        } else if guess.is_decided() && !firm {
            (guess.hand, OrderBy::Calibrations)
        } else {
            (guess.hand, OrderBy::Nothing)
        }
    }
}

/// A pixel on which no sample falls.
const NO_SAMPLE: u32 = u32::MAX;

/// For each pixel of view `to` on which points of two surfaces of view `from` fall: by how much the one that
/// is nearer if the order is kept has the better colour.
fn advantages(
    images: &[&Image],
    surface: &Surface,
    scene: &Reconstruction,
    from: usize,
    to: usize,
) -> Result<Vec<f64>, RenderError> {
    let source = scene.camera(from)?;
    let target = scene.camera(to)?;
    let chi = surface.chi(images[from].size());
    let (width, height) = images[to].size();
    let sign = chirality::order_sign(&scene.cameras[to], Handedness::Kept);
    let mut samples: Vec<Sample<3>> = Vec::with_capacity(chi.len());
    let frame = Frame::whole(width, height, 0.0, 0.0);
    propagate_chi(images[from], &chi, 0, &source.relative_to(&target), sign, &frame, |sample| {
        samples.push(sample)
    });
    let apart = (SURFACES_APART * chi_range(&scene.features(to))) as f32;
    drop(chi);
    // The nearest and the farthest sample on each pixel, by number.
    let mut ends = vec![[NO_SAMPLE; 2]; width * height];
    for (number, s) in samples.iter().enumerate() {
        let p = (s.y + 0.5) as usize * width + (s.x + 0.5) as usize;
        let Some([near, far]) = ends.get_mut(p) else { continue };
        let depth = |number: u32| samples.get(number as usize).map(|s| s.depth);
        if depth(*near).is_none_or(|near| s.depth < near) {
            *near = number as u32;
        }
        if depth(*far).is_none_or(|far| s.depth > far) {
            *far = number as u32;
        }
    }
    let advantage = |(p, ends): (usize, &[u32; 2])| {
        let [near, far] = ends.map(|number| samples.get(number as usize));
        let (near, far) = near.zip(far).filter(|(near, far)| far.depth - near.depth > apart)?;
        let shown = images[to].pixel::<3>(p);
        let miss = |s: &Sample<3>| {
            let sum: f32 = s.value.iter().zip(shown).map(|(a, b)| (a - b).abs()).sum();
            (sum / 3.0).min(LARGEST_DIFFERENCE)
        };
        Some(f64::from(miss(far) - miss(near)))
    };
    Ok(ends.iter().enumerate().filter_map(advantage).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` pixels of which all but one in eight favour the order by 20 grey levels.
    fn advantage(count: usize, sign: f64) -> Advantage {
        let one = |i: usize| if i.is_multiple_of(8) { -20.0 } else { 20.0 } * sign;
        let sum = (0..count).map(one).sum();
        Advantage { sum, squares: 400.0 * count as f64, count }
    }

    #[test]
    fn photographs_and_calibrations_decide_together() {
        let guess = |hand, agreement| Order { hand, agreement };
        let (kept, reversed) = (Handedness::Kept, Handedness::Reversed);
        let (many, some, few) = (advantage(400, 1.0), advantage(64, 1.0), advantage(24, 1.0));
        assert!(
            many.deviations() > DEVIATIONS_ALONE
                && some.deviations() < DEVIATIONS_ALONE
                && some.deviations() > DEVIATIONS_TOGETHER
        );
        assert_eq!(many.order(&guess(reversed, 1.0)), (kept, OrderBy::Colours));
        assert_eq!(some.order(&guess(kept, 0.6)), (kept, OrderBy::Both));
        assert_eq!(some.order(&guess(reversed, 0.99)), (reversed, OrderBy::Nothing));
        assert_eq!(few.order(&guess(kept, 0.9)), (kept, OrderBy::Nothing));
        assert_eq!(few.order(&guess(reversed, 0.99)), (reversed, OrderBy::Calibrations));
        let none = Advantage::default();
        assert_eq!(none.order(&guess(reversed, 0.99)), (reversed, OrderBy::Calibrations));
        assert_eq!(none.order(&guess(reversed, 0.9)), (reversed, OrderBy::Nothing));
    }
}
