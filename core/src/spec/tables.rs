//! The tables of a spec file as serde reads them, and the spec that they make: units resolved, omitted
//! filters and defaults filled in. [`Spec::check`] has the rules for the numbers.

use serde::Deserialize;

use super::error::{At, refused};
use super::filter_table::FilterTable;
use super::table::FromTable;
use super::{
    Band, ChannelSpec, DesignOverrides, FilterModel, FilterModels, Fitting, OneOrEach, Refusal, SignalSpec,
    SignalSpectrum, Spec, SpecError, SpecProblem, USUAL_RMS, UncertaintySpec, frames, limits,
};
use crate::quantity::{FullScale, Rate, Share, WrittenTime};
use crate::runtime::Nonlinearity;
use crate::units::{Decibels, FastPeriods, Hertz, Seconds};

/// Errors of models below this, in decibels, are not carried into the uncertainty: 1.2e-4 of the gain.
const LEAST_MODEL_ERROR_DB: f64 = 1e-3;

/// The whole file.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct SpecTable {
    name: String,
    fast_period: Option<WrittenTime>,
    fast_rate: Option<Rate>,
    ratio: Option<usize>,
    latency: Option<usize>,
    full_scale: Option<FullScale>,
    fit: Vec<Fitting>,
    target: Option<FromTable<TargetTable>>,
    channel: Option<Vec<FromTable<ChannelTable>>>,
    signal: Option<FromTable<SignalTable>>,
    uncertainty: Option<FromTable<UncertaintyTable>>,
    design: Option<FromTable<DesignOverrides>>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TargetTable {
    filter: Option<FromTable<FilterTable>>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ChannelTable {
    delay: Option<WrittenTime>,
    delay_samples: Option<f64>,
    rate: Option<Rate>,
    filter: Option<FromTable<FilterTable>>,
    noise: Option<f64>,
    bits: Option<u32>,
    jitter: Option<WrittenTime>,
    gain: Option<f64>,
    offset: Option<f64>,
    nonlinearity: Nonlinearity,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct SignalTable {
    band: Option<OneOrEach<Hertz>>,
    filter: Option<FromTable<FilterTable>>,
    floor_db: Option<f64>,
    rms: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct UncertaintyTable {
    delay: Option<OneOrEach<WrittenTime>>,
    delay_samples: Option<OneOrEach<f64>>,
    gain: Option<OneOrEach<Share>>,
    cutoff: Option<OneOrEach<Share>>,
    offset: Option<OneOrEach<Share>>,
    reference: Option<usize>,
}

/// Two keys that exclude each other.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub(super) first: &'static str,
    pub(super) second: &'static str,
    pub(super) remedy: &'static str,
}

const FAST_PERIOD: Pair = Pair { first: "fast_period", second: "fast_rate", remedy: SAME_MEANING };
const DELAY: Pair = Pair { first: "delay", second: "delay_samples", remedy: SAME_MEANING };
const SPECTRUM: Pair =
    Pair { first: "band", second: "filter", remedy: "each is the spectrum of the signal, keep one of them" };
const SAME_MEANING: &str = "they have the same meaning, keep one of them";

impl Pair {
    /// The value of the key that is given.
    pub(super) fn only<T>(self, first: Option<T>, second: Option<T>) -> Result<Option<T>, SpecError> {
        let Self { first: one, second: other, remedy } = self;
        match (&first, &second) {
            (Some(_), Some(_)) => {
                Err(Refusal::new(other, SpecProblem::Conflict { first: one, second: other, remedy }))
            }
            _ => Ok(first.or(second)),
        }
    }
}

/// The value of a key, or the table without it.
pub(super) fn required<T>(value: Option<T>, key: &'static str, remedy: &'static str) -> Result<T, SpecError> {
    value.ok_or_else(|| Refusal::new("", SpecProblem::MissingKey { key, remedy }))
}

impl SpecTable {
    /// The spec of this file, with parts of its `[design]` table replaced.
    ///
    /// # Errors
    /// [`SpecError`] with the path of keys for the first thing that is wrong, and those of `models`.
    pub(crate) fn spec(
        self,
        overrides: DesignOverrides,
        models: &FilterModels<'_>,
    ) -> Result<Spec, SpecError> {
        let given = overrides.clone();
        let spec = self.unchecked(overrides, models)?;
        match spec.check() {
            Ok(()) => Ok(spec),
            Err(error) => Err(given.blamed(error)),
        }
    }

    fn unchecked(self, overrides: DesignOverrides, models: &FilterModels<'_>) -> Result<Spec, SpecError> {
        self.fast_rate.map_or(Ok(()), |rate| limits::check_rate(rate.0)).at("fast_rate")?;
        let rate = self.fast_rate.map(|rate| WrittenTime::Seconds(rate.0.period()));
        let h = match FAST_PERIOD.only(self.fast_period, rate)? {
            Some(WrittenTime::Seconds(h)) => h,
            Some(WrittenTime::Samples(_)) => {
                return Err(refused("fast_period", "it must be in seconds, as in 1e-9 or \"1 ns\""));
            }
            None => required(None, "fast_period", "give fast_period in seconds or fast_rate in hertz")?,
        };
        // Everything else is relative to it.
        limits::check_fast_period(h).at("fast_period")?;
        let remedy = "describe the filter of the ideal fast converter, [target] filter = { .. }";
        let FromTable(target) = required(self.target, "target", remedy)?;
        let target = required(target.filter, "filter", "give the target's analog filter")
            .and_then(|FromTable(filter)| filter.model(h, models).map_err(|error| error.inside("filter")))
            .map_err(|error| error.inside("target"))?;
        let design = overrides.over(self.design.unwrap_or_default().0);
        design.noise.map_or(Ok(()), limits::check_noise).at("design.noise")?;
        let common = Common { h, target: &target, noise: design.noise.unwrap_or(0.0), models };
        let remedy = "describe every slow converter in a table of its own, [[channel]] delay = ..";
        let tables = required(self.channel, "channel", remedy)?.into_iter().enumerate();
        let channel = |(i, FromTable(table)): (usize, FromTable<ChannelTable>)| {
            table.channel(&common).map_err(|error| error.inside(&format!("channel[{i}]")))
        };
        let channels = tables.map(channel).collect::<Result<Vec<_>, _>>()?;
        let (mut channels, errors): (Vec<_>, Vec<_>) = channels.into_iter().unzip();
        let ratio = frames::common_ratio(h, self.ratio, &mut channels)?;
        let signal =
            self.signal.map(|FromTable(table)| table.signal()).transpose().map_err(|e| e.inside("signal"))?;
        let uncertainty = self.uncertainty.map(|FromTable(table)| table.uncertainty(h)).transpose();
        let uncertainty = uncertainty.map_err(|error| error.inside("uncertainty"))?;
        Ok(Spec {
            name: self.name,
            fast_period: h,
            ratio,
            latency: self.latency,
            full_scale: self.full_scale,
            fit: self.fit,
            target: target.filter,
            channels,
            signal,
            uncertainty: with_model_errors(uncertainty, &errors),
            design: design.resolved(),
        })
    }
}

/// Defaults of a channel.
struct Common<'a> {
    h: Seconds,
    target: &'a FilterModel,
    noise: f64,
    models: &'a FilterModels<'a>,
}

impl ChannelTable {
    /// The channel, and the error of its filter's model.
    fn channel(self, common: &Common<'_>) -> Result<(ChannelSpec, Decibels), SpecError> {
        let samples = self.delay_samples.map(|periods| WrittenTime::Samples(FastPeriods(periods)));
        let remedy = "give delay in seconds or delay_samples in fast periods (0 for none)";
        let delay = required(DELAY.only(self.delay, samples)?, "delay", remedy)?;
        let model = self.filter.map(|FromTable(filter)| filter.model(common.h, common.models)).transpose();
        let FilterModel { filter, error } =
            model.map_err(|error| error.inside("filter"))?.unwrap_or_else(|| common.target.clone());
        let jitter = self.jitter.map_or(Seconds(0.0), |jitter| jitter.in_seconds(common.h));
        // A delay of -0.0 is a delay of 0.0, and so are noise, offset and jitter.
        let channel = ChannelSpec {
            delay: delay.in_seconds(common.h) + Seconds(0.0),
            rate: self.rate.map(|rate| rate.0),
            filter,
            noise: self.noise.unwrap_or(common.noise) + 0.0,
            bits: self.bits,
            jitter: jitter + Seconds(0.0),
            gain: self.gain.unwrap_or(1.0),
            offset: self.offset.unwrap_or(0.0) + 0.0,
            nonlinearity: self.nonlinearity,
        };
        Ok((channel, error))
    }
}

impl SignalTable {
    fn signal(self) -> Result<SignalSpec, SpecError> {
        let band = self.band.map(band).transpose().at("band")?.map(SignalSpectrum::Band);
        let filter = self
            .filter
            .map(|FromTable(filter)| filter.filter())
            .transpose()
            .map_err(|e| e.inside("filter"))?;
        let remedy = "say which frequencies the signal occupies, as in band = \"8 kHz\" or band = [\"60 MHz\", \"80 MHz\"]";
        let spectrum = SPECTRUM.only(band, filter.map(SignalSpectrum::Filter))?;
        let spectrum = required(spectrum, "band", remedy)?;
        Ok(SignalSpec { spectrum, floor_db: self.floor_db, rms: self.rms.unwrap_or(USUAL_RMS) })
    }
}

/// One frequency, the end of a band that begins at 0, or two.
fn band(written: OneOrEach<Hertz>) -> Result<Band, SpecProblem> {
    match written {
        OneOrEach::Same(high) => Ok(Band::up_to(high)),
        OneOrEach::Each(list) => match list[..] {
            // A band from -0.0 begins at 0.0.
            [low, high] => Ok(Band { low: Hertz(low.0 + 0.0), high }),
            _ => Err(SpecProblem::Value { message: "expected a frequency, or a list of two".to_owned() }),
        },
    }
}

impl UncertaintyTable {
    fn uncertainty(self, h: Seconds) -> Result<UncertaintySpec, SpecError> {
        let samples = self.delay_samples.map(|list| list.map(|n| WrittenTime::Samples(FastPeriods(*n))));
        let shares = |list: Option<OneOrEach<Share>>| list.map(|list| list.map(|share| share.0));
        Ok(UncertaintySpec {
            delay: DELAY.only(self.delay, samples)?.map(|list| list.map(|time| time.in_seconds(h))),
            gain: shares(self.gain),
            offset: shares(self.offset),
            cutoff: shares(self.cutoff),
            reference: self.reference,
        })
    }
}

/// The errors of the channels' models as further half-widths of their gains. Without a table each channel
/// has an error of its own.
fn with_model_errors(written: Option<UncertaintySpec>, errors: &[Decibels]) -> Option<UncertaintySpec> {
    if errors.iter().all(|error| error.0 < LEAST_MODEL_ERROR_DB) {
        return written;
    }
    let table = written.unwrap_or(UncertaintySpec { reference: Some(0), ..UncertaintySpec::default() });
    let gain = |(i, error): (usize, &Decibels)| {
        table.gain.as_ref().map_or(0.0, |gain| gain.of(i)) + 10f64.powf(error.0 / 20.0) - 1.0
    };
    let gain = OneOrEach::Each(errors.iter().enumerate().map(gain).collect());
    Some(UncertaintySpec { gain: Some(gain), ..table })
}
