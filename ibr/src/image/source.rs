//! The content of a file before its format is known.

use crate::files::InputError;
use hybank_core::messages::Quoted;
use std::path::Path;

/// A file whose format is not known yet.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    /// The most pixels that it may have.
    pub(super) most: usize,
}

impl Source<'_> {
    /// That the content cannot be used.
    pub(super) fn wrong(&self, reason: String) -> InputError {
        let reason = Quoted(reason);
        let formats = "PNG, JPEG, TIFF, PPM, PGM, PFM, OpenEXR and NPY";
        InputError::file(self.path, format!("{reason}; the readable formats are {formats}"))
    }

    /// Refuses too many pixels.
    pub(super) fn check_size(&self, width: usize, height: usize) -> Result<(), InputError> {
        let most = self.most;
        if width.saturating_mul(height) > most {
            let reason = format!(
                "{width} x {height} pixels are more than the limit of {most}; crop or shrink the image, or allow so many with --max-pixels"
            );
            return Err(InputError::file(self.path, reason));
        }
        Ok(())
    }
}
