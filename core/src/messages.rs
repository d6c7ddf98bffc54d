//! What messages hold that this program did not write (foreign text, lines of files), and numbers of any
//! size.
//!
//! Names of files, keys, headers and cells may hold control characters, which a terminal obeys, and may be
//! megabytes long. [`Quoted`] is foreign text in a message. Whoever prints a message passes all of it
//! through [`shown`], so a text that was not quoted does no harm either.
//!
//! ```
//! use hybank_core::messages::{Number, Quoted, shown};
//! assert_eq!(Quoted("a\u{1b}[2Jb\n").to_string(), "a\\u{1b}[2Jb\\n");
//! assert_eq!(Quoted("x".repeat(1_000_000)).to_string().len(), 200);
//! assert_eq!(shown("x\ry: no number"), "x\\ry: no number");
//! assert_eq!(format!("{} {}", Number(0.25), Number(1e300)), "0.25 1e300");
//! ```

use std::ffi::OsStr;
use std::fmt;
use std::ops::Range;

/// Most characters of a foreign text in a message.
const MOST_QUOTED: usize = 200;
/// Most characters of a line of a message; an error names several files and texts.
const MOST_SHOWN: usize = 3000;
/// Stands for what is left out.
const CUT: &str = " [..] ";

/// Foreign text in a message: a name, a key, a cell, a path.
///
/// Control characters are escaped, as well as those that reorder or hide text. Of more than 200 characters
/// the beginning and the end are shown.
#[derive(Debug, Clone, Copy)]
pub struct Quoted<T>(pub T);

impl<T: AsRef<OsStr>> fmt::Display for Quoted<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&bounded(&self.0.as_ref().to_string_lossy(), MOST_QUOTED))
    }
}

/// A number in a message: with an exponent where there would be many zeros.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(pub f64);

/// Magnitudes that are written without an exponent.
const PLAIN: Range<f64> = 1e-5..1e16;

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_plain = self.0 == 0.0 || !self.0.is_finite() || PLAIN.contains(&self.0.abs());
        if is_plain { fmt::Display::fmt(&self.0, f) } else { fmt::LowerExp::fmt(&self.0, f) }
    }
}

/// A whole message as it may be printed: in one line and bounded, with every control character escaped. The
/// lines of a [`Location`] keep their line breaks.
pub fn shown(message: &str) -> String {
    let breaks: Vec<usize> = message
        .match_indices('\n')
        .map(|(at, _)| at)
        .filter(|&at| is_of_location(&message[at + 1..]))
        .take(Location::LINES)
        .collect();
    let begins = [0].into_iter().chain(breaks.iter().map(|at| at + 1));
    let ends = breaks.iter().copied().chain([message.len()]);
    let lines: Vec<String> = begins.zip(ends).map(|(a, b)| bounded(&message[a..b], MOST_SHOWN)).collect();
    lines.join("\n")
}

/// A text of several lines with every other control character escaped.
pub fn printable(text: &str) -> String {
    let lines: Vec<String> = text.split('\n').map(|line| escaped(line.chars())).collect();
    lines.join("\n")
}

/// Where a message of serde_json says that it is about, and the rest of it.
fn place_of(message: &str) -> (Option<(&str, &str)>, &str) {
    let found = message
        .rsplit_once(" at line ")
        .and_then(|(what, place)| Some((what, place.split_once(" column ")?)));
    found.map_or((None, message), |(what, place)| (Some(place), what))
}

/// What a message of serde or serde_json says, in plain words and with the line and the column.
pub fn of_json(message: &str) -> String {
    match place_of(message) {
        // Columns are counted from 1: the fault is that of the whole text.
        (Some(("1", "0")), what) if what.starts_with("EOF") => "it is empty".into(),
        (Some(("1", "0")), _) => of_document(message),
        (Some((line, column)), _) => format!("line {line}, column {column}: {}", of_document(message)),
        (None, _) => of_document(message),
    }
}

/// A key or a name that a document does not have.
pub struct Unknown<'a> {
    /// "key" or "name".
    pub what: &'static str,
    /// As it is written.
    pub name: &'a str,
    /// Those that it has.
    pub known: Vec<&'a str>,
}

/// The key or the name that is unknown, if a message of serde says so.
pub fn unknown(message: &str) -> Option<Unknown<'_>> {
    let kinds = [("key", "unknown field `"), ("name", "unknown variant `")];
    let (what, rest) = kinds.iter().find_map(|(what, words)| Some((*what, message.strip_prefix(words)?)))?;
    let (name, known) = rest.rsplit_once("`, expected ")?;
    Some(Unknown { what, name, known: known.split('`').skip(1).step_by(2).collect() })
}

/// What a message of serde says about a document of any format, in plain words and without its place.
pub fn of_document(message: &str) -> String {
    let (_, message) = place_of(message);
    let after = |words: &str| message.strip_prefix(words);
    let key = |rest: &str| Quoted(rest.trim_end_matches('`')).to_string();
    if let Some(rest) = after("missing field `") {
        return format!("the key {} is missing", key(rest));
    }
    if let Some(rest) = after("duplicate field `") {
        return format!("the key {} is given twice; keep one of them", key(rest));
    }
    if let Some(Unknown { what, name, known }) = unknown(message) {
        return format!("unknown {what} \"{}\"; the {what}s here are {}", Quoted(name), known.join(", "));
    }
    if let Some((found, expected)) = after("invalid length ").and_then(|rest| rest.split_once(", expected "))
    {
        return format!(
            "{found} entries, but {} is needed",
            expected.replace("an array of length", "a list of")
        );
    }
    let wrong = after("invalid type: ").or(after("invalid value: "));
    if let Some((found, expected)) = wrong.and_then(|rest| rest.rsplit_once(", expected ")) {
        return format!("expected {}, found {}", expected_type(expected), found_value(found));
    }
    match message {
        deep if deep.contains("recur") => "lists and tables are nested too deeply".into(),
        "number out of range" => "a number does not fit a double; write one below 1e308".into(),
        "invalid escape" | "unexpected end of hex escape" | "lone leading surrogate in hex escape" => {
            "a text has a backslash that begins no character of JSON".into()
        }
        control if control.starts_with("control character") => {
            "a text has a line break or another control character; write \\n or \\u and four digits".into()
        }
        "trailing characters" => "there is more text after the end of a list or of the document".into(),
        "key must be a string" => "a key must be a text in double quotes".into(),
        "expected value" | "expected ident" => "a value is missing or not one of JSON".into(),
        _ => match after("EOF while parsing ") {
            Some(part) => {
                format!("the text ends inside {}", if part == "an object" { "a table" } else { part })
            }
            None => shown(message),
        },
    }
}

/// The type that serde expected.
fn expected_type(name: &str) -> String {
    match name {
        "u8" | "u16" | "u32" | "u64" | "usize" => {
            "a whole number, zero or more, without point and exponent".into()
        }
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number without point and exponent".into(),
        "f32" | "f64" => "a number".into(),
        "a string" | "string" | "str" => "a text".into(),
        "path string" => "the name of a file".into(),
        "a boolean" => "true or false".into(),
        "a sequence" => "a list".into(),
        "a map" => "a table".into(),
        other if other.starts_with("struct ") => "a table of keys and values".into(),
        other => Quoted(other).to_string(),
    }
}

/// The value that serde found.
fn found_value(found: &str) -> String {
    match found.split_once([' ', '`']).unwrap_or((found, "")) {
        ("string", text) => format!("the text {}", Quoted(text)),
        ("integer", digits) => Quoted(digits.trim_matches('`')).to_string(),
        ("floating", point) => {
            let text = point.trim_start_matches("point ").trim_matches('`');
            text.parse::<f64>().map_or_else(|_| Quoted(text).to_string(), |number| Number(number).to_string())
        }
        ("boolean", word) => word.trim_matches('`').to_owned(),
        ("map", _) => "a table".into(),
        ("sequence", _) => "a list".into(),
        // serde_json and others write NaN and infinity as null.
        ("null", _) => "null (perhaps written for NaN or infinity)".into(),
        _ => Quoted(found).to_string(),
    }
}

/// What is wrong with the usage of a program, with the arguments in it quoted; `text` has lines of its own.
pub fn usage(text: &str, arguments: impl Iterator<Item = String>) -> String {
    let mut text = text.to_owned();
    for argument in arguments {
        for part in [&*argument].into_iter().chain(argument.split(['=', ','])) {
            let quoted = Quoted(part).to_string();
            if quoted != part && !part.trim().is_empty() {
                text = text.replace(part, &quoted);
            }
        }
    }
    for (foreign, plain) in WORDS_OF_STD {
        text = text.replace(foreign, plain);
    }
    printable(&text)
}

/// What the standard library says of numbers that it cannot read.
const WORDS_OF_STD: [(&str, &str); 6] = [
    ("invalid digit found in string", "it must be a whole number, zero or more"),
    ("number too large to fit in target type", "the number is too large"),
    ("number too small to fit in target type", "the number is too small"),
    ("cannot parse integer from empty string", "it must be a whole number"),
    ("cannot parse float from empty string", "it must be a number"),
    ("invalid float literal", "it must be a number"),
];

/// Whether a line begins as those of a [`Location`] do.
fn is_of_location(line: &str) -> bool {
    line.trim_start_matches(' ').trim_start_matches(|c: char| c.is_ascii_digit()).starts_with(" |")
        || line.trim_start_matches(' ').starts_with('|')
}

/// The escaped text; of more than `most` characters the beginning and the end.
fn bounded(text: &str, most: usize) -> String {
    let whole = escaped(text.chars().take(most + 1));
    if whole.chars().count() <= most {
        return whole;
    }
    let end = most / 4;
    let from = text.char_indices().rev().nth(end - 1).map_or(0, |(at, _)| at);
    let tail: Vec<char> = escaped(text[from..].chars()).chars().collect();
    let head = whole.chars().take(most - end - CUT.len());
    head.chain(CUT.chars()).chain(tail[tail.len().saturating_sub(end)..].iter().copied()).collect()
}

fn escaped(text: impl Iterator<Item = char>) -> String {
    let mut shown = String::new();
    for c in text {
        if is_hidden(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown
}

/// Control characters, and those of Unicode that reorder text, hide or break it.
fn is_hidden(c: char) -> bool {
    let reorders =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{206f}');
    let hides =
        matches!(c, '\u{ad}' | '\u{200b}' | '\u{2060}'..='\u{2065}' | '\u{feff}' | '\u{e0000}'..='\u{e0fff}');
    c.is_control() || reorders || hides || matches!(c, '\u{2028}' | '\u{2029}' | '\u{fff9}'..='\u{fffb}')
}

/// A location in a text file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Length in characters on that line, at least 1.
    pub width: usize,
    /// The line, without its line break.
    pub text: String,
}

/// Most characters of a line that a message shows.
const SHOWN_CHARACTERS: usize = 100;

impl Location {
    /// Lines of its text, each after a line break of the message.
    const LINES: usize = 3;

    /// The location of the byte range `span` in `text`; a range that exceeds the text is clipped to it.
    pub fn find(text: &str, span: Range<usize>) -> Self {
        let start = boundary(text, span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |i| start + i);
        let end = boundary(text, span.end).clamp(start, line_end);
        Self {
            line: text[..start].matches('\n').count() + 1,
            column: text[line_start..start].chars().count() + 1,
            width: text[start..end].chars().count().max(1),
            text: text[line_start..line_end].trim_end_matches('\r').to_owned(),
        }
    }
}

/// The nearest character boundary at or below `index`.
fn boundary(text: &str, index: usize) -> usize {
    let index = index.min(text.len());
    (0..=index).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

impl fmt::Display for Location {
    /// The line with its number and carets under the location. Of a long line, the part around it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let skipped = (self.column - 1).saturating_sub(SHOWN_CHARACTERS / 2);
        // Escapes, and a tab, would misalign the carets.
        let shown = |c: char| if is_hidden(c) { ' ' } else { c };
        let line: String = self.text.chars().skip(skipped).take(SHOWN_CHARACTERS).map(shown).collect();
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        let indent = " ".repeat(self.column - 1 - skipped);
        let carets = "^".repeat(self.width.min(SHOWN_CHARACTERS / 2));
        write!(f, "{margin} |\n{number} | {line}\n{margin} | {indent}{carets}")
    }
}

/// A number of things, with a plural where it is not 1.
pub fn counted(count: impl fmt::Display, name: &str) -> String {
    let count = count.to_string();
    let ending = if count == "1" { "" } else { "s" };
    format!("{count} {name}{ending}")
}

#[cfg(test)]
mod tests;
