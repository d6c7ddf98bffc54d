//! Typed access to a document; every error carries its path and location.

use super::Fault;
use super::SpecProblem;
use super::document::{Entry, Kind, Node};
use crate::quantity::{self, FullScale, QuantityError, Time};
use crate::units::{Hertz, Seconds};

/// A value and its path.
#[derive(Debug, Clone)]
pub(crate) struct Value<'a> {
    node: &'a Node,
    path: String,
}

/// A table of which every key is known.
#[derive(Debug, Clone)]
pub(crate) struct Fields<'a> {
    entries: &'a [Entry],
    whole: Value<'a>,
}

/// The value of one of two keys.
pub(crate) enum Either<'a> {
    First(Value<'a>),
    Second(Value<'a>),
    Neither,
}

impl<'a> Value<'a> {
    /// The whole document.
    pub(crate) fn root(node: &'a Node) -> Self {
        Self { node, path: String::new() }
    }

    /// A problem with this value.
    pub(crate) fn fault(&self, problem: impl Into<SpecProblem>) -> Fault {
        Fault {
            path: self.path.clone(),
            span: self.node.span.clone(),
            problem: Box::new(problem.into()),
            overridden: false,
        }
    }

    fn wrong_type(&self, expected: &'static str) -> Fault {
        self.fault(SpecProblem::WrongType { expected, found: self.node.kind.name() })
    }

    /// Whether it is null.
    pub(crate) fn is_null(&self) -> bool {
        matches!(self.node.kind, Kind::Null)
    }

    /// The path of keys to this value.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// A finite number; integers are accepted.
    pub(crate) fn number(&self) -> Result<f64, Fault> {
        let value = match self.node.kind {
            Kind::Number(x) => x,
            Kind::Integer(i) => i as f64,
            _ => return Err(self.wrong_type("a number")),
        };
        if value.is_finite() {
            return Ok(value);
        }
        let rule = "every number must be finite and fit a double".into();
        Err(self.fault(SpecProblem::Range { value, unit: "(read as a double)", rule }))
    }

    /// A number, or a text that `parse` turns into the quantity.
    fn quantity<T>(
        &self,
        parse: fn(&str) -> Result<T, QuantityError>,
        bare: fn(f64) -> T,
    ) -> Result<T, Fault> {
        match &self.node.kind {
            Kind::Text(text) => parse(text).map_err(|problem| self.fault(problem)),
            Kind::Number(_) | Kind::Integer(_) => self.number().map(bare),
            _ => Err(self.wrong_type("a number, or a text with a number and its unit")),
        }
    }

    /// A time: a number of seconds, or a text such as `\"3 ns\"` or `\"0.3 samples\"`.
    pub(crate) fn time(&self) -> Result<Time, Fault> {
        self.quantity(quantity::time, |seconds| Time::Seconds(Seconds(seconds)))
    }

    /// Full scale: a number above 0, or a text such as `\"8bits\"`.
    pub(crate) fn full_scale(&self) -> Result<FullScale, Fault> {
        let text = match &self.node.kind {
            Kind::Text(text) => text.clone(),
            _ => self.number()?.to_string(),
        };
        quantity::full_scale(&text).map_err(|problem| self.fault(problem))
    }

    /// A frequency: a number of hertz, or a text such as `\"9 kHz\"`.
    pub(crate) fn frequency(&self) -> Result<Hertz, Fault> {
        self.quantity(quantity::frequency, Hertz)
    }

    /// A share of something: a number, or a text such as `\"1%\"`.
    pub(crate) fn share(&self) -> Result<f64, Fault> {
        self.quantity(quantity::relative, |share| share)
    }

    /// A rate: a number of hertz, or a text such as `\"1 GS/s\"`.
    pub(crate) fn rate(&self) -> Result<Hertz, Fault> {
        self.quantity(quantity::rate, Hertz)
    }

    /// A whole number >= 0; `unit` names what is counted.
    pub(crate) fn count(&self, unit: &'static str) -> Result<usize, Fault> {
        let out_of_range =
            |value, rule: &str| self.fault(SpecProblem::Range { value, unit, rule: rule.into() });
        let whole = self.integer(unit)?;
        usize::try_from(whole).map_err(|_| {
            out_of_range(whole as f64, "it must be a whole number, zero or more, that fits a machine word")
        })
    }

    /// A whole number of either sign; `unit` names what is counted.
    pub(crate) fn integer(&self, unit: &'static str) -> Result<i128, Fault> {
        match self.node.kind {
            Kind::Integer(i) => Ok(i),
            Kind::Number(value) => {
                let rule = "it must be a whole number, written without point and exponent".into();
                Err(self.fault(SpecProblem::Range { value, unit, rule }))
            }
            _ => Err(self.wrong_type("a whole number")),
        }
    }

    /// A text.
    pub(crate) fn text(&self) -> Result<&'a str, Fault> {
        match &self.node.kind {
            Kind::Text(text) => Ok(text),
            _ => Err(self.wrong_type("a text in quotes")),
        }
    }

    /// A list, item by item; `expected` describes the whole list.
    pub(crate) fn items(&self, expected: &'static str) -> Result<Vec<Value<'a>>, Fault> {
        match &self.node.kind {
            Kind::List(items) => Ok(items
                .iter()
                .enumerate()
                .map(|(i, node)| Value { node, path: format!("{}[{i}]", self.path) })
                .collect()),
            _ => Err(self.wrong_type(expected)),
        }
    }

    /// A number that `check` accepts.
    pub(crate) fn number_in(&self, check: fn(f64) -> Result<(), SpecProblem>) -> Result<f64, Fault> {
        let number = self.number()?;
        check(number).map(|()| number).map_err(|problem| self.fault(problem))
    }

    /// A count that `check` accepts.
    pub(crate) fn count_in(
        &self,
        unit: &'static str,
        check: fn(usize) -> Result<(), SpecProblem>,
    ) -> Result<usize, Fault> {
        let count = self.count(unit)?;
        check(count).map(|()| count).map_err(|problem| self.fault(problem))
    }

    /// A number of bits. One that does not fit u32 is out of range in any case.
    pub(crate) fn bits(&self) -> Result<u32, Fault> {
        Ok(u32::try_from(self.count("bits")?).unwrap_or(u32::MAX))
    }

    /// Two frequencies; `expected` describes them.
    pub(crate) fn frequencies(&self, expected: &'static str) -> Result<[Hertz; 2], Fault> {
        match &self.items(expected)?[..] {
            [low, high] => Ok([low.frequency()?, high.frequency()?]),
            _ => Err(self.fault(SpecProblem::WrongType { expected, found: "a list of another length" })),
        }
    }

    /// Whether it is a list.
    pub(crate) fn is_list(&self) -> bool {
        matches!(self.node.kind, Kind::List(_))
    }

    /// Whether it is a table.
    pub(crate) fn is_table(&self) -> bool {
        matches!(self.node.kind, Kind::Table(_))
    }

    /// A list of numbers. Paths are built only for errors, since tap lists are long.
    pub(crate) fn numbers(&self) -> Result<Vec<f64>, Fault> {
        let Kind::List(items) = &self.node.kind else { return Err(self.wrong_type("a list of numbers")) };
        let number = |(i, node): (usize, &'a Node)| match node.kind {
            Kind::Number(x) if x.is_finite() => Ok(x),
            _ => Value { node, path: format!("{}[{i}]", self.path) }.number(),
        };
        items.iter().enumerate().map(number).collect()
    }

    /// A list of rows of numbers.
    pub(crate) fn matrix(&self) -> Result<Vec<Vec<f64>>, Fault> {
        self.items("a list of rows, [[..], [..]]")?.iter().map(Value::numbers).collect()
    }

    /// One of the `known` names; `what` describes them in errors.
    pub(crate) fn name<T: Copy>(&self, what: &'static str, known: &[(&'static str, T)]) -> Result<T, Fault> {
        let text = self.text()?;
        if let Some((_, value)) = known.iter().find(|(name, _)| *name == text) {
            return Ok(*value);
        }
        let known: Vec<&'static str> = known.iter().map(|(name, _)| *name).collect();
        let nearest = nearest(text, &known);
        Err(self.fault(SpecProblem::UnknownName { what, name: text.to_owned(), nearest, known }))
    }

    /// The value of `key` of a table whose other keys are not checked.
    pub(crate) fn entry(&self, key: &'static str) -> Result<Value<'a>, Fault> {
        let Kind::Table(entries) = &self.node.kind else {
            return Err(self.wrong_type("a table of keys and values"));
        };
        Fields { entries, whole: self.clone() }.required(key, "every bank file starts with it")
    }

    /// A table whose keys are all in `known`.
    pub(crate) fn fields(&self, known: &[&'static str]) -> Result<Fields<'a>, Fault> {
        let Kind::Table(entries) = &self.node.kind else {
            return Err(self.wrong_type("a table of keys and values"));
        };
        match entries.iter().find(|entry| !known.contains(&entry.key.as_str())) {
            Some(Entry { key, key_span, .. }) => {
                let (key, nearest, known) = (key.clone(), nearest(key, known), known.to_vec());
                let problem = SpecProblem::UnknownKey { key, homes: Vec::new(), nearest, known };
                Err(Fault { span: key_span.clone(), ..self.fault(problem) })
            }
            None => Ok(Fields { entries, whole: self.clone() }),
        }
    }
}

impl<'a> Fields<'a> {
    /// The table itself, for errors that concern all of it.
    pub(crate) fn whole(&self) -> &Value<'a> {
        &self.whole
    }

    /// Whether `key` is present and not null.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.optional(key).is_some()
    }

    /// The value of `key`, unless it is absent or null.
    pub(crate) fn optional(&self, key: &str) -> Option<Value<'a>> {
        let entry = self.entries.iter().find(|entry| entry.key == key)?;
        let prefix = &self.whole.path;
        let path = if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") };
        Some(Value { node: &entry.value, path }).filter(|value| !value.is_null())
    }

    /// What `read` makes of the value of `key`, unless it is absent or null.
    pub(crate) fn read<T>(
        &self,
        key: &str,
        read: impl FnOnce(Value<'a>) -> Result<T, Fault>,
    ) -> Result<Option<T>, Fault> {
        self.optional(key).map(read).transpose()
    }

    /// The value of one of two keys that exclude each other.
    pub(crate) fn either(
        &self,
        first: &'static str,
        second: &'static str,
        remedy: &'static str,
    ) -> Result<Either<'a>, Fault> {
        match (self.optional(first), self.optional(second)) {
            (Some(_), Some(value)) => Err(value.fault(SpecProblem::Conflict { first, second, remedy })),
            (Some(value), None) => Ok(Either::First(value)),
            (None, Some(value)) => Ok(Either::Second(value)),
            (None, None) => Ok(Either::Neither),
        }
    }

    /// The value of `key`; `remedy` is the advice if it is absent.
    pub(crate) fn required(&self, key: &'static str, remedy: &'static str) -> Result<Value<'a>, Fault> {
        self.optional(key).ok_or_else(|| self.whole.fault(SpecProblem::MissingKey { key, remedy }))
    }

    /// `problem` at the value of `key`, or at the whole table without it.
    pub(crate) fn fault_at(&self, key: Option<&str>, problem: impl Into<SpecProblem>) -> Fault {
        key.and_then(|key| self.optional(key)).unwrap_or_else(|| self.whole.clone()).fault(problem)
    }
}

/// The entry of `known` with the least edit distance to `word`, if that is at most a third of its length.
fn nearest(word: &str, known: &[&'static str]) -> Option<&'static str> {
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
}
