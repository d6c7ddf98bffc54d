//! Writes a [`Bank`] as JSON text.

use std::io;

use serde::Serialize;
use serde_json::ser::Formatter;

use crate::spec::{Method, Spec};
use crate::units::Seconds;

use super::digest::digest;
use super::read::parse;
use super::{
    Bank, BankError, BankProblem, FORMAT, FixedPoint, Gamma, Proof, StateSpace, SynthesisFilters, VERSION,
};

/// The file, key by key.
#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    version: usize,
    spec: Option<&'a Spec>,
    fast_period: Seconds,
    ratio: usize,
    latency: usize,
    method: Method,
    channels: Vec<Channel<'a>>,
    state_space: Option<&'a StateSpace>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fixed_point: Option<&'a FixedPoint>,
    gamma: Gamma,
    #[serde(skip_serializing_if = "Option::is_none")]
    proof: Option<&'a Proof>,
    #[serde(skip_serializing_if = "Option::is_none")]
    digest: Option<String>,
}

#[derive(Serialize)]
struct Channel<'a> {
    delay: Seconds,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    taps: Option<Taps<'a>>,
}

/// The taps of a converter: one list, or one for each of several samples per frame.
#[derive(Serialize)]
#[serde(untagged)]
enum Taps<'a> {
    One(&'a [f64]),
    Several(&'a [Vec<f64>]),
}

impl Bank {
    /// The text of the bank file with its digest: objects indented, lists on one line, numbers with as many
    /// digits as are needed to read back the same bits.
    ///
    /// # Errors
    /// [`BankError`] as [`Bank::check`]; in particular for NaN and infinity, which JSON cannot represent.
    pub fn to_json(&self) -> Result<String, BankError> {
        self.check()?;
        let bare = text(&self.document(None))?;
        text(&self.document(Some(digest(&parse(&bare)?))))
    }

    /// The digest that the bank file has.
    ///
    /// # Errors
    /// As [`Bank::to_json`].
    pub fn digest(&self) -> Result<String, BankError> {
        Ok(digest(&parse(&text(&self.document(None))?)?))
    }

    fn document(&self, digest: Option<String>) -> Document<'_> {
        let (taps, state_space) = match &self.filters {
            SynthesisFilters::Fir(taps) => (Some(taps), None),
            SynthesisFilters::StateSpace(block) => (None, Some(block)),
        };
        let first = |i: usize| self.samples[..i].iter().sum::<usize>();
        let taps_of = |i: usize| match taps?.get(first(i)..first(i) + self.samples[i])? {
            [one] => Some(Taps::One(one)),
            several => Some(Taps::Several(several)),
        };
        // What a reader takes for granted is left out.
        let unless = |value: f64, default: f64| (value != default).then_some(value);
        let channel = |i: usize| Channel {
            delay: self.delays[i],
            samples: (self.samples[i] != 1).then_some(self.samples[i]),
            gain: unless(self.gains[i], 1.0),
            offset: unless(self.offsets[i], 0.0),
            taps: taps_of(i),
        };
        Document {
            format: FORMAT,
            version: VERSION,
            spec: self.spec.as_ref(),
            fast_period: self.fast_period,
            ratio: self.ratio,
            latency: self.latency,
            method: self.method,
            channels: (0..self.channel_count()).map(channel).collect(),
            state_space,
            fixed_point: self.fixed_point.as_ref(),
            gamma: self.gamma,
            proof: self.proof.as_ref(),
            digest,
        }
    }
}

fn text(document: &Document<'_>) -> Result<String, BankError> {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Indented::default());
    let unwritable = |message: String| BankError::new("", String::new(), BankProblem::Syntax { message });
    document.serialize(&mut serializer).map_err(|e| unwritable(e.to_string()))?;
    bytes.push(b'\n');
    String::from_utf8(bytes).map_err(|e| unwritable(e.to_string()))
}

/// Objects over several lines, lists on one.
#[derive(Default)]
struct Indented {
    depth: usize,
}

impl Indented {
    fn new_line<W: ?Sized + io::Write>(&self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| writer.write_all(b"  "))
    }
}

impl Formatter for Indented {
    fn begin_array_value<W: ?Sized + io::Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if first { Ok(()) } else { writer.write_all(b", ") }
    }

    fn begin_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        writer.write_all(b"{")
    }

    fn begin_object_key<W: ?Sized + io::Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if !first {
            writer.write_all(b",")?;
        }
        self.new_line(writer)
    }

    fn begin_object_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }

    fn end_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        self.new_line(writer)?;
        writer.write_all(b"}")
    }
}
