//! The proof in a bank file: the certificate and the witnesses with which [`crate::verify`] proves the
//! gammas from the file alone.

use serde::Serialize;

/// Witnesses for the gammas of a bank. Each part may be missing; its bound is then not proven.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proof {
    /// For `gamma.upper`, from above and from below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<Certificate>,
    /// For `gamma.lower`. Left out if `gamma.noncausal` is an equally large bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower: Option<LowerProof>,
    /// For `gamma.noncausal`: a frequency and direction in which the samples determine the reference
    /// samples least.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noncausal: Option<DualWitness>,
    /// For `gamma.worst_case`, beside `upper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<BoxProof>,
}

/// Bounds of what the errors of the spec's `[uncertainty]` change: of the filters over D, and of D times the
/// uncertain rows. `verify` multiplies them.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NormBound {
    /// The number.
    pub norm: f64,
    /// Lower triangular R, row by row, with P = R R' of the bounded-real lemma.
    pub factor: Vec<Vec<f64>>,
}

/// The witnesses of a lower bound.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum LowerProof {
    /// For all FIR banks of this length: witnesses whose combination does not depend on the taps.
    Fir(Vec<DualWitness>),
    /// For all causal banks.
    Causal(CausalWitness),
}

/// A gamma that no causal bank achieves: the finite-horizon filtering recursion breaks down within
/// `periods` slow periods.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CausalWitness {
    /// No causal bank has a smaller norm (h = 1).
    pub gamma: f64,
    /// T, 1 to [`MAX_PERIODS`](Self::MAX_PERIODS).
    pub periods: usize,
}

impl CausalWitness {
    /// Maximum number of slow periods of a witness.
    pub const MAX_PERIODS: usize = 4096;
}

/// Certificate that the norm of a bank is below a gamma, and a frequency at which its gain is close to that
/// gamma.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// ||K|| is less than this (h = 1); `gamma.upper`, some 1e-8 above `gamma.norm`.
    pub gamma: f64,
    /// The frequency and direction of the bank's largest gain.
    pub peak: DualWitness,
    /// Lower triangular R, row by row, with P = R R' of the bounded-real lemma in the coordinates of
    /// [`crate::verify`].
    pub factor: Vec<Vec<f64>>,
    /// A triangle that is added to `factor` where R needs more digits than a double has; empty elsewhere.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub correction: Vec<Vec<f64>>,
}

/// Weights of the samples at the point e^{i w} = (c + i s)^2 / (c^2 + s^2) of the unit circle, w in radians
/// per slow period.
///
/// A witness of weight zero proves nothing and is refused.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DualWitness {
    /// `[c, s]`, about cos(w/2) and sin(w/2).
    pub half: [f64; 2],
    /// Weights of the M reference samples of a slow period, `[re, im]`.
    pub reference: Vec<[f64; 2]>,
    /// Weights of the N measured samples of a slow period; empty if they follow from the other numbers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<[f64; 2]>,
}
