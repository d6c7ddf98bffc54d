//! FIR designs by two methods that share no numerics: the exchange of frequencies (`sampled`) and the
//! bounded-real LMI of thesis 5.4 (`kyp`).

use crate::golden::{g6, g8, g9, g10, g11, g12, g12c, g12d};
use crate::support::specs::{alike, butterworth, tf, thesis, with_taps};
use hybank::bank::Gamma;
use hybank::design::{DesignError, Options, design};
use hybank::spec::{Method, Solver, Spec};
use std::fs;
use std::path::Path;

/// Largest relative difference of the two gammas: `sampled` stops within 5e-7 of the optimum and grants 4e-7
/// to the secondary objective, `kyp` stops within 1e-7 of the optimum.
const AGREEMENT: f64 = 2e-6;
/// Errors below this fraction of the target are zero.
const ZERO: f64 = 1e-9;

fn gamma(spec: &Spec, solver: Solver) -> Gamma {
    let mut spec = spec.clone();
    spec.design.solver = Some(solver);
    design(&spec, &Options::default()).unwrap_or_else(|error| panic!("{}: {error}", spec.name)).bank.gamma
}

/// The two gammas agree, and neither method's lower bound exceeds the other's gamma.
fn check(name: &str, spec: &Spec) {
    let [sampled, kyp] = [Solver::Sampled, Solver::Kyp].map(|solver| gamma(spec, solver));
    let (a, b) = (sampled.norm.unwrap(), kyp.norm.unwrap());
    assert!((a - b).abs() <= AGREEMENT * a + ZERO, "{name}: sampled {sampled:?}, kyp {kyp:?}");
    assert!(sampled.lower.unwrap() <= b * (1.0 + 1e-9) + ZERO, "{name}: sampled {sampled:?}, kyp {kyp:?}");
    assert!(kyp.lower.unwrap() <= a * (1.0 + 1e-9) + ZERO, "{name}: sampled {sampled:?}, kyp {kyp:?}");
}

#[test]
fn the_golden_fir_plants() {
    for taps in [1, 2, 10, 22] {
        check("G2, G3", &with_taps(thesis(10, &[1.2, 0.6]), taps));
    }
    check("G4b", &with_taps(thesis(1, &[1.2, 0.6]), 12));
    check("G5", &with_taps(thesis(10, &[0.0, 1.0]), 22));
    check("G6", &g6(1e-6, Method::Fir));
    for delays in [[0.1, 0.2], [0.0, 0.01], [1.9, 0.1], [0.5, 1.5]] {
        check("G7", &with_taps(thesis(10, &delays), 22));
    }
    check("G8", &with_taps(g8(), 12));
    check("G9", &with_taps(g9(), 18));
    check("G10", &with_taps(g10(), 24));
    check("G11", &with_taps(g11(), 18));
    check("G12", &with_taps(g12(), 16));
    check("G12d", &g12d());
}

#[test]
fn a_bank_with_256_unknowns() {
    check("G12c", &g12c());
}

/// Unknowns up to which `kyp` is quick; the larger specs are tried where `HYBANK_SLOW` is set.
const QUICK: usize = 64;

#[test]
fn the_fir_specs_in_filters() {
    let limit = if trials::is_slow("the bounded-real LMI of long banks") { usize::MAX } else { QUICK };
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("filters")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let mut spec = Spec::from_toml(&fs::read_to_string(&path).unwrap(), "spec.toml").unwrap();
        let unknowns = spec.channels.len() * spec.design.taps.unwrap_or_default();
        if spec.design.method != Method::Fir || unknowns > limit {
            println!("{}: not tried, {unknowns} unknowns", path.display());
            continue;
        }
        // `kyp` has no secondary objective, and integer taps are another problem.
        (spec.design.gamma_margin, spec.design.bits, spec.design.fraction_bits) = (None, None, None);
        spec.channels.iter_mut().for_each(|channel| channel.noise = 0.0);
        check(&path.display().to_string(), &spec);
    }
}

/// Equal channels, one channel, channels of very different gains, and samples that are the reference
/// already.
#[test]
fn degenerate_plants() {
    check("equal", &with_taps(thesis(4, &[0.6, 0.6]), 6));
    check("one", &with_taps(thesis(4, &[0.6]), 6));
    let mut unequal = with_taps(thesis(4, &[1.2, 0.6]), 6);
    unequal.channels[0].filter = tf(&[0.25e9], &[1.0, 1.0, 0.25]);
    unequal.channels[1].filter = tf(&[0.25e-9], &[1.0, 1.0, 0.25]);
    check("gains", &unequal);
    check("zero", &with_taps(thesis(4, &[0.0, 1.0]), 6));
    check("butterworth", &with_taps(alike(&butterworth(4, 1.2), 2, 4, &[0.0, 1.3]), 8));
}

#[test]
fn too_many_states_are_refused_with_the_remedy() {
    let mut spec = with_taps(thesis(10, &[1.2, 0.6]), 400);
    spec.design.solver = Some(Solver::Kyp);
    let refused = design(&spec, &Options::default()).map(|_| ());
    assert!(matches!(refused, Err(DesignError::KypTooLarge { limit: 160, .. })), "{refused:?}");
    assert!(refused.unwrap_err().to_string().contains("solver = \"sampled\""));
}
