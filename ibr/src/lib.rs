//! Image-based rendering on the sampling core.
