//! Tests of the enclosed error system against the designer's lifted plant, which it does not use, and of
//! proofs that must be refused.

use super::spectrum;
use super::*;
use crate::arithmetic::{ComplexBall, DoubleDouble};
use crate::bank::{Certificate, Gamma, StateMatrices, SynthesisFilters};
use crate::design::{LiftedPlant, Problem, filters};
use crate::linalg::{CMat, hermitian_eigenvalues};
use crate::lti::FrequencyResponse;
use crate::spec::{ChannelSpec, DesignSpec, Family, FilterSpec, Method, Passband, Spec};
use crate::units::{Hertz, Seconds};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

fn family(family: Family, order: usize, omega: f64) -> FilterSpec {
    FilterSpec::Family {
        family,
        order: Some(order),
        passband: Passband::LowPass { cutoff: Hertz(omega / TAU) },
        ripple_db: family.has_ripple().then_some(0.5),
        attenuation_db: family.has_attenuation().then_some(55.0),
    }
}

fn thesis_filter() -> FilterSpec {
    FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] }
}

/// A bank with arbitrary coefficients; the comparisons hold for good and bad banks.
fn bank(
    target: FilterSpec,
    filters: Vec<FilterSpec>,
    delays: &[f64],
    ratio: usize,
    latency: usize,
    taps: usize,
) -> Bank {
    let made_up = |i: usize| (0..taps).map(|n| ((7 * n + 3 * i) % 11) as f64 / 11.0 - 0.4).collect();
    let channel = |(filter, &delay)| ChannelSpec::new(Seconds(delay), filter);
    let spec = Spec {
        name: String::new(),
        fast_period: Seconds(1.0),
        ratio,
        latency: Some(latency),
        full_scale: None,
        fit: Vec::new(),
        target,
        channels: filters.into_iter().zip(delays).map(channel).collect(),
        signal: None,
        uncertainty: None,
        design: DesignSpec::new(Method::Fir, Some(taps)),
    };
    Bank {
        spec: Some(spec),
        fast_period: Seconds(1.0),
        ratio,
        latency,
        method: Method::Fir,
        samples: vec![1; delays.len()],
        delays: delays.iter().copied().map(Seconds).collect(),
        gains: vec![1.0; delays.len()],
        offsets: vec![0.0; delays.len()],
        nonlinearity: vec![crate::runtime::Nonlinearity::default(); delays.len()],
        filters: SynthesisFilters::Fir((0..delays.len()).map(made_up).collect()),
        gamma: Gamma::default(),
        proof: None,
        fixed_point: None,
    }
}

fn alike(filter: &FilterSpec, delays: &[f64], ratio: usize, latency: usize, taps: usize) -> Bank {
    bank(filter.clone(), vec![filter.clone(); delays.len()], delays, ratio, latency, taps)
}

fn cases() -> Vec<(&'static str, Bank)> {
    let thesis = thesis_filter();
    let eight = [0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    let rc = |omega| family(Family::Rc, 1, omega);
    let stiff = FilterSpec::Cascade { cascade: vec![rc(1e6), rc(0.5)] };
    let mixed = vec![thesis.clone(), rc(1.0), family(Family::Elliptic, 5, 2.0)];
    vec![
        ("thesis", alike(&thesis, &[1.2, 0.6], 2, 10, 22)),
        ("whole periods late", alike(&thesis, &[0.2, 9.1], 2, 3, 7)),
        ("exactly whole periods", alike(&thesis, &[0.0, 4.0, 8.0], 4, 9, 9)),
        ("samples as wanted", alike(&thesis, &[0.0, 1.0], 2, 10, 22)),
        ("equal delays", alike(&thesis, &[0.6, 0.6], 2, 4, 8)),
        ("delays almost equal", alike(&thesis, &[0.6, 0.6 + 1e-9], 2, 4, 8)),
        ("a delay a hair from a period", alike(&thesis, &[2.0 - 1e-7, 1.0], 2, 5, 8)),
        ("one channel, no ratio", alike(&rc(2.0), &[0.25], 1, 1, 5)),
        ("stiff", alike(&stiff, &[0.3, 1.7], 2, 6, 9)),
        ("stiffer", alike(&rc(1e8), &[0.3, 1.7], 2, 6, 9)),
        ("slow", alike(&rc(1e-4), &[0.3, 1.7], 2, 6, 9)),
        ("mixed", bank(rc(0.7), mixed, &[0.25, 1.1, 2.6], 3, 6, 11)),
        ("Butterworth 6, eight channels", alike(&family(Family::Butterworth, 6, 1.8), &eight, 8, 32, 48)),
        ("low Butterworth 6", alike(&family(Family::Butterworth, 6, 0.4), &eight, 8, 20, 24)),
        ("elliptic 7", alike(&family(Family::Elliptic, 7, 2.4), &[0.31, 1.22, 2.45, 2.9], 4, 10, 32)),
        ("Bessel 8", alike(&family(Family::Bessel, 8, 0.9), &[0.1, 1.9], 3, 2, 6)),
        ("few channels", alike(&thesis, &[0.2, 1.9], 3, 6, 18)),
    ]
}

/// K(z) K(z)* by the designer's route.
fn designers(bank: &Bank, omega: f64) -> CMat {
    let problem = Problem::new(bank.spec.as_ref().unwrap(), bank.latency).unwrap();
    let filters = filters::lifted(&bank.filters, bank.ratio);
    let error = LiftedPlant::new(&problem).error_system(&filters);
    let k = FrequencyResponse::new(&error).at_frequency(omega);
    &k * k.adjoint()
}

/// The same from the enclosed period and the filters' response.
fn enclosed(error: &EnclosedErrorSystem<'_>, half: [f64; 2]) -> DMatrix<ComplexBall<DoubleDouble>> {
    let (bank, z) = (error.bank, spectrum::unit(half));
    let through = spectrum::filter_response(&bank.filters, bank.ratio, z);
    let combine = ball::above(&ball::identity(bank.ratio), &spectrum::adjoint(&through).map(|x| -x));
    let gram = spectrum::gram(&error.period, z);
    ball::product(&ball::product(&spectrum::adjoint(&combine), &gram), &combine)
}

#[test]
fn the_error_system_is_the_designers() {
    for (name, bank) in cases() {
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        for omega in [0.0, 1e-3, 0.4, 1.3, 2.9, std::f64::consts::PI] {
            let (s, c) = (0.5 * omega).sin_cos();
            let ours = enclosed(&error, [c, s]);
            let theirs = designers(&bank, omega);
            let size = theirs.norm();
            let gap =
                ours.zip_map(&theirs, |x, z| (x.re.nearest() - z.re).hypot(x.im.nearest() - z.im) / size);
            // Of K K*: half as much, 1e-10, of K.
            assert!(gap.max() < 2e-10, "{name} at {omega}: {:e} of {size:e}", gap.max());
            let radius = ours.iter().map(|x| x.re.radius().max(x.im.radius())).fold(0.0, f64::max);
            assert!(radius < 1e-13 * size, "{name} at {omega}: radius {radius:e} of {size:e}");
        }
    }
}

/// The state-space form of the enclosure is the same system as its samples and filters.
#[test]
fn the_state_equations_have_the_same_response() {
    for (name, bank) in cases() {
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        let Midpoint { a, b, c, d } = error.midpoint().unwrap();
        let system = crate::lti::StateSpace::new(a, b, c, d);
        for omega in [0.1, 1.3, 3.0] {
            let k = FrequencyResponse::new(&system).at_frequency(omega);
            let theirs = designers(&bank, omega);
            let gap = (&k * k.adjoint() - &theirs).norm() / theirs.norm();
            assert!(gap < 1e-9, "{name} at {omega}: {gap:e}");
        }
    }
}

#[test]
fn gram_matrices_are_positive_and_tight() {
    for (name, bank) in cases() {
        let gram = EnclosedErrorSystem::new(&bank).unwrap().period.gram;
        let eigenvalues = hermitian_eigenvalues(&ball::nearest(&gram)).unwrap();
        let largest = eigenvalues[eigenvalues.len() - 1];
        assert!(eigenvalues[0] > -1e-14 * largest, "{name}: {eigenvalues:?}");
        assert!(ball::radius_sum(&gram) < 1e-18 * largest, "{name}");
    }
}

fn designed(method: Method, latency: usize, taps: usize) -> (Bank, Verified) {
    let mut spec = alike(&thesis_filter(), &[1.2, 0.6], 2, latency, 1).spec.unwrap();
    spec.design = DesignSpec::new(method, method.has_taps().then_some(taps));
    let design = crate::design::design(&spec, &crate::design::DesignOptions::default()).unwrap();
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
        let norm = crate::design::analyze(&bank, &[]).unwrap().gamma;
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
    let design = crate::design::design(&spec, &crate::design::DesignOptions::default()).unwrap();
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
