//! The proof in a bank file: the certificate with which `hybank::verify` proves the gamma from the file
//! alone.

use serde::{Deserialize, Serialize};

/// The proof of the gammas of a bank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// For `gamma.upper`, from above and from below.
    pub upper: Certificate,
    /// For `gamma.worst_case`, beside `upper`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<BoxProof>,
}

/// Bounds of what the errors of the spec's `[uncertainty]` change: of the filters over D, and of D times the
/// uncertain rows. `verify` multiplies them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxProof {
    /// D: a positive number for each uncertain delay, gain and cut-off of each sample of a frame, in this
    /// order.
    pub scales: Vec<f64>,
    /// Of the filters.
    pub filters: NormBound,
    /// Of the rows.
    pub slopes: NormBound,
}

/// Certificate that a norm is below a number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormBound {
    /// The number.
    pub norm: f64,
    /// Lower triangular R, row by row, with P = R R' of the bounded-real lemma.
    pub factor: Vec<Vec<f64>>,
}

/// Certificate that the norm of a bank is below a gamma, and a frequency at which its gain is close to that
/// gamma.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// ||K|| is less than this (h = 1); `gamma.upper`, some 1e-8 above `gamma.norm`.
    pub gamma: f64,
    /// The frequency and direction of the bank's largest gain.
    pub peak: GainWitness,
    /// Lower triangular R, row by row, with P = R R' of the bounded-real lemma in the coordinates of
    /// `hybank::verify`.
    pub factor: Vec<Vec<f64>>,
    /// A triangle that is added to `factor` where R needs more digits than a double has; empty elsewhere.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correction: Vec<Vec<f64>>,
}

/// A direction of the reference samples at the point e^{i w} = (c + i s)^2 / (c^2 + s^2) of the unit circle,
/// w in radians per slow period: the gain there is a lower bound of the norm.
///
/// A witness of weight zero proves nothing and is refused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainWitness {
    /// `[c, s]`, about cos(w/2) and sin(w/2).
    pub half: [f64; 2],
    /// Weights of the M reference samples of a slow period, `[re, im]`.
    pub reference: Vec<[f64; 2]>,
}
