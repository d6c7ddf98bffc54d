//! Command-line arguments.

use crate::image::Levels;
use crate::interpolate::plane::PlaneSettings;
use crate::interpolate::{Degree, HoleFill};
use crate::pipeline::RenderSettings;
use crate::scene::Unknown;
use clap::{Args, Parser, Subcommand};
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
  hybank-ibr render folder -o middle.png
  hybank-ibr init left.png right.png -o scene.toml
  hybank-ibr render scene.toml --view centre -o centre.png --truth centre-photo.png
  hybank-ibr render scene.toml --depth-step 6 -o sparse.png --json
  hybank-ibr render path.toml -o film.y4m
  hybank-ibr evaluate folder --every 8
  hybank-ibr bound scene.toml --map error.pfm

Exit codes: 0 done, 1 the input failed, 2 wrong usage.";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Render the virtual view of a scene.
    Render(Box<RenderArguments>),
    /// Leave out every 8th view in turn, render it from the others and compare it with its photograph.
    Evaluate(EvaluateArguments),
    /// Predict the error of the virtual view without a photograph of it, and what makes it smaller.
    Bound(BoundArguments),
    /// Write the scene file of a folder: a COLMAP workspace, transforms.json, or two photographs.
    Init(InitArguments),
}

/// What `render`, `evaluate` and `bound` share.
#[derive(Debug, Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML), `-` for standard input, or a folder of which `init` makes a scene.
    #[arg(value_name = "SCENE")]
    pub(super) file: PathBuf,
    /// Leave this view out; the virtual view is its place. Its name, or the end of the path of its image;
    /// also an image that only has a camera in a COLMAP model or transforms file.
    #[arg(long, value_name = "NAME")]
    pub(super) view: Option<String>,
    /// Use only every K-th value of full depth maps, in rows and columns.
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub(super) depth_step: usize,
    /// Photograph of the virtual view, to compare the result with.
    #[arg(long, value_name = "FILE")]
    pub(super) truth: Option<PathBuf>,
    /// Offset added to every column of the virtual view, in pixels; overrides that of the scene.
    #[arg(long, value_name = "PX")]
    pub(super) offset: Option<f64>,
    /// Use the brightness of every view as it is, instead of giving all the exposure of the first.
    #[arg(long)]
    pub(super) keep_exposure: bool,
    /// Do not correct the cameras, or the rows of a rig, where the photographs do not fit each other.
    #[arg(long)]
    pub(super) keep_cameras: bool,
    /// Print the results as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
    /// Most pixels of the virtual view, and of each image and map, 268435456 at most. A rendering takes up
    /// to 160 bytes of memory per pixel.
    #[arg(long, value_name = "N", default_value_t = crate::image::MOST_PIXELS, value_parser = pixels)]
    pub(super) max_pixels: usize,
    /// Number of threads [default: all cores]. The result has the same bits for every number.
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
}

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
pub(super) struct RenderArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    /// Image to write (.png, .jpg, .ppm, .pgm, .pfm) or film (.y4m); `-` is standard output: PNG, and Y4M of
    /// several views.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Also write a mask: white for seen pixels, grey for cracks, dark grey where only samples of guessed
    /// depth lie, black for disocclusions.
    #[arg(long, value_name = "FILE")]
    pub(super) mask: Option<PathBuf>,
    /// Also write the depth of the virtual view (.pfm), NaN in holes: disparities in pixels for a baseline
    /// of one of rectified rigs, depths in the unit of general cameras, and an order without a unit of
    /// scenes without cameras.
    #[arg(long, value_name = "FILE")]
    pub(super) depth: Option<PathBuf>,
    /// Write a PNG with an alpha channel: transparent where no view shows what is there.
    #[arg(long)]
    pub(super) alpha: bool,
    /// Frames per second that a film says it has [default: 25].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) fps: Option<u32>,
    /// Use only the K views nearest to the virtual camera, by angle and distance; not in scenes without
    /// cameras.
    #[arg(long, value_name = "K")]
    pub(super) nearest: Option<usize>,
    /// Render the cameras of this file instead of [virtual]: a camera path of nerfstudio, a transforms.json
    /// or the folder of a COLMAP model.
    #[arg(long, value_name = "FILE")]
    pub(super) cameras: Option<PathBuf>,
    /// Bits per value of a PNG, 8 or 16.
    #[arg(long, value_name = "N", value_enum, default_value_t = Levels::Eight, hide_possible_values = true)]
    pub(super) bits: Levels,
    /// How holes are filled.
    #[arg(long, value_enum, default_value_t = HoleFill::Background)]
    pub(super) fill: HoleFill,
    /// What unknown depths are taken for [default: as the scene says, or auto].
    #[arg(long, value_enum)]
    pub(super) unknown: Option<Unknown>,
    /// Degree of the splines for general cameras [default: cubic]. Linear ones take less time and are less
    /// sharp.
    #[arg(long, value_enum)]
    pub(super) degree: Option<Degree>,
    /// Seed of the robust estimators (scenes without cameras) [default: 1].
    #[arg(long)]
    pub(super) seed: Option<u64>,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
}

impl RenderArguments {
    /// The settings that were typed over the defaults; `offset` is that of the scene.
    pub(super) fn settings(&self, offset: f64) -> RenderSettings {
        let mut settings = RenderSettings { nearest: self.nearest, ..self.scene.settings(offset) };
        let stage = &mut settings.interpolation;
        stage.fill = self.fill;
        if self.degree == Some(Degree::Linear) {
            stage.plane = PlaneSettings::LINEAR;
        }
        settings
    }
}

const EVALUATE_EXAMPLES: &str = "Examples:
  hybank-ibr evaluate folder
      leaves out the views 1, 9, 17 and so on, and prints PSNR, SSIM and mean absolute error of each and the means
  hybank-ibr evaluate scene.toml --every 1 --predict --pictures rendered
      leaves out every view in turn, predicts each error too, and writes the views that were rendered";

#[derive(Debug, Args)]
#[command(after_help = EVALUATE_EXAMPLES)]
pub(super) struct EvaluateArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    /// Leave out the first view and every K-th after it.
    #[arg(long, value_name = "K", default_value = "8", value_parser = step)]
    pub(super) every: usize,
    /// Use only the K views nearest to each virtual camera.
    #[arg(long, value_name = "K", value_parser = step)]
    pub(super) nearest: Option<usize>,
    /// Predict the error of each view too, as `bound` does; this takes about ten times as long.
    #[arg(long)]
    pub(super) predict: bool,
    /// Write the rendered views into this folder, as PNG with the numbers of the views.
    #[arg(long, value_name = "FOLDER")]
    pub(super) pictures: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
}

fn step(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|count| *count > 0).ok_or_else(|| "it must be a whole number from 1 on".into())
}

const BOUND_EXAMPLES: &str = "Examples:
  hybank-ibr bound scene.toml
      prints how large the error of the virtual view will be, its causes, and what would make it smaller
  hybank-ibr bound scene.toml --map error.pfm --truth photo.png
      also writes the estimate of every pixel, and compares the prediction with a photograph

Figures, in grey levels:
  estimate   mean absolute error, calibrated by leaving out each view in turn
  expected   root mean square error, a bound of the expected mean error
Of several virtual views each is predicted, and files are numbered. Scenes without cameras are refused.";

#[derive(Debug, Args)]
#[command(after_help = BOUND_EXAMPLES)]
pub(super) struct BoundArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    /// Write the estimate of every pixel in grey levels (.pfm).
    #[arg(long, value_name = "FILE")]
    pub(super) map: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long)]
    pub(super) force: bool,
}

const INIT_EXAMPLES: &str = "Examples:
  hybank-ibr init workspace -o scene.toml
      a COLMAP model with its images, and the depth maps in stereo/depth_maps if there are any
  hybank-ibr init left.png right.png -o scene.toml
      a rectified pair, whose disparities are found from the photographs

Without depth maps a scene says \"matched\": the depths are found when it is rendered. The virtual view is
half-way between two views. `render folder` makes the same scene without writing it; if the folder has a
scene.toml, that is taken.";

#[derive(Debug, Args)]
#[command(after_help = INIT_EXAMPLES)]
pub(super) struct InitArguments {
    /// A folder, a transforms.json, or the left and the right photograph of a rectified rig.
    #[arg(value_name = "FOLDER", required = true, num_args = 1..=2)]
    pub(super) inputs: Vec<PathBuf>,
    /// Scene file to write; `-` is standard output. Its paths are relative to its folder where they can be.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// The virtual view is the place of this image, which is no view then; also one that only has a camera.
    #[arg(long, value_name = "NAME")]
    pub(super) view: Option<String>,
    /// Overwrite an existing file.
    #[arg(long)]
    pub(super) force: bool,
    /// Number of threads [default: all cores].
    #[arg(long, value_name = "N")]
    pub(super) threads: Option<usize>,
}

/// The largest `--max-pixels`: a rendering of so many takes 40 GB.
const LARGEST: usize = 1 << 28;

fn pixels(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (1..=LARGEST).contains(&count) => Ok(count),
        _ => Err(format!("it must be a whole number from 1 to {LARGEST}")),
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
        assert_eq!(pixels("268435456"), Ok(LARGEST));
        assert!(pixels("0").is_err() && pixels("268435457").is_err());
    }
}
