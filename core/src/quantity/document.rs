//! Quantities in documents: a number in SI units, or a text with a unit.

use super::{FullScale, QuantityError, WrittenTime, frequency, full_scale, rate, relative, time};
use crate::units::{Hertz, Seconds};
use serde::de::{Deserialize, Deserializer, Error, Visitor};
use std::fmt;

/// A rate of samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rate(pub(crate) Hertz);

/// A share of something.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Share(pub(crate) f64);

/// How a quantity is read.
struct QuantityVisitor<T> {
    number: fn(f64) -> T,
    text: fn(&str) -> Result<T, QuantityError>,
}

impl<T> Visitor<'_> for QuantityVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a text with a number and its unit")
    }

    fn visit_f64<E>(self, number: f64) -> Result<T, E> {
        Ok((self.number)(number))
    }

    fn visit_i64<E>(self, number: i64) -> Result<T, E> {
        Ok((self.number)(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> Result<T, E> {
        Ok((self.number)(number as f64))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        (self.text)(text).map_err(E::custom)
    }
}

/// Reads a type by its two functions.
macro_rules! read_by {
    ($name:ty, $number:expr, $text:expr) => {
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(QuantityVisitor { number: $number, text: $text })
            }
        }
    };
}

read_by!(WrittenTime, |number| Self::Seconds(Seconds(number)), time);
read_by!(Hertz, Self, frequency);
read_by!(Rate, |number| Self(Hertz(number)), |text| rate(text).map(Self));
read_by!(Share, Self, |text| relative(text).map(Self));
read_by!(FullScale, Self::Number, full_scale);
