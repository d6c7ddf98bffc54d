//! `calib.txt` of the Middlebury stereo benchmark (2014 and later): inner parameters of both cameras,
//! baseline and the difference of the principal points.

use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::Quoted;
use std::collections::BTreeMap;
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
    parse_calibration(&files::read_text(path, CHECK_THE_PATH)?, path)
}

/// The same from the text of the file; `path` appears in messages.
///
/// # Errors
/// [`InputError`].
pub fn parse_calibration(text: &str, path: &Path) -> Result<Calibration, InputError> {
    let keys = Keys::new(text, path)?;
    let refused = |reason: String| Err(InputError::file(path, reason));
    let [left, right] = [keys.matrix("cam0")?, keys.matrix("cam1")?];
    let focal = left[0];
    if !(focal > 0.0 && (right[0] - focal).abs() <= 1e-6 * focal) {
        return refused(format!(
            "the cameras have focal lengths {focal} and {}: those of a rectified pair are positive and equal",
            right[0]
        ));
    }
    let between = right[2] - left[2];
    let offset = if keys.values.contains_key("doffs") { keys.number("doffs")? } else { between };
    if (offset - between).abs() > ROUNDING {
        return refused(format!(
            "doffs = {offset}, but the principal points of cam0 and cam1 are {between} apart"
        ));
    }
    let (baseline, size) = (keys.number("baseline")?, (keys.side("width")?, keys.side("height")?));
    if baseline <= 0.0 {
        return refused(format!("baseline = {baseline}: it must be positive"));
    }
    Ok(Calibration { focal, offset, baseline, size })
}

/// The values of a file by their keys, with their lines.
struct Keys<'a> {
    path: &'a Path,
    values: BTreeMap<&'a str, (usize, &'a str)>,
}

impl<'a> Keys<'a> {
    fn new(text: &'a str, path: &'a Path) -> Result<Self, InputError> {
        let mut values = BTreeMap::new();
        for (line, content) in (1..).zip(text.lines()).filter(|(_, content)| !content.trim().is_empty()) {
            let fault = |reason: String| InputError::content(path, format!(":{line}"), reason);
            let (key, value) =
                content.split_once('=').ok_or_else(|| fault("a line is `key=value`".into()))?;
            if values.insert(key.trim(), (line, value.trim())).is_some() {
                return Err(fault(format!("{} is given twice", key.trim())));
            }
        }
        Ok(Self { path, values })
    }

    /// What `read` makes of a value; `rule` says what it must be.
    fn get<T>(&self, key: &str, rule: &str, read: impl Fn(&str) -> Option<T>) -> Result<T, InputError> {
        let Some((line, value)) = self.values.get(key) else {
            return Err(InputError::file(self.path, format!("`{key}` is missing; it is a line `{key}=..`")));
        };
        read(value).ok_or_else(|| {
            let reason = format!("{key} is \"{}\": it must be {rule}", Quoted(value));
            InputError::content(self.path, format!(":{line}"), reason)
        })
    }

    fn number(&self, key: &str) -> Result<f64, InputError> {
        self.get(key, "a finite number", |value| value.parse().ok().filter(|v: &f64| v.is_finite()))
    }

    fn side(&self, key: &str) -> Result<usize, InputError> {
        self.get(key, "a positive whole number of pixels", |value| value.parse().ok().filter(|n| *n > 0))
    }

    fn matrix(&self, key: &str) -> Result<[f64; 9], InputError> {
        self.get(key, "a 3 x 3 matrix [f 0 cx; 0 f cy; 0 0 1]", |value| {
            let inner = value.strip_prefix('[')?.strip_suffix(']')?;
            let words = inner.split([' ', ';', ',']).filter(|word| !word.is_empty());
            let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
            <[f64; 9]>::try_from(numbers).ok().filter(|matrix| matrix.iter().all(|v| v.is_finite()))
        })
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
