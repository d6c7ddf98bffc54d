//! Tracks: image positions of scene points, one line per point, one pair "x y" per view, "-" where not seen.

use super::Point;
use crate::files::{self, CHECK_THE_PATH, InputError, Location};
use hybank::messages::Quoted;
use std::path::Path;

/// What a line has, for messages.
const FORMAT: &str = "a track is \"x y\" for each view in order and \"-\" where the point is not seen";

/// Tracks over a number of columns (views).
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    columns: usize,
    rows: Vec<Vec<Option<Point>>>,
}

impl Tracks {
    /// Reads a track file; empty lines and text after a `#` are ignored. A point that is not seen is
    /// one `-`, or one for each coordinate.
    ///
    /// # Errors
    /// [`InputError`], with file and line.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&files::read_text(path, CHECK_THE_PATH, room)?, path)
    }

    /// The same from text; `path` appears in messages.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, InputError> {
        let fault = |line: usize, reason| InputError::content(path, Location::Line(line), reason);
        let mut lines = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let content = line.split('#').next().unwrap_or("");
            let words = words(content).map_err(|word| {
                fault(i + 1, format!("\"{}\" is neither a finite number nor \"-\"", Quoted(word)))
            })?;
            if !words.is_empty() {
                lines.push((i + 1, words));
            }
        }
        // One dash per point, unless only one dash per coordinate gives all lines the same number of
        // columns.
        let single = columns(&lines, one_dash);
        let rows = match columns(&lines, two_dashes) {
            Ok(rows) if single.is_err() => rows,
            _ => single.map_err(|(line, found, expected)| {
                fault(line, format!("{found} columns where the file has {expected}; {FORMAT}"))
            })?,
        };
        let empty = || InputError::content(path, Location::File, "there is no track in the file");
        let columns = rows.first().map(Vec::len).ok_or_else(empty)?;
        Ok(Self { columns, rows })
    }

    /// Number of views that the tracks run over.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The tracks.
    pub fn rows(&self) -> &[Vec<Option<Point>>] {
        &self.rows
    }
}

/// Bytes that the tracks of a text take while they are read, in both ways to count dashes.
fn room(text: &str) -> f64 {
    const WORD: f64 = 130.0;
    const LINE: f64 = 160.0;
    WORD * text.split_whitespace().count() as f64 + LINE * text.lines().count() as f64
}

type Words = Vec<Option<f64>>;
type Rows = Vec<Vec<Option<Point>>>;

/// Numbers, and `None` for each dash; the error is the word that is neither.
fn words(line: &str) -> Result<Words, String> {
    let word = |w: &str| match w {
        "-" => Ok(None),
        w => w.parse().ok().filter(|v: &f64| v.is_finite()).map(Some).ok_or_else(|| w.to_string()),
    };
    line.split_whitespace().map(word).collect()
}

/// Number of words in the first column of a line, and the point if there is one.
type Reading = fn(&[Option<f64>]) -> (usize, Option<Point>);

/// Reads all lines in one way; the error is the line, its columns and those of the first line.
fn columns(lines: &[(usize, Words)], read: Reading) -> Result<Rows, (usize, usize, usize)> {
    let mut rows = Rows::new();
    for (line, words) in lines {
        let (row, whole) = columns_of(words, read);
        let expected = rows.first().map_or(words.len().div_ceil(2), Vec::len);
        if !whole || (!rows.is_empty() && row.len() != expected) {
            return Err((*line, row.len(), expected));
        }
        rows.push(row);
    }
    Ok(rows)
}

/// The columns of a line, and whether all of them were complete.
fn columns_of(words: &[Option<f64>], read: Reading) -> (Vec<Option<Point>>, bool) {
    let (mut row, mut rest) = (Vec::new(), words);
    while !rest.is_empty() {
        let (taken, point) = read(rest);
        let column = &rest[..taken.min(rest.len())];
        if column.len() < taken || (point.is_none() && column.iter().any(Option::is_some)) {
            return (row, false);
        }
        row.push(point);
        rest = &rest[taken..];
    }
    (row, true)
}

fn one_dash(words: &[Option<f64>]) -> (usize, Option<Point>) {
    match words {
        [None, ..] => (1, None),
        [Some(x), Some(y), ..] => (2, Some(Point::new(*x, *y))),
        _ => (2, None),
    }
}

fn two_dashes(words: &[Option<f64>]) -> (usize, Option<Point>) {
    match words {
        [Some(x), Some(y), ..] => (2, Some(Point::new(*x, *y))),
        _ => (2, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Tracks, InputError> {
        Tracks::parse(text, Path::new("t.txt"))
    }

    #[test]
    fn one_dash_or_two_for_what_is_not_seen() {
        let want = [
            vec![Some(Point::new(1.0, 2.0)), None, Some(Point::new(3.0, 4.5))],
            vec![None, None, Some(Point::new(5.0, 6.0))],
            vec![Some(Point::new(1.0, 1.0)), Some(Point::new(2.0, 2.0)), Some(Point::new(3.0, 3.0))],
        ];
        let one = parse("# tracks\n1 2 - 3 4.5\n\n- - 5 6 # far\n1 1 2 2 3 3\n").unwrap();
        assert_eq!((one.columns(), one.rows()), (3, &want[..]));
        let two = parse("1 2 - - 3 4.5\n- - - - 5 6\n1 1 2 2 3 3\n").unwrap();
        assert_eq!(two, one);
    }

    #[test]
    fn wrong_lines_are_named() {
        let message = |text| parse(text).unwrap_err().to_string();
        assert!(message("1 2 3 4\n1 2 3 x\n").starts_with("t.txt:2: \"x\" is neither"));
        assert!(message("1 2 3 4\n1 2\n").starts_with("t.txt:2: 1 columns where the file has 2"));
        assert!(message("1 2 3\n").starts_with("t.txt:1:"));
        assert!(message("1 nan\n").contains("nan"));
        assert!(message("# nothing\n").contains("no track"));
        assert!(Tracks::read(Path::new("/nowhere")).unwrap_err().to_string().contains("/nowhere"));
    }
}
