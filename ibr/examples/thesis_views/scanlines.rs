//! Figure 3.9: the error of every row of a rendered view, measured and predicted.

use crate::page::Verdict;
use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use crate::{Effort, Figure, Outcome, chart};
use hybank_ibr::analysis::Predictor;
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::{Image, MOST_PIXELS, read_image, read_map};
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::propagate::RectifiedView;
use std::path::{Path, PathBuf};

struct Pair {
    name: &'static str,
    images: [Image; 2],
    maps: [DepthMap; 2],
    truth: Image,
}

/// The rows of the view half-way between two photographs.
pub(crate) fn rows(effort: Effort) -> Outcome<Figure> {
    let folder = data().filter(|_| !effort.few);
    let pair = match &folder {
        Some(folder) => photographs(folder)?,
        None => synthetic()?,
    };
    let view = |i: usize| RectifiedView { image: &pair.images[i], map: &pair.maps[i], camera: i as f64 };
    let predictor = Predictor::new(&[view(0), view(1)], &RenderSettings::default())?;
    let predicted = predictor.at(&0.5, pair.truth.size())?;
    let rendered = predicted.rendering.image.quantised();
    let stride = rendered.width() * rendered.channels();
    let pairs = rendered.data().chunks(stride).zip(pair.truth.data().chunks(stride));
    let measured: Vec<f64> = pairs
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / stride as f64)
        .collect();
    let rows = predicted.rows();
    let estimates: Vec<f64> = rows.iter().map(|r| r.estimate).collect();
    let bounds: Vec<f64> = rows.iter().map(|r| r.expected).collect();
    let above = bounds.iter().zip(&measured).filter(|(bound, error)| bound >= error).count();
    let related = correlation(&estimates, &measured);
    let verdicts = vec![
        Verdict::new(
            "the expected error lies above that of most rows",
            format!("in {above} of {} rows", rows.len()),
            above as f64 >= 0.8 * rows.len() as f64,
        ),
        Verdict::new(
            "rows with large errors are predicted",
            format!("correlation of estimate and error {related:.2}"),
            related > 0.5,
        ),
    ];
    let by_row = |values: &[f64]| values.iter().enumerate().map(|(y, v)| (y as f64, *v)).collect();
    let chart = chart(
        format!("Figure 3.9: error of the rows of {}", pair.name),
        ["row", "MAE in grey levels"],
        vec![
            ("measured", by_row(&measured)),
            ("estimate", by_row(&estimates)),
            ("expected", by_row(&bounds)),
        ],
    );
    Ok(Figure { file: "figure-3.9.svg", chart, verdicts })
}

/// The folder of the photographs "Cones", if it is there.
fn data() -> Option<PathBuf> {
    trials::data("ibr/cones")
}

fn photographs(folder: &Path) -> Outcome<Pair> {
    let image = |name: &str| read_image(&folder.join(name), MOST_PIXELS);
    let map = |name: &str| -> Outcome<DepthMap> {
        let (width, height, stored) = read_map(&folder.join(name), MOST_PIXELS)?;
        let mut map = DepthMap::new((width, height), stored, 4.0, Measure::Disparity)?;
        fill_unknown(&mut map);
        Ok(map)
    };
    Ok(Pair {
        name: "\"Cones\" (the thesis has \"Teddy\", which lacks a photograph half-way)",
        images: [image("im2.png")?, image("im6.png")?],
        maps: [map("disp2.png")?, map("disp6.png")?],
        truth: image("im4.png")?,
    })
}

fn synthetic() -> Outcome<Pair> {
    let size = (96, 72);
    let shot = |position: f64| -> Outcome<(Image, DepthMap)> {
        let camera = Camera::metric(rig_camera(position, size), false)?;
        let (image, depth) = SyntheticScene::default().view(&camera, size);
        Ok((image.quantised(), rig_disparity(&depth, size.0)))
    };
    let ((left, left_map), (right, right_map)) = (shot(0.0)?, shot(1.0)?);
    let truth = shot(0.5)?.0;
    Ok(Pair { name: "a synthetic scene", images: [left, right], maps: [left_map, right_map], truth })
}

/// Pearson's correlation coefficient.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| f(x - ma, y - mb)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}
