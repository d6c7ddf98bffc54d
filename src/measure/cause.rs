//! Where a spur comes from.

use std::fmt;

/// The cause of a spur. Tones count from 1; 0 stands for the only tone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// Unequal offsets of `of` converters in turn: a line at k fs / of.
    Offset {
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
    },
    /// Unequal gains or sampling instants of `of` converters in turn: a line at |k fs / of + f| or
    /// |k fs / of - f|, in complex records without the bars. One tone does not tell gain from skew.
    GainOrSkew {
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
        /// True for the sum, false for the difference.
        is_sum: bool,
        /// The tone.
        tone: usize,
    },
    /// A harmonic of a tone.
    Harmonic {
        /// Multiple of the tone's frequency.
        order: usize,
        /// True if the harmonic lies above half the rate and is seen at its alias.
        folded: bool,
        /// The tone.
        tone: usize,
    },
    /// Unequal nonlinearity of `of` converters in turn: a line at a harmonic displaced by k fs / of.
    HarmonicImage {
        /// Multiple of the tone's frequency.
        order: usize,
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
    },
    /// Parts of a complex record that are not in quadrature or not of one gain: a line at minus the
    /// frequency of a tone or of its harmonic.
    Image {
        /// Multiple of the tone's frequency; 1 for the tone.
        order: usize,
        /// The tone.
        tone: usize,
    },
    /// A product of two tones, at |a f1 + b f2|; in complex records at a f1 + b f2.
    Intermodulation {
        /// a.
        a: i32,
        /// The first tone.
        first: usize,
        /// b.
        b: i32,
        /// The second tone.
        second: usize,
    },
    /// None of the others.
    Unknown,
}

impl Cause {
    /// True for what would be absent if all converters were equal.
    pub fn is_interleaving(self) -> bool {
        matches!(self, Self::Offset { .. } | Self::GainOrSkew { .. } | Self::HarmonicImage { .. })
    }

    /// True for harmonics.
    pub fn is_harmonic(self) -> bool {
        matches!(self, Self::Harmonic { .. })
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |tone: usize| if tone == 0 { "f".to_owned() } else { format!("f{tone}") };
        match *self {
            Self::Offset { k, of } => write!(f, "offset, {k}/{of} fs"),
            Self::GainOrSkew { k, of, is_sum, tone } => {
                write!(f, "gain or skew, {k}/{of} fs {} {}", if is_sum { '+' } else { '-' }, name(tone))
            }
            Self::Harmonic { order, folded, tone } => {
                write!(f, "harmonic, {order} {}{}", name(tone), if folded { ", folded" } else { "" })
            }
            Self::HarmonicImage { order, k, of } => write!(f, "harmonic {order} displaced by {k}/{of} fs"),
            Self::Image { order: 1, tone } => write!(f, "image, -{}", name(tone)),
            Self::Image { order, tone } => write!(f, "image of a harmonic, -{order} {}", name(tone)),
            Self::Intermodulation { a, first, b, second } => {
                write!(f, "intermodulation, {a} {} {b:+} {}", name(first), name(second))
            }
            Self::Unknown => write!(f, "unknown"),
        }
    }
}
