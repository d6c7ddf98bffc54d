//! Charts as SVG and, with the feature `png`, as PNG.

mod chart;
mod legend;
#[cfg(feature = "png")]
mod raster;

pub use chart::{Chart, Marks, PlotError, Series};
