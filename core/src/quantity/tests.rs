use super::*;
use proptest::prelude::*;

fn seconds(text: &str) -> Result<f64, QuantityError> {
    time(text).map(|time| time.in_seconds(Seconds(1.0)).0)
}

#[test]
fn prefixes_move_the_decimal_point_exactly() {
    for (text, value) in [
        ("10ps", 1e-11),
        ("10 ps", 1e-11),
        (" -0.1ns ", -1e-10),
        ("+7.3fs", 7.3e-15),
        ("3us", 3e-6),
        ("3\u{b5}s", 3e-6),
        ("3\u{3bc}s", 3e-6),
        (".5ms", 5e-4),
        ("5.e3 as", 5e-15),
        ("1E2s", 100.0),
        ("1e-11", 1e-11),
        ("0", 0.0),
        ("1e-400ks", 0.0),
    ] {
        assert_eq!(seconds(text), Ok(value), "{text}");
    }
    assert_eq!(frequency("1.2GHz"), Ok(Hertz(1.2e9)));
    assert_eq!(frequency("9 kHz"), Ok(Hertz(9000.0)));
    assert_eq!(frequency("50"), Ok(Hertz(50.0)));
    assert_eq!((frequency("44.1k"), rate("2.4 M")), (Ok(Hertz(44_100.0)), Ok(Hertz(2.4e6))));
    assert!(time("10k").is_err() && frequency("10m").is_err());
    assert_eq!(relative("1%"), Ok(0.01));
    assert_eq!(relative("540 ppm"), Ok(540e-6));
    assert_eq!(relative("-0.02"), Ok(-0.02));
}

#[test]
fn full_scale_is_a_number_or_codes() {
    assert_eq!(full_scale("128"), Ok(FullScale::Number(128.0)));
    assert_eq!(full_scale(" 2.5e-3 "), Ok(FullScale::Number(2.5e-3)));
    assert_eq!(full_scale("8 bits"), Ok(FullScale::Signed(8)));
    assert_eq!(full_scale("u12bits"), Ok(FullScale::Unsigned(12)));
    for wrong in ["0", "-1", "1e31", "8V", "u128", "0bits", "54bits", "2.5bits", "-8bits", "bits", ""] {
        assert!(full_scale(wrong).is_err(), "{wrong}");
    }
    for text in ["128", "8bits", "u12bits"] {
        assert_eq!(full_scale(text).unwrap().to_string(), text);
    }
}

#[test]
fn codes_are_those_of_the_fewest_bits() {
    use FullScale::{Signed, Unsigned};
    for (least, most, codes) in [
        (-128.0, 3.0, Some(Signed(8))),
        (-1.0, 127.0, Some(Signed(8))),
        (-1.0, 128.0, Some(Signed(9))),
        (0.0, 255.0, Some(Unsigned(8))),
        (0.0, 256.0, Some(Unsigned(9))),
        (2.0, 4095.0, Some(Unsigned(12))),
        (-1e300, 0.0, None),
    ] {
        assert_eq!(FullScale::of_codes(least, most), codes, "{least} {most}");
    }
    assert_eq!((Unsigned(8).middle(), Unsigned(8).amplitude()), (128.0, 128.0));
    assert_eq!(Signed(8).rails(), Some((-1.0, 127.0 / 128.0)));
}

#[test]
fn rates_are_samples_per_second_or_hertz() {
    assert_eq!(rate("1 GS/s"), Ok(Hertz(1e9)));
    assert_eq!(rate("48kHz"), Ok(Hertz(48e3)));
    assert_eq!(rate("250e6"), Ok(Hertz(250e6)));
    assert!(rate("1 GB/s").is_err());
}

#[test]
fn axes_have_prefixes() {
    assert_eq!(scale_of(500e6, "Hz"), (1e-6, "MHz".to_owned()));
    assert_eq!(scale_of(0.5, "Hz"), (1e3, "mHz".to_owned()));
    assert_eq!(scale_of(1e3, "Hz"), (1e-3, "kHz".to_owned()));
    for odd in [0.0, 1e99, f64::NAN] {
        assert_eq!(scale_of(odd, "Hz"), (1.0, "Hz".to_owned()));
    }
}

#[test]
fn people_read_six_digits_and_a_prefix() {
    for (value, text) in [
        (249_999_999.999_999_97, "250 MHz"),
        (89_651_060_300.120_67, "89.6511 GHz"),
        (999_999.9, "1 MHz"),
        (-3.0062e-9, "-3.0062 nHz"),
        (0.0, "0 Hz"),
        (12.345_678, "12.3457 Hz"),
        (1e30, "1e30 Hz"),
    ] {
        assert_eq!(readable(value, "Hz"), text);
    }
}

#[test]
fn exact_texts_read_back_to_the_same_bits() {
    assert_eq!(exact(3.006_2e-9, "s"), "3.0062 ns");
    assert_eq!(exact(14_000.0, "Hz"), "14 kHz");
    assert_eq!(exact(0.1 + 0.2, "s"), "300.00000000000004 ms");
    for power in -320..300 {
        for digits in [1.0, -9.0, 1.234_567_890_123_456_7, 4.9 / 3.0] {
            let value = digits * 10f64.powi(power);
            let read = frequency(&exact(value, "Hz")).unwrap();
            assert_eq!(read.0.to_bits(), value.to_bits(), "{value:e}");
        }
    }
}

#[test]
fn samples_are_fast_periods() {
    assert_eq!(time("0.25 samples"), Ok(WrittenTime::Samples(FastPeriods(0.25))));
    assert_eq!(time("1sample").map(|time| time.in_seconds(Seconds(4.0))), Ok(Seconds(4.0)));
}

#[test]
fn refusals_name_the_text_and_the_remedy() {
    for text in ["", "ps", "inf", "nan", "-", ".", "e3", "--1", "1.2.3s", "\u{b5}s"] {
        let error = time(text).unwrap_err();
        assert!(matches!(error, QuantityError::NoNumber { .. }), "{text}: {error}");
    }
    for text in ["10 p", "1Hz", "1e", "1e+", "3 seconds", "1 %", "1kss", "1 0ps", "1sps"] {
        let error = time(text).unwrap_err();
        assert!(matches!(error, QuantityError::Unit { .. }), "{text}: {error}");
        assert!(error.to_string().contains("such as 10ps"), "{error}");
    }
    for text in ["1e999", "1e99999999999999", "9e306Ts"] {
        assert_eq!(time(text), Err(QuantityError::TooLarge { text: text.into() }));
    }
    assert!(relative("1s").is_err() && relative("1 k%").is_err() && frequency("1ms").is_err());
}

proptest! {
    /// A double as Rust prints it is the same double with the prefix of one.
    #[test]
    fn numbers_keep_their_bits(x in any::<f64>().prop_filter("finite", |x| x.is_finite())) {
        prop_assert_eq!(seconds(&format!("{x}s")).map(f64::to_bits), Ok(x.to_bits()));
        prop_assert_eq!(seconds(&format!("{x:e}")).map(f64::to_bits), Ok(x.to_bits()));
    }

    /// Against the decimal text with the exponent written out.
    #[test]
    fn scaling_rounds_once(digits in 1u64..1_000_000_000_000, k in 0usize..13) {
        let (prefix, power) = PREFIXES[k];
        let exact: f64 = format!("{digits}e{power}").parse().unwrap();
        prop_assert_eq!(seconds(&format!("{digits}{prefix}s")), Ok(exact));
    }

    /// Any text is read or refused.
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,12}") {
        let _ = (time(&text), frequency(&text), relative(&text));
    }
}
