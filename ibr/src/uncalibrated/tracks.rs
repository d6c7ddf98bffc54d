//! Tracks: image positions of scene points, one line per point, one pair "x y" per view, "-" where not seen.

use super::Point;
use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::Quoted;
use std::path::Path;

/// What a line has, for messages.
const FORMAT: &str = "a track is \"x y\" for each view in order and \"-\" where the point is not seen";

/// Tracks over a number of columns (views).
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    rows: Vec<Vec<Option<Point>>>,
}

impl Tracks {
    /// Reads a track file; empty lines and text after a `#` are ignored.
    ///
    /// # Errors
    /// [`InputError`], with file and line.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&files::read_text(path, CHECK_THE_PATH)?, path)
    }

    /// The same from text; `path` appears in messages.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, InputError> {
        let mut tracks = Self { rows: Vec::new() };
        for (i, line) in text.lines().enumerate() {
            let fault = |reason| InputError::content(path, format!(":{}", i + 1), reason);
            let row = columns(line.split('#').next().unwrap_or("")).map_err(fault)?;
            if row.is_empty() {
                continue;
            }
            let columns = tracks.rows.first().map_or(row.len(), Vec::len);
            if row.len() != columns {
                let reason = format!("{} columns where the file has {columns}; {FORMAT}", row.len());
                return Err(fault(reason));
            }
            tracks.rows.push(row);
        }
        let empty = || InputError::file(path, "there is no track in the file");
        (!tracks.rows.is_empty()).then_some(tracks).ok_or_else(empty)
    }

    /// Number of views that the tracks run over.
    pub fn columns(&self) -> usize {
        self.rows[0].len()
    }

    /// The tracks.
    pub fn rows(&self) -> &[Vec<Option<Point>>] {
        &self.rows
    }
}

/// The columns of a line.
fn columns(line: &str) -> Result<Vec<Option<Point>>, String> {
    let mut words = line.split_whitespace();
    let mut row = Vec::new();
    while let Some(word) = words.next() {
        let point = match word {
            "-" => None,
            x => {
                let y = words.next().filter(|y| *y != "-");
                let y = y.ok_or_else(|| format!("\"{}\" has no second coordinate; {FORMAT}", Quoted(x)))?;
                Some(Point::new(number(x)?, number(y)?))
            }
        };
        row.push(point);
    }
    Ok(row)
}

fn number(word: &str) -> Result<f64, String> {
    let number = word.parse().ok().filter(|v: &f64| v.is_finite());
    number.ok_or_else(|| format!("\"{}\" is neither a finite number nor \"-\"", Quoted(word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Tracks, InputError> {
        Tracks::parse(text, Path::new("t.txt"))
    }

    #[test]
    fn a_dash_is_for_what_is_not_seen() {
        let want = [
            vec![Some(Point::new(1.0, 2.0)), None, Some(Point::new(3.0, 4.5))],
            vec![None, None, Some(Point::new(5.0, 6.0))],
            vec![Some(Point::new(1.0, 1.0)), Some(Point::new(2.0, 2.0)), Some(Point::new(3.0, 3.0))],
        ];
        let one = parse("# tracks\n1 2 - 3 4.5\n\n- - 5 6 # far\n1 1 2 2 3 3\n").unwrap();
        assert_eq!((one.columns(), one.rows()), (3, &want[..]));
        assert!(
            parse("1 2 - - 3 4.5\n1 1 2 2 3 3\n").unwrap_err().to_string().starts_with("t.txt:2: 3 columns")
        );
    }

    #[test]
    fn wrong_lines_are_named() {
        let message = |text| parse(text).unwrap_err().to_string();
        assert!(message("1 2 3 4\n1 2 3 x\n").starts_with("t.txt:2: \"x\" is neither"));
        assert!(message("1 2 3 4\n1 2\n").starts_with("t.txt:2: 1 columns where the file has 2"));
        assert!(message("1 2 3\n").starts_with("t.txt:1: \"3\" has no second"));
        assert!(message("1 - 3\n").starts_with("t.txt:1: \"1\" has no second"));
        assert!(message("1 nan\n").contains("nan"));
        assert!(message("# nothing\n").contains("no track"));
        assert!(Tracks::read(Path::new("/nowhere")).unwrap_err().to_string().contains("/nowhere"));
    }
}
