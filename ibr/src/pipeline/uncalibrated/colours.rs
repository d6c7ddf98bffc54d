//! The order of depth from the photographs themselves.

use super::OrderBy;
use super::reconstruction::Reconstruction;
use super::surface::{Surface, colour_at};
use crate::image::Image;
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::order::Order;

/// Share of the range of chi by which two points lie on different surfaces.
const SURFACES_APART: f64 = 0.2;

/// Largest difference of colours that counts, in grey levels.
const LARGEST_DIFFERENCE: f32 = 60.0;

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
    pub(super) count: usize,
}

impl Advantage {
    pub(super) fn of(images: &[&Image], surfaces: &[Surface], scene: &Reconstruction) -> Self {
        let mut all = Self::default();
        for (from, to) in [(0, 1), (1, 0)] {
            for advantage in advantages(images, &surfaces[from], scene, from, to) {
                all.sum += advantage;
                all.squares += advantage * advantage;
                all.count += 1;
            }
        }
        all
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

/// The colour of a point, and its depth if the order is kept.
type Shown = (f32, [f32; 3]);

/// For each pixel of view `to` on which points of two surfaces of view `from` fall: by how much the one that
/// is nearer if the order is kept has the better colour.
fn advantages(
    images: &[&Image],
    surface: &Surface,
    scene: &Reconstruction,
    from: usize,
    to: usize,
) -> Vec<f64> {
    let size = images[to].size();
    let sign = chirality::order_sign(&scene.cameras[to], Handedness::Kept);
    // The nearest and the farthest point on each pixel.
    let mut ends: Vec<Option<[Shown; 2]>> = vec![None; size.0 * size.1];
    surface.mesh.visit(&surface.places[to], size, |pixel, corner, shares| {
        let place = surface.place_at(from, corner, surface.carried(shares, corner, to, from));
        let Some(colour) = colour_at(images[from], &place) else { return };
        let shown = ((sign * surface.chi_at(to, corner, shares)) as f32, colour);
        let [near, far] = ends[pixel].get_or_insert([shown; 2]);
        if shown.0 < near.0 {
            *near = shown;
        }
        if shown.0 > far.0 {
            *far = shown;
        }
    });
    let apart = surface.chi_apart(to, SURFACES_APART) as f32;
    let advantage = |(pixel, ends): (usize, &Option<[Shown; 2]>)| {
        let [near, far] = (*ends).filter(|[near, far]| far.0 - near.0 > apart)?;
        let own = images[to].pixel::<3>(pixel);
        let miss = |colour: [f32; 3]| {
            let sum: f32 = colour.iter().zip(own).map(|(a, b)| (a - b).abs()).sum();
            (sum / 3.0).min(LARGEST_DIFFERENCE)
        };
        Some(f64::from(miss(far.1) - miss(near.1)))
    };
    ends.iter().enumerate().filter_map(advantage).collect()
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
