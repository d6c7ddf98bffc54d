//! Decompositions and transforms against their definitions, on structured and nasty matrices.
//!
//! They stand outside of the crate so that the generic code of its dependencies is compiled once, not twice.

mod assemble;
mod balance;
mod blocks;
mod cholesky;
mod eigen;
mod fourier;
mod lq;
mod svd;
