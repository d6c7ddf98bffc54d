//! The sampling core that both crates stand on: kernels, fits in shift-invariant spaces, nonuniform samples.
