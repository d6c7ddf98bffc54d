//! Holes: pixels of the virtual image that no surviving sample comes near.

/// What becomes of holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HoleFill {
    /// The farther side is continued into the hole: what a moving camera uncovers is background.
    #[default]
    Background,
    /// The fit bridges the hole from side to side.
    Bridge,
    /// Holes stay black.
    Leave,
}

/// What is a hole, and what becomes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleSettings {
    /// Neighbouring samples farther apart than this, in pixels, have a hole between them; a pixel is in
    /// it if no sample lies within half of this.
    pub gap: f64,
    /// What becomes of it.
    pub fill: HoleFill,
}

impl Default for HoleSettings {
    fn default() -> Self {
        Self { gap: 1.5, fill: HoleFill::Background }
    }
}

/// How a pixel of the virtual image came to its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cover {
    /// From samples.
    #[default]
    Seen,
    /// A stretched surface left a hole: the same depth on both sides.
    Crack,
    /// No view saw what is there: the depth differs across the hole, or it reaches the border.
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
