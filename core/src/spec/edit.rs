//! New values in the text of a spec file, with everything else kept: comments, layout, units.

use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{Array, DocumentMut, InlineTable, Item, KeyMut, Table, TableLike, Value};

use super::{
    ChannelSpec, DesignOverrides, FilterModel, FilterModels, FilterSpec, MeasuredFilter, OneOrEach, Spec,
    SpecError, UncertaintySpec,
};
use crate::runtime::Nonlinearity;
use crate::units::{Decibels, Seconds};

/// Largest relative difference of two delays that differ only by the rounding of their unit.
const DELAY_ROUNDING: f64 = 1e-12;

impl Spec {
    /// The text of a spec file with the delays, gains, offsets, noise and filters of the channels, the
    /// latency, the rms of the signal, the method and the uncertainty of this spec, whose measured filters
    /// are those of `models`. Everything else of `text` is kept as it is, measurements by their files.
    /// Delays have the unit that the file gives them.
    ///
    /// Where the text cannot be edited (it describes another spec, or writes channels in an unusual way),
    /// the whole spec is rewritten.
    ///
    /// # Errors
    /// As [`Spec::to_toml`].
    pub fn to_toml_like(&self, text: &str, models: &FilterModels<'_>) -> Result<String, SpecError> {
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
        for (own, read) in self.channels.iter().zip(&mut read.channels) {
            read.delay = rounded_to(read.delay, own.delay);
        }
        if let (Some(own), Some(read)) = (&self.uncertainty, &mut read.uncertainty)
            && let (Some(OneOrEach::Each(own)), Some(OneOrEach::Each(read))) = (&own.delay, &mut read.delay)
        {
            read.iter_mut().zip(own).for_each(|(read, own)| *read = rounded_to(*read, *own));
        }
        read == *self
    }

    /// `None` where the text has other channels.
    fn edited(&self, text: &str, models: &FilterModels<'_>) -> Option<String> {
        let old = read(text, models).ok()?;
        let mut document: DocumentMut = text.parse().ok()?;
        if let Some(latency) = self.latency {
            set(document.as_table_mut(), "latency", i64::try_from(latency).ok()?.into());
        }
        if self.design.method != old.design.method {
            let table = document.entry("design").or_insert(Item::Table(Table::new()));
            set(table.as_table_like_mut()?, "method", self.design.method.name().into());
        }
        if let (Some(own), Some(old)) = (&self.signal, &old.signal)
            && own.rms != old.rms
        {
            set(document.get_mut("signal")?.as_table_like_mut()?, "rms", number(own.rms));
        }
        let tables = tables_in(document.get_mut("channel")?);
        if tables.len() != self.channels.len() || old.channels.len() != self.channels.len() {
            return None;
        }
        // The unit of delays, and of their half-widths.
        let h = tables.first()?.contains_key("delay_samples").then_some(self.fast_period);
        for ((table, channel), old) in tables.into_iter().zip(&self.channels).zip(&old.channels) {
            channel.write(table, old, self.fast_period)?;
        }
        if let Some(uncertainty) = &self.uncertainty {
            let table = document.entry("uncertainty").or_insert(Item::Table(Table::new()));
            uncertainty.write(table.as_table_like_mut()?, h);
        }
        Some(document.to_string())
    }
}

impl ChannelSpec {
    /// Writes into the table what may have changed since `old`.
    fn write(&self, table: &mut dyn TableLike, old: &Self, h: Seconds) -> Option<()> {
        match table.contains_key("delay_samples") {
            true => set(table, "delay_samples", number(self.delay / h)),
            false => set(table, "delay", number(self.delay.0)),
        }
        let [own, old_values] = [self, old].map(|channel| [channel.gain, channel.offset, channel.noise]);
        for (key, (new, old)) in ["gain", "offset", "noise"].into_iter().zip(own.into_iter().zip(old_values))
        {
            if new != old {
                set(table, key, number(new));
            }
        }
        if self.nonlinearity != old.nonlinearity {
            set(table, "nonlinearity", written_nonlinearity(&self.nonlinearity));
        }
        if self.filter != old.filter {
            set(table, "filter", inline(&self.filter)?);
        }
        Some(())
    }
}

impl UncertaintySpec {
    /// Writes all keys into the table; delays in fast periods if the fast period `h` is given.
    fn write(&self, table: &mut dyn TableLike, h: Option<Seconds>) {
        let (key, other) = if h.is_some() { ("delay_samples", "delay") } else { ("delay", "delay_samples") };
        table.remove(other);
        let delay = |time: &Seconds| h.map_or(time.0, |h| *time / h);
        let entries = [
            (key, self.delay.as_ref().map(|list| written(&list.map(delay)))),
            ("gain", self.gain.as_ref().map(written)),
            ("offset", self.offset.as_ref().map(written)),
            ("cutoff", self.cutoff.as_ref().map(written)),
            ("reference", self.reference.map(|channel| (channel as i64).into())),
        ];
        for (key, value) in entries {
            match value {
                Some(value) => set(table, key, value),
                None => drop(table.remove(key)),
            }
        }
    }
}

/// Whether the text of a spec file leaves the design to the defaults; the noise of the converters is none of
/// it.
pub fn leaves_the_design_open(text: &str) -> bool {
    let Ok(document) = text.parse::<DocumentMut>() else { return false };
    let table = document.get("design").and_then(Item::as_table_like);
    table.is_none_or(|table| table.iter().all(|(key, _)| key == "noise"))
}

/// The text of a spec file with the names of measurements as `renamed` says; as it is where it says nothing,
/// or where the text is no TOML.
pub fn with_measurements_renamed(text: &str, renamed: impl Fn(&str) -> Option<String>) -> String {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return text.to_owned() };
    Renaming(renamed).visit_document_mut(&mut document);
    document.to_string()
}

/// Renames measurements.
struct Renaming<F>(F);

impl<F: Fn(&str) -> Option<String>> VisitMut for Renaming<F> {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, item: &mut Item) {
        let is_measurement = matches!(key.get(), "touchstone" | "response");
        match item.as_str().filter(|_| is_measurement).and_then(&self.0) {
            Some(renamed) => replace(item, renamed.into()),
            None => visit_table_like_kv_mut(self, key, item),
        }
    }
}

fn read(text: &str, models: &FilterModels<'_>) -> Result<Spec, SpecError> {
    Spec::from_toml_and_files(text, "", DesignOverrides::default(), models)
}

fn rounded_to(read: Seconds, own: Seconds) -> Seconds {
    if (read.0 - own.0).abs() <= DELAY_ROUNDING * own.0.abs() { own } else { read }
}

/// The tables of a list, each headed [[channel]] or inline.
fn tables_in(item: &mut Item) -> Vec<&mut dyn TableLike> {
    match item {
        Item::ArrayOfTables(list) => list.iter_mut().map(|table| table as &mut dyn TableLike).collect(),
        Item::Value(Value::Array(list)) => {
            let tables = list.iter_mut().filter_map(Value::as_inline_table_mut);
            tables.map(|table| table as &mut dyn TableLike).collect()
        }
        _ => Vec::new(),
    }
}

/// Sets the value of a key. One that is there keeps its place and its comment.
fn set(table: &mut dyn TableLike, key: &str, value: Value) {
    match table.get_mut(key) {
        Some(item) => replace(item, value),
        None => append(table, key, value),
    }
}

/// The space before the end of an inline table stays there.
fn append(table: &mut dyn TableLike, key: &str, mut value: Value) {
    let last = table.iter_mut().last().and_then(|(_, item)| item.as_value_mut());
    if let Some(decor) = last.map(Value::decor_mut)
        && let Some(space) =
            decor.suffix().filter(|suffix| suffix.as_str().is_some_and(|text| text.trim().is_empty()))
    {
        value.decor_mut().set_suffix(space.clone());
        decor.set_suffix("");
    }
    table.insert(key, Item::Value(value));
}

fn replace(item: &mut Item, mut value: Value) {
    if let Some(old) = item.as_value() {
        *value.decor_mut() = old.decor().clone();
    }
    *item = Item::Value(value);
}

/// A number as TOML reads it back to the same bits, with an exponent where there would be many zeros.
fn number(value: f64) -> Value {
    format!("{value:?}").parse().unwrap_or_else(|_| value.into())
}

fn written_nonlinearity(nonlinearity: &Nonlinearity) -> Value {
    let values: Value = nonlinearity.values().iter().copied().map(number).collect();
    match nonlinearity {
        Nonlinearity::Polynomial(_) => values,
        Nonlinearity::Table { .. } => InlineTable::from_iter([("table", values)]).into(),
    }
}

fn written(values: &OneOrEach<f64>) -> Value {
    match values {
        OneOrEach::Same(value) => number(*value),
        OneOrEach::Each(list) => list.iter().copied().map(number).collect::<Array>().into(),
    }
}

fn inline(filter: &FilterSpec) -> Option<Value> {
    toml::Value::try_from(filter).ok()?.to_string().parse().ok()
}
