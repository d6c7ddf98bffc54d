//! The bank file: its tables, and the bank that they make.

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use super::check::check_length;
use super::digest::{check_form, digest};
use super::{Bank, FORMAT, FixedPoint, Gamma, Proof, StateMatrices, SynthesisFilters, VERSION, layout};
use crate::messages::{Quoted, of_json};
use crate::runtime::Nonlinearity;
use crate::spec::{
    At, DesignOverrides, Method, OneOrEach, Refusal, Spec, SpecProblem, SpecTable, no_models, refusal,
    refused,
};
use crate::units::Seconds;

/// The file, key by key, with the spec as it is read or written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BankTable<S> {
    format: String,
    version: usize,
    spec: Option<S>,
    fast_period: f64,
    ratio: usize,
    latency: usize,
    method: Method,
    channels: Vec<ConverterTable>,
    state_space: Option<StateMatrices>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fixed_point: Option<FixedPoint>,
    gamma: Option<Gamma>,
    #[serde(skip_serializing_if = "Option::is_none")]
    proof: Option<Proof>,
    #[serde(skip_serializing_if = "Option::is_none")]
    digest: Option<String>,
    /// What other programs store.
    #[serde(rename = "meta", default, skip_serializing)]
    _meta: IgnoredAny,
}

/// A converter. What a reader takes for granted is left out.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConverterTable {
    delay: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<f64>,
    #[serde(skip_serializing_if = "Nonlinearity::is_straight", default)]
    nonlinearity: Nonlinearity,
    #[serde(skip_serializing_if = "Option::is_none")]
    taps: Option<TapLists>,
}

/// The taps of each sample of a frame: one list in the file, or a list of several.
#[derive(Clone, Serialize, Deserialize)]
#[serde(try_from = "Vec<OneOrEach<f64>>", into = "Vec<OneOrEach<f64>>")]
struct TapLists(Vec<Vec<f64>>);

impl From<TapLists> for Vec<OneOrEach<f64>> {
    fn from(TapLists(mut lists): TapLists) -> Self {
        match &mut lists[..] {
            [one] => std::mem::take(one).into_iter().map(OneOrEach::Same).collect(),
            _ => lists.into_iter().map(OneOrEach::Each).collect(),
        }
    }
}

impl TryFrom<Vec<OneOrEach<f64>>> for TapLists {
    type Error = &'static str;

    fn try_from(items: Vec<OneOrEach<f64>>) -> Result<Self, &'static str> {
        let number = |item: &OneOrEach<f64>| if let OneOrEach::Same(tap) = item { Some(*tap) } else { None };
        let list = |item| if let OneOrEach::Each(taps) = item { Some(taps) } else { None };
        match items.iter().map(number).collect() {
            Some(one) => Ok(Self(vec![one])),
            None => {
                let lists: Option<_> = items.into_iter().map(list).collect();
                lists.map(Self).ok_or("expected a list of numbers, or a list of such lists")
            }
        }
    }
}

/// What every version of the format has.
#[derive(Deserialize)]
struct Header {
    format: String,
    version: usize,
}

impl Bank {
    /// Reads a bank file's text; `file_name` is used only in messages.
    ///
    /// # Errors
    /// [`Refusal`] naming the JSON place, the rule and the remedy for the first thing that is wrong.
    pub fn from_json(text: &str, file_name: &str) -> Result<Self, Refusal> {
        // Some editors put a byte-order mark in front.
        let text = text.trim_start_matches('\u{feff}');
        let bank = parse(text).and_then(BankTable::bank);
        bank.and_then(|bank| bank.check().map(|()| bank)).map_err(|error| error.in_file(file_name))
    }

    /// The text of the bank file with its digest: objects indented, lists on one line, numbers with as many
    /// digits as are needed to read back the same bits.
    ///
    /// # Errors
    /// [`Refusal`] as [`Bank::check`]; in particular for NaN and infinity, which JSON cannot represent.
    pub fn to_json(&self) -> Result<String, Refusal> {
        self.check()?;
        layout::text(&BankTable { digest: Some(self.digest()?), ..self.table() })
    }

    /// The digest that the bank file has.
    ///
    /// # Errors
    /// As [`Bank::to_json`].
    pub fn digest(&self) -> Result<String, Refusal> {
        serde_json::to_value(self.table())
            .map(|document| digest(&document))
            .map_err(|error| unreadable(&error.to_string()))
    }

    fn table(&self) -> BankTable<&Spec> {
        let unless = |value: f64, default: f64| (value != default).then_some(value);
        let channel = |i: usize| ConverterTable {
            delay: self.delays[i].0,
            samples: (self.samples[i] != 1).then_some(self.samples[i]),
            gain: unless(self.gains[i], 1.0),
            offset: unless(self.offsets[i], 0.0),
            nonlinearity: self.nonlinearity[i].clone(),
            taps: self.taps_of(i),
        };
        BankTable {
            format: FORMAT.to_owned(),
            version: VERSION,
            spec: self.spec.as_ref(),
            fast_period: self.fast_period.0,
            ratio: self.ratio,
            latency: self.latency,
            method: self.method,
            channels: (0..self.channel_count()).map(channel).collect(),
            state_space: match &self.filters {
                SynthesisFilters::Fir(_) => None,
                SynthesisFilters::StateSpace(block) => Some(block.clone()),
            },
            fixed_point: self.fixed_point.clone(),
            gamma: Some(self.gamma),
            proof: self.proof.clone(),
            digest: None,
            _meta: IgnoredAny,
        }
    }

    /// The taps of a converter.
    fn taps_of(&self, converter: usize) -> Option<TapLists> {
        let SynthesisFilters::Fir(taps) = &self.filters else { return None };
        Some(TapLists(taps[self.layout().ranges()[converter].clone()].to_vec()))
    }
}

fn parse(text: &str) -> Result<BankTable<SpecTable>, Refusal> {
    serde_json::from_str(text).or_else(|_| {
        // Only a file that is refused is read again for the path of the fault.
        let reader = &mut serde_json::Deserializer::from_str(text);
        serde_path_to_error::deserialize(reader).map_err(|error| {
            let header: Result<Header, _> = serde_json::from_str(text);
            header.map_or(Ok(()), Header::check).err().unwrap_or_else(|| refused_at(&error))
        })
    })
}

fn refused_at(error: &serde_path_to_error::Error<serde_json::Error>) -> Refusal {
    match error.inner().is_data() {
        true => refusal(&error.inner().to_string(), &error.path().to_string()),
        false => syntax(error.inner()),
    }
}

/// A text that is not JSON.
pub(super) fn syntax(error: &serde_json::Error) -> Refusal {
    unreadable(&of_json(&error.to_string()))
}

/// A text that no bank has.
pub(super) fn unreadable(message: &str) -> Refusal {
    let remedy = "is this a bank written by `hybank design`, and is it whole?";
    refused("", format!("{}; {remedy}", Quoted(message)))
}

impl Header {
    fn check(self) -> Result<(), Refusal> {
        if self.format != FORMAT {
            let rule = format!(
                "the file says format \"{}\", a bank says \"{FORMAT}\"; give a file written by `hybank design`",
                Quoted(&self.format)
            );
            return Err(refused("format", rule));
        }
        if self.version != VERSION {
            let rule = format!(
                "the bank has version {}, this program reads version {VERSION}; design it again, or update the program",
                self.version
            );
            return Err(refused("version", rule));
        }
        Ok(())
    }
}

impl BankTable<SpecTable> {
    fn bank(self) -> Result<Bank, Refusal> {
        Header { format: self.format, version: self.version }.check()?;
        self.digest.as_deref().map_or(Ok(()), check_form)?;
        let spec = self.spec.map(|table| table.spec(DesignOverrides::default(), &no_models));
        let spec = spec.transpose().map_err(|error| error.inside("spec"))?;
        let of_channels = |value: fn(&ConverterTable) -> f64| self.channels.iter().map(value).collect();
        Ok(Bank {
            spec,
            fast_period: Seconds(self.fast_period),
            ratio: self.ratio,
            latency: self.latency,
            method: self.method,
            samples: self.channels.iter().map(|channel| channel.samples.unwrap_or(1)).collect(),
            delays: self.channels.iter().map(|channel| Seconds(channel.delay)).collect(),
            gains: of_channels(|channel| channel.gain.unwrap_or(1.0)),
            offsets: of_channels(|channel| channel.offset.unwrap_or(0.0)),
            nonlinearity: self.channels.iter().map(|channel| channel.nonlinearity.clone()).collect(),
            filters: filters(self.state_space, self.channels)?,
            fixed_point: self.fixed_point,
            gamma: self.gamma.unwrap_or_default(),
            proof: self.proof,
        })
    }
}

/// Either every channel has taps, or there is a state-space block.
fn filters(block: Option<StateMatrices>, channels: Vec<ConverterTable>) -> Result<SynthesisFilters, Refusal> {
    let with_taps = channels.iter().position(|channel| channel.taps.is_some());
    match (block, with_taps) {
        (Some(block), None) => Ok(SynthesisFilters::StateSpace(block)),
        (Some(_), Some(i)) => {
            let remedy = "a bank runs by the one or the other, keep what goes with its method";
            let problem = SpecProblem::Conflict { first: "taps", second: "state_space", remedy };
            Err(Refusal::new(format!("channels[{i}].taps"), problem))
        }
        (None, _) => {
            let lists = channels.into_iter().enumerate().map(|(i, channel)| {
                channel.tap_lists().map_err(|error| error.inside(&format!("channels[{i}]")))
            });
            let lists = lists.collect::<Result<Vec<_>, Refusal>>()?;
            Ok(SynthesisFilters::Fir(lists.into_iter().flatten().collect()))
        }
    }
}

impl ConverterTable {
    /// The taps of each sample of a frame.
    fn tap_lists(self) -> Result<Vec<Vec<f64>>, Refusal> {
        let remedy = "give the taps of every channel, or a state_space for all";
        let missing = SpecProblem::MissingKey { key: "taps", remedy };
        let TapLists(lists) = self.taps.ok_or(missing).at("")?;
        let rule = "a converter with several samples per frame has a list of taps for each of them";
        check_length("taps", lists.len(), self.samples.unwrap_or(1), "tap lists", rule)?;
        Ok(lists)
    }
}
