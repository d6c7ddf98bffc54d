//! SVG figures.

mod chart;
mod legend;

pub use chart::{Chart, Marks, PlotError, Series};
