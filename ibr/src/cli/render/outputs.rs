//! The files of one rendered view, and what is in them.

use crate::cli::arguments::RenderArguments;
use crate::cli::failure::{Failure, failed, usage};
use crate::cli::output::{self, Encoded, Outputs, Part, ends_with, is_film};
use crate::depth::{FAR, Measure};
use crate::image::{Image, Levels, encode_with_alpha, pfm};
use crate::interpolate::Cover;
use crate::pipeline::Rendering;
use crate::scene::Kind;
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use std::path::{Path, PathBuf};

impl RenderArguments {
    /// The files that were asked for.
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::of(&[
            (Part::View, Some(&self.output)),
            (Part::Mask, self.mask.as_ref()),
            (Part::Depth, self.depth.as_ref()),
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

    /// The contents of the files of a view.
    pub(super) fn encoded<'a>(
        &self,
        outputs: &'a Outputs,
        rendering: &Rendering,
    ) -> Result<Vec<Encoded<'a>>, Failure> {
        let encoded = |(part, path): &'a (Part, PathBuf)| match part {
            Part::View => self.view(rendering, path),
            Part::Mask => output::encoded(&mask_image(rendering), path, Levels::Eight),
            Part::Depth | Part::Map => Ok(Encoded { bytes: pfm::encode(&depths(rendering)), path }),
        };
        outputs.parts.iter().map(encoded).collect()
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

/// What the numbers in the file of `--depth` are, if one is written.
pub(super) fn unit_of_depths(kind: &Kind, written: bool) -> Option<&'static str> {
    let text = match kind {
        Kind::Rectified { .. } => "as disparities in pixels for a baseline of one",
        Kind::Calibrated { .. } => "in the unit of the cameras",
        Kind::Uncalibrated { .. } => "as an order without a unit: larger is farther",
    };
    written.then_some(text)
}
