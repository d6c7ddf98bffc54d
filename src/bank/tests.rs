//! Round trips to the bit, and every way in which a bank file can be wrong.

use super::*;

fn thesis_like() -> Bank {
    let spec = r#"
fast_period = 1.0
ratio = 2
latency = 10
[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }
[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
[design]
taps = 3
"#;
    Bank {
        spec: Some(Spec::from_toml(spec, "t.toml").unwrap()),
        fast_period: 1.0,
        ratio: 2,
        latency: 10,
        method: Method::Fir,
        delays: vec![1.2, 0.6],
        filters: SynthesisFilters::Fir(vec![vec![0.1, -2.5e-9, 1.0 / 3.0], vec![5e-324, -0.0, 1.7e308]]),
        gamma: Gamma { upper: Some(0.0399320), lower: None, noncausal: Some(0.03) },
    }
}

#[test]
fn reads_back_to_the_same_bits() {
    let bank = thesis_like();
    let text = bank.to_json().unwrap();
    let back = Bank::from_json(&text, "b.json").unwrap();
    assert_eq!(back, bank);
    let SynthesisFilters::Fir(taps) = &back.filters else { panic!("taps expected") };
    assert_eq!(taps[1][1].to_bits(), (-0.0_f64).to_bits());
    assert_eq!(back.to_json().unwrap(), text);
}
