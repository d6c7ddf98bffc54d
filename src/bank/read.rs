//! Reads JSON text into a checked [`Bank`].

use crate::messages::of_json;
use crate::spec::Fault;
use crate::spec::document::Node;
use crate::spec::reader::{Fields, Value};
use crate::spec::{DesignOverrides, Method, SpecProblem, decode, no_models, word_lengths};
use crate::units::Seconds;

use super::digest::{digest, is_digest};
use super::{
    Bank, BankError, BankProblem, BoxProof, CausalWitness, Certificate, DualWitness, FORMAT, FixedPoint,
    Gamma, LowerProof, NormBound, Proof, StateSpace, SynthesisFilters, VERSION,
};

const KEYS: [&str; 14] = [
    "format",
    "version",
    "spec",
    "fast_period",
    "ratio",
    "latency",
    "method",
    "channels",
    "state_space",
    "fixed_point",
    "gamma",
    "proof",
    "digest",
    "meta",
];
const CHANNEL_KEYS: [&str; 5] = ["delay", "samples", "gain", "offset", "taps"];
const REWRITE: &str = "a bank without it cannot be run; give a file written by `hybank design`";

impl Bank {
    /// Reads a bank file's text; `file_name` is used only in messages.
    ///
    /// # Errors
    /// [`BankError`] naming the JSON place, the rule and the remedy for the first thing that is wrong.
    pub fn from_json(text: &str, file_name: &str) -> Result<Self, BankError> {
        let bank = parse(text).and_then(|document| read(&Value::root(&document)));
        let checked = bank.and_then(|bank| bank.check().map(|()| bank));
        checked.map_err(|error| error.in_file(file_name))
    }
}

/// Compares the digest of a bank file with its content. Returns false if the file has no digest.
///
/// # Errors
/// [`BankError`] if the text is not JSON, the digest is malformed, or the digest does not match the
/// content.
pub fn check_digest(text: &str, file_name: &str) -> Result<bool, BankError> {
    let checked = parse(text).and_then(|document| {
        let top = Value::root(&document).fields(&KEYS)?;
        let Some(value) = top.optional("digest") else { return Ok(false) };
        if stated_digest(&value)? == digest(&document) {
            return Ok(true);
        }
        Err(BankError::new("", value.path().to_owned(), BankProblem::Altered))
    });
    checked.map_err(|error| error.in_file(file_name))
}

fn stated_digest(value: &Value<'_>) -> Result<String, BankError> {
    let text = value.text()?;
    if is_digest(text) {
        return Ok(text.to_owned());
    }
    Err(BankError::new("", value.path().to_owned(), BankProblem::Digest { found: text.to_owned() }))
}

impl From<Fault> for BankError {
    fn from(fault: Fault) -> Self {
        Self::new("", fault.path, *fault.problem)
    }
}

pub(super) fn parse(text: &str) -> Result<Node, BankError> {
    // Some editors put a byte-order mark in front.
    serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|error| {
        let problem = BankProblem::Syntax { message: of_json(&error.to_string()) };
        BankError::new("", String::new(), problem)
    })
}

fn read(document: &Value<'_>) -> Result<Bank, BankError> {
    check_header(document)?;
    let top = document.fields(&KEYS)?;
    top.optional("digest").map(|value| stated_digest(&value)).transpose()?;
    let spec =
        top.optional("spec").map(|v| decode::spec(&v, DesignOverrides::default(), &no_models)).transpose()?;
    let method = Method::ALL.map(|m| (m.name(), m));
    let channels = top.required("channels", REWRITE)?.items("a list of channels")?;
    let channels = channels.iter().map(|c| c.fields(&CHANNEL_KEYS)).collect::<Result<Vec<_>, _>>()?;
    let of_channels = |key, default| -> Result<Vec<f64>, Fault> {
        channels.iter().map(|c| c.optional(key).map_or(Ok(default), |v| v.number())).collect()
    };
    Ok(Bank {
        spec,
        fast_period: Seconds(top.required("fast_period", REWRITE)?.number()?),
        ratio: top.required("ratio", REWRITE)?.count("fast samples")?,
        latency: top.required("latency", REWRITE)?.count("fast samples")?,
        method: top.required("method", REWRITE)?.name("method", &method)?,
        samples: channels
            .iter()
            .map(|c| c.optional("samples").map_or(Ok(1), |v| v.count("samples")))
            .collect::<Result<_, _>>()?,
        delays: channels
            .iter()
            .map(|c| c.required("delay", REWRITE)?.number().map(Seconds))
            .collect::<Result<_, _>>()?,
        gains: of_channels("gain", 1.0)?,
        offsets: of_channels("offset", 0.0)?,
        filters: filters(&top, &channels)?,
        fixed_point: top.optional("fixed_point").map(|v| fixed_point(&v)).transpose()?,
        gamma: top.optional("gamma").map(|v| gamma(&v)).transpose()?.unwrap_or_default(),
        proof: top.optional("proof").map(|v| proof(&v)).transpose()?,
    })
}

/// Checks format and version first, because a bank of a later version may have other keys.
fn check_header(document: &Value<'_>) -> Result<(), BankError> {
    let format = document.entry("format")?;
    let found = format.text()?;
    if found != FORMAT {
        let problem = BankProblem::Format { found: found.to_owned() };
        return Err(BankError::new("", format.path().to_owned(), problem));
    }
    let version = document.entry("version")?;
    match version.count("(version)")? {
        VERSION => Ok(()),
        found => Err(BankError::new("", version.path().to_owned(), BankProblem::Version { found })),
    }
}

/// Either every channel has taps, or there is a state-space block.
fn filters(top: &Fields<'_>, channels: &[Fields<'_>]) -> Result<SynthesisFilters, BankError> {
    let Some(block) = top.optional("state_space") else {
        let remedy = "give the taps of every channel, or a state_space for all";
        let taps = channels.iter().map(|channel| {
            let taps = channel.required("taps", remedy)?;
            let samples = channel.optional("samples").map_or(Ok(1), |v| v.count("samples"))?;
            if samples == 1 {
                return Ok(vec![taps.numbers()?]);
            }
            let lists = taps.matrix()?;
            let rule = "a converter with several samples per frame has a list of taps for each of them";
            let (found, expected, unit) = (lists.len(), samples, "tap lists");
            let problem = BankProblem::Length { found, expected, unit, rule };
            if found == expected {
                Ok(lists)
            } else {
                Err(BankError::new("", taps.path().to_owned(), problem))
            }
        });
        let taps = taps.collect::<Result<Vec<_>, BankError>>()?;
        return Ok(SynthesisFilters::Fir(taps.into_iter().flatten().collect()));
    };
    if let Some(taps) = channels.iter().find_map(|channel| channel.optional("taps")) {
        let remedy = "a bank runs by the one or the other, keep what goes with its method";
        return Err(taps
            .fault(SpecProblem::Conflict { first: "taps", second: "state_space", remedy })
            .into());
    }
    let fields = block.fields(&["a", "b", "c", "d"])?;
    let matrix = |key| fields.required(key, "a block filter has the four matrices a, b, c and d")?.matrix();
    Ok(SynthesisFilters::StateSpace(StateSpace {
        a: matrix("a")?,
        b: matrix("b")?,
        c: matrix("c")?,
        d: matrix("d")?,
    }))
}

fn fixed_point(value: &Value<'_>) -> Result<FixedPoint, Fault> {
    let fields = value.fields(&["bits", "fraction_bits", "integers"])?;
    let required = |key| fields.required(key, "integer taps are known by bits, fraction_bits and integers");
    // An integer that does not fit i64 is out of every range, too.
    let integer = |v: &Value<'_>| v.integer("(integer tap)").map(|i| i64::try_from(i).unwrap_or(i64::MAX));
    let list = |v: &Value<'_>| v.items("a list of integers")?.iter().map(integer).collect();
    let lists = required("integers")?.items("a list of integers for each channel")?;
    Ok(FixedPoint {
        bits: word_lengths::word_lengths(&required("bits")?)?,
        fraction_bits: word_lengths::fraction_bits(&required("fraction_bits")?)?,
        integers: lists.iter().map(list).collect::<Result<_, _>>()?,
    })
}

fn gamma(value: &Value<'_>) -> Result<Gamma, Fault> {
    let fields = value.fields(&["norm", "upper", "lower", "noncausal", "worst_case"])?;
    let bound = |key| fields.optional(key).map(|v| v.number()).transpose();
    Ok(Gamma {
        norm: bound("norm")?,
        upper: bound("upper")?,
        lower: bound("lower")?,
        noncausal: bound("noncausal")?,
        worst_case: bound("worst_case")?,
    })
}

const WITNESS: &str = "a proof without it proves nothing; leave the proof out, or take the whole of it";

fn proof(value: &Value<'_>) -> Result<Proof, Fault> {
    let fields = value.fields(&["upper", "lower", "noncausal", "worst_case"])?;
    Ok(Proof {
        upper: fields.optional("upper").map(|v| certificate(&v)).transpose()?,
        lower: fields.optional("lower").map(|v| lower_proof(&v)).transpose()?,
        noncausal: fields.optional("noncausal").map(|v| witness(&v)).transpose()?,
        worst_case: fields.optional("worst_case").map(|v| box_proof(&v)).transpose()?,
    })
}

fn box_proof(value: &Value<'_>) -> Result<BoxProof, Fault> {
    let fields = value.fields(&["scales", "filters", "slopes"])?;
    Ok(BoxProof {
        scales: fields.required("scales", WITNESS)?.numbers()?,
        filters: norm_bound(&fields.required("filters", WITNESS)?)?,
        slopes: norm_bound(&fields.required("slopes", WITNESS)?)?,
    })
}

fn norm_bound(value: &Value<'_>) -> Result<NormBound, Fault> {
    let fields = value.fields(&["norm", "factor"])?;
    let norm = fields.required("norm", WITNESS)?.number()?;
    Ok(NormBound { norm, factor: fields.required("factor", WITNESS)?.matrix()? })
}

/// A list of witnesses for FIR banks, or a table with gamma and periods for causal ones.
fn lower_proof(value: &Value<'_>) -> Result<LowerProof, Fault> {
    if let Ok(list) = value.items("a list of witnesses") {
        return Ok(LowerProof::Fir(list.iter().map(witness).collect::<Result<_, _>>()?));
    }
    let fields = value.fields(&["gamma", "periods"])?;
    let gamma = fields.required("gamma", WITNESS)?.number()?;
    let periods = fields.required("periods", WITNESS)?.count("slow periods")?;
    Ok(LowerProof::Causal(CausalWitness { gamma, periods }))
}

fn certificate(value: &Value<'_>) -> Result<Certificate, Fault> {
    let fields = value.fields(&["gamma", "peak", "factor", "correction"])?;
    Ok(Certificate {
        gamma: fields.required("gamma", WITNESS)?.number()?,
        peak: witness(&fields.required("peak", WITNESS)?)?,
        factor: fields.required("factor", WITNESS)?.matrix()?,
        correction: fields.optional("correction").map(|v| v.matrix()).transpose()?.unwrap_or_default(),
    })
}

fn witness(value: &Value<'_>) -> Result<DualWitness, Fault> {
    let fields = value.fields(&["half", "reference", "measured"])?;
    let measured = fields.optional("measured").map(|v| pairs(&v)).transpose()?;
    Ok(DualWitness {
        half: pair(&fields.required("half", WITNESS)?)?,
        reference: pairs(&fields.required("reference", WITNESS)?)?,
        measured: measured.unwrap_or_default(),
    })
}

fn pairs(value: &Value<'_>) -> Result<Vec<[f64; 2]>, Fault> {
    value.items("a list of pairs [re, im]")?.iter().map(pair).collect()
}

fn pair(value: &Value<'_>) -> Result<[f64; 2], Fault> {
    let numbers = value.numbers()?;
    numbers
        .try_into()
        .map_err(|_| value.fault(SpecProblem::WrongType { expected: "a pair of numbers", found: "a list" }))
}
