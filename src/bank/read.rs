//! From JSON text to a checked [`Bank`].

use crate::spec::document::Node;
use crate::spec::reader::{Fault, Fields, Value};
use crate::spec::{DesignOverrides, Method, decode};

use super::{Bank, BankError, BankProblem, BlockFilter, FORMAT, Gamma, SynthesisFilters, VERSION};

const KEYS: [&str; 11] = [
    "format",
    "version",
    "spec",
    "fast_period",
    "ratio",
    "latency",
    "method",
    "channels",
    "state_space",
    "gamma",
    "meta",
];
const REWRITE: &str = "a bank without it cannot be run; give a file written by `hybank design`";

impl Bank {
    /// Reads a bank file's text; `file_name` only serves the messages.
    ///
    /// # Errors
    /// [`BankError`] naming the JSON place, the rule and the remedy for the first thing that is wrong.
    pub fn from_json(text: &str, file_name: &str) -> Result<Self, BankError> {
        let bank = parse(text).and_then(|document| read(&Value::root(&document)));
        let checked = bank.and_then(|bank| bank.check().map(|()| bank));
        checked.map_err(|error| error.in_file(file_name))
    }
}

impl From<Fault> for BankError {
    fn from(fault: Fault) -> Self {
        Self::new("", fault.path, *fault.problem)
    }
}

fn parse(text: &str) -> Result<Node, BankError> {
    // Some editors put a byte-order mark in front.
    serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|error| {
        let problem = BankProblem::Syntax { message: error.to_string() };
        BankError::new("", String::new(), problem)
    })
}

fn read(document: &Value<'_>) -> Result<Bank, BankError> {
    check_header(document)?;
    let top = document.fields(&KEYS)?;
    let spec = top.optional("spec").map(|v| decode::spec(&v, DesignOverrides::default())).transpose()?;
    let method = Method::ALL.map(|m| (m.name(), m));
    let channels = top.required("channels", REWRITE)?.items("a list of channels")?;
    let channels = channels.iter().map(|c| c.fields(&["delay", "taps"])).collect::<Result<Vec<_>, _>>()?;
    Ok(Bank {
        spec,
        fast_period: top.required("fast_period", REWRITE)?.number()?,
        ratio: top.required("ratio", REWRITE)?.count("fast samples")?,
        latency: top.required("latency", REWRITE)?.count("fast samples")?,
        method: top.required("method", REWRITE)?.name("method", &method)?,
        delays: channels.iter().map(|c| c.required("delay", REWRITE)?.number()).collect::<Result<_, _>>()?,
        filters: filters(&top, &channels)?,
        gamma: top.optional("gamma").map(|v| gamma(&v)).transpose()?.unwrap_or_default(),
    })
}

/// Format and version come before everything else: a bank of a later version may well have other keys.
fn check_header(document: &Value<'_>) -> Result<(), BankError> {
    let format = document.entry("format")?;
    let found = format.text()?;
    if found != FORMAT {
        let problem = BankProblem::Format { found: found.chars().take(60).collect() };
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
        let taps = channels.iter().map(|channel| channel.required("taps", remedy)?.numbers());
        return Ok(SynthesisFilters::Fir(taps.collect::<Result<_, Fault>>()?));
    };
    if let Some(taps) = channels.iter().find_map(|channel| channel.optional("taps")) {
        let remedy = "a bank runs by the one or the other, keep what goes with its method";
        return Err(taps
            .fault(crate::spec::SpecProblem::Conflict { first: "taps", second: "state_space", remedy })
            .into());
    }
    let fields = block.fields(&["a", "b", "c", "d"])?;
    let matrix = |key| fields.required(key, "a block filter has the four matrices a, b, c and d")?.matrix();
    Ok(SynthesisFilters::StateSpace(BlockFilter {
        a: matrix("a")?,
        b: matrix("b")?,
        c: matrix("c")?,
        d: matrix("d")?,
    }))
}

fn gamma(value: &Value<'_>) -> Result<Gamma, Fault> {
    let fields = value.fields(&["upper", "lower", "noncausal"])?;
    let bound = |key| fields.optional(key).map(|v| v.number()).transpose();
    Ok(Gamma { upper: bound("upper")?, lower: bound("lower")?, noncausal: bound("noncausal")? })
}
