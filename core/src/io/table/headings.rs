//! What the lines before the numbers say: which column is the time, in which unit, and the rate.

use super::stamp::Stamp;
use crate::quantity::{self, WrittenTime};

/// What the heading of a column says of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Role {
    /// When each line was taken, in this unit in seconds; unless it is said, the size of the number tells.
    Time(Option<f64>),
    /// It numbers the lines, if it does.
    Index,
    /// Nothing is known.
    Other,
}

/// Words of which one at least is in the heading of a time.
const TIMES: [&str; 12] = [
    "t",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "ts",
    "seconds",
    "second",
    "date",
    "datetime",
    "elapsed",
    "epoch",
];
/// Words that may stand beside them.
const BESIDE: [&str; 10] = ["x", "axis", "stamp", "utc", "local", "relative", "since", "start", "in", "unix"];
/// Words of a column that numbers the lines.
const INDICES: [&str; 9] = ["index", "idx", "sample", "samples", "sequence", "n", "no", "number", "point"];
/// Units of time.
const UNITS: [(&str, f64); 28] = [
    ("h", 3600.0),
    ("hour", 3600.0),
    ("hours", 3600.0),
    ("min", 60.0),
    ("minute", 60.0),
    ("minutes", 60.0),
    ("s", 1.0),
    ("sec", 1.0),
    ("secs", 1.0),
    ("second", 1.0),
    ("seconds", 1.0),
    ("ms", 1e-3),
    ("msec", 1e-3),
    ("millisecond", 1e-3),
    ("milliseconds", 1e-3),
    ("us", 1e-6),
    // The micro sign and the Greek letter.
    ("\u{b5}s", 1e-6),
    ("\u{3bc}s", 1e-6),
    ("usec", 1e-6),
    ("microsecond", 1e-6),
    ("microseconds", 1e-6),
    ("ns", 1e-9),
    ("nsec", 1e-9),
    ("nanosecond", 1e-9),
    ("nanoseconds", 1e-9),
    ("ps", 1e-12),
    ("picosecond", 1e-12),
    ("picoseconds", 1e-12),
];
/// Times since 1970 at and above these are in ms, µs and ns: as seconds they would be after the year 5138.
const EPOCHS: [(f64, f64); 3] = [(1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)];

/// Names of the interval of two samples, in letters only.
const INTERVALS: [&str; 11] = [
    "sampleinterval",
    "samplinginterval",
    "sampleperiod",
    "samplingperiod",
    "timeinterval",
    "interval",
    "increment",
    "xincr",
    "xincrement",
    "tinc",
    "dt",
];
/// Names of the rate.
const RATES: [&str; 6] =
    ["samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "samplespersecond", "fs"];
/// Names of the beginning beside an interval.
const BEGINNINGS: [&str; 2] = ["start", "t0"];
/// Digits up to which an interval is a round number; those that end in more are rounded.
const ROUND: i32 = 2;

/// Prefixes of units and the size that they give.
const PREFIXES: [(&str, &str); 9] = [
    ("", "1"),
    ("milli", "m"),
    ("micro", "µ"),
    ("kilo", "k"),
    ("m", "m"),
    ("µ", "µ"),
    ("μ", "µ"),
    ("u", "µ"),
    ("k", "k"),
];
/// Names of units, and what they measure.
const QUANTITIES: [(&str, &str); 8] = [
    ("v", "voltage"),
    ("volt", "voltage"),
    ("volts", "voltage"),
    ("a", "current"),
    ("amp", "current"),
    ("ampere", "current"),
    ("amps", "current"),
    ("amperes", "current"),
];

/// The unit of time that a text is, in seconds.
fn unit_of(word: &str) -> Option<f64> {
    UNITS.iter().find(|(known, _)| *known == word).map(|(_, seconds)| *seconds)
}

fn words(text: &str) -> Vec<String> {
    let text = text.to_lowercase();
    text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

/// The unit of a signal as it is written: a quantity, and the size that its prefix gives it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unit {
    pub(super) quantity: &'static str,
    pub(super) size: &'static str,
    pub(super) written: String,
}

/// What stands in brackets at the end of a text.
fn in_brackets(text: &str) -> Option<&str> {
    let text = text.trim();
    text[text.find(['(', '['])? + 1..].strip_suffix([')', ']'])
}

impl Unit {
    /// Of the cell of a line of units, or of brackets in a heading.
    pub(super) fn of(heading: &str, below: &str) -> Option<Self> {
        let written = in_brackets(below).or_else(|| in_brackets(heading)).unwrap_or(below);
        let lower = written.trim().to_lowercase();
        let of = |&(prefix, size): &(&str, &'static str)| {
            let quantity = QUANTITIES.iter().find(|(name, _)| lower.strip_prefix(prefix) == Some(name))?.1;
            Some((quantity, size))
        };
        let (quantity, size) = PREFIXES.iter().find_map(of)?;
        Some(Self { quantity, size, written: written.trim().to_owned() })
    }
}

/// What a heading says, with the cell below it where there is a line of units.
pub(super) fn role(heading: &str, below: &str) -> Role {
    let (own, below) = (words(heading), words(below));
    let all: Vec<&str> = own.iter().chain(&below).map(String::as_str).collect();
    let is = |list: &[&str], word: &str| list.contains(&word);
    if !all.is_empty() && all.iter().all(|word| is(&INDICES, word) || *word == "x") && *all != ["x"] {
        return Role::Index;
    }
    let names = own.iter().any(|word| is(&TIMES, word) || unit_of(word).is_some_and(|unit| unit < 1.0));
    let unit = below.iter().chain(own.iter().rev()).find_map(|word| unit_of(word));
    let is_known = |word: &&str| is(&TIMES, word) || is(&BESIDE, word) || unit_of(word).is_some();
    let is_axis = own.first().is_some_and(|word| word == "x") && unit.is_some();
    // A line of units says it in any language.
    let is_in_units = below.len() == 1 && unit_of(&below[0]).is_some();
    let is_time = is_in_units || (all.iter().all(is_known) && (names || is_axis));
    if is_time { Role::Time(unit) } else { Role::Other }
}

/// True for a line below the headings that holds units: its first cell is one, or numbers the lines.
pub(super) fn is_of_units(first: &str) -> bool {
    matches!(words(first).as_slice(), [word] if unit_of(word).is_some() || word == "sequence")
}

/// The unit, in seconds, of times whose heading does not say it, by the first of them.
pub(super) fn unit_by_size(first: f64) -> f64 {
    EPOCHS.iter().find(|(least, _)| first >= *least).map_or(1.0, |(_, unit)| *unit)
}

/// A rate that is written in the lines before the numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StatedRate {
    pub(super) hertz: f64,
    /// Hertz by which the true rate may differ: half of the last digit.
    pub(super) error: f64,
}

/// The rate in the lines before the numbers, each as its cells, if one of them names it or the interval of
/// two samples. The value follows in the same cell, in one after it, or below it.
pub(super) fn stated_rate(lines: &[Vec<String>]) -> Option<StatedRate> {
    let cells = lines.iter().enumerate().flat_map(|(line, cells)| (0..cells.len()).map(move |c| (line, c)));
    cells.into_iter().find_map(|(line, column)| {
        let (name, rest) = split_name(&lines[line][column]);
        let is_rate = is_name(name, &RATES);
        if !is_rate && !is_name(name, &INTERVALS) {
            return None;
        }
        let below = lines.get(line + 1).and_then(|below| below.get(column));
        let after = &lines[line][column + 1..];
        let of_name = in_brackets(name);
        let value = |(k, text): (usize, &str)| {
            let unit = if k == 0 { None } else { after.get(k).map(String::as_str) };
            stated(text, of_name.or(unit), is_rate)
        };
        let values = std::iter::once(rest).chain(after.iter().map(|cell| split_name(cell).1));
        values.enumerate().find_map(value).or_else(|| stated(below?, of_name, is_rate))
    })
}

/// True for a heading over which such a value stands, and no samples.
pub(super) fn is_of_preamble(heading: &str) -> bool {
    let (name, _) = split_name(heading);
    is_name(name, &INTERVALS) || is_name(name, &BEGINNINGS)
}

/// A name before a colon or an equals sign, and what follows; all of the text is both if there is neither.
fn split_name(cell: &str) -> (&str, &str) {
    cell.split_once([':', '=']).map_or((cell, cell), |(name, rest)| (name, rest.trim()))
}

fn is_name(text: &str, known: &[&str]) -> bool {
    let text = text.split(['(', '[']).next().unwrap_or_default();
    let letters: String = text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    known.contains(&letters.as_str())
}

/// A rate or an interval, with its unit or with that of the next cell.
fn stated(text: &str, next: Option<&str>, is_rate: bool) -> Option<StatedRate> {
    let text = text.trim().replace(',', ".");
    let number = text.trim_end_matches(|c: char| !c.is_ascii_digit() && c != '.');
    let value = if is_rate {
        // What follows a plain number is its unit, or another number.
        let with_unit = next.filter(|_| number == text).map(|unit| format!("{text} {unit}"));
        let rate = |text: &str| quantity::rate(text.replace("Sa/s", "S/s").trim()).ok();
        with_unit.and_then(|text| rate(&text)).or_else(|| rate(&text))?.0
    } else {
        let Ok(WrittenTime::Seconds(time)) = quantity::time(&text) else { return None };
        time.0
            * next
                .filter(|_| number == text)
                .and_then(|next| unit_of(&next.trim().to_lowercase()))
                .unwrap_or(1.0)
    };
    let stamp = Stamp::parse(number).filter(|_| value.is_finite() && value > 0.0)?;
    let rounding = if stamp.digits() <= ROUND { 0.0 } else { 0.5 * stamp.digit() / stamp.value() };
    let hertz = if is_rate { value } else { 1.0 / value };
    Some(StatedRate { hertz, error: rounding * hertz })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_name_the_time_and_its_unit() {
        for (heading, below, want) in [
            ("Time (s)", "", Role::Time(Some(1.0))),
            ("t", "", Role::Time(None)),
            ("time_ms", "", Role::Time(Some(1e-3))),
            ("Time [us]", "", Role::Time(Some(1e-6))),
            ("TIME", "", Role::Time(None)),
            ("Time", "(ms)", Role::Time(Some(1e-3))),
            ("Zeit", "(ms)", Role::Time(Some(1e-3))),
            ("Source", "Second", Role::Time(Some(1.0))),
            ("x-axis", "second", Role::Time(Some(1.0))),
            ("X", "Second", Role::Time(Some(1.0))),
            ("X", "Sequence", Role::Index),
            ("time (µs)", "", Role::Time(Some(1e-6))),
            ("ms", "", Role::Time(Some(1e-3))),
            ("Time (min)", "", Role::Time(Some(60.0))),
            ("Time (h)", "", Role::Time(Some(3600.0))),
            ("min", "", Role::Other),
            ("timestamp", "", Role::Time(None)),
            ("Date Time", "", Role::Time(None)),
            ("elapsed (ns)", "", Role::Time(Some(1e-9))),
            ("Sample", "", Role::Index),
            ("index", "", Role::Index),
            ("x", "", Role::Other),
            ("x", "Volt", Role::Other),
            ("time ratio", "", Role::Other),
            ("sample voltage", "", Role::Other),
            ("volts", "", Role::Other),
            ("", "", Role::Other),
        ] {
            assert_eq!(role(heading, below), want, "{heading} {below}");
        }
        assert!(is_of_units("(ms)") && is_of_units("Second") && !is_of_units("Label") && !is_of_units("t"));
        assert_eq!(unit_by_size(1.7e9), 1.0);
        assert_eq!([1.7e12, 1.7e15, 1.7e18].map(unit_by_size), [1e-3, 1e-6, 1e-9]);
    }

    #[test]
    fn units_are_told_by_quantity_and_size() {
        let unit = |heading, below| Unit::of(heading, below).map(|unit| (unit.quantity, unit.size));
        for (heading, below, want) in [
            ("A", "(mV)", Some(("voltage", "m"))),
            ("CH1", "Volt", Some(("voltage", "1"))),
            ("Channel A [V]", "", Some(("voltage", "1"))),
            ("I (µA)", "", Some(("current", "µ"))),
            ("I (uA)", "", Some(("current", "µ"))),
            ("A", "", None),
            ("left", "right", None),
            ("T (°C)", "", None),
        ] {
            assert_eq!(unit(heading, below), want, "{heading} {below}");
        }
    }

    #[test]
    fn preambles_state_the_rate() {
        let rate = |text: &str| {
            let cells = |line: &str| line.split(',').map(str::to_owned).collect();
            stated_rate(&text.lines().map(cells).collect::<Vec<_>>())
        };
        for (text, hertz) in [
            ("Record Length,400\nSample Interval,1e-06\nLabel,", 1e6),
            ("X,CH1,Start,Increment,\nSequence,Volt,-2e-04,2.000000e-06", 5e5),
            ("X,CH1,t0 = -0.0006, tInc = 0.000004,", 2.5e5),
            ("Sample Interval,CH1:4.00E-09 CH2:4.00E-09\nSample Interval,CH1:4.00E-09", 2.5e8),
            ("Sample rate: 100000Hz", 1e5),
            ("Samplerate: 1 MHz", 1e6),
            ("XINCR,2.5,ms", 400.0),
            ("Sample Interval [us],2.5", 4e5),
            ("Sample interval (us): 2.5", 4e5),
            ("Increment (ms),2.5", 400.0),
            ("Sample Rate [kHz],24", 24e3),
            ("Sample Rate,24 kSa/s", 24e3),
            ("Sample Rate,24000,24000", 24e3),
            ("Sampling Rate = 48 kS/s", 48e3),
        ] {
            let found = rate(text).unwrap();
            assert!((found.hertz / hertz - 1.0).abs() < 1e-12, "{text} {found:?}");
        }
        for text in
            ["Sample Rate,24 kilo", "Sample Interval,auto", "Sample rate:", "interval,-1", "CH1,0.5", ""]
        {
            assert_eq!(rate(text), None, "{text}");
        }
        let rounded = rate("Interval,4.167e-05").unwrap();
        assert!((rounded.hertz - 24e3).abs() < rounded.error && rounded.error < 5.0);
        assert_eq!(rate("Interval,2.5e-05").unwrap().error, 0.0);
        assert!(is_of_preamble("Increment") && is_of_preamble(" tInc = 1e-9") && !is_of_preamble("CH1"));
    }
}
