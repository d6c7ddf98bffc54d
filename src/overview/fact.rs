//! A figure in words.

/// A figure with its name and its meaning.
#[derive(Debug, Clone, PartialEq)]
pub struct Fact {
    /// Its name in tables.
    pub name: &'static str,
    /// With its unit.
    pub value: String,
    /// In a sentence.
    pub meaning: String,
}

/// A [`Fact`] of its three texts.
pub(super) fn fact(name: &'static str, value: impl Into<String>, meaning: impl Into<String>) -> Fact {
    Fact { name, value: value.into(), meaning: meaning.into() }
}
