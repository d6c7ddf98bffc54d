//! How tables are read.

use hybank::io::table::{Column, Decimal, Delimiter, TableOptions, TimeColumn};

/// Options of the commands that read tables.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct TableArgs {
    /// Lines at the beginning of a table that are not looked at; a preamble is found without it
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        hide_short_help = true,
        help_heading = "Tables"
    )]
    skip_lines: u64,
    /// The columns of a table that are channels, by number from 1 or by heading: 2,3 or left,right
    /// [default: all but the time]
    #[arg(long, value_name = "C,..", value_delimiter = ',', hide_short_help = true, help_heading = "Tables")]
    columns: Vec<Column>,
    /// The column of a table that says when each line was taken, by number or by heading, or none
    /// [default: a first column that is called time, or that is a steady ramp]
    #[arg(long, value_name = "C", hide_short_help = true, help_heading = "Tables")]
    time_column: Option<TimeColumn>,
    /// What stands between the cells of a table: , ; tab or space [default: found]
    #[arg(long, value_name = "D", hide_short_help = true, help_heading = "Tables")]
    delimiter: Option<Delimiter>,
    /// The mark before the decimals in a table: point or comma [default: found]
    #[arg(long, value_name = "MARK", hide_short_help = true, help_heading = "Tables")]
    decimal: Option<Decimal>,
}

impl TableArgs {
    /// For the reader.
    pub(super) fn options(&self) -> TableOptions {
        TableOptions {
            skip_lines: self.skip_lines,
            delimiter: self.delimiter,
            decimal: self.decimal,
            columns: self.columns.clone(),
            time: self.time_column.clone().unwrap_or_default(),
            ..TableOptions::default()
        }
    }
}
