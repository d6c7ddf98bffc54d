//! The maps of views: from files, from the points of a model, or from the photographs themselves.

use super::{Loaded, Loader};
use crate::camera::Camera;
use crate::depth::{DepthError, DepthMap, Measure};
use crate::files::InputError;
use crate::image::{Image, read_map};
use crate::matching::{Photograph, depths};
use crate::partial::placed;
use crate::propagate::Viewpoint;
use crate::scene::spec::MapSource;
use crate::scene::{SourceView, ViewSpec};
use std::path::Path;

/// A view whose map, if it is to be found from the photographs, waits for the others.
pub(super) struct Read<P> {
    pub(super) image: Image,
    pub(super) map: Option<DepthMap>,
    pub(super) camera: P,
}

impl Loader<'_> {
    /// A view with its image, the camera that `camera` gives for the size of that, and its map unless the
    /// photographs have to give it; `points` makes that of the points of a model.
    pub(super) fn read<P>(
        &self,
        view: &ViewSpec,
        measure: Measure,
        camera: impl Fn((usize, usize)) -> Loaded<P>,
        points: impl Fn(&Image, &P) -> Loaded<DepthMap>,
    ) -> Loaded<Read<P>> {
        let (key, kind, map, scale) = match measure {
            Measure::Depth => ("depth", "calibrated", &view.depth, view.depth_scale),
            Measure::Disparity => ("disparity", "rectified", &view.disparity, view.disparity_scale),
        };
        let file = self.need(map.as_deref(), view, key, kind)?;
        let (image, source) = (self.image(&view.image)?, MapSource::of(file));
        let stored = match source {
            MapSource::File(file) => Some(self.stored(view, file, scale.unwrap_or(1.0), measure, &image)?),
            _ => self.no_numbers(view, key, scale)?,
        };
        let camera = camera(image.size())?;
        let map = if source == MapSource::Points { Some(points(&image, &camera)?) } else { stored };
        let map = map.map(|map| self.sampled(view, map, &image, file)).transpose()?;
        Ok(Read { image, map, camera })
    }

    /// The map that a file has.
    fn stored(
        &self,
        view: &ViewSpec,
        file: &Path,
        scale: f64,
        measure: Measure,
        image: &Image,
    ) -> Loaded<DepthMap> {
        let path = self.file(file);
        let (width, height, stored) = read_map(&path, self.options.max_pixels)?;
        let map =
            DepthMap::new((width, height), stored, scale, measure).and_then(|map| with_offset(view, map));
        let fitting = map.and_then(|map| map.fits(image.size(), view.step.unwrap_or(1)).map(|()| map));
        fitting.map_err(|e| InputError::file(&path, format!("{}: {e}", view.named())))
    }

    /// Refuses what is said of the numbers of a file where no file has the map.
    fn no_numbers<T>(&self, view: &ViewSpec, key: &str, scale: Option<f64>) -> Loaded<Option<T>> {
        let key = match (scale, view.step) {
            (Some(_), _) => format!("{key}_scale"),
            (None, Some(_)) => "step".into(),
            (None, None) => return Ok(None),
        };
        Err(self.incomplete(format!(
            "{} has `{key}`, which is for the numbers of a file, but no file has its map; remove it",
            view.named()
        )))
    }

    /// A map of the size of its image, with the samples that are wanted.
    fn sampled(&self, view: &ViewSpec, map: DepthMap, image: &Image, file: &Path) -> Loaded<DepthMap> {
        let bad = |e| InputError::file(&self.file(file), format!("{}: {e}", view.named()));
        Ok(match (view.step.unwrap_or(1), self.options.depth_step) {
            (1, 1) => map,
            (1, step) => placed(&map.decimated(step).map_err(bad)?, step, image),
            (step, _) => placed(&map, step, image),
        })
    }

    /// The views with the maps that are found from the photographs.
    pub(super) fn matched<P: Viewpoint>(
        &self,
        views: &[&ViewSpec],
        read: Vec<Read<P>>,
        measure: Measure,
    ) -> Loaded<Vec<SourceView<P>>> {
        let photographs: Vec<_> =
            read.iter().map(|read| Photograph { image: &read.image, camera: read.camera }).collect();
        let found = match read.iter().all(|read| read.map.is_some()) {
            true => Vec::new(),
            false => depths(&photographs, measure).map_err(|e| self.incomplete(e))?,
        };
        let found = found.into_iter().map(Some).chain(std::iter::repeat(None));
        let whole = |((view, read), found): ((&&ViewSpec, Read<P>), Option<DepthMap>)| {
            let Read { image, map, camera } = read;
            let map = match map {
                Some(map) => map,
                None => {
                    let found = found.ok_or_else(|| self.incomplete("a view without a map"))?;
                    let found = with_offset(view, found).map_err(|e| self.incomplete(e))?;
                    self.sampled(view, found, &image, Path::new("matched"))?
                }
            };
            Ok(SourceView { image, map, camera })
        };
        views.iter().zip(read).zip(found).map(whole).collect()
    }

    /// The depths of the points of a model that this view shows, unknown elsewhere.
    pub(super) fn of_points(&self, view: &ViewSpec, image: &Image, camera: &Camera) -> Loaded<DepthMap> {
        let Some(folder) = view.colmap.as_ref().or(self.spec.colmap.as_ref()) else {
            return Err(self.incomplete(format!(
                "{} has depth = \"points\", those of a COLMAP model; name its folder with `colmap`, or give a depth map",
                view.named()
            )));
        };
        let points = self.models.points(&self.file(folder), &view.image.to_string_lossy())?;
        let (width, height) = image.size();
        let mut data = vec![f32::NAN; width * height];
        for point in points {
            let (x, y, depth) = camera.project(&point);
            if let Some(p) = image.pixel_at(x, y).filter(|_| depth > 0.0) {
                data[p] = data[p].min(depth as f32);
            }
        }
        DepthMap::new((width, height), data, 1.0, Measure::Depth).map_err(|_| {
            self.incomplete(format!("{} shows no point of the model; give it a depth map", view.named()))
        })
    }
}

fn with_offset(view: &ViewSpec, map: DepthMap) -> Result<DepthMap, DepthError> {
    match view.disparity_offset {
        Some(offset) => map.with_offset(offset),
        None => Ok(map),
    }
}
