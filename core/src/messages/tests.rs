use super::*;
use proptest::prelude::*;
use std::path::Path;

#[test]
fn text_that_is_harmless_stays_as_it_is() {
    // Accents of their own, as in names of files on a Mac, are not escaped.
    for text in ["", "a b.wav", "\"x\" \\ 'y'", "e\u{301}t\u{e9} \u{65e5}\u{672c}", &"x".repeat(MOST_QUOTED)]
    {
        assert_eq!(Quoted(text).to_string(), text);
        assert_eq!(shown(text), text);
    }
    assert_eq!(Quoted(Path::new("a/b")).to_string(), "a/b");
}

#[test]
fn long_text_keeps_its_beginning_and_its_end() {
    let text = format!("begin{}end", "\u{e9}".repeat(1 << 20));
    let quoted = Quoted(&text).to_string();
    assert!(quoted.starts_with("begin\u{e9}") && quoted.ends_with("\u{e9}end") && quoted.contains(CUT));
    assert_eq!(quoted.chars().count(), MOST_QUOTED);
    assert_eq!(Quoted(&quoted).to_string(), quoted);
    assert_eq!(shown(&text).chars().count(), MOST_SHOWN);
}

#[test]
fn only_the_lines_of_a_location_begin_lines() {
    let location = Location::find("a = 1\nratio = \u{1b}x\n", 6..11).to_string();
    assert_eq!(location, "  |\n2 | ratio =  x\n  | ^^^^^");
    let message = format!("spec\nhybank: forged: no\n{location}");
    assert_eq!(shown(&message), format!("spec\\nhybank: forged: no\n{location}"));
    assert_eq!(shown("a\n1 | b\nc"), "a\n1 | b\\nc");
    let arguments = ["hybank", "--taps=7\nhybank: forged", &"y".repeat(5000)].map(str::to_owned);
    let text = format!("error: invalid value '7\nhybank: forged'\n\nUsage: {}", "y".repeat(5000));
    let said = usage(&text, arguments.into_iter());
    assert!(said.starts_with("error: invalid value '7\\nhybank: forged'\n\nUsage: yyy"), "{said}");
    assert!(said.len() < 300, "{said}");
    assert_eq!(printable("two\nlines\u{9b}\t"), "two\nlines\\u{9b}\\t");
    let flood = format!("x{}", "\n1 | y".repeat(1000));
    assert_eq!(shown(&flood).lines().count(), 1 + Location::LINES);
}

#[test]
fn numbers_are_short() {
    let shown =
        [0.0, -0.5, 48000.0, 1e-5, 9e-6, -1e16, f64::MAX, 5e-324, f64::NAN].map(|x| Number(x).to_string());
    let want = ["0", "-0.5", "48000", "0.00001", "9e-6", "-1e16", "1.7976931348623157e308", "5e-324", "NaN"];
    assert_eq!(shown, want);
    assert_eq!(format!("{:.2} {:.1}", Number(0.126), Number(1.26e99)), "0.13 1.3e99");
}

#[test]
fn the_words_of_serde_become_plain_ones() {
    for (message, words) in [
        ("missing field `global` at line 1 column 2", "line 1, column 2: the key global is missing"),
        (
            "invalid type: string \"a, expected b\", expected u64 at line 3 column 9",
            "line 3, column 9: expected a whole number, zero or more, without point and exponent, found the text \"a, expected b\"",
        ),
        ("invalid type: floating point `1e300.0`, expected a string", "expected a text, found 1e300.0"),
        (
            "invalid type: floating point `0.5`, expected usize",
            "expected a whole number, zero or more, without point and exponent, found 0.5",
        ),
        ("invalid type: map, expected a sequence", "expected a list, found a table"),
        (
            "invalid value: integer `-3`, expected u64",
            "expected a whole number, zero or more, without point and exponent, found -3",
        ),
        ("invalid length 1, expected an array of length 2", "1 entries, but a list of 2 is needed"),
        (
            "unknown variant `b`, expected `first` or `second`",
            "unknown name \"b\"; the names here are first, second",
        ),
        (
            "unknown field `b\u{1b}`, expected one of `first`, `length`",
            "unknown key \"b\\u{1b}\"; the keys here are first, length",
        ),
        ("unknown field `b`, expected `first`", "unknown key \"b\"; the keys here are first"),
        ("EOF while parsing an object at line 2 column 0", "line 2, column 0: the text ends inside a table"),
        (
            "recursion limit exceeded at line 1 column 128",
            "line 1, column 128: lists and tables are nested too deeply",
        ),
        ("cannot recurse further; max recursion depth met", "lists and tables are nested too deeply"),
        (
            "number out of range at line 1 column 15",
            "line 1, column 15: a number does not fit a double; write one below 1e308",
        ),
        (
            "unexpected end of hex escape at line 1 column 14",
            "line 1, column 14: a text has a backslash that begins no character of JSON",
        ),
        (
            "control character (\\u0000-\\u001F) found while parsing a string at line 1 column 4",
            "line 1, column 4: a text has a line break or another control character; write \\n or \\u and four \
             digits",
        ),
        ("EOF while parsing a value at line 1 column 0", "it is empty"),
        ("invalid type: sequence, expected a map at line 1 column 0", "expected a table, found a list"),
        ("expected `,` or `}` at line 1 column 7", "line 1, column 7: expected `,` or `}`"),
    ] {
        assert_eq!(of_json(message), words);
    }
    let huge = format!("invalid type: floating point `1{}.0`, expected u64", "0".repeat(300));
    assert!(of_document(&huge).ends_with("found 1e300"), "{}", of_document(&huge));
}

proptest! {
    #[test]
    fn nothing_foreign_reaches_the_terminal(text in any::<String>(), times in 1usize..100) {
        let long = text.repeat(times);
        for shown in [Quoted(&long).to_string(), shown(&long)] {
            let lines = shown.matches('\n').count();
            prop_assert!(lines <= Location::LINES && shown.chars().count() <= MOST_SHOWN * (1 + lines) + lines);
            prop_assert!(!shown.chars().any(|c| c != '\n' && is_hidden(c)), "{shown:?}");
        }
    }
}
