//! Image-based rendering on the sampling core.

pub mod atomic;
pub mod camera;
pub mod depth;
pub mod image;
pub mod interpolate;
mod linear;
pub mod occlusion;
pub mod pipeline;
pub mod propagate;
pub mod sample;
