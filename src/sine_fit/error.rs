//! Why a fit is refused.

use crate::units::Hertz;

/// Why sines cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SineFitError {
    /// No record or no tone was given, or the rate is not a positive number.
    #[error(
        "a sine fit needs at least one record, one tone and a positive rate: got {channels} records, {tones} tones and {rate}"
    )]
    Nothing {
        /// Number of records.
        channels: usize,
        /// Number of tones.
        tones: usize,
        /// Rate of the samples.
        rate: Hertz,
    },
    /// The mask of a channel has another length than its samples.
    #[error("channel {channel}: its mask has {mask} entries for {samples} samples; give one per sample")]
    Mask {
        /// The channel, from 1.
        channel: usize,
        /// Length of the mask.
        mask: usize,
        /// Length of the record.
        samples: usize,
    },
    /// Fewer samples than the parameters need.
    #[error(
        "channel {channel}: {used} usable samples of {samples} do not determine {tones} tones and a constant, which need at least {needed}; record more, or leave out fewer"
    )]
    TooFewSamples {
        /// The channel, from 1.
        channel: usize,
        /// Samples that are finite and not left out.
        used: usize,
        /// Length of the record.
        samples: usize,
        /// Number of tones.
        tones: usize,
        /// Samples that are needed.
        needed: usize,
    },
    /// A frequency so close to a multiple of half the rate that sine and cosine (or the constant) cannot be
    /// told apart.
    #[error(
        "the tone at {frequency} is within {distance:.3} cycles per record of a multiple of half the rate ({rate}), where sine and cosine coincide and amplitude and phase cannot be told apart; choose a tone at least half a cycle per record away"
    )]
    AtEdge {
        /// The frequency.
        frequency: Hertz,
        /// Its distance to the multiple, in cycles per record.
        distance: f64,
        /// Rate of the samples.
        rate: Hertz,
    },
    /// Two tones whose samples cannot be told apart.
    #[error(
        "the tones at {first} and {second} cannot be told apart in the samples: they alias to less than half a cycle per record of each other; choose other tones, or record longer"
    )]
    TonesCoincide {
        /// One tone.
        first: Hertz,
        /// The other.
        second: Hertz,
    },
    /// Nothing stands out of the noise.
    #[error("no tone found{}", nothing(*near, lines))]
    NoTone {
        /// Where it was looked for; `None` for anywhere.
        near: Option<Hertz>,
        /// Where lines are instead, from the largest, below half the rate.
        lines: Vec<Hertz>,
    },
    /// Gauss-Newton did not settle, or left the neighbourhood of its start.
    #[error(
        "the fit of the tone near {frequency} did not converge after {iterations} steps; give its frequency to within half a cycle per record, or a record in which it is steady"
    )]
    NoConvergence {
        /// The start.
        frequency: Hertz,
        /// Steps taken.
        iterations: usize,
    },
}

/// Where there is no tone, and where there are lines.
fn nothing(near: Option<Hertz>, lines: &[Hertz]) -> String {
    let Some(near) = near else {
        return ": the largest peak of the spectrum is not above its noise; give a record with a sine wave"
            .into();
    };
    let list: Vec<String> = lines.iter().map(|line| format!("{line:.3}")).collect();
    match &list[..] {
        [] => format!(" near {near}: no peak of the spectrum is above the noise there; check the frequency"),
        [one] => format!(" near {near}: the only line of the record appears at {one}; give its frequency"),
        more => format!(
            " near {near}: the lines of the record appear at {} (largest first); give the frequency of one of them",
            more.join(", ")
        ),
    }
}
