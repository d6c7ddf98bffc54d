//! SVG figures.

mod chart;

pub use chart::{Chart, Marks, PlotError, Series};
