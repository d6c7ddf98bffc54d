//! The files of one virtual view.

use crate::analysis::difference;
use crate::cli::arguments::RenderArguments;
use crate::cli::failure::Failure;
use crate::cli::heat;
use crate::cli::output::{self, Encoded};
use crate::depth::{FAR, Measure};
use crate::files::refuse_pixels_without_memory;
use crate::image::{Image, Levels, encode_levels, encode_with_alpha, pfm};
use crate::interpolate::Cover;
use crate::pipeline::Rendering;
use hybank::messages::Quoted;
use std::path::{Path, PathBuf};

/// What a file shows of a virtual view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    View,
    Mask,
    Depth,
    Count,
    Error,
}

impl Part {
    fn option(self) -> &'static str {
        match self {
            Self::View => "-o",
            Self::Mask => "--mask",
            Self::Depth => "--depth",
            Self::Count => "--count",
            Self::Error => "--error",
        }
    }

    /// Refuses a file whose ending is not one of its formats.
    fn check(self, path: &Path, levels: Levels) -> Result<(), Failure> {
        let allowed: &[&str] = match self {
            Self::Depth => &["pfm"],
            Self::Count => &["png", "pfm"],
            Self::View if is_film(path) => return Ok(()),
            Self::View if is_packed_film(path) => return Err(packed_film(path)),
            Self::View => return output::refuse_format(path, levels),
            Self::Mask | Self::Error => return output::refuse_format(path, Levels::Eight),
        };
        if allowed.iter().any(|ending| path.extension().is_some_and(|e| e == *ending)) {
            return Ok(());
        }
        let (option, path) = (self.option(), Quoted(path));
        let name = option.trim_start_matches('-');
        let endings: Vec<String> = allowed.iter().map(|ending| format!(".{ending}")).collect();
        Err(Failure::Usage(format!("{option} {path}: {name} is written as {}", endings.join(" or "))))
    }
}

/// Whether a path is a film of several views.
pub(super) fn is_film(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "y4m")
}

/// Whether a path is a film of a format that only encoders write.
fn is_packed_film(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    ["mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "mpeg", "ogv", "wmv"].contains(&ending.as_str())
}

fn packed_film(path: &Path) -> Failure {
    let (shown, film) = (Quoted(path), path.with_extension("y4m"));
    Failure::Usage(format!(
        "-o {shown}: films are written uncompressed, as .y4m; write `-o {}`, or give an encoder the frames: \
         `-o - | ffmpeg -i - {shown}`",
        Quoted(&film)
    ))
}

/// The files of one view.
pub(super) struct Outputs {
    parts: Vec<(Part, PathBuf)>,
    levels: Levels,
    alpha: bool,
}

impl Outputs {
    /// Those that were asked for.
    pub(super) fn of(arguments: &RenderArguments) -> Self {
        let RenderArguments { output, mask, depth, count, error, .. } = arguments;
        let asked = [
            (Part::View, Some(output)),
            (Part::Mask, mask.as_ref()),
            (Part::Depth, depth.as_ref()),
            (Part::Count, count.as_ref()),
            (Part::Error, error.as_ref()),
        ];
        let parts = asked.into_iter().filter_map(|(part, path)| Some((part, path?.clone()))).collect();
        Self { parts, levels: arguments.bits, alpha: arguments.alpha }
    }

    /// The same files with the number of a view.
    pub(super) fn numbered(mut self, frame: usize) -> Self {
        self.parts.iter_mut().for_each(|(_, path)| *path = output::numbered(path, frame));
        self
    }

    /// The same without the view itself, which goes into a film.
    pub(super) fn beside_film(mut self) -> Self {
        self.parts.retain(|(part, _)| *part != Part::View);
        self
    }

    /// The files, without standard output.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|(_, path)| path.as_path()).filter(|path| !output::is_standard(path))
    }

    /// Checks that need no file.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let named: Vec<(&str, &Path)> =
            self.parts.iter().map(|(part, path)| (part.option(), path.as_path())).collect();
        output::check_names(&named)?;
        let view = &self.parts[0].1;
        let png = output::is_standard(view) || view.extension().is_some_and(|ending| ending == "png");
        if self.alpha && !png {
            let view = Quoted(view);
            return Err(Failure::Usage(format!("--alpha: {view} has no alpha channel; write a .png")));
        }
        if is_film(view) && self.levels == Levels::Sixteen {
            return Err(Failure::Usage("--bits 16: a film has 8 bits per value".into()));
        }
        self.parts.iter().try_for_each(|(part, path)| part.check(path, self.levels))
    }

    /// The contents of the files, and the error that is white in its picture.
    pub(super) fn encoded(
        &self,
        rendering: &Rendering,
        truth: Option<&Image>,
    ) -> Result<(Vec<Encoded<'_>>, Option<f32>), Failure> {
        let (mut all, mut white) = (Vec::new(), None);
        for (part, path) in &self.parts {
            // Numbers or a picture, and the file.
            refuse_pixels_without_memory(path, rendering.image.size(), 20.0).map_err(Failure::input)?;
            all.push(match part {
                Part::View => self.view(rendering, path)?,
                Part::Mask => output::encoded(&mask_image(rendering), path, Levels::Eight)?,
                Part::Depth => numbers(depths(rendering), rendering.depth.size(), path),
                Part::Count => counts(rendering, path)?,
                Part::Error => {
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
            let bytes = encode_with_alpha(image, &rendering.alpha(), path, self.levels);
            return Ok(Encoded { bytes: bytes.map_err(Failure::input)?, path });
        }
        output::encoded(image, path, self.levels)
    }
}

/// White seen, grey crack, dark grey guessed, black disocclusion.
fn mask_image(rendering: &Rendering) -> Image {
    let (width, height) = rendering.image.size();
    let mut image = Image::filled(width, height, 1, 0.0);
    for (pixel, cover) in image.data_mut().iter_mut().zip(&rendering.mask) {
        *pixel = match cover {
            Cover::Seen => 255.0,
            Cover::Crack => 128.0,
            Cover::Guessed => 64.0,
            Cover::Disocclusion => 0.0,
        };
    }
    image
}

/// The depths, infinite where they are far away.
fn depths(rendering: &Rendering) -> Vec<f32> {
    let map = &rendering.depth;
    let is_far = |v: f32| map.measure() == Measure::Depth && v >= FAR;
    map.data().iter().map(|v| if is_far(*v) { f32::INFINITY } else { *v }).collect()
}

/// A float map.
fn numbers(data: Vec<f32>, size: (usize, usize), path: &Path) -> Encoded<'_> {
    Encoded { bytes: pfm::encode(&Image::from_values(size, 1, data)), path }
}

/// The number of samples of every pixel, as it is.
fn counts<'a>(rendering: &Rendering, path: &'a Path) -> Result<Encoded<'a>, Failure> {
    let size = rendering.image.size();
    if path.extension().is_some_and(|ending| ending == "pfm") {
        return Ok(numbers(rendering.counts.iter().map(|n| f32::from(*n)).collect(), size, path));
    }
    let bytes = encode_levels(&rendering.counts, size, path).map_err(Failure::input)?;
    Ok(Encoded { bytes, path })
}

/// Absolute difference from the photograph in grey levels, mean over the channels; of the brightness, if
/// only one of them has colours.
fn errors<'a>(image: &Image, truth: &Image, path: &'a Path) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    let values = difference(image, truth);
    if path.extension().is_some_and(|ending| ending == "pfm") {
        return Ok((numbers(values, image.size(), path), None));
    }
    let (map, white) = heat::map(&values, image.size());
    Ok((output::encoded(&map, path, Levels::Eight)?, Some(white)))
}
