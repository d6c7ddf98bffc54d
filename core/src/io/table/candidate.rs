//! Which column of a table may be the time.

use super::Table;
use super::headings::{Role, unit_by_size};
use super::options::{TableOptions, TimeColumn};
use super::stamp::Stamp;
use crate::io::IoError;
use std::io::Read;

/// Lines that show a ramp, as chance does not.
const RAMP: usize = 16;

/// A column that may be the time, before its stamps are judged.
pub(super) struct Candidate {
    pub(super) column: usize,
    pub(super) role: Role,
    /// The table is refused if it is none; else it is a channel then.
    pub(super) is_certain: bool,
    pub(super) stamps: Vec<Stamp>,
}

impl Candidate {
    /// The column that the options or the headings name, or a first column that may be a ramp.
    pub(super) fn of<R: Read>(table: &Table<R>, options: &TableOptions) -> Option<Self> {
        let certain = |column, role| Some(Self { column, role, is_certain: true, stamps: Vec::new() });
        match (&options.time, table.time()) {
            (TimeColumn::None, _) => return None,
            (TimeColumn::Is(_), Some(column)) if column < table.width() => {
                let role = table.role(column);
                return certain(column, if role == Role::Other { Role::Time(Some(1.0)) } else { role });
            }
            _ => {}
        }
        let (first, columns) = (table.first_column()?, table.columns());
        let role = table.role(first);
        match role {
            _ if !options.columns.is_empty() && columns.contains(&first) => None,
            Role::Index if table.width() > 2 && matches!(table.role(1), Role::Time(_)) => {
                certain(1, table.role(1))
            }
            Role::Time(_) => certain(first, role),
            // Instruments that state the rate number their lines.
            Role::Index if columns.len() > 1 && table.stated_rate().is_some() => certain(first, role),
            Role::Index | Role::Other if columns.len() > 1 && options.columns.is_empty() => {
                Some(Self { column: first, role, is_certain: false, stamps: Vec::new() })
            }
            _ => None,
        }
    }

    /// Lines without which nothing can be said.
    pub(super) fn least_lines(&self) -> usize {
        if self.is_certain || self.role == Role::Index { 2 } else { RAMP }
    }

    /// Takes the stamp of the next line; false if it shows that the column is a channel.
    pub(super) fn take<R: Read>(&mut self, table: &mut Table<R>) -> Result<bool, IoError> {
        let stamp = match table.stamp(self.column) {
            Ok(stamp) => stamp,
            Err(error) => return if self.is_certain { Err(error) } else { Ok(false) },
        };
        if stamp.is_date && self.stamps.is_empty() {
            (self.role, self.is_certain) = (Role::Time(None), true);
        }
        let is_later = self.stamps.last().is_none_or(|last| stamp.since(*last) > 0.0);
        self.stamps.push(stamp);
        Ok(is_later || self.is_certain)
    }

    /// In seconds, if it is known.
    pub(super) fn unit(&self) -> Option<f64> {
        let first = self.stamps.first()?;
        match self.role {
            Role::Time(_) if first.is_date => Some(1.0),
            Role::Time(unit) => Some(unit.unwrap_or_else(|| unit_by_size(first.value()))),
            Role::Index | Role::Other => None,
        }
    }
}
