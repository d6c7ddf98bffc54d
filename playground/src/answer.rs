//! What the program answers.

use hybank::bank::Bank;
use hybank::spec::SpecError;
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, Write};

/// A line of JSON and the samples that follow it, 32-bit floats in little-endian order.
pub(crate) struct Answer {
    json: serde_json::Value,
    samples: Vec<u8>,
}

impl Answer {
    /// Without samples.
    pub(crate) fn of(value: &impl Serialize) -> Result<Self, Refusal> {
        Self::with_samples(value, &[])
    }

    /// With recordings, one after the other.
    pub(crate) fn with_samples(value: &impl Serialize, recordings: &[&[f64]]) -> Result<Self, Refusal> {
        let json = serde_json::to_value(value).map_err(Refusal::new)?;
        let bytes =
            |recording: &&[f64]| recording.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect::<Vec<_>>();
        Ok(Self { json, samples: recordings.iter().flat_map(bytes).collect() })
    }

    pub(crate) fn write(&self, output: &mut impl Write) -> io::Result<()> {
        writeln!(output, "{}", self.json)?;
        output.write_all(&self.samples)?;
        output.flush()
    }
}

/// Something that cannot be done, with the rule and the remedy.
#[derive(Serialize)]
pub(crate) struct Refusal {
    /// As the command line says it, with the line and carets below it.
    message: String,
    place: Option<Place>,
}

/// A place in the text, from 1, and how many characters there are meant.
#[derive(Serialize)]
struct Place {
    line: usize,
    column: usize,
    width: usize,
}

impl Refusal {
    pub(crate) fn new(message: impl Display) -> Self {
        Self { message: message.to_string(), place: None }
    }

    pub(crate) fn answer(&self) -> Answer {
        Answer { json: serde_json::json!({ "refused": self }), samples: Vec::new() }
    }
}

impl From<SpecError> for Refusal {
    fn from(error: SpecError) -> Self {
        let place = error.location().map(|at| Place { line: at.line, column: at.column, width: at.width });
        Self { message: error.to_string(), place }
    }
}

/// The text of an input.
pub(crate) fn text(input: &[u8]) -> Result<&str, Refusal> {
    std::str::from_utf8(input).map_err(|error| Refusal::new(format!("not a text in UTF-8: {error}")))
}

/// The bank of a file's text.
pub(crate) fn bank(input: &[u8]) -> Result<Bank, Refusal> {
    Bank::from_json(text(input)?, "bank.json").map_err(Refusal::new)
}
