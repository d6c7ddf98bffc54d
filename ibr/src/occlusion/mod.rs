//! Stage two, occlusion removal: a sample behind another one at nearly the same position is removed (thesis
//! 2.3.2).
//!
//! With P the set of propagated samples, x in P is removed if and only if there is a y in P, whose depth was
//! not filled in, with
//!
//! ```text
//! ||x - y||_2 <= epsilon(y)   and   d(x) - d(y) >= sigma(y),   sigma(y) = relative d(y) + absolute
//! ```
//!
//! and, where depths have errors, 1 / d(y) - 1 / d(x) >= parallax. Here epsilon(y) = epsilon max(1,
//! spacing(y)). The spacing is the distance between neighbouring samples of one view on the surface of y. A
//! fixed radius is right only where they lie about a pixel apart: where the view magnifies, the balls of a
//! foreground would no longer cover it, and background would show through.
//!
//! Every test is against all of P, not against the samples that are left, so the result does not depend on
//! any order. sigma grows with d(y). Hence if any sample of one radius in the ball hides x, then the nearest
//! one of that radius does, and comparing with the least depth suffices; this also holds in floating point,
//! since both sides are monotone.

mod cells;
mod grid;
mod points;
mod row;

pub(crate) use grid::PlaneSearch;
#[cfg(test)]
pub(crate) use grid::tests::remove;
pub(crate) use points::{Points, RUN};
pub use row::{RowScratch, remove_in_row};

use crate::setting::{NOT_NEGATIVE, POSITIVE, SettingError};

/// Spacing from which on the radius grows no further, in virtual pixels: beyond it a surface is hardly
/// sampled, and its samples would hide what shows between them.
pub const LARGEST_SPACING: f32 = 8.0;

/// The condition under which one sample hides another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthTest {
    /// Radius of the neighbourhood in virtual pixels, where samples lie a pixel apart or closer; elsewhere
    /// it grows with their spacing.
    pub epsilon: f64,
    /// Share of the nearer depth that the difference must reach; needs positive depths.
    pub relative: f64,
    /// Absolute part of the difference that must be reached.
    pub absolute: f64,
    /// Least difference of the reciprocal depths, that is of disparities; needs positive depths if it is not
    /// 0.
    pub parallax: f64,
}

impl Default for DepthTest {
    /// 5 % of the nearer depth within 0.7 px: the samples of one camera on a surface lie about a pixel
    /// apart, so a hidden sample nearly always has a nearer one in its ball; below 1 px neighbouring rows
    /// do not interact.
    fn default() -> Self {
        Self { epsilon: 0.7, relative: 0.05, absolute: 0.0, parallax: 0.0 }
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
        NOT_NEGATIVE.check("parallax", self.parallax)?;
        POSITIVE.check("sum of relative and absolute depth difference", self.relative + self.absolute)
    }

    /// Whether a sample of depth `near` hides one of depth `far` at the same position.
    #[inline]
    pub fn hides(&self, near: f64, far: f64) -> bool {
        // 1 / near - 1 / far >= parallax without a division, monotone in both depths.
        (far - near >= self.relative * near + self.absolute) & (far * (1.0 - self.parallax * near) >= near)
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
    use crate::depth::Origin;
    use crate::sample::Sample;

    impl DepthTest {
        /// The definition, sample against sample, O(n^2): the oracle of the fast routines.
        pub(crate) fn hidden_by_definition<const C: usize>(&self, samples: &[Sample<C>]) -> Vec<bool> {
            let hidden = |x: &Sample<C>| {
                samples.iter().any(|y| {
                    y.origin != Origin::Filled
                        && Self::close(x.x - y.x, x.y - y.y, self.radius(y.spacing))
                        && self.hides(f64::from(y.depth), f64::from(x.depth))
                })
            };
            samples.iter().map(hidden).collect()
        }
    }

    #[test]
    fn senseless_tests_are_refused() {
        let test = DepthTest::default();
        assert!(test.check().is_ok());
        for epsilon in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let broken = DepthTest { epsilon, ..test };
            assert!(matches!(broken.check(), Err(SettingError { name: "epsilon", .. })));
        }
        for (relative, absolute) in [(0.0, 0.0), (-0.1, 1.0), (0.1, -1.0), (f64::NAN, 1.0)] {
            let broken = DepthTest { relative, absolute, ..test };
            let name = broken.check().unwrap_err().name;
            assert!(name.ends_with("depth difference"), "{relative} {absolute}: {name}");
        }
    }

    #[test]
    fn the_threshold_itself_hides() {
        let none = DepthTest { epsilon: 1.0, relative: 0.0, absolute: 0.0, parallax: 0.0 };
        let test = DepthTest { relative: 0.5, ..none };
        assert!(test.hides(2.0, 3.0) && !test.hides(2.0, 2.9999));
        let test = DepthTest { absolute: 0.5, ..none };
        assert!(test.hides(-1.0, -0.5) && !test.hides(-1.0, -0.51));
        // Disparities of 4 and 2, and of 2 and 0.5 pixels.
        let test = DepthTest { relative: 0.05, parallax: 2.0, ..none };
        assert!(test.hides(0.25, 0.5) && !test.hides(0.25, 0.49) && !test.hides(0.5, 2.0));
    }
}
