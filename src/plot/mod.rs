//! Charts as SVG and, with the feature `png`, as PNG.

mod axis;
mod chart;
mod labels;
mod legend;
#[cfg(feature = "png")]
mod raster;

pub use axis::AxisScale;
pub use chart::{Chart, Marks, PlotError, Series};
