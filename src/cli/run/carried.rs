//! What of the inputs accompanies the output: metadata, gaps as annotations, the bank.

use super::super::Failure;
use crate::bank::Bank;
use crate::io::{MultiReader, OutputNotes, Placement, is_sigmf};
use crate::pipeline::Gap;
use std::path::Path;

/// The notes of the output `path`, whose frames lie at `placement`.
pub(in crate::cli) fn carried(
    reader: &MultiReader,
    gaps: &[Gap],
    bank: &Bank,
    path: &Path,
    placement: Placement,
) -> Result<OutputNotes, Failure> {
    let mut notes = reader.notes(placement);
    // Only this kind of output holds the rest.
    if is_sigmf(path) {
        notes.record_bank(&bank.digest().map_err(Failure::input)?);
        for gap in gaps {
            let comment = format!("channel {}: {} samples missing", gap.channel, gap.length);
            notes.annotate(placement, gap.first, gap.length, "gap", &comment);
        }
    }
    Ok(notes)
}
