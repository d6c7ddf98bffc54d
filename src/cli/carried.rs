//! What of the inputs accompanies the output: metadata, gaps as annotations, the bank.

use super::Failure;
use super::run::RunReport;
use crate::bank::Bank;
use crate::io::{MultiReader, OutputNotes, Placement, is_sigmf};
use std::path::Path;

/// The notes of the output `path`, whose frames lie at `placement`.
pub(super) fn carried(
    reader: &MultiReader,
    run: &RunReport,
    bank: &Bank,
    path: &Path,
    placement: Placement,
) -> Result<OutputNotes, Failure> {
    let mut notes = reader.notes(placement);
    // Only this kind of output holds the rest.
    if is_sigmf(path) {
        notes.record_bank(&bank.digest().map_err(Failure::input)?);
        for gap in run.gaps() {
            let comment = format!("channel {}: {} samples missing", gap.channel, gap.length);
            notes.annotate(placement, gap.first, gap.length, "gap", &comment);
        }
    }
    Ok(notes)
}
