//! Errors of a written filter.

/// Most poles of a filter. Real front ends have fewer than a dozen. The product of 32 poles, each of at
/// most 1e9 rad per fast period, still fits a double.
pub const MAX_ORDER: usize = 32;

/// The rule that a written filter violates.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterProblem {
    /// A list or matrix has no entries.
    #[error("{key} is empty; {remedy}")]
    Empty {
        /// The key of the list.
        key: &'static str,
        /// What to write instead.
        remedy: &'static str,
    },
    /// A coefficient is NaN or infinite.
    #[error("{key} holds {value}; every coefficient must be a finite number")]
    NotFinite {
        /// The key of the list or number.
        key: &'static str,
        /// The offending value.
        value: f64,
    },
    /// Too many poles.
    #[error(
        "the filter has {order} poles, but at most {MAX_ORDER} are supported; leave out stages that matter least"
    )]
    OrderTooHigh {
        /// The key that sets the number of poles.
        key: &'static str,
        /// Number of poles asked for.
        order: usize,
    },
    /// No pole at all.
    #[error("the filter has no pole, so it passes every frequency; give it at least one")]
    NoPoles {
        /// The key that sets the number of poles.
        key: &'static str,
    },
    /// Every denominator coefficient is zero.
    #[error("den is zero ({count} coefficients, all 0); its highest power of s needs another coefficient")]
    ZeroDenominator {
        /// How many coefficients were given.
        count: usize,
    },
    /// The filter is zero.
    #[error("the filter is zero because {key} is, so its output carries no signal; make {key} nonzero")]
    Zero {
        /// The key that makes it zero.
        key: &'static str,
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
    /// More zeros than poles.
    #[error(
        "the filter has {zeros} zeros and {poles} poles, so it grows with frequency; give it at least as many poles as zeros"
    )]
    Improper {
        /// Degree of the numerator.
        zeros: usize,
        /// Degree of the denominator.
        poles: usize,
    },
    /// A matrix of a state-space form that does not fit the others.
    #[error(
        "{key} is {rows} x {cols}, but a filter with one input, one output and {states} states needs {expected}"
    )]
    Shape {
        /// Which matrix.
        key: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns; of the first row that does not fit, if the rows are unequal.
        cols: usize,
        /// Rows of `a`.
        states: usize,
        /// The size that fits.
        expected: String,
    },
    /// A family parameter that is missing.
    #[error("a {family} filter needs {key} ({meaning})")]
    MissingParameter {
        /// Name of the family.
        family: &'static str,
        /// Name of the missing key.
        key: &'static str,
        /// What the key means.
        meaning: &'static str,
    },
    /// A family parameter that has no meaning for the family.
    #[error("{key} = {value} has no meaning for a {family} filter; remove it")]
    NeedlessParameter {
        /// Name of the family.
        family: &'static str,
        /// Name of the key.
        key: &'static str,
        /// The value given.
        value: f64,
    },
    /// A family parameter out of its range.
    #[error("{key} = {value}{unit}: {rule}")]
    ParameterRange {
        /// Name of the key.
        key: &'static str,
        /// The value given.
        value: f64,
        /// Its unit with a leading space, or nothing.
        unit: &'static str,
        /// The rule and the remedy.
        rule: String,
    },
    /// A cascade inside a cascade.
    #[error("a cascade cannot hold another cascade; list all its stages in one")]
    NestedCascade,
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
    /// The key of the filter table that the problem concerns, if it is a single one.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            Self::Empty { key, .. }
            | Self::NotFinite { key, .. }
            | Self::OrderTooHigh { key, .. }
            | Self::NoPoles { key }
            | Self::Zero { key }
            | Self::Shape { key, .. }
            | Self::NeedlessParameter { key, .. }
            | Self::ParameterRange { key, .. } => Some(key),
            Self::ZeroDenominator { .. } => Some("den"),
            Self::NestedCascade | Self::Stage { .. } => Some("cascade"),
            Self::NotStrictlyProper { .. } | Self::Improper { .. } | Self::MissingParameter { .. } => None,
        }
    }
}
