//! From the text of a spec to the bank and what is to be said of it.

use crate::answer::{Answer, Refusal, text};
use hybank::bank::Bank;
use hybank::design::{Design, Effort, GammaScale, Options, Stage, analyze_mean};
use hybank::figures::Figures;
use hybank::messages::counted;
use hybank::overview::{self, Facts};
use hybank::spec::Spec;
use hybank::verify::Verified;
use serde::Serialize;
use std::io::{self, Write};
use std::time::Instant;

/// The name of the spec in messages.
const SPEC: &str = "spec.toml";

#[derive(Serialize)]
struct Designed {
    /// The text of the bank file.
    bank: String,
    #[serde(flatten)]
    facts: Facts,
    /// The bounds of gamma that a proof supports.
    proven: Option<Verified>,
    unproven: Option<String>,
    warnings: Vec<String>,
    seconds: f64,
    proof_seconds: f64,
    iterations: String,
}

fn spec(input: &[u8]) -> Result<Spec, Refusal> {
    Ok(Spec::from_toml(text(input)?, SPEC)?)
}

/// Designs the bank and proves its gamma.
pub(crate) fn design(input: &[u8]) -> Result<Answer, Refusal> {
    let spec = spec(input)?;
    let begin = Instant::now();
    let options = Options { observer: &tell, ..Options::default() };
    let design = hybank::design::design(&spec, &options).map_err(Refusal::new)?;
    let seconds = (begin.elapsed() - design.proof_time).as_secs_f64();
    Answer::of(&Designed::new(&spec, design, seconds)?)
}

/// A line for who waits: the seconds that all of it takes natively at most, and the step that begins.
fn tell(stage: Stage, effort: Effort) {
    let _ = writeln!(io::stderr(), "{} {stage}", effort.longest);
}

impl Designed {
    fn new(spec: &Spec, design: Design, seconds: f64) -> Result<Self, Refusal> {
        let Design { bank, proof, proof_time, iterations, .. } = design;
        let complete = bank.spec.as_ref().unwrap_or(spec);
        Ok(Self {
            bank: bank.to_json().map_err(Refusal::new)?,
            facts: Facts::new(&bank, complete).map_err(Refusal::new)?,
            proven: proof.as_ref().ok().copied(),
            unproven: proof.err().map(|reason| reason.to_string()),
            warnings: warnings(spec, &bank)?,
            seconds,
            proof_seconds: proof_time.as_secs_f64(),
            iterations: counted(iterations, "iteration"),
        })
    }
}

/// As `hybank design` warns.
fn warnings(spec: &Spec, bank: &Bank) -> Result<Vec<String>, Refusal> {
    let mean = analyze_mean(bank).map_err(Refusal::new)?;
    let scale = GammaScale::new(bank).map_err(Refusal::new)?;
    let figures = Figures::new(bank).map_err(Refusal::new)?;
    let found = hybank::design::warnings(spec).unwrap_or_default();
    Ok(found.into_iter().chain(overview::warnings(bank, &mean, &scale, &figures)).collect())
}
