//! Tests of the enclosures themselves; those against the designer's lifted plant are beside the designer.

use super::spectrum;
use super::*;
use crate::arithmetic::{ComplexBall, DoubleDouble};
use front_ends::cases;
use hybank_linalg::hermitian_eigenvalues;
use nalgebra::DMatrix;

#[path = "../../../tests/support/front_ends.rs"]
mod front_ends;

/// K(z) K(z)* from the enclosed period and the filters' response.
fn enclosed(error: &EnclosedErrorSystem<'_>, half: [f64; 2]) -> DMatrix<ComplexBall<DoubleDouble>> {
    let (bank, z) = (error.bank, spectrum::unit(half));
    let through = spectrum::filter_response(&bank.filters, bank.ratio, z);
    let combine = ball::above(&ball::identity(bank.ratio), &spectrum::adjoint(&through).map(|x| -x));
    ball::product(&spectrum::adjoint(&combine), &spectrum::gram_times(&error.period, z, &combine))
}

#[test]
fn the_error_system_is_tight() {
    for (name, bank) in cases() {
        let error = EnclosedErrorSystem::new(&bank).unwrap();
        for omega in [0.0, 1e-3, 0.4, 1.3, 2.9, std::f64::consts::PI] {
            let (s, c) = (0.5 * omega).sin_cos();
            let gram = enclosed(&error, [c, s]);
            let size = gram.map(|x| x.re.nearest().hypot(x.im.nearest())).norm();
            let radius = gram.iter().map(|x| x.re.radius().max(x.im.radius())).fold(0.0, f64::max);
            assert!(radius < 1e-13 * size, "{name} at {omega}: radius {radius:e} of {size:e}");
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
