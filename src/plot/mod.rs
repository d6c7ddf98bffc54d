//! SVG figures.

mod chart;

pub use chart::{Chart, PlotError, Series};
