//! Proof of a bank's gammas from its file alone, in arithmetic whose every rounding is charged.
//!
//! This module shares no code with the designer: it neither searches nor optimises, it checks. What a proof needs is in the
//! file ([`Proof`]); where that came from does not matter.
//!
//! # What is proven
//! For the error system K of the bank's own coefficients (thesis Props. 5.1-5.3), in normalised time (h = 1):
//!
//! - `attained <= ||K|| <= upper`: from below by the gain at one tone, from above by the bounded-real lemma with the
//!   certificate P = R R'; the same certificate proves that the bank is stable;
//! - no FIR bank of this length has a gamma below `lower`, by tones that together bind all taps;
//! - no bank at all, causal or not, has a gamma below `noncausal`, by one tone.
//!
//! # From where on
//! Taken for given, exactly as doubles: the state equations of the front ends in normalised time that [`crate::analog`]
//! realises from the spec (their rounding, some 1e-15 relative, is tested there, not proven here), delays and latency in fast
//! periods, the coefficients in the file. From these on everything is enclosed: exponentials and Gramians by Taylor series with
//! their rest, frequency responses by a residual, positive definiteness by a Cholesky factorisation in double-double
//! arithmetic (Rump, 2006), everything else by intervals of 106 bits. Sampling instants are rounded to 106 bits.
//!
//! Not proven: that the spec describes the hardware; the lower end of `iir` banks beyond the noncausal bound; for `h2`,
//! `sinc` and `separation` only what holds for any bank is claimed.

mod ball;
mod double_word;
mod error_system;
mod flow;
mod front_ends;
mod lower;
mod positive;
mod spectrum;
#[cfg(test)]
mod tests;
mod tick;
mod upper;

use self::error_system::{BlockForm, ErrorSystem};
use self::front_ends::FrontEnds;
use self::tick::Tick;
use crate::analog::AnalogError;
use crate::bank::{Bank, Proof, SynthesisFilters, Tone};
use crate::linalg::Mat;
use crate::spec::Method;

/// Relative excess of a stated number over a proven one that counts as the same: the claim is six digits.
pub const CLAIM_TOLERANCE: f64 = 1e-6;
/// Rounding of a computed norm against a proven one.
const ROUNDED: f64 = 1e-8;
/// Most states of an error system that is proven: its matrices are dense.
pub const MAX_STATES: usize = 2048;
/// Most analog states of all distinct front ends together.
pub const MAX_ANALOG_STATES: usize = 128;
/// Most samples of a tick times the cube of the analog states: a minute's work.
const MAX_WORK: usize = 100_000_000;

/// What was proven of a bank; all numbers for h = 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Verified {
    /// No bank of this method and size has less: an FIR bank of this length, or else any bank.
    pub lower: f64,
    /// ||K|| of this bank is at most this.
    pub upper: f64,
    /// ||K|| of this bank is at least this.
    pub attained: f64,
    /// No bank at all has less.
    pub noncausal: f64,
    /// `gamma.lower` in the file is more than was proven: a statement of the designer's.
    pub lower_only_stated: bool,
    /// `gamma.noncausal` in the file is more than was proven.
    pub noncausal_only_stated: bool,
    /// Order of P.
    pub states: usize,
}

/// Why a bank is not what its file says, or cannot be judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VerifyError {
    /// Nothing is known about the front ends.
    #[error(
        "spec: it is null, so the front ends are unknown and nothing can be proven; design the bank with its spec"
    )]
    NoSpec,
    /// A filter of the spec is no front end.
    #[error("{place}: {source}")]
    FrontEnd {
        /// Where it stands in the file.
        place: String,
        /// What is wrong with it.
        source: AnalogError,
    },
    /// Too large a system.
    #[error(
        "the error system has {states} states, at most {MAX_STATES} are proven; bring latency and delays closer together, or \
         use fewer taps"
    )]
    TooLarge {
        /// Its states.
        states: usize,
    },
    /// Too many different filters.
    #[error(
        "spec: the distinct filters have {states} states together and a tick {samples} samples; at most {MAX_ANALOG_STATES} states, \
         fewer with many samples, are proven; give channels that have the same filter the same text"
    )]
    TooManyFilters {
        /// States of all distinct filters.
        states: usize,
        /// M + N.
        samples: usize,
    },
    /// The file carries no certificate.
    #[error("proof.upper: there is none; find one first")]
    NoCertificate,
    /// The certificate belongs to another system.
    #[error(
        "proof.upper.factor: it has {found} rows, but the error system of this bank has {states} states: the file was altered"
    )]
    CertificateSize {
        /// Rows given.
        found: usize,
        /// Rows needed.
        states: usize,
    },
    /// The certificate does not prove what it says.
    #[error(
        "proof.upper: the certificate does not prove that these coefficients keep gamma = {gamma}: a coefficient, the spec, \
         the gamma or the certificate was altered; design the bank anew"
    )]
    NotProven {
        /// The certificate's gamma.
        gamma: f64,
    },
    /// A stated number is wrong.
    #[error(
        "{place}: it says {stated}, but {relation} {proven} is proven; the file was altered, design the bank anew"
    )]
    Disproved {
        /// Where it stands in the file.
        place: &'static str,
        /// What the file says.
        stated: f64,
        /// How the proven number relates to the true one.
        relation: &'static str,
        /// What was proven.
        proven: f64,
    },
    /// Tones that prove nothing.
    #[error("{place}: these tones prove nothing; the file was altered, design the bank anew")]
    Void {
        /// Where they stand in the file.
        place: &'static str,
    },
}

/// A bank with its error system enclosed: built once, judged with any witnesses.
#[derive(Debug, Clone)]
pub struct Subject<'a> {
    bank: &'a Bank,
    tick: Tick,
    error: ErrorSystem,
    distinct: Vec<usize>,
}

/// Midpoints of the enclosed error system, for whoever looks for a certificate: xi+ = a xi + b w, e = c xi + d w with w white.
#[derive(Debug, Clone)]
pub struct Midpoint {
    /// n x n.
    pub a: Mat,
    /// n x m.
    pub b: Mat,
    /// M x n.
    pub c: Mat,
    /// M x m.
    pub d: Mat,
}

impl<'a> Subject<'a> {
    /// Encloses the error system of `bank`.
    ///
    /// # Errors
    /// [`VerifyError::NoSpec`], [`VerifyError::FrontEnd`], [`VerifyError::TooLarge`].
    pub fn new(bank: &'a Bank) -> Result<Self, VerifyError> {
        let (front_ends, taps) = FrontEnds::new(bank)?;
        let states = front_ends.order();
        if states > MAX_ANALOG_STATES || taps.len() * states.pow(3) > MAX_WORK {
            return Err(VerifyError::TooManyFilters { states, samples: taps.len() });
        }
        let tick = Tick::new(&front_ends, &taps, bank.ratio);
        let states = error_system::order(&tick, &bank.filters, bank.ratio);
        if states > MAX_STATES {
            return Err(VerifyError::TooLarge { states });
        }
        let filters = BlockForm::new(&bank.filters, bank.ratio);
        let same = |i: usize, j: usize| taps[i].filter == taps[j].filter && taps[i].time == taps[j].time;
        let (m, count) = (bank.ratio, bank.channel_count());
        let distinct = (0..count).filter(|&i| (0..i).all(|j| !same(m + i, m + j))).collect();
        Ok(Self { bank, error: ErrorSystem::new(&tick, &filters), tick, distinct })
    }

    /// Number of states of the error system, the order of P.
    pub fn states(&self) -> usize {
        self.error.order()
    }

    /// Root of the energy that the input of one tick brings into the wanted samples: the size against which a gamma is small.
    pub fn scale(&self) -> f64 {
        let n = self.tick.order();
        (n..n + self.bank.ratio).map(|i| self.tick.gram[(i, i)].nearest()).sum::<f64>().sqrt()
    }

    /// Whether `factor` proves ||K|| <= `gamma`.
    pub fn keeps(&self, factor: &[Vec<f64>], gamma: f64) -> bool {
        upper::proves(&self.error, factor, gamma)
    }

    /// A proven lower bound of ||K||, from the gain at a tone.
    pub fn attains(&self, tone: &Tone) -> Option<f64> {
        lower::gain(&self.tick, &self.bank.filters, self.bank.ratio, tone)
    }

    /// A proven lower bound for any bank on these front ends, from a tone.
    pub fn unexplained(&self, tone: &Tone) -> Option<f64> {
        lower::unexplained(&self.tick, self.bank.ratio, &self.distinct, tone)
    }

    /// A proven lower bound for FIR banks as long as this one, from tones.
    pub fn out_of_reach(&self, tones: &[Tone]) -> Option<f64> {
        match &self.bank.filters {
            SynthesisFilters::Fir(taps) => {
                lower::of_length(&self.tick, self.bank.ratio, &self.distinct, taps[0].len(), tones)
            }
            SynthesisFilters::StateSpace(_) => None,
        }
    }

    /// The error system in double precision; `None` if its inputs have no root, which does not happen.
    pub fn midpoint(&self) -> Option<Midpoint> {
        let root = positive::root(&self.error.gram)?;
        let (n, m) = (self.error.order(), self.error.outputs);
        let system = ball::nearest(&self.error.system);
        let inputs = ball::nearest(&ball::product(&self.error.inputs, &root));
        Some(Midpoint {
            a: system.rows(0, n).into_owned(),
            b: inputs.rows(0, n).into_owned(),
            c: system.rows(n, m).into_owned(),
            d: inputs.rows(n, m).into_owned(),
        })
    }

    /// Gram matrix of the M wanted and N measured samples at a tone's point of the unit circle, in double precision.
    pub fn gram_at(&self, half: [f64; 2]) -> crate::linalg::CMat {
        let gram = spectrum::gram(&self.tick, &spectrum::Complex::unit(half));
        gram.re.zip_map(&gram.im, |re, im| crate::linalg::Complex::new(re.nearest(), im.nearest()))
    }

    /// Judges the bank's gammas with `proof`.
    ///
    /// # Errors
    /// [`VerifyError`] naming what does not fit.
    pub fn judge(&self, proof: &Proof) -> Result<Verified, VerifyError> {
        let (upper, attained) = self.judge_upper(proof)?;
        let noncausal = match &proof.noncausal {
            Some(tone) => self.unexplained(tone).ok_or(VerifyError::Void { place: "proof.noncausal" })?,
            None => 0.0,
        };
        let tones = match proof.lower.as_slice() {
            [] => 0.0,
            tones => self.out_of_reach(tones).ok_or(VerifyError::Void { place: "proof.lower" })?,
        };
        let lower = noncausal.max(tones);
        self.judge_lower(proof, lower, noncausal, upper)?;
        let more = |stated: Option<f64>, proven: f64| stated.is_some_and(|x| x > beyond(proven, upper));
        let gamma = &self.bank.gamma;
        Ok(Verified {
            lower,
            upper,
            attained,
            noncausal,
            lower_only_stated: more(gamma.lower, lower),
            noncausal_only_stated: more(gamma.noncausal, noncausal),
            states: self.states(),
        })
    }

    fn judge_upper(&self, proof: &Proof) -> Result<(f64, f64), VerifyError> {
        let certificate = proof.upper.as_ref().ok_or(VerifyError::NoCertificate)?;
        let (found, states, gamma) = (certificate.factor.len(), self.states(), certificate.gamma);
        if found != states {
            return Err(VerifyError::CertificateSize { found, states });
        }
        let attained =
            self.attains(&certificate.peak).ok_or(VerifyError::Void { place: "proof.upper.peak" })?;
        if let Some(stated) = self.bank.gamma.norm {
            let place = "gamma.norm";
            if stated < attained * (1.0 - ROUNDED) {
                return Err(VerifyError::Disproved {
                    place,
                    stated,
                    relation: "a norm of at least",
                    proven: attained,
                });
            }
            if stated > gamma * (1.0 + ROUNDED) {
                return Err(VerifyError::Disproved {
                    place,
                    stated,
                    relation: "a norm of at most",
                    proven: gamma,
                });
            }
        }
        if let Some(stated) = self.bank.gamma.upper.filter(|&x| x < attained) {
            let (place, relation) = ("gamma.upper", "a norm of at least");
            return Err(VerifyError::Disproved { place, stated, relation, proven: attained });
        }
        if self.keeps(&certificate.factor, gamma) {
            return Ok((gamma, attained));
        }
        Err(VerifyError::NotProven { gamma })
    }

    fn judge_lower(&self, proof: &Proof, lower: f64, noncausal: f64, upper: f64) -> Result<(), VerifyError> {
        let gamma = &self.bank.gamma;
        let most = gamma.upper.unwrap_or(upper);
        let fits = |place, stated: Option<f64>, witness: bool, proven: f64| {
            let Some(stated) = stated else { return Ok(()) };
            if stated > most {
                let relation = "for this bank a norm of";
                return Err(VerifyError::Disproved { place, stated, relation, proven: most });
            }
            if witness && stated > beyond(proven, upper) {
                let relation = "by the tones in the file only";
                return Err(VerifyError::Disproved { place, stated, relation, proven });
            }
            Ok(())
        };
        let fir = self.bank.method == Method::Fir;
        fits("gamma.lower", gamma.lower, fir && !proof.lower.is_empty(), lower)?;
        fits("gamma.noncausal", gamma.noncausal, proof.noncausal.is_some(), noncausal)?;
        if let Some(stated) = gamma.noncausal.filter(|&x| x < noncausal * (1.0 - ROUNDED)) {
            let (place, relation) = ("gamma.noncausal", "a bound of at least");
            return Err(VerifyError::Disproved { place, stated, relation, proven: noncausal });
        }
        Ok(())
    }
}

/// The largest statement that a proven bound still supports.
fn beyond(proven: f64, upper: f64) -> f64 {
    proven * (1.0 + CLAIM_TOLERANCE) + 1e-12 * upper
}

/// Proves the gammas of a bank with the witnesses that it carries.
///
/// # Errors
/// [`VerifyError`] naming what does not fit; [`VerifyError::NoCertificate`] for a bank made elsewhere, which has none.
pub fn verify(bank: &Bank) -> Result<Verified, VerifyError> {
    let none = Proof::default();
    Subject::new(bank)?.judge(bank.proof.as_ref().unwrap_or(&none))
}
