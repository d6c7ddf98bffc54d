//! The plot of a prediction: the numbers of every image row, and below them what the estimate comes from.

use crate::analysis::{Cause, Totals, ViewError};
use crate::cli::failure::{Failure, failed};
use crate::cli::outputs::ends_with;
use crate::image::Image;
use hybank::plot::{Chart, Series};
use image::{ImageFormat, RgbImage};
use std::io::Cursor;
use std::path::Path;

/// The bytes of the plot, one chart above the other.
pub(super) fn file(predicted: &ViewError, truth: Option<&Image>, path: &Path) -> Result<Vec<u8>, Failure> {
    let charts = [numbers(predicted, truth), causes(predicted)];
    if ends_with(path, "png") {
        return stacked_pixels(&charts);
    }
    let [above, below] = charts.map(|chart| chart.to_svg().map_err(failed));
    Ok(stacked_svg(&above?, &below?).into_bytes())
}

fn by_row(values: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    values.enumerate().map(|(y, value)| (y as f64, value)).collect()
}

/// The numbers of every row, and the measured error beside them.
fn numbers(predicted: &ViewError, truth: Option<&Image>) -> Chart {
    let (rows, totals) = (predicted.rows(), predicted.totals());
    let of = |f: &dyn Fn(&Totals) -> f64| by_row(rows.iter().map(f));
    let mut series = vec![
        Series { label: format!("estimate, mean {:.2}", totals.estimate), points: of(&|t| t.estimate) },
        Series { label: format!("expected, {:.2}", totals.expected), points: of(&|t| t.expected) },
        Series {
            label: format!("local limit, mean {:.2}", totals.local_limit),
            points: of(&|t| t.local_limit),
        },
    ];
    if let Some(truth) = truth {
        let points = by_row(predicted.measured_rows(truth).into_iter());
        let mean = points.iter().map(|p| p.1).sum::<f64>() / points.len() as f64;
        series.push(Series { label: format!("measured, mean {mean:.2}"), points });
    }
    Chart {
        title: "Error of the image rows, predicted from the inputs".into(),
        x_label: "image row".into(),
        y_label: "grey levels".into(),
        series,
        ..Chart::default()
    }
}

/// The part of each cause in the estimate of every row, and its share in that of the view.
fn causes(predicted: &ViewError) -> Chart {
    let whole: f64 = predicted.causes.iter().sum();
    let of_cause = |cause: Cause| {
        let k = cause as usize;
        let share = if whole > 0.0 { 100.0 * predicted.causes[k] / whole } else { 0.0 };
        let label = format!("{cause:?} {share:.0} %").to_lowercase();
        Series { label, points: by_row(predicted.causes_of_rows.iter().map(|row| row[k])) }
    };
    Chart {
        title: "What the estimate comes from".into(),
        x_label: "image row".into(),
        y_label: "grey levels".into(),
        series: Cause::ALL.into_iter().map(of_cause).collect(),
        ..Chart::default()
    }
}

/// Two SVG pictures of one size, one above the other.
fn stacked_svg(above: &str, below: &str) -> String {
    let size = |name: &str| -> f64 {
        let (_, rest) = above.split_once(&format!("{name}=\"")).unwrap_or_default();
        rest.split('"').next().and_then(|number| number.parse().ok()).unwrap_or(0.0)
    };
    let (width, height) = (size("width"), size("height"));
    let below = below.replacen("<svg ", &format!("<svg y=\"{height}\" "), 1);
    let both = 2.0 * height;
    let head = format!(
        "<svg width=\"{width}\" height=\"{both}\" viewBox=\"0 0 {width} {both}\" xmlns=\"http://www.w3.org/2000/svg\">"
    );
    format!("{head}\n{above}\n{below}\n</svg>\n")
}

/// Two charts as one PNG file, one above the other.
fn stacked_pixels(charts: &[Chart; 2]) -> Result<Vec<u8>, Failure> {
    let mut data = Vec::new();
    let (mut width, mut height) = (0, 0);
    for chart in charts {
        let png = chart.to_png().map_err(failed)?;
        let pixels = image::load_from_memory_with_format(&png, ImageFormat::Png).map_err(failed)?;
        let pixels = pixels.to_rgb8();
        (width, height) = (pixels.width(), height + pixels.height());
        data.extend(pixels.into_raw());
    }
    let whole = RgbImage::from_raw(width, height, data).unwrap_or_default();
    let mut bytes = Cursor::new(Vec::new());
    whole.write_to(&mut bytes, ImageFormat::Png).map_err(failed)?;
    Ok(bytes.into_inner())
}
