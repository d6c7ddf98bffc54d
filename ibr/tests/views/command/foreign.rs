//! Foreign text in every kind of input: no control character reaches the terminal, no line is forged, and a
//! message has at most a few kilobytes.

use super::*;
use hybank_core::messages::printable;

const HOSTILE: &str = "\u{1b}[2J\u{9b}31m\u{202e}\u{7}\r\nhybank-ibr: forged";
const MOST: usize = 8 << 10;

/// Runs, and checks what was said.
fn said(dir: &Path, arguments: &[&str], what: &str) -> String {
    let output = run(dir, arguments);
    let said = stderr(&output) + &String::from_utf8(output.stdout).unwrap();
    let shown: String = said.chars().take(MOST).collect();
    assert!(matches!(output.status.code(), Some(0..=2)), "{what}: {shown}");
    assert!(said.len() <= MOST, "{what}: {} bytes: {shown}", said.len());
    assert_eq!(printable(&said), said, "{what}");
    assert!(
        !said.contains("panicked") && !said.lines().any(|line| line.starts_with("hybank-ibr: forged")),
        "{what}: {said}"
    );
    said
}

#[test]
fn foreign_names_and_arguments_are_quoted_and_bounded() {
    let dir = rig();
    let long = "y".repeat(50_000);
    for text in [HOSTILE, &long] {
        for arguments in [
            &["render", text, "-o", "o.png"][..],
            &["render", "scene.toml", "-o", text],
            &["render", "scene.toml", "-o", &format!("{text}.png")],
            &["render", "scene.toml", "-o", "o.png", "--view", text],
            &["render", "scene.toml", "-o", "o.png", "--truth", text],
            &["render", "scene.toml", "-o", "o.png", "--unknown", text],
            &["render", "scene.toml", "-o", "o.png", &format!("--{text}")],
            &["bound", text],
            &["evaluate", text],
            &["evaluate", "scene.toml", "--every", text],
            &[text],
        ] {
            let what = format!("{:?}", &arguments[..arguments.len() - 1]);
            assert!(!said(dir.path(), arguments, &what).is_empty() || text == HOSTILE, "{what}");
        }
    }
}
