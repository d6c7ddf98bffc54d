//! Arguments of `hybank-ibr render`.

use super::SceneArguments;
use crate::image::{FrameRate, Levels};
use crate::interpolate::plane::PlaneSettings;
use crate::interpolate::{Degree, HoleFill};
use crate::pipeline::{Method, RenderSettings};
use clap::Args;
use std::path::PathBuf;

const RENDER_EXAMPLES: &str = "Examples:
  hybank-ibr render scene.toml -o middle.png --truth photo.png
      renders the view that [virtual] asks for and prints PSNR, SSIM, mean absolute error and coverage
  hybank-ibr render scene.toml --view left -o left.png
      leaves out the view \"left\" and renders it from the other views
  hybank-ibr render - -o - < scene.toml > middle.png
      reads the scene from standard input (paths are relative to the working directory) and writes a PNG to
      standard output
  hybank-ibr render path.toml -o - | ffmpeg -i - film.mp4
      renders the views on a path as one film; path.toml has several [[virtual]] tables, or an end and frames

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
disparity, or colmap = \"folder\" or transforms = \"transforms.json\" at the top; [virtual] has camera = ..
and size = [w, h], or camera_of = \"image.png\". A scene without cameras has
views with images only, and matches = \"tracks.txt\"; [virtual] has from_tracks = 3 (a column, counted
from 1) or between = 0.5.";

#[derive(Debug, Args)]
#[command(after_help = RENDER_EXAMPLES)]
pub(in crate::cli) struct RenderArguments {
    #[command(flatten)]
    pub(in crate::cli) scene: SceneArguments,
    /// Image to write (.png, .jpg, .ppm, .pgm, .pfm) or film (.y4m); `-` is standard output: PNG, and Y4M of
    /// several views.
    #[arg(short, long, value_name = "FILE")]
    pub(in crate::cli) output: PathBuf,
    /// Also write a mask: white for seen pixels, grey for cracks, dark grey where only samples of guessed
    /// depth lie, black for disocclusions.
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) mask: Option<PathBuf>,
    /// Also write the depth of the virtual view (.pfm), NaN in holes: millimetres of a rig with calib.txt,
    /// disparities in pixels for a baseline of one of other rectified rigs, depths in the unit of general
    /// cameras, and an order without a unit of scenes without cameras.
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) depth: Option<PathBuf>,
    /// Also write how many visible samples fall on each pixel (.png of 16 bits or .pfm).
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) count: Option<PathBuf>,
    /// Also write where the view differs from --truth: as a picture, black is no error and white the
    /// largest, or as numbers in grey levels (.pfm).
    #[arg(long, value_name = "FILE", requires = "truth")]
    pub(in crate::cli) error: Option<PathBuf>,
    /// Write a PNG with an alpha channel: transparent where no view shows what is there.
    #[arg(long)]
    pub(in crate::cli) alpha: bool,
    /// Frames per second that a film says it has: 25, 29.97 or 30000/1001 [default: 25].
    #[arg(long, value_name = "RATE")]
    pub(in crate::cli) fps: Option<FrameRate>,
    /// Use only the K views nearest to the virtual camera, by angle and distance; not in scenes without
    /// cameras.
    #[arg(long, value_name = "K")]
    pub(in crate::cli) nearest: Option<usize>,
    /// Bits per value of a PNG, 8 or 16.
    #[arg(long, value_name = "N", value_enum, default_value_t = Levels::Eight, hide_possible_values = true)]
    pub(in crate::cli) bits: Levels,
    /// How samples are interpolated.
    #[arg(long, value_enum, default_value_t = Method::Auto)]
    pub(in crate::cli) method: Method,
    /// How holes are filled.
    #[arg(long, value_enum, default_value_t = HoleFill::Background)]
    pub(in crate::cli) fill: HoleFill,
    /// Drop pixels of unknown depth instead of filling it from the farther neighbour.
    #[arg(long)]
    pub(in crate::cli) drop_unknown: bool,
    /// Degree of the splines of the plane; rows are cubic, and scenes without cameras have none
    /// [default: cubic]. A linear plane takes less time and is less sharp.
    #[arg(long, value_enum)]
    pub(in crate::cli) degree: Option<Degree>,
    /// Weight of the slope penalty of the row fit (rectified rigs), px^2 [default: from the noise of the
    /// photographs, 0.01 to 4].
    #[arg(long, value_name = "L")]
    pub(in crate::cli) lambda: Option<f64>,
    /// Seed of the robust estimators (scenes without cameras) [default: 1].
    #[arg(long)]
    pub(in crate::cli) seed: Option<u64>,
    /// Exchange near and far (scenes without cameras).
    #[arg(long)]
    pub(in crate::cli) reverse_order: bool,
    /// Overwrite existing files.
    #[arg(long)]
    pub(in crate::cli) force: bool,
}

impl RenderArguments {
    /// The settings that were typed over the defaults; `offset` is that of the scene.
    pub(in crate::cli) fn settings(&self, offset: f64) -> RenderSettings {
        let keep_smoothing = self.lambda.is_some();
        let nearest = self.nearest;
        let mut settings = RenderSettings { nearest, keep_smoothing, ..self.scene.settings(offset) };
        settings.method = self.method;
        let stage = &mut settings.interpolation;
        stage.fill = self.fill;
        if self.degree == Some(Degree::Linear) {
            stage.plane = PlaneSettings::LINEAR;
        }
        stage.fit.lambda = self.lambda.unwrap_or(stage.fit.lambda);
        settings
    }
}
