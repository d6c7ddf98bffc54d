//! What separates surfaces: the rule that hiding, relief, springs, holes, votes and agreement share.
//!
//! Two depths lie on different surfaces if their difference shows, by a share of the depth or by pixels of
//! parallax, and if errors of the depths do not explain it.

use crate::depth::{DepthMap, Measure};
use crate::occlusion::LARGEST_SPACING;
use crate::setting::{NOT_NEGATIVE, POSITIVE, SettingError};

/// Share of the nearer depth that separates two surfaces.
pub(crate) const JUMP: f32 = 0.05;

/// Pixels of parallax between the virtual view and the nearest photograph that separate two surfaces, also
/// where they are a smaller share of the depth: a roof below a drone. Neighbours on slanted surfaces differ
/// by as much: with one pixel ground that is seen at a flat angle loses 0.6 dB.
const PARALLAX: f64 = 2.0;

/// Pixels by which disparities of one point in two maps may differ.
const ROUNDED: f64 = 1.0;

/// The condition under which one sample hides another, and lies on another surface.
///
/// ```text
/// d(x) - d(y) >= sigma(y) = d(y) max(min(relative, pixel d(y)), noise) + absolute,
/// 1 / d(y) - 1 / d(x) >= parallax
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthTest {
    /// Radius of the neighbourhood in virtual pixels, where samples lie a pixel apart or closer; elsewhere
    /// it grows with their spacing.
    pub epsilon: f64,
    /// Share of the nearer depth that the difference must reach; needs positive depths.
    pub relative: f64,
    /// Absolute part of the difference that must be reached.
    pub absolute: f64,
    /// Difference of reciprocal depths, that is of disparities, that suffices in place of `relative`;
    /// infinite if none does.
    pub pixel: f64,
    /// Share of the nearer depth that errors of depths explain.
    pub noise: f64,
    /// Difference of the reciprocal depths that errors of disparities explain; needs positive depths if it
    /// is not 0.
    pub parallax: f64,
}

impl Default for DepthTest {
    /// 5 % of the nearer depth within 0.7 px: the samples of one camera on a surface lie about a pixel
    /// apart, so a hidden sample nearly always has a nearer one in its ball; below 1 px neighbouring rows
    /// do not interact.
    fn default() -> Self {
        let (pixel, relative) = (f64::INFINITY, 0.05);
        Self { epsilon: 0.7, relative, absolute: 0.0, pixel, noise: 0.0, parallax: 0.0 }
    }
}

impl DepthTest {
    /// Refuses settings outside their range: with a difference of zero every sample would hide itself.
    ///
    /// # Errors
    /// [`SettingError`].
    pub fn check(&self) -> Result<(), SettingError> {
        POSITIVE.check("epsilon", self.epsilon)?;
        NOT_NEGATIVE.check("relative depth difference", self.relative)?;
        NOT_NEGATIVE.check("absolute depth difference", self.absolute)?;
        NOT_NEGATIVE.check("noise of depths", self.noise)?;
        NOT_NEGATIVE.check("parallax", self.parallax)?;
        POSITIVE.check("difference of a pixel", self.pixel.min(f64::MAX))?;
        POSITIVE.check("sum of relative and absolute depth difference", self.relative + self.absolute)
    }

    /// The test for photographs of which the nearest is displaced by so many pixels against the virtual view
    /// per reciprocal depth.
    pub(crate) fn over(self, displacement: f64) -> Self {
        Self { pixel: self.pixel.min(PARALLAX / displacement), ..self }
    }

    /// The least difference to a depth that separates surfaces. It grows with the depth.
    #[inline]
    pub(crate) fn sigma(&self, near: f64) -> f64 {
        let shown = self.pixel * near;
        let share = if shown < self.relative { shown } else { self.relative };
        (if share < self.noise { self.noise } else { share }) * near + self.absolute
    }

    /// Whether a sample of depth `near` hides one of depth `far` at the same position.
    #[inline]
    pub fn hides(&self, near: f64, far: f64) -> bool {
        // 1 / near - 1 / far >= parallax without a division, monotone in both depths.
        (far - near >= self.sigma(near)) & (far * (1.0 - self.parallax * near) >= near)
    }

    /// The least difference between two disparities that separates surfaces, of which the smaller one with
    /// the offset of its map is `far`: a share of the nearer depth is the same share of the smaller
    /// disparity.
    #[inline(always)]
    pub(crate) fn jump(&self, far: f32) -> f32 {
        let (share, pixel, noise) = (self.relative as f32 * far, self.pixel as f32, self.parallax as f32);
        let shown = if share < pixel { share } else { pixel };
        if shown > noise { shown } else { noise }
    }

    /// Whether two parallaxes, to which `offset` is added, lie on one surface.
    #[inline]
    pub(crate) fn joins(&self, a: f32, b: f32, offset: f32) -> bool {
        (a - b).abs() <= self.jump(a.min(b) + offset)
    }

    /// Whether two values of maps like this one are those of one point.
    pub(crate) fn are_one_point(a: f32, b: f32, map: &DepthMap) -> bool {
        let measure = map.measure();
        let parallax = if measure == Measure::Disparity { ROUNDED } else { 0.0 };
        let test = Self { parallax, ..Self::default() };
        test.joins(measure.parallax(a), measure.parallax(b), map.offset() as f32)
    }

    /// 1 / (1 + (D / sigma)^2) for the range D of some depths: the share of a spring between them.
    #[inline]
    pub(crate) fn share(&self, near: f32, far: f32) -> f32 {
        let range = far - near;
        if range > 0.0 {
            let sigma = self.sigma(f64::from(near)) as f32;
            sigma * sigma / (sigma * sigma + range * range)
        } else {
            // One depth, or none is known.
            1.0
        }
    }

    /// The radius within which a sample of this spacing hides others: epsilon max(1, spacing).
    ///
    /// On a grid of spacing s every point lies within s / sqrt(2) of a sample, so with epsilon = 0.7 a
    /// surface is opaque at any magnification.
    #[inline]
    pub fn radius(&self, spacing: f32) -> f64 {
        self.epsilon * f64::from(spacing.clamp(1.0, LARGEST_SPACING))
    }

    /// Whether two positions lie within `radius` of each other.
    #[inline]
    pub fn close(dx: f64, dy: f64, radius: f64) -> bool {
        dx * dx + dy * dy <= radius * radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A roof of 4 m below a drone at 100 m, and photographs 10 m apart with a focal length of 1000 pixels.
    #[test]
    fn parallax_separates_what_is_a_small_share_of_the_depth() {
        let test = DepthTest::default();
        assert!(!test.hides(96.0, 100.0));
        let seen = test.over(10_000.0);
        assert!(seen.hides(96.0, 100.0) && !seen.hides(98.5, 100.0) && seen.hides(50.0, 52.5));
        assert_eq!(test.over(0.0), test);
        // Errors of depths explain as much.
        assert!(!DepthTest { noise: 0.045, ..seen }.hides(96.0, 100.0));
    }

    /// Depths and their reciprocals have one rule.
    #[test]
    fn parallaxes_are_joined_as_depths_are() {
        for pixel in [f64::INFINITY, 2e-4] {
            let test = DepthTest { pixel, ..DepthTest::default() };
            for (near, far) in (1..400).map(|k| (90.0, 90.0 + 0.0251 * f64::from(k))) {
                let share = (far - near) / test.sigma(near);
                let joined = test.joins((1.0 / near) as f32, (1.0 / far) as f32, 0.0);
                // A pixel is 2 % more of the nearer depth than of both.
                assert!(if joined { share < 1.03 } else { share > 0.999 }, "{pixel} {far}: {share} {joined}");
            }
        }
    }

    #[test]
    fn springs_halve_at_sigma() {
        let test = DepthTest::default();
        assert_eq!((test.share(4.0, 4.0), test.share(f32::NAN, 4.0)), (1.0, 1.0));
        assert!((test.share(4.0, 4.2) - 0.5).abs() < 1e-5);
    }
}
