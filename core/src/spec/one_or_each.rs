//! One value for all, or a list of values.

use serde::Serialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// One value for all, or one value for each.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum OneOrEach<T> {
    /// The same for all.
    Same(T),
    /// One each, in order.
    Each(Vec<T>),
}

impl<T: Copy + Default> OneOrEach<T> {
    /// The value of index `i`, from 0; zero beyond the end of a list.
    pub fn of(&self, i: usize) -> T {
        match self {
            Self::Same(value) => *value,
            Self::Each(list) => list.get(i).copied().unwrap_or_default(),
        }
    }
}

impl<T> OneOrEach<T> {
    /// The values that were written.
    pub fn values(&self) -> &[T] {
        match self {
            Self::Same(value) => std::slice::from_ref(value),
            Self::Each(list) => list,
        }
    }

    /// The same list with other values.
    pub(super) fn map<U>(&self, other: impl Fn(&T) -> U) -> OneOrEach<U> {
        match self {
            Self::Same(value) => OneOrEach::Same(other(value)),
            Self::Each(list) => OneOrEach::Each(list.iter().map(other).collect()),
        }
    }
}

/// Reads numbers and texts as one value, and lists as one value each.
struct OneOrEachVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OneOrEach<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrEachVisitor(PhantomData))
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for OneOrEachVisitor<T> {
    type Value = OneOrEach<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a list of numbers")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<OneOrEach<T>, E> {
        T::deserialize(number.into_deserializer()).map(OneOrEach::Same)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<OneOrEach<T>, E> {
        T::deserialize(number.into_deserializer()).map(OneOrEach::Same)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<OneOrEach<T>, E> {
        T::deserialize(number.into_deserializer()).map(OneOrEach::Same)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<OneOrEach<T>, E> {
        T::deserialize(text.into_deserializer()).map(OneOrEach::Same)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, items: A) -> Result<OneOrEach<T>, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(items)).map(OneOrEach::Each)
    }
}
