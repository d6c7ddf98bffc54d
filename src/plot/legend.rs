//! The legend of a chart, in rows above it: there it hides nothing.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontDesc, IntoFont};

/// plotters rounds SVG points to whole pixels, so charts are drawn larger and the view box scales them down.
pub(super) const OVERSIZE: u32 = 4;

/// Pixels of a row, a sample of a line, and what separates things; all before enlargement.
const ROW: i32 = 23;
const SAMPLE: i32 = 26;
const GAP: i32 = 8;
const FONT: u32 = 15;
/// Mean width of a letter over its height.
pub(super) const LETTER: f64 = 0.56;

/// Dashes of a line, enlarged pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dashes {
    pub(super) on: i32,
    pub(super) off: i32,
}

/// How a curve or a kind of points looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Look {
    Line(Option<Dashes>),
    Points,
}

/// One line of the legend.
pub(super) struct LegendEntry<'a> {
    pub(super) label: &'a str,
    pub(super) look: Look,
    pub(super) style: ShapeStyle,
}

impl LegendEntry<'_> {
    fn width(&self) -> i32 {
        SAMPLE + 3 * GAP + (f64::from(FONT) * LETTER * self.label.chars().count() as f64) as i32
    }
}

/// Entries with their places, and the rows they take.
pub(super) struct Legend<'a> {
    entries: Vec<(LegendEntry<'a>, (i32, i32))>,
    rows: i32,
}

impl<'a> Legend<'a> {
    /// As many entries in a row of `width` pixels as have room there.
    pub(super) fn new(entries: impl Iterator<Item = LegendEntry<'a>>, width: i32) -> Self {
        let (mut x, mut row) = (GAP, 0);
        let mut place = |entry: LegendEntry<'a>| {
            if x > GAP && x + entry.width() > width {
                (x, row) = (GAP, row + 1);
            }
            let at = (x, row * ROW);
            x += entry.width();
            (entry, at)
        };
        let entries = entries.map(&mut place).collect();
        Self { entries, rows: row + 1 }
    }

    /// Enlarged pixels.
    pub(super) fn height(&self) -> u32 {
        (self.rows * ROW) as u32 * OVERSIZE
    }

    /// Draws all entries.
    pub(super) fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let enlarged = |x: i32| x * OVERSIZE as i32;
        for (LegendEntry { label, look, style }, (x, y)) in &self.entries {
            let middle = enlarged(y + ROW / 2);
            let line = [(enlarged(*x), middle), (enlarged(x + SAMPLE), middle)];
            match look {
                Look::Line(None) => area.draw(&PathElement::new(line, *style))?,
                Look::Line(Some(Dashes { on, off })) => {
                    area.draw(&DashedPathElement::new(line, on / 2, off / 2, *style))?;
                }
                Look::Points => {
                    area.draw(&Circle::new((enlarged(x + SAMPLE / 2), middle), enlarged(3), *style))?;
                }
            }
            let style = TextStyle::from(letters(FONT * OVERSIZE)).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(*label, (enlarged(x + SAMPLE + GAP), middle), style))?;
        }
        Ok(())
    }
}

/// Letters of so many enlarged pixels.
pub(super) fn letters(size: u32) -> FontDesc<'static> {
    ("sans-serif", size).into_font()
}
