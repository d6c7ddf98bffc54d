//! Line charts, and their SVG text.

use super::axis::{AxisScale, Labels, extent, widened};
use super::curves::{Curves, Guide, colours_after, line_style};
use super::labels::{MARK_FONT, RADIUS, Room, beside_guide};
use super::legend::{Dashes, Legend, LegendEntry, Look, OVERSIZE, letters};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

const WIDTH: u32 = 960;
const HEIGHT: u32 = 450;
/// The size of the drawing.
const ENLARGED: (u32, u32) = (WIDTH * OVERSIZE, HEIGHT * OVERSIZE);
/// Pixels left and right of all.
const SIDE: u32 = 10;
/// Curves that differ by less than this share of their values are drawn as level.
const LEAST_SHARE: f64 = 1e-3;
/// In a dark scheme colours are turned round but for their hues; white and black become soft.
const DARK: &str =
    "<style>@media(prefers-color-scheme:dark){svg{filter:invert(.9) hue-rotate(180deg)}}</style>";
const GUIDE: RGBColor = RGBColor(120, 120, 120);

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
    /// Legend text; of several marks with one text the legend has the first.
    pub label: String,
    /// Red, green, blue; `None` for the colour that follows those of the curves.
    pub colour: Option<[u8; 3]>,
    /// Rings in place of discs.
    pub are_rings: bool,
    /// Points (x, y) and their texts; points that are not finite are left out.
    pub points: Vec<(f64, f64, String)>,
}

/// The axes of a chart that is being drawn.
type Axes<'a, B, X> = ChartContext<'a, B, Cartesian2d<X, RangedCoordf64>>;

/// The ranges of both axes.
type Ranges = (Range<f64>, Range<f64>);

type DrawnSeries<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Curves over a common axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Text under the x axis, with its unit.
    pub x_label: String,
    /// Of the x axis.
    pub x_scale: AxisScale,
    /// Text beside the y axis, with its unit.
    pub y_label: String,
    /// What the curves are.
    pub curves: Curves,
    /// The curves, drawn in this order.
    pub series: Vec<Series>,
    /// Upright lines behind the curves; those outside of the x axis are left out.
    pub guides: Vec<Guide>,
    /// Points over the curves, in the colours that follow theirs.
    pub marks: Vec<Marks>,
}

/// A chart that could not be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    /// Lines over linear axes.
    pub fn lines(
        title: impl Into<String>,
        x_label: impl Into<String>,
        y_label: impl Into<String>,
        series: Vec<Series>,
    ) -> Self {
        let (title, x_label, y_label) = (title.into(), x_label.into(), y_label.into());
        Self { title, x_label, y_label, series, ..Self::default() }
    }

    /// The chart as SVG text.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let ranges = self.ranges()?;
        let mut svg = String::new();
        self.draw(SVGBackend::with_string(&mut svg, ENLARGED), ranges)
            .map_err(|error| self.failed(&error))?;
        Ok(scale_by_view_box(&svg))
    }

    fn failed(&self, error: &dyn std::fmt::Display) -> PlotError {
        PlotError::Drawing { title: self.title.clone(), reason: error.to_string() }
    }

    fn ranges(&self) -> Result<Ranges, PlotError> {
        let marked = || self.marks.iter().flat_map(|m| &m.points).map(|(x, y, _)| (*x, *y));
        let drawn = || self.series.iter().flat_map(|s| &s.points).copied().chain(marked());
        let points = || drawn().filter(|(x, y)| self.is_drawn(*x, *y));
        if points().next().is_none() {
            return Err(PlotError::Empty { title: self.title.clone() });
        }
        let zero = (self.curves == Curves::Stems).then_some(0.0);
        let (across, up) = (extent(points().map(|p| p.0)), extent(points().map(|p| p.1).chain(zero)));
        let across = match self.x_scale {
            AxisScale::Linear if zero.is_some() => across.start - 0.5..across.end + 0.5,
            AxisScale::Linear => widened(&across, 0.0, 0.0),
            AxisScale::Decades if across.start == across.end => 0.5 * across.start..2.0 * across.end,
            AxisScale::Decades => across,
        };
        Ok((across, widened(&up, 0.06, LEAST_SHARE)))
    }

    fn is_drawn(&self, x: f64, y: f64) -> bool {
        x.is_finite() && y.is_finite() && (self.x_scale == AxisScale::Linear || x > 0.0)
    }

    fn looks(&self, height: f64) -> Vec<Look> {
        let curves: Vec<&[_]> = self.series.iter().map(|series| series.points.as_slice()).collect();
        self.curves.looks(&curves, height)
    }

    fn style(&self, k: usize) -> ShapeStyle {
        self.curves.style(k, self.series.len())
    }

    fn entries<'a>(&'a self, looks: &'a [Look]) -> impl Iterator<Item = LegendEntry<'a>> {
        let line = |(k, (series, look)): (usize, (&'a Series, &Look))| LegendEntry {
            label: &series.label,
            look: *look,
            style: if *look == Look::Points { self.style(k).filled() } else { self.style(k) },
        };
        let lines = self.series.iter().zip(looks).enumerate().map(line);
        let marks = &self.marks;
        let is_first = |k: usize| !marks[..k].iter().any(|earlier| earlier.label == marks[k].label);
        let points = self.styled().enumerate().filter(move |(k, _)| is_first(*k));
        lines.chain(points.map(|(_, (marks, style))| LegendEntry {
            label: &marks.label,
            look: Look::Points,
            style,
        }))
    }

    /// The marks with the style of their circles.
    fn styled(&self) -> impl Iterator<Item = (&Marks, ShapeStyle)> {
        self.marks.iter().zip(colours_after(self.series.len())).map(|(marks, next)| {
            let colour = marks.colour.map_or(*next, |[r, g, b]| RGBColor(r, g, b));
            (marks, if marks.are_rings { line_style(&colour) } else { colour.filled() })
        })
    }

    fn draw<B: DrawingBackend>(&self, backend: B, (x, y): Ranges) -> DrawnSeries<B> {
        let root = backend.into_drawing_area();
        root.fill(&WHITE)?;
        let looks = self.looks(y.end - y.start);
        let legend = Legend::new(self.entries(&looks), (WIDTH - 2 * SIDE) as i32);
        let below = root.margin(8 * OVERSIZE, 8 * OVERSIZE, SIDE * OVERSIZE, SIDE * OVERSIZE);
        let (title, below) = below.split_vertically(28 * OVERSIZE);
        // At the left, where a narrow screen begins.
        title.draw(&Text::new(self.title.as_str(), (8 * OVERSIZE as i32, 3 * OVERSIZE as i32), text(18)))?;
        let (above, below) = below.split_vertically(legend.height());
        legend.draw(&above)?;
        let mut builder = ChartBuilder::on(&below);
        builder
            .margin_top(4 * OVERSIZE)
            .margin_right(14 * OVERSIZE)
            .x_label_area_size(44 * OVERSIZE)
            .y_label_area_size(72 * OVERSIZE);
        match self.x_scale {
            AxisScale::Linear => self.draw_on(builder.build_cartesian_2d(x, y)?, &looks)?,
            AxisScale::Decades => {
                self.draw_on(builder.build_cartesian_2d(x.log_scale(), y)?, &looks)?;
            }
        }
        root.present()?;
        Ok(())
    }

    fn draw_on<B: DrawingBackend, X: Across>(
        &self,
        mut chart: Axes<'_, B, X>,
        looks: &[Look],
    ) -> DrawnSeries<B> {
        self.draw_axes(&mut chart)?;
        self.draw_guides(&mut chart)?;
        self.draw_lines(&mut chart, looks)?;
        self.draw_marks(&mut chart)
    }

    fn draw_axes<B: DrawingBackend, X: Across>(&self, chart: &mut Axes<'_, B, X>) -> DrawnSeries<B> {
        let across = match self.x_scale {
            AxisScale::Linear => Labels::over(&chart.x_range()),
            AxisScale::Decades => Labels::OfDecades,
        };
        let up = Labels::over(&chart.y_range());
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

    /// Each line begins at its text, at the left of which only shorter lines are: texts cross no line.
    fn draw_guides<B: DrawingBackend, X: Across>(&self, chart: &mut Axes<'_, B, X>) -> DrawnSeries<B> {
        let (across, up) = (chart.x_range(), chart.y_range());
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        let step = (up.end - up.start) * f64::from(MARK_FONT * OVERSIZE) / f64::from(rows.end - rows.start);
        let mut drawn: Vec<_> = self.guides.iter().filter(|guide| across.contains(&guide.x)).collect();
        drawn.sort_by(|a, b| b.x.total_cmp(&a.x));
        for (row, Guide { label, x }) in drawn.into_iter().enumerate() {
            let (foot, dash) = ((*x, up.start + step * row as f64), 4 * OVERSIZE);
            let line = [foot, (*x, up.end)];
            chart.draw_series(DashedLineSeries::new(line, dash, dash, GUIDE.stroke_width(OVERSIZE)))?;
            let (place, anchor) = beside_guide(chart.backend_coord(&foot).0 - columns.start, label);
            let style = TextStyle::from(text(MARK_FONT)).color(&GUIDE).pos(anchor);
            chart.draw_series([EmptyElement::at(foot) + Text::new(label.clone(), place, style)])?;
        }
        Ok(())
    }

    fn draw_lines<B: DrawingBackend, X: Across>(
        &self,
        chart: &mut Axes<'_, B, X>,
        looks: &[Look],
    ) -> DrawnSeries<B> {
        for (k, (series, look)) in self.series.iter().zip(looks).enumerate() {
            let points = series.points.iter().copied().filter(|(x, y)| self.is_drawn(*x, *y));
            let style = self.style(k);
            match *look {
                Look::Line(Some(Dashes { on, off })) => {
                    chart.draw_series(DashedLineSeries::new(points, on, off, style))?;
                }
                Look::Line(None) => drop(chart.draw_series(LineSeries::new(points, style))?),
                Look::Points => {
                    let shift = self.curves.shift(k, self.series.len());
                    let points: Vec<_> = points.map(|(x, y)| (x + shift, y)).collect();
                    let stem = |&(x, y): &(f64, f64)| PathElement::new([(x, 0.0), (x, y)], style);
                    chart.draw_series(points.iter().map(stem))?;
                    let head = |&point: &(f64, f64)| Circle::new(point, RADIUS, style.filled());
                    chart.draw_series(points.iter().map(head))?;
                }
            }
        }
        Ok(())
    }

    /// Circles with their texts beside them, where these cover neither each other nor a circle. A text for
    /// which there is no room is left out.
    fn draw_marks<B: DrawingBackend, X: Across>(&self, chart: &mut Axes<'_, B, X>) -> DrawnSeries<B> {
        let text_style = TextStyle::from(text(MARK_FONT)).color(&RGBColor(60, 60, 60));
        let (across, down) = chart.plotting_area().get_pixel_range();
        let mut room = Room::new(across, down);
        let mut texts = Vec::new();
        for (marks, style) in self.styled() {
            for (x, y, text) in marks.points.iter().filter(|(x, y, _)| self.is_drawn(*x, *y)) {
                room.take_circle(chart.backend_coord(&(*x, *y)));
                chart.draw_series([Circle::new((*x, *y), RADIUS, style)])?;
                texts.push((*x, *y, text));
            }
        }
        for (x, y, text) in texts.into_iter().filter(|(.., text)| !text.is_empty()) {
            if let Some(place) = room.beside(chart.backend_coord(&(x, y)), text) {
                let text = Text::new(text.clone(), place, text_style.clone());
                chart.draw_series([EmptyElement::at((x, y)) + text])?;
            }
        }
        Ok(())
    }
}

/// The coordinates of an x axis.
trait Across: Ranged<ValueType = f64> + ValueFormatter<f64> {}

impl<T: Ranged<ValueType = f64> + ValueFormatter<f64>> Across for T {}

fn text(size: u32) -> FontDesc<'static> {
    letters(size * OVERSIZE)
}

/// The picture in its own size, for light and dark schemes.
fn scale_by_view_box(svg: &str) -> String {
    let large = format!("width=\"{}\" height=\"{}\"", ENLARGED.0, ENLARGED.1);
    let svg = svg.replacen(&large, &format!("width=\"{WIDTH}\" height=\"{HEIGHT}\""), 1);
    svg.replacen('>', &format!(">\n{DARK}"), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let series = vec![Series { label: "error <1>".into(), points }];
        Chart { title: "t".into(), x_label: "x".into(), y_label: "y".into(), series, ..Chart::default() }
    }

    #[test]
    fn marks_are_drawn_with_their_texts() {
        let points = vec![(1.0, 2.0, "spur".to_owned()), (f64::NAN, 0.0, "absent".to_owned())];
        let marks = vec![Marks { label: "offset".into(), colour: None, are_rings: false, points }];
        let svg = Chart { marks, ..chart(vec![(0.0, 1.0), (2.0, 3.0)]) }.to_svg().unwrap();
        // One circle for the point and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("spur") && svg.contains("offset") && !svg.contains("absent"));
    }

    /// Marks of one cause, before and after, have one colour and one line in the legend.
    #[test]
    fn marks_of_one_label_share_colour_and_legend() {
        let of = |y: f64, are_rings| Marks {
            label: "offset".into(),
            colour: Some([255, 127, 14]),
            are_rings,
            points: vec![(1.0, y, "1/4".to_owned())],
        };
        let marks = vec![of(2.0, true), of(1.0, false)];
        let svg = Chart { marks, ..chart(vec![(0.0, 1.0), (2.0, 3.0)]) }.to_svg().unwrap();
        assert_eq!(svg.matches("<circle").count(), 3);
        assert_eq!(svg.matches("#FF7F0E").count(), 3, "{svg}");
        assert_eq!(svg.matches("offset").count(), 1);
    }

    #[test]
    fn decades_are_evenly_apart_and_zero_is_left_out() {
        let points = (0..=1000).map(|k| (f64::from(k), 1.0)).collect();
        let decades = Chart { x_scale: AxisScale::Decades, ..chart(points) };
        assert_eq!(decades.ranges().unwrap().0, 1.0..1000.0);
        let svg = decades.to_svg().unwrap();
        let at = |label: &str| -> f64 {
            let before = svg[..svg.rfind(&format!("\n{label}\n")).unwrap()].rfind("x=\"").unwrap() + 3;
            svg[before..].split('"').next().unwrap().parse().unwrap()
        };
        let places = ["1", "10", "100", "1000"].map(at);
        let step = places[1] - places[0];
        assert!(step > 100.0 && places.windows(2).all(|p| (p[1] - p[0] - step).abs() < 3.0), "{places:?}");
        assert!(Chart { x_scale: AxisScale::Decades, ..chart(vec![(0.0, 1.0)]) }.to_svg().is_err());
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
            let (_, up) = chart(vec![(0.0, -30.0), (1.0, -30.0 + apart)]).ranges().unwrap();
            up.end - up.start
        };
        assert!((0.02..0.04).contains(&height(1e-7)), "{}", height(1e-7));
        assert!((1.0..1.2).contains(&height(1.0)), "{}", height(1.0));
    }

    /// Each tap has a stem and a head, and the legend a head.
    #[test]
    fn stems_begin_at_zero() {
        let chart = Chart { curves: Curves::Stems, ..chart(vec![(0.0, 1.0), (1.0, 2.0), (2.0, 1.5)]) };
        let (across, up) = chart.ranges().unwrap();
        assert!(up.contains(&0.0) && across == (-0.5..2.5), "{across:?} {up:?}");
        let svg = chart.to_svg().unwrap();
        assert_eq!((svg.matches("<circle").count(), svg.matches("stroke=\"#1F77B4\"").count()), (4, 3));
    }

    #[test]
    fn guides_outside_of_the_axis_are_left_out() {
        let guide = |label: &str, x| Guide { label: label.into(), x };
        let guides = vec![guide("inside", 1.0), guide("outside", 3.0)];
        let svg = Chart { guides, ..chart(vec![(0.0, 1.0), (2.0, 3.0)]) }.to_svg().unwrap();
        assert!(svg.contains("inside") && !svg.contains("outside"));
    }

    #[test]
    fn a_constant_series_is_drawn_and_an_empty_one_refused() {
        assert!(chart(vec![(1.0, 5.0)]).to_svg().is_ok());
        assert_eq!(chart(vec![]).to_svg(), Err(PlotError::Empty { title: "t".into() }));
    }
}
