//! What a bank file carries so that its gammas can be proven from the file alone; [`crate::verify`] says how.

use serde::Serialize;

/// Witnesses for the gammas of a bank. Each part may be missing; what is missing is found anew before a proof.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proof {
    /// For `gamma.upper`, from above and from below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<Certificate>,
    /// For `gamma.lower` of an FIR bank: tones that bind all taps of its length. Empty where `gamma.noncausal` says as
    /// much, and for the other methods.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lower: Vec<Tone>,
    /// For `gamma.noncausal`: a tone at which the samples say least about the wanted ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noncausal: Option<Tone>,
}

/// Certificate that a bank keeps a gamma, and a tone at which it comes near it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// ||K|| is less than this (h = 1); some 1e-8 above `gamma.upper`, which is the norm itself.
    pub gamma: f64,
    /// Where the bank's own gain is largest.
    pub peak: Tone,
    /// Lower triangular R, row by row, with P = R R' of the bounded-real lemma in the coordinates of [`crate::verify`].
    pub factor: Vec<Vec<f64>>,
}

/// A tone at the point e^{i w} = (c + i s)^2 / (c^2 + s^2) of the unit circle, w in radians a slow tick.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tone {
    /// `[c, s]`, about cos(w/2) and sin(w/2).
    pub half: [f64; 2],
    /// Weights of the M wanted samples of a tick, `[re, im]`.
    pub wanted: Vec<[f64; 2]>,
    /// Weights of the N measured samples of a tick; empty where they follow from the rest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<[f64; 2]>,
}
