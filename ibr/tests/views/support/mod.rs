//! What several of the tests draw and compare with.

pub(crate) mod noise;
pub(crate) mod normal;
pub(crate) mod render;
