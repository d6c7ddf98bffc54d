//! Decimal commas that look like delimiters.

use super::cells::Cells;

/// Lines that are looked at: with two decimals one number in ten has a zero after its comma.
const LOOKED_AT: u32 = 10_000;

/// Looks for `0,082`, which is read as two whole numbers, where only whole numbers have been read so far: no
/// whole number begins with a zero, nor is one written -0.
#[derive(Debug, Default)]
pub(super) struct BareCommas {
    lines: u32,
    /// Nothing more is looked for.
    pub(super) is_over: bool,
}

impl BareCommas {
    /// What is wrong with a line.
    pub(super) fn find(&mut self, cells: &Cells) -> Option<String> {
        self.lines += 1;
        if self.is_over {
            return None;
        }
        let is_whole = |cell: &str| cell.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'-' | b'+'));
        let is_padded = |cell: &str| {
            let digits = cell.trim_start_matches(['-', '+']);
            digits.len() > 1 && digits.starts_with('0')
        };
        // Codes may be padded in all columns; quotes tell commas from delimiters.
        let is_even = cells.count.is_multiple_of(2);
        let pairs = || (0..cells.count / 2).map(|pair| (cells.get(2 * pair), cells.get(2 * pair + 1)));
        self.is_over = self.lines > LOOKED_AT
            || !is_even
            || !cells.iter().all(is_whole)
            || pairs().any(|(whole, _)| is_padded(whole));
        if self.is_over {
            return None;
        }
        let (whole, decimals) = pairs().find(|(whole, decimals)| *whole == "-0" || is_padded(decimals))?;
        let single = if cells.count == 2 { "--decimal comma, or " } else { "" };
        Some(format!(
            "{whole},{decimals} looks like one number with a decimal comma, which is the delimiter too; write the table with \
             ; between its cells or with decimal points, or state which mark the decimals have ({single}--decimal \
             point if these are two numbers)"
        ))
    }
}
