//! Specs that are written and read back, and damaged texts.

use proptest::prelude::*;

use super::*;

/// Numbers of every size, with the awkward ones among them.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        (1.0..10.0f64, -30..30i32).prop_map(|(x, e)| x * 10f64.powi(e)),
        Just(0.1),
        Just(1.0 / 3.0),
        Just(f64::MIN_POSITIVE),
        Just(5e-324),
        Just(1e150),
    ]
}

fn written_filter() -> impl Strategy<Value = FilterSpec> {
    let list = |size| prop::collection::vec(number(), size);
    let tf = (list(1..3), list(3..6)).prop_map(|(num, den)| FilterSpec::TransferFunction { num, den });
    let pole = [number(), number()];
    let zpk = (prop::collection::vec(pole, 1..5), number()).prop_map(|(poles, gain)| {
        FilterSpec::ZeroPoleGain { zeros: vec![[-0.0, 1.0]; poles.len() - 1], poles, gain }
    });
    let ss = (1usize..4, number()).prop_map(|(n, x)| FilterSpec::StateSpace {
        a: vec![vec![-x; n]; n],
        b: vec![vec![x]; n],
        c: vec![vec![1.0; n]],
    });
    let family =
        (prop::sample::select(Family::ALL.to_vec()), 0usize..5, number()).prop_map(|(family, k, cutoff)| {
            FilterSpec::Family {
                family,
                order: (family != Family::Rc).then_some(2 * k + 1),
                passband: if k % 2 == 0 || cutoff < f64::MIN_POSITIVE {
                    Passband::LowPass { cutoff: Hertz(cutoff) }
                } else {
                    Passband::BandPass { low: Hertz(cutoff / 3.0), high: Hertz(cutoff) }
                },
                ripple_db: family.has_ripple().then_some(0.1),
                attenuation_db: family.has_attenuation().then_some(51.7),
            }
        });
    let single = prop_oneof![tf, zpk, ss, family];
    let cascade =
        prop::collection::vec(single.clone(), 1..3).prop_map(|cascade| FilterSpec::Cascade { cascade });
    prop_oneof![4 => single, 1 => cascade]
}

prop_compose! {
    fn written_spec()(
        name in prop_oneof![Just(String::new()), "[ -~äß\"\\n\\t]{0,12}"],
        fast_period in (1.0..10.0f64, -12..3i32).prop_map(|(x, e)| Seconds(x * 10f64.powi(e))),
        ratio in 1usize..9,
        latency in prop::option::of(0usize..100),
        target in written_filter(),
        channels in prop::collection::vec((0.0..30.0f64, written_filter()), 1..4),
        method in prop::sample::select(Method::ALL.to_vec()),
        taps in 1usize..100,
        gamma_margin in prop::option::of(0.0..0.1f64),
        bits in prop::option::of((2..33u32).prop_map(WordLengths::Same)),
        fraction_bits in prop::option::of(-256..257i32),
        order in prop::option::of(0usize..99),
        loss in prop::option::of(0.0..9.0f64),
        uncertainty in prop::option::of((0.0..1.0f64, 0usize..2, prop::bool::ANY)),
        signal in prop::option::of((written_filter(), 0.1..9.0f64, 0usize..3, 0.01..1.0f64)),
    ) -> Spec {
        let signal = signal.map(|(filter, edge, kind, rms)| SignalSpec {
            spectrum: match kind {
                0 => SignalSpectrum::Filter(filter),
                1 => SignalSpectrum::Band(Band::up_to(Hertz(edge))),
                _ => SignalSpectrum::Band(Band { low: Hertz(0.5 * edge), high: Hertz(edge) }),
            },
            floor_db: (kind > 0 && edge > 4.0).then_some(10.0 * edge),
            rms,
        });
        let uncertainty = uncertainty.map(|(x, reference, each)| UncertaintySpec {
            delay: Some(if each { OneOrEach::Each(vec![fast_period * x; channels.len()]) } else { OneOrEach::Same(fast_period * x) }),
            cutoff: (x < 0.49 && !(method == Method::Fir && signal.is_some())).then_some(OneOrEach::Same(x)),
            reference: Some(reference),
            ..UncertaintySpec::default()
        });
        let moves = uncertainty.as_ref().is_some_and(|table| table.delays(channels.len()).iter().any(|d| d.0 > 0.0));
        let is_sized = method.has_taps() || (method == Method::H2 && order.is_none() && loss.is_none());
        let is_fir = method != Method::H2 || is_sized;
        let by_loss = method.reads("loss_db") && is_fir && fraction_bits.is_none() && ratio % 2 == 0;
        let is_reduced = method.reads("order") && !(method == Method::H2 && moves);
        let by_snr = method.reads("target_snr_db") && ratio % 3 == 0;
        Spec {
            name, fast_period, ratio, latency, target,
            fit: [vec![], vec![Fitting::Gain, Fitting::Cutoff(Cutoff::Stage(ratio))]][ratio % 2].clone(),
            full_scale: [None, Some(FullScale::Number(1e3 * fast_period.0.fract() + 0.1)), Some(FullScale::Unsigned(12))][ratio % 3],
            channels: channels.into_iter().map(|(d, filter)| ChannelSpec { noise: 1e-4 * d.fract(), bits: (d > 5.0).then_some(d as u32), jitter: fast_period * (0.1 * d.fract()), gain: 0.9 + d.floor() % 3.0 / 10.0, offset: (d % 2.0 - 1.0).min(0.0), ..ChannelSpec::new(fast_period * d, filter) }).collect(),
            signal,
            uncertainty,
            design: DesignSpec {
                method,
                taps: (is_sized && !by_snr).then_some(taps),
                target_snr_db: (is_sized && by_snr).then_some(taps as f64 / 1000.0),
                gamma_margin: gamma_margin.filter(|_| method.reads("gamma_margin")),
                bits: bits.clone().filter(|_| method.reads("bits") && is_fir),
                fraction_bits: fraction_bits.filter(|_| method.reads("bits") && is_fir && bits.is_some()),
                loss_db: by_loss.then_some(0.25),
                order: order.filter(|_| is_reduced),
                reduction_loss_db: loss.filter(|_| is_reduced && order.is_none()),
                ..DesignSpec::new(method, None)
            },
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_reads_back_equal(spec in written_spec()) {
        prop_assert_eq!(spec.check(), Ok(()));
        let toml = spec.to_toml().unwrap();
        prop_assert_eq!(&Spec::from_toml(&toml, "spec.toml").unwrap(), &spec, "{}", toml);
        let json = serde_json::to_string(&spec).unwrap();
        let data: serde_json::Value = serde_json::from_str(&json).unwrap();
        let read = Spec::from_data(data, "spec", DesignOverrides::default(), &no_models).unwrap();
        prop_assert_eq!(&read, &spec, "{}", json);
    }

    #[test]
    fn a_damaged_spec_is_refused_or_read_but_never_panics(at in 0usize..400, cut in 0usize..20, put in "[ -~\\n=\\[\\]{}é]{0,6}") {
        let start = at.min(THESIS.len());
        let end = (at + cut).min(THESIS.len());
        let damaged = format!("{}{put}{}", &THESIS[..start], &THESIS[end..]);
        if let Err(error) = Spec::from_toml(&damaged, "spec.toml") {
            prop_assert!(error.to_string().starts_with("spec.toml:"));
        }
    }
}
