//! Specs that are read, specs that are refused with location and message, and round trips.

use proptest::prelude::*;

use super::*;

const THESIS: &str = r#"
name = "thesis example, FIR"
fast_period = 1.0          # h in seconds
ratio = 2                  # M
latency = 10

[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }

[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
filter = { zeros = [], poles = [[-0.5, 0.0], [-0.5, 0.0]], gain = 0.25 }

[design]
method = "fir"
taps = 22
"#;

fn read(text: &str) -> Spec {
    Spec::from_toml(text, "spec.toml").unwrap_or_else(|error| panic!("{error}"))
}

/// The thesis example with one piece of text replaced.
fn thesis_with(from: &str, to: &str) -> String {
    assert!(THESIS.contains(from), "{from:?} is not in the example");
    THESIS.replacen(from, to, 1)
}

fn thesis_with_target(filter: &str) -> String {
    thesis_with("{ num = [0.25], den = [1.0, 1.0, 0.25] }", filter)
}

#[test]
fn the_thesis_example_is_read() {
    let spec = read(THESIS);
    let thesis = FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] };
    let zpk = FilterSpec::ZeroPoleGain { zeros: vec![], poles: vec![[-0.5, 0.0]; 2], gain: 0.25 };
    let expected = Spec {
        name: "thesis example, FIR".into(),
        fast_period: Seconds(1.0),
        ratio: 2,
        latency: Some(10),
        target: thesis.clone(),
        channels: vec![
            ChannelSpec { delay: Seconds(1.2), filter: thesis, noise: 0.0 },
            ChannelSpec { delay: Seconds(0.6), filter: zpk, noise: 0.0 },
        ],
        design: DesignSpec::new(Method::Fir, Some(22)),
    };
    assert_eq!(spec, expected);
}

#[test]
fn rates_and_sample_delays_become_seconds() {
    let text = thesis_with("fast_period = 1.0", "fast_rate = 96_000")
        .replace("delay = 1.2", "delay_samples = 3")
        .replace("delay = 0.6", "delay = 1e-5");
    let spec = read(&text);
    assert_eq!(spec.fast_period, Seconds(1.0 / 96e3));
    assert_eq!(spec.channels[0].delay, Seconds(3.0 / 96e3));
    assert_eq!(spec.delays_in_fast_periods()[0], FastPeriods(3.0));
    assert!((spec.delays_in_fast_periods()[1].0 - 0.96).abs() < 1e-15);
}

#[test]
fn whole_delays_stay_whole_at_every_rate() {
    for rate in [1.0, 3.0, 10.0, 44.1e3, 96e3, 1e9, 7.77e11] {
        for samples in 0..200 {
            let (h, whole) = (Hertz(rate).period(), FastPeriods(f64::from(samples)));
            assert_eq!(delay_in_fast_periods(whole.in_seconds(h), h), whole, "{rate} Hz");
        }
    }
    // A fraction that is meant is kept.
    assert_eq!(delay_in_fast_periods(Seconds(3.0 + 1e-9), Seconds(1.0)), FastPeriods(3.0 + 1e-9));
}

#[test]
fn latency_name_and_design_may_be_left_out() {
    let end = THESIS.find("[design]").unwrap();
    let spec = read(&THESIS[..end].replace("latency = 10", "").replace("name = \"thesis example, FIR\"", ""));
    assert_eq!((spec.latency, spec.name.as_str()), (None, ""));
    assert_eq!(spec.design, DesignSpec::new(Method::Iir, None));
    assert_eq!(read(&thesis_with("method = \"fir\"", "")).design.method, Method::Fir);
}

#[test]
fn every_filter_form_is_read() {
    let target = |text: &str| read(&thesis_with_target(text)).target;
    let family = |family, order, ripple_db, attenuation_db| FilterSpec::Family {
        family,
        order,
        cutoff: Hertz(2e4),
        ripple_db,
        attenuation_db,
    };
    assert_eq!(
        target(r#"{ a = [[-1, 2.5], [0, -3]], b = [[0], [1]], c = [[1, 0]] }"#),
        FilterSpec::StateSpace {
            a: vec![vec![-1.0, 2.5], vec![0.0, -3.0]],
            b: vec![vec![0.0], vec![1.0]],
            c: vec![vec![1.0, 0.0]],
        }
    );
    assert_eq!(
        target(r#"{ poles = [-2, [-1, 3.5], [-1.0, -3.5]], gain = 7 }"#),
        FilterSpec::ZeroPoleGain {
            zeros: vec![],
            poles: vec![[-2.0, 0.0], [-1.0, 3.5], [-1.0, -3.5]],
            gain: 7.0
        }
    );
    for (text, expected) in [
        ("family = 'butterworth', order = 4", family(Family::Butterworth, Some(4), None, None)),
        ("family = 'bessel', order = 5", family(Family::Bessel, Some(5), None, None)),
        (
            "family = 'chebyshev1', order = 4, ripple_db = 0.5",
            family(Family::Chebyshev1, Some(4), Some(0.5), None),
        ),
        (
            "family = 'chebyshev2', order = 5, attenuation_db = 60",
            family(Family::Chebyshev2, Some(5), None, Some(60.0)),
        ),
        (
            "family = 'elliptic', order = 3, ripple_db = 1, attenuation_db = 60",
            family(Family::Elliptic, Some(3), Some(1.0), Some(60.0)),
        ),
        ("family = 'rc'", family(Family::Rc, None, None, None)),
        ("family = 'rc', order = 1", family(Family::Rc, Some(1), None, None)),
    ] {
        assert_eq!(target(&format!("{{ {text}, cutoff = 20e3 }}")), expected);
    }
    let cascade = target(
        "{ cascade = [ { family = 'elliptic', order = 4, cutoff = 1.0, ripple_db = 1, attenuation_db = 60 },
                       { family = 'rc', cutoff = 50.0 } ] }",
    );
    assert_eq!(cascade.degrees(), (4, 5));
    // A table of its own is the same as an inline table.
    let table = thesis_with(
        "[target]\nfilter = { num = [0.25], den = [1.0, 1.0, 0.25] }",
        "[target.filter]\nnum = [0.25]\nden = [1, 1, 0.25]",
    );
    assert_eq!(read(&table), read(THESIS));
}

/// The whole message for the changed example; panics if it reads.
fn message(text: &str) -> String {
    match Spec::from_toml(text, "spec.toml") {
        Ok(spec) => panic!("this must not read: {text}\n{spec:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn an_unknown_key_is_named_with_line_neighbour_and_all_known_keys() {
    let text = message(&thesis_with("delay = 1.2", "dealy = 1.2"));
    let expected = "spec.toml:11:1: channel[0]: unknown key \"dealy\", did you mean \"delay\"?; the keys here are delay, \
                    delay_samples, filter, noise\n   |\n11 | dealy = 1.2\n   | ^^^^^";
    assert_eq!(text, expected);
}

#[test]
fn every_mistake_has_its_line_and_its_message() {
    let target = thesis_with_target;
    for (text, line, words) in [
        // Top level.
        (
            thesis_with("fast_period = 1.0", "fast_period = 1.0\nfast_rate = 1.0"),
            4,
            "both fast_period and fast_rate",
        ),
        (
            thesis_with("fast_period = 1.0", ""),
            1,
            "the key fast_period is missing; give fast_period in seconds or fast_rate",
        ),
        (thesis_with("fast_period = 1.0", "fast_period = 0"), 3, "0 s is out of range"),
        (thesis_with("fast_period = 1.0", "fast_period = -1e-6"), 3, "must be positive"),
        (thesis_with("fast_period = 1.0", "fast_period = nan"), 3, "must be finite"),
        (thesis_with("fast_period = 1.0", "fast_period = 1e999"), 3, "must be finite"),
        (thesis_with("fast_period = 1.0", "fast_rate = inf"), 3, "must be finite"),
        (thesis_with("fast_period = 1.0", "fast_rate = 0.0"), 3, "0 Hz is out of range"),
        (thesis_with("fast_period = 1.0", "fast_period = 1e-300"), 3, "between 1e-100 and 1e100"),
        (thesis_with("fast_period = 1.0", "fast_period = \"1 us\""), 3, "expected a number, found a text"),
        (thesis_with("ratio = 2", ""), 1, "the key ratio is missing; give M"),
        (thesis_with("ratio = 2", "ratio = 0"), 4, "must be 1 to 1024"),
        (thesis_with("ratio = 2", "ratio = 1_000_000"), 4, "must be 1 to 1024"),
        (thesis_with("ratio = 2", "ratio = -2"), 4, "whole number, zero or more"),
        (thesis_with("ratio = 2", "ratio = 2.0"), 4, "without point"),
        (thesis_with("ratio = 2", "ratio = true"), 4, "found true or false"),
        (thesis_with("ratio = 2", "ratio = 1979-05-27"), 4, "found a date"),
        (thesis_with("ratio = 2", "ratio = 2\nratio = 3"), 5, "duplicate key"),
        (thesis_with("ratio = 2", "ratio = 99999999999999999999"), 4, "whole number"),
        (thesis_with("latency = 10", "latency = 1e3"), 5, "without point"),
        (thesis_with("latency = 10", "latency = 70000"), 5, "at most 65536"),
        (thesis_with("name = \"thesis example, FIR\"", "name = 3"), 2, "expected a text"),
        (thesis_with("ratio = 2", "Ratio = 2"), 4, "did you mean \"ratio\""),
        (thesis_with("ratio = 2", "ratio = = 2"), 4, "spec.toml:4:"),
        ("".into(), 1, "missing"),
        // Target and channels.
        (thesis_with("[target]", "[traget]"), 7, "did you mean \"target\""),
        (thesis_with("[target]\nfilter", "[target]\nfliter"), 8, "did you mean \"filter\""),
        (THESIS.replace("[[channel]]", "[[channels]]"), 10, "did you mean \"channel\""),
        (THESIS.split("[[channel]]").next().unwrap().into(), 1, "the key channel is missing"),
        (
            THESIS.split("[[channel]]").next().unwrap().replace("latency", "channel = []\nlatency"),
            5,
            "1 to 1024 channels",
        ),
        (THESIS.split("[[channel]]").next().unwrap().to_owned() + "[channel]\ndelay = 1", 10, "[[channel]]"),
        (thesis_with("delay = 1.2", "delay = 1.2\ndelay_samples = 1.2"), 12, "both delay and delay_samples"),
        (thesis_with("delay = 1.2", ""), 10, "the key delay is missing"),
        (thesis_with("delay = 1.2", "delay = -0.1"), 11, "cannot be negative; add the same amount"),
        (thesis_with("delay = 1.2", "delay = nan"), 11, "must be finite"),
        (thesis_with("delay = 1.2", "delay = 1e6"), 11, "check its unit"),
        (thesis_with("delay = 1.2", "delay_samples = -3"), 11, "-3 fast periods is out of range"),
        (thesis_with("delay = 1.2", "delay = [1.2]"), 11, "expected a number, found a list"),
        // Filters.
        (target("{ }"), 8, "the filter is empty"),
        (target("3"), 8, "expected a table"),
        (target("{ num = [1.0] }"), 8, "the key den is missing"),
        (target("{ den = [1.0, 1.0] }"), 8, "the key num is missing"),
        (target("{ num = [1.0], den = [1.0, 2.0], gain = 3.0 }"), 8, "both num and gain are given"),
        (target("{ num = [], den = [1.0, 2.0] }"), 8, "num is empty"),
        (target("{ num = [0, 0], den = [1.0, 2.0] }"), 8, "the filter is zero"),
        (target("{ num = [1], den = [0, 0.0] }"), 8, "den is zero"),
        (target("{ num = [1], den = [0, 3.0] }"), 8, "no pole"),
        (target("{ num = [1, 0], den = [1, 3.0] }"), 8, "not strictly proper: with 1 zeros against 1 poles"),
        (target("{ num = [1], den = [1, inf] }"), 8, "den[1]: inf"),
        (target("{ num = [1], den = [1, \"2\"] }"), 8, "den[1]: expected a number, found a text"),
        (target("{ num = 1, den = [1, 2] }"), 8, "expected a list of numbers"),
        (target("{ poles = [[-1, 0]] }"), 8, "the key gain is missing"),
        (target("{ zeros = [[1, 0]], gain = 1 }"), 8, "the key poles is missing"),
        (target("{ poles = [[-1, 0, 0]], gain = 1 }"), 8, "expected a pair [re, im]"),
        (target("{ poles = [[-1, nan]], gain = 1 }"), 8, "must be finite"),
        (target("{ poles = [], gain = 1 }"), 8, "no pole"),
        (target("{ poles = [-1], gain = 0.0 }"), 8, "the filter is zero because gain is"),
        (target("{ a = [[-1, 0]], b = [[1]], c = [[1]] }"), 8, "a is 1 x 2"),
        (
            target("{ a = [[-1]], b = [[1, 2]], c = [[1]] }"),
            8,
            "b is 1 x 2, but a filter with one input, one output and 1 states needs 1 x 1",
        ),
        (target("{ a = [[-1]], b = [[1]], c = [[1], [2]] }"), 8, "c is 2 x 1"),
        (target("{ a = [[-1]], b = [[0]], c = [[1]] }"), 8, "zero because b is"),
        (target("{ a = [[-1]], b = [[1]], c = [[1]], d = [[0]] }"), 8, "unknown key \"d\"; the keys here"),
        (target("{ a = [[-1], b = 1 }"), 8, "spec.toml:8:"),
        (target("{ family = 'butterwort', order = 3, cutoff = 1 }"), 8, "did you mean \"butterworth\""),
        (
            target("{ family = 'gauss', order = 3, cutoff = 1 }"),
            8,
            "unknown filter family \"gauss\"; choose one of butterworth",
        ),
        (
            target("{ family = 'butterworth', cutoff = 1 }"),
            8,
            "a butterworth filter needs order (the number of poles)",
        ),
        (
            target("{ family = 'butterworth', order = 3 }"),
            8,
            "the key cutoff is missing; give the cutoff in hertz",
        ),
        (target("{ family = 'butterworth', order = 0, cutoff = 1 }"), 8, "no pole"),
        (target("{ family = 'butterworth', order = 33, cutoff = 1 }"), 8, "33 poles, but at most 32"),
        (target("{ family = 'butterworth', order = 3, cutoff = -1 }"), 8, "cutoff = -1 Hz"),
        (
            target("{ family = 'butterworth', order = 3, cutoff = 1, ripple_db = 1 }"),
            8,
            "ripple_db = 1 has no meaning for a butterworth",
        ),
        (target("{ family = 'rc', order = 2, cutoff = 1 }"), 8, "an rc filter has one pole"),
        (
            target("{ family = 'chebyshev1', order = 3, cutoff = 1 }"),
            8,
            "a chebyshev1 filter needs ripple_db",
        ),
        (
            target("{ family = 'chebyshev1', order = 3, cutoff = 1, ripple_db = 0 }"),
            8,
            "between 1e-6 and 300 dB",
        ),
        (
            target("{ family = 'chebyshev2', order = 3, cutoff = 1, ripple_db = 2 }"),
            8,
            "no meaning for a chebyshev2",
        ),
        (
            target("{ family = 'chebyshev2', order = 4, cutoff = 1, attenuation_db = 40 }"),
            8,
            "add the pole of the sampling switch",
        ),
        (
            target("{ family = 'elliptic', order = 3, cutoff = 1, ripple_db = 50, attenuation_db = 40 }"),
            8,
            "must exceed the pass-band ripple",
        ),
        (target("{ cascade = [] }"), 8, "list the stages"),
        (target("{ cascade = [{ num = [1], den = [1] }] }"), 8, "no pole"),
        (
            target("{ cascade = [{ num = [1, 0, 0], den = [1, 2] }, { family = 'rc', cutoff = 1 }] }"),
            8,
            "cascade[0]",
        ),
        (
            target("{ cascade = [{ cascade = [{ family = 'rc', cutoff = 1 }] }] }"),
            8,
            "cannot hold another cascade",
        ),
        // Design.
        (thesis_with("method = \"fir\"", "method = \"fri\""), 17, "did you mean \"fir\""),
        (
            thesis_with("method = \"fir\"", "method = \"kalman\""),
            17,
            "choose one of fir, iir, h2, sinc, separation",
        ),
        (thesis_with("taps = 22", ""), 16, "the method fir needs the number of taps"),
        (thesis_with("taps = 22", "taps = 0"), 18, "1 to 65536 taps"),
        (thesis_with("taps = 22", "taps = 65537"), 18, "1 to 65536 taps"),
        (thesis_with("taps = 22", "taps = 10_000"), 18, "taps times channels is at most 16384"),
        (thesis_with("taps = 22", "taps = 22\ngamma_margin = -0.1"), 19, "gamma_margin is the share"),
        (thesis_with("taps = 22", "taps = 22\nsolver = 'lp'"), 19, "choose one of sampled, kyp"),
        (thesis_with("taps = 22", "taps = 22\nsolver = 'kyp'\ngamma_margin = 0.1"), 20, "gamma_margin"),
        (
            thesis_with("method = \"fir\"\ntaps = 22", "method = \"iir\"\nsolver = 'kyp'"),
            18,
            "choose the method fir",
        ),
        (thesis_with("taps = 22", "taps = 22\nbits = 1"), 19, "2 to 32 bits"),
        (thesis_with("taps = 22", "taps = 22\nbits = 12.5"), 19, "whole number"),
        (thesis_with("taps = 22", "taps = 22\nbits = 'many'"), 19, "whole number"),
        (thesis_with("taps = 22", "taps = 22\nbits = [8, 8]"), 19, "each of the 22 taps"),
        (
            thesis_with("taps = 22", "taps = 22\nbits = []"),
            19,
            "list of bits is empty; give one entry for each of the 22",
        ),
        (thesis_with("taps = 22", "taps = 4\nbits = [1, 0, 1, 0]"), 19, "at least one tap needs 2 bits"),
        (thesis_with("taps = 22", "taps = 22\nbits = 8\nfraction_bits = 300"), 20, "from -256 to 256"),
        (thesis_with("taps = 22", "taps = 22\nfraction_bits = 7"), 16, "the key bits is missing"),
        (
            thesis_with("method = \"fir\"\ntaps = 22", "method = \"iir\"\nbits = 8"),
            18,
            "choose the method fir",
        ),
        (thesis_with("method = \"fir\"", "method = \"iir\""), 18, "taps has no meaning for the method iir"),
        (thesis_with("taps = 22", "tap = 22"), 18, "did you mean \"taps\""),
        (thesis_with("[design]", "[[design]]"), 16, "expected a table"),
    ] {
        let message = message(&text);
        assert!(message.contains(words), "expected {words:?} in\n{message}");
        assert!(message.starts_with(&format!("spec.toml:{line}:")), "expected line {line} in\n{message}");
    }
}

#[test]
fn carets_stand_under_the_value_even_after_tabs_and_wide_letters() {
    let text = thesis_with("ratio = 2 ", "\tratio = 0").replace("thesis example", "größer – 例");
    let shown = message(&text);
    assert!(shown.ends_with("4 |  ratio = 0                 # M\n  |          ^"), "{shown}");
    let long = thesis_with("den = [1.0,", &format!("den = [{} x,", "1.0, ".repeat(5000)));
    assert!(message(&long).chars().count() < 700);
}

#[test]
fn a_location_outside_the_text_is_clipped_to_it() {
    for (start, end) in [(0, 0), (0, 99), (99, 120), (3, 2)] {
        let location = Location::find("añb\nc", std::ops::Range { start, end });
        assert!(location.line >= 1 && location.column >= 1 && location.width >= 1);
    }
    assert_eq!(
        Location::find("a\r\nbc\r\n", 4..5),
        Location { line: 2, column: 2, width: 1, text: "bc".into() }
    );
}

#[test]
fn the_command_line_overrides_the_design() {
    let with =
        |text: &str, overrides| Spec::from_toml_with(text, "spec.toml", overrides).map(|spec| spec.design);
    let method = |method| DesignOverrides { method: Some(method), ..Default::default() };
    let no_taps = thesis_with("taps = 22", "");
    let taps = DesignOverrides { taps: Some(7), ..Default::default() };
    assert_eq!(with(&no_taps, taps.clone()).unwrap().taps, Some(7));
    assert_eq!(with(THESIS, taps).unwrap().taps, Some(7));
    // The file's taps go with its method, not with another that has none.
    assert_eq!(with(THESIS, method(Method::H2)), Ok(DesignSpec::new(Method::H2, None)));
    assert_eq!(with(THESIS, method(Method::Sinc)).unwrap().taps, Some(22));
    let both = DesignOverrides { method: Some(Method::Iir), taps: Some(5), ..Default::default() };
    assert!(matches!(
        with(THESIS, both).unwrap_err().problem(),
        SpecProblem::NeedlessKey { key: "taps", .. }
    ));

    let wanted = |reduction| DesignOverrides { reduction: Some(reduction), ..Default::default() };
    let iir = thesis_with("method = \"fir\"", "method = \"iir\"\norder = 7").replace("taps = 22", "");
    assert_eq!(with(&iir, DesignOverrides::default()).unwrap().reduction, Some(Reduction::Order(7)));
    let loss = Reduction::Loss(0.5);
    assert_eq!(with(&iir, wanted(loss)).unwrap().reduction, Some(loss));
    assert_eq!(with(&iir, method(Method::H2)).unwrap().reduction, Some(Reduction::Order(7)));
    assert_eq!(with(&iir, method(Method::Separation)).unwrap().reduction, None);
    assert!(matches!(
        with(THESIS, wanted(loss)).unwrap_err().problem(),
        SpecProblem::NeedlessKey { key: "reduction_loss_db", .. }
    ));

    let design = read(THESIS).design;
    assert_eq!(design.with_method(Method::Iir, 2).unwrap().taps, None);
    assert_eq!(design.with_taps(9, 2).unwrap(), DesignSpec::new(Method::Fir, Some(9)));
    assert!(design.with_taps(0, 2).is_err());
    let iir = design.with_method(Method::Iir, 2).unwrap();
    assert!(iir.with_taps(9, 2).is_err() && iir.with_method(Method::Fir, 2).is_err());
}

#[test]
fn specs_in_memory_are_checked_too() {
    let good = read(THESIS);
    assert_eq!(good.check(), Ok(()));
    let bad = [
        Spec { fast_period: Seconds(f64::NAN), ..good.clone() },
        Spec { ratio: 0, ..good.clone() },
        Spec { channels: vec![], ..good.clone() },
        Spec { target: FilterSpec::Cascade { cascade: vec![] }, ..good.clone() },
        Spec { design: DesignSpec { taps: None, ..good.design.clone() }, ..good.clone() },
    ];
    for spec in bad {
        assert!(spec.check().is_err() && spec.to_toml().is_err(), "{spec:?}");
    }
}

#[test]
fn serde_reads_a_filter_with_a_message_about_keys() {
    let error =
        serde_json::from_str::<FilterSpec>(r#"{ "num": [1], "den": [1, 2], "gian": 3 }"#).unwrap_err();
    assert!(error.to_string().contains("unknown key \"gian\", did you mean \"gain\"?"), "{error}");
    let null = serde_json::from_str::<FilterSpec>(r#"{ "num": [null], "den": [1, 2] }"#).unwrap_err();
    assert!(null.to_string().contains("num[0]: expected a number, found null"), "{null}");
    let twice =
        serde_json::from_str::<FilterSpec>(r#"{ "num": [1], "num": [2], "den": [1, 2] }"#).unwrap_err();
    assert!(twice.to_string().contains("given twice"), "{twice}");
}

/// Numbers of every size, with the awkward ones among them.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        (1.0..10.0f64, -30..30i32).prop_map(|(x, e)| x * 10f64.powi(e)),
        Just(0.1),
        Just(1.0 / 3.0),
        Just(f64::MIN_POSITIVE),
        Just(5e-324),
        Just(1.7976931348623157e308),
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
                cutoff: Hertz(cutoff),
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
        solver in prop::option::of(prop::sample::select(Solver::ALL.to_vec())),
        bits in prop::option::of((2..33u32).prop_map(WordLengths::Same)),
        fraction_bits in prop::option::of(-256..257i32),
        reduction in prop::option::of(prop_oneof![
            (0usize..99).prop_map(Reduction::Order), (0.0..9.0f64).prop_map(Reduction::Loss)
        ]),
    ) -> Spec {
        Spec {
            name, fast_period, ratio, latency, target,
            channels: channels.into_iter().map(|(d, filter)| ChannelSpec { delay: fast_period * d, filter, noise: 1e-4 * d.fract() }).collect(),
            design: DesignSpec {
                method,
                taps: method.has_taps().then_some(taps),
                gamma_margin: gamma_margin.filter(|_| method.has_gamma_margin() && solver != Some(Solver::Kyp)),
                solver: solver.filter(|_| method.has_solver()),
                bits: bits.clone().filter(|_| method.has_bits()),
                fraction_bits: fraction_bits.filter(|_| method.has_bits() && bits.is_some()),
                reduction: reduction.filter(|_| method.has_states()),
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
        prop_assert_eq!(&serde_json::from_str::<Spec>(&json).unwrap(), &spec, "{}", json);
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
