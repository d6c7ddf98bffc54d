#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

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
pub mod synthetic;
pub mod uncalibrated;
