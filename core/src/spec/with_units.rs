//! The numbers of a spec file with their units: `fast_rate = "48 kS/s"`, `cutoff = "9 kHz"`.

use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{DocumentMut, Item, KeyMut, Value};

use crate::quantity::exact;
use crate::units::{Hertz, Seconds};

/// Digits of a rate that people chose.
const CHOSEN_DIGITS: usize = 12;

/// The text of a spec with this fast period, as it is serialised, with units in place of powers of ten. It
/// reads back to the same bits.
pub(super) fn with_units(text: &str, fast_period: Seconds) -> String {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return text.to_owned() };
    WithUnits.visit_document_mut(&mut document);
    let period = format!("fast_period = {}", Value::from(exact(fast_period.0, "s")));
    let rate = rate_of(fast_period).map(|rate| format!("fast_rate = {}", Value::from(exact(rate, "S/s"))));
    document.to_string().replacen(&period, &rate.unwrap_or_else(|| period.clone()), 1)
}

/// The rate of this period, with few digits where they suffice; `None` if no rate has the period's bits.
fn rate_of(fast_period: Seconds) -> Option<f64> {
    let rate = fast_period.rate().0;
    let chosen = format!("{rate:.*e}", CHOSEN_DIGITS - 1).parse().unwrap_or(rate);
    [chosen, rate].into_iter().find(|rate| Hertz(*rate).period() == fast_period)
}

struct WithUnits;

impl VisitMut for WithUnits {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, item: &mut Item) {
        let unit = match key.get() {
            "fast_period" | "delay" | "jitter" => "s",
            "rate" => "S/s",
            "cutoff" | "band" => "Hz",
            // Its cut-offs are shares.
            "uncertainty" => return item.get_mut("delay").map_or((), |delay| give_unit(delay, "s")),
            _ => return visit_table_like_kv_mut(self, key, item),
        };
        give_unit(item, unit);
    }
}

/// A number, or each of a list, as a text with this unit.
fn give_unit(item: &mut Item, unit: &str) {
    let values: Vec<&mut Value> = match item.as_value_mut() {
        Some(Value::Array(list)) => list.iter_mut().collect(),
        value => value.into_iter().collect(),
    };
    for value in values {
        if let Some(number) = value.as_float() {
            *value = exact(number, unit).into();
        }
    }
}
