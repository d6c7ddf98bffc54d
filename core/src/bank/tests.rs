//! Round trips to the bit, and every way in which a bank file can be wrong.

use proptest::prelude::*;

use super::*;
use crate::runtime::Nonlinearity;
use crate::spec::WordLengths;
use crate::units::Seconds;

fn spec() -> Spec {
    let text = "fast_period = 1.0\nratio = 2\nlatency = 10\n[target]\nfilter = { num = [0.25], den = [1.0, 1.0, 0.25] }\n\
                [[channel]]\ndelay = 1.2\n[[channel]]\ndelay = 0.6\n[design]\ntaps = 3\n";
    Spec::from_toml(text, "t.toml").unwrap()
}

fn fir() -> Bank {
    let taps = vec![vec![0.1, -2.5e-9, 1.0 / 3.0], vec![5e-324, -0.0, 1.7e149]];
    Bank {
        spec: Some(spec()),
        latency: 10,
        delays: vec![Seconds(1.2), Seconds(0.6)],
        gamma: Gamma { upper: Some(0.0399320), noncausal: Some(0.03), ..Gamma::default() },
        ..Bank::bare(SynthesisFilters::Fir(taps), 2)
    }
}

fn state_space() -> Bank {
    let block = StateMatrices {
        a: vec![vec![0.5, 0.1, 0.0], vec![0.0, -0.25, 1e-300], vec![1.0 / 7.0, 0.0, 0.0]],
        b: vec![vec![1.0, 2.0], vec![3.0, 4.0], vec![5.0, 6.0]],
        c: vec![vec![1.0, 0.0, 0.5], vec![0.0, 1.0, 0.5]],
        d: vec![vec![0.0, 0.1], vec![0.2, 0.3]],
    };
    Bank { spec: None, method: Method::Iir, filters: SynthesisFilters::StateSpace(block), ..fir() }
}

/// Its digest is that of `tools/bank_digest.py`.
const FIR_TEXT: &str = r#"{
  "format": "hybank-bank",
  "version": 1,
  "spec": {
    "fast_period": 1.0,
    "ratio": 2,
    "latency": 10,
    "target": {
      "filter": {
        "num": [0.25],
        "den": [1.0, 1.0, 0.25]
      }
    },
    "channel": [{
      "delay": 1.2,
      "filter": {
        "num": [0.25],
        "den": [1.0, 1.0, 0.25]
      }
    }, {
      "delay": 0.6,
      "filter": {
        "num": [0.25],
        "den": [1.0, 1.0, 0.25]
      }
    }],
    "design": {
      "method": "fir",
      "taps": 3
    }
  },
  "fast_period": 1.0,
  "ratio": 2,
  "latency": 10,
  "method": "fir",
  "channels": [{
    "delay": 1.2,
    "taps": [0.1, -2.5e-9, 0.3333333333333333]
  }, {
    "delay": 0.6,
    "taps": [5e-324, -0.0, 1.7e+149]
  }],
  "state_space": null,
  "gamma": {
    "norm": null,
    "upper": 0.039932,
    "lower": null,
    "noncausal": 0.03
  },
  "digest": "sha256:1738fddf0912eb1cabe5ac6dcd92100846b3aec4602af8b057756c4af1b0bf3e"
}
"#;

#[test]
fn the_file_looks_as_the_format_says() {
    assert_eq!(fir().to_json().unwrap(), FIR_TEXT);
}

/// The proof of a bank with two channels and ratio 2.
fn with_proof() -> Bank {
    let peak = GainWitness { half: [0.8, -0.6], reference: vec![[1.0, 0.5], [-0.0, 1.5e-300]] };
    let factor = vec![vec![0.1], vec![0.2, 1.0 / 3.0], vec![1e-9, -2.5, 7.0]];
    let correction = vec![vec![1e-18], vec![-3e-18, 0.0], vec![0.0, 2e-17, 1e-17]];
    let upper = Certificate { gamma: 0.04, peak, factor, correction };
    let norm = |norm: f64| NormBound { norm, factor: vec![vec![0.5], vec![-1.0 / 3.0, 2.0]] };
    let worst_case = Some(BoxProof { scales: vec![0.25, 1e-9], filters: norm(1.5), slopes: norm(0.1) });
    Bank { proof: Some(Proof { upper, worst_case }), ..fir() }
}

#[test]
fn the_digest_sees_the_content_and_not_the_layout() {
    assert_eq!(check_digest(FIR_TEXT, "b.json"), Ok(true));
    let flat = FIR_TEXT.replace("\n", " ").replace("\"fast_period\": 1.0", "\"fast_period\": 1");
    assert_eq!(check_digest(&flat, "b.json"), Ok(true), "{flat}");
    let noted = FIR_TEXT.replacen("{", "{\"meta\": [1, 2],", 1);
    assert_eq!(check_digest(&noted, "b.json"), Ok(true));
    let imperfect = imperfect().to_json().unwrap();
    assert_eq!(check_digest(imperfect.as_str(), "b.json"), Ok(true));
    for (text, from, to) in [
        (FIR_TEXT, "0.3333333333333333", "0.33333333333333337"),
        (FIR_TEXT, "-0.0", "0.0"),
        (FIR_TEXT, "\"lower\": null", "\"lower\": 0.01"),
        (FIR_TEXT, "1.2,", "1.3,"),
        // In the spec and in the channel, so that they agree.
        (imperfect.as_str(), "1.02", "1.03"),
        (imperfect.as_str(), "-0.3333333333333333", "-0.25"),
    ] {
        let altered = text.replace(from, to);
        assert!(altered != text && Bank::from_json(&altered, "b.json").is_ok(), "{from}");
        let error = check_digest(&altered, "b.json").unwrap_err();
        assert!(error.path() == "digest" && error.to_string().contains("was altered"), "{error}");
    }
    let at = FIR_TEXT.find(",\n  \"digest\"").unwrap();
    assert_eq!(check_digest(&format!("{}}}", &FIR_TEXT[..at]), "b.json"), Ok(false));
}

#[test]
fn every_mistake_in_a_proof_names_its_place() {
    let text = with_proof().to_json().unwrap();
    for (from, to, path, words) in [
        ("[0.2, 0.3333333333333333]", "[0.2]", "proof.upper.factor[1]", "lower triangular"),
        ("[-3e-18, 0.0]", "[-3e-18]", "proof.upper.correction[1]", "lower triangular"),
        ("[[1e-18], ", "[", "proof.upper.correction", "as many rows as the factor"),
        ("\"gamma\": 0.04", "\"gamma\": -0.04", "proof.upper.gamma", "zero or more"),
        ("\"half\": [0.8, -0.6]", "\"half\": [0, 0]", "proof.upper.peak.half", "cannot be zero"),
        ("\"half\": [0.8, -0.6]", "\"half\": [0.8]", "proof.upper.peak.half", "1 entries"),
        ("[[1.0, 0.5], [-0.0, 1.5e-300]]", "[[1.0, 0.5]]", "proof.upper.peak.reference", "1 weights"),
        ("[-0.0, 1.5e-300]", "[null, 2.0]", "proof.upper.peak.reference[1][0]", "expected a number"),
        ("\"factor\"", "\"faktor\"", "proof.upper", "did you mean \"factor\""),
        ("\"digest\": \"sha256:", "\"digest\": \"sha1:", "digest", "64 hexadecimal digits"),
    ] {
        refused(&with(&text, from, to), path, words);
    }
}

#[test]
fn reads_back_to_the_same_bits() {
    for bank in [fir(), state_space(), with_proof(), imperfect()] {
        let text = bank.to_json().unwrap();
        let back = Bank::from_json(&text, "b.json").unwrap();
        assert_eq!(back, bank);
        assert_eq!(back.to_json().unwrap(), text);
    }
    let SynthesisFilters::Fir(taps) = Bank::from_json(FIR_TEXT, "b.json").unwrap().filters else {
        panic!("no taps")
    };
    assert_eq!(taps[1][1].to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn a_bank_made_elsewhere_reads() {
    let text = "\u{feff}{\"version\":1,\"format\":\"hybank-bank\",\"fast_period\":1,\"ratio\":3,\"latency\":0,\
                \"method\":\"sinc\",\"channels\":[{\"delay\":0,\"taps\":[1,12345678901234567890]}],\
                \"meta\":{\"made_by\":[\"anything\",null]}}";
    let bank = Bank::from_json(text, "b.json").unwrap();
    assert_eq!((bank.spec.is_none(), bank.gamma, bank.slow_period()), (true, Gamma::default(), Seconds(3.0)));
    assert_eq!(bank.filters, SynthesisFilters::Fir(vec![vec![1.0, 12345678901234567890.0]]));
}

#[test]
fn a_static_block_has_no_states() {
    let block = StateMatrices {
        a: vec![],
        b: vec![],
        c: vec![vec![], vec![]],
        d: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
    };
    let bank = Bank { filters: SynthesisFilters::StateSpace(block), ..state_space() };
    assert_eq!(Bank::from_json(&bank.to_json().unwrap(), "b.json").unwrap(), bank);
}

fn fixed_point() -> Bank {
    let integers = vec![vec![-8, 0, 7], vec![1, -1, 3]];
    let words = FixedPoint { bits: WordLengths::Same(4), fraction_bits: 3, integers };
    Bank { filters: SynthesisFilters::Fir(words.taps()), fixed_point: Some(words), ..fir() }
}

#[test]
fn integer_taps_read_back_and_are_checked_against_the_taps_and_their_bits() {
    let bank = fixed_point();
    let text = bank.to_json().unwrap();
    assert!(text.contains("[-8, 0, 7]") && text.contains("[-1.0, 0.0, 0.875]"), "{text}");
    assert_eq!(Bank::from_json(&text, "b.json").unwrap(), bank);
    for (was, is, place, words) in [
        ("[-8, 0, 7]", "[-8, 0, 8]", "fixed_point.integers[0][2]", "from -8 to 7"),
        ("[-8, 0, 7]", "[-8, 0, 9223372036854775808]", "fixed_point.integers[0][2]", "a whole number"),
        ("[-8, 0, 7]", "[-8, 1, 7]", "channels[0].taps[1]", "is not 1 times"),
        ("[-8, 0, 7]", "[-8, 0]", "fixed_point.integers", "an integer for each tap"),
        ("[-8, 0, 7]", "[-8, 0.5, 7]", "fixed_point.integers[0][1]", "whole number"),
        ("0.875", "0.8750000000000001", "channels[0].taps[2]", "is not 7 times"),
        ("\"fraction_bits\": 3", "\"fraction_bits\": 4", "channels[0].taps[0]", "is not -8 times"),
        ("\"fraction_bits\": 3", "\"fraction_bits\": 3000", "fixed_point.fraction_bits", "from -256"),
        ("\"bits\": 4", "\"bits\": 3", "fixed_point.integers[0][0]", "from -4 to 3"),
        ("\"bits\": 4", "\"bits\": [4, 0, 4]", "fixed_point.integers[1][1]", "from 0 to 0"),
        ("\"bits\": 4", "\"bits\": []", "fixed_point.bits", "list of bits is empty"),
        ("\"bits\": 4", "\"bits\": 64", "fixed_point.bits", "2 to 32"),
    ] {
        refused(&with(&text, was, is), place, words);
    }
    let states = Bank { fixed_point: bank.fixed_point.clone(), ..state_space() };
    assert_eq!(states.check().unwrap_err().path(), "fixed_point");
    let mut other = spec();
    other.design.bits = Some(WordLengths::Same(5));
    let differs = Bank { spec: Some(other), ..bank };
    assert_eq!(differs.check().unwrap_err().path(), "spec.design.bits");
}

#[test]
fn integer_taps_that_could_not_be_read_back_are_not_written() {
    let words = |bits: WordLengths, fraction_bits| FixedPoint {
        bits,
        fraction_bits,
        integers: vec![vec![1, 0, -1]; 2],
    };
    for (words, place) in [
        (words(WordLengths::Same(4), -257), "fixed_point.fraction_bits"),
        (words(WordLengths::Same(4), 257), "fixed_point.fraction_bits"),
        (words(WordLengths::Same(33), 3), "fixed_point.bits"),
        (words(WordLengths::PerTap(vec![]), 3), "fixed_point.bits"),
    ] {
        let filters = SynthesisFilters::Fir(words.taps());
        let bank = Bank { filters, fixed_point: Some(words), ..fir() };
        assert_eq!(bank.check().unwrap_err().path(), place);
        assert!(bank.to_json().is_err());
    }
}

/// A text with the first occurrence replaced.
fn with(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from} in {text}");
    text.replacen(from, to, 1)
}

/// Refused at this place with a message that has `words`.
fn refused(text: &str, path: &str, words: &str) {
    let Err(error) = Bank::from_json(text, "b.json") else { panic!("this must not read: {text}") };
    assert_eq!(error.path(), path, "{error}");
    assert!(error.to_string().contains(words), "expected {words:?} in: {error}");
    assert!(error.to_string().starts_with("b.json: "), "{error}");
}

#[test]
fn every_mistake_names_its_json_place_and_the_remedy() {
    let ss = state_space().to_json().unwrap();
    let fir_with = |from: &str, to: &str| with(FIR_TEXT, from, to);
    let ss_with = |from: &str, to: &str| with(&ss, from, to);
    // The last occurrence is the bank's own, where the spec has the same key.
    let last = |from: &str, to: &str| {
        let at = FIR_TEXT.rfind(from).unwrap();
        format!("{}{to}{}", &FIR_TEXT[..at], &FIR_TEXT[at + from.len()..])
    };
    for (text, path, words) in [
        (String::new(), "", "it is empty"),
        ("[]".into(), "", "0 entries"),
        (FIR_TEXT[..400].into(), "", "line"),
        (fir_with("\"latency\": 10,", "\"latency\": 10, \"latency\": 10,"), "spec", "given twice"),
        (fir_with("hybank-bank", "wavelets"), "format", "a bank says \"hybank-bank\""),
        (fir_with("\"format\": \"hybank-bank\",", ""), "", "the key format is missing"),
        (fir_with("\"version\": 1", "\"version\": 2"), "version", "has version 2"),
        (fir_with("\"version\": 1", "\"version\": \"1\""), "version", "expected a whole number"),
        (fir_with("\"state_space\"", "\"statespace\""), "", "did you mean \"state_space\""),
        (last("\"fast_period\": 1.0", "\"fast_period\": 0.0"), "fast_period", "must be positive"),
        (last("\"fast_period\": 1.0", "\"fast_period\": 1e999"), "", "does not fit a double"),
        (last("\"fast_period\": 1.0", "\"fast_period\": null"), "fast_period", "perhaps written for NaN"),
        (last("\"fast_period\": 1.0", "\"fast_period\": 2.0"), "spec.fast_period", "the bank says 2"),
        (last("\"ratio\": 2", "\"ratio\": 0"), "ratio", "must be 1 to 1024"),
        (last("\"ratio\": 2", "\"ratio\": 2.5"), "ratio", "without point"),
        (last("\"ratio\": 2", "\"ratio\": 3"), "spec.ratio", "the bank says 3, its spec says 2"),
        (last("\"latency\": 10", "\"latency\": -1"), "latency", "zero or more"),
        (last("\"latency\": 10", "\"latency\": 99999999"), "latency", "16777216"),
        (last("\"latency\": 10", "\"latency\": 11"), "spec.latency", "must agree"),
        (last("\"fir\"", "\"firr\""), "method", "did you mean \"fir\""),
        (last("\"fir\"", "\"iir\""), "method", "a bank of the method iir holds state_space and no taps"),
        (ss_with("\"iir\"", "\"sinc\""), "method", "a bank of the method sinc holds taps"),
        (last("\"delay\": 0.6", "\"delay\": -6e7"), "channels[1].delay", "check its unit"),
        (last("\"delay\": 0.6", "\"delay\": 0.61"), "spec.channel[1].delay", "the bank says 0.61"),
        (last("\"delay\": 0.6", "\"dealy\": 0.6"), "channels[1]", "did you mean \"delay\""),
        (last("0.3333333333333333", "null"), "channels[0].taps[2]", "perhaps written for NaN"),
        (last("-0.0", "\"x\""), "channels[1].taps[1]", "found the text \"x\""),
        (last(", 1.7e+149", ""), "channels[1].taps", "2 taps, but there must be 3: all filters are as long"),
        (
            last("\"taps\": [5e-324, -0.0, 1.7e+149]", "\"taps\": null"),
            "channels[1]",
            "the key taps is missing",
        ),
        (last("\"state_space\": null", "\"state_space\": {}"), "state_space", "the key a is missing"),
        (last("0.039932", "-0.1"), "gamma.upper", "zero or more"),
        (last("\"noncausal\": 0.03", "\"noncausal\": 0.05"), "gamma.noncausal", "at most gamma.upper"),
        (last("\"noncausal\"", "\"non_causal\""), "gamma", "did you mean \"noncausal\""),
        (fir_with("\"taps\": 3", "\"taps\": 0"), "spec.design.taps", "1 to 65536"),
        (fir_with("[1.0, 1.0, 0.25]", "[1.0, 1.0, NaN]"), "", "line"),
        (
            fir_with("\"num\": [0.25],\n        \"den\": [1.0, 1.0, 0.25]", ""),
            "spec.target.filter",
            "the filter is empty",
        ),
        (ss_with("[[0.5, 0.1, 0.0], ", "["), "state_space.a[0]", "3 columns, but there must be 2"),
        (ss_with("[0.5, 0.1, 0.0]", "[0.5, 0.1]"), "state_space.a[0]", "2 columns, but there must be 3"),
        (ss_with("[3.0, 4.0]", "[3.0]"), "state_space.b[1]", "b is n x N, N the number of channels"),
        (ss_with(", [5.0, 6.0]", ""), "state_space.b", "2 rows, but there must be 3"),
        (ss_with("[0.0, 1.0, 0.5]", "[0.0, 1.0]"), "state_space.c[1]", "c is M x n"),
        (ss_with("[0.2, 0.3]", "[0.2, 0.3, 0.4]"), "state_space.d[1]", "d is M x N"),
        (ss_with("\"d\": ", "\"e\": "), "state_space", "unknown key \"e\""),
        (ss_with("\"ratio\": 2", "\"ratio\": 1"), "state_space.c", "2 rows, but there must be 1"),
    ] {
        refused(&text, path, words);
    }
    let none = Bank { spec: None, delays: vec![], filters: SynthesisFilters::Fir(vec![]), ..fir() };
    assert_eq!(none.check().unwrap_err().path(), "channels");
}

#[test]
fn what_json_cannot_say_is_not_written() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let tap = Bank { filters: SynthesisFilters::Fir(vec![vec![0.0; 3], vec![0.0, value, 0.0]]), ..fir() };
        let error = tap.to_json().unwrap_err();
        assert_eq!(error.path(), "channels[1].taps[1]");
        let gamma = Bank { gamma: Gamma { lower: Some(value), ..Gamma::default() }, ..fir() };
        assert_eq!(gamma.to_json().unwrap_err().path(), "gamma.lower");
        let delay = Bank { delays: vec![Seconds(value), Seconds(0.6)], ..fir() };
        assert_eq!(delay.to_json().unwrap_err().path(), "channels[0].delay");
        let mut block = state_space();
        if let SynthesisFilters::StateSpace(filter) = &mut block.filters {
            filter.c[1][2] = value;
        }
        assert_eq!(block.to_json().unwrap_err().path(), "state_space.c[1][2]");
    }
}

#[test]
fn deep_nesting_is_an_error() {
    for key in ["format", "channels", "meta"] {
        let text = format!("{{\"{key}\": {}1{}}}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(!Bank::from_json(&text, "b.json").unwrap_err().to_string().is_empty());
        let error = check_digest(&text, "b.json").unwrap_err().to_string();
        assert!(error.contains("is this a bank written by"), "{error}");
    }
}

/// Every bit pattern of a number of a bank.
fn any_double() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("in range", |x| x.abs() <= 1e150)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bits_survive_the_file(
        taps in prop::collection::vec(prop::collection::vec(any_double(), 17), 1..4),
        gamma in prop::option::of(any_double().prop_map(f64::abs)),
        fast_period in 1e-100..1e100f64,
        latency in 0usize..1000,
    ) {
        let delays = taps.iter().map(|list| Seconds(fast_period * (list[0].abs() % 1.0))).collect();
        let gains = taps.iter().map(|list| -1.0 - (list[1] % 1.0).abs()).collect();
        let offsets = taps.iter().map(|list| list[2] % 1.0).collect();
        let gamma = Gamma { upper: gamma, ..Gamma::default() };
        let samples = vec![1; taps.len()];
        let curve = |list: &Vec<f64>| match list[4].to_bits() as usize % 4 {
            3 => Nonlinearity::Table { table: vec![list[3] % 0.1; 16] },
            count => Nonlinearity::Polynomial(vec![list[3] % 0.1; count]),
        };
        let nonlinearity = taps.iter().map(curve).collect();
        let filters = SynthesisFilters::Fir(taps.clone());
        let fast_period = Seconds(fast_period);
        let converters = Bank { delays, gains, offsets, nonlinearity, samples, ..fir() };
        let bank = Bank { spec: None, fast_period, latency, filters, gamma, ..converters };
        let back = Bank::from_json(&bank.to_json().unwrap(), "b.json").unwrap();
        let SynthesisFilters::Fir(read) = &back.filters else { panic!("taps expected") };
        let bits = |lists: &[Vec<f64>]| lists.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(read), bits(&taps));
        prop_assert_eq!(back, bank);
    }

    #[test]
    fn a_damaged_file_is_refused_or_read_but_never_panics(at in 0usize..1200, cut in 0usize..20, put in "[ -~]{0,6}") {
        let (start, end) = (at.min(FIR_TEXT.len()), (at + cut).min(FIR_TEXT.len()));
        let damaged = format!("{}{put}{}", &FIR_TEXT[..start], &FIR_TEXT[end..]);
        if let Err(error) = Bank::from_json(&damaged, "b.json") {
            prop_assert!(error.to_string().starts_with("b.json: "));
        }
    }
}

/// The second converter of [`fir`] is two per cent too strong and has an offset.
fn imperfect() -> Bank {
    let mut bank = fir();
    (bank.gains, bank.offsets) = (vec![1.0, 1.02], vec![0.0, -1.0 / 3.0]);
    let channel = &mut bank.spec.as_mut().unwrap().channels[1];
    (channel.gain, channel.offset) = (1.02, -1.0 / 3.0);
    bank
}

#[test]
fn gains_and_offsets_that_do_not_fit_are_refused() {
    for (bank, path) in [
        (Bank { gains: vec![1.0], ..fir() }, "channels"),
        (Bank { offsets: vec![0.0; 3], ..fir() }, "channels"),
        (Bank { gains: vec![1.0, 0.0], ..fir() }, "channels[1].gain"),
        (Bank { gains: vec![f64::NAN, 1.0], ..fir() }, "channels[0].gain"),
        (Bank { offsets: vec![0.0, 1.5], ..fir() }, "channels[1].offset"),
        // The spec says otherwise.
        (Bank { gains: vec![1.0, 1.02], ..fir() }, "spec.channel[1].gain"),
        (Bank { offsets: vec![1e-9, 0.0], ..fir() }, "spec.channel[0].offset"),
    ] {
        let error = bank.check().unwrap_err();
        assert_eq!(error.path(), path, "{error}");
    }
}

#[test]
fn a_bank_needs_as_many_filters_as_delays() {
    let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0], vec![1.0]]), 2);
    assert_eq!(bank.plan(Options::default()).unwrap().channels(), 2);
    let refused =
        Bank { delays: vec![Seconds(0.0)], samples: vec![1], ..bank }.plan(Options::default()).unwrap_err();
    assert_eq!(refused, BuildError::FilterCount { delays: 1, filters: 2 });
}

#[test]
fn offsets_are_subtracted_before_the_filters() {
    let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0, 2.0], vec![10.0, 20.0]]), 2);
    let bank = Bank { offsets: vec![0.5, -1.0], ..bank };
    let mut stream = crate::runtime::Stream::new(&bank.plan(Options::default()).unwrap());
    let mut out = [0.0; 2];
    stream.process(&[1.5, 0.0], &mut out).unwrap();
    assert_eq!(out, [11.0, 22.0]);
}
