//! How large the error of a rendered view is, and why (thesis chapters 3 and 4).
//!
//! * [`flat`]: scenes of the plane, with Theorems 3.1 and 3.2 and occlusion (4.3);
//! * [`spatial`]: scenes of space, with Theorem 4.3 and what edges cost;
//! * [`view`]: the error of one rendered view of photographs, pixel by pixel, without a photograph of it;
//! * [`plan`]: where to put cameras, and how many bits to give intensities and depths.
//!
//! The first two have the densities of the samples, the jitter that errors of depth cause, bounds in closed
//! form, and virtual experiments that measure what the bounds promise. Lengths in images are pixels
//! throughout.
//!
//! The bounds of the theorems are expectations over random phases of the cameras' pixels. They are false
//! for cameras that share a phase: N coincident cameras have the error of one. What holds for any samples
//! is [`hybank::sampling::nonuniform::PiecewiseLinear::mean_error_bound`].

pub mod flat;
pub mod plan;
mod random;
pub mod spatial;
pub mod view;
