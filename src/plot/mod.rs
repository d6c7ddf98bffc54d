//! Charts as SVG.

mod axis;
mod chart;
mod curves;
mod labels;
mod legend;

pub use axis::AxisScale;
pub use chart::{Chart, Marks, PlotError, Series};
pub use curves::{Curves, Guide};
