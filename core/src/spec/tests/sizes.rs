//! The largest sizes, each refused just above it with its place.

use super::*;

/// Where the thesis example with these sizes is refused. Its front ends have two poles.
fn refused_at(ratio: usize, latency: usize, delays: &[f64], design: &str) -> String {
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = {latency}\nchannel = [{}]\ndesign = {{ {design} }}\n\
         target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n",
        channels.join(", "),
    );
    let spec = Spec::from_toml(&text, "spec.toml");
    spec.map_or_else(|error| error.path().to_owned(), |_| "accepted".to_owned())
}

#[test]
fn frames_are_shorter_for_designs_that_couple_them() {
    for (ratio, channels, method, place) in [
        (380, 4, "fir", "accepted"),
        (381, 4, "fir", "channel"),
        (381, 4, "h2", "accepted"),
        (1020, 5, "h2", "channel"),
    ] {
        let design = format!("method = \"{method}\", taps = 2");
        assert_eq!(refused_at(ratio, 0, &vec![0.0; channels], &design), place, "{ratio} {method}");
    }
}

#[test]
fn the_states_of_the_error_system_are_counted() {
    for (latency, delays, place) in [
        // Two poles, a chain of m0 states between the sample and the output, and as many again for the bank.
        (2046, &[0.0][..], "accepted"),
        (2047, &[0.0], "latency"),
        // The chain of the older of two samples.
        (0, &[2046.0, 0.0], "accepted"),
        (0, &[2047.0, 0.0], "latency"),
    ] {
        assert_eq!(refused_at(1, latency, delays, "method = \"iir\""), place, "{latency} {delays:?}");
    }
    // What the least squares of one output sample hold.
    for (taps, place) in [(2048, "accepted"), (2049, "design.taps")] {
        let design = format!("method = \"h2\", taps = {taps}");
        assert_eq!(refused_at(2, 0, &[0.0, 1.0], &design), place);
    }
}

#[test]
fn distinct_front_ends_have_so_many_poles() {
    let text = |channels: usize| {
        let channel = |i: usize| {
            format!("{{ delay = 0, filter = {{ family = \"bessel\", order = 15, cutoff = {} }} }}", 1 + i)
        };
        format!(
            "fast_period = 1.0\nratio = 2\ntarget = {{ filter = {{ family = \"rc\", cutoff = 0.1 }} }}\nchannel = [{}]\n",
            (0..channels).map(channel).collect::<Vec<_>>().join(", ")
        )
    };
    assert!(Spec::from_toml(&text(34), "").is_ok());
    let refused = Spec::from_toml(&text(35), "").unwrap_err();
    assert!(refused.path() == "channel" && refused.to_string().contains("526 poles"), "{refused}");
}
