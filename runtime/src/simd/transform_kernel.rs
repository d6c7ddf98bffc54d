//! The checked calls of the kernels that transform, multiply and scatter.

use super::dispatch::{Element, compiled_narrow};
use super::isa::Isa;
use super::passes::{Forward, ForwardJob, Inverse, InverseJob};
use super::product::{Product, ProductJob, Scatter, ScatterJob};
use super::transform::{OutputFrames, Segments, Spectra, Transform, row_samples};
use super::vector::group_lanes;

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TransformKernel<T: Element> {
    /// By log2 D.
    forward: [unsafe fn(ForwardJob<'_, T>); 4],
    product: [unsafe fn(ProductJob<'_, T>); 4],
    inverse: unsafe fn(InverseJob<'_, T>),
    scatter: [unsafe fn(ScatterJob<'_, T>); 4],
}

/// A kernel for D = 1, 2, 4 and 8 lanes per segment.
macro_rules! by_depth {
    ($kernel:ident, $isa:expr) => {
        [
            compiled_narrow::<$kernel<T, 1>>($isa),
            compiled_narrow::<$kernel<T, 2>>($isa),
            compiled_narrow::<$kernel<T, 4>>($isa),
            compiled_narrow::<$kernel<T, 8>>($isa),
        ]
    };
}

impl<T: Element> TransformKernel<T> {
    /// The kernels for an instruction set, in vectors of one group.
    pub(crate) fn new(isa: Isa) -> Self {
        Self {
            forward: by_depth!(Forward, isa),
            product: by_depth!(Product, isa),
            inverse: compiled_narrow::<Inverse<T>>(isa),
            scatter: by_depth!(Scatter, isa),
        }
    }

    /// Transforms F frames of each segment, of which `depth` samples are lanes, to F rows.
    ///
    /// # Panics
    /// If `depth` is no power of two up to a group, or a slice is too short: the last frame needs `depth`
    /// samples.
    pub(crate) fn forward(
        &self,
        transform: &Transform<T>,
        depth: usize,
        from: Segments<'_, T>,
        rows: &mut [T],
    ) {
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        let needed = (transform.len - 1) * from.stride + (group_lanes::<T>() / depth - 1) * from.hop + depth;
        assert!(from.parts.iter().all(|part| part.len() >= needed));
        assert!(rows.len() >= transform.plane());
        #[cfg(test)]
        transform.count();
        // SAFETY: the parts hold all frames of all segments, and `rows` the rows of the transform, as
        // asserted.
        unsafe { self.forward[depth.ilog2() as usize](ForwardJob { transform, from, rows }) };
    }

    /// F times the inverse transform, in place.
    ///
    /// # Panics
    /// If there are less than F rows.
    pub(crate) fn inverse(&self, transform: &Transform<T>, rows: &mut [T]) {
        assert!(rows.len() >= transform.plane());
        #[cfg(test)]
        transform.count();
        // SAFETY: `rows` holds the rows of the transform, as asserted.
        unsafe { (self.inverse)(InverseJob { transform, rows }) };
    }

    /// Brings rows to where they belong, `depth` lanes to a frame from each of its groups. Each frame is
    /// written as whole lanes and what is too much overwritten by the next one, which also goes for what
    /// follows the last one.
    ///
    /// # Panics
    /// If slices do not fit: the last frame needs whole lanes.
    pub(crate) fn scatter(
        &self,
        transform: &Transform<T>,
        depth: usize,
        rows: &[T],
        to: OutputFrames<'_, T>,
    ) {
        let (plane, group) = (transform.plane(), group_lanes::<T>());
        let groups = rows.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group);
        assert!(groups > 0 && rows.len() == groups * plane && (1..=transform.len).contains(&to.count));
        assert!((2 * group / depth * to.count - 1) * to.stride + groups * depth <= to.samples.len());
        // SAFETY: there are `count` last rows in each group, and room for the lanes of all groups from each
        // frame on, as asserted.
        unsafe { self.scatter[depth.ilog2() as usize](ScatterJob { transform, rows, to }) };
    }

    /// Y(f) = H(f) X(f): from F rows for each `depth` channels to F rows for each group of phases.
    ///
    /// # Panics
    /// If slices do not fit.
    pub(crate) fn product(
        &self,
        transform: &Transform<T>,
        depth: usize,
        spectra: Spectra<'_, T>,
        input: &[T],
        output: &mut [T],
    ) {
        let (plane, row) = (transform.plane(), row_samples::<T>());
        let outputs = output.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        assert!(input.len() >= spectra.channels.div_ceil(depth) * plane && output.len() == outputs * plane);
        assert!(spectra.rows.len() >= transform.pairs.len() * outputs * spectra.channels * row);
        #[cfg(test)]
        super::work::add(2 * transform.pairs.len() * outputs * spectra.channels * row);
        // SAFETY: the pairs are rows below F, see `Transform::new`, and all groups of inputs and outputs
        // have F rows, and each pair its spectra, as asserted.
        unsafe { self.product[depth.ilog2() as usize](ProductJob { transform, spectra, input, output }) };
    }
}
