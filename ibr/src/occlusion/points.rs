//! What the depth test needs of samples, as arrays.

use crate::lanes::bounds;
use crate::sample::Sample;

/// Points whose bounds are found together.
pub(crate) const RUN: usize = 8;

/// Positions, depths and spacings of samples, in arrays of one length, a multiple of [`RUN`]: its loops
/// become vector instructions. Neighbours in the arrays should be neighbours in the image.
///
/// A place without a sample has NaN in all numbers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Points {
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) depth: Vec<f32>,
    pub(crate) spacing: Vec<f32>,
    /// Whether the depth test decides on the sample. The others may hide it and are not looked at.
    pub(crate) own: Vec<bool>,
}

impl Points {
    #[cfg(test)]
    pub(crate) fn of<const C: usize>(samples: impl Iterator<Item = Sample<C>> + Clone) -> Self {
        let mut points = Self::default();
        points.set(samples);
        points
    }

    pub(super) fn set<const C: usize>(&mut self, samples: impl Iterator<Item = Sample<C>> + Clone) {
        self.resize(0);
        self.x.extend(samples.clone().map(|s| s.x));
        self.y.extend(samples.clone().map(|s| s.y));
        self.depth.extend(samples.clone().map(|s| s.depth));
        self.spacing.extend(samples.map(|s| s.spacing));
        self.own.resize(self.x.len(), true);
        self.resize(self.x.len().next_multiple_of(RUN));
    }

    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    /// Changes the number of places. New ones have no sample.
    pub(crate) fn resize(&mut self, count: usize) {
        self.x.resize(count, f64::NAN);
        self.y.resize(count, f64::NAN);
        self.depth.resize(count, f32::NAN);
        self.spacing.resize(count, f32::NAN);
        self.own.resize(count, false);
    }

    pub(crate) fn extent(&self) -> Extent {
        let none = (f64::MAX, f64::MIN);
        let ((left, right), (top, bottom)) = (bounds::<_, 2>(&self.x, none), bounds::<_, 2>(&self.y, none));
        Extent { left, right, top, bottom }
    }
}

#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Extent {
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) top: f64,
    pub(crate) bottom: f64,
}

/// Square cells over a rectangle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Raster {
    pub(super) left: f64,
    pub(super) top: f64,
    /// Cells per pixel.
    pub(super) scale: f64,
    pub(super) columns: usize,
    pub(super) rows: usize,
}

impl Raster {
    /// Cells no smaller than `edge`: the edge is doubled until there are at most `most` cells.
    pub(super) fn over(extent: &Extent, edge: f64, most: usize) -> Self {
        let Extent { left, right, top, bottom } = *extent;
        let cells = |edge: f64| ((right - left) / edge + 1.0) * ((bottom - top) / edge + 1.0);
        let mut edge = edge;
        // The doubling ends at the latest when one cell holds all samples; positions may be infinite.
        while cells(edge) > most as f64 && edge.is_finite() {
            edge *= 2.0;
        }
        let scale = 1.0 / edge;
        let count = |low: f64, high: f64| ((high - low) * scale) as usize + 1;
        Self { left, top, scale, columns: count(left, right), rows: count(top, bottom) }
    }

    #[inline]
    pub(super) fn cell(&self, x: f64, y: f64) -> (usize, usize) {
        (((x - self.left) * self.scale) as usize, ((y - self.top) * self.scale) as usize)
    }
}
