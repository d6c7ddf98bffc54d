//! The list of propagated samples, which connects the three stages.

use crate::depth::Origin;

/// One pixel of an actual view, seen from the virtual camera; C = 1 (grey) or 3 (RGB).
///
/// Positions are f64; the rest is f32, which keeps the list at 48 bytes per sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<const C: usize> {
    /// Column in the virtual image, in pixels.
    pub x: f64,
    /// Row in the virtual image, in pixels.
    pub y: f64,
    /// Depth key at the virtual camera: smaller is nearer. A depth, a reciprocal disparity (both
    /// positive), or a signed chi of a projective camera.
    pub depth: f32,
    /// Intensity, 0..255.
    pub value: [f32; C],
    /// Distance of neighbouring samples of this view on this surface, in virtual pixels: root mean square
    /// over the two directions of the view. The depth test's radius and the size of holes grow with it.
    pub spacing: f32,
    /// Weight in the fit: the area of the virtual image that the sample stands for (at least 1), less where
    /// depth or colour are doubtful.
    pub weight: f32,
    /// Index of the pixel in its actual view, row by row.
    pub pixel: u32,
    /// Index of the actual view.
    pub view: u16,
    /// Whether the depth is a guess, or the colour may be mixed with that of a nearer surface.
    pub doubtful: bool,
    /// Where the depth comes from.
    pub origin: Origin,
}

#[cfg(test)]
impl<const C: usize> Sample<C> {
    /// A sample at the origin with unit spacing and weight and all other fields 0.
    pub(crate) const BLANK: Self = Self {
        x: 0.0,
        y: 0.0,
        depth: 0.0,
        value: [0.0; C],
        spacing: 1.0,
        weight: 1.0,
        pixel: 0,
        view: 0,
        doubtful: false,
        origin: Origin::Known,
    };
}

/// Pixels that the propagation dropped, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Dropped {
    /// The pixel has no depth.
    pub unknown: usize,
    /// The point lies behind the virtual camera or in its focal plane.
    pub behind: usize,
    /// The point projects farther outside the virtual image than the support of the kernel.
    pub outside: usize,
}

impl std::ops::AddAssign for Dropped {
    fn add_assign(&mut self, other: Self) {
        self.unknown += other.unknown;
        self.behind += other.behind;
        self.outside += other.outside;
    }
}

#[cfg(test)]
mod tests {
    use super::Dropped;

    impl Dropped {
        /// All dropped samples.
        pub(crate) fn total(&self) -> usize {
            self.unknown + self.behind + self.outside
        }
    }
}
