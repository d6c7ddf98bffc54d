//! What the depth test needs of samples, as arrays.

use crate::depth::Origin;
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
    /// Whether it may hide others: not where its depth was filled in, and where its view has no share in the
    /// place.
    pub(crate) hides: Vec<bool>,
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
        self.spacing.extend(samples.clone().map(|s| s.spacing));
        self.hides.extend(samples.map(|s| s.origin != Origin::Filled));
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
        self.hides.resize(count, false);
    }
}
