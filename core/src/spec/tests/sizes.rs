//! The largest sizes, each refused just above it with its place.

use super::*;

/// The thesis example with these sizes. Its front ends have two poles.
struct Sizes {
    ratio: usize,
    latency: Option<usize>,
    delays: Vec<f64>,
    design: &'static str,
}

impl Sizes {
    fn spec(&self) -> Result<Spec, SpecError> {
        let channels: Vec<String> =
            self.delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
        let latency = self.latency.map(|latency| format!("latency = {latency}\n")).unwrap_or_default();
        let text = format!(
            "fast_period = 1.0\nratio = {}\n{latency}channel = [{}]\ndesign = {{ {} }}\n\
             target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n",
            self.ratio,
            channels.join(", "),
            self.design,
        );
        Spec::from_toml(&text, "spec.toml")
    }

    fn refused_at(&self) -> String {
        self.spec().map_or_else(|error| error.path().to_owned(), |_| "accepted".to_owned())
    }
}

fn recursive(ratio: usize, latency: usize, delays: &[f64]) -> Sizes {
    Sizes { ratio, latency: Some(latency), delays: delays.to_vec(), design: "method = \"iir\"" }
}

#[test]
fn frames_are_shorter_for_designs_that_couple_them() {
    let frame =
        |ratio, channels, design| Sizes { ratio, latency: Some(0), delays: vec![0.0; channels], design };
    assert_eq!(frame(380, 4, "method = \"fir\", taps = 2").refused_at(), "accepted");
    assert_eq!(frame(381, 4, "method = \"fir\", taps = 2").refused_at(), "channel");
    assert_eq!(frame(381, 4, "method = \"h2\", taps = 2").refused_at(), "accepted");
    assert_eq!(frame(1020, 5, "method = \"h2\", taps = 2").refused_at(), "channel");
}

#[test]
fn the_states_of_the_error_system_are_counted() {
    // Two poles, a chain of m0 states between the sample and the output, and as many again for the bank.
    assert_eq!(recursive(1, 2046, &[0.0]).refused_at(), "accepted");
    assert_eq!(recursive(1, 2047, &[0.0]).refused_at(), "latency");
    // The chain of the older of two samples.
    assert_eq!(recursive(1, 0, &[2046.0, 0.0]).refused_at(), "accepted");
    assert_eq!(recursive(1, 0, &[2047.0, 0.0]).refused_at(), "latency");
    // What the least squares of one output sample hold.
    let fir = |design| Sizes { ratio: 2, latency: Some(0), delays: vec![0.0, 1.0], design };
    assert_eq!(fir("method = \"h2\", taps = 2048").refused_at(), "accepted");
    assert_eq!(fir("method = \"h2\", taps = 2049").refused_at(), "design.taps");
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
