#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

// The synthetic scene names this crate as an example does.
#[cfg(test)]
extern crate self as hybank_ibr;

pub mod analysis;
pub mod camera;
pub mod cli;
pub mod depth;
pub mod files;
pub mod image;
pub mod interpolate;
mod lanes;
pub mod matching;
pub mod occlusion;
pub mod partial;
pub mod pipeline;
pub mod propagate;
pub mod restore;
pub mod sample;
pub mod scene;
pub mod setting;
mod surfaces;
#[cfg(test)]
#[path = "../examples/demo/synthetic.rs"]
mod synthetic;
pub mod uncalibrated;
