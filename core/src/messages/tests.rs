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
    assert!(
        said.starts_with("error: invalid value '7\\nhybank: forged'\n\nUsage: yyy") && said.len() < 300,
        "{said}"
    );
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
