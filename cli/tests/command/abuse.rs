//! What a tester found by abusing the binary: each stays as a test of its exit code and message.

use crate::support::{Desk, THESIS};

#[test]
fn delay_errors_out_of_all_proportion_are_refused() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    for error in ["1e300,0", "-1e300,0", "1e5,0", "0,-1e5"] {
        desk.refused(1, &["analyze", "bank.json", "--delay-error", error], &["bank.json", "states", "unit"]);
    }
}

#[test]
fn a_chirp_too_fast_for_its_quadrature_is_refused() {
    let desk = Desk::with_spec(THESIS);
    let args = ["simulate", "spec.toml", "--source", "chirp:1Hz..1e9Hz@2s", "-o", "captures"];
    desk.refused(1, &args, &["chirp:1Hz..1e9Hz@2s", "units"]);
}

#[test]
fn captures_that_no_sample_can_hold_are_refused() {
    let desk = Desk::with_spec(THESIS);
    let args = ["simulate", "spec.toml", "--source", "step@1", "--gain", "1e300", "-o", "captures"];
    desk.refused(1, &args, &["step@1", "--gain"]);
}
