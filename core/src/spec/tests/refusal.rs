//! Specs that are refused, with location and message.

use super::*;

/// The whole message for the changed example; panics if it reads.
fn message(text: &str) -> String {
    match Spec::from_toml(text, "spec.toml") {
        Ok(spec) => panic!("this must not read: {text}\n{spec:?}"),
        Err(error) => error.to_string(),
    }
}

/// Refused at the given line with a message that has `words`.
fn refused(text: &str, line: usize, words: &str) {
    let message = message(text);
    assert!(message.contains(words), "expected {words:?} in\n{message}");
    assert!(message.starts_with(&format!("spec.toml:{line}:")), "expected line {line} in\n{message}");
}

#[test]
fn an_unknown_key_is_named_with_line_neighbour_and_all_known_keys() {
    let text = message(&thesis_with("delay = 1.2", "dealy = 1.2"));
    let expected = "spec.toml:11:1: channel 1: unknown key \"dealy\", did you mean \"delay\"?; the keys here are delay, \
                    delay_samples, rate, filter, noise, bits, jitter, gain, offset, nonlinearity\n   |\n11 | dealy = 1.2\n   | ^^^^^";
    assert_eq!(text, expected);
}

/// A key in the wrong table is named with the right one, and so is a single table of the channels.
#[test]
fn keys_and_tables_in_the_wrong_place_are_sent_to_the_right_one() {
    let design = thesis_with("latency = 10", "").replace("[design]", "[design]\nlatency = 10");
    let line = 1 + design[..design.find("latency").unwrap()].matches('\n').count();
    let place = "\"latency\", which belongs at the top of the file, before the first table; the keys";
    refused(&design, line, place);
    let bare = thesis_with("[target]\nfilter", "filter");
    let place = "\"filter\", which belongs under [target], under [[channel]] or under [signal]; the keys";
    refused(&bare, 7, place);
    refused(&thesis_with("[target]", "[filter]"), 7, "which belongs under [target]");
    refused(&thesis_with("ratio = 2", "ratio = 2\ntaps = 8"), 5, "which belongs under [design]");
    refused(&thesis_with("ratio = 2", "ratio = 2\ncutoff = 8"), 5, "or in a filter, filter = { .. }");
    let single = "head each with two brackets, [[channel]]";
    let twice = THESIS.replace("[[channel]]", "[channel]");
    let second = 1 + twice[..twice.rfind("[channel]").unwrap()].matches('\n').count();
    refused(&twice, second, single);
    let once = &twice[..twice.rfind("[channel]").unwrap()];
    assert!(message(once).contains(single), "{}", message(once));
}

#[test]
fn every_mistake_has_its_line_and_its_message() {
    for (from, to, line, words) in [
        // Top level.
        ("fast_period = 1.0", "fast_period = 1.0\nfast_rate = 1.0", 4, "both fast_period and fast_rate"),
        ("fast_period = 1.0", "", 1, "the key fast_period is missing; give fast_period"),
        ("fast_period = 1.0", "fast_period = 0", 3, "0 s is out of range"),
        ("fast_period = 1.0", "fast_period = -1e-6", 3, "must be positive"),
        ("fast_period = 1.0", "fast_period = nan", 3, "NaN s is out of range"),
        ("fast_period = 1.0", "fast_period = 1e999", 3, "number overflowed"),
        ("fast_period = 1.0", "fast_rate = inf", 3, "inf Hz is out of range"),
        ("fast_period = 1.0", "fast_rate = 0.0", 3, "0 Hz is out of range"),
        ("fast_period = 1.0", "fast_period = 1e-300", 3, "between 1e-100 and 1e100"),
        ("fast_period = 1.0", "fast_period = \"1 Hz\"", 3, "the unit \"Hz\", which is not known here"),
        ("fast_period = 1.0", "fast_period = \"1 us\"", 11, "1.2 s is out of range: it is 1200000"),
        ("fast_period = 1.0", "fast_period = true", 3, "expected a number, or a text with a number"),
        ("ratio = 2", "", 1, "the key ratio is missing; give M"),
        ("ratio = 2", "ratio = 0", 4, "must be 1 to 1024"),
        ("ratio = 2", "ratio = 1_000_000", 4, "must be 1 to 1024"),
        ("ratio = 2", "ratio = -2", 4, "whole number, zero or more"),
        ("ratio = 2", "ratio = 2.0", 4, "without point"),
        ("ratio = 2", "ratio = true", 4, "found true"),
        ("ratio = 2", "ratio = 1979-05-27", 4, "expected a whole number"),
        ("ratio = 2", "ratio = 2\nratio = 3", 5, "duplicate key"),
        ("ratio = 2", "ratio = 99999999999999999999", 4, "whole number"),
        ("latency = 10", "latency = 1e3", 5, "without point"),
        ("latency = 10", "latency = 70000", 5, "at most 65536"),
        ("name = \"thesis example, FIR\"", "name = 3", 2, "expected a text"),
        ("ratio = 2", "Ratio = 2", 4, "did you mean \"ratio\""),
        ("ratio = 2", "ratio = = 2", 4, "spec.toml:4:"),
        // Target and channels.
        ("[target]", "[traget]", 7, "did you mean \"target\""),
        ("[target]\nfilter", "[target]\nfliter", 8, "did you mean \"filter\""),
        ("delay = 1.2", "delay = 1.2\ndelay_samples = 1.2", 12, "both delay and delay_samples"),
        ("delay = 1.2", "", 10, "the key delay is missing"),
        ("delay = 1.2", "delay = nan", 11, "NaN s is out of range"),
        ("delay = 1.2", "delay = 1e6", 11, "check its unit"),
        (
            "delay = 1.2",
            "delay_samples = -3e6",
            11,
            "-3000000 s is out of range: it is -3000000 fast periods",
        ),
        ("delay = 1.2", "delay = 1.2\ngain = 0", 12, "gain is the factor of the converter's samples"),
        ("delay = 1.2", "delay = 1.2\ngain = -1e7", 12, "1e-6 to 1e6 in size"),
        ("delay = 1.2", "delay = 1.2\ngain = inf", 12, "inf (factor) is out of range"),
        ("delay = 1.2", "delay = 1.2\noffset = 5", 12, "5 steps of a 12-bit converter are 5 / 2048"),
        ("delay = 1.2", "delay = 1.2\noffest = 0.1", 12, "did you mean \"offset\""),
        ("delay = 1.2", "delay = [1.2]", 11, "expected a number, or a text with a number"),
        // Uncertainty.
        ("[design]", "[uncertainty]\ndelay = -0.1\n[design]", 17, "zero or more"),
        ("[design]", "[uncertainty]\ndelay_samples = 2e3\n[design]", 17, "at most 1024 fast periods"),
        ("[design]", "[uncertainty]\ndelay = 1\ndelay_samples = 1\n[design]", 18, "the same meaning"),
        ("[design]", "[uncertainty]\ngain = [0.1]\n[design]", 17, "one for each of the 2"),
        ("[design]", "[uncertainty]\ncutoff = 0.5\n[design]", 17, "0.01 is one per cent"),
        ("[design]", "[uncertainty]\ngain = [0, 0.5]\n[design]", 17, "at most 0.49"),
        ("[design]", "[uncertainty]\nreference = 3\n[design]", 17, "one of the channels 1 to 2"),
        ("[design]", "[uncertainty]\ndely = 0.1\n[design]", 17, "did you mean \"delay\""),
        // Design.
        ("method = \"fir\"", "method = \"fri\"", 17, "did you mean \"fir\""),
        ("method = \"fir\"", "method = \"kalman\"", 17, "the names here are fir, iir, h2, sinc, separation"),
        ("taps = 22", "taps = 22\ntarget_snr_db = 90", 19, "the SNR decides how many taps there are"),
        ("taps = 22", "target_snr_db = -1", 18, "target_snr_db is the ratio of the signal"),
        ("\"fir\"\ntaps = 22", "\"iir\"\ntarget_snr_db = 90", 18, "fir or h2"),
        ("\"fir\"\ntaps = 22", "\"h2\"\ntaps = 22\norder = 4", 19, "h2 with taps"),
        ("taps = 22", "taps = 0", 18, "1 to 65536 taps"),
        ("taps = 22", "taps = 65537", 18, "1 to 65536 taps"),
        ("taps = 22", "taps = 10_000", 18, "taps times channels is at most 8192"),
        ("taps = 22", "taps = 22\ngamma_margin = -0.1", 19, "gamma_margin is the share"),
        ("method = \"fir\"\ntaps = 22", "method = \"iir\"\nbits = 12", 18, "choose the method fir"),
        ("taps = 22", "taps = 22\nbits = 1", 19, "2 to 32 bits"),
        ("taps = 22", "taps = 22\nbits = 12.5", 19, "whole number"),
        ("taps = 22", "taps = 22\nbits = 'many'", 19, "whole number"),
        ("taps = 22", "taps = 22\nbits = [8, 8]", 19, "each of the 22 taps"),
        ("taps = 22", "taps = 22\nbits = []", 19, "list of bits is empty; give one entry for each of the 22"),
        ("taps = 22", "taps = 4\nbits = [1, 0, 1, 0]", 19, "at least one tap needs 2 bits"),
        ("taps = 22", "taps = 22\nbits = 8\nfraction_bits = 300", 20, "from -256 to 256"),
        ("taps = 22", "taps = 22\nfraction_bits = 7", 19, "the key bits is missing"),
        ("method = \"fir\"\ntaps = 22", "method = \"iir\"\nbits = 8", 18, "choose the method fir"),
        ("method = \"fir\"", "method = \"iir\"", 18, "taps has no meaning for the method iir"),
        ("taps = 22", "tap = 22", 18, "did you mean \"taps\""),
        ("[design]", "[[design]]", 16, "expected a table"),
        ("latency = 10", "full_scale = 0", 5, "write the number that is full scale"),
        ("latency = 10", "full_scale = '8V'", 5, "\"V\""),
        ("latency = 10", "fit = ['delay', 'cutoff:0']", 5, "delay, gain, offset and cutoff can be fitted"),
        ("latency = 10", "fit = ['cutoff', 'cutoff:2']", 5, "cutoff and cutoff:2 have one factor for each"),
        ("latency = 10", "fit = 'delay'", 5, "expected a list, found the text \"delay\""),
    ] {
        refused(&thesis_with(from, to), line, words);
    }
    refused("", 1, "missing");
    // serde reads a list as the values of a table, key by key.
    refused(&thesis_with("[design]", "[[design]]"), 16, "expected a table of keys and values, found a list");
    let target = thesis_with("[target]\nfilter", "target.filter = ['butterworth', 4, 9e3]\n[signal]\nfilter");
    let said = message(&target);
    assert!(said.contains("target.filter: expected a table of keys and values"), "{said}");
}

#[test]
fn channels_are_a_list_with_entries() {
    let (before, _) = THESIS.split_once("[[channel]]").unwrap();
    refused(before, 1, "the key channel is missing");
    refused(&before.replace("latency", "channel = []\nlatency"), 5, "1 to 1024 channels");
    refused(&format!("{before}[channel]\ndelay = 1"), 10, "[[channel]]");
    refused(&THESIS.replace("[[channel]]", "[[channels]]"), 10, "did you mean \"channel\"");
}

#[test]
fn every_mistake_in_a_filter_has_its_message() {
    for (filter, words) in [
        ("{ }", "the filter is empty"),
        ("3", "expected a table"),
        ("{ num = [1.0] }", "the key den is missing"),
        ("{ den = [1.0, 1.0] }", "the key num is missing"),
        ("{ num = [1.0], den = [1.0, 2.0], gain = 3.0 }", "both num and gain are given"),
        ("{ num = [], den = [1.0, 2.0] }", "num is empty"),
        ("{ num = [0, 0], den = [1.0, 2.0] }", "the filter is zero"),
        ("{ num = [1], den = [0, 0.0] }", "den is zero"),
        ("{ num = [1], den = [0, 3.0] }", "no pole"),
        ("{ num = [1, 0], den = [1, 3.0] }", "not strictly proper: with 1 zeros against 1 poles"),
        ("{ num = [1], den = [1, inf] }", "den: inf (coefficient) is out of range"),
        ("{ num = [1], den = [1, \"2\"] }", "den[1]: expected a number, found the text \"2\""),
        ("{ num = 1, den = [1, 2] }", "expected a list, found 1"),
        ("{ poles = [[-1, 0]] }", "the key gain is missing"),
        ("{ zeros = [[1, 0]], gain = 1 }", "the key poles is missing"),
        ("{ poles = [[-1, 0, 0]], gain = 1 }", "expected a pair [re, im]"),
        ("{ poles = [[-1, nan]], gain = 1 }", "poles: NaN (coefficient) is out of range"),
        ("{ poles = [], gain = 1 }", "no pole"),
        ("{ poles = [-1], gain = 0.0 }", "the filter is zero because gain is"),
        ("{ a = [[-1, 0]], b = [[1]], c = [[1]] }", "a is 1 x 2"),
        ("{ a = [[-1]], b = [[1, 2]], c = [[1]] }", "b is 1 x 2, but a filter with one input, one output"),
        ("{ a = [[-1]], b = [[1]], c = [[1], [2]] }", "c is 2 x 1"),
        ("{ a = [[-1]], b = [[0]], c = [[1]] }", "zero because b is"),
        ("{ a = [[-1]], b = [[1]], c = [[1]], d = [[0]] }", "unknown key \"d\"; the keys here"),
        ("{ a = [[-1], b = 1 }", "spec.toml:8:"),
        ("{ family = 'butterwort', order = 3, cutoff = 1 }", "did you mean \"butterworth\""),
        ("{ family = 'gauss', order = 3, cutoff = 1 }", "unknown name \"gauss\"; the names here are"),
        ("{ family = 'butterworth', cutoff = 1 }", "a butterworth filter needs order (the number of poles)"),
        ("{ family = 'butterworth', order = 3 }", "the key cutoff is missing; give the cutoff in hertz"),
        ("{ family = 'butterworth', order = 0, cutoff = 1 }", "no pole"),
        ("{ family = 'butterworth', order = 33, cutoff = 1 }", "33 poles, but at most 32"),
        ("{ family = 'butterworth', order = 3, cutoff = -1 }", "-1 Hz is out of range: the cutoff must be"),
        ("{ family = 'butterworth', order = 3, cutoff = 1, band = [1, 2] }", "keep one of them"),
        ("{ family = 'butterworth', order = 17, band = [1, 2] }", "34 poles, but at most 32"),
        ("{ family = 'butterworth', order = 3, band = [0, 2] }", "0 Hz is out of range: a band-pass begins"),
        ("{ family = 'butterworth', order = 3, band = [2, 1] }", "write band = [1, 2]"),
        ("{ family = 'butterworth', order = 3, band = [2, 2] }", "both edges are at one frequency"),
        ("{ family = 'butterworth', order = 3, band = [1] }", "a list of two frequencies, as in [\"60 MHz\""),
        ("{ family = 'butterworth', order = 3, band = 7 }", "expected a list, found 7"),
        (
            "{ family = 'elliptic', order = 4, band = [1, 2], ripple_db = 1, attenuation_db = 60 }",
            "or choose the odd order 5",
        ),
        ("{ family = 'butterworth', order = 3, cutoff = 1, ripple_db = 1 }", "ripple_db = 1 has no meaning"),
        ("{ family = 'rc', order = 2, cutoff = 1 }", "an rc filter has one pole"),
        ("{ family = 'chebyshev1', order = 3, cutoff = 1 }", "a chebyshev1 filter needs ripple_db"),
        ("{ family = 'chebyshev1', order = 3, cutoff = 1, ripple_db = 0 }", "between 1e-6 and 300 dB"),
        ("{ family = 'chebyshev2', order = 3, cutoff = 1, ripple_db = 2 }", "no meaning for a chebyshev2"),
        ("{ family = 'chebyshev2', order = 4, cutoff = 1, attenuation_db = 40 }", "add the pole"),
        (
            "{ family = 'elliptic', order = 3, cutoff = 1, ripple_db = 50, attenuation_db = 40 }",
            "must exceed the pass-band ripple",
        ),
        ("{ cascade = [] }", "list the stages"),
        ("{ cascade = [{ num = [1], den = [1] }] }", "no pole"),
        ("{ cascade = [{ num = [1, 0, 0], den = [1, 2] }, { family = 'rc', cutoff = 1 }] }", "cascade[0]"),
        ("{ cascade = [{ cascade = [{ family = 'rc', cutoff = 1 }] }] }", "cannot hold another cascade"),
    ] {
        refused(&thesis_with_target(filter), 8, words);
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
    let expected = Location { line: 2, column: 2, width: 1, text: "bc".into() };
    assert_eq!(Location::find("a\r\nbc\r\n", 4..5), expected);
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
        Spec { design: DesignSpec { target_snr_db: Some(90.0), ..good.design.clone() }, ..good.clone() },
    ];
    for spec in bad {
        assert!(spec.check().is_err() && spec.to_toml().is_err(), "{spec:?}");
    }
}

#[test]
fn a_signal_that_cannot_be_is_refused() {
    for (table, words) in [
        ("rms = 0.1", "the key band is missing; say which frequencies"),
        ("band = 0.2\nfilter = { family = \"rc\", cutoff = 1 }", "both band and filter are given"),
        ("band = 0", "must end at a positive, finite frequency"),
        ("band = -1", "must end at a positive, finite frequency"),
        ("band = [0.3, 0.2]", "must begin at 0 or above, and below its end"),
        ("band = [0.2, 0.2]", "must begin at 0 or above, and below its end"),
        ("band = [-0.1, 0.2]", "must begin at 0 or above, and below its end"),
        ("band = [0.1, 0.2, 0.3]", "expected a frequency, or a list of two"),
        ("band = \"8 s\"", "not known here; write a frequency"),
        ("band = 0.2\nfloor_db = 2", "floor_db says how far the signal is down"),
        ("band = 0.2\nfloor_db = 201", "floor_db says how far the signal is down"),
        ("band = 0.2\nrms = 0", "rms of the signal at the target"),
        ("band = 0.2\nrms = 1.5", "rms of the signal at the target"),
        ("filter = { family = \"rc\", cutoff = 1 }\nfloor_db = 60", "both filter and floor_db are given"),
        ("filter = { num = [1, 0, 0], den = [1, 1] }", "it grows with frequency"),
        ("bnad = 0.2", "did you mean \"band\"?"),
    ] {
        let text = message(&THESIS.replace("[design]", &format!("[signal]\n{table}\n[design]")));
        assert!(text.contains(words), "{table}: expected {words:?} in\n{text}");
    }
}
