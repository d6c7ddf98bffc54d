//! Depth and disparity maps: one value per pixel, NaN where unknown.

mod fill;
mod mesh;
mod relief;

use crate::lanes::bounds;
use crate::setting::{PIXELS, SCALE, STEP, SettingError};
pub(crate) use fill::fill_empty_rows;
pub use fill::fill_unknown;
pub(crate) use fill::{NONE, for_holes};
pub(crate) use mesh::Mesh;
pub(crate) use relief::{Reliefs, TILE};

/// The quantity that a map holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Pixels of disparity for a baseline of one: larger is nearer.
    Disparity,
    /// Depth along the optical axis: smaller is nearer.
    Depth,
}

impl Measure {
    /// A value as parallax, disparity or reciprocal depth, which is affine on planes.
    #[inline]
    pub(crate) fn parallax(self, value: f32) -> f32 {
        if self == Self::Disparity { value } else { 1.0 / value }
    }

    #[inline]
    pub(crate) fn of_parallax(self, parallax: f32) -> f32 {
        if self == Self::Disparity {
            parallax
        } else {
            or_far(f64::from(1.0 / parallax.max(1.0 / FAR))) as f32
        }
    }
}

/// Errors of depth maps.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DepthError {
    /// The scale that turns stored numbers into depth, the offset of the disparities, or the step between
    /// depth samples is outside its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A map does not fit its image.
    #[error(
        "the map has {} x {} values, the image {} x {} pixels; with step {step} the map must have {} x {}",
        map.0, map.1, image.0, image.1, expected.0, expected.1
    )]
    Size {
        /// Width and height of the map.
        map: (usize, usize),
        /// Width and height of the image.
        image: (usize, usize),
        /// Pixels from one value of the map to the next.
        step: usize,
        /// Width and height that would fit.
        expected: (usize, usize),
    },
    /// All values of the map are unknown.
    #[error("none of the {values} values is a usable number: without any depth nothing can be rendered")]
    AllUnknown {
        /// Values in the map.
        values: usize,
    },
    /// No depth of the map is positive.
    #[error(
        "none of the {values} depths is positive, and {negative} are negative: depths grow away from the camera; change their sign"
    )]
    Negative {
        /// Depths in the map.
        values: usize,
        /// Those below 0.
        negative: usize,
    },
}

/// The depth of what is infinitely far away, in every map and at every camera. It is finite, so that such
/// points have a place in other views: with a baseline of 1000 units and a focal length of 10,000 pixels
/// they miss it by a ten thousandth of a pixel.
pub const FAR: f32 = 1e11;

/// Depths from here on are [`FAR`]: renderers write 1e10 where they see nothing, and a point that is far
/// away from one camera has at another one its depth times the cosine of an angle between their axes.
const FAR_FROM: f32 = 5e9;

/// A depth along the axis of another camera: what is far away is so for all cameras.
#[inline]
pub(crate) fn or_far(depth: f64) -> f64 {
    if depth >= f64::from(FAR_FROM) { f64::from(FAR) } else { depth }
}

/// Largest share of the pixels that have scattered values; with more a map is one with holes.
const MOST_SCATTERED: f64 = 0.5;

/// Where a depth comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Origin {
    /// The map has it.
    #[default]
    Known,
    /// The map has an outlier there; its neighbours gave this value.
    Replaced,
    /// It was unknown, and its neighbours gave it. It hides nothing.
    Filled,
}

impl Origin {
    /// Whether its neighbours gave it.
    pub fn is_guess(self) -> bool {
        self != Self::Known
    }
}

/// A map of depths or disparities with NaN for unknown. Known depths are positive, and [`FAR`] at most;
/// known disparities are finite, and negative behind the point at which converged cameras look.
#[derive(Debug, Clone)]
pub struct DepthMap {
    width: usize,
    height: usize,
    measure: Measure,
    data: Vec<f32>,
    /// Added to a disparity, it gives a positive number in inverse proportion to depth; 0 for depths.
    offset: f64,
    /// Where the values come from; empty if the map has all of them.
    origins: Vec<Origin>,
}

impl DepthMap {
    /// A map from stored numbers: value / scale. 0 and subnormal numbers and NaN are unknown; so are
    /// negative depths, and negative disparities if all of them are one number, which then is a mark. Depths
    /// of positive infinity are [`FAR`] away, and infinite disparities are unknown.
    ///
    /// # Errors
    /// [`DepthError::Setting`], [`DepthError::Size`] when the numbers do not fill the map, and
    /// [`DepthError::AllUnknown`] or [`DepthError::Negative`] when none of them is known.
    pub fn new(
        (width, height): (usize, usize),
        stored: Vec<f32>,
        scale: f64,
        measure: Measure,
    ) -> Result<Self, DepthError> {
        SCALE.check("the scale", scale)?;
        if stored.len() != width.saturating_mul(height) {
            let (map, image) = ((stored.len(), 1), (width, height));
            return Err(DepthError::Size { map, image, step: 1, expected: image });
        }
        let negatives = measure == Measure::Disparity && has_negatives(&stored);
        let negative = stored.iter().filter(|v| **v < 0.0).count();
        let value = |v: f32| match measure {
            Measure::Disparity => known(v, scale, negatives),
            Measure::Depth if v == f32::INFINITY => FAR,
            Measure::Depth => or_far(f64::from(known(v, scale, negatives))) as f32,
        };
        let data: Vec<f32> = stored.into_iter().map(value).collect();
        if data.iter().all(|v| v.is_nan()) {
            let values = data.len();
            let is_reversed = measure == Measure::Depth && negative > 0;
            return Err(match is_reversed {
                true => DepthError::Negative { values, negative },
                false => DepthError::AllUnknown { values },
            });
        }
        Ok(Self::from_known((width, height), data, measure))
    }

    /// The map with the offset of its disparities: depth = focal length * baseline / (disparity + offset),
    /// as with principal points that differ by `offset` pixels (Middlebury's `doffs`). Points whose sum is
    /// not positive become unknown.
    ///
    /// # Errors
    /// [`DepthError::Setting`] and [`DepthError::AllUnknown`].
    pub fn with_offset(mut self, offset: f64) -> Result<Self, DepthError> {
        PIXELS.check("the disparity offset", offset)?;
        self.offset = offset;
        let behind = |v: f32| f64::from(v) + offset < f64::from(f32::MIN_POSITIVE);
        self.data.iter_mut().filter(|v| behind(**v)).for_each(|v| *v = f32::NAN);
        if self.unknown() == self.data.len() {
            return Err(DepthError::AllUnknown { values: self.data.len() });
        }
        Ok(self)
    }

    /// Added to a disparity, a positive number in inverse proportion to depth: the offset given, else 0, or
    /// a guess if some disparities are negative. 0 for depths.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Where a value comes from.
    #[inline]
    pub fn origin(&self, pixel: usize) -> Origin {
        self.origins.get(pixel).copied().unwrap_or_default()
    }

    /// Whether a value was taken from its neighbours.
    #[inline]
    pub fn is_guessed(&self, pixel: usize) -> bool {
        self.origin(pixel).is_guess()
    }

    pub(crate) fn guesses(&self) -> usize {
        self.origins.iter().filter(|origin| origin.is_guess()).count()
    }

    /// Width in values.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in values.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height in values.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The quantity of the values.
    pub fn measure(&self) -> Measure {
        self.measure
    }

    /// All values, row by row, NaN where unknown.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// One row.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// Number of unknown values.
    pub fn unknown(&self) -> usize {
        self.data.iter().filter(|v| v.is_nan()).count()
    }

    /// The median of about a thousand evenly spaced values; none if they are unknown or far away.
    pub fn middle(&self) -> Option<f32> {
        self.quantile(0.5)
    }

    /// The value below which this share of about a thousand evenly spaced ones lies.
    pub(crate) fn quantile(&self, share: f64) -> Option<f32> {
        let step = self.data.len().div_ceil(1000).max(1);
        let near = self.data.iter().copied().step_by(step).filter(|v| *v < FAR);
        let mut known: Vec<f32> = near.collect();
        known.sort_by(f32::total_cmp);
        known.get((share * known.len() as f64) as usize).copied()
    }

    /// Every `step`-th value in both directions, from the first, as from a coarse sensor.
    ///
    /// # Errors
    /// [`DepthError::Setting`] for step 0, [`DepthError::AllUnknown`] when no known value is left.
    pub fn decimated(&self, step: usize) -> Result<Self, DepthError> {
        STEP.check("the step between depth samples", step as f64)?;
        let rows = (0..self.height).step_by(step);
        let data: Vec<f32> = rows.flat_map(|y| self.row(y).iter().copied().step_by(step)).collect();
        if data.iter().all(|v| v.is_nan()) {
            return Err(DepthError::AllUnknown { values: data.len() });
        }
        let size = (self.width.div_ceil(step), self.height.div_ceil(step));
        Ok(self.with_values(size, data))
    }

    /// Whether the known values lie apart, as points of a lidar do: few of the pixels have one, and fewer
    /// than half of these have neighbours to the right and below, where the map goes on.
    pub(crate) fn is_scattered(&self) -> bool {
        let is_known = |p: usize| self.data.get(p).is_none_or(|v| !v.is_nan());
        let is_joined = |p: &usize| {
            let is_last = (p + 1).is_multiple_of(self.width);
            (is_last || is_known(p + 1)) && is_known(p + self.width)
        };
        let known = || (0..self.data.len()).filter(|p| is_known(*p));
        let is_thin = known().count() as f64 <= MOST_SCATTERED * self.data.len() as f64;
        is_thin && 2 * known().filter(is_joined).count() < known().count()
    }

    /// Refuses a map whose size does not fit an image of `size` with one value every `step` pixels.
    ///
    /// # Errors
    /// [`DepthError::Setting`] and [`DepthError::Size`].
    pub fn fits(&self, image: (usize, usize), step: usize) -> Result<(), DepthError> {
        STEP.check("the step between depth samples", step as f64)?;
        let expected = (image.0.div_ceil(step), image.1.div_ceil(step));
        if self.size() == expected {
            return Ok(());
        }
        Err(DepthError::Size { map: self.size(), image, step, expected })
    }

    pub(crate) fn from_known((width, height): (usize, usize), data: Vec<f32>, measure: Measure) -> Self {
        assert_eq!(data.len(), width * height);
        let offset = if measure == Measure::Disparity { guessed_offset(&data) } else { 0.0 };
        Self { width, height, measure, data, offset, origins: Vec::new() }
    }

    /// The same map with changed values, all of which stay before the camera: a tenth of their disparity or
    /// depth remains.
    pub fn changed(&self, mut change: impl FnMut(f32) -> f32) -> Self {
        let (mut map, offset) = (self.clone(), self.offset as f32);
        map.data.iter_mut().for_each(|v| *v = change(*v).max(0.1 * *v - 0.9 * offset));
        map
    }

    /// Takes the depths of pixels away; how many of them were guesses, and how many far away.
    pub(crate) fn forget(&mut self, pixels: &[bool]) -> (usize, usize) {
        let (mut guesses, mut far) = (0, 0);
        for p in (0..self.data.len()).filter(|p| pixels.get(*p) == Some(&true)) {
            guesses += usize::from(self.is_guessed(p));
            far += usize::from(self.measure == Measure::Depth && self.data[p] >= FAR);
            self.data[p] = f32::NAN;
            if let Some(origin) = self.origins.get_mut(p) {
                *origin = Origin::Known;
            }
        }
        (guesses, far)
    }

    /// Takes pixels as far away; the parallax of disparities is next to nothing there.
    pub(crate) fn set_far(&mut self, pixels: &[usize]) {
        let value = match self.measure {
            Measure::Depth => FAR,
            Measure::Disparity => (f64::from(1.0 / FAR) - self.offset) as f32,
        };
        for p in pixels {
            self.data[*p] = value;
            if let Some(origin) = self.origins.get_mut(*p) {
                *origin = Origin::Known;
            }
        }
    }

    /// The same map, in which values have the origin that they have in another one, and some more this one.
    pub(crate) fn with_origins(mut self, before: &Self, also: &[bool], origin: Origin) -> Self {
        let of = |p: usize| match also.get(p) {
            Some(true) if !before.is_guessed(p) => origin,
            _ => before.origin(p),
        };
        if !(before.origins.is_empty() && also.is_empty()) {
            self.origins = (0..self.data.len()).map(of).collect();
        }
        self
    }

    /// A map of the same measure and offset with other values, NaN where unknown.
    pub(crate) fn with_values(&self, size: (usize, usize), data: Vec<f32>) -> Self {
        Self { offset: self.offset, ..Self::from_known(size, data, self.measure) }
    }
}

/// Equal in every bit; unknown values equal each other.
impl PartialEq for DepthMap {
    fn eq(&self, other: &Self) -> bool {
        let bits = |map: &Self| (map.width, map.height, map.measure, map.offset.to_bits());
        let values = |map: &Self| map.data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        bits(self) == bits(other) && values(self) == values(other) && self.origins == other.origins
    }
}

fn known(stored: f32, scale: f64, negatives: bool) -> f32 {
    let value = (f64::from(stored) / scale) as f32;
    // A subnormal number is as good as 0: its reciprocal, the depth key of a disparity, overflows.
    if value.is_normal() && (value > 0.0 || negatives) { value } else { f32::NAN }
}

/// Whether negative numbers are values. A single negative number, as often as it may occur, is a mark for
/// unknown values, as some stereo programs write it.
fn has_negatives(stored: &[f32]) -> bool {
    let mut negatives = stored.iter().copied().filter(|v| v.is_finite() && *v < 0.0);
    let first = negatives.next();
    negatives.any(|v| Some(v) != first)
}

/// 0 if all disparities are positive; else what lifts the least to a quarter of their range, and to one
/// pixel at least: depths in the order of the disparities, in a ratio that real scenes have.
fn guessed_offset(data: &[f32]) -> f64 {
    let (low, high) = bounds::<_, 8>(data, (f32::MAX, f32::MIN));
    if low > 0.0 { 0.0 } else { f64::from((high - low) / 4.0).max(1.0) - f64::from(low) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_numbers_become_disparities() {
        let stored = vec![8.0, 0.0, f32::NAN, f32::INFINITY, -4.0, 1.0, 1e-42, -0.0];
        let map = DepthMap::new((4, 2), stored, 4.0, Measure::Disparity).unwrap();
        assert_eq!((map.data()[0], map.data()[5], map.unknown()), (2.0, 0.25, 6));
        assert_eq!(map.offset(), 0.0);
    }

    #[test]
    fn negative_disparities_are_values_and_negative_depths_are_not() {
        let stored = vec![8.0, -4.0, -2.0, 0.0];
        let map = DepthMap::new((4, 1), stored.clone(), 2.0, Measure::Disparity).unwrap();
        assert_eq!((map.data()[1], map.unknown()), (-2.0, 1));
        assert!((map.offset() - 3.5).abs() < 1e-9 && map.decimated(1).unwrap().offset() == map.offset());
        assert_eq!(DepthMap::new((4, 1), stored, 2.0, Measure::Depth).unwrap().unknown(), 3);
        let marked = vec![8.0, -1.0, -1.0, 3.0];
        assert_eq!(DepthMap::new((4, 1), marked, 1.0, Measure::Disparity).unwrap().unknown(), 2);
    }

    /// Three tenths of the values are missing at random: a map with holes, not a lidar.
    #[test]
    fn a_map_with_holes_is_not_scattered() {
        let with = |share: usize| {
            let value = |p: usize| if p * 7919 % 100 < share { 5.0 } else { 0.0 };
            DepthMap::new((60, 50), (0..3000).map(value).collect(), 1.0, Measure::Depth).unwrap()
        };
        assert!(!with(70).is_scattered() && with(10).is_scattered());
    }

    #[test]
    fn offsets_are_checked_and_decide_what_lies_in_front() {
        let map = || DepthMap::new((3, 1), vec![5.0, -3.0, -8.0], 1.0, Measure::Disparity).unwrap();
        let placed = map().with_offset(6.0).unwrap();
        assert_eq!((placed.offset(), placed.unknown()), (6.0, 1));
        assert!(matches!(map().with_offset(f64::NAN), Err(DepthError::Setting(_))));
        assert!(matches!(map().with_offset(-5.0), Err(DepthError::AllUnknown { .. })));
    }

    #[test]
    fn useless_maps_are_refused() {
        let new = |data: Vec<f32>, scale| DepthMap::new((2, 1), data, scale, Measure::Depth);
        assert_eq!(new(vec![0.0, f32::NAN], 1.0), Err(DepthError::AllUnknown { values: 2 }));
        assert_eq!(new(vec![0.0, -3.0], 1.0), Err(DepthError::Negative { values: 2, negative: 1 }));
        assert!(matches!(new(vec![1.0; 3], 1.0), Err(DepthError::Size { map: (3, 1), .. })));
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(new(vec![1.0; 2], scale), Err(DepthError::Setting(_))));
        }
    }

    #[test]
    fn coarse_maps_must_fit_their_step() {
        let data: Vec<f32> = (1..=35).map(|v| v as f32).collect();
        let map = DepthMap::new((7, 5), data, 1.0, Measure::Depth).unwrap();
        let coarse = map.decimated(3).unwrap();
        assert_eq!((coarse.size(), coarse.data()), ((3, 2), &[1.0, 4.0, 7.0, 22.0, 25.0, 28.0][..]));
        assert!(coarse.fits((7, 5), 3).is_ok() && coarse.fits((9, 6), 3).is_ok());
        assert!(matches!(coarse.fits((10, 6), 3), Err(DepthError::Size { expected: (4, 2), .. })));
        assert!(matches!(map.decimated(0), Err(DepthError::Setting(_))));
    }
}
