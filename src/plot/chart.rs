//! Line charts, and their SVG text.

use super::legend::{Dashes, Entry, Legend, Look, OVERSIZE, letters};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

const WIDTH: u32 = 960;
const HEIGHT: u32 = 450;
/// The size of the drawing.
pub(super) const ENLARGED: (u32, u32) = (WIDTH * OVERSIZE, HEIGHT * OVERSIZE);
/// Pixels left and right of all.
const SIDE: u32 = 10;
/// Curves that differ by less than this share of their values are drawn as level.
const LEAST_SHARE: f64 = 1e-3;
/// Share of an axis by which it goes on after its last point.
const END: f64 = 1e-9;
/// Curves nearer to each other than this share of the height look like one.
const SAME_PLACE: f64 = 0.005;
const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(80, 80, 80),
];

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Legend text.
    pub label: String,
    /// Points (x, y); points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// Points of one kind, each with a text beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Marks {
    /// Legend text.
    pub label: String,
    /// Points (x, y) and their texts; points that are not finite are left out.
    pub points: Vec<(f64, f64, String)>,
}

/// The axes of a chart that is being drawn.
type Axes<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The ranges of both axes.
pub(super) type Ranges = (Range<f64>, Range<f64>);

pub(super) type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Curves over a common axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Text under the x axis, with its unit.
    pub x_label: String,
    /// Text beside the y axis, with its unit.
    pub y_label: String,
    /// The curves, drawn in this order.
    pub series: Vec<Series>,
}

/// A chart that could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// No finite point in any series.
    #[error("the chart `{title}` has no finite point to draw")]
    Empty {
        /// Title of the chart.
        title: String,
    },
    /// The drawing library failed.
    #[error("the chart `{title}` could not be drawn: {reason}")]
    Drawing {
        /// Title of the chart.
        title: String,
        /// The library's message.
        reason: String,
    },
}

impl Chart {
    /// The chart as SVG text.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.to_svg_with(&[])
    }

    /// The chart as SVG text with points over the curves, in the colours that follow those of the curves.
    pub fn to_svg_with(&self, marks: &[Marks]) -> Result<String, PlotError> {
        let ranges = self.ranges(marks)?;
        let mut svg = String::new();
        self.draw(SVGBackend::with_string(&mut svg, ENLARGED), marks, ranges)
            .map_err(|error| self.failed(&error))?;
        Ok(scale_by_view_box(&svg))
    }

    pub(super) fn failed(&self, error: &dyn std::fmt::Display) -> PlotError {
        PlotError::Drawing { title: self.title.clone(), reason: error.to_string() }
    }

    pub(super) fn ranges(&self, marks: &[Marks]) -> Result<Ranges, PlotError> {
        let marked = || marks.iter().flat_map(|m| &m.points).map(|(x, y, _)| (*x, *y));
        let drawn = || self.series.iter().flat_map(|s| &s.points).copied().chain(marked());
        let points = || drawn().filter(|p| p.0.is_finite() && p.1.is_finite());
        if points().next().is_none() {
            return Err(PlotError::Empty { title: self.title.clone() });
        }
        let (across, up) = (extent(points().map(|p| p.0)), extent(points().map(|p| p.1)));
        Ok((widened(&across, 0.0, 0.0), widened(&up, 0.06, LEAST_SHARE)))
    }

    fn looks(&self, height: f64) -> Vec<Look> {
        let covered = |k: usize| {
            self.series[..k].iter().filter(|earlier| covers(&self.series[k], earlier, height)).count()
        };
        (0..self.series.len()).map(|k| Look::Line(dashes_over(covered(k)))).collect()
    }

    fn entries<'a>(&'a self, looks: &'a [Look], marks: &'a [Marks]) -> impl Iterator<Item = Entry<'a>> {
        let lines = self.series.iter().zip(looks).map(|(series, look)| (series.label.as_str(), *look));
        let points = marks.iter().map(|marks| (marks.label.as_str(), Look::Points));
        lines.chain(points).zip(COLOURS.iter().cycle()).map(|((label, look), colour)| {
            let style = if look == Look::Points { colour.filled() } else { line_style(colour) };
            Entry { label, look, style }
        })
    }

    pub(super) fn draw<B: DrawingBackend>(&self, backend: B, marks: &[Marks], (x, y): Ranges) -> Drawn<B> {
        let root = backend.into_drawing_area();
        root.fill(&WHITE)?;
        let looks = self.looks(y.end - y.start);
        let legend = Legend::new(self.entries(&looks, marks), (WIDTH - 2 * SIDE) as i32);
        let below = root.margin(8 * OVERSIZE, 8 * OVERSIZE, SIDE * OVERSIZE, SIDE * OVERSIZE);
        let (title, below) = below.split_vertically(28 * OVERSIZE);
        // At the left, where a narrow screen begins.
        title.draw(&Text::new(self.title.as_str(), (8 * OVERSIZE as i32, 3 * OVERSIZE as i32), text(18)))?;
        let (above, below) = below.split_vertically(legend.height());
        legend.draw(&above)?;
        let mut chart = ChartBuilder::on(&below)
            .margin_top(4 * OVERSIZE)
            .margin_right(14 * OVERSIZE)
            .x_label_area_size(44 * OVERSIZE)
            .y_label_area_size(72 * OVERSIZE)
            .build_cartesian_2d(x, y)?;
        self.draw_axes(&mut chart)?;
        self.draw_lines(&mut chart, &looks)?;
        self.draw_marks(&mut chart, marks)?;
        root.present()?;
        Ok(())
    }

    fn draw_axes<B: DrawingBackend>(&self, chart: &mut Axes<'_, B>) -> Drawn<B> {
        let (across, up) = (Labels::over(&chart.x_range()), Labels::over(&chart.y_range()));
        chart
            .configure_mesh()
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_label_formatter(&|value| across.text(*value))
            .y_label_formatter(&|value| up.text(*value))
            .label_style(text(15))
            .axis_desc_style(text(15))
            .light_line_style(RGBColor(238, 238, 238))
            .draw()?;
        Ok(())
    }

    fn draw_lines<B: DrawingBackend>(&self, chart: &mut Axes<'_, B>, looks: &[Look]) -> Drawn<B> {
        for ((series, look), colour) in self.series.iter().zip(looks).zip(COLOURS.iter().cycle()) {
            let points = series.points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite());
            let style = line_style(colour);
            match *look {
                Look::Line(Some(Dashes { on, off })) => {
                    chart.draw_series(DashedLineSeries::new(points, on, off, style))?;
                }
                _ => drop(chart.draw_series(LineSeries::new(points, style))?),
            }
        }
        Ok(())
    }

    /// Circles with their texts above them.
    fn draw_marks<B: DrawingBackend>(&self, chart: &mut Axes<'_, B>, marks: &[Marks]) -> Drawn<B> {
        let text_style = TextStyle::from(text(12)).color(&RGBColor(60, 60, 60));
        for (marks, colour) in marks.iter().zip(COLOURS.iter().cycle().skip(self.series.len())) {
            let points = || marks.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
            let radius = 3 * OVERSIZE as i32;
            chart.draw_series(points().map(|(x, y, _)| Circle::new((*x, *y), radius, colour.filled())))?;
            let above = |(x, y, text): &(f64, f64, String)| {
                let place = (-(text.chars().count() as i32) * radius, -16 * OVERSIZE as i32);
                EmptyElement::at((*x, *y)) + Text::new(text.clone(), place, text_style.clone())
            };
            chart.draw_series(points().filter(|(.., text)| !text.is_empty()).map(above))?;
        }
        Ok(())
    }
}

fn text(size: u32) -> FontDesc<'static> {
    letters(size * OVERSIZE)
}

/// For a line over so many others that lie in the same place; each shows in the gaps of the next one.
fn dashes_over(covered: usize) -> Option<Dashes> {
    let covered = i32::try_from(covered).unwrap_or(i32::MAX);
    let unit = OVERSIZE as i32;
    (covered > 0).then(|| Dashes { on: (12 / covered).max(2) * unit, off: 10 * unit })
}

/// Whether most of a curve lies on an earlier one: one colour would hide the other.
fn covers(series: &Series, earlier: &Series, height: f64) -> bool {
    let both = series.points.iter().zip(&earlier.points).filter(|(a, b)| a.1.is_finite() && b.1.is_finite());
    let near = both.clone().filter(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < SAME_PLACE * height).count();
    near > 0 && 2 * near >= both.count()
}

fn line_style(colour: &RGBColor) -> ShapeStyle {
    colour.stroke_width(OVERSIZE + OVERSIZE / 2)
}

/// Numbers at an axis, with the decimals that tell neighbours apart.
struct Labels {
    decimals: usize,
    is_scientific: bool,
}

impl Labels {
    fn over(range: &Range<f64>) -> Self {
        let size = (range.end - range.start).log10();
        Self {
            decimals: (2.0 - size).ceil().clamp(0.0, 12.0) as usize,
            is_scientific: !(-9.0..7.0).contains(&size),
        }
    }

    fn text(&self, value: f64) -> String {
        if self.is_scientific {
            return format!("{value:.3e}");
        }
        let text = format!("{value:.*}", self.decimals);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        // A rounded zero may have a sign.
        if text == "-0" { "0".to_owned() } else { text.to_owned() }
    }
}

fn extent(values: impl Iterator<Item = f64>) -> Range<f64> {
    values.fold(f64::INFINITY..f64::NEG_INFINITY, |range, v| range.start.min(v)..range.end.max(v))
}

/// With `share` of the length on both sides; at least `least` of the size of the numbers long.
fn widened(range: &Range<f64>, share: f64, least: f64) -> Range<f64> {
    let (low, high, size) = (range.start, range.end, range.start.abs().max(range.end.abs()));
    let margin = match high - low {
        0.0 => 0.5 * size.max(1.0),
        span => (share * span).max(0.5 * (least * size - span)),
    };
    // A tick at the end must not be lost by rounding.
    let slack = END * (high - low);
    low - margin - slack..high + margin + slack
}

fn scale_by_view_box(svg: &str) -> String {
    let large = format!("width=\"{}\" height=\"{}\"", ENLARGED.0, ENLARGED.1);
    svg.replacen(&large, &format!("width=\"{WIDTH}\" height=\"{HEIGHT}\""), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let series = vec![Series { label: "error <1>".into(), points }];
        Chart { title: "t".into(), x_label: "x".into(), y_label: "y".into(), series }
    }

    #[test]
    fn marks_are_drawn_with_their_texts() {
        let points = vec![(1.0, 2.0, "spur".to_owned()), (f64::NAN, 0.0, "absent".to_owned())];
        let marks = [Marks { label: "offset".into(), points }];
        let svg = chart(vec![(0.0, 1.0), (2.0, 3.0)]).to_svg_with(&marks).unwrap();
        // One circle for the point and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("spur") && svg.contains("offset") && !svg.contains("absent"));
    }

    #[test]
    fn a_chart_is_svg_with_its_texts() {
        let svg = chart(vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)]).to_svg().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("width=\"960\"") && svg.contains("viewBox=\"0 0 3840 1800\""));
        assert!(svg.contains("error &lt;1&gt;"));
    }

    /// The second curve is dashed, so that the first shows in its gaps; curves apart are solid.
    #[test]
    fn curves_in_one_place_are_both_seen() {
        let lines = |apart: f64| {
            let mut chart = chart((0..40).map(|x| (f64::from(x), 1.0 + f64::from(x))).collect());
            let points = chart.series[0].points.iter().map(|(x, y)| (*x, y + apart)).collect();
            chart.series.push(Series { label: "second".into(), points });
            chart.to_svg().unwrap().matches("stroke=\"#D62728\"").count()
        };
        // A line of the chart and one of the legend.
        assert_eq!(lines(2.0), 2);
        assert!(lines(0.0) > 10 && lines(0.05) > 10);
    }

    /// Rounding errors are not blown up to the height of the picture; real differences are.
    #[test]
    fn a_level_curve_is_drawn_level() {
        let height = |apart: f64| {
            let (_, up) = chart(vec![(0.0, -30.0), (1.0, -30.0 + apart)]).ranges(&[]).unwrap();
            up.end - up.start
        };
        assert!((0.02..0.04).contains(&height(1e-7)), "{}", height(1e-7));
        assert!((1.0..1.2).contains(&height(1.0)), "{}", height(1.0));
    }

    #[test]
    fn labels_tell_neighbours_apart() {
        let label = |range: Range<f64>, value: f64| Labels::over(&range).text(value);
        assert_eq!(label(-1.0..1.0, -1e-17), "0");
        assert_eq!(label(-1.0..1.0, 0.300_000_000_000_000_04), "0.3");
        assert_eq!(label(0.0..1200.0, 400.0), "400");
        assert_eq!(label(0.031_29..0.031_31, 0.031_295), "0.031295");
        assert_eq!(label(0.0..1e-12, 5e-13), "5.000e-13");
    }

    #[test]
    fn a_constant_series_is_drawn_and_an_empty_one_refused() {
        assert!(chart(vec![(1.0, 5.0)]).to_svg().is_ok());
        assert_eq!(chart(vec![]).to_svg(), Err(PlotError::Empty { title: "t".into() }));
    }
}
