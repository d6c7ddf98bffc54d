//! Reads an analog filter in whichever form it is written.

use super::filter::{FilterModel, FilterModels, MeasuredFilter, Measurement};
use super::reader::{Either, Fields, Value};
use super::{Family, Fault, FilterProblem, FilterSpec, Passband, SpecProblem};
use crate::units::{Decibels, Seconds};

/// The keys of each written form of a filter; the first one names the form.
pub(super) const FILTER_FORMS: [&[&str]; 5] = [
    &["num", "den"],
    &["poles", "zeros", "gain"],
    &["a", "b", "c"],
    &["family", "order", "cutoff", "band", "ripple_db", "attenuation_db"],
    &["cascade"],
];

/// The keys of a filter that is a measurement.
const MEASURED_KEYS: [&str; 5] = ["touchstone", "response", "order", "parameter", "deembed"];

/// Reads one filter in whichever form it is written.
pub(super) fn filter(value: &Value<'_>) -> Result<FilterSpec, Fault> {
    checked_filter(value, FilterSpec::check)
}

/// A filter, which may be a measurement; a filter that is written is exact.
pub(super) fn front_end(
    value: &Value<'_>,
    h: Seconds,
    models: &FilterModels<'_>,
) -> Result<FilterModel, Fault> {
    let mut known = FILTER_FORMS.concat();
    known.extend(MEASURED_KEYS.iter().filter(|key| !FILTER_FORMS.concat().contains(key)));
    let fields = value.fields(&known)?;
    let remedy = "a filter has one measurement, keep one of them";
    let (path, measurement, keys) = match fields.either("touchstone", "response", remedy)? {
        Either::Neither => return Ok(FilterModel { filter: filter(value)?, error: Decibels(0.0) }),
        Either::First(path) => {
            let parameter = fields.read("parameter", |v| v.text().map(str::to_owned))?;
            (path, Measurement::Touchstone(parameter), &MEASURED_KEYS[..])
        }
        Either::Second(path) => (path, Measurement::Response, &["response", "order", "deembed"][..]),
    };
    let fields = value.fields(keys)?;
    let order = fields.required("order", "give the number of poles of the model")?.count("poles")?;
    let deembed = fields.read("deembed", |v| v.time())?;
    let deembed = deembed.map_or(Seconds(0.0), |delay| delay.in_seconds(h));
    let path = path.text()?.to_owned();
    let model = models(&MeasuredFilter { path, measurement, order, deembed })
        .map_err(|message| value.fault(SpecProblem::Measurement { message }))?;
    model.filter.check().map_err(|problem| value.fault(problem))?;
    Ok(model)
}

/// Reads a filter that may have a direct term.
pub(super) fn proper_filter(value: &Value<'_>) -> Result<FilterSpec, Fault> {
    checked_filter(value, FilterSpec::check_proper)
}

fn checked_filter(
    value: &Value<'_>,
    check: fn(&FilterSpec) -> Result<(), FilterProblem>,
) -> Result<FilterSpec, Fault> {
    let fields = value.fields(&FILTER_FORMS.concat())?;
    let filter = unchecked_filter(&fields)?;
    check(&filter).map_err(|problem| fields.fault_at(problem.key(), problem))?;
    Ok(filter)
}

fn unchecked_filter(fields: &Fields<'_>) -> Result<FilterSpec, Fault> {
    let mut used = FILTER_FORMS.iter().filter_map(|form| form.iter().copied().find(|key| fields.has(key)));
    let Some(first) = used.next() else { return Err(fields.whole().fault(SpecProblem::EmptyFilter)) };
    if let Some(second) = used.next() {
        let remedy = "they belong to different ways to write a filter, keep the keys of one way";
        return Err(fields.fault_at(Some(second), SpecProblem::Conflict { first, second, remedy }));
    }
    match first {
        "num" | "den" => Ok(FilterSpec::TransferFunction {
            num: fields.required("num", "list the numerator in descending powers of s")?.numbers()?,
            den: fields.required("den", "list the denominator in descending powers of s")?.numbers()?,
        }),
        "poles" | "zeros" | "gain" => Ok(FilterSpec::ZeroPoleGain {
            zeros: fields.read("zeros", |v| roots(&v))?.unwrap_or_default(),
            poles: roots(&fields.required("poles", "list the poles as [re, im] pairs in rad/s")?)?,
            gain: fields
                .required("gain", "give the factor before the product of zeros over poles")?
                .number()?,
        }),
        "a" | "b" | "c" => Ok(FilterSpec::StateSpace {
            a: fields.required("a", "give dx/dt = a x + b f, out = c x as lists of rows")?.matrix()?,
            b: fields.required("b", "give the n x 1 input matrix, [[..], ..]")?.matrix()?,
            c: fields.required("c", "give the 1 x n output matrix, [[..]]")?.matrix()?,
        }),
        "cascade" => {
            let stages = fields
                .required("cascade", "list the stages")?
                .items("a list of filters, [{ .. }, { .. }]")?;
            let read = |stage: &Value<'_>| unchecked_filter(&stage.fields(&FILTER_FORMS.concat())?);
            Ok(FilterSpec::Cascade { cascade: stages.iter().map(read).collect::<Result<_, _>>()? })
        }
        _ => family(fields),
    }
}

fn family(fields: &Fields<'_>) -> Result<FilterSpec, Fault> {
    let named = fields.required("family", "name the family, for example family = \"butterworth\"")?;
    let number = |key| fields.read(key, |v| v.number());
    Ok(FilterSpec::Family {
        family: named.name("filter family", &Family::ALL.map(|f| (f.name(), f)))?,
        order: fields.read("order", |v| v.count("poles"))?,
        passband: passband(fields)?,
        ripple_db: number("ripple_db")?,
        attenuation_db: number("attenuation_db")?,
    })
}

/// The cutoff, or the edges of the band.
fn passband(fields: &Fields<'_>) -> Result<Passband, Fault> {
    match fields.either(
        "cutoff",
        "band",
        "a low-pass has a cutoff and a band-pass has a band, keep one of them",
    )? {
        Either::First(cutoff) => Ok(Passband::LowPass { cutoff: cutoff.frequency()? }),
        Either::Second(band) => {
            let [low, high] =
                band.frequencies("a list of two frequencies, as in [\"60 MHz\", \"80 MHz\"]")?;
            Ok(Passband::BandPass { low, high })
        }
        Either::Neither => {
            let remedy = "give the cutoff in hertz, or band = [low, high] for a band-pass";
            Err(fields.whole().fault(SpecProblem::MissingKey { key: "cutoff", remedy }))
        }
    }
}

/// Complex numbers as `[re, im]`; a bare number is real.
fn roots(value: &Value<'_>) -> Result<Vec<[f64; 2]>, Fault> {
    value.items("a list of [re, im] pairs")?.iter().map(root).collect()
}

fn root(value: &Value<'_>) -> Result<[f64; 2], Fault> {
    if let Ok(re) = value.number() {
        return Ok([re, 0.0]);
    }
    let pair = value.numbers()?;
    <[f64; 2]>::try_from(pair).map_err(|_| {
        value.fault(SpecProblem::WrongType {
            expected: "a pair [re, im] of numbers",
            found: "a list of another length",
        })
    })
}
