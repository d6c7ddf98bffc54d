//! The page about a bank, and the manual pages.

use crate::support::{Desk, THESIS};

/// Tags that load something, or could.
const LOADING: [&str; 6] = ["<script", "<img", "<iframe", "src=", "@import", "url("];

fn desk() -> Desk {
    let desk =
        Desk::with_spec(&THESIS.replace("fast_period = 1.0", "name = \"a < b & c\"\nfast_period = 1.0"));
    desk.good(&["design", "--prove", "spec.toml", "-o", "b.json"]);
    desk
}

fn page(desk: &Desk, args: &[&str]) -> String {
    desk.good(&[&["report", "b.json", "-o", "report.html", "--force"], args].concat());
    String::from_utf8(desk.read("report.html")).unwrap()
}

#[test]
fn a_page_shows_the_bank_and_loads_nothing() {
    let desk = desk();
    let page = page(&desk, &[]);
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    assert!(LOADING.iter().all(|tag| !page.contains(tag)), "something is loaded");
    // Addresses occur as the names of XML only.
    assert_eq!(page.matches("http").count(), page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    assert_eq!((page.matches("<svg").count(), page.matches("</svg>").count()), (9, 9));
    assert!(page.contains("a &lt; b &amp; c") && !page.contains("a < b"), "the name is not escaped");
    for part in [
        "largest image of a tone",
        "plain interleaving",
        "proven for this page",
        "multiply-adds",
        "hybank verify b.json",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("NaN") && !page.contains("Captures"));
}

/// gamma and its proof are those of the file.
#[test]
fn the_figures_are_those_of_verify() {
    let desk = desk();
    let proven: serde_json::Value =
        serde_json::from_str(&desk.good(&["verify", "b.json", "--json"])).unwrap();
    let bound = |key: &str| {
        let digits = format!("{:.7}", proven[key].as_f64().unwrap());
        digits.trim_end_matches('0').to_owned()
    };
    let page = page(&desk, &[]);
    assert!(page.contains(&format!("{} to {}", bound("attained"), bound("upper"))), "{proven}");
}

#[test]
fn captures_are_shown_before_and_after() {
    let desk = desk();
    desk.good(&["simulate", "b.json", "--source", "tones:0.3", "--samples", "4000", "-o", "cap"]);
    let page = page(&desk, &["cap/ch1.wav", "cap/ch2.wav"]);
    assert_eq!(page.matches("<svg").count(), 10);
    for part in ["Captures", "plain interleaving", "fused", "--force cap/ch1.wav cap/ch2.wav"] {
        assert!(page.contains(part), "{part}");
    }
    // The figures and the spurs of the tone, before and after.
    for part in ["interleaved (rings)", "SINAD", "SFDR", "worst of these", "gain or skew, 1/2 fs", " (noise)"]
    {
        assert!(page.contains(part), "{part}");
    }
    desk.refused(1, &["report", "b.json", "cap/ch1.wav", "-o", "other.html"], &["2 channels", "1"]);
    assert!(!desk.path("other.html").exists());
}

#[test]
fn what_cannot_be_reported_is_refused() {
    let desk = desk();
    page(&desk, &[]);
    desk.refused(1, &["report", "b.json", "-o", "report.html"], &["exists", "--force"]);
    desk.refused(1, &["report", "b.json", "-o", "b.json", "--force"], &["b.json"]);
    let mut bank: serde_json::Value = serde_json::from_slice(&desk.read("b.json")).unwrap();
    for key in ["spec", "proof", "digest"] {
        bank[key] = serde_json::Value::Null;
    }
    desk.write("bare.json", bank.to_string());
    desk.refused(1, &["report", "bare.json", "-o", "bare.html"], &["bare.json", "spec"]);
}

#[test]
fn each_command_has_a_manual_page() {
    let desk = desk();
    desk.good(&["man", "pages"]);
    let program = String::from_utf8(desk.read("pages/hybank.1")).unwrap();
    for command in ["design", "fuse", "report", "man"] {
        let text = String::from_utf8(desk.read(&format!("pages/hybank-{command}.1"))).unwrap();
        assert!(text.contains(".SH SYNOPSIS") && text.contains(&format!("hybank {command}")), "{command}");
        assert!(program.contains(&format!("hybank\\-{command}(1)")), "{command}");
    }
    desk.refused(1, &["man", "pages"], &["exists", "--force"]);
}
