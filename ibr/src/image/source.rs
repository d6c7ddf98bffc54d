//! The content of a file before its format is known.

use super::ImageError;
use std::path::Path;

/// Bytes per pixel while an image is unpacked and converted: four channels of 16 bits, three as they are
/// needed, and three numbers.
const READING: f64 = 30.0;

/// A file whose format is not known yet.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    /// The most pixels that it may have.
    pub(super) most: usize,
}

impl Source<'_> {
    /// That the content cannot be used.
    pub(super) fn wrong(&self, reason: String) -> ImageError {
        ImageError::Decode { path: self.path.into(), reason }
    }

    /// Refuses too many pixels, and such that the system has no memory for.
    pub(super) fn check_size(&self, width: usize, height: usize) -> Result<(), ImageError> {
        let pixels = width.saturating_mul(height);
        if pixels > self.most {
            return Err(ImageError::TooLarge { path: self.path.into(), width, height, most: self.most });
        }
        ImageError::refuse_without_memory(self.path, (width, height), READING)
    }
}
