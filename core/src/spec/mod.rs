//! The spec of a bank: front ends, delays, rates and design settings, as an engineer writes them.
//!
//! Everything here is plain data in SI units; `hybank::analog` turns a [`FilterSpec`] into a
//! checked realisation and `hybank::design` turns a [`Spec`] into a bank.

mod design;
mod edit;
mod error;
mod error_box;
mod filter;
mod filter_rules;
mod filter_table;
mod fitting;
mod frames;
mod limits;
mod one_or_each;
mod passband;
mod reading;
mod signal;
mod sizes;
mod table;
mod tables;
mod uncertainty;
mod with_units;
mod word_lengths;

pub use crate::messages::Location;
pub use design::{DesignOverrides, DesignSpec, DesignTable, Method, Reduction};
pub use edit::{leaves_the_design_open, with_measurements_renamed};
pub use error::{At, refused};
pub use error::{Refusal, SpecError, SpecProblem};
pub use error_box::{ConverterErrors, ErrorBox, ErrorPoint};
pub(crate) use filter::no_models;
pub use filter::{
    Family, FilterModel, FilterModels, FilterSpec, MAX_RIPPLE_DB, MIN_RIPPLE_DB, MeasuredFilter,
    MeasurementFile,
};
pub use filter_rules::MAX_ORDER;
pub use fitting::{Cutoff, Fitting, UnknownFitting};
pub use frames::{FrameLayout, FrameSample};
pub use limits::{MAX_CHANNELS, MAX_LATENCY, MAX_OPTIMISED_TAPS, MAX_RATIO, MAX_TAPS};
pub(crate) use limits::{MAX_ENTRY, check_channel_count, check_fast_period, check_ratio};
pub use limits::{MAX_REDUCTION_LOSS_DB, MAX_STATES, MAX_TARGET_DB};
pub use limits::{check_gain, check_noise, check_nonlinearity, check_offset, within};
pub use one_or_each::OneOrEach;
pub use passband::Passband;
pub(crate) use reading::refusal;
pub use signal::{Band, ROUNDING_16_BITS, SignalSpec, SignalSpectrum, USUAL_RMS};
pub use sizes::{MAX_ERROR_STATES, MAX_FRONT_END_STATES};
pub(crate) use table::FromTable;
pub(crate) use tables::SpecTable;
pub use uncertainty::{HALF_WIDTH, UncertaintySpec, check_delay_half_width, for_channels};
pub(crate) use word_lengths::check_fraction_bits;
pub use word_lengths::{MAX_BITS, MAX_FRACTION_BITS, WordLengths};

use crate::quantity::{self, FullScale};
use crate::runtime::Nonlinearity;
use crate::units::{FastPeriods, GridTime, Hertz, Seconds};
use serde::{Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// A spec with the units resolved (seconds) and the omitted channel filters filled in.
///
/// Serialised with serde (or [`Spec::to_toml`]) it is a valid spec file in SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spec {
    /// Name for reports; free text.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// h, the period of the fast samples.
    pub fast_period: Seconds,
    /// M, fast samples per slow sample; where converters have [rates](ChannelSpec::rate) of their own, P,
    /// fast samples per frame.
    pub ratio: usize,
    /// m0, the latency in fast samples, with the [wait](FrameLayout::wait) for the rest of a frame; `None`
    /// lets the designer choose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency: Option<usize>,
    /// Full scale of captures whose format does not say it, such as tables; 1 if `None`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<FullScale>,
    /// What a calibration fits unless the command line says otherwise; empty for delays, gains and offsets.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fit: Vec<Fitting>,
    /// Phi_0, the filter of the ideal fast converter.
    #[serde(serialize_with = "as_table")]
    pub target: FilterSpec,
    /// The real channels, in the order of the recordings.
    #[serde(rename = "channel")]
    pub channels: Vec<ChannelSpec>,
    /// What the analog signal is; `None` weighs every frequency alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal: Option<SignalSpec>,
    /// How well the values of the channels are known, if the spec says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<UncertaintySpec>,
    /// The design settings.
    pub design: DesignSpec,
}

/// One slow converter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelSpec {
    /// D_i >= 0.
    pub delay: Seconds,
    /// The converter's own sample rate. `None` for all channels, with one sample of each in a frame, or for
    /// none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Hertz>,
    /// Phi_i.
    pub filter: FilterSpec,
    /// sigma_i: rms of the converter's own white noise, relative to full scale.
    #[serde(skip_serializing_if = "is_zero")]
    pub noise: f64,
    /// Bits of the converter, whose rounding is noise too; `None` for no rounding.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// Rms of the distance of a sampling instant from its nominal one, other at each sample.
    #[serde(skip_serializing_if = "is_exact")]
    pub jitter: Seconds,
    /// g_i: the converter's gain relative to nominal. With y the output of Phi_i at the sampling instant,
    /// the converter delivers the sample g_i y + o_i.
    #[serde(skip_serializing_if = "is_one")]
    pub gain: f64,
    /// o_i: the converter's offset, relative to full scale.
    #[serde(skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// What a sample also contains, which is subtracted before anything else.
    #[serde(skip_serializing_if = "Nonlinearity::is_straight")]
    pub nonlinearity: Nonlinearity,
}

impl ChannelSpec {
    /// A converter without noise, gain error, offset and nonlinearity.
    pub fn new(delay: Seconds, filter: FilterSpec) -> Self {
        Self {
            delay,
            rate: None,
            filter,
            noise: 0.0,
            bits: None,
            jitter: Seconds(0.0),
            gain: 1.0,
            offset: 0.0,
            nonlinearity: Nonlinearity::default(),
        }
    }

    /// Checks the numbers, for the fast period `h`.
    fn check(&self, h: Seconds) -> Result<(), SpecError> {
        limits::check_delay(self.delay, self.delay.in_fast_periods(h)).at("delay")?;
        self.filter.check().map_err(|error| error.inside("filter"))?;
        limits::check_noise(self.noise).at("noise")?;
        self.bits.map_or(Ok(()), limits::check_converter_bits).at("bits")?;
        limits::check_jitter(self.jitter.in_fast_periods(h), self.jitter.0).at("jitter")?;
        check_gain(self.gain).at("gain")?;
        check_offset(self.offset).at("offset")?;
        check_nonlinearity(&self.nonlinearity).at("nonlinearity")
    }

    /// The sample that is left of `x` without the nonlinearity.
    pub fn straightened(&self, x: f64) -> f64 {
        x - self.nonlinearity.at(x)
    }

    /// Rms of the noise and of the rounding together, relative to full scale.
    pub fn sample_noise(&self) -> f64 {
        self.noise.hypot(self.rounding())
    }

    /// Rms of the rounding: a step of 2^(1 - bits) is an error of step / sqrt(12).
    pub fn rounding(&self) -> f64 {
        self.bits.map_or(0.0, |bits| 2f64.powi(1 - bits as i32) / 12f64.sqrt())
    }
}

fn is_exact(time: &Seconds) -> bool {
    time.0 == 0.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_one(gain: &f64) -> bool {
    *gain == 1.0
}

impl Spec {
    /// Reads a spec file's text; `file_name` is used only in messages.
    ///
    /// # Errors
    /// [`SpecError`] with line, column, rule and remedy for the first thing that is wrong.
    pub fn from_toml(text: &str, file_name: &str) -> Result<Self, SpecError> {
        Self::from_toml_and_files(text, file_name, DesignOverrides::default(), &no_models)
    }

    /// Reads a spec file's text with parts of its `[design]` table replaced before it is checked: a file
    /// without taps is complete when the command line gives them. Filters may be measurements in other
    /// files, of which `models` makes filters. Their errors become half-widths of the gains in the
    /// uncertainty, where they matter.
    ///
    /// # Errors
    /// As [`Spec::from_toml`], and those of `models`; [`SpecError::overridden`] distinguishes errors in
    /// `overrides` from errors in the file.
    pub fn from_toml_and_files(
        text: &str,
        file_name: &str,
        overrides: DesignOverrides,
        models: &FilterModels<'_>,
    ) -> Result<Self, SpecError> {
        let table: Result<SpecTable, SpecError> = reading::of_toml(text);
        table
            .and_then(|table| table.spec(overrides, models))
            .map_err(|error| reading::in_text(error, file_name, text))
    }

    /// As [`Spec::from_toml_and_files`], of data that have no text: the tables and lists of another
    /// language, with the keys of a spec file. `name` is used only in messages.
    ///
    /// # Errors
    /// As [`Spec::from_toml_and_files`], without a location; the path of keys says where.
    pub fn from_data<'de, D: Deserializer<'de>>(
        data: D,
        name: &str,
        overrides: DesignOverrides,
        models: &FilterModels<'_>,
    ) -> Result<Self, SpecError> {
        let table: Result<FromTable<SpecTable>, SpecError> = reading::of_data(data);
        table.and_then(|FromTable(table)| table.spec(overrides, models)).map_err(|error| error.in_file(name))
    }

    /// The spec as a TOML file that reads back equal, with units where time is not normalised.
    ///
    /// # Errors
    /// As [`Spec::check`]; NaN and infinity in particular are refused.
    pub fn to_toml(&self) -> Result<String, SpecError> {
        self.check()?;
        let text = toml::to_string(self)
            .map_err(|error| Refusal::new("", SpecProblem::Value { message: error.to_string() }))?;
        Ok(if self.is_normalised() { text } else { with_units::with_units(&text, self.fast_period) })
    }

    /// Checks a spec, whether it was read or built in memory.
    ///
    /// # Errors
    /// [`SpecError`] with the path of keys for the first thing that is wrong.
    pub fn check(&self) -> Result<(), SpecError> {
        limits::check_fast_period(self.fast_period).at("fast_period")?;
        limits::check_ratio(self.ratio).at("ratio")?;
        self.latency.map_or(Ok(()), limits::check_latency).at("latency")?;
        // A full scale is right if what is written of it is.
        let full_scale =
            self.full_scale.map_or(Ok(()), |scale| quantity::full_scale(&scale.to_string()).map(drop));
        full_scale.map_err(|error| SpecProblem::Value { message: error.to_string() }).at("full_scale")?;
        fitting::check(&self.fit).at("fit")?;
        self.target.check().map_err(|error| error.inside("target.filter"))?;
        limits::check_channel_count(self.channels.len()).at("channel")?;
        for (i, channel) in self.channels.iter().enumerate() {
            let inside = |error: SpecError| error.inside(&format!("channel[{i}]"));
            channel.check(self.fast_period).map_err(inside)?;
        }
        self.signal.as_ref().map_or(Ok(()), SignalSpec::check).map_err(|error| error.inside("signal"))?;
        let layout = frames::checked(self.fast_period, self.ratio, &self.channels)?;
        frames::check_latency(self.latency, layout.wait(&self.delays())).at("latency")?;
        if let Some(uncertainty) = &self.uncertainty {
            let checked = uncertainty.check(self.channels.len(), self.fast_period);
            checked.map_err(|error| error.inside("uncertainty"))?;
        }
        let design = self.design.check(&layout);
        let design =
            design.and_then(|()| self.design.check_beside(self.uncertainty.as_ref(), self.channels.len()));
        design.map_err(|error| error.inside("design"))?;
        self.check_sizes(&layout)
    }

    /// Whether the filters are FIR: by the method, by its taps, or because `h2` averages over uncertain
    /// delays and gains, which no recursive filter does exactly.
    pub fn is_fir(&self) -> bool {
        let is_uncertain = |table: &UncertaintySpec| table.has_delays_or_gains(self.channels.len());
        let averages = || self.uncertainty.as_ref().is_some_and(is_uncertain);
        self.design.is_fir() || self.design.method == Method::H2 && averages()
    }

    /// True in normalised time: times are in fast periods, and the rates of recordings are free.
    pub fn is_normalised(&self) -> bool {
        self.fast_period == Seconds(1.0)
    }

    /// The frames of the converters' samples.
    pub fn layout(&self) -> FrameLayout {
        frames::of_channels(self.fast_period, self.ratio, &self.channels)
    }

    /// The same front ends with a channel of the common slow rate for each sample of a frame, whose delays
    /// are rounded to seconds; without the uncertainty, which these channels share.
    pub fn per_sample(&self) -> Self {
        let layout = self.layout();
        let delays = layout.waited_delays(&self.delays()).into_iter();
        let channel = |(converter, delay): (usize, GridTime)| ChannelSpec {
            delay: delay.in_fast_periods().in_seconds(self.fast_period),
            rate: None,
            ..self.channels[converter].clone()
        };
        match layout.is_plain() && self.wait() == 0 {
            true => self.clone(),
            false => Self {
                channels: layout.owners().into_iter().zip(delays).map(channel).collect(),
                uncertainty: None,
                ..self.clone()
            },
        }
    }

    /// S, the part of a latency for which a frame waits for its last sample; 0 for converters of one rate
    /// without negative delays.
    pub fn wait(&self) -> usize {
        self.layout().wait(&self.delays())
    }

    /// D_i of every channel.
    pub fn delays(&self) -> Vec<GridTime> {
        self.channels.iter().map(|channel| GridTime::new(channel.delay, self.fast_period)).collect()
    }

    /// D_i / h of every channel.
    pub fn delays_in_fast_periods(&self) -> Vec<FastPeriods> {
        self.delays().into_iter().map(GridTime::in_fast_periods).collect()
    }
}

impl DesignOverrides {
    /// Reads the keys of a `[design]` table from data that have no text.
    ///
    /// # Errors
    /// As [`Spec::from_data`].
    pub fn from_data<'de, D: Deserializer<'de>>(data: D, name: &str) -> Result<Self, SpecError> {
        let table: Result<FromTable<Self>, SpecError> = reading::of_data(data);
        table.map(|FromTable(keys)| keys).map_err(|error| error.in_file(name))
    }
}

/// The target's table.
fn as_table<S: Serializer>(filter: &FilterSpec, serializer: S) -> Result<S::Ok, S::Error> {
    BTreeMap::from([("filter", filter)]).serialize(serializer)
}

#[cfg(test)]
mod tests;
