//! The files of one rendered view, and what is in them.

use crate::analysis::difference;
use crate::camera::middlebury::Calibration;
use crate::cli::arguments::RenderArguments;
use crate::cli::failure::{Failure, failed, usage};
use crate::cli::heat;
use crate::cli::output::{self, Encoded, Outputs, Part, ends_with, is_film};
use crate::depth::{DepthMap, FAR, Measure};
use crate::image::{Image, Levels, encode_with_alpha, pfm};
use crate::interpolate::Cover;
use crate::pipeline::Rendering;
use crate::scene::{Kind, Scene};
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use std::path::Path;

impl RenderArguments {
    /// The files that were asked for.
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::of(&[
            (Part::View, Some(&self.output)),
            (Part::Mask, self.mask.as_ref()),
            (Part::Depth, self.depth.as_ref()),
            (Part::Count, self.count.as_ref()),
            (Part::Error, self.error.as_ref()),
        ])
    }

    /// Checks of the files that need no other file.
    pub(super) fn check_outputs(&self) -> Result<(), Failure> {
        let view = &self.output;
        if self.alpha && !(is_dash(view) || ends_with(view, "png")) {
            let view = Quoted(view);
            return usage(format!("--alpha: {view} has no alpha channel; write a .png"));
        }
        if is_film(view) && self.bits == Levels::Sixteen {
            return usage("--bits 16: a film has 8 bits per value");
        }
        self.outputs().check(self.bits, self.force)
    }

    /// The contents of some files of a view, and the error that is white in its picture.
    pub(super) fn encoded<'a>(
        &self,
        outputs: &'a Outputs,
        rendering: &Rendering,
        truth: Option<&Image>,
    ) -> Result<(Vec<Encoded<'a>>, Option<f32>), Failure> {
        let (mut all, mut white) = (Vec::new(), None);
        for (part, path) in &outputs.parts {
            all.push(match part {
                Part::View => self.view(rendering, path)?,
                Part::Mask => output::encoded(&mask_image(rendering), path, Levels::Eight)?,
                Part::Depth => Encoded { bytes: pfm::encode(&depths(rendering)), path },
                Part::Count => counts(rendering, path)?,
                _ => {
                    let Some(truth) = truth else { continue };
                    let (file, largest) = errors(&rendering.image, truth, path)?;
                    white = largest;
                    file
                }
            });
        }
        Ok((all, white))
    }

    fn view<'a>(&self, rendering: &Rendering, path: &'a Path) -> Result<Encoded<'a>, Failure> {
        let image = &rendering.image;
        if self.alpha {
            let bytes = encode_with_alpha(image, &rendering.alpha(), path, self.bits);
            return Ok(Encoded { bytes: bytes.map_err(failed)?, path });
        }
        output::encoded(image, path, self.bits)
    }
}

/// White seen, grey crack, dark grey guessed, black disocclusion.
fn mask_image(rendering: &Rendering) -> Image {
    let grey = |cover: &Cover| match cover {
        Cover::Seen => 255.0,
        Cover::Crack => 128.0,
        Cover::Guessed => 64.0,
        Cover::Disocclusion => 0.0,
    };
    Image::from_values(rendering.image.size(), 1, rendering.mask.iter().map(grey).collect())
}

/// The depths, infinite where they are far away.
fn depths(rendering: &Rendering) -> Image {
    let map = &rendering.depth;
    let is_far = |v: f32| map.measure() == Measure::Depth && v >= FAR;
    let shown = |v: &f32| if is_far(*v) { f32::INFINITY } else { *v };
    Image::from_values(map.size(), 1, map.data().iter().map(shown).collect())
}

/// The number of samples of every pixel, as it is.
fn counts<'a>(rendering: &Rendering, path: &'a Path) -> Result<Encoded<'a>, Failure> {
    let is_float = ends_with(path, "pfm");
    // Of 16 bits, 255 is 65535.
    let scale = if is_float { 1.0 } else { 257.0 };
    let numbers = rendering.counts.iter().map(|n| f32::from(*n) / scale).collect();
    let image = Image::from_values(rendering.image.size(), 1, numbers);
    match is_float {
        true => Ok(Encoded { bytes: pfm::encode(&image), path }),
        false => output::encoded(&image, path, Levels::Sixteen),
    }
}

/// Absolute difference from the photograph in grey levels, mean over the channels; of the brightness, if
/// only one of them has colours.
fn errors<'a>(image: &Image, truth: &Image, path: &'a Path) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    let values = difference(image, truth);
    heat::encoded(&values, image.size(), path, || Image::from_values(image.size(), 1, values.clone()))
}

/// The rendering with depths in millimetres, if the scene has the calibration of a rectified rig.
pub(super) fn in_millimetres(mut rendering: Rendering, scene: &Scene) -> Rendering {
    if let Some(calibration) = &scene.calibration
        && let Some(depth) = metric_depth(&rendering.depth, calibration)
    {
        rendering.depth = depth;
    }
    rendering
}

/// Depths f B / (d + offset) from disparities d for a baseline of one; `None` if all are unknown.
fn metric_depth(map: &DepthMap, calibration: &Calibration) -> Option<DepthMap> {
    let Calibration { focal, offset, baseline, .. } = calibration;
    let of = |d: &f32| (focal * baseline / (f64::from(*d) + offset)) as f32;
    DepthMap::new(map.size(), map.data().iter().map(of).collect(), 1.0, Measure::Depth).ok()
}

/// What the numbers in the file of `--depth` are, if one is written.
pub(super) fn unit_of_depths(scene: &Scene, written: bool) -> Option<String> {
    let text = match (&scene.kind, &scene.calibration) {
        (_, Some(Calibration { focal, baseline, .. })) => {
            format!("in millimetres, from focal length {focal} px and baseline {baseline} mm")
        }
        (Kind::Rectified { .. }, None) => "as disparities in pixels for a baseline of one".into(),
        (Kind::Calibrated { .. }, _) => "in the unit of the cameras".into(),
        (Kind::Uncalibrated { .. }, _) => "as an order without a unit: larger is farther".into(),
    };
    written.then_some(text)
}
