//! The error analysis of the thesis, chapters 3 and 4, with the virtual experiments that test it.
//!
//! * [`flat`]: scenes of the plane, with Theorems 3.1 and 3.2 and occlusion (4.3);
//! * [`spatial`]: scenes of space, with Theorem 4.3 and what edges cost;
//! * [`piecewise_linear`], [`periodic`], [`jump`] and [`delaunay`]: what both stand on, the bounds between
//!   samples and the moments of intervals and triangles.
//!
//! The bounds of the theorems are expectations over random phases of the cameras' pixels. They are false
//! for cameras that share a phase: N coincident cameras have the error of one. What holds for any samples
//! is [`piecewise_linear::PiecewiseLinear::mean_error_bound`]. Lengths in images are pixels throughout.

pub mod delaunay;
pub mod flat;
pub mod jump;
pub mod periodic;
pub mod piecewise_linear;
mod quadrature;
pub mod random;
pub mod spatial;
