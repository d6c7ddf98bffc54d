//! Charts as PNG files.

use super::canvas::Canvas;
use super::chart::{Chart, ENLARGED, Marks, PlotError};
use super::legend::OVERSIZE;
use super::pixels::Pixels;

/// Pixels of a PNG file per pixel of an SVG that is not enlarged.
const FINENESS: u32 = 2;

impl Chart {
    /// The chart as a PNG file of 1920 by 900 pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        self.to_png_with(&[])
    }

    /// As [`Self::to_svg_with`], as a PNG file of 1920 by 900 pixels.
    pub fn to_png_with(&self, marks: &[Marks]) -> Result<Vec<u8>, PlotError> {
        let ranges = self.ranges(marks)?;
        let mut pixels = Pixels::white(ENLARGED.0 as usize, ENLARGED.1 as usize);
        self.draw(Canvas(&mut pixels), marks, ranges).map_err(|error| self.failed(&error))?;
        pixels.reduced((OVERSIZE / FINENESS) as usize).png().map_err(|error| self.failed(&error))
    }
}
