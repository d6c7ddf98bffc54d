//! Holes: pixels of the virtual image without a visible sample nearby.

use crate::occlusion::LARGEST_SPACING;

/// Hole filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
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

/// Definition and filling of holes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleSettings {
    /// Neighbouring samples farther apart than this, in units of their spacing on the surface (at least one
    /// pixel), have a hole between them. A pixel belongs to a hole if no sample lies within half of this
    /// distance.
    pub gap: f64,
    /// Hole filling.
    pub fill: HoleFill,
}

impl HoleSettings {
    /// Distance up to which a sample of this spacing covers pixels.
    #[inline]
    pub(crate) fn reach(&self, spacing: f32) -> f64 {
        self.gap / 2.0 * f64::from(spacing.clamp(1.0, LARGEST_SPACING))
    }
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

/// Rows on each side over which disocclusions are averaged.
const ROWS: usize = 4;

/// Replaces every disoccluded pixel by the mean over the disoccluded pixels near it in its column. Each row
/// fills its holes for itself, and without this the fillings form a comb of teeth one row high.
pub(crate) fn join_rows<const C: usize>(mask: &[Cover], width: usize, values: &mut [f32]) {
    let pixels = values.as_chunks_mut::<C>().0;
    let height = mask.len() / width.max(1);
    // The rows above as they were, the latest ones.
    let mut above = vec![[0.0; C]; width * ROWS.min(height.saturating_sub(1))];
    let kept = |y: usize, x: usize| y % ROWS * width + x;
    for y in 0..height {
        for x in 0..width {
            let here = pixels[y * width + x];
            if mask[y * width + x] == Cover::Disocclusion {
                let (mut sum, mut count) = ([0.0; C], 0.0);
                let rows = y.saturating_sub(ROWS)..(y + ROWS + 1).min(height);
                for row in rows.filter(|row| mask[row * width + x] == Cover::Disocclusion) {
                    let value = if row < y { above[kept(row, x)] } else { pixels[row * width + x] };
                    sum.iter_mut().zip(value).for_each(|(s, v)| *s += v);
                    count += 1.0;
                }
                pixels[y * width + x] = sum.map(|s| s / count);
            }
            if let Some(above) = above.get_mut(kept(y, x)) {
                *above = here;
            }
        }
    }
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
        // A byte counts a short piece, so that the compiler compares many pixels at a time.
        let piece = |kind: Cover, piece: &[Cover]| piece.iter().map(|c| u8::from(*c == kind)).sum::<u8>();
        let count = |kind: Cover| mask.chunks(128).map(|part| usize::from(piece(kind, part))).sum();
        Self { crack: count(Cover::Crack), disocclusion: count(Cover::Disocclusion) }
    }

    /// All pixels in holes.
    pub fn total(&self) -> usize {
        self.crack + self.disocclusion
    }
}
