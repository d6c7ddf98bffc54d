//! In which numbers kernels compute.

/// Number type of the kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Coefficients and sums in f32: error about 1e-7 of full scale.
    #[default]
    Single,
    /// Coefficients and sums in f64, at half the speed.
    Double,
}

impl Precision {
    /// Bytes of a number.
    pub(crate) fn bytes(self) -> f64 {
        match self {
            Self::Single => 4.0,
            Self::Double => 8.0,
        }
    }
}
