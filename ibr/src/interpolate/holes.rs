//! Holes: pixels of the virtual image without a visible sample nearby.

/// Hole filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HoleFill {
    /// Continue the farther side into the hole, since a moving camera uncovers background.
    #[default]
    Background,
    /// Let the fit interpolate between the sides.
    Bridge,
    /// Leave holes black.
    Leave,
}

/// Definition and filling of holes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleSettings {
    /// Neighbouring samples farther apart than this, in pixels, have a hole between them. A pixel belongs to
    /// a hole if no sample lies within half of this distance.
    pub gap: f64,
    /// Hole filling.
    pub fill: HoleFill,
}

impl Default for HoleSettings {
    fn default() -> Self {
        Self { gap: 1.5, fill: HoleFill::Background }
    }
}

/// Origin of the value of a pixel of the virtual image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cover {
    /// From samples.
    #[default]
    Seen,
    /// Crack: a hole in a stretched surface, with the same depth on both sides.
    Crack,
    /// Disocclusion: no view saw this region. The depth differs across the hole, or the hole touches the
    /// border.
    Disocclusion,
}

/// Pixels in holes, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct HoleCount {
    /// Pixels in cracks.
    pub crack: usize,
    /// Pixels in disocclusions.
    pub disocclusion: usize,
}

impl HoleCount {
    /// Counts the holes of a mask.
    pub fn of(mask: &[Cover]) -> Self {
        let count = |kind: Cover| mask.iter().filter(|c| **c == kind).count();
        Self { crack: count(Cover::Crack), disocclusion: count(Cover::Disocclusion) }
    }

    /// All pixels in holes.
    pub fn total(&self) -> usize {
        self.crack + self.disocclusion
    }
}
