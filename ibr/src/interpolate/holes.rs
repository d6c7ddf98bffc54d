//! Holes: pixels of the virtual image without a visible sample nearby.

use crate::occlusion::LARGEST_SPACING;

/// Hole filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
#[non_exhaustive]
pub enum HoleFill {
    /// Continue the farther side into holes between surfaces; bridge cracks within one.
    // A moving camera uncovers background. At the border of the image the nearest pixel is continued.
    #[default]
    Background,
    /// Let the fitted spline bridge all holes.
    Bridge,
    /// Leave holes black.
    Leave,
}

/// Neighbouring samples farther apart than this, in units of their spacing on the surface (at least one
/// pixel), have a hole between them. A pixel belongs to a hole if no sample lies within half of this
/// distance.
pub(super) const GAP: f64 = 1.5;

/// Distance up to which a sample of this spacing covers pixels.
#[inline]
pub(super) fn reach(spacing: f32) -> f64 {
    GAP / 2.0 * f64::from(spacing.clamp(1.0, LARGEST_SPACING))
}

/// Origin of the value of a pixel of the virtual image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cover {
    /// From samples.
    #[default]
    Seen,
    /// From samples of which only a guess says how deep they lie.
    Guessed,
    /// Crack: a hole in a stretched surface, with the same depth on both sides.
    Crack,
    /// Disocclusion: no view saw this region. The depth differs across the hole, or the hole touches the
    /// border.
    Disocclusion,
}

impl Cover {
    /// Whether no sample shows the pixel.
    pub fn is_hole(self) -> bool {
        matches!(self, Self::Crack | Self::Disocclusion)
    }
}

/// Pixels that were not seen, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct HoleCount {
    /// Pixels in cracks.
    pub crack: usize,
    /// Pixels in disocclusions.
    pub disocclusion: usize,
    /// Pixels that only samples of guessed depth show.
    pub guessed: usize,
}

impl HoleCount {
    /// Counts the pixels of a mask.
    pub fn of(mask: &[Cover]) -> Self {
        let count = |kind: Cover| mask.iter().filter(|cover| **cover == kind).count();
        let [crack, disocclusion, guessed] = [Cover::Crack, Cover::Disocclusion, Cover::Guessed].map(count);
        Self { crack, disocclusion, guessed }
    }

    /// All pixels that were not seen.
    pub fn total(&self) -> usize {
        self.crack + self.disocclusion + self.guessed
    }
}
