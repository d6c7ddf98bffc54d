//! New values in the text of a spec file, with everything else kept: comments, layout, units.

use std::ops::Range;

use super::document::{Entry, Kind, Node};
use super::{
    ChannelSpec, DesignOverrides, FilterModel, FilterModels, MeasuredFilter, PerChannel, Spec, SpecError,
    SpecProblem, UncertaintySpec,
};
use crate::units::{Decibels, Seconds};

/// Largest relative difference of two delays that differ only by the rounding of their unit.
const DELAY_ROUNDING: f64 = 1e-12;

/// Replacements of ranges of a text.
struct Edits<'a> {
    text: &'a str,
    list: Vec<(Range<usize>, String)>,
}

impl Spec {
    /// The text of a spec file with the delays, gains, offsets and filters of the channels, the latency and
    /// the uncertainty of this spec, whose measured filters are those of `models`. Everything else of `text`
    /// is kept as it is, measurements by their files. Delays have the unit that the file gives them.
    ///
    /// Where the text cannot be edited (it describes another spec, or writes channels in an unusual way),
    /// the whole spec is rewritten.
    ///
    /// # Errors
    /// As [`Spec::to_toml`].
    pub fn to_toml_like(&self, text: &str, models: &FilterModels<'_>) -> Result<String, SpecProblem> {
        self.check()?;
        let exact = |wanted: &MeasuredFilter| {
            models(wanted).map(|model| FilterModel { error: Decibels(0.0), ..model })
        };
        let own = self.without_model_errors(text, models, &exact);
        let edited = own.edited(text, &exact).filter(|edited| own.is_what(edited, &exact));
        edited.map_or_else(|| self.to_toml(), Ok)
    }

    /// This spec with the half-widths of the gains that `text` has, if they differ from this spec's by the
    /// errors of models alone: reading adds these again.
    fn without_model_errors(&self, text: &str, models: &FilterModels<'_>, exact: &FilterModels<'_>) -> Self {
        let mut own = self.clone();
        let gain = |spec: &Self| spec.uncertainty.as_ref().and_then(|table| table.gain.clone());
        if let (Ok(read), Ok(written)) = (read(text, models), read(text, exact))
            && let Some(table) = own.uncertainty.as_mut().filter(|table| table.gain == gain(&read))
        {
            table.gain = gain(&written);
        }
        own
    }

    /// Whether `text` reads as this spec, up to the rounding of delays.
    fn is_what(&self, text: &str, models: &FilterModels<'_>) -> bool {
        let Ok(mut read) = read(text, models) else { return false };
        if read.channels.len() != self.channels.len() {
            return false;
        }
        for (own, read) in self.channels.iter().zip(&mut read.channels) {
            read.delay = rounded_to(read.delay, own.delay);
        }
        if let (Some(own), Some(read)) = (&self.uncertainty, &mut read.uncertainty)
            && let (Some(PerChannel::Each(own)), Some(PerChannel::Each(read))) = (&own.delay, &mut read.delay)
        {
            read.iter_mut().zip(own).for_each(|(read, own)| *read = rounded_to(*read, *own));
        }
        read == *self
    }

    fn edited(&self, text: &str, models: &FilterModels<'_>) -> Option<String> {
        let document = Node::from_toml(text).ok()?;
        let mut edits = Edits { text, list: Vec::new() };
        let top = entries(&document)?;
        if let Some(latency) = self.latency {
            edits.replace(find(top, "latency")?, latency.to_string());
        }
        let channels = list(&find(top, "channel")?.value)?;
        if channels.len() != self.channels.len() {
            return None;
        }
        let in_samples = entries(channels.first()?).is_some_and(|keys| find(keys, "delay_samples").is_some());
        let old = read(text, models).ok()?;
        for ((node, channel), old) in channels.iter().zip(&self.channels).zip(&old.channels) {
            edits.channel(self, node, old, channel)?;
        }
        if let Some(uncertainty) = &self.uncertainty {
            let h = in_samples.then_some(self.fast_period);
            edits.uncertainty(find(top, "uncertainty"), &lines(uncertainty, h))?;
        }
        Some(edits.apply())
    }
}

/// The text of a spec file with the names of measurements as `renamed` says; as it is where it says nothing,
/// or where the text is no TOML.
pub fn with_measurements_renamed(text: &str, renamed: impl Fn(&str) -> Option<String>) -> String {
    let mut edits = Edits { text, list: Vec::new() };
    let mut nodes = Vec::from_iter(Node::from_toml(text));
    while let Some(node) = nodes.pop() {
        match node.kind {
            Kind::List(items) => nodes.extend(items),
            Kind::Table(entries) => {
                for entry in entries {
                    if let ("touchstone" | "response", Kind::Text(path)) = (&*entry.key, &entry.value.kind)
                        && let Some(path) = renamed(path)
                    {
                        edits.replace(&entry, toml::Value::from(path).to_string());
                    }
                    nodes.push(entry.value);
                }
            }
            _ => {}
        }
    }
    edits.apply()
}

fn read(text: &str, models: &FilterModels<'_>) -> Result<Spec, SpecError> {
    Spec::from_toml_and_files(text, "", DesignOverrides::default(), models)
}

fn rounded_to(read: Seconds, own: Seconds) -> Seconds {
    if (read.0 - own.0).abs() <= DELAY_ROUNDING * own.0.abs() { own } else { read }
}

fn entries(node: &Node) -> Option<&[Entry]> {
    if let Kind::Table(entries) = &node.kind { Some(entries) } else { None }
}

fn list(node: &Node) -> Option<&[Node]> {
    if let Kind::List(items) = &node.kind { Some(items) } else { None }
}

fn find<'a>(entries: &'a [Entry], key: &str) -> Option<&'a Entry> {
    entries.iter().find(|entry| entry.key == key)
}

impl Edits<'_> {
    fn replace(&mut self, entry: &Entry, value: String) {
        if let Some(span) = &entry.value.span {
            self.list.push((span.clone(), value));
        }
    }

    fn channel(&mut self, spec: &Spec, node: &Node, old: &ChannelSpec, channel: &ChannelSpec) -> Option<()> {
        let keys = entries(node)?;
        let delay = match (find(keys, "delay"), find(keys, "delay_samples")) {
            (Some(entry), _) => (entry, channel.delay.0),
            (None, entry) => (entry?, channel.delay / spec.fast_period),
        };
        self.replace(delay.0, number(delay.1));
        let before = delay.0.key_span.as_ref()?.start;
        let is_inline = self.text.get(node.span.clone()?)?.starts_with('{');
        let mut put = |key: &str, value: String, is_default: bool| match find(keys, key) {
            Some(entry) => self.replace(entry, value),
            None if is_default => {}
            None => {
                let end = if is_inline { ", " } else { "\n" };
                self.list.push((before..before, format!("{key} = {value}{end}")));
            }
        };
        put("gain", number(channel.gain), channel.gain == 1.0);
        put("offset", number(channel.offset), channel.offset == 0.0);
        if channel.filter != old.filter {
            put("filter", toml::Value::try_from(&channel.filter).ok()?.to_string(), false);
        }
        Some(())
    }

    /// The table as `lines`, in the place of the old one or at the end.
    fn uncertainty(&mut self, old: Option<&Entry>, lines: &[String]) -> Option<()> {
        let Some(old) = old else {
            let end = self.text.len();
            let gap = if self.text.ends_with('\n') { "\n" } else { "\n\n" };
            self.list.push((end..end, format!("{gap}[uncertainty]\n{}\n", lines.join("\n"))));
            return Some(());
        };
        let span = old.value.span.clone()?;
        if self.text.get(span.clone())?.starts_with('{') {
            self.list.push((span, format!("{{ {} }}", lines.join(", "))));
            return Some(());
        }
        let keys = entries(&old.value)?;
        for (number, entry) in keys.iter().enumerate() {
            let start = self.text[..entry.key_span.as_ref()?.start].rfind('\n').map_or(0, |at| at + 1);
            let end = entry.value.span.as_ref()?.end;
            let end = self.text[end..].find('\n').map_or(self.text.len(), |at| end + at + 1);
            let new = if number == 0 { lines.join("\n") + "\n" } else { String::new() };
            self.list.push((start..end, new));
        }
        (!keys.is_empty()).then_some(())
    }

    fn apply(mut self) -> String {
        // A stable sort: insertions at one place keep their order.
        self.list.sort_by_key(|(range, _)| range.start);
        let mut text = self.text.to_owned();
        for (range, new) in self.list.iter().rev() {
            text.replace_range(range.clone(), new);
        }
        text
    }
}

/// A number as TOML reads it back to the same bits.
fn number(value: f64) -> String {
    format!("{value:?}")
}

/// The keys of the table; delays in fast periods if the fast period `h` is given.
fn lines(table: &UncertaintySpec, h: Option<Seconds>) -> Vec<String> {
    let line =
        |key: &str, value: Option<PerChannel<f64>>| value.map(|value| format!("{key} = {}", written(&value)));
    let delay = match h {
        Some(h) => line("delay_samples", table.delay.as_ref().map(|list| list.map(|time| *time / h))),
        None => line("delay", table.delay.as_ref().map(|list| list.map(|time| time.0))),
    };
    let reference = table.reference.map(|reference| format!("reference = {reference}"));
    let all = [
        delay,
        line("gain", table.gain.clone()),
        line("offset", table.offset.clone()),
        line("cutoff", table.cutoff.clone()),
        reference,
    ];
    all.into_iter().flatten().collect()
}

fn written(value: &PerChannel<f64>) -> String {
    match value {
        PerChannel::Same(value) => number(*value),
        PerChannel::Each(list) => {
            format!("[{}]", list.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "))
        }
    }
}
