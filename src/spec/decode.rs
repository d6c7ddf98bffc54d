//! Turns a document into a [`Spec`]: resolves units, fills in omitted filters, checks all rules.

use crate::units::{Decibels, FastPeriods, Seconds};

use super::Fault;
use super::design::DesignOverrides;
use super::design::KeyProblem;
use super::filter_reader::{FILTER_FORMS, filter};
use super::limits::{
    check_channel_count, check_converter_bits, check_delay, check_fast_period, check_fast_rate, check_gain,
    check_gamma_margin, check_jitter, check_latency, check_noise, check_offset, check_order, check_ratio,
    check_reduction_loss, check_taps, check_target_snr,
};
use super::measured::{FilterModel, FilterModels, MeasuredFilter, Measurement, no_models};
use super::reader::{Fields, Value};
use super::word_lengths::{WordLengths, check_fraction_bits};
use super::{
    ChannelSpec, Method, PerChannel, Reduction, Solver, Spec, SpecProblem, Tracking, UncertaintySpec, signal,
};
use crate::quantity::Time;

const TOP_KEYS: [&str; 10] = [
    "name",
    "fast_period",
    "fast_rate",
    "ratio",
    "latency",
    "target",
    "channel",
    "signal",
    "uncertainty",
    "design",
];
const CHANNEL_KEYS: [&str; 8] =
    ["delay", "delay_samples", "filter", "noise", "bits", "jitter", "gain", "offset"];
const DESIGN_KEYS: [&str; 11] = [
    "method",
    "taps",
    "target_snr_db",
    "gamma_margin",
    "solver",
    "bits",
    "fraction_bits",
    "tracking",
    "order",
    "reduction_loss_db",
    "noise",
];
const UNCERTAINTY_KEYS: [&str; 6] = ["delay", "delay_samples", "gain", "cutoff", "offset", "reference"];

/// The keys of a filter that is a measurement.
const MEASURED_KEYS: [&str; 5] = ["touchstone", "response", "order", "parameter", "deembed"];

/// Errors of models below this, in decibels, are not carried into the uncertainty: 1.2e-4 of the gain.
const NEGLIGIBLE_DB: f64 = 1e-3;

/// Reads the whole spec, whose filters are not measurements.
pub(crate) fn spec(document: &Value<'_>, overrides: DesignOverrides) -> Result<Spec, Fault> {
    spec_with(document, overrides, &no_models)
}

/// Reads the whole spec.
pub(crate) fn spec_with(
    document: &Value<'_>,
    overrides: DesignOverrides,
    models: &FilterModels<'_>,
) -> Result<Spec, Fault> {
    let top = document.fields(&TOP_KEYS)?;
    let name = top.optional("name").map(|v| v.text()).transpose()?.unwrap_or_default().to_owned();
    let fast_period = fast_period(&top)?;
    let ratio = top.required("ratio", "give M, the number of fast samples per slow sample")?;
    let ratio = checked_count(&ratio, "fast samples", check_ratio)?;
    let latency =
        top.optional("latency").map(|v| checked_count(&v, "fast samples", check_latency)).transpose()?;
    let target = top
        .required("target", "describe the filter of the ideal fast converter, [target] filter = { .. }")?
        .fields(&["filter"])?;
    let target = target.required("filter", "give the target's analog filter")?;
    let target = front_end(&target, fast_period, models)?;
    let signal = top.optional("signal").map(|v| signal::read(&v)).transpose()?;
    let table = top.optional("design").map(|table| table.fields(&DESIGN_KEYS)).transpose()?;
    let noise = noise(table.as_ref())?.unwrap_or(0.0);
    let (channels, errors): (Vec<_>, Vec<_>) =
        channels(&top, &Common { fast_period, target: &target, noise, models })?.into_iter().unzip();
    let uncertainty =
        top.optional("uncertainty").map(|v| uncertainty(&v, channels.len(), fast_period)).transpose()?;
    let uncertainty = with_model_errors(uncertainty, &errors);
    let given = [("tracking", overrides.tracking.is_some()), ("solver", overrides.solver.is_some())];
    let design = design(table.as_ref(), &top, overrides, channels.len())?;
    design.check_beside(uncertainty.as_ref(), channels.len()).map_err(|KeyProblem { key, problem }| {
        if given.contains(&(key, true)) {
            Fault::overriding(key, problem)
        } else {
            table.as_ref().unwrap_or(&top).fault_at(Some(key), problem)
        }
    })?;
    Ok(Spec {
        name,
        fast_period,
        ratio,
        latency,
        target: target.filter,
        channels,
        signal,
        uncertainty,
        design,
    })
}

/// The errors of the channels' models as further half-widths of their gains. Without a table each channel
/// has an error of its own.
fn with_model_errors(written: Option<UncertaintySpec>, errors: &[Decibels]) -> Option<UncertaintySpec> {
    if errors.iter().all(|error| error.0 < NEGLIGIBLE_DB) {
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
    match (top.optional("fast_period"), top.optional("fast_rate")) {
        (Some(_), Some(rate)) => {
            let remedy = "they have the same meaning, keep one of them";
            Err(rate.fault(SpecProblem::Conflict { first: "fast_period", second: "fast_rate", remedy }))
        }
        (Some(period), None) => seconds(&period),
        (None, Some(rate)) => {
            let written = rate.rate()?;
            check_fast_rate(written).map_err(|problem| rate.fault(problem))?;
            Ok(written.period())
        }
        (None, None) => {
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
    check_fast_period(h).map_err(|problem| period.fault(problem))?;
    Ok(h)
}

fn checked_number(value: &Value<'_>, check: fn(f64) -> Result<(), SpecProblem>) -> Result<f64, Fault> {
    let number = value.number()?;
    check(number).map_err(|problem| value.fault(problem))?;
    Ok(number)
}

fn checked_count(
    value: &Value<'_>,
    unit: &'static str,
    check: fn(usize) -> Result<(), SpecProblem>,
) -> Result<usize, Fault> {
    let count = value.count(unit)?;
    check(count).map_err(|problem| value.fault(problem))?;
    Ok(count)
}

/// Defaults of a channel.
struct Common<'a> {
    fast_period: Seconds,
    target: &'a FilterModel,
    noise: f64,
    models: &'a FilterModels<'a>,
}

/// sigma, of all channels in `[design]` or of one in its own table.
fn noise(table: Option<&Fields<'_>>) -> Result<Option<f64>, Fault> {
    table.and_then(|fields| fields.optional("noise")).map(|v| checked_number(&v, check_noise)).transpose()
}

/// The channels, each with the error of its filter's model.
fn channels(top: &Fields<'_>, common: &Common<'_>) -> Result<Vec<(ChannelSpec, Decibels)>, Fault> {
    let list = top
        .required("channel", "describe every slow converter in a table of its own, [[channel]] delay = ..")?;
    let items = list.items("a list of tables, each headed [[channel]]")?;
    check_channel_count(items.len()).map_err(|problem| list.fault(problem))?;
    items.iter().map(|item| channel(item, common)).collect()
}

fn channel(item: &Value<'_>, common: &Common<'_>) -> Result<(ChannelSpec, Decibels), Fault> {
    let fields = item.fields(&CHANNEL_KEYS)?;
    let delay = delay(&fields, common.fast_period)?;
    let FilterModel { filter, error } = match fields.optional("filter") {
        Some(value) => front_end(&value, common.fast_period, common.models)?,
        None => common.target.clone(),
    };
    // Noise of -0.0 is noise of 0.0, and so is an offset.
    let noise = noise(Some(&fields))?.unwrap_or(common.noise) + 0.0;
    let number = |key, check| fields.optional(key).map(|v| checked_number(&v, check)).transpose();
    let gain = number("gain", check_gain)?.unwrap_or(1.0);
    let offset = number("offset", check_offset)?.unwrap_or(0.0) + 0.0;
    let bits = fields.optional("bits").map(|v| converter_bits(&v)).transpose()?;
    let jitter = fields.optional("jitter").map(|v| jitter(&v, common.fast_period)).transpose()?;
    let jitter = jitter.unwrap_or(Seconds(0.0));
    Ok((ChannelSpec { delay, filter, noise, bits, jitter, gain, offset }, error))
}

/// The resolution of a converter.
fn converter_bits(value: &Value<'_>) -> Result<u32, Fault> {
    // A number that does not fit u32 is out of range in any case.
    let bits = u32::try_from(value.count("bits")?).unwrap_or(u32::MAX);
    check_converter_bits(bits).map_err(|problem| value.fault(problem))?;
    Ok(bits)
}

/// The rms jitter of a converter.
fn jitter(value: &Value<'_>, h: Seconds) -> Result<Seconds, Fault> {
    let jitter = value.time()?.in_seconds(h);
    check_jitter(jitter.in_fast_periods(h), jitter.0).map_err(|problem| value.fault(problem))?;
    Ok(jitter + Seconds(0.0))
}

/// D_i, from one of its two spellings.
fn delay(fields: &Fields<'_>, fast_period: Seconds) -> Result<Seconds, Fault> {
    let (value, written) = match (fields.optional("delay"), fields.optional("delay_samples")) {
        (Some(_), Some(samples)) => {
            let remedy = "they have the same meaning, keep one of them";
            let problem = SpecProblem::Conflict { first: "delay", second: "delay_samples", remedy };
            return Err(samples.fault(problem));
        }
        (Some(delay), None) => {
            let written = delay.time()?;
            (delay, written)
        }
        (None, Some(samples)) => {
            let written = Time::Samples(FastPeriods(samples.number()?));
            (samples, written)
        }
        (None, None) => {
            let remedy = "give delay in seconds or delay_samples in fast periods (0 for none)";
            return Err(fields.whole().fault(SpecProblem::MissingKey { key: "delay", remedy }));
        }
    };
    let delay = written.in_seconds(fast_period);
    let (number, unit) = match written {
        Time::Seconds(time) => (time.0, "s"),
        Time::Samples(periods) => (periods.0, "fast periods"),
    };
    check_delay(delay.in_fast_periods(fast_period), number, unit).map_err(|problem| value.fault(problem))?;
    // A delay of -0.0 is a delay of 0.0.
    Ok(delay + Seconds(0.0))
}

/// The `[uncertainty]` table.
fn uncertainty(item: &Value<'_>, channels: usize, h: Seconds) -> Result<UncertaintySpec, Fault> {
    let fields = item.fields(&UNCERTAINTY_KEYS)?;
    let times = |key| per_channel(&fields, key, |v| Ok(v.time()?.in_seconds(h)));
    let shares = |key| per_channel(&fields, key, Value::share);
    let samples =
        per_channel(&fields, "delay_samples", |v| v.number().map(|n| FastPeriods(n).in_seconds(h)))?;
    if let (Some(_), Some(samples)) = (fields.optional("delay"), fields.optional("delay_samples")) {
        let remedy = "they have the same meaning, keep one of them";
        return Err(samples.fault(SpecProblem::Conflict { first: "delay", second: "delay_samples", remedy }));
    }
    let is_in_samples = samples.is_some();
    let table = UncertaintySpec {
        delay: if is_in_samples { samples } else { times("delay")? },
        gain: shares("gain")?,
        offset: shares("offset")?,
        cutoff: shares("cutoff")?,
        reference: fields.optional("reference").map(|v| v.count("(channel)")).transpose()?,
    };
    table.check_by_key(channels, h).map_err(|(key, problem)| {
        let key = if key == "delay" && is_in_samples { "delay_samples" } else { key };
        fields.fault_at(Some(key), problem)
    })?;
    Ok(table)
}

/// One value for all channels, or a list of values. The length of the list is checked where that of the
/// channels is known.
fn per_channel<'a, T>(
    fields: &Fields<'a>,
    key: &str,
    read: impl Fn(&Value<'a>) -> Result<T, Fault>,
) -> Result<Option<PerChannel<T>>, Fault> {
    let Some(value) = fields.optional(key) else { return Ok(None) };
    Ok(Some(match value.items("a number, or a list of numbers") {
        Ok(items) => PerChannel::Each(items.iter().map(read).collect::<Result<_, _>>()?),
        Err(_) => PerChannel::Same(read(&value)?),
    }))
}

fn design(
    table: Option<&Fields<'_>>,
    top: &Fields<'_>,
    overrides: DesignOverrides,
    channels: usize,
) -> Result<super::DesignSpec, Fault> {
    let get = |key| table.and_then(|fields| fields.optional(key));
    let written = DesignOverrides {
        method: get("method").map(|v| v.name("method", &Method::ALL.map(|m| (m.name(), m)))).transpose()?,
        taps: get("taps").map(|v| checked_count(&v, "taps", check_taps)).transpose()?,
        target_snr_db: get("target_snr_db")
            .map(|v| checked_number(&v, check_target_snr).map(|db| db + 0.0))
            .transpose()?,
        gamma_margin: get("gamma_margin").map(|v| checked_number(&v, check_gamma_margin)).transpose()?,
        solver: get("solver").map(|v| v.name("solver", &Solver::ALL.map(|s| (s.name(), s)))).transpose()?,
        bits: get("bits").map(|v| word_lengths(&v)).transpose()?,
        fraction_bits: get("fraction_bits").map(|v| fraction_bits(&v)).transpose()?,
        tracking: get("tracking")
            .map(|v| v.name("tracking", &Tracking::ALL.map(|t| (t.name(), t))))
            .transpose()?,
        reduction: reduction(get("order"), get("reduction_loss_db"))?,
    };
    let design = overrides.clone().over(written).resolved();
    match design.check_by_key(channels) {
        Ok(()) => Ok(design),
        Err(KeyProblem { key, problem }) => {
            let fields = table.unwrap_or(top);
            Err(match blamed(&overrides, key, &problem) {
                Some(given) => Fault::overriding(given, problem),
                None if matches!(problem, SpecProblem::MissingKey { .. }) => fields.whole().fault(problem),
                None => fields.fault_at(Some(key), problem),
            })
        }
    }
}

/// The key of `overrides` that causes a problem with `key`, if there is one.
fn blamed(overrides: &DesignOverrides, key: &'static str, problem: &SpecProblem) -> Option<&'static str> {
    let other_length = key == "bits" && matches!(problem, SpecProblem::Range { unit: "entries", .. });
    let cause = if other_length && !overrides.gives(key) { "taps" } else { key };
    overrides.gives(cause).then_some(cause)
}

/// One number of bits, or a list of them. The length of the list is checked where that of the filters is
/// known.
pub(crate) fn word_lengths(value: &Value<'_>) -> Result<WordLengths, Fault> {
    // A number that does not fit u32 is out of range in any case.
    let bits = |v: &Value<'_>| v.count("bits").map(|bits| u32::try_from(bits).unwrap_or(u32::MAX));
    let words = match value.items("a number of bits, or a list of them") {
        Ok(items) => WordLengths::PerTap(items.iter().map(bits).collect::<Result<_, _>>()?),
        Err(_) => WordLengths::Same(bits(value)?),
    };
    words.check_numbers().map_err(|problem| value.fault(problem))?;
    Ok(words)
}

/// The exponent of the finest step.
pub(crate) fn fraction_bits(value: &Value<'_>) -> Result<i32, Fault> {
    let bits = value.integer("bits")?;
    let bits = i32::try_from(bits).unwrap_or(if bits < 0 { i32::MIN } else { i32::MAX });
    check_fraction_bits(bits).map_err(|problem| value.fault(problem))?;
    Ok(bits)
}

/// The order or the loss, not both.
fn reduction(order: Option<Value<'_>>, loss: Option<Value<'_>>) -> Result<Option<Reduction>, Fault> {
    match (order, loss) {
        (Some(_), Some(loss)) => {
            let remedy = "each determines the other, keep one of them";
            Err(loss.fault(SpecProblem::Conflict { first: "order", second: "reduction_loss_db", remedy }))
        }
        (Some(order), None) => checked_count(&order, "states", check_order).map(Reduction::Order).map(Some),
        (None, Some(loss)) => {
            checked_number(&loss, check_reduction_loss).map(|db| Some(Reduction::Loss(db + 0.0)))
        }
        (None, None) => Ok(None),
    }
}

/// A filter, which may be a measurement; a filter that is written is exact.
fn front_end(value: &Value<'_>, h: Seconds, models: &FilterModels<'_>) -> Result<FilterModel, Fault> {
    let mut known = FILTER_FORMS.concat();
    known.extend(MEASURED_KEYS.iter().filter(|key| !FILTER_FORMS.concat().contains(key)));
    let fields = value.fields(&known)?;
    let (path, measurement) = match (fields.optional("touchstone"), fields.optional("response")) {
        (None, None) => return Ok(FilterModel { filter: filter(value)?, error: Decibels(0.0) }),
        (Some(_), Some(second)) => {
            let remedy = "a filter has one measurement, keep one of them";
            let problem = SpecProblem::Conflict { first: "touchstone", second: "response", remedy };
            return Err(second.fault(problem));
        }
        (Some(path), None) => {
            let parameter = fields.optional("parameter").map(|v| v.text().map(str::to_owned)).transpose()?;
            (path, Measurement::Touchstone(parameter))
        }
        (None, Some(path)) => (path, Measurement::Response),
    };
    let is_table = measurement == Measurement::Response;
    let fields = value.fields(if is_table { &["response", "order", "deembed"] } else { &MEASURED_KEYS })?;
    let order = fields.required("order", "give the number of poles of the model")?.count("poles")?;
    let deembed = fields.optional("deembed").map(|v| v.time()).transpose()?;
    let deembed = deembed.map_or(Seconds(0.0), |delay| delay.in_seconds(h));
    let path = path.text()?.to_owned();
    let model = models(&MeasuredFilter { path, measurement, order, deembed })
        .map_err(|message| value.fault(SpecProblem::Measurement { message }))?;
    model.filter.check().map_err(|problem| value.fault(problem))?;
    Ok(model)
}
