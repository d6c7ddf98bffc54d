//! The maps of views: from files, from the points of a model, or from the photographs themselves.

use super::{Loaded, Loader};
use crate::camera::Camera;
use crate::depth::{DepthMap, Measure};
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

/// What a view says of its map.
pub(super) struct Given<'a> {
    pub(super) map: &'a Path,
    pub(super) scale: Option<f64>,
    pub(super) measure: Measure,
}

impl Loader<'_> {
    /// The map of a view, if a file has it.
    pub(super) fn stored(
        &self,
        view: &ViewSpec,
        image: &Image,
        given: &Given<'_>,
    ) -> Loaded<Option<DepthMap>> {
        let MapSource::File(file) = MapSource::of(given.map) else {
            let scale = if given.measure == Measure::Depth { "depth_scale" } else { "disparity_scale" };
            let others = [(scale, given.scale.is_some()), ("step", view.step.is_some())];
            return match others.iter().find(|(_, given)| *given) {
                None => Ok(None),
                Some((key, _)) => Err(self.incomplete(format!(
                    "{} has `{key}`, which is for the numbers of a file, but no file has its map; remove it",
                    view.named()
                ))),
            };
        };
        let path = self.file(file);
        let (width, height, stored) = read_map(&path, self.options.max_pixels)?;
        let bad = |e| InputError::file(&path, format!("{}: {e}", view.named()));
        let map = DepthMap::new((width, height), stored, given.scale.unwrap_or(1.0), given.measure);
        let map = map.and_then(|map| match view.disparity_offset {
            Some(offset) => map.with_offset(offset),
            None => Ok(map),
        });
        let map = map.map_err(bad)?;
        map.fits(image.size(), view.step.unwrap_or(1)).map_err(bad)?;
        Ok(Some(map))
    }

    /// A view with the samples of its map at their pixels; `points` gives that of the points of a model.
    pub(super) fn read<P>(
        &self,
        view: &ViewSpec,
        given: &Given<'_>,
        mut read: Read<P>,
        points: impl Fn(&Image, &P) -> Loaded<DepthMap>,
    ) -> Loaded<Read<P>> {
        if MapSource::of(given.map) == MapSource::Points {
            read.map = Some(points(&read.image, &read.camera)?);
        }
        let map = read.map.map(|map| self.sampled(view, map, &read.image, given.map)).transpose()?;
        Ok(Read { map, ..read })
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
        let mut found = found.into_iter();
        let whole = |(view, Read { image, map, camera }): (&&ViewSpec, Read<P>)| {
            let map = match (map, found.next()) {
                (Some(map), _) => map,
                (None, Some(map)) => {
                    let map = match view.disparity_offset {
                        Some(offset) => map.with_offset(offset).map_err(|e| self.incomplete(e))?,
                        None => map,
                    };
                    self.sampled(view, map, &image, Path::new("matched"))?
                }
                (None, None) => return Err(self.incomplete("a view without a map")),
            };
            Ok(SourceView { image, map, camera })
        };
        views.iter().zip(read).map(whole).collect()
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
