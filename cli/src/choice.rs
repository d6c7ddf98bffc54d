//! Options that take one of a few names.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// A name, what the help says of it, and its value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Choice<T> {
    pub(super) name: &'static str,
    pub(super) help: &'static str,
    pub(super) value: T,
}

/// Reads the name of one of these.
pub(super) fn one_of<T>(choices: &'static [Choice<T>]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let names = choices.iter().map(|choice| PossibleValue::new(choice.name).help(choice.help));
    PossibleValuesParser::new(names).try_map(|name| named(choices, &name).ok_or("no such name"))
}

/// The value of this name.
pub(super) fn named<T: Copy>(choices: &[Choice<T>], name: &str) -> Option<T> {
    choices.iter().find(|choice| choice.name == name).map(|choice| choice.value)
}
