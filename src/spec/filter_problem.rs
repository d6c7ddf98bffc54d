//! Errors of a written filter.

use crate::messages::Number;

/// Most poles of a filter. Real front ends have fewer than a dozen. The product of 32 poles, each of at
/// most 1e9 rad per fast period, still fits a double.
pub const MAX_ORDER: usize = 32;

/// The rule that a written filter violates.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterProblem {
    /// A rule for one key of the filter table, or for the whole table.
    #[error("{rule}")]
    Rule {
        /// The key, if it is a single one.
        key: Option<&'static str>,
        /// What is wrong, with the value, the rule and the remedy.
        rule: String,
    },
    /// As many zeros as poles, or more.
    #[error(
        "the filter is not strictly proper: with {zeros} zeros against {poles} poles it passes arbitrarily high \
         frequencies, and samples of a finite-energy signal are not defined; {remedy}"
    )]
    NotStrictlyProper {
        /// Degree of the numerator.
        zeros: usize,
        /// Degree of the denominator.
        poles: usize,
        /// What to do about it.
        remedy: String,
    },
    /// A problem with one stage of a cascade.
    #[error("cascade[{index}]: {problem}")]
    Stage {
        /// Index of the stage, from 0.
        index: usize,
        /// The problem.
        problem: Box<FilterProblem>,
    },
}

impl FilterProblem {
    /// A problem of one key.
    pub(crate) fn of(key: &'static str, rule: impl Into<String>) -> Self {
        Self::Rule { key: Some(key), rule: rule.into() }
    }

    /// A number that is NaN, or larger than `most`.
    pub(super) fn too_large(key: &'static str, value: f64, most: f64) -> Self {
        let rule = "every coefficient must be a finite number";
        Self::of(
            key,
            format!("{key} holds {}; {rule}, at most {most:e} in size; check its unit", Number(value)),
        )
    }

    /// The key of the filter table that the problem concerns, if it is a single one.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            Self::Rule { key, .. } => *key,
            Self::NotStrictlyProper { .. } => None,
            Self::Stage { .. } => Some("cascade"),
        }
    }
}
