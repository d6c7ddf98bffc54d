//! The spec: what an engineer writes down about front ends, delays and rates.
//!
//! Everything here is plain data in SI units; [`crate::analog`] turns a [`FilterSpec`] into a
//! checked realisation and [`crate::design`] turns a [`Spec`] into a bank.

use serde::{Deserialize, Serialize};

/// A spec with the units resolved (seconds) and the omitted channel filters filled in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Free text.
    #[serde(default)]
    pub name: String,
    /// h, the period of the wanted fast samples, in seconds.
    pub fast_period: f64,
    /// M, fast samples for each slow one.
    pub ratio: usize,
    /// m0, the latency allowed, in fast samples; `None` lets the designer pick.
    #[serde(default)]
    pub latency: Option<usize>,
    /// Phi_0, the filter of the ideal fast converter.
    pub target: FilterSpec,
    /// The real channels, in the order of the recordings.
    pub channels: Vec<ChannelSpec>,
    /// How to design.
    pub design: DesignSpec,
}

/// One slow converter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelSpec {
    /// D_i >= 0 in seconds.
    pub delay: f64,
    /// Phi_i.
    pub filter: FilterSpec,
}

/// An analog filter as written down; not yet checked for stability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum FilterSpec {
    /// Numerator over denominator in descending powers of s (rad/s).
    TransferFunction {
        /// Numerator coefficients.
        num: Vec<f64>,
        /// Denominator coefficients.
        den: Vec<f64>,
    },
    /// gain * prod(s - z) / prod(s - p), rad/s, complex values as `[re, im]`.
    ZeroPoleGain {
        /// Zeros.
        zeros: Vec<[f64; 2]>,
        /// Poles.
        poles: Vec<[f64; 2]>,
        /// Leading coefficient.
        gain: f64,
    },
    /// dx/dt = a x + b f, out = c x; lists of rows.
    StateSpace {
        /// n x n.
        a: Vec<Vec<f64>>,
        /// n x 1.
        b: Vec<Vec<f64>>,
        /// 1 x n.
        c: Vec<Vec<f64>>,
    },
    /// A classical low-pass by name.
    Family {
        /// Which one.
        family: Family,
        /// Number of poles.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        order: Option<usize>,
        /// Cutoff in hertz, with scipy.signal's meaning for the family.
        cutoff: f64,
        /// Pass-band ripple in decibels (Chebyshev 1, elliptic).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ripple_db: Option<f64>,
        /// Stop-band attenuation in decibels (Chebyshev 2, elliptic).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        attenuation_db: Option<f64>,
    },
}

/// The classical low-pass families.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Maximally flat magnitude.
    Butterworth,
    /// Equiripple pass band.
    Chebyshev1,
    /// Equiripple stop band.
    Chebyshev2,
    /// Equiripple in both bands.
    Elliptic,
    /// Maximally flat group delay, normalised by phase.
    Bessel,
    /// One pole.
    Rc,
}

/// How the synthesis filters are designed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Finite impulse responses of given length, least gamma.
    Fir,
    /// State-space filters, least gamma.
    Iir,
    /// State-space filters, least mean-square error.
    H2,
    /// Papoulis/Yen interpolation of recurrent nonuniform samples, truncated (for comparison).
    Sinc,
    /// Fractional delays undone channel by channel, then integer delays (for comparison).
    Separation,
}

/// The `[design]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignSpec {
    /// The method.
    pub method: Method,
    /// Taps a channel at the fast rate, for the methods that make FIR filters.
    #[serde(default)]
    pub taps: Option<usize>,
    /// Relative excess over the optimal gamma that the designer may spend on a smaller mean-square error.
    #[serde(default)]
    pub slack: Option<f64>,
}
