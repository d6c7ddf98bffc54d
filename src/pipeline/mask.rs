//! Delays the mask of frames by the latency of the outputs.

use std::ops::Range;

/// Aligns the mask with the outputs of an algorithm that adds latency: y\[n\] is output number n + latency.
#[derive(Debug, Clone)]
pub(super) struct MaskDelay {
    /// The marks of the block's frames.
    pub(super) block: Vec<u8>,
    /// The marks of the block's outputs, and the known marks of later outputs.
    marks: Vec<u8>,
}

impl MaskDelay {
    /// A delay for outputs that are `latency` samples late.
    pub(super) fn new(latency: usize) -> Self {
        Self { block: Vec::new(), marks: vec![0; latency] }
    }

    /// Appends the marks of the block's frames.
    pub(super) fn enter(&mut self) {
        self.marks.extend_from_slice(&self.block);
    }

    /// The marks of some of the block's outputs.
    pub(super) fn of(&self, samples: Range<usize>) -> &[u8] {
        &self.marks[samples]
    }

    /// Removes the marks of the block's outputs.
    pub(super) fn leave(&mut self) {
        self.marks.drain(..self.block.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_come_later_by_the_latency_whatever_the_blocks() {
        let marks: Vec<u8> = (0..40).map(|k| u8::from(k % 7 == 3)).collect();
        for latency in [0, 1, 6, 50] {
            let mut delayed = vec![0; latency];
            delayed.extend(&marks);
            let mut delay = MaskDelay::new(latency);
            let mut got = Vec::new();
            for block in [&marks[..3], &marks[3..3], &marks[3..20], &marks[20..]] {
                delay.block = block.to_vec();
                delay.enter();
                got.extend_from_slice(delay.of(0..block.len()));
                delay.leave();
            }
            assert_eq!(got, delayed[..40], "{latency}");
        }
    }
}
