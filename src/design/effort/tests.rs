use super::*;

fn spec(text: &str) -> Spec {
    let whole = format!(
        "fast_period = 1.0\ntarget = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n{text}"
    );
    Spec::from_toml(&whole, "spec.toml").unwrap()
}

const PAIR: &str = "channel = [{ delay = 1.2 }, { delay = 0.6 }]";

#[test]
fn efforts_are_said_in_units_for_people() {
    let said = |seconds: f64, bytes: f64| Effort { shortest: seconds, longest: seconds, bytes }.to_string();
    assert_eq!(said(0.05, 2.4e6), "50 ms and 2.4 MB");
    assert_eq!(said(75.0, 31e6), "75 seconds and 31 MB");
    assert_eq!(said(2100.0, 8.7e9), "35 minutes and 8.7 GB");
    assert_eq!(said(3.6e7, 1e13), "417 days and 10 TB");
    let range = |shortest: f64, longest: f64| Effort { shortest, longest, bytes: 1e6 }.time();
    assert_eq!(range(0.08, 12.0), "80 ms to 12 seconds");
    assert_eq!(range(9.0, 12.0), "12 seconds");
}

#[test]
fn more_of_anything_takes_longer() {
    let base = ("ratio = 2", "latency = 10", "taps = 22");
    let of = |(ratio, latency, taps): (&str, &str, &str)| {
        let text = format!("{ratio}\n{latency}\n{PAIR}\ndesign = {{ method = \"fir\", {taps} }}");
        estimate(&spec(&text), false).unwrap().longest
    };
    let small = of(base);
    assert!(small < 1.0, "{small}");
    assert!(of(("ratio = 4", base.1, "taps = 44")) > small);
    assert!(of((base.0, "latency = 100", "taps = 220")) > 2.0 * small);
    let open = of((base.0, "", ""));
    assert!(open > of((base.0, base.1, "")) && open > of((base.0, "", base.2)), "{open}");
}

/// Certificates of up to 96 states are searched in 512 bits, those of more than 512 states not at all.
#[test]
fn the_search_for_a_proof_costs_time() {
    let proof = |latency: usize, taps: usize| {
        let text =
            format!("ratio = 2\nlatency = {latency}\n{PAIR}\ndesign = {{ method = \"fir\", taps = {taps} }}");
        let seconds = |proving| estimate(&spec(&text), proving).unwrap().longest;
        seconds(true) - seconds(false)
    };
    assert!(proof(10, 24) > 0.3, "{}", proof(10, 24));
    assert!(proof(10, 80) > 0.5 && proof(10, 80) > proof(10, 96), "{} {}", proof(10, 80), proof(10, 96));
    assert_eq!(proof(300, 600), 0.0);
}

#[test]
fn each_scenario_of_uncertain_channels_costs_time() {
    let seconds = |uncertainty: &str| {
        let text = format!(
            "ratio = 2\nlatency = 10\n{PAIR}\ndesign = {{ method = \"fir\", taps = 22 }}\n{uncertainty}"
        );
        estimate(&spec(&text), false).unwrap().longest
    };
    let (nominal, delays) = (seconds(""), seconds("uncertainty = { delay_samples = 0.1 }"));
    let both = seconds("uncertainty = { delay_samples = 0.1, cutoff = 0.01 }");
    assert!(delays > 3.0 * nominal && both > 1.3 * delays, "{nominal} {delays} {both}");
    let exact = seconds("uncertainty = { delay_samples = [0.1, 0.0] }");
    assert_eq!(exact, nominal, "the reference channel has no error");
}

#[test]
fn what_cannot_end_is_refused_with_the_figure_and_the_way_out() {
    let huge =
        spec(&format!("ratio = 2\nlatency = 1000\n{PAIR}\ndesign = {{ method = \"fir\", taps = 5000 }}"));
    let refused = check(&huge, true, Limits::Enforced).unwrap_err();
    assert!(matches!(refused, DesignError::TooLong { .. } | DesignError::TooLarge { .. }), "{refused}");
    for part in ["would take about", " GB", "use fewer taps"] {
        assert!(refused.to_string().contains(part), "{refused}");
    }
    assert!(check(&huge, true, Limits::Off).is_ok());
    let small = spec(&format!("ratio = 2\nlatency = 10\n{PAIR}\ndesign = {{ method = \"fir\", taps = 22 }}"));
    assert!(check(&small, true, Limits::Enforced).is_ok());
}
