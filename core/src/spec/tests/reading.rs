//! Specs that are read: units, defaults and the forms of filters.

use super::*;

#[test]
fn data_without_text_read_like_a_file_and_faults_carry_their_path() {
    let text = "fast_rate = 48e3\nratio = 2\ntarget = { filter = { family = \"rc\", cutoff = \"9 kHz\" } }\n\
        channel = [{ delay = 25e-6 }, { delay = \"12.5 us\" }]\ndesign = { method = \"iir\" }";
    let data: toml::Table = text.parse().unwrap();
    let read = |data| Spec::from_data(data, "spec", DesignOverrides::default(), &no_models);
    assert_eq!(read(data.clone()).unwrap(), Spec::from_toml(text, "spec").unwrap());
    let mut wrong = data;
    wrong["channel"][1]["delay"] = toml::Value::Float(f64::INFINITY);
    let error = read(wrong).unwrap_err();
    assert_eq!((error.path(), error.location()), ("channel[1].delay", None));
    assert!(error.to_string().starts_with("spec: channel 2.delay: "), "{error}");
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
        full_scale: None,
        fit: Vec::new(),
        target: thesis.clone(),
        channels: vec![ChannelSpec::new(Seconds(1.2), thesis), ChannelSpec::new(Seconds(0.6), zpk)],
        signal: None,
        uncertainty: None,
        design: DesignSpec::new(Method::Fir, Some(22)),
    };
    assert_eq!(spec, expected);
}

#[test]
fn full_scale_is_a_number_or_codes() {
    let full_scale = |value: &str| {
        let text = thesis_with("latency = 10", &format!("latency = 10\nfull_scale = {value}"));
        read(&text).full_scale
    };
    assert_eq!(full_scale("128"), Some(FullScale::Number(128.0)));
    assert_eq!(full_scale("\"2.5\""), Some(FullScale::Number(2.5)));
    assert_eq!(full_scale("\"u12bits\""), Some(FullScale::Unsigned(12)));
    assert_eq!(read(THESIS).full_scale, None);
}

#[test]
fn what_is_fitted_is_a_list_of_names() {
    let text = thesis_with("latency = 10", "latency = 10\nfit = [\"delay\", \"cutoff:2\"]");
    let spec = read(&text);
    assert_eq!(spec.fit, [Fitting::Delay, Fitting::Cutoff(Cutoff::Stage(1))]);
    assert_eq!(read(&spec.to_toml().unwrap()), spec);
}

#[test]
fn converters_have_gains_and_offsets() {
    let text = thesis_with("delay = 1.2", "delay = 1.2\ngain = -1.01\noffset = 0.0025");
    let channels = read(&text).channels;
    let found: Vec<_> = channels.iter().map(|channel| (channel.gain, channel.offset)).collect();
    assert_eq!(found, [(-1.01, 0.0025), (1.0, 0.0)]);
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
            assert_eq!(GridTime::new(whole.in_seconds(h), h).in_fast_periods(), whole, "{rate} Hz");
        }
    }
    // So do distances of whole slow periods between long delays, where an ulp is more than 1e-11.
    let text = thesis_with("fast_period = 1.0", "fast_rate = 44_100")
        .replace("latency = 10", "")
        .replace("delay = 1.2", "delay_samples = 60000.3")
        .replace("delay = 0.6", "delay_samples = 65000.3");
    let delays = read(&text).delays();
    assert_eq!(delays[1].periods_since(delays[0], 2), Some(2500.0));
    // A fraction that is meant is kept.
    let meant = GridTime::new(Seconds(3.0 + 1e-9), Seconds(1.0));
    assert_eq!(
        (meant.in_fast_periods(), meant.periods_since(GridTime::fast_sample(3.0, Seconds(1.0)), 1)),
        (FastPeriods(3.0 + 1e-9), None)
    );
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
        passband: Passband::LowPass { cutoff: Hertz(2e4) },
        ripple_db,
        attenuation_db,
    };
    assert_eq!(
        target("{ family = 'bessel', order = 3, band = ['60 MHz', 80e6] }"),
        FilterSpec::Family {
            family: Family::Bessel,
            order: Some(3),
            passband: Passband::BandPass { low: Hertz(60e6), high: Hertz(80e6) },
            ripple_db: None,
            attenuation_db: None,
        }
    );
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

#[test]
fn half_widths_are_numbers_or_lists_and_the_reference_is_exact() {
    let table = "[uncertainty]\ndelay_samples = 0.01\ngain = [0.1, \"20 %\"]\nreference = 2\n[design]";
    let text = thesis_with("fast_period = 1.0", "fast_rate = 100.0").replace("[design]", table);
    let uncertainty = read(&text).uncertainty.unwrap();
    assert_eq!(uncertainty.delays(2), [Seconds(1e-4), Seconds(0.0)]);
    assert_eq!(uncertainty.gains(2), [0.1, 0.0]);
    assert_eq!((uncertainty.reference_channel(), uncertainty.offsets(2)), (Some(1), vec![0.0; 2]));
    let all = UncertaintySpec { reference: Some(0), ..uncertainty };
    assert_eq!(all.gains(2), [0.1, 0.2]);
}

#[test]
fn half_widths_have_units() {
    let table = "[uncertainty]\ndelay = [0.0, \"10 ms\"]\ncutoff = \"2%\"\n[design]";
    let uncertainty = read(&THESIS.replace("[design]", table)).uncertainty.unwrap();
    assert_eq!(uncertainty.delay, Some(OneOrEach::Each(vec![Seconds(0.0), Seconds(0.01)])));
    assert_eq!(uncertainty.cutoff, Some(OneOrEach::Same(0.02)));
}

#[test]
fn the_signal_is_a_band_or_a_filter() {
    let signal =
        |table: &str| read(&THESIS.replace("[design]", &format!("[signal]\n{table}\n[design]"))).signal;
    let band = |low, high| Band { low: Hertz(low), high: Hertz(high) };
    assert_eq!(read(THESIS).signal, None);
    assert_eq!(signal("band = \"0.2 Hz\""), Some(SignalSpec::in_band(band(0.0, 0.2))));
    let told = SignalSpec { floor_db: Some(60.0), rms: 0.1, ..SignalSpec::in_band(band(0.6, 0.9)) };
    assert_eq!(signal("band = [0.6, \"900 mHz\"]\nfloor_db = 60\nrms = 0.1"), Some(told));
    let filter = FilterSpec::TransferFunction { num: vec![0.01, 1.0], den: vec![1.0, 1.0] };
    let spectrum = SignalSpectrum::Filter(filter);
    assert_eq!(
        signal("filter = { num = [0.01, 1.0], den = [1.0, 1.0] }"),
        Some(SignalSpec { spectrum, floor_db: None, rms: USUAL_RMS })
    );
}

#[test]
fn converters_have_bits_and_jitter() {
    let text = THESIS.replacen("delay = 1.2", "delay = 1.2\nnoise = 1e-3\nbits = 12\njitter = \"10 ms\"", 1);
    let spec = read(&text);
    assert_eq!((spec.channels[0].bits, spec.channels[0].jitter), (Some(12), Seconds(0.01)));
    // A step of full scale +-1 is 2^-11.
    let rounding = 2f64.powi(-11) / 12f64.sqrt();
    assert!((spec.channels[0].sample_noise() / 1e-3_f64.hypot(rounding) - 1.0).abs() < 1e-15);
    assert_eq!((spec.channels[1].bits, spec.channels[1].jitter), (None, Seconds(0.0)));
    assert_eq!(read(&spec.to_toml().unwrap()), spec);
}
