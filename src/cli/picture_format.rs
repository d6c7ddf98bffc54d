//! Formats of pictures.

use crate::plot::{Chart, Marks, PlotError};
use std::path::Path;

/// The format of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum PictureFormat {
    /// Lines and letters, sharp at any size
    Svg,
    /// 1920 by 900 pixels
    Png,
}

impl PictureFormat {
    /// The format that the extension of a file names, if it is one.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let formats = [Self::Svg, Self::Png];
        let extension = path.extension()?;
        formats.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }

    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }

    /// The bytes of the file of a chart.
    pub(super) fn file(self, chart: &Chart, marks: &[Marks]) -> Result<Vec<u8>, PlotError> {
        match self {
            Self::Svg => chart.to_svg_with(marks).map(String::into_bytes),
            Self::Png => chart.to_png_with(marks),
        }
    }
}
