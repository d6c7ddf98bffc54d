//! Finds the first line of numbers, and what the lines before it say.

use super::cells::{Cells, Numbers, may_be_thousands, remedy};
use super::headings::{self, Role, StatedRate};
use super::options::{Column, Decimal, Delimiter, TableOptions, TimeColumn};
use super::stamp::Stamp;
use super::text::Lines;
use crate::io::IoError;
use crate::messages::{Quoted, counted};
use std::collections::VecDeque;
use std::io::Read;

/// Most lines before the first one of numbers.
const MOST_LINES: usize = 1000;
/// Lines at hand after one with numbers in the chosen columns among which one of numbers alone is looked
/// for.
const LOOKED_AHEAD: usize = 256;
/// Lines above the first one of numbers in which headings are looked for.
const HEADINGS_ABOVE: usize = 4;
/// Most lines of a table of headings alone.
const HEADINGS: usize = 2;

/// A line with its number, from 1.
pub(super) type NumberedLine = (u64, Vec<u8>);

/// What a table says before its numbers.
#[derive(Default)]
pub(super) struct Preamble {
    pub(super) layout: Layout,
    /// The first lines of numbers.
    pub(super) ahead: VecDeque<NumberedLine>,
    /// Lines of numbers may have words of the preamble in the columns that hold nothing.
    pub(super) is_beside: bool,
    /// Headings, and the cells below them where there is a line of units; as many as the first line of
    /// numbers has cells.
    pub(super) names: Vec<String>,
    pub(super) units: Vec<String>,
    pub(super) stated: Option<StatedRate>,
    /// Columns that hold nothing and have no heading, as after a delimiter at the end of each line.
    pub(super) blank: Vec<bool>,
}

/// How lines are split, and the columns that the options name.
#[derive(Clone)]
pub(super) struct Layout {
    pub(super) delimiter: Delimiter,
    pub(super) chosen: Vec<usize>,
    pub(super) time: Option<usize>,
}

impl Default for Layout {
    fn default() -> Self {
        Self { delimiter: Delimiter::Comma, chosen: Vec::new(), time: None }
    }
}

impl Preamble {
    /// Reads up to the first line of numbers, or to the end. Where columns are chosen, the others may hold
    /// words; then it is the first line with numbers in those, unless one of numbers alone follows.
    pub(super) fn read<R: Read>(lines: &mut Lines<R>, options: &TableOptions) -> Result<Self, IoError> {
        let mut skipped: Vec<NumberedLine> = Vec::new();
        let mut among_words: Option<(Layout, usize)> = None;
        loop {
            if let Some((layout, at)) = &among_words
                && (!lines.is_more_at_hand() || skipped.len() - at >= LOOKED_AHEAD)
            {
                let (layout, ahead) = (layout.clone(), skipped.split_off(*at).into());
                return Ok(Self::found(layout, skipped, ahead));
            }
            let Some(line) = lines.next()? else { return Self::of_headings(lines, &skipped, options) };
            let line = line.to_vec();
            let line = (lines.number, line);
            let layout = layout_of(&line.1, &skipped, options);
            let is_of_numbers = layout_of(&line.1, &skipped, &options.without_columns()).is_some();
            let Some(layout) = layout.clone().filter(|_| is_of_numbers) else {
                if is_of_numbers {
                    return Err(lines.fault(&not_there(&skipped, options)));
                }
                if among_words.is_none() {
                    among_words = layout.map(|layout| (layout, skipped.len()));
                }
                skipped.push(line);
                if skipped.len() == MOST_LINES && among_words.is_none() {
                    return Err(lines.fault(&no_numbers(&skipped, options)));
                }
                continue;
            };
            let mut ahead = VecDeque::from([line]);
            // A line at hand tells whether the numbers are part of the preamble.
            if lines.is_more_at_hand()
                && let Some(next) = lines.next()?.map(<[u8]>::to_vec)
            {
                let is_headings = is_headings(&next, &ahead[0].1, layout.delimiter);
                if skipped.is_empty() && is_numbering(&ahead[0].1, &next, layout.delimiter) {
                    skipped.extend(ahead.pop_front());
                }
                ahead.push_back((lines.number, next));
                if is_headings {
                    skipped.extend(ahead);
                    continue;
                }
            }
            return Ok(Self::found(layout, skipped, ahead));
        }
    }

    /// A table without numbers: empty, or none at all.
    fn of_headings<R: Read>(
        lines: &Lines<R>,
        skipped: &[NumberedLine],
        options: &TableOptions,
    ) -> Result<Self, IoError> {
        if skipped.len() > HEADINGS || options.columns.iter().any(is_name) {
            return Err(lines.fault(&no_numbers(skipped, options)));
        }
        let Some((_, line)) = skipped.last() else { return Ok(Self::default()) };
        let has = |delimiter: &Delimiter| line.contains(&delimiter.byte());
        let delimiter = Delimiter::ALL.into_iter().find(has).unwrap_or(Delimiter::Comma);
        let names = split(line, options.delimiter.unwrap_or(delimiter));
        let units = vec![String::new(); names.len()];
        Ok(Self { blank: vec![false; names.len()], names, units, ..Self::default() })
    }

    fn found(layout: Layout, mut skipped: Vec<NumberedLine>, mut ahead: VecDeque<NumberedLine>) -> Self {
        let delimiter = layout.delimiter;
        let first = split(&ahead[0].1, delimiter);
        let plain = ahead.len();
        while skipped.last().is_some_and(|line| is_beside(&split(&line.1, delimiter), &first)) {
            ahead.extend(skipped.pop());
            ahead.rotate_right(1);
        }
        let cells: Vec<Vec<String>> =
            skipped.iter().map(|(_, line)| split_heading(line, delimiter)).collect();
        let (mut names, mut units) = headings_of(&cells, first.len());
        names.iter_mut().filter(|name| headings::is_of_preamble(name)).for_each(String::clear);
        names.resize(first.len(), String::new());
        units.resize(first.len(), String::new());
        // Settings of an instrument may stand in a column of their own, with `Time` among them.
        let is_blank = |(cell, name): (&String, &String)| {
            cell.is_empty() && (name.is_empty() || matches!(headings::role(name, ""), Role::Time(_)))
        };
        let blank = first.iter().zip(&names).map(is_blank).collect();
        let beside = ahead.len() - plain;
        let preamble = skipped.iter().chain(ahead.iter().take(beside));
        let words = |line: &[u8]| split(line, delimiter_of_words(line, delimiter));
        let cells: Vec<Vec<String>> = preamble.map(|(_, line)| words(line)).collect();
        let is_beside = beside > 0;
        Self { layout, ahead, is_beside, names, units, stated: headings::stated_rate(&cells), blank }
    }
}

/// What is said of a table in which no numbers were found.
fn no_numbers(lines: &[NumberedLine], options: &TableOptions) -> String {
    let names: Vec<String> =
        options.columns.iter().filter(|column| is_name(column)).map(Column::to_string).collect();
    let named = match names.as_slice() {
        [] => String::new(),
        names => format!(" in columns called {}", Quoted(names.join(", "))),
    };
    let last = lines.last().map_or(&[][..], |(_, line)| line);
    let cells = Delimiter::ALL.map(|delimiter| split(last, options.delimiter.unwrap_or(delimiter)));
    let cell = cells
        .iter()
        .filter(|cells| cells.len() > 1)
        .chain(&cells)
        .flatten()
        .find_map(|cell| Some((cell, remedy(cell)?)));
    let remedy = cell.map_or_else(
        || {
            "give one column per channel and one line per frame, with cells separated by , ; tab or space"
                .to_owned()
        },
        |(cell, remedy)| format!("the last one has \"{}\": {remedy}", Quoted(cell)),
    );
    format!("no line of numbers{named} among {}; {remedy}", counted(lines.len(), "line"))
}

/// What is said of columns that are not there.
fn not_there(before: &[NumberedLine], options: &TableOptions) -> String {
    let time = if let TimeColumn::Is(column) = &options.time { Some(column) } else { None };
    let asked: Vec<String> = options.columns.iter().chain(time).map(Column::to_string).collect();
    let headings = before.last().map_or_else(
        || "it has no headings".to_owned(),
        |(_, line)| format!("its headings are \"{}\"", Quoted(String::from_utf8_lossy(line).trim())),
    );
    format!("not all of the columns {} are there, or hold numbers; {headings}", Quoted(asked.join(", ")))
}

fn is_name(column: &Column) -> bool {
    matches!(column, Column::Name(_))
}

fn split(line: &[u8], delimiter: Delimiter) -> Vec<String> {
    let mut cells = Cells::new(delimiter);
    cells.split(line);
    cells.iter().map(str::to_owned).collect()
}

/// The cells of a heading, which may be a comment.
fn split_heading(line: &[u8], delimiter: Delimiter) -> Vec<String> {
    let Some(comment) = line.strip_prefix(b"#") else { return split(line, delimiter) };
    let mut cells = split(comment.trim_ascii_start(), delimiter);
    cells.first_mut().into_iter().for_each(|cell| cell.insert(0, '#'));
    cells
}

/// The delimiter of a line of words above numbers; of a single column there is none to be seen.
fn delimiter_of_words(line: &[u8], delimiter: Delimiter) -> Delimiter {
    let others = [Delimiter::Comma, Delimiter::Semicolon, Delimiter::Tab];
    match delimiter {
        Delimiter::Comma | Delimiter::Space => {
            others.into_iter().find(|other| line.contains(&other.byte())).unwrap_or(Delimiter::Comma)
        }
        other => other,
    }
}

/// How a line of numbers is split; `None` if it is none.
fn layout_of(line: &[u8], before: &[NumberedLine], options: &TableOptions) -> Option<Layout> {
    if line.starts_with(b"#") {
        return None;
    }
    let with_commas = options.decimal == Some(Decimal::Comma);
    let may_be = |delimiter: &Delimiter| match options.delimiter {
        Some(given) => *delimiter == given,
        // Cells in quotes may hold commas beside those that separate them.
        None => !with_commas || *delimiter != Delimiter::Comma || line.contains(&b'"'),
    };
    let single = if with_commas { Delimiter::Semicolon } else { Delimiter::Comma };
    let several = |delimiter: &Delimiter| split(line, *delimiter).len() > 1;
    let candidates = Delimiter::ALL.into_iter().filter(may_be).filter(several);
    candidates.chain([options.delimiter.unwrap_or(single)]).find_map(|delimiter| {
        let layout = Layout::resolve(delimiter, before, options)?;
        layout.is_row(&split(line, delimiter), options).then_some(layout)
    })
}

impl Layout {
    /// The columns that the options name, by the headings in the lines before; `None` if one is not there.
    fn resolve(delimiter: Delimiter, before: &[NumberedLine], options: &TableOptions) -> Option<Self> {
        let place = |column: &Column| match column {
            Column::Number(number) => Some(*number),
            Column::Name(name) => before.iter().rev().take(HEADINGS_ABOVE).find_map(|(_, line)| {
                split(line, delimiter).iter().position(|cell| cell.eq_ignore_ascii_case(name))
            }),
        };
        let chosen = options.columns.iter().map(place).collect::<Option<_>>()?;
        let time = match &options.time {
            TimeColumn::Is(column) => Some(place(column)?),
            TimeColumn::Found | TimeColumn::None => None,
        };
        Some(Self { delimiter, chosen, time })
    }

    /// True for cells that are numbers, one at least, where samples are; the time may be a date.
    fn is_row(&self, cells: &[String], options: &TableOptions) -> bool {
        if self.time.is_some_and(|time| time >= cells.len()) {
            return false;
        }
        let time = self.time.unwrap_or(0);
        let may_be_date = options.time != TimeColumn::None;
        let columns: Vec<usize> = match self.chosen.as_slice() {
            [] => (0..cells.len()).collect(),
            chosen => chosen.iter().copied().chain(self.time).collect(),
        };
        let mut numbers = Numbers { decimal: options.decimal };
        let mut count = 0;
        let mut is_held = |column: &usize| {
            let Some(cell) = cells.get(*column) else { return false };
            if may_be_date && *column == time && Stamp::parse(cell).is_some_and(|stamp| stamp.is_date) {
                return true;
            }
            let number = numbers.read(cell);
            // Whether a comma separates thousands is asked where the number is read.
            let is_number = number.is_some_and(f64::is_finite) || may_be_thousands(cell);
            count += usize::from(is_number);
            is_number || number.is_some()
        };
        columns.iter().all(&mut is_held) && count > 0
    }
}

/// True for a line of words only, with another number of cells than the line of numbers before it.
fn is_headings(line: &[u8], before: &[u8], delimiter: Delimiter) -> bool {
    let cells = split(line, delimiter);
    if cells.is_empty() || line.starts_with(b"#") {
        return false;
    }
    let is_word =
        |cell: &String| Numbers { decimal: None }.read(cell).is_none() && Stamp::parse(cell).is_none();
    cells.len() != split(before, delimiter).len() && cells.iter().all(is_word)
}

/// True for a line 0, 1, 2, .. of as many columns, two at least, above one with decimals: headings of a
/// program that has no others.
fn is_numbering(line: &[u8], next: &[u8], delimiter: Delimiter) -> bool {
    let (cells, below) = (split(line, delimiter), split(next, delimiter));
    let are_numbers = cells.iter().enumerate().all(|(column, cell)| *cell == column.to_string());
    are_numbers
        && cells.len() > 1
        && cells.len() == below.len()
        && below.iter().all(|cell| cell.contains('.'))
}

/// True for a line with numbers where `first` has them, and words where it has nothing: the preamble stands
/// beside the numbers.
fn is_beside(cells: &[String], first: &[String]) -> bool {
    let mut pairs = first.iter().enumerate().filter(|(_, cell)| !cell.is_empty());
    let is_number = |cell: &String| Numbers { decimal: None }.read(cell).is_some_and(f64::is_finite);
    first.iter().any(String::is_empty) && pairs.all(|(column, _)| cells.get(column).is_some_and(is_number))
}

/// The headings of so many columns, and the line of units below them. Both are the last lines with cells,
/// or a comment that has as many.
fn headings_of(lines: &[Vec<String>], columns: usize) -> (Vec<String>, Vec<String>) {
    let is_comment = |cells: &&Vec<String>| cells[0].starts_with('#');
    let mut last = lines.iter().rev().filter(|cells| !cells.iter().all(String::is_empty));
    let mut plain = last.clone().filter(|cells| !is_comment(cells));
    match (plain.next(), plain.next()) {
        (Some(units), Some(names)) if headings::is_of_units(&units[0]) => (names.clone(), units.clone()),
        (Some(names), _) => (names.clone(), Vec::new()),
        (None, _) => {
            let comment = last.find(|cells| columns > 1 && cells.len() == columns);
            let mut names = comment.cloned().unwrap_or_default();
            names.iter_mut().take(1).for_each(|name| *name = name.trim_start_matches(['#', ' ']).to_owned());
            (names, Vec::new())
        }
    }
}
