//! Command-line arguments.

use crate::image::Levels;
use crate::interpolate::{Degree, HoleFill};
use crate::partial::{Densify, Segmentwise};
use crate::pipeline::{Method, RenderSettings};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Renders new views from photographs with depth (image-based rendering).
#[derive(Debug, Parser)]
#[command(name = "hybank-ibr", version, about, after_help = EXAMPLES)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
}

const EXAMPLES: &str = "Examples:
  hybank-ibr render scene.toml -o middle.png
  hybank-ibr render scene.toml --view centre -o centre.png --truth centre-photo.png
  hybank-ibr render scene.toml --depth-step 6 -o sparse.png --json
  hybank-ibr bound scene.toml --map error.png
  hybank-ibr demo -o demo.png

Exit codes: 0 done, 1 the input failed, 2 wrong usage.";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Render the virtual view of a scene.
    Render(Box<RenderArguments>),
    /// Predict the error of the virtual view without a photograph of it, and what to spend on next.
    Bound(BoundArguments),
    /// Render a synthetic scene with exact depth, compare the result with the exact view, and write a
    /// contact sheet.
    Demo(DemoArguments),
}

const RENDER_EXAMPLES: &str = "Examples:
  hybank-ibr render scene.toml -o middle.png --truth photo.png
      renders the view that [virtual] asks for and prints PSNR, SSIM, mean absolute error and coverage
  hybank-ibr render scene.toml --view left -o left.png
      leaves out the view \"left\" and renders it from the other views
  hybank-ibr render - -o - < scene.toml > middle.png
      reads the scene from standard input (paths are relative to the working directory) and writes a PNG to
      standard output

A scene of a rectified rig:
  [[view]]
  name = \"left\"
  image = \"im2.png\"
  position = 0.0
  disparity = \"disp2.png\"
  disparity_scale = 4.0
  [[view]]
  name = \"right\"
  image = \"im6.png\"
  position = 1.0
  disparity = \"disp6.png\"
  disparity_scale = 4.0
  [virtual]
  position = 0.5

A scene of general cameras has camera = [[..4..],[..],[..]] and depth = \"d.pfm\" in place of position and
disparity, or colmap = \"folder\"; [virtual] has camera = .. and size = [w, h]. A scene without cameras has
views with images only, and matches = \"tracks.txt\"; [virtual] has from_tracks = 3 (a column, counted
from 1) or between = 0.5.";

#[derive(Debug, Args)]
#[command(after_help = RENDER_EXAMPLES)]
pub(super) struct RenderArguments {
    /// Scene file (TOML); `-` is standard input.
    pub(super) scene: PathBuf,
    /// Image to write (.png, .jpg, .ppm, .pgm, .pfm); `-` is PNG on standard output.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Leave this view out and render it.
    #[arg(long, value_name = "NAME")]
    pub(super) view: Option<String>,
    /// Use only every K-th value of full depth maps, in rows and columns.
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub(super) depth_step: usize,
    /// Photograph of the virtual view, to compare the rendering with.
    #[arg(long, value_name = "FILE")]
    pub(super) truth: Option<PathBuf>,
    /// Also write a mask: white for seen pixels, grey for cracks, black for disocclusions.
    #[arg(long, value_name = "FILE")]
    pub(super) mask: Option<PathBuf>,
    /// Also write the depth of the virtual view (.pfm): disparities for a baseline of one of a rectified
    /// rig, else depths; NaN in holes.
    #[arg(long, value_name = "FILE")]
    pub(super) depth: Option<PathBuf>,
    /// Bits per value of a PNG, 8 or 16.
    #[arg(long, value_name = "N", default_value = "8", value_parser = levels)]
    pub(super) bits: Levels,
    /// Print the results as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
    /// Offset added to every column of the virtual view, in pixels; overrides that of the scene.
    #[arg(long, value_name = "PX", allow_hyphen_values = true)]
    pub(super) offset: Option<f64>,
    /// How samples are interpolated.
    #[arg(long, value_enum, default_value_t = MethodName::Auto)]
    pub(super) method: MethodName,
    /// Use the brightness of every view as it is, instead of giving all the exposure of the first.
    #[arg(long)]
    pub(super) keep_exposure: bool,
    /// How holes are filled.
    #[arg(long, value_enum, default_value_t = FillName::Background)]
    pub(super) fill: FillName,
    /// How coarse depth is made dense.
    #[arg(long, value_enum, default_value_t = DensifyName::Segmentwise)]
    pub(super) densify: DensifyName,
    /// Drop pixels of unknown depth instead of filling it from the farther neighbour.
    #[arg(long)]
    pub(super) drop_unknown: bool,
    /// Degree of the row splines.
    #[arg(long, value_enum, default_value_t = DegreeName::Cubic)]
    pub(super) degree: DegreeName,
    /// Weight of the slope penalty of the row fit, px^2.
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    pub(super) lambda: Option<f64>,
    /// Weight of the differences of neighbouring coefficients of the row fit.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub(super) tau: Option<f64>,
    /// Radius of the depth test, px.
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub(super) epsilon: Option<f64>,
    /// Depth difference from which a sample is hidden, as a share of the nearer depth.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub(super) relative_depth: Option<f64>,
    /// Seed of the robust estimators (scenes without cameras).
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Exchange near and far (scenes without cameras).
    #[arg(long)]
    pub(super) reverse_order: bool,
    /// Most pixels of the virtual view, and of each image and map. A rendering takes up to 64 bytes of
    /// memory per pixel.
    #[arg(long, value_name = "N", default_value_t = crate::image::MOST_PIXELS)]
    pub(super) max_pixels: usize,
    /// Number of threads [default: all cores]. The result has the same bits for every number.
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
}

const BOUND_EXAMPLES: &str = "Examples:
  hybank-ibr bound scene.toml
      prints how large the error of the virtual view will be, and its causes
  hybank-ibr bound scene.toml --map error.png --truth photo.png
      also writes where the error is, and compares the prediction with a photograph

Three figures, in grey levels:
  sure       the mean error is not larger, while slopes and residuals are those of the samples
  expected   root mean square error, a bound of the expected mean error
  estimate   mean absolute error, calibrated by leaving out each view in turn
Scenes of rectified rigs only; the view is the one that `render --method rows` gives.";

#[derive(Debug, Args)]
#[command(after_help = BOUND_EXAMPLES)]
pub(super) struct BoundArguments {
    /// Scene file (TOML); `-` is standard input.
    pub(super) scene: PathBuf,
    /// Leave this view out and predict the error of its place.
    #[arg(long, value_name = "NAME")]
    pub(super) view: Option<String>,
    /// Use only every K-th value of full depth maps, in rows and columns.
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub(super) depth_step: usize,
    /// Photograph of the virtual view, to compare the prediction with.
    #[arg(long, value_name = "FILE")]
    pub(super) truth: Option<PathBuf>,
    /// Write the estimate of every pixel as an image: black is no error, white the largest.
    #[arg(long, value_name = "FILE")]
    pub(super) map: Option<PathBuf>,
    /// Offset added to every column of the virtual view, in pixels; overrides that of the scene.
    #[arg(long, value_name = "PX", allow_hyphen_values = true)]
    pub(super) offset: Option<f64>,
    /// Use the brightness of every view as it is, instead of giving all the exposure of the first.
    #[arg(long)]
    pub(super) keep_exposure: bool,
    /// Print the results as one JSON object, with the figures of each row.
    #[arg(long)]
    pub(super) json: bool,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
    /// Most pixels of the virtual view, and of each image and map.
    #[arg(long, value_name = "N", default_value_t = crate::image::MOST_PIXELS)]
    pub(super) max_pixels: usize,
    /// Number of threads [default: all cores]. The result has the same bits for every number.
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
}

#[derive(Debug, Args)]
pub(super) struct DemoArguments {
    /// Contact sheet to write.
    #[arg(short, long, value_name = "FILE", default_value = "hybank-ibr-demo.png")]
    pub(super) output: PathBuf,
    /// Width and height of the views.
    #[arg(long, value_name = "WxH", default_value = "480x360", value_parser = size)]
    pub(super) size: (usize, usize),
    /// Print the results as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
    /// Number of threads [default: all cores].
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
}

/// Sides that the demo renders: enough for its shapes, and no more than a screen holds.
const SIDES: std::ops::RangeInclusive<usize> = 64..=4096;

fn size(text: &str) -> Result<(usize, usize), String> {
    let (w, h) = text.split_once('x').ok_or("write it as WIDTHxHEIGHT, for example 480x360")?;
    let side = |s: &str| match s.parse() {
        Ok(n) if SIDES.contains(&n) => Ok(n),
        _ => Err(format!("{s:?} is not a number from {} to {}", SIDES.start(), SIDES.end())),
    };
    Ok((side(w)?, side(h)?))
}

fn levels(text: &str) -> Result<Levels, String> {
    match text {
        "8" => Ok(Levels::Eight),
        "16" => Ok(Levels::Sixteen),
        _ => Err("give 8 or 16".into()),
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum MethodName {
    /// rows for rectified rigs, plane for other scenes.
    Auto,
    /// One spline per row (rectified rigs only).
    Rows,
    /// One spline for the whole image.
    Plane,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum FillName {
    /// Continue the farther side into holes between surfaces; bridge cracks within one.
    Background,
    /// Let the fitted spline bridge all holes.
    Bridge,
    /// Leave holes black.
    Leave,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum DensifyName {
    /// Interpolate within segments of image and depth.
    Segmentwise,
    /// Bilinear interpolation everywhere.
    Bilinear,
    /// The value of the nearest sample.
    Nearest,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum DegreeName {
    /// Linear B-splines.
    Linear,
    /// Cubic B-splines.
    Cubic,
}

impl RenderArguments {
    /// The settings that were typed over the defaults; `offset` is that of the scene.
    pub(super) fn settings(&self, offset: f64) -> RenderSettings {
        let offset = self.offset.unwrap_or(offset);
        let mut settings =
            RenderSettings { offset, keep_exposure: self.keep_exposure, ..RenderSettings::default() };
        settings.method = match self.method {
            MethodName::Auto => Method::Auto,
            MethodName::Rows => Method::Rows,
            MethodName::Plane => Method::Plane,
        };
        let stage = &mut settings.interpolation;
        stage.holes.fill = match self.fill {
            FillName::Background => HoleFill::Background,
            FillName::Bridge => HoleFill::Bridge,
            FillName::Leave => HoleFill::Leave,
        };
        stage.fit.degree = match self.degree {
            DegreeName::Linear => Degree::Linear,
            DegreeName::Cubic => Degree::Cubic,
        };
        let mut typed = |slot: fn(&mut crate::interpolate::Settings) -> &mut f64, value: Option<f64>| {
            if let Some(value) = value {
                *slot(stage) = value;
            }
        };
        typed(|s| &mut s.fit.lambda, self.lambda);
        typed(|s| &mut s.fit.tau, self.tau);
        typed(|s| &mut s.depth_test.epsilon, self.epsilon);
        typed(|s| &mut s.depth_test.relative, self.relative_depth);
        settings
    }

    /// How coarse depth is made dense.
    pub(super) fn densify(&self) -> Densify {
        match self.densify {
            DensifyName::Segmentwise => Densify::Segmentwise(Segmentwise::default()),
            DensifyName::Bilinear => Densify::Bilinear,
            DensifyName::Nearest => Densify::Nearest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn sizes_are_checked() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("640").is_err() && size("0x9").is_err() && size("9000x90").is_err());
    }
}
