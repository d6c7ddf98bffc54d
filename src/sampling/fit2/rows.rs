//! Samples enter the normal equations, into some rows of an image.

use super::super::kernel::BSpline;
use super::Fit2;

/// A sample of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit2Sample<const C: usize> {
    /// Column, in pixels.
    pub x: f64,
    /// Row, in pixels.
    pub y: f64,
    /// Values.
    pub values: [f32; C],
    /// Weight w >= 0.
    pub weight: f32,
    /// Slope weight mu >= 0.
    pub slope_weight: f32,
}

/// Some rows of the equations of a [`Fit2`]. Rows that do not overlap take samples at the same time.
#[derive(Debug)]
pub struct Fit2Rows<'a, const ORDER: usize, const C: usize> {
    size: (usize, usize),
    /// Coefficients of a row.
    stride: usize,
    /// The first row.
    first: usize,
    records: &'a mut [f32],
}

impl<'a, const ORDER: usize, const C: usize> Fit2Rows<'a, ORDER, C> {
    pub(super) fn new(size: (usize, usize), stride: usize, records: &'a mut [f32]) -> Self {
        Self { size, stride, first: 0, records }
    }

    /// The rows before row `row` of the image, and the rest.
    pub fn split_at(self, row: usize) -> (Self, Self) {
        let (size, stride, first) = (self.size, self.stride, self.first);
        // Below the image there are more coefficients.
        let end = if row < size.1 { row } else { usize::MAX };
        let middle = (end - first).saturating_mul(stride * Fit2::<ORDER, C>::RECORD);
        let (before, after) = self.records.split_at_mut(middle.min(self.records.len()));
        let part = |first, records| Self { size, stride, first, records };
        (part(first, before), part(row, after))
    }

    /// Adds a sample, whose position is moved into the image. It changes its own row and the ORDER - 1 rows
    /// below it; they must be among these rows.
    ///
    /// # Panics
    /// If they are not.
    // A call would pass the sample through memory.
    #[inline(always)]
    pub fn add(&mut self, sample: &Fit2Sample<C>) {
        let (column, across) = span::<ORDER>(sample.x, self.size.0);
        let (row, down) = span::<ORDER>(sample.y, self.size.1);
        let start = ((row - self.first) * self.stride + column) * Fit2::<ORDER, C>::RECORD;
        let records = &mut self.records[start..];
        let (w, v) = (&across.weights, &down.weights);
        add_product(records, self.stride, (v, w), sample.weight, Some(&sample.values));
        if sample.slope_weight > 0.0 {
            let weight = sample.weight * sample.slope_weight;
            add_product::<ORDER, C>(records, self.stride, (v, &across.slopes), weight, None);
            add_product::<ORDER, C>(records, self.stride, (&down.slopes, w), weight, None);
        }
    }
}

/// Weights and slopes of the splines around a position.
struct Span<const ORDER: usize> {
    weights: [f32; ORDER],
    slopes: [f32; ORDER],
}

/// First coefficient around a position, which is moved into a row of `length` pixels.
#[inline(always)]
fn span<const ORDER: usize>(position: f64, length: usize) -> (usize, Span<ORDER>) {
    let position = position.clamp(0.0, length.saturating_sub(1) as f64);
    // The cast cuts toward zero: rounding functions are library calls on baseline x86-64, and casts of 64
    // bits take several instructions.
    let first = (position as u32).min(length.saturating_sub(2) as u32);
    let (weights, slopes) = BSpline::<ORDER>::in_span(position - f64::from(first));
    (first as usize, Span { weights: weights.map(|w| w as f32), slopes: slopes.map(|d| d as f32) })
}

/// Adds weight (b b'), b the products of the weights down and across, and weight b f.
#[inline(always)]
fn add_product<const ORDER: usize, const C: usize>(
    records: &mut [f32],
    stride: usize,
    (down, across): (&[f32; ORDER], &[f32; ORDER]),
    weight: f32,
    values: Option<&[f32; C]>,
) {
    let length = Fit2::<ORDER, C>::RECORD;
    for (i, d) in down.iter().enumerate() {
        // Images narrower than a spline: what is beyond the last record has the weight 0.
        let end = ((i * stride + ORDER) * length).min(records.len());
        let records = &mut records[i * stride * length..end];
        for (j, record) in records.chunks_exact_mut(length).enumerate() {
            let own = weight * d * across[j];
            let (couplings, sums) = record.split_at_mut(Fit2::<ORDER, C>::COUPLINGS);
            // Along the row, then the rows below.
            for k in j..ORDER {
                couplings[k - j] += own * d * across[k];
            }
            for (below, d) in down[i + 1..].iter().enumerate() {
                let middle = ORDER + below * (2 * ORDER - 1) + ORDER - 1;
                for (k, w) in across.iter().enumerate() {
                    couplings[middle + k - j] += own * d * w;
                }
            }
            if let Some(values) = values {
                sums.iter_mut().zip(values).for_each(|(s, v)| *s += own * v);
            }
        }
    }
}
