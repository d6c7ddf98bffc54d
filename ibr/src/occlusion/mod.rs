//! Stage two, occlusion removal: a sample behind another one at nearly the same position is removed (thesis
//! 2.3.2).
//!
//! With P the set of propagated samples, x in P is removed if and only if there is a y in P, whose depth was
//! not filled in, with
//!
//! ```text
//! ||x - y||_2 <= epsilon(y)   and   d(x) - d(y) >= sigma(y)
//! ```
//!
//! and the sigma of [`DepthTest`]. Here epsilon(y) = epsilon max(1, spacing(y)). The spacing is the distance
//! between neighbouring samples of one view on the surface of y. A fixed radius is right only where they lie
//! about a pixel apart: where the view magnifies, the balls of a foreground would no longer cover it, and
//! background would show through.
//!
//! Every test is against all of P, not against the samples that are left, so the result does not depend on
//! any order. sigma grows with d(y). Hence if any sample of one radius in the ball hides x, then the nearest
//! one of that radius does, and comparing with the least depth suffices; this also holds in floating point,
//! since both sides are monotone.

mod cells;
mod grid;
mod points;
mod row;

pub use crate::surfaces::DepthTest;
pub(crate) use grid::PlaneSearch;
#[cfg(test)]
pub(crate) use grid::tests::remove;
pub(crate) use points::{Points, RUN};
pub use row::{RowScratch, remove_in_row};

/// Spacing from which on the radius grows no further, in virtual pixels: beyond it a surface is hardly
/// sampled, and its samples would hide what shows between them.
pub const LARGEST_SPACING: f32 = 8.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Origin;
    use crate::sample::Sample;
    use crate::setting::SettingError;

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
        let none = DepthTest { epsilon: 1.0, relative: 0.0, ..DepthTest::default() };
        let test = DepthTest { relative: 0.5, ..none };
        assert!(test.hides(2.0, 3.0) && !test.hides(2.0, 2.9999));
        let test = DepthTest { absolute: 0.5, ..none };
        assert!(test.hides(-1.0, -0.5) && !test.hides(-1.0, -0.51));
        // Disparities of 4 and 2, and of 2 and 0.5 pixels.
        let test = DepthTest { relative: 0.05, parallax: 2.0, ..none };
        assert!(test.hides(0.25, 0.5) && !test.hides(0.25, 0.49) && !test.hides(0.5, 2.0));
    }
}
