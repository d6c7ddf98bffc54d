//! The spectra of captures, plainly interleaved and fused.

use super::super::bank_file::name;
use super::super::capture_file::Whole;
use super::super::file_kind::unreadable;
use super::super::fused::fused;
use super::super::match_bank::{check_channels, output_rate};
use super::super::say::warn;
use super::Failure;
use super::page::Figure;
use crate::bank::Bank;
use crate::io::{MultiReader, ReadOptions};
use crate::overview::spectra;
use crate::pipeline::Settings;
use crate::simulate::interleaved;
use crate::units::Hertz;
use std::path::{Path, PathBuf};

/// Frames that are used; more would only make the lines denser.
const MOST_FRAMES: usize = 1 << 20;
/// Frames that the spectra need.
const LEAST_FRAMES: usize = 16;

/// Both recordings at the fast rate.
pub(super) struct Spectra {
    rate: Hertz,
    interleaved: Vec<f64>,
    fused: Vec<f64>,
    /// The captures go on after the frames that were read.
    is_cut: bool,
    frames: usize,
}

impl Spectra {
    /// Reads the captures and fuses them.
    pub(super) fn read(bank: &Bank, path: &Path, inputs: &[PathBuf]) -> Result<Self, Failure> {
        let stop = crossbeam_channel::never();
        let reader = MultiReader::start(inputs, ReadOptions::files(), stop).map_err(unreadable)?;
        let mut reader = reader.ok_or_else(|| Failure::input("interrupted; nothing was written"))?;
        check_channels(bank, path, &reader)?;
        let rate = Hertz(output_rate(bank, &reader)?);
        let Whole { mut channels, is_cut } = Whole::read(&mut reader, MOST_FRAMES)?;
        reader.warnings().iter().for_each(|warning| warn(&warning.to_string()));
        let names = inputs.iter().map(|input| name(input).to_string()).collect::<Vec<_>>().join(", ");
        let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
        if frames < LEAST_FRAMES {
            return Err(Failure::Input(format!(
                "{names}: {frames} frames, and a spectrum needs {LEAST_FRAMES}; give longer captures, or none"
            )));
        }
        if is_cut {
            warn(&format!("{names}: only the first {frames} frames are on the page"));
        }
        // What was lost is a zero, as `fuse` has it without --gaps.
        channels.iter_mut().flatten().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        let fused = fused(bank, &channels, Settings::default())?;
        let interleaved = interleaved(&bank.delays_in_fast_periods(), bank.ratio, 0, &channels);
        Ok(Self { rate, interleaved, fused, is_cut, frames })
    }

    /// Both spectra in one chart.
    pub(super) fn figure(&self) -> Result<Figure, Failure> {
        let recordings = [("plain interleaving", &self.interleaved[..]), ("fused", &self.fused)];
        let chart = spectra(self.rate, &recordings);
        let part = if self.is_cut {
            format!("the first {} frames of the captures", self.frames)
        } else {
            "the captures".to_owned()
        };
        let caption = format!(
            "The spectra of {part}, interleaved as if they were taken in turn, and fused by the bank. Lines that only \
             the first has are images of the signal: errors of the converters' instants and filters."
        );
        Figure::new(&chart, &caption).map_err(Failure::input)
    }
}
