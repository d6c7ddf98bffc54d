//! Reading the bank that a verb works on.

use super::Failure;
use crate::bank::{Bank, Gamma, SynthesisFilters};
use crate::spec::Method;
use std::path::Path;

/// Reads a bank file.
pub(super) fn load(path: &Path) -> Result<Bank, Failure> {
    let name = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::Input(format!("{name}: cannot read the bank: {error}")))?;
    parse(&text).map_err(|error| Failure::Input(format!("{name}: not a bank: {error}")))
}

#[derive(serde::Deserialize)]
struct Form {
    fast_period: f64,
    ratio: usize,
    latency: usize,
    method: Method,
    channels: Vec<Channel>,
    state_space: Option<crate::bank::BlockFilter>,
    gamma: Gamma,
}

#[derive(serde::Deserialize)]
struct Channel {
    delay: f64,
    #[serde(default)]
    taps: Vec<f64>,
}

fn parse(text: &str) -> serde_json::Result<Bank> {
    let form: Form = serde_json::from_str(text)?;
    let delays = form.channels.iter().map(|channel| channel.delay).collect();
    let filters = match form.state_space {
        Some(filter) => SynthesisFilters::StateSpace(filter),
        None => SynthesisFilters::Fir(form.channels.into_iter().map(|channel| channel.taps).collect()),
    };
    let Form { fast_period, ratio, latency, method, gamma, .. } = form;
    Ok(Bank { spec: None, fast_period, ratio, latency, method, delays, filters, gamma })
}
