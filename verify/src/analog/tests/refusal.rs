//! Filters that are refused, and what the message says.

use proptest::prelude::*;

use super::*;

fn refused(filter: &FilterSpec, h: f64) -> AnalogError {
    realise(filter, h).unwrap_err()
}

#[test]
fn what_cannot_be_sampled_is_refused_with_reason_and_remedy() {
    assert_eq!(refused(&tf(&[1.0], &[1.0, 1.0]), 0.0), AnalogError::FastPeriod { value: Seconds(0.0) });
    assert!(matches!(refused(&tf(&[1.0], &[1.0, 1.0]), f64::NAN), AnalogError::FastPeriod { .. }));

    let unstable = refused(&zpk(&[], &[[1e3, 0.0]], 1.0), 1e-3);
    assert_eq!(unstable, AnalogError::Unstable { re: 1e3, im: 0.0 });
    assert!(unstable.to_string().contains("left half plane"), "{unstable}");
    // An integrator, an undamped resonator, one as good as undamped, and a negative coefficient.
    for filter in [
        tf(&[1.0], &[1.0, 0.0]),
        tf(&[1.0], &[1.0, 0.0, 1.0]),
        zpk(&[], &[[-1e-10, 1.0], [-1e-10, -1.0]], 1.0),
        tf(&[1.0], &[1.0, 2.0, -3.0, 1.0]),
    ] {
        assert!(matches!(refused(&filter, 1.0), AnalogError::Unstable { .. }), "{filter:?}");
    }
    let growing = FilterSpec::StateSpace {
        a: vec![vec![0.1, 1.0], vec![-1.0, 0.1]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![1.0, 0.0]],
    };
    assert!(matches!(refused(&growing, 1.0), AnalogError::Unstable { .. }));

    let alone = refused(&zpk(&[], &[[-1.0, 2.0], [-1.0, -2.1]], 1.0), 1.0);
    assert_eq!(alone, AnalogError::NotConjugate { what: "pole", re: -1.0, im: 2.0 });
    assert!(matches!(
        refused(&zpk(&[[0.0, 1.0]], &[[-1.0, 0.0]; 3], 1.0), 1.0),
        AnalogError::NotConjugate { what: "zero", .. }
    ));

    // Hertz taken for a period: the pole is 1e12 rad a "period".
    assert!(matches!(refused(&family(Family::Rc, 1, 2e4), 96e3 * 1e3), AnalogError::PoleOutOfRange { .. }));
    assert!(matches!(refused(&tf(&[1e-12], &[1.0, 1e-12]), 1.0), AnalogError::PoleOutOfRange { .. }));

    let unread = FilterSpec::StateSpace {
        a: vec![vec![-1.0, 0.0], vec![0.0, -2.0]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![0.0, 1.0]],
    };
    assert_eq!(refused(&unread, 1.0), AnalogError::NoTransmission);
    assert!(matches!(
        refused(&zpk(&[], &[[-1.0, 0.0]], 1e308), 1e300),
        AnalogError::GainOutOfRange { .. } | AnalogError::PoleOutOfRange { .. }
    ));
}

/// Squares of such gains once ended in a decomposition that did not converge.
#[test]
fn gains_whose_squares_are_no_doubles_are_refused_by_their_key() {
    for gain in [1e308, 1e200, 1e61, 1e-61, 1e-200, 1e-300] {
        for filter in [tf(&[gain], &[1.0, 1.0]), zpk(&[], &[[-1.0, 0.0]], gain)] {
            let error = refused(&filter, 1.0);
            assert!(matches!(error, AnalogError::GainOutOfRange { .. }), "{gain:e}: {error}");
            assert!(error.to_string().contains("check num, gain or c"), "{error}");
        }
    }
    for gain in [1e59, 1e-59] {
        assert!(realise(&tf(&[gain], &[1.0, 1.0]), 1.0).is_ok(), "{gain:e}");
    }
}

#[test]
fn an_edge_sharper_than_a_double_is_refused_by_its_order() {
    let filter = FilterSpec::Family {
        family: Family::Elliptic,
        order: Some(17),
        passband: Passband::LowPass { cutoff: Hertz(1.0) },
        ripple_db: Some(11.0),
        attenuation_db: Some(11.05),
    };
    let text = refused(&filter, 1.0).to_string();
    assert!(text.contains("order = 17") && text.contains("lower the order"), "{text}");
}

#[test]
fn direct_terms_are_refused_with_the_way_out() {
    for (kind, order) in [(Family::Chebyshev2, 4), (Family::Elliptic, 6)] {
        let error = refused(&family(kind, order, 1.0), 1e-3);
        assert!(matches!(error, AnalogError::Spec(_)));
        let text = error.to_string();
        for part in [
            "not strictly proper",
            "even-order",
            "direct term",
            "add the pole of the sampling switch",
            "cascade",
        ] {
            assert!(text.contains(part), "{text}");
        }
        let with_switch =
            FilterSpec::Cascade { cascade: vec![family(kind, order, 1.0), family(Family::Rc, 1, 50.0)] };
        assert_eq!(realise(&with_switch, 1e-1).unwrap().order(), order + 1);
    }
    assert!(matches!(refused(&tf(&[1.0, 2.0], &[1.0, 3.0]), 1.0), AnalogError::Spec(_)));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_coefficients_make_a_filter_or_a_message(
        num in prop::collection::vec(-1e3..1e3f64, 1..4),
        den in prop::collection::vec(prop_oneof![Just(0.0), -1e-9..1e9f64, 0.0..10.0f64], 1..9),
        h in prop_oneof![Just(1.0), 1e-12..1e3f64],
    ) {
        match realise(&tf(&num, &den), h) {
            Ok(phi) => prop_assert!(response(&phi, 1.0).norm().is_finite()),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
