//! Why a measurement cannot be read or modelled.

use hybank_core::messages::Quoted;
use hybank_core::quantity::readable;
use hybank_core::units::{Decibels, Hertz, Seconds};

/// A text that is no measured response.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// A Touchstone file of another kind.
    #[error("line {line}: {what}")]
    Unsupported {
        /// Line, from 1.
        line: usize,
        /// What is not supported, and the remedy.
        what: String,
    },
    /// A line that is no data.
    #[error("line {line}: {wanted} are expected, and the line is \"{}\"", Quoted(.found))]
    Line {
        /// Line, from 1.
        line: usize,
        /// What belongs there.
        wanted: String,
        /// The beginning of the line.
        found: String,
    },
    /// Frequencies that do not rise.
    #[error("line {line}: the frequency {} does not lie above the one before it; sort the lines", readable(.value.0, "Hz"))]
    Order {
        /// Line, from 1.
        line: usize,
        /// The frequency there.
        value: Hertz,
    },
    /// A parameter that the file does not have.
    #[error("there is no parameter \"{}\"; this file has {known}", Quoted(.name))]
    Parameter {
        /// What was asked for.
        name: String,
        /// What there is.
        known: &'static str,
    },
    /// A heading without a unit.
    #[error(
        "the first line must name the columns and their units, as in \"frequency (MHz), gain (dB), phase (deg)\", and \
         it is \"{}\"",
        Quoted(.found)
    )]
    Heading {
        /// The first line.
        found: String,
    },
    /// Too many lines.
    #[error("there are more than {most} frequencies; keep every second one or fewer")]
    TooMany {
        /// The largest number.
        most: usize,
    },
    /// No data.
    #[error("there are no frequencies in it; give the file that was meant, a line for each frequency")]
    Empty,
}

/// A measurement without a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The model has more parameters than the measurement determines.
    #[error("too few frequencies above 0 Hz for order {order}: {points}; measure at {} or more, or give a lower order", 2 * .order)]
    TooFew {
        /// Frequencies above zero.
        points: usize,
        /// Poles that were asked for.
        order: usize,
    },
    /// An order that is not supported.
    #[error("a model has 1 to {most} poles, not {order}")]
    Order {
        /// Poles that were asked for.
        order: usize,
        /// The largest number.
        most: usize,
    },
    /// No model of this order is near.
    #[error(
        "the best model of {order} poles misses the measurement by {:.2} dB near {}{}; give another order, or measure \
         beyond the pass band",
        .error.0, readable(.at.0, "Hz"), delay_remedy(*.delay)
    )]
    Poor {
        /// Poles.
        order: usize,
        /// The error of the model.
        error: Decibels,
        /// Where it is largest.
        at: Hertz,
        /// A delay without which the model is good, and the error that is left.
        delay: Option<(Seconds, Decibels)>,
    },
    /// The response is zero or the numbers left the range of doubles.
    #[error("the response is zero, or its numbers leave the range of doubles")]
    Numbers,
}

fn delay_remedy(delay: Option<(Seconds, Decibels)>) -> String {
    delay.map_or_else(String::new, |(delay, error)| {
        format!(
            "; without a delay of {} the error is {:.4} dB: give deembed = \"{:e} s\" in the filter, and add the delay to \
             that of the channel if the signal has it too",
            readable(delay.0, "s"),
            error.0,
            delay.0
        )
    })
}
