//! The error analysis of the thesis, chapters 3 and 4, with the virtual experiments that test it.
//!
//! * [`flat`]: scenes of the plane, with Theorem 3.1;
//! * [`spatial`]: scenes of space, with Theorem 4.3;
//! * [`piecewise_linear`], [`periodic`] and [`delaunay`]: what both stand on, the interpolation and the
//!   moments of intervals and triangles.
//!
//! The bounds of the theorems are expectations over random phases of the cameras' pixels. They are false
//! for cameras that share a phase: N coincident cameras have the error of one. Lengths in images are pixels
//! throughout.

pub(crate) mod delaunay;
pub(crate) mod flat;
pub(crate) mod periodic;
pub(crate) mod piecewise_linear;
mod quadrature;
pub(crate) mod random;
pub(crate) mod spatial;
