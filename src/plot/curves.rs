//! How curves look: their colours, widths and dashes, and stems.

use super::legend::{Dashes, Look, OVERSIZE};
use plotters::prelude::*;

const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(80, 80, 80),
];
/// From the uppermost curve down: dark over pale, so that each shows where another lies on it.
const OVERLAID: [RGBColor; 3] = [RGBColor(20, 74, 144), RGBColor(240, 150, 130), RGBColor(200, 200, 200)];

/// Curves nearer to each other than this share of the height look like one.
const SAME_PLACE: f64 = 0.005;
/// Share of the distance of two stems of a curve that those of all curves take.
const STEMS_SHARE: f64 = 0.6;
/// Stems of two curves are no farther apart.
const MOST_APART: f64 = 0.2;

/// What the curves of a chart are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Curves {
    /// Functions.
    #[default]
    Lines,
    /// Values at whole numbers: stems from zero, those of several curves side by side.
    Stems,
    /// Functions that lie over one another, as spectra do.
    Overlaid,
}

/// An upright line across a chart, with its text.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// Beside the line.
    pub label: String,
    /// On the x axis.
    pub x: f64,
}

impl Curves {
    /// Of curve k of `count`.
    pub(super) fn style(self, k: usize, count: usize) -> ShapeStyle {
        let above = count.saturating_sub(k + 1);
        match self {
            Self::Overlaid if above == 0 => OVERLAID[0].stroke_width(OVERSIZE + OVERSIZE / 4),
            Self::Overlaid => OVERLAID[above.min(OVERLAID.len() - 1)].stroke_width(2 * OVERSIZE),
            Self::Lines | Self::Stems => line_style(&COLOURS[k % COLOURS.len()]),
        }
    }

    /// By how much the stems of curve k of `count` lie beside their whole numbers.
    pub(super) fn shift(self, k: usize, count: usize) -> f64 {
        match self {
            Self::Stems => {
                (k as f64 - 0.5 * (count as f64 - 1.0)) * (STEMS_SHARE / count as f64).min(MOST_APART)
            }
            Self::Lines | Self::Overlaid => 0.0,
        }
    }

    /// Of all curves; a line over others in the same place has dashes.
    pub(super) fn looks(self, curves: &[&[(f64, f64)]], height: f64) -> Vec<Look> {
        let covered =
            |k: usize| curves[..k].iter().filter(|earlier| covers(curves[k], earlier, height)).count();
        let look = |k: usize| match self {
            Self::Lines => Look::Line(dashes_over(covered(k))),
            Self::Stems => Look::Points,
            Self::Overlaid => Look::Line(None),
        };
        (0..curves.len()).map(look).collect()
    }
}

/// The colours of marks that have none, after those of so many curves.
pub(super) fn colours_after(count: usize) -> impl Iterator<Item = &'static RGBColor> {
    COLOURS.iter().cycle().skip(count)
}

pub(super) fn line_style(colour: &RGBColor) -> ShapeStyle {
    colour.stroke_width(OVERSIZE + OVERSIZE / 2)
}

/// For a line over so many others that lie in the same place; each shows in the gaps of the next one.
fn dashes_over(covered: usize) -> Option<Dashes> {
    let covered = i32::try_from(covered).unwrap_or(i32::MAX);
    let unit = OVERSIZE as i32;
    (covered > 0).then(|| Dashes { on: (12 / covered).max(2) * unit, off: 10 * unit })
}

/// Whether most of a curve lies on an earlier one: one colour would hide the other.
fn covers(curve: &[(f64, f64)], earlier: &[(f64, f64)], height: f64) -> bool {
    let both = curve.iter().zip(earlier).filter(|(a, b)| a.1.is_finite() && b.1.is_finite());
    let near = both.clone().filter(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < SAME_PLACE * height).count();
    near > 0 && 2 * near >= both.count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stems of a number stay nearer to it than to the next one, and no two of them coincide.
    #[test]
    fn stems_are_side_by_side() {
        for count in 1..=6 {
            let shifts: Vec<f64> = (0..count).map(|k| Curves::Stems.shift(k, count)).collect();
            assert!(shifts.windows(2).all(|pair| pair[1] - pair[0] > 0.05), "{shifts:?}");
            assert!(shifts.iter().all(|shift| shift.abs() < 0.5) && shifts.iter().sum::<f64>().abs() < 1e-12);
        }
    }

    #[test]
    fn the_uppermost_of_overlaid_curves_is_the_thinnest() {
        let width = |k: usize| Curves::Overlaid.style(k, 2).stroke_width;
        assert!(width(1) < width(0));
        assert_ne!(Curves::Overlaid.style(0, 2).color, Curves::Overlaid.style(1, 2).color);
    }
}
