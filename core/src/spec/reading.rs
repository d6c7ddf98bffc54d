//! Reads documents by serde. What serde says of a fault becomes a place, a rule and the nearest known word.

use std::ops::Range;

use serde::de::value::{Error as Complaint, MapDeserializer};
use serde::de::{DeserializeOwned, Deserializer};
use toml::de::{DeTable, DeValue};

use super::filter_table::FilterTable;
use super::tables::{ChannelTable, SignalTable, SpecTable, TargetTable, UncertaintyTable};
use super::{DesignOverrides, Refusal, SpecError, SpecProblem};
use crate::messages::{Location, of_json, unknown};

/// One table where there is one for each converter.
const SINGLE_CHANNEL: &str = "[channel] is a single table, and each converter has one of its own; head each with two brackets, [[channel]]";

/// Reads TOML text.
pub(super) fn of_toml<T: DeserializeOwned>(text: &str) -> Result<T, SpecError> {
    let document = toml::Deserializer::parse(text).map_err(|error| {
        let place = error.span().and_then(|span| text.get(span)).unwrap_or_default();
        let is_channel = place.trim_matches(['[', ']', ' ']) == "channel";
        let is_second = is_channel && error.message().contains("duplicate");
        in_toml(text, &error, if is_second { "channel" } else { "" })
    })?;
    serde_path_to_error::deserialize(document)
        .map_err(|error| in_toml(text, error.inner(), &error.path().to_string()))
}

fn in_toml(text: &str, error: &toml::de::Error, path: &str) -> SpecError {
    let span = error.span().or_else(|| span_of(text, path)).or_else(|| line_of(text, error.message()));
    let location = span.map(|span| Location::find(text, span));
    refusal(error.message(), path).with_homes(tables_with).located(location)
}

/// The line with which the parser begins to say `message`, which has no place of its own.
fn line_of(text: &str, message: &str) -> Option<Range<usize>> {
    let ends: Vec<usize> = text.match_indices('\n').map(|(end, _)| end).chain([text.len()]).collect();
    let is_fine =
        |end: &usize| DeTable::parse(&text[..*end]).err().is_none_or(|error| error.message() != message);
    let line = ends.partition_point(is_fine);
    let start = if line == 0 { 0 } else { ends[line - 1] + 1 };
    Some(start..*ends.get(line)?)
}

/// Reads data of any format; the path of keys says where a fault is.
pub(super) fn of_data<'de, D: Deserializer<'de>, T: DeserializeOwned>(data: D) -> Result<T, SpecError> {
    serde_path_to_error::deserialize(data).map_err(|error| {
        let message = error.inner().to_string();
        refusal(message.lines().next().unwrap_or_default(), &error.path().to_string()).with_homes(tables_with)
    })
}

/// The refusal that a message of serde, about the value at `path`, stands for.
pub(crate) fn refusal(message: &str, path: &str) -> SpecError {
    let path = path.trim_matches('.');
    if path == "channel" && (message.contains("duplicate") || message.contains("invalid type: map")) {
        return Refusal::new(path, SpecProblem::Value { message: SINGLE_CHANNEL.to_owned() });
    }
    let Some(word) = unknown(message) else {
        return Refusal::new(path, SpecProblem::Value { message: of_json(message) });
    };
    let nearest = nearest(word.name, &word.known).map(str::to_owned);
    let known = word.known.into_iter().map(str::to_owned).collect();
    let (what, name) = (word.what, word.name.to_owned());
    // The path ends with the unknown key.
    let table =
        if what == "key" { path.strip_suffix(&name).unwrap_or(path).trim_end_matches('.') } else { path };
    Refusal::new(table, SpecProblem::Unknown { what, name, nearest, homes: Vec::new(), known })
}

/// The tables of a spec that have a key of this name.
fn tables_with(key: &str) -> Vec<&'static str> {
    let all = [
        (knows::<SpecTable>(key), "at the top of the file, before the first table"),
        (knows::<TargetTable>(key), "under [target]"),
        (knows::<ChannelTable>(key), "under [[channel]]"),
        (knows::<SignalTable>(key), "under [signal]"),
        (knows::<DesignOverrides>(key), "under [design]"),
        (knows::<UncertaintyTable>(key), "under [uncertainty]"),
        (knows::<FilterTable>(key), "in a filter, filter = { .. }"),
    ];
    all.into_iter().filter_map(|(knows, home)| knows.then_some(home)).collect()
}

/// Whether a table has a key: any other complaint than that it is unknown means that it is known.
fn knows<T: DeserializeOwned>(key: &str) -> bool {
    let entry = MapDeserializer::<_, Complaint>::new([(key, 0)].into_iter());
    T::deserialize(entry).err().is_none_or(|complaint| unknown(&complaint.to_string()).is_none())
}

/// The entry of `known` with the least edit distance to `word`, if that is at most a third of its length.
fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    // A typing error does not make a key far longer; the limit also bounds the work.
    let word: String = word.chars().take(65).flat_map(char::to_lowercase).collect();
    if word.chars().count() > 64 {
        return None;
    }
    known
        .iter()
        .map(|candidate| (strsim::osa_distance(&word, candidate), *candidate))
        .filter(|(d, candidate)| 3 * d <= candidate.chars().count())
        .min_by_key(|(d, _)| *d)
        .map(|(_, candidate)| candidate)
}

/// The error of a spec in the text of a file, with its location.
pub(super) fn in_text(error: SpecError, file: &str, text: &str) -> SpecError {
    let error = error.in_file(file);
    if error.overridden().is_some() || error.location().is_some() {
        return error;
    }
    let span = span_of(text, error.path());
    error.located(span.map(|span| Location::find(text, span)))
}

/// Where the value at a path of keys is in a TOML text: the value itself, or what is there of the path.
fn span_of(text: &str, path: &str) -> Option<Range<usize>> {
    let document = DeTable::parse(text).ok()?;
    let mut span = document.span();
    let whole = DeValue::Table(document.into_inner());
    let mut value = &whole;
    for part in path.split(['.', '[', ']']).filter(|part| !part.is_empty()) {
        let entry = value.get(part).or_else(|| value.get(other_spelling(part)?));
        let Some(next) = entry.or_else(|| value.get(part.parse::<usize>().ok()?)) else { break };
        (span, value) = (next.span(), next.get_ref());
    }
    Some(span)
}

/// The other key of a value that has two.
fn other_spelling(key: &str) -> Option<&'static str> {
    match key {
        "fast_period" => Some("fast_rate"),
        "delay" => Some("delay_samples"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_only_what_is_near() {
        let known = ["delay", "delay_samples", "filter"];
        assert_eq!(nearest("Delay", &known), Some("delay"));
        assert_eq!(nearest("delay_sample", &known), Some("delay_samples"));
        assert_eq!(nearest("fitler", &known), Some("filter"));
        assert_eq!(nearest("gain", &known), None);
        assert_eq!(nearest("d", &["a", "b", "c"]), None);
        assert_eq!(nearest(&"x".repeat(1_000_000), &known), None);
    }

    #[test]
    fn a_path_is_found_as_far_as_it_goes() {
        let text = "ratio = 2\nchannel = [{ delay = 1 }, { delay_samples = 3, filter = { den = [1, 2] } }]\n";
        let found = |path: &str| &text[span_of(text, path).unwrap()];
        assert_eq!(found("ratio"), "2");
        assert_eq!(found("channel[0].delay"), "1");
        assert_eq!(found("channel[1].delay"), "3");
        assert_eq!(found("channel[1].filter.den[1]"), "2");
        assert_eq!(found("channel[1].filter.num"), "{ den = [1, 2] }");
        assert_eq!(span_of(text, "design.taps").unwrap().start, 0);
    }
}
