//! Memory that starts on a cache line.

use std::ops::{Deref, DerefMut};

/// A cache line, and the widest vector.
const LINE_BYTES: usize = 64;

/// A slice of fixed length whose first element lies on a cache line.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    memory: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: Copy + Default> Aligned<T> {
    /// `len` default values.
    pub(crate) fn new(len: usize) -> Self {
        let memory = vec![T::default(); len + LINE_BYTES / size_of::<T>()];
        // The offset is in elements; where the platform cannot tell, unaligned is merely slower.
        let start = memory.as_ptr().align_offset(LINE_BYTES).min(memory.len() - len);
        Self { memory, start, len }
    }

    /// A copy of `values`.
    pub(crate) fn from_slice(values: &[T]) -> Self {
        let mut aligned = Self::new(values.len());
        aligned.copy_from_slice(values);
        aligned
    }
}

impl<T: Copy + Default> Clone for Aligned<T> {
    fn clone(&self) -> Self {
        Self::from_slice(self)
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.memory[self.start..self.start + self.len]
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.memory[self.start..self.start + self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_on_a_line_also_after_cloning() {
        for len in 0..70 {
            let values: Vec<f32> = (0..len).map(|i| i as f32).collect();
            let aligned = Aligned::from_slice(&values);
            for copy in [aligned.clone(), aligned] {
                assert_eq!(copy.as_ptr() as usize % 64, 0);
                assert_eq!(*copy, *values);
            }
        }
    }
}
