//! Intervals of integers, exact.

/// All values of a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    pub(super) least: i128,
    pub(super) most: i128,
}

impl Range {
    pub(super) fn of_bits(bits: u32) -> Self {
        Self { least: -(1 << (bits - 1)), most: (1 << (bits - 1)) - 1 }
    }

    /// Bits in two's complement that hold all values.
    pub(super) fn bits(self) -> u32 {
        let magnitude = |x: i128| i128::BITS - (if x < 0 { !x } else { x }).leading_zeros();
        1 + magnitude(self.least).max(magnitude(self.most))
    }

    pub(super) fn plus(self, other: Self) -> Self {
        Self { least: self.least + other.least, most: self.most + other.most }
    }

    pub(super) fn times(self, factor: i128) -> Self {
        let (a, b) = (self.least * factor, self.most * factor);
        Self { least: a.min(b), most: a.max(b) }
    }

    pub(super) fn hull(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }
}

impl From<i128> for Range {
    fn from(value: i128) -> Self {
        Self { least: value, most: value }
    }
}
