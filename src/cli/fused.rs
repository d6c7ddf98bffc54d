//! Signals in memory, fused as `hybank fuse` fuses files.

use super::print::Failure;
use crate::bank::Bank;
use crate::pipeline::{Settings, fuse};
use crate::runtime::{Options, Planar, Precision};

/// M output samples per frame, in double precision. Channels that are longer than the shortest one are cut.
pub(super) fn fused(bank: &Bank, channels: &[Vec<f64>], settings: Settings<'_>) -> Result<Vec<f64>, Failure> {
    let options = Options { precision: Precision::Double, ..Options::default() };
    let plan = bank.plan(options).map_err(Failure::input)?;
    let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
    let cut: Vec<&[f64]> = channels.iter().map(|channel| &channel[..frames]).collect();
    let input = Planar::new(&cut).map_err(Failure::input)?;
    let mut output = vec![0.0; frames * bank.ratio];
    fuse(bank, &plan, &[input], &mut output[..], settings, &|| false).map_err(Failure::running)?;
    Ok(output)
}
