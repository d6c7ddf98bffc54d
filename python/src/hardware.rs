//! A bank of integer taps for hardware: the exported circuit, and the model of its bits.

use crate::arrays::{ArrayShape, Held};
use crate::errors::{file_error, refused, warn};
use crate::outputs::begin_file;
use hybank::bank::Bank;
use hybank::files::{commit_all, refuse_overlaps};
use hybank::interchange::{BitTrue, Circuit, Verilog, VerilogOptions, WordSizes};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// Random frames of a testbench unless the caller says how many.
const RANDOM_FRAMES: u32 = 1000;

/// The keywords of a circuit.
#[derive(Debug)]
pub(crate) struct CircuitKeywords {
    pub(crate) output_bits: Option<u32>,
    pub(crate) accumulator: Option<u32>,
    pub(crate) clocks_per_frame: Option<u32>,
    pub(crate) frames_per_clock: Option<u32>,
    pub(crate) pipeline: Option<u32>,
    pub(crate) loadable: bool,
    pub(crate) testbench: Option<PathBuf>,
    pub(crate) random_frames: Option<u32>,
}

impl CircuitKeywords {
    /// Refuses keywords that another format would ignore.
    pub(crate) fn check_none(&self) -> PyResult<()> {
        let words = [self.output_bits, self.accumulator, self.random_frames];
        let clocks = [self.clocks_per_frame, self.frames_per_clock, self.pipeline];
        let is_any = words.iter().chain(&clocks).any(Option::is_some);
        if is_any || self.testbench.is_some() || self.loadable {
            return Err(refused(
                "output_bits, accumulator, clocks_per_frame, frames_per_clock, pipeline, loadable, testbench and random_frames \
                 describe a circuit; give format=\"verilog\" or leave them out",
            ));
        }
        Ok(())
    }

    fn options(&self, input_bits: Option<u32>) -> PyResult<VerilogOptions> {
        Ok(VerilogOptions {
            input_bits,
            output_bits: self.output_bits,
            accumulator_bits: self.accumulator,
            clocks_per_frame: at_least_one("clocks_per_frame", self.clocks_per_frame)?,
            frames_per_clock: at_least_one("frames_per_clock", self.frames_per_clock)?,
            pipeline: at_least_one("pipeline", self.pipeline)?,
            is_loadable: self.loadable,
        })
    }

    /// The words that a loadable module of these keywords takes.
    pub(crate) fn load(&self, bank: &Bank, input_bits: Option<u32>) -> PyResult<String> {
        let verilog = Verilog::new(bank, "bank", &self.options(input_bits)?).map_err(refused)?;
        Ok(verilog.load.unwrap_or_default())
    }

    /// Writes the module, and the testbench with it; the files appear together.
    pub(crate) fn write(
        &self,
        bank: &Bank,
        path: &Path,
        name: &str,
        input_bits: Option<u32>,
        overwrite: bool,
    ) -> PyResult<Circuit> {
        if self.random_frames.is_some() && self.testbench.is_none() {
            return Err(refused(
                "random_frames: they belong to a testbench; give its folder, or leave them out",
            ));
        }
        let verilog = Verilog::new(bank, name, &self.options(input_bits)?).map_err(refused)?;
        let mut files = Vec::new();
        if let Some(folder) = &self.testbench {
            let bench = verilog.testbench(self.random_frames.unwrap_or(RANDOM_FRAMES)).map_err(refused)?;
            std::fs::create_dir_all(folder)?;
            files.extend(bench.into_iter().map(|(name, text)| (folder.join(name), text)));
        }
        files.push((path.to_owned(), verilog.text));
        let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
        refuse_overlaps(&paths, &[]).map_err(file_error)?;
        let begin = |(path, text): &(PathBuf, String)| begin_file(path, text.as_bytes(), overwrite);
        commit_all(files.iter().map(begin).collect::<PyResult<_>>()?).map_err(file_error)?;
        Ok(verilog.circuit)
    }
}

fn at_least_one(keyword: &str, given: Option<u32>) -> PyResult<NonZeroU32> {
    let number = NonZeroU32::new(given.unwrap_or(1));
    number.ok_or_else(|| refused(format!("{keyword}: 0 is too few; give 1 or more")))
}

/// Fuses integers as hardware does. Words have the bits of the array, whose type the output has.
pub(crate) fn fuse<'py>(
    bank: &Bank,
    x: &Bound<'py, PyAny>,
    shape: ArrayShape,
    accumulator: u32,
    keep_latency: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let held = Held::new(x, shape)?;
    if !held.format.name().starts_with('i') {
        let given = held.format.name();
        return Err(refused(format!(
            "hardware takes integers, not samples of {given}; convert them to i1, i2 or i4"
        )));
    }
    let bits = 8 * held.format.bytes() as u32;
    let words = WordSizes { input: bits, accumulator, output: bits };
    let mut model = BitTrue::new(bank, words).map_err(refused)?;
    // A power of two: the product is the integer itself.
    let full_scale = f64::from(bits - 1).exp2();
    let channels = held.captures()?.channels;
    let frame = |k: usize| channels.iter().map(move |channel| (channel.samples[k] * full_scale) as i32);
    let mut frames: Vec<i32> = (0..held.frames()).flat_map(frame).collect();
    let skip = if keep_latency { 0 } else { bank.output_delay() };
    let wanted = held.frames() * bank.ratio;
    frames.extend(model.resting().repeat(skip.div_ceil(bank.ratio)));
    let fast = x.py().detach(|| model.filtered(&frames));
    model.warnings().iter().try_for_each(|warning| warn(x.py(), warning))?;
    let y = PyArray1::from_slice(x.py(), &fast[skip..skip + wanted]);
    y.call_method1("astype", (held.format.name(),))
}
