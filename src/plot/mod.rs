//! Charts as SVG.

mod axis;
mod chart;
mod labels;
mod legend;

pub use axis::AxisScale;
pub use chart::{Chart, Marks, PlotError, Series};
