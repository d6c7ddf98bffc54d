//! Which kind of file an input is, by its name.

use super::{Coding, PcmFormat, is_sigmf, mat_variable};
use std::path::Path;

/// A kind of input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Sigmf,
    /// A SigMF recording in an archive.
    Archive,
    Csv,
    Npy,
    Mat,
    /// A recording that must be decoded.
    Audio,
    Raw,
    Wav,
}

impl Kind {
    /// Of an input of this name, which is of this coding if its name says nothing.
    pub(super) fn of(path: &Path, coding: Coding) -> Self {
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.map(str::to_ascii_lowercase).as_deref() {
            _ if is_sigmf(path) => Self::Sigmf,
            Some("sigmf") => Self::Archive,
            Some("csv") => Self::Csv,
            Some("npy") => Self::Npy,
            Some("flac" | "mp3" | "aif" | "aiff" | "aifc" | "ogg" | "oga") => Self::Audio,
            _ if mat_variable(path).is_some() => Self::Mat,
            Some("wav" | "wave") => Self::Wav,
            _ if coding == Coding::Wav => Self::Wav,
            _ => Self::Raw,
        }
    }
}

/// True for inputs that state their own format and channels whatever the [`Coding`] is: names that end in
/// `.wav`, SigMF recordings and archives, tables, arrays, and recordings that are decoded.
pub fn is_self_describing(path: &Path) -> bool {
    Kind::of(path, Coding::Raw(PcmFormat::U8)) != Kind::Raw
}
