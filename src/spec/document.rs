//! A document as a tree of keys and values with their spans in the text.
//!
//! TOML and JSON both become this tree, so that both get the same error messages.

use std::collections::HashSet;
use std::fmt;
use std::ops::Range;

use crate::messages::Quoted;
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use toml::de::{DeTable, DeValue};

/// A value with its span in the text, where the parser reports one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    pub(crate) kind: Kind,
    pub(crate) span: Option<Range<usize>>,
}

/// A value by type.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Null,
    Boolean(bool),
    Integer(i128),
    Number(f64),
    Text(String),
    Date,
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// One key of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) key_span: Option<Range<usize>>,
    pub(crate) value: Node,
}

impl Kind {
    /// The name of the type in messages.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            // serde_json and others write NaN and infinity as null.
            Self::Null => "null (perhaps written for NaN or infinity)",
            Self::Boolean(_) => "true or false",
            Self::Integer(_) => "a whole number",
            Self::Number(_) => "a number",
            Self::Text(_) => "a text",
            Self::Date => "a date",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        }
    }
}

/// What is wrong with a TOML text, and where.
pub(super) fn syntax(error: &toml::de::Error, text: &str) -> (String, Option<Range<usize>>) {
    let is_deep = error.message().contains("recur");
    if !is_deep {
        return (error.message().to_owned(), error.span());
    }
    let rule = "tables and lists are nested too deeply; a spec needs no more than five levels";
    (rule.to_owned(), error.span().or_else(|| deepest_line(text)))
}

/// The line with the most dots, which the parser does not give for a key of too many parts.
fn deepest_line(text: &str) -> Option<Range<usize>> {
    let mut begin = 0;
    let lines = text.split_inclusive('\n').map(|line| {
        begin += line.len();
        begin - line.len()..begin
    });
    lines.max_by_key(|span| text[span.clone()].matches('.').count())
}

impl Node {
    /// Parses TOML text.
    pub(crate) fn from_toml(text: &str) -> Result<Self, toml::de::Error> {
        let table = DeTable::parse(text)?;
        let span = table.span();
        Ok(Self { kind: table_kind(table.into_inner()), span: Some(span) })
    }
}

fn table_kind(table: DeTable<'_>) -> Kind {
    let mut entries: Vec<Entry> = table
        .into_iter()
        .map(|(key, value)| Entry {
            key_span: Some(key.span()),
            key: key.into_inner().into_owned(),
            value: value_node(value),
        })
        .collect();
    // The parser sorts by name; errors should come in the order of the file.
    entries.sort_by_key(|entry| entry.key_span.as_ref().map(|span| span.start));
    Kind::Table(entries)
}

fn value_node(value: toml::Spanned<DeValue<'_>>) -> Node {
    let span = Some(value.span());
    let kind = match value.into_inner() {
        DeValue::String(text) => Kind::Text(text.into_owned()),
        DeValue::Boolean(b) => Kind::Boolean(b),
        DeValue::Datetime(_) => Kind::Date,
        DeValue::Float(x) => Kind::Number(x.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Integer(i) => match i128::from_str_radix(i.as_str(), i.radix()) {
            Ok(integer) => Kind::Integer(integer),
            Err(_) => Kind::Number(i.as_str().parse().unwrap_or(f64::INFINITY)),
        },
        DeValue::Array(items) => Kind::List(items.into_iter().map(value_node).collect()),
        DeValue::Table(table) => table_kind(table),
    };
    Node { kind, span }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let kind = deserializer.deserialize_any(KindVisitor)?;
        Ok(Self { kind, span: None })
    }
}

/// Builds a [`Kind`] from any self-describing format; a key given twice is an error.
struct KindVisitor;

impl<'de> Visitor<'de> for KindVisitor {
    type Value = Kind;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Kind, E> {
        Ok(Kind::Null)
    }

    fn visit_none<E>(self) -> Result<Kind, E> {
        Ok(Kind::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Kind, D::Error> {
        deserializer.deserialize_any(self)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Kind, E> {
        Ok(Kind::Boolean(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Kind, E> {
        Ok(Kind::Integer(value.into()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Kind, E> {
        Ok(Kind::Integer(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Kind, E> {
        Ok(Kind::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Kind, E> {
        Ok(Kind::Text(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Kind, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Kind::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Kind, A::Error> {
        let mut entries: Vec<Entry> = Vec::new();
        let mut keys = HashSet::new();
        while let Some(key) = map.next_key::<String>()? {
            if !keys.insert(key.clone()) {
                return Err(A::Error::custom(format!(
                    "the key \"{}\" is given twice; keep one of them",
                    Quoted(key)
                )));
            }
            entries.push(Entry { key, key_span: None, value: map.next_value()? });
        }
        Ok(Kind::Table(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_given_twice_is_found_among_very_many() {
        // Comparing each key with all before it would take minutes.
        let keys: String = (0..300_000).map(|i| format!("\"k{i}\":0,")).collect();
        let error = serde_json::from_str::<Node>(&format!("{{{keys}\"k7\":1}}")).unwrap_err().to_string();
        assert!(error.contains("\"k7\" is given twice"), "{error}");
        assert!(serde_json::from_str::<Node>(&format!("{{{keys}\"new\":1}}")).is_ok());
    }
}
