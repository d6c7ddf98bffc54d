//! `hybank-ibr demo`: a synthetic scene, rendered and compared with its exact view.

use super::arguments::DemoArguments;
use super::failure::{Failure, failed, usage};
use super::output;
use super::progress::Progress;
use super::summary::Summary;
use crate::camera::Camera;
use crate::depth::DepthMap;
use crate::image::{Image, Levels, quality};
use crate::partial::densify;
use crate::pipeline::{RenderSettings, Rendering, rectified};
use crate::propagate::RectifiedView;
use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use image::{DynamicImage, Rgb, RgbImage, imageops};
use serde::Serialize;
use std::time::Instant;

/// Step of the coarse depth in the second rendering.
const STEP: usize = 6;

/// Pixels between the pictures of the sheet.
const GAP: usize = 6;

/// Factor of the differences that it shows.
const GAIN: f32 = 4.0;

#[derive(Debug, Serialize)]
struct DemoSummary {
    /// Every pixel has its exact depth.
    full_depth: Summary,
    /// One pixel in 6 x 6 has exact depth.
    partial_depth: Summary,
}

pub(super) fn run(arguments: &DemoArguments) -> Result<(), Failure> {
    output::refuse_existing(&arguments.output, arguments.force)?;
    output::refuse_format(&arguments.output, Levels::Eight)?;
    if is_dash(&arguments.output) && arguments.json {
        return usage("-o - and --json both write to standard output; write the sheet to a file");
    }
    let progress = Progress::new(4);
    progress.step("drawing the scene");
    let (left, left_map) = view(0.0, arguments.size)?;
    let (right, right_map) = view(1.0, arguments.size)?;
    let (exact, _) = view(0.5, arguments.size)?;
    progress.step("full depth");
    let (full, full_summary) = render(&[rig(&left, &left_map, 0.0), rig(&right, &right_map, 1.0)], &exact)?;
    progress.step("partial depth");
    let start = Instant::now();
    let [left_coarse, right_coarse] = [coarse(&left_map, &left)?, coarse(&right_map, &right)?];
    let preparation = start.elapsed().as_secs_f64();
    let (partial, mut partial_summary) =
        render(&[rig(&left, &left_coarse, 0.0), rig(&right, &right_coarse, 1.0)], &exact)?;
    partial_summary.preparation_seconds = preparation;
    progress.step("writing");
    let [full, partial] = [&full.image, &partial.image];
    let errors = [full, partial].map(|image| enlarged_difference(image, &exact));
    let sheet = sheet([&left, &exact, &right, full, &errors[0], &errors[1]])?;
    let sheet = output::encoded(&sheet, &arguments.output, Levels::Eight)?;
    output::write(&[sheet], arguments.force)?;
    drop(progress);
    report(&DemoSummary { full_depth: full_summary, partial_depth: partial_summary }, arguments)
}

fn view(position: f64, size: (usize, usize)) -> Result<(Image, DepthMap), Failure> {
    let camera = Camera::metric(rig_camera(position, size), false).map_err(failed)?;
    let (image, depth) = SyntheticScene::default().view(&camera, size);
    let disparity = rig_disparity(&depth, size.0);
    // Rounded to 8 bits, as in a file.
    Ok((image.quantised(), disparity))
}

fn coarse(map: &DepthMap, image: &Image) -> Result<DepthMap, Failure> {
    let sparse = map.decimated(STEP).map_err(failed)?;
    densify(&sparse, STEP, image).map_err(failed)
}

fn rig<'a>(image: &'a Image, map: &'a DepthMap, camera: f64) -> RectifiedView<'a> {
    RectifiedView { image, map, camera }
}

fn render(views: &[RectifiedView<'_>], exact: &Image) -> Result<(Rendering, Summary), Failure> {
    let start = Instant::now();
    let rendering = rectified::render(views, 0.5, &RenderSettings::default()).map_err(failed)?;
    let mut summary = Summary::new(&rendering, start.elapsed().as_secs_f64(), 0);
    let quality = quality::compare(&rendering.image, exact, None).map_err(failed)?;
    quality.iter().for_each(|q| summary.compare(q));
    Ok((rendering, summary))
}

/// Two rows of three pictures on white.
fn sheet(pictures: [&Image; 6]) -> Result<Image, Failure> {
    let (width, height) = pictures[0].size();
    let side = |count: usize, length: usize| (count * (length + GAP) + GAP) as u32;
    let mut sheet = RgbImage::from_pixel(side(3, width), side(2, height), Rgb([255; 3]));
    for (k, picture) in pictures.iter().enumerate() {
        let [left, top] = [k % 3 * (width + GAP), k / 3 * (height + GAP)].map(|before| (GAP + before) as i64);
        imageops::replace(&mut sheet, &picture.to_dynamic(Levels::Eight).to_rgb8(), left, top);
    }
    Image::try_from(&DynamicImage::from(sheet)).map_err(failed)
}

/// Mid-grey plus the difference of two images of one size, enlarged.
fn enlarged_difference(a: &Image, b: &Image) -> Image {
    let mut image = a.clone();
    let values = a.data().iter().zip(b.data()).map(|(a, b)| 128.0 + GAIN * (a - b));
    image.data_mut().iter_mut().zip(values).for_each(|(p, v)| *p = v);
    image
}

fn report(summary: &DemoSummary, arguments: &DemoArguments) -> Result<(), Failure> {
    let text = || {
        let (full, partial) = (summary.full_depth.text(), summary.partial_depth.text());
        format!(
            "exact depth at every pixel\n{full}\nexact depth at one pixel in {STEP} x {STEP}\n{partial}\n{}: left, exact, right; rendered, its error and that of partial depth (times {GAIN})\n",
            Quoted(&arguments.output)
        )
    };
    output::report(arguments.json, summary, text, Some(&arguments.output))
}
