//! Converters with rates of their own: banks against those for the same samples as channels written by hand,
//! and errors that the samples of a converter share against brute force.

use crate::support::random::Random;
use crate::support::{designed, proven};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::uncertainty::BoxStudy;
use hybank::design::{analyze_mean, norm_at};
use hybank::spec::{ErrorBox, ErrorPoint, Spec};
use hybank::units::{FastPeriods, Seconds};
use hybank::verify::verify;

/// 24 kHz and 16 kHz into 48 kHz in fast periods, latency 12, with a `[design]` table.
fn spec(design: &str) -> Spec {
    let text = format!(
        "fast_period = 1.0\nlatency = 12\n\
         target = {{ filter = {{ family = \"butterworth\", order = 2, cutoff = 0.18 }} }}\n\
         channel = [\n{{ delay = 0.3, rate = 0.5 }},\n\
         {{ delay = 1.1, rate = 0.3333333333333333, gain = 1.1, filter = {{ family = \"butterworth\", order = 2, cutoff = 0.15 }} }}]\n\
         {design}"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// gamma, its proof, and the mean error of each method are those of five channels of one rate.
#[test]
fn a_bank_for_unequal_rates_is_one_for_all_samples_of_a_frame() {
    for table in ["\"fir\", taps = 24", "\"iir\"", "\"h2\""] {
        let own = spec(&format!("design = {{ method = {table} }}"));
        assert_eq!((own.ratio, own.layout().samples().to_vec(), own.wait()), (6, vec![3, 2], 4));
        let by_hand = own.per_sample();
        assert_eq!((by_hand.channels.len(), by_hand.wait()), (5, 0));
        let found = proven(&own);
        let hand = designed(&by_hand);
        let [gamma, other] = [&found.bank, &hand].map(|bank| bank.gamma.norm.unwrap());
        assert!((gamma / other - 1.0).abs() < 1e-6, "{table}: {gamma} {other}");
        let mean = |bank: &Bank| analyze_mean(bank).unwrap().rms_error;
        assert!((mean(&found.bank) / mean(&hand) - 1.0).abs() < 1e-3, "{table}");
        found.proof.as_ref().unwrap_or_else(|error| panic!("{table}: {error}"));
        let read = Bank::from_json(&found.bank.to_json().unwrap(), "bank.json").unwrap();
        assert_eq!(read, found.bank, "{table}");
        let proven = verify(&read).unwrap();
        assert!(proven.upper >= gamma && proven.upper < gamma * 1.001, "{table}: {proven:?}");
    }
}

/// Equal rates, written or not, are one spec and one bank.
#[test]
fn equal_rates_are_no_rates() {
    let text = |rate: &str, ratio: &str| {
        format!(
            "fast_rate = 48000\n{ratio}\nlatency = 8\n\
             target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = 9000 }} }}\n\
             channel = [{{ delay_samples = 1.2 {rate} }}, {{ delay_samples = 0.6 {rate} }}]\ndesign = {{ method = \"fir\", taps = 12 }}"
        )
    };
    let read = |rate, ratio| Spec::from_toml(&text(rate, ratio), "spec.toml").unwrap();
    let plain = read("", "ratio = 2");
    assert_eq!(read(", rate = \"24 kHz\"", ""), plain);
    assert_eq!(read(", rate = \"24 kHz\"", "ratio = 2"), plain);
    let json = designed(&plain).to_json().unwrap();
    assert!(!json.contains("rate\"") && !json.contains("samples"), "{json}");
}

/// Against the norms at points of the box, with one error per converter; errors that each sample has for
/// itself are worse.
#[test]
fn the_samples_of_a_converter_share_its_errors() {
    let own = spec("design = { method = \"fir\", taps = 12 }");
    let bank = designed(&own);
    let errors = ErrorBox {
        delays: vec![FastPeriods(0.0), FastPeriods(0.1)],
        gains: vec![0.02, 0.0],
        cutoffs: vec![0.0, 0.01],
    };
    let found = BoxStudy::new(&bank, &errors).unwrap();
    assert!(found.upper <= found.attained * 2.0, "{found:?}");
    let mut random = Random(4);
    let mut most = 0.0f64;
    for trial in 0..60 {
        // The corners first.
        let mut draw = |side: u32, half: f64| match trial {
            0..8 if trial >> side & 1 == 1 => -half,
            0..8 => half,
            _ => half * random.sample(),
        };
        let point = ErrorPoint {
            delays: vec![FastPeriods(0.0), FastPeriods(draw(0, 0.1))],
            gains: vec![draw(1, 0.02), 0.0],
            cutoffs: vec![0.0, draw(2, 0.01)],
        };
        most = most.max(norm_at(&bank, &point).unwrap());
    }
    assert!(most <= found.upper * (1.0 + 1e-9) && most > 0.98 * found.attained, "{most} {found:?}");
    // The same box with an error for each sample.
    let untied = Bank {
        samples: vec![1; 5],
        delays: own.per_sample().channels.iter().map(|c| c.delay).collect(),
        spec: Some(own.per_sample()),
        gains: vec![1.0, 1.0, 1.0, 1.1, 1.1],
        offsets: vec![0.0; 5],
        nonlinearity: vec![hybank::runtime::Nonlinearity::default(); 5],
        ..bank.clone()
    };
    untied.check().unwrap();
    let each = ErrorBox {
        delays: [0.0, 0.0, 0.0, 0.1, 0.1].map(FastPeriods).to_vec(),
        gains: vec![0.02, 0.02, 0.02, 0.0, 0.0],
        cutoffs: vec![0.0, 0.0, 0.0, 0.01, 0.01],
    };
    let [tied, looser] =
        [(&bank, &errors), (&untied, &each)].map(|(bank, errors)| BoxStudy::new(bank, errors).unwrap());
    assert!(looser.attained > tied.attained && looser.upper >= looser.attained, "{looser:?} {tied:?}");
}

/// Designs for errors are better at their worst than those that do not know of them, and prove it.
#[test]
fn robust_designs_know_one_error_per_converter() {
    let box_of = "uncertainty = { delay = [0, 0.1], reference = 1 }\n";
    let nominal = designed(&spec("design = { method = \"fir\", taps = 12 }"));
    let errors = ErrorBox { delays: vec![FastPeriods(0.0), FastPeriods(0.1)], ..ErrorBox::none(2) };
    let careless = BoxStudy::new(&nominal, &errors).unwrap();
    let robust = proven(&spec(&format!("{box_of}design = {{ method = \"fir\", taps = 12 }}")));
    let stated = robust.bank.gamma.worst_case.unwrap_or_else(|| panic!("{:?}", robust.box_unproven));
    assert!(stated < careless.upper, "{stated} {careless:?}");
    let found = BoxStudy::new(&robust.bank, &errors).unwrap();
    assert!(found.attained < careless.attained, "{found:?} {careless:?}");
}

/// The mean over Gaussian errors of one delay, which the samples of its converter share, by the rule of
/// Gauss and Hermite with seven points: no other bank tried is better.
#[test]
fn mean_square_banks_average_over_one_error_per_converter() {
    let deviation = 0.2;
    let half = 1.959963984540054 * deviation;
    let table = |uncertainty: &str| {
        let text = format!("{uncertainty}design = {{ method = \"h2\", taps = 18 }}");
        let mut spec = spec(&text);
        spec.channels.iter_mut().for_each(|channel| channel.noise = 1e-3);
        spec
    };
    let averaged = designed(&table(&format!("uncertainty = {{ delay = [0, {half}], reference = 1 }}\n")));
    let nominal = designed(&table(""));
    // Nodes and weights for the weight exp(-x^2).
    let nodes = [
        (0.0, 0.8102646175568073),
        (0.8162878828589647, 0.4256072526101278),
        (1.673551628767471, 0.05451558281912703),
        (2.651961356835233, 0.0009717812450995192),
    ];
    let mean = |bank: &Bank| {
        let at = |x: f64| {
            let moved = hybank::design::analyze(
                bank,
                &[Seconds(0.0), Seconds(std::f64::consts::SQRT_2 * deviation * x)],
            )
            .unwrap();
            moved.mean.rms_error.powi(2) + moved.mean.output_noise.powi(2)
        };
        let both = |&(x, w): &(f64, f64)| if x == 0.0 { w * at(0.0) } else { w * (at(x) + at(-x)) };
        nodes.iter().map(both).sum::<f64>() / std::f64::consts::PI.sqrt()
    };
    let best = mean(&averaged);
    assert!(best < 0.999 * mean(&nominal), "{best} {}", mean(&nominal));
    let SynthesisFilters::Fir(taps) = &averaged.filters else { panic!("taps") };
    for (i, n) in (0..5).flat_map(|i| [4, 9, 13].map(|n| (i, n))) {
        for change in [-1e-3, 1e-3] {
            let mut changed = taps.clone();
            changed[i][n] += change;
            let other = mean(&Bank { filters: SynthesisFilters::Fir(changed), ..averaged.clone() });
            assert!(other > best, "{i} {n}: {other} {best}");
        }
    }
}
