//! The table of a filter, in whichever form it is written.

use serde::Deserialize;

use super::error::refused;
use super::table::FromTable;
use super::tables::{Pair, required};
use super::{
    Family, FilterModel, FilterModels, FilterSpec, MeasuredFilter, MeasurementFile, OneOrEach, Passband,
    Refusal, SpecError, SpecProblem,
};
use crate::quantity::WrittenTime;
use crate::units::{Decibels, Hertz, Seconds};

/// The keys of all forms. Which of them are given says which form it is.
#[derive(Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct FilterTable {
    num: Option<Vec<f64>>,
    den: Option<Vec<f64>>,
    poles: Option<Vec<OneOrEach<f64>>>,
    zeros: Option<Vec<OneOrEach<f64>>>,
    gain: Option<f64>,
    a: Option<Vec<Vec<f64>>>,
    b: Option<Vec<Vec<f64>>>,
    c: Option<Vec<Vec<f64>>>,
    family: Option<Family>,
    order: Option<usize>,
    cutoff: Option<Hertz>,
    band: Option<Vec<Hertz>>,
    ripple_db: Option<f64>,
    attenuation_db: Option<f64>,
    cascade: Option<Vec<FromTable<FilterTable>>>,
    touchstone: Option<String>,
    response: Option<String>,
    parameter: Option<String>,
    deembed: Option<WrittenTime>,
}

/// The ways to write a filter.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Polynomials,
    Roots,
    Matrices,
    Family,
    Cascade,
    Measurement,
}

const EMPTY: &str = "the filter is empty; give num and den, or poles and gain, or a, b and c, or family and cutoff, or cascade, \
                     or touchstone or response and order";
const PASSBAND: Pair = Pair {
    first: "cutoff",
    second: "band",
    remedy: "a low-pass has a cutoff and a band-pass has a band, keep one of them",
};
const FILES: Pair = Pair {
    first: "touchstone",
    second: "response",
    remedy: "a filter has one measurement, keep one of them",
};
const PARAMETER: Pair =
    Pair { first: "response", second: "parameter", remedy: "a table has one response; leave parameter out" };

impl FilterTable {
    /// The filter, and the error of its model; a filter that is written is exact.
    pub(super) fn model(self, h: Seconds, models: &FilterModels<'_>) -> Result<FilterModel, SpecError> {
        if self.form()? != Form::Measurement {
            return Ok(FilterModel { filter: self.filter()?, error: Decibels(0.0) });
        }
        let measured = self.measured(h)?;
        let model = models(&measured).map_err(|message| refused("", &message))?;
        model.filter.check()?;
        Ok(model)
    }

    /// A filter that is written out.
    pub(super) fn filter(self) -> Result<FilterSpec, SpecError> {
        match self.form()? {
            Form::Polynomials => self.polynomials(),
            Form::Roots => self.roots(),
            Form::Matrices => self.matrices(),
            Form::Family => self.family(),
            Form::Cascade => self.stages(),
            Form::Measurement => {
                Err(refused("", "only the filter of the target or of a channel is a measurement"))
            }
        }
    }

    fn polynomials(self) -> Result<FilterSpec, SpecError> {
        Ok(FilterSpec::TransferFunction {
            num: required(self.num, "num", "list the numerator in descending powers of s")?,
            den: required(self.den, "den", "list the denominator in descending powers of s")?,
        })
    }

    fn roots(self) -> Result<FilterSpec, SpecError> {
        let poles = required(self.poles, "poles", "list the poles as [re, im] pairs in rad/s")?;
        Ok(FilterSpec::ZeroPoleGain {
            zeros: roots(self.zeros.unwrap_or_default(), "zeros")?,
            poles: roots(poles, "poles")?,
            gain: required(self.gain, "gain", "give the factor before the product of zeros over poles")?,
        })
    }

    fn matrices(self) -> Result<FilterSpec, SpecError> {
        Ok(FilterSpec::StateSpace {
            a: required(self.a, "a", "give dx/dt = a x + b f, out = c x as lists of rows")?,
            b: required(self.b, "b", "give the n x 1 input matrix, [[..], ..]")?,
            c: required(self.c, "c", "give the 1 x n output matrix, [[..]]")?,
        })
    }

    fn family(self) -> Result<FilterSpec, SpecError> {
        let remedy = "name the family, for example family = \"butterworth\"";
        Ok(FilterSpec::Family {
            family: required(self.family, "family", remedy)?,
            order: self.order,
            passband: passband(self.cutoff, self.band)?,
            ripple_db: self.ripple_db,
            attenuation_db: self.attenuation_db,
        })
    }

    fn stages(self) -> Result<FilterSpec, SpecError> {
        let stage = |(i, FromTable(stage)): (usize, FromTable<Self>)| {
            stage.filter().map_err(|error| error.inside(&format!("cascade[{i}]")))
        };
        let stages = self.cascade.into_iter().flatten().enumerate();
        Ok(FilterSpec::Cascade { cascade: stages.map(stage).collect::<Result<_, _>>()? })
    }

    /// The form whose keys are given.
    fn form(&self) -> Result<Form, SpecError> {
        let is_measured = self.touchstone.is_some() || self.response.is_some();
        let of_order = if is_measured { Form::Measurement } else { Form::Family };
        let keys = [
            ("touchstone", Form::Measurement, self.touchstone.is_some()),
            ("response", Form::Measurement, self.response.is_some()),
            ("parameter", Form::Measurement, self.parameter.is_some()),
            ("deembed", Form::Measurement, self.deembed.is_some()),
            ("num", Form::Polynomials, self.num.is_some()),
            ("den", Form::Polynomials, self.den.is_some()),
            ("poles", Form::Roots, self.poles.is_some()),
            ("zeros", Form::Roots, self.zeros.is_some()),
            ("gain", Form::Roots, self.gain.is_some()),
            ("a", Form::Matrices, self.a.is_some()),
            ("b", Form::Matrices, self.b.is_some()),
            ("c", Form::Matrices, self.c.is_some()),
            ("family", Form::Family, self.family.is_some()),
            ("order", of_order, self.order.is_some()),
            ("cutoff", Form::Family, self.cutoff.is_some()),
            ("band", Form::Family, self.band.is_some()),
            ("ripple_db", Form::Family, self.ripple_db.is_some()),
            ("attenuation_db", Form::Family, self.attenuation_db.is_some()),
            ("cascade", Form::Cascade, self.cascade.is_some()),
        ];
        let mut given = keys.into_iter().filter(|(_, _, given)| *given);
        let Some((first, form, _)) = given.next() else {
            return Err(refused("", EMPTY));
        };
        match given.find(|(_, other, _)| *other != form) {
            Some((second, ..)) => {
                let remedy = "they belong to different ways to write a filter, keep the keys of one way";
                Err(Refusal::new(second, SpecProblem::Conflict { first, second, remedy }))
            }
            None => Ok(form),
        }
    }

    fn measured(self, h: Seconds) -> Result<MeasuredFilter, SpecError> {
        let is_touchstone = self.touchstone.is_some();
        PARAMETER.only(self.response.as_ref().map(drop), self.parameter.as_ref().map(drop))?;
        let path = FILES.only(self.touchstone, self.response)?;
        Ok(MeasuredFilter {
            path: required(path, "touchstone", "name the file of the measurement")?,
            measurement: match is_touchstone {
                true => MeasurementFile::Touchstone(self.parameter),
                false => MeasurementFile::Response,
            },
            order: required(self.order, "order", "give the number of poles of the model")?,
            deembed: self.deembed.map_or(Seconds(0.0), |delay| delay.in_seconds(h)),
        })
    }
}

/// The cutoff, or the edges of the band.
fn passband(cutoff: Option<Hertz>, band: Option<Vec<Hertz>>) -> Result<Passband, SpecError> {
    let cutoff = cutoff.map(|cutoff| vec![cutoff]);
    let is_low_pass = cutoff.is_some();
    let remedy = "give the cutoff in hertz, or band = [low, high] for a band-pass";
    let edges = required(PASSBAND.only(cutoff, band)?, "cutoff", remedy)?;
    match edges[..] {
        [cutoff] if is_low_pass => Ok(Passband::LowPass { cutoff }),
        [low, high] => Ok(Passband::BandPass { low, high }),
        _ => Err(refused("band", "expected a list of two frequencies, as in [\"60 MHz\", \"80 MHz\"]")),
    }
}

/// Complex numbers as `[re, im]`; a bare number is real.
fn roots(list: Vec<OneOrEach<f64>>, key: &str) -> Result<Vec<[f64; 2]>, SpecError> {
    let root = |(i, root): (usize, OneOrEach<f64>)| match root {
        OneOrEach::Same(re) => Ok([re, 0.0]),
        OneOrEach::Each(pair) => <[f64; 2]>::try_from(pair)
            .map_err(|_| refused(&format!("{key}[{i}]"), "expected a pair [re, im] of numbers")),
    };
    list.into_iter().enumerate().map(root).collect()
}
