//! Turns a document into a [`Spec`]: resolves units, fills in omitted filters, checks all rules.

use super::design::{AFFINE, DesignOverrides, Method, Reduction};
use super::error::KeyProblem;
use super::filter::{FilterModel, FilterModels};
use super::filter_reader::{FILTER_FORMS, front_end};
use super::reader::{Either, Fields, Value};
use super::word_lengths::{fraction_bits, word_lengths};
use super::{
    ChannelSpec, DesignSpec, Fault, FrameLayout, PerChannel, Spec, SpecProblem, UncertaintySpec, fitting,
    frames, limits, signal,
};
use crate::quantity::Time;
use crate::units::{Decibels, FastPeriods, GridTime, Hertz, Seconds};

const TOP_KEYS: [&str; 12] = [
    "name",
    "fast_period",
    "fast_rate",
    "ratio",
    "latency",
    "full_scale",
    "fit",
    "target",
    "channel",
    "signal",
    "uncertainty",
    "design",
];
const TARGET_KEYS: [&str; 1] = ["filter"];
const CHANNEL_KEYS: [&str; 9] =
    ["delay", "delay_samples", "rate", "filter", "noise", "bits", "jitter", "gain", "offset"];
const DESIGN_KEYS: [&str; 11] = [
    "method",
    "taps",
    "target_snr_db",
    "gamma_margin",
    "bits",
    "fraction_bits",
    "loss_db",
    "tracking",
    "order",
    "reduction_loss_db",
    "noise",
];
const UNCERTAINTY_KEYS: [&str; 6] = ["delay", "delay_samples", "gain", "cutoff", "offset", "reference"];

/// The advice for two keys of one value in two units.
const SAME_MEANING: &str = "they have the same meaning, keep one of them";

/// Errors of models below this, in decibels, are not carried into the uncertainty: 1.2e-4 of the gain.
const LEAST_MODEL_ERROR_DB: f64 = 1e-3;

/// Reads the whole spec.
pub(crate) fn spec(
    document: &Value<'_>,
    overrides: DesignOverrides,
    models: &FilterModels<'_>,
) -> Result<Spec, Fault> {
    whole(document, overrides, models).map_err(|mut fault| {
        if let SpecProblem::UnknownKey { key, homes, .. } = &mut *fault.problem {
            *homes = tables_with(key);
        }
        fault
    })
}

/// The tables that have a key of this name.
fn tables_with(key: &str) -> Vec<&'static str> {
    let filter = FILTER_FORMS.concat();
    let all: [(&[&str], &'static str); 7] = [
        (&TOP_KEYS, "at the top of the file, before the first table"),
        (&TARGET_KEYS, "under [target]"),
        (&CHANNEL_KEYS, "under [[channel]]"),
        (&signal::KEYS, "under [signal]"),
        (&DESIGN_KEYS, "under [design]"),
        (&UNCERTAINTY_KEYS, "under [uncertainty]"),
        (&filter, "in a filter, filter = { .. }"),
    ];
    all.iter().filter(|(keys, _)| keys.contains(&key)).map(|(_, home)| *home).collect()
}

fn whole(document: &Value<'_>, overrides: DesignOverrides, models: &FilterModels<'_>) -> Result<Spec, Fault> {
    let top = document.fields(&TOP_KEYS)?;
    let name = top.read("name", |v| v.text())?.unwrap_or_default().to_owned();
    let h = fast_period(&top)?;
    let ratio = top.read("ratio", |v| v.count_in("fast samples", limits::check_ratio))?;
    if ratio.is_none() && !has_rates(&top) {
        let remedy = "give M, the number of fast samples per slow sample, or the rate of every channel";
        return Err(top.whole().fault(SpecProblem::MissingKey { key: "ratio", remedy }));
    }
    let latency = top.read("latency", |v| v.count_in("fast samples", limits::check_latency))?;
    let full_scale = top.read("full_scale", |v| v.full_scale())?;
    let fit = top.read("fit", |v| fitting::read(&v))?.unwrap_or_default();
    let target = top
        .required("target", "describe the filter of the ideal fast converter, [target] filter = { .. }")?
        .fields(&TARGET_KEYS)?;
    let target = front_end(&target.required("filter", "give the target's analog filter")?, h, models)?;
    let signal = top.read("signal", |v| signal::read(&v))?;
    let table = top.read("design", |v| v.fields(&DESIGN_KEYS))?;
    let noise = table.as_ref().map_or(Ok(None), noise)?.unwrap_or(0.0);
    let (mut channels, errors): (Vec<_>, Vec<_>) =
        channels(&top, &Common { h, target: &target, noise, models })?.into_iter().unzip();
    let ratio = frame_ratio(&top, h, ratio, &mut channels)?;
    let layout = frames::of_channels(h, ratio, &channels);
    let delays: Vec<_> = channels.iter().map(|channel| GridTime::new(channel.delay, h)).collect();
    frames::check_latency(latency, layout.wait(&delays))
        .map_err(|problem| top.fault_at(Some("latency"), problem))?;
    let uncertainty = top.read("uncertainty", |v| uncertainty(&v, channels.len(), h))?;
    let uncertainty = with_model_errors(uncertainty, &errors);
    // A table that is absent is blamed as the whole document.
    let blamed = table.as_ref().unwrap_or(&top);
    let design = design(table.as_ref(), blamed, &overrides, &layout)?;
    frames::check_size(&layout, design.is_coupled(), h)
        .map_err(|problem| top.fault_at(Some("channel"), problem))?;
    design.check_beside(uncertainty.as_ref(), channels.len()).map_err(|KeyProblem { key, problem }| {
        if overrides.gives(key) {
            Fault::overriding(key, problem)
        } else {
            blamed.fault_at(Some(key), problem)
        }
    })?;
    let target = target.filter;
    Ok(Spec {
        name,
        fast_period: h,
        ratio,
        latency,
        full_scale,
        fit,
        target,
        channels,
        signal,
        uncertainty,
        design,
    })
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
    let gain = PerChannel::Each(errors.iter().enumerate().map(gain).collect());
    Some(UncertaintySpec { gain: Some(gain), ..table })
}

/// h, from one of its two spellings.
fn fast_period(top: &Fields<'_>) -> Result<Seconds, Fault> {
    match top.either("fast_period", "fast_rate", SAME_MEANING)? {
        Either::First(period) => seconds(&period),
        Either::Second(rate) => {
            let written = rate.rate()?;
            limits::check_fast_rate(written).map_err(|problem| rate.fault(problem))?;
            Ok(written.period())
        }
        Either::Neither => {
            let remedy = "give fast_period in seconds or fast_rate in hertz";
            Err(top.whole().fault(SpecProblem::MissingKey { key: "fast_period", remedy }))
        }
    }
}

/// The fast period itself cannot be given in samples.
fn seconds(period: &Value<'_>) -> Result<Seconds, Fault> {
    let Time::Seconds(h) = period.time()? else {
        let expected = "the fast period in seconds, as in 1e-9 or \"1 ns\"";
        return Err(period.fault(SpecProblem::WrongType { expected, found: "a number of samples" }));
    };
    limits::check_fast_period(h).map_err(|problem| period.fault(problem))?;
    Ok(h)
}

/// Whether every channel has a rate of its own.
fn has_rates(top: &Fields<'_>) -> bool {
    let list = top.optional("channel").and_then(|list| list.items("a list").ok()).unwrap_or_default();
    !list.is_empty() && list.iter().all(|item| item.entry("rate").is_ok())
}

/// Fast samples per frame. Channels without a rate have that of the `ratio`; where all have one rate, none
/// keeps it.
fn frame_ratio(
    top: &Fields<'_>,
    h: Seconds,
    ratio: Option<usize>,
    channels: &mut [ChannelSpec],
) -> Result<usize, Fault> {
    if let Some(ratio) = ratio
        && channels.iter().all(|channel| channel.rate.is_none())
    {
        return Ok(ratio);
    }
    let common = ratio.map(|ratio| (h * ratio as f64).rate());
    let rates: Vec<Hertz> = channels.iter().filter_map(|channel| channel.rate.or(common)).collect();
    let layout = frames::layout(h, &rates).map_err(|refused| {
        let list = top.optional("channel").and_then(|list| list.items("a list").ok());
        let channel = refused.channel.and_then(|i| list?.get(i)?.entry("rate").ok());
        let blamed = channel.or_else(|| top.optional("channel")).unwrap_or_else(|| top.whole().clone());
        blamed.fault(refused.problem)
    })?;
    if let Some(ratio) = ratio.filter(|&ratio| ratio != layout.ratio())
        && channels.iter().all(|channel| channel.rate.is_some())
    {
        let rule = format!(
            "every channel has a rate, and these make frames of {} fast samples; leave ratio out",
            layout.ratio()
        );
        return Err(top.fault_at(Some("ratio"), limits::range(ratio as f64, "fast samples", rule)));
    }
    for (channel, rate) in channels.iter_mut().zip(rates) {
        channel.rate = (!layout.is_plain()).then_some(rate);
    }
    Ok(layout.ratio())
}

/// Defaults of a channel.
struct Common<'a> {
    h: Seconds,
    target: &'a FilterModel,
    noise: f64,
    models: &'a FilterModels<'a>,
}

/// sigma, of all channels in `[design]` or of one in its own table.
fn noise(fields: &Fields<'_>) -> Result<Option<f64>, Fault> {
    fields.read("noise", |v| v.number_in(limits::check_noise))
}

/// The channels, each with the error of its filter's model.
fn channels(top: &Fields<'_>, common: &Common<'_>) -> Result<Vec<(ChannelSpec, Decibels)>, Fault> {
    let list = top
        .required("channel", "describe every slow converter in a table of its own, [[channel]] delay = ..")?;
    if list.is_table() {
        return Err(list.fault(SpecProblem::SingleTable { key: "channel" }));
    }
    let items = list.items("a list of tables, each headed [[channel]]")?;
    limits::check_channel_count(items.len()).map_err(|problem| list.fault(problem))?;
    items.iter().map(|item| channel(item, common)).collect()
}

fn channel(item: &Value<'_>, common: &Common<'_>) -> Result<(ChannelSpec, Decibels), Fault> {
    let fields = item.fields(&CHANNEL_KEYS)?;
    let delay = delay(&fields, common.h)?;
    let model = fields.read("filter", |v| front_end(&v, common.h, common.models))?;
    let FilterModel { filter, error } = model.unwrap_or_else(|| common.target.clone());
    // Noise of -0.0 is noise of 0.0, and so are offset and jitter.
    let channel = ChannelSpec {
        delay,
        rate: fields.read("rate", |v| v.rate())?,
        filter,
        noise: noise(&fields)?.unwrap_or(common.noise) + 0.0,
        gain: fields.read("gain", |v| v.number_in(limits::check_gain))?.unwrap_or(1.0),
        offset: fields.read("offset", |v| v.number_in(limits::check_offset))?.unwrap_or(0.0) + 0.0,
        bits: fields.read("bits", |v| {
            let bits = v.bits()?;
            limits::check_converter_bits(bits).map(|()| bits).map_err(|problem| v.fault(problem))
        })?,
        jitter: fields.read("jitter", |v| jitter(&v, common.h))?.unwrap_or(Seconds(0.0)) + Seconds(0.0),
    };
    Ok((channel, error))
}

/// The rms jitter of a converter.
fn jitter(value: &Value<'_>, h: Seconds) -> Result<Seconds, Fault> {
    let jitter = value.time()?.in_seconds(h);
    limits::check_jitter(jitter.in_fast_periods(h), jitter.0).map_err(|problem| value.fault(problem))?;
    Ok(jitter)
}

/// D_i, from one of its two spellings.
fn delay(fields: &Fields<'_>, h: Seconds) -> Result<Seconds, Fault> {
    let (value, written) = match fields.either("delay", "delay_samples", SAME_MEANING)? {
        Either::First(delay) => (delay.clone(), delay.time()?),
        Either::Second(samples) => (samples.clone(), Time::Samples(FastPeriods(samples.number()?))),
        Either::Neither => {
            let remedy = "give delay in seconds or delay_samples in fast periods (0 for none)";
            return Err(fields.whole().fault(SpecProblem::MissingKey { key: "delay", remedy }));
        }
    };
    let delay = written.in_seconds(h);
    let (number, unit) = match written {
        Time::Seconds(time) => (time.0, "s"),
        Time::Samples(periods) => (periods.0, "fast periods"),
    };
    limits::check_delay(delay.in_fast_periods(h), number, unit).map_err(|problem| value.fault(problem))?;
    // A delay of -0.0 is a delay of 0.0.
    Ok(delay + Seconds(0.0))
}

/// The `[uncertainty]` table.
fn uncertainty(item: &Value<'_>, channels: usize, h: Seconds) -> Result<UncertaintySpec, Fault> {
    let fields = item.fields(&UNCERTAINTY_KEYS)?;
    let shares = |key| fields.read(key, |v| per_channel(&v, Value::share));
    let (delay_key, delay) = match fields.either("delay", "delay_samples", SAME_MEANING)? {
        Either::First(v) => ("delay", Some(per_channel(&v, |v| Ok(v.time()?.in_seconds(h)))?)),
        Either::Second(v) => {
            let samples = |v: &Value<'_>| v.number().map(|n| FastPeriods(n).in_seconds(h));
            ("delay_samples", Some(per_channel(&v, samples)?))
        }
        Either::Neither => ("delay", None),
    };
    let table = UncertaintySpec {
        delay,
        gain: shares("gain")?,
        offset: shares("offset")?,
        cutoff: shares("cutoff")?,
        reference: fields.read("reference", |v| v.count("(channel)"))?,
    };
    table.check(channels, h).map_err(|KeyProblem { key, problem }| {
        fields.fault_at(Some(if key == "delay" { delay_key } else { key }), problem)
    })?;
    Ok(table)
}

/// One value for all channels, or a list of values. The length of the list is checked where that of the
/// channels is known.
fn per_channel<'a, T>(
    value: &Value<'a>,
    read: impl Fn(&Value<'a>) -> Result<T, Fault>,
) -> Result<PerChannel<T>, Fault> {
    match value.items("a number, or a list of numbers") {
        Ok(items) => items.iter().map(read).collect::<Result<_, _>>().map(PerChannel::Each),
        Err(_) => read(value).map(PerChannel::Same),
    }
}

/// The `[design]` table, if there is one; problems of keys that are absent are those of `blamed`.
fn design(
    table: Option<&Fields<'_>>,
    blamed: &Fields<'_>,
    overrides: &DesignOverrides,
    layout: &FrameLayout,
) -> Result<DesignSpec, Fault> {
    let written = table.map_or(Ok(DesignOverrides::default()), written)?;
    let design = overrides.clone().over(written).resolved();
    match design.check(layout) {
        Ok(()) => Ok(design),
        Err(KeyProblem { key, problem }) => Err(match overriding(overrides, key, &problem) {
            Some(given) => Fault::overriding(given, problem),
            None if matches!(problem, SpecProblem::MissingKey { .. }) => blamed.whole().fault(problem),
            None => blamed.fault_at(Some(key), problem),
        }),
    }
}

/// The keys of a `[design]` table that stands alone.
pub(crate) fn design_keys(table: &Value<'_>) -> Result<DesignOverrides, Fault> {
    written(&table.fields(&DESIGN_KEYS)?)
}

/// The keys that are written.
fn written(table: &Fields<'_>) -> Result<DesignOverrides, Fault> {
    let order = |v: Value<'_>| v.count_in("states", limits::check_order);
    Ok(DesignOverrides {
        method: table.read("method", |v| v.name("method", &Method::ALL.map(|m| (m.name(), m))))?,
        taps: table.read("taps", |v| v.count_in("taps", limits::check_taps))?,
        target_snr_db: table
            .read("target_snr_db", |v| v.number_in(limits::check_target_snr))?
            .map(|db| db + 0.0),
        gamma_margin: table.read("gamma_margin", |v| v.number_in(limits::check_gamma_margin))?,
        bits: table.read("bits", |v| word_lengths(&v))?,
        fraction_bits: table.read("fraction_bits", |v| fraction_bits(&v))?,
        loss_db: table.read("loss_db", |v| v.number_in(limits::check_word_loss))?.map(|db| db + 0.0),
        tracking: table.read("tracking", |v| v.name("tracking", &[(AFFINE, true)]))?.unwrap_or(false),
        reduction: match table.either(
            "order",
            "reduction_loss_db",
            "each determines the other, keep one of them",
        )? {
            Either::First(value) => Some(Reduction::Order(order(value)?)),
            Either::Second(db) => Some(Reduction::Loss(db.number_in(limits::check_reduction_loss)? + 0.0)),
            Either::Neither => None,
        },
    })
}

/// The key of `overrides` that causes a problem with `key`, if there is one.
fn overriding(overrides: &DesignOverrides, key: &'static str, problem: &SpecProblem) -> Option<&'static str> {
    let other_length = key == "bits" && matches!(problem, SpecProblem::Range { unit: "entries", .. });
    let cause = if other_length && !overrides.gives(key) { "taps" } else { key };
    overrides.gives(cause).then_some(cause)
}
