//! What a user may say of a table.

use std::fmt;
use std::str::FromStr;

/// How a table is read; by default everything is found out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableOptions {
    /// Lines at the beginning that are not looked at.
    pub skip_lines: u64,
    /// What stands between two cells.
    pub delimiter: Option<Delimiter>,
    /// The mark before the decimals.
    pub decimal: Option<Decimal>,
    /// The columns that are channels, in this order; all but the time if there are none.
    pub columns: Vec<Column>,
    /// The column that says when each line was taken.
    pub time: TimeColumn,
    /// The rate is known from elsewhere: the times are left out without being judged.
    pub is_rate_known: bool,
}

impl TableOptions {
    /// True if anything of how the table is written was said.
    pub(in crate::io) fn is_layout_given(&self) -> bool {
        Self { is_rate_known: false, ..self.clone() } != Self::default()
    }

    /// The same, with the columns left to the table.
    pub(super) fn without_columns(&self) -> Self {
        Self { columns: Vec::new(), time: TimeColumn::Found, ..self.clone() }
    }
}

/// A column of a table. It reads from its number, counted from 1, or its heading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Column {
    /// By its place, from 0.
    Number(usize),
    /// By its heading; upper and lower case are the same.
    Name(String),
}

impl FromStr for Column {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text.trim(), text.trim().parse::<usize>()) {
            ("", _) | (_, Ok(0)) => Err("give the heading of a column, or its number from 1".to_owned()),
            (_, Ok(number)) => Ok(Self::Number(number - 1)),
            (name, Err(_)) => Ok(Self::Name(name.to_owned())),
        }
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(column) => write!(f, "{}", column + 1),
            Self::Name(name) => f.write_str(name),
        }
    }
}

/// Which column is the time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum TimeColumn {
    /// A first column whose heading names the time, or that is a steady ramp.
    #[default]
    Found,
    /// None: all columns are channels.
    None,
    /// This one.
    Is(Column),
}

/// `none`, or a [`Column`].
impl FromStr for TimeColumn {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" { Ok(Self::None) } else { text.parse().map(Self::Is) }
    }
}

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delimiter {
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
    /// `,`
    Comma,
    /// Spaces, any number of them.
    Space,
}

impl Delimiter {
    /// In the order in which they are tried: a comma may be a decimal mark, and spaces may stand anywhere.
    pub(super) const ALL: [Self; 4] = [Self::Semicolon, Self::Tab, Self::Comma, Self::Space];

    pub(super) fn byte(self) -> u8 {
        match self {
            Self::Semicolon => b';',
            Self::Tab => b'\t',
            Self::Comma => b',',
            Self::Space => b' ',
        }
    }
}

impl FromStr for Delimiter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            ";" | "semicolon" => Ok(Self::Semicolon),
            "tab" | "\\t" | "\t" => Ok(Self::Tab),
            "," | "comma" => Ok(Self::Comma),
            "space" | " " => Ok(Self::Space),
            _ => Err("give one of , ; tab space".to_owned()),
        }
    }
}

/// The mark before the decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimal {
    /// `0.5`
    Point,
    /// `0,5`
    Comma,
}

impl FromStr for Decimal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "point" | "." => Ok(Self::Point),
            "comma" | "," => Ok(Self::Comma),
            _ => Err("give point or comma".to_owned()),
        }
    }
}
