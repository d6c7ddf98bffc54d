//! Direct polyphase FIR on frames as they lie.
//!
//! A frame's window is cut into steps of D samples. Each lane sums one place of the steps with fused
//! multiply-adds from 0, and at the end the D lanes of a frame are added as said in
//! [`vector`](super::vector). Two to four phases are the work of `phases`, a single one is that of `single`;
//! `polyphase` checks calls.

mod kernel;
mod phases;
mod polyphase;
mod single;
mod tiling;

pub(crate) use kernel::FirKernel;
pub(crate) use polyphase::{Polyphase, Segment};
pub(crate) use tiling::Tiling;
