//! The map and the plot of a prediction.

use super::chart;
use crate::analysis::ViewError;
use crate::cli::arguments::BoundArguments;
use crate::cli::failure::Failure;
use crate::cli::heat;
use crate::cli::output::{self, Encoded};
use crate::files::refuse_pixels_without_memory;
use crate::image::{Image, Levels, pfm};
use hybank::messages::Quoted;
use std::path::{Path, PathBuf};

/// The files of one virtual view.
pub(super) struct Outputs {
    map: Option<PathBuf>,
    plot: Option<PathBuf>,
}

impl Outputs {
    /// Those that were asked for; of one of several views with its number.
    pub(super) fn of(arguments: &BoundArguments, frame: Option<usize>) -> Self {
        let name = |path: &PathBuf| frame.map_or(path.clone(), |frame| output::numbered(path, frame));
        Self { map: arguments.map.as_ref().map(name), plot: arguments.plot.as_ref().map(name) }
    }

    pub(super) fn files(&self) -> Vec<&Path> {
        [&self.map, &self.plot].into_iter().flatten().map(PathBuf::as_path).collect()
    }

    /// Checks that need no file.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let named = [("--map", &self.map), ("--plot", &self.plot)];
        let named = named.iter().filter_map(|(option, path)| Some((*option, path.as_deref()?)));
        output::check_names(&named.collect::<Vec<_>>())?;
        if let Some(plot) = self.plot.as_ref().filter(|plot| chart::format(plot).is_none()) {
            let message = "a plot is written as .svg or .png";
            return Err(Failure::Usage(format!("--plot {}: {message}", Quoted(plot))));
        }
        self.map.as_ref().map_or(Ok(()), |map| output::refuse_format(map, Levels::Eight))
    }

    pub(super) fn refuse_existing(&self, force: bool) -> Result<(), Failure> {
        self.files().into_iter().try_for_each(|path| output::refuse_existing(path, force))
    }

    /// The contents of the files, and the estimate that is white in the picture of the map.
    pub(super) fn encoded(
        &self,
        predicted: &ViewError,
        truth: Option<&Image>,
    ) -> Result<(Vec<Encoded<'_>>, Option<f32>), Failure> {
        let (mut all, mut white) = (Vec::new(), None);
        if let Some(path) = &self.map {
            // A picture or three numbers per pixel, and the file.
            let size = predicted.rendering.image.size();
            refuse_pixels_without_memory(path, size, 36.0).map_err(Failure::input)?;
            let (map, largest) = map(predicted, path)?;
            white = largest;
            all.push(map);
        }
        if let Some(path) = &self.plot {
            let bytes = chart::file(predicted, truth, path)?;
            all.push(Encoded { bytes, path });
        }
        Ok((all, white))
    }
}

/// A picture of the estimate, or the three numbers of every pixel as a float map.
fn map<'a>(predicted: &ViewError, path: &'a Path) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    let size = predicted.rendering.image.size();
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pfm")) {
        let first =
            if predicted.sure_bound.is_empty() { &predicted.local_limit } else { &predicted.sure_bound };
        let pixels = first.iter().zip(&predicted.expected).zip(&predicted.estimate);
        let data = pixels.flat_map(|((limit, expected), estimate)| [*limit, *expected, *estimate]).collect();
        let bytes = pfm::encode(&Image::from_values(size, 3, data));
        return Ok((Encoded { bytes, path }, None));
    }
    let (map, white) = heat::map(&predicted.estimate, size);
    Ok((output::encoded(&map, path, Levels::Eight)?, Some(white)))
}
