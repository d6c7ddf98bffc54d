//! Tests of the enclosed error system against the designer's lifted plant, which it does not use, and of
//! proofs that must be refused.

use super::*;
use crate::design::{DesignOptions, LiftedPlant, Problem, analyze, design, filters};
use crate::lti::{FrequencyResponse, StateSpace};
use crate::tests::front_ends::{alike, bank, cases, family, thesis_filter};
use hybank_core::bank::{Certificate, Gamma, StateMatrices, SynthesisFilters};
use hybank_core::spec::{DesignSpec, Family, Method};
use hybank_linalg::CMat;
use hybank_verify::verify::{Midpoint, Verified, VerifyError, verify};
use std::f64::consts::TAU;

/// K(z) K(z)* by the designer's route.
fn designers(bank: &Bank, omega: f64) -> CMat {
    let problem = Problem::new(bank.spec.as_ref().unwrap(), bank.latency).unwrap();
    let filters = filters::lifted(&bank.filters, bank.ratio);
    let error = LiftedPlant::new(&problem).error_system(&filters);
    let k = FrequencyResponse::new(&error).at_frequency(omega);
    &k * k.adjoint()
}

#[test]
fn the_error_system_is_the_designers() {
    for (name, bank) in cases() {
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        for omega in [0.0, 1e-3, 0.4, 1.3, 2.9, std::f64::consts::PI] {
            let (s, c) = (0.5 * omega).sin_cos();
            let ours = error.error_gram([c, s]);
            let theirs = designers(&bank, omega);
            let size = theirs.norm();
            let gap = ours.zip_map(&theirs, |x, z| (x - z).norm() / size);
            // Of K K*: half as much, 1e-10, of K.
            assert!(gap.max() < 2e-10, "{name} at {omega}: {:e} of {size:e}", gap.max());
        }
    }
}

/// The state-space form of the enclosure is the same system as its samples and filters.
#[test]
fn the_state_equations_have_the_same_response() {
    for (name, bank) in cases() {
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        let Midpoint { a, b, c, d } = error.midpoint().unwrap();
        let system = StateSpace::new(a, b, c, d);
        for omega in [0.1, 1.3, 3.0] {
            let k = FrequencyResponse::new(&system).at_frequency(omega);
            let theirs = designers(&bank, omega);
            let gap = (&k * k.adjoint() - &theirs).norm() / theirs.norm();
            assert!(gap < 1e-9, "{name} at {omega}: {gap:e}");
        }
    }
}

fn designed(method: Method, latency: usize, taps: usize) -> (Bank, Verified) {
    let mut spec = alike(&thesis_filter(), &[1.2, 0.6], 2, latency, 1).spec.unwrap();
    spec.design = DesignSpec::new(method, method.has_taps().then_some(taps));
    let design = design(&spec, &DesignOptions::default()).unwrap();
    (design.bank, design.proof.unwrap())
}

#[test]
fn the_interval_of_the_thesis_example_is_known() {
    for method in [Method::Fir, Method::Iir] {
        let (bank, proven) = designed(method, 10, 22);
        assert!(proven.attained <= 0.0399320395 && proven.upper >= 0.0399320394, "{proven:?}");
        assert!((proven.upper - proven.attained) / proven.upper < 1e-7, "{proven:?}");
        assert_eq!(verify(&bank).unwrap(), proven);
    }
}

#[test]
fn a_norm_that_is_stated_too_low_or_too_high_is_refused() {
    for method in [Method::Fir, Method::Iir] {
        let (bank, proven) = designed(method, 10, 22);
        let norm = analyze(&bank, &[]).unwrap().gamma;
        assert!(proven.attained <= norm * (1.0 + 1e-9) && norm <= proven.upper);
        for factor in [1.0 - 1e-6, 1.0 + 1e-6] {
            let gamma = Gamma { norm: Some(norm * factor), ..Gamma::default() };
            let error = verify(&Bank { gamma, ..bank.clone() }).unwrap_err();
            assert!(matches!(error, VerifyError::Disproved { place: "gamma.norm", .. }), "{error}");
        }
        // A certificate proves its gamma and no lower one.
        let certificate = bank.proof.as_ref().unwrap().upper.clone();
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        assert!(error.certifies(&certificate));
        for below in [1e-6, 1e-12] {
            assert!(!error.certifies(&Certificate { gamma: norm * (1.0 - below), ..certificate.clone() }));
        }
    }
}

/// Whatever P is tried: below the norm nothing may pass. Scaled, shifted and true certificates of other
/// gammas.
#[test]
fn no_certificate_passes_below_the_norm() {
    let (bank, proven) = designed(Method::Fir, 10, 22);
    let error = EnclosedErrorSystem::new(&bank).unwrap();
    let certificate = &bank.proof.as_ref().unwrap().upper;
    let keeps =
        |factor: Vec<Vec<f64>>, gamma| error.certifies(&Certificate { factor, gamma, ..certificate.clone() });
    let factor = &certificate.factor;
    for scale in [0.5, 0.999999, 1.0, 1.000001, 1.5, 1e3] {
        let scaled: Vec<Vec<f64>> =
            factor.iter().map(|row| row.iter().map(|x| x * scale).collect()).collect();
        assert!(!keeps(scaled.clone(), proven.attained), "{scale}");
        assert!(!keeps(scaled, 0.9 * proven.attained), "{scale}");
    }
    let zero: Vec<Vec<f64>> = factor.iter().map(|row| vec![0.0; row.len()]).collect();
    assert!(!keeps(zero, 1e9) && !keeps(factor[1..].to_vec(), 1e9));
}

/// After a steep filter doubles are too coarse for the certificate: what they leave is in the correction.
#[test]
fn a_corrected_certificate_passes_and_proves_no_less_than_the_norm() {
    let steep = family(Family::Butterworth, 8, 0.1 * TAU);
    let mut spec = bank(steep.clone(), vec![steep], &[0.6], 2, 1, 1).spec.unwrap();
    spec.design = DesignSpec::new(Method::Iir, None);
    let design = design(&spec, &DesignOptions::default()).unwrap();
    let proven = design.proof.unwrap();
    assert!(proven.upper - proven.attained <= 1e-4 * proven.upper, "{proven:?}");
    let certificate = design.bank.proof.as_ref().unwrap().upper.clone();
    assert_eq!(certificate.correction.len(), certificate.factor.len());
    let error = EnclosedErrorSystem::new(&design.bank).unwrap();
    assert!(error.certifies(&certificate));
    assert!(!error.certifies(&Certificate { gamma: proven.attained, ..certificate.clone() }));
    assert!(!error.certifies(&Certificate { correction: Vec::new(), ..certificate }));
}

#[test]
fn an_unstable_bank_has_no_certificate() {
    let (bank, _) = designed(Method::Iir, 10, 22);
    let SynthesisFilters::StateSpace(block) = &bank.filters else { panic!("states") };
    let n = block.a.len();
    let grown = (0..n).map(|i| (0..n).map(|j| if i == j { 1.5 } else { block.a[i][j] }).collect()).collect();
    let unstable = StateMatrices { a: grown, ..block.clone() };
    let bank = Bank { filters: SynthesisFilters::StateSpace(unstable), gamma: Gamma::default(), ..bank };
    assert!(matches!(verify(&bank), Err(VerifyError::NotProven { .. })));
    assert!(crate::design::prove(&bank).is_err());
}

#[test]
fn statements_that_contradict_the_proof_are_refused() {
    let (bank, proven) = designed(Method::Fir, 1, 12);
    let with = |gamma: Gamma| verify(&Bank { gamma, ..bank.clone() });
    let good = bank.gamma;
    assert_eq!(with(good), Ok(proven));
    for upper in [0.9 * proven.attained, proven.upper * (1.0 - 1e-12), proven.upper * (1.0 + 1e-7)] {
        let error = with(Gamma { upper: Some(upper), ..good }).unwrap_err();
        assert!(matches!(&error, VerifyError::Disproved { place: "gamma.upper", .. }), "{error}");
    }
    let none = Bank { spec: None, proof: None, ..bank.clone() };
    assert_eq!(verify(&none), Err(VerifyError::NoSpec));
    let bare = Bank { proof: None, ..bank };
    assert_eq!(verify(&bare), Err(VerifyError::NoCertificate));
}
