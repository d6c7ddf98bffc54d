//! Charts as SVG and, with the feature `png`, as PNG.

#[cfg(feature = "png")]
mod canvas;
mod chart;
mod font;
mod legend;
#[cfg(feature = "png")]
mod pixels;
#[cfg(feature = "png")]
mod raster;

pub use chart::{Chart, Marks, PlotError, Series};
