//! Of which converters captures come, and how their files are read.

use crate::bank::{Bank, FrameLayout};
use crate::io::table::TableOptions;
use crate::io::{Coding, MultiReader, ReadOptions, StatedScale, TimeInterleaving};
use crate::pipeline::matching::{self, InputMismatch, NotInTurn};
use crate::quantity::FullScale;
use crate::spec::Spec;
use crate::units::FastPeriods;

/// What is said of files that do not state their format.
#[derive(Debug, Clone, PartialEq)]
pub struct FileFormat {
    /// The coding of the samples.
    pub coding: Coding,
    /// Channels of each raw file; one each, or all in a single file, if `None`.
    pub channels: Option<usize>,
    /// The only channel to read of each file, from 0.
    pub only: Option<usize>,
    /// Pairs of channels are complex samples.
    pub is_iq: bool,
    /// Full scale of the converters.
    pub full_scale: Option<FullScale>,
    /// How tables are read.
    pub table: TableOptions,
}

impl FileFormat {
    /// Of so many files that together have `channels` channels.
    pub fn options(self, files: usize, channels: usize) -> ReadOptions<'static> {
        let Self { coding, only, is_iq, full_scale, table, .. } = self;
        let usual = if files == 1 && only.is_none() { channels } else { 1 };
        let channels = self.channels.unwrap_or(usual);
        let scale = StatedScale { given: full_scale, ..StatedScale::default() };
        ReadOptions { coding, channels, only, is_iq, scale, table, ..ReadOptions::files() }
    }
}

/// The converters of a bank or a spec.
#[derive(Debug, Clone)]
pub struct Converters<'a> {
    source: ConverterSource<'a>,
    layout: FrameLayout,
}

#[derive(Debug, Clone, Copy)]
enum ConverterSource<'a> {
    Bank(&'a Bank),
    Spec(&'a Spec),
}

impl<'a> From<&'a Bank> for Converters<'a> {
    fn from(bank: &'a Bank) -> Self {
        Self { source: ConverterSource::Bank(bank), layout: bank.layout() }
    }
}

impl<'a> From<&'a Spec> for Converters<'a> {
    fn from(spec: &'a Spec) -> Self {
        Self { source: ConverterSource::Spec(spec), layout: spec.layout() }
    }
}

impl Converters<'_> {
    /// The samples of a frame.
    pub fn layout(&self) -> &FrameLayout {
        &self.layout
    }

    fn spec(&self) -> Option<&Spec> {
        match self.source {
            ConverterSource::Bank(bank) => bank.spec.as_ref(),
            ConverterSource::Spec(spec) => Some(spec),
        }
    }

    /// In periods of the output.
    fn delays(&self) -> Vec<FastPeriods> {
        match self.source {
            ConverterSource::Bank(bank) => bank.delays_in_fast_periods(),
            ConverterSource::Spec(spec) => spec.delays_in_fast_periods(),
        }
    }

    /// The order in which so many converters take turns in one captures.
    ///
    /// # Errors
    /// [`NotInTurn`].
    pub fn interleaving(&self, converters: usize) -> Result<TimeInterleaving, NotInTurn> {
        matching::interleaving(converters, &self.delays(), &self.layout)
    }

    /// What is stated of the full scale of the converters, by the user and by the spec.
    pub fn scale(&self, given: Option<FullScale>) -> StatedScale {
        let spec = self.spec();
        // No file says which converter has which number of bits.
        let bits = spec.and_then(|spec| spec.channels.first()?.bits);
        let bits = bits.filter(|_| spec.is_some_and(|spec| spec.channels.iter().all(|one| one.bits == bits)));
        StatedScale { given, of_spec: spec.and_then(|spec| spec.full_scale), bits }
    }

    /// How so many files of these converters are read. The spec states a full scale if the files do not.
    pub fn options<'a>(
        &'a self,
        format: FileFormat,
        files: usize,
        interleaving: Option<&'a TimeInterleaving>,
    ) -> ReadOptions<'a> {
        let scale = self.scale(format.full_scale);
        let own = format.options(files, matching::channels_of_raw(&self.layout, files));
        let samples_per_frame = matching::samples_per_frame(&self.layout, files);
        ReadOptions { interleaving, samples_per_frame, scale, ..own }
    }

    /// The files have the rates of the spec, or all channels and rates of the bank called `name`, whose
    /// output has the rate that is returned.
    ///
    /// # Errors
    /// [`InputMismatch`].
    pub fn check(&self, name: &str, reader: &MultiReader) -> Result<Option<f64>, InputMismatch> {
        match self.source {
            ConverterSource::Spec(spec) => matching::check_rate(spec, reader).map(|()| None),
            ConverterSource::Bank(bank) => {
                matching::check_channels(&self.layout, name, reader)?;
                matching::output_rate(bank, reader).map(Some)
            }
        }
    }
}
