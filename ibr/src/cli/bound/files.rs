//! The map and the plot of a prediction.

use super::chart;
use crate::analysis::ViewError;
use crate::cli::arguments::BoundArguments;
use crate::cli::failure::{Failure, failed};
use crate::cli::heat;
use crate::cli::output::{self, Encoded};
use crate::cli::outputs::{Outputs, Part, ends_with};
use crate::files::refuse_pixels_without_memory;
use crate::image::{Image, Levels, pfm};
use std::path::Path;

impl BoundArguments {
    /// The files that were asked for.
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::of(&[(Part::Map, self.map.as_ref()), (Part::Plot, self.plot.as_ref())])
    }
}

/// The contents of the files of a view, and the estimate that is white in the picture of the map.
pub(super) fn encoded<'a>(
    outputs: &'a Outputs,
    predicted: &ViewError,
    truth: Option<&Image>,
) -> Result<(Vec<Encoded<'a>>, Option<f32>), Failure> {
    let (mut all, mut white) = (Vec::new(), None);
    for (part, path) in &outputs.parts {
        if *part == Part::Plot {
            all.push(Encoded { bytes: chart::file(predicted, truth, path)?, path });
            continue;
        }
        // A picture or three numbers per pixel, and the file.
        let size = predicted.rendering.image.size();
        refuse_pixels_without_memory(path, size, 36.0).map_err(failed)?;
        let (map, largest) = map(predicted, path)?;
        white = largest;
        all.push(map);
    }
    Ok((all, white))
}

/// A picture of the estimate, or the three numbers of every pixel as a float map.
fn map<'a>(predicted: &ViewError, path: &'a Path) -> Result<(Encoded<'a>, Option<f32>), Failure> {
    let size = predicted.rendering.image.size();
    if ends_with(path, "pfm") {
        let pixels = predicted.local_limit.iter().zip(&predicted.expected).zip(&predicted.estimate);
        let data = pixels.flat_map(|((limit, expected), estimate)| [*limit, *expected, *estimate]).collect();
        let bytes = pfm::encode(&Image::from_values(size, 3, data));
        return Ok((Encoded { bytes, path }, None));
    }
    let (map, white) = heat::map(&predicted.estimate, size);
    Ok((output::encoded(&map, path, Levels::Eight)?, Some(white)))
}
