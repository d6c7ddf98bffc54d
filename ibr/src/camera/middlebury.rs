//! `calib.txt` of the Middlebury stereo benchmark (2014 and later): inner parameters of both cameras,
//! baseline and the difference of the principal points.

use crate::files::{self, CHECK_THE_PATH, InputError, Location};
use hybank::messages::Quoted;
use std::path::Path;

/// Difference between `doffs` and the principal points that rounding explains, in pixels.
const ROUNDING: f64 = 0.1;

/// What a calibration file says about a rectified pair. Depth is
/// `baseline` `focal` / (disparity + `offset`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Focal length of both cameras in pixels.
    pub focal: f64,
    /// `doffs`: column of the principal point of the right camera minus that of the left, in pixels.
    pub offset: f64,
    /// Distance of the cameras, in millimetres.
    pub baseline: f64,
    /// Width and height of the images in pixels.
    pub size: (usize, usize),
}

/// Reads a file.
///
/// # Errors
/// [`InputError`], with the line.
pub fn read_calibration(path: &Path) -> Result<Calibration, InputError> {
    parse_calibration(&files::read_text(path, CHECK_THE_PATH, |text| 16.0 * text.len() as f64)?, path)
}

/// The same from the text of the file; `path` appears in messages.
///
/// # Errors
/// [`InputError`].
pub fn parse_calibration(text: &str, path: &Path) -> Result<Calibration, InputError> {
    let keys = Keys::new(text, path)?;
    let [left, right] = [keys.matrix("cam0")?, keys.matrix("cam1")?];
    let focal = left[0];
    if !(focal > 0.0 && (right[0] - focal).abs() <= 1e-6 * focal) {
        return keys.contradiction(format!(
            "the cameras have focal lengths {focal} and {}: those of a rectified pair are positive and equal",
            right[0]
        ));
    }
    let between = right[2] - left[2];
    let offset = if keys.has("doffs") { keys.number("doffs")? } else { between };
    if (offset - between).abs() > ROUNDING {
        return keys.contradiction(format!(
            "doffs = {offset}, but the principal points of cam0 and cam1 are {between} apart"
        ));
    }
    let (baseline, size) = (keys.number("baseline")?, (keys.side("width")?, keys.side("height")?));
    if baseline <= 0.0 {
        return keys.contradiction(format!("baseline = {baseline}: it must be positive"));
    }
    Ok(Calibration { focal, offset, baseline, size })
}

/// The lines `key=value` of a file.
struct Keys<'a> {
    path: &'a Path,
    lines: Vec<(usize, &'a str, &'a str)>,
}

type Read<T> = Result<T, InputError>;

impl<'a> Keys<'a> {
    fn new(text: &'a str, path: &'a Path) -> Read<Self> {
        let mut keys = Self { path, lines: Vec::new() };
        for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let Some((key, value)) = line.split_once('=') else {
                return keys.at(i + 1, "a line is `key=value`".into());
            };
            if keys.has(key.trim()) {
                return keys.at(i + 1, format!("{} is given twice", key.trim()));
            }
            keys.lines.push((i + 1, key.trim(), value.trim()));
        }
        Ok(keys)
    }

    fn at<T>(&self, line: usize, reason: String) -> Read<T> {
        Err(InputError::content(self.path, Location::Line(line), reason))
    }

    fn contradiction<T>(&self, reason: String) -> Read<T> {
        Err(InputError::content(self.path, Location::File, reason))
    }

    fn has(&self, key: &str) -> bool {
        self.lines.iter().any(|(_, known, _)| *known == key)
    }

    fn value(&self, key: &str) -> Read<(usize, &'a str)> {
        match self.lines.iter().find(|(_, known, _)| *known == key) {
            Some((line, _, value)) => Ok((*line, value)),
            None => self.contradiction(format!("`{key}` is missing; it is a line `{key}=..`")),
        }
    }

    fn number(&self, key: &str) -> Read<f64> {
        let (line, value) = self.value(key)?;
        match value.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => self.at(line, format!("{key} is \"{}\": it must be a finite number", Quoted(value))),
        }
    }

    fn side(&self, key: &str) -> Read<usize> {
        let (line, value) = self.value(key)?;
        match value.parse::<usize>() {
            Ok(side) if side > 0 => Ok(side),
            _ => self.at(
                line,
                format!("{key} is \"{}\": it must be a positive whole number of pixels", Quoted(value)),
            ),
        }
    }

    /// The nine numbers of `[a b c; d e f; g h i]`.
    fn matrix(&self, key: &str) -> Read<[f64; 9]> {
        let (line, value) = self.value(key)?;
        let inner = value.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or("");
        let words = inner.split([' ', ';', ',']).filter(|word| !word.is_empty());
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        match <[f64; 9]>::try_from(numbers) {
            Ok(matrix) if matrix.iter().all(|v| v.is_finite()) => Ok(matrix),
            _ => self.at(line, format!("{key} must be a 3 x 3 matrix [f 0 cx; 0 f cy; 0 0 1]")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "cam0=[3997.684 0 1176.728; 0 3997.684 1011.728; 0 0 1]\n\
        cam1=[3997.684 0 1307.839; 0 3997.684 1011.728; 0 0 1]\n\
        doffs=131.111\nbaseline=193.001\nwidth=2964\nheight=1988\nndisp=280\nisint=0\n";

    #[test]
    fn a_file_of_the_benchmark_is_read() {
        let found = parse_calibration(FILE, Path::new("calib.txt")).unwrap();
        let want = Calibration { focal: 3997.684, offset: 131.111, baseline: 193.001, size: (2964, 1988) };
        assert_eq!(found, want);
        let without = parse_calibration(&FILE.replace("doffs", "doff"), Path::new("c")).unwrap();
        assert!((without.offset - 131.111).abs() < 1e-9);
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        for (from, to, words) in [
            ("baseline=", "base=", "`baseline` is missing"),
            ("doffs=131.111", "doffs=99", "131.1"),
            ("doffs=131.111", "doffs=x", "calib.txt:3: doffs"),
            ("width=2964", "width=-2", "calib.txt:5: width"),
            ("[3997.684 0 1176.728;", "[3997.684 0;", "calib.txt:1: cam0"),
            ("cam0=[3997.684", "cam0=[-1", "focal lengths"),
            ("ndisp=280", "ndisp", "calib.txt:7: a line"),
            ("ndisp=280", "width=2", "given twice"),
            ("baseline=193.001", "baseline=0", "positive"),
        ] {
            let message = parse_calibration(&FILE.replace(from, to), Path::new("calib.txt"));
            let message = message.unwrap_err().to_string();
            assert!(message.contains(words), "{to}: {message}");
        }
    }
}
