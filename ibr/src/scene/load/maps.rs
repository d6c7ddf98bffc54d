//! The maps of views: from files, from the points of a model, or from the photographs themselves.

use super::{Loaded, Loader};
use crate::camera::Camera;
use crate::camera::resize::{Size, factors};
use crate::depth::{DepthError, DepthMap, Measure};
use crate::files::InputError;
use crate::image::{Image, read_image, read_map, read_photograph};
use crate::matching::{Photograph, depths};
use crate::partial::placed;
use crate::pipeline::{Geometry, RenderSettings, Renderer};
use crate::propagate::View;
use crate::scene::spec::MapSource;
use crate::scene::{SourceView, ViewSpec};
use hybank_core::messages::Quoted;
use std::path::Path;

/// A view whose map, if it is to be found from others, waits for them.
pub(super) struct Read<P> {
    pub(super) image: Image,
    pub(super) map: Option<DepthMap>,
    pub(super) camera: P,
    /// Pixels that show no part of the scene; empty if all do.
    pub(super) hidden: Vec<bool>,
}

impl<P: Copy> Read<P> {
    fn photograph(&self) -> Photograph<'_, P> {
        Photograph { image: &self.image, camera: self.camera }
    }

    fn view(&self) -> Option<View<'_, P>> {
        Some(View { image: &self.image, map: self.map.as_ref()?, camera: self.camera })
    }

    /// Takes away the depths of what is no part of the scene, unless nothing would be left.
    fn forget_hidden(&mut self) {
        let Some(map) = &mut self.map else { return };
        let is_shown = |p: usize| self.hidden.get(p) != Some(&true) && !map.data()[p].is_nan();
        if (0..map.data().len()).any(is_shown) {
            map.forget(&self.hidden);
        }
    }
}

/// What to say of a photograph whose shape is that of another image after a quarter turn.
pub(super) fn on_its_side(photograph: Size, other: Size) -> &'static str {
    let turned = (photograph.1, photograph.0);
    match turned != photograph && factors(turned, other).is_some() {
        true => "; the photograph seems to lie on its side: turn its pixels as its EXIF data say",
        false => "",
    }
}

/// The views, and of each the pixels that show no part of the scene.
type Whole<P> = (Vec<SourceView<P>>, Vec<Vec<bool>>);

/// The photograph of a view, and the pixels that show no part of the scene: transparent ones, and those that
/// are black in its mask. `folder` is that of the scene.
pub(crate) fn photograph(view: &ViewSpec, folder: &Path, most: usize) -> Loaded<(Image, Vec<bool>)> {
    let (image, mut hidden) = read_photograph(&folder.join(&view.image), most)?;
    if let Some(mask) = &view.mask {
        let path = folder.join(mask);
        let mask = read_image(&path, most)?;
        mask.same_size(&Quoted(&path).to_string(), image.size(), &view.named())?;
        hidden.resize(image.width() * image.height(), false);
        hidden.iter_mut().enumerate().for_each(|(p, hidden)| *hidden |= mask.pixel::<3>(p) == [0.0; 3]);
    }
    Ok((image, hidden))
}

impl Loader<'_> {
    /// A view with its image, the camera that `camera` gives for the size of that, and its map unless other
    /// views have to give it; `other` makes that of a mesh or of the points of a model.
    pub(super) fn read<P>(
        &self,
        view: &ViewSpec,
        measure: Measure,
        camera: impl Fn((usize, usize)) -> Loaded<P>,
        other: impl Fn(MapSource<'_>, &Image, &P) -> Loaded<DepthMap>,
    ) -> Loaded<Read<P>> {
        let (key, map, scale) = match measure {
            Measure::Depth => ("depth", &view.depth, view.depth_scale),
            Measure::Disparity => ("disparity", &view.disparity, view.disparity_scale),
        };
        let (image, hidden) = photograph(view, self.folder, self.options.max_pixels)?;
        let source = map.as_deref().map(MapSource::of);
        let stored = match source {
            Some(MapSource::File(file)) => {
                Some(self.stored(view, file, scale.unwrap_or(1.0), measure, &image)?)
            }
            Some(_) => self.no_numbers(view, key, scale)?,
            None => None,
        };
        let camera = camera(image.size())?;
        let map = match source {
            Some(source @ (MapSource::Points | MapSource::Mesh(_))) => Some(other(source, &image, &camera)?),
            _ => stored,
        };
        let map = map.map(|map| self.sampled(view, map, &image)).transpose()?;
        Ok(Read { image, map, camera, hidden })
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
        fitting.map_err(|e| {
            let side = on_its_side(image.size(), (width, height));
            InputError::file(&path, format!("{}: {e}{side}", view.named()))
        })
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
    fn sampled(&self, view: &ViewSpec, map: DepthMap, image: &Image) -> Loaded<DepthMap> {
        let bad = |e| self.incomplete(format!("the map of {}: {e}", view.named()));
        Ok(match (view.step.unwrap_or(1), self.options.depth_step) {
            (1, 1) => map,
            (1, step) => placed(&map.decimated(step).map_err(bad)?, step, image),
            (step, _) => placed(&map, step, image),
        })
    }

    /// The views with the maps that are found from the photographs, and those without any, whose depths are
    /// what the others show from their places.
    pub(super) fn whole<P: Geometry>(
        &self,
        views: &[&ViewSpec],
        mut read: Vec<Read<P>>,
        measure: Measure,
    ) -> Loaded<Whole<P>> {
        let map = |view: &ViewSpec| {
            if measure == Measure::Depth { view.depth.clone() } else { view.disparity.clone() }
        };
        let wanted: Vec<bool> = views
            .iter()
            .map(|view| map(view).is_some_and(|map| MapSource::of(&map) == MapSource::Matched))
            .collect();
        if wanted.contains(&true) {
            let photographs: Vec<_> = read.iter().map(Read::photograph).collect();
            let found = depths(&photographs, measure, &wanted).map_err(|e| self.incomplete(e))?;
            for ((view, read), found) in views.iter().zip(&mut read).zip(found) {
                let Some(found) = found else { continue };
                let found = with_offset(view, found).map_err(|e| self.incomplete(e))?;
                read.map = Some(self.sampled(view, found, &read.image)?);
            }
        }
        read.iter_mut().for_each(Read::forget_hidden);
        let found = self.shown_by_others(views, &read, measure)?;
        let hidden = read.iter_mut().map(|read| std::mem::take(&mut read.hidden)).collect();
        let of = |(Read { image, map, camera, .. }, found): (Read<P>, Option<DepthMap>)| {
            Some(SourceView { image, map: map.or(found)?, camera })
        };
        Ok((read.into_iter().zip(found).filter_map(of).collect(), hidden))
    }

    /// For views without a map the depths that the others show from there.
    fn shown_by_others<P: Geometry>(
        &self,
        views: &[&ViewSpec],
        read: &[Read<P>],
        measure: Measure,
    ) -> Loaded<Vec<Option<DepthMap>>> {
        let Some(lacking) = read.iter().position(|read| read.map.is_none()) else {
            return Ok(vec![None; read.len()]);
        };
        let with_maps: Vec<View<'_, P>> = read.iter().filter_map(Read::view).collect();
        if with_maps.is_empty() {
            let key = if measure == Measure::Depth { "depth" } else { "disparity" };
            return Err(self.incomplete(format!(
                "{} has no `{key}`, and neither has another view that could show it; {key} = \"matched\" finds it from the photographs",
                views[lacking].named()
            )));
        }
        let settings = RenderSettings { keep_exposure: true, ..RenderSettings::default() };
        let named = |e| self.incomplete(format!("the views with a map: {e}"));
        let renderer = Renderer::new(&with_maps, &settings).map_err(named)?;
        let shown = |(view, read): (&&ViewSpec, &Read<P>)| {
            if read.map.is_some() {
                return Ok(None);
            }
            let none = |why: String| {
                self.incomplete(format!(
                    "{} has no map, and the others show none from there{why}",
                    view.named()
                ))
            };
            let rendering = renderer.render(&read.camera, read.image.size());
            let depth = rendering.map_err(|e| none(format!(": {e}")))?.depth;
            let is_unknown = depth.unknown() == depth.data().len();
            if is_unknown { Err(none(String::new())) } else { Ok(Some(depth)) }
        };
        views.iter().zip(read).map(shown).collect()
    }

    /// The depths of a mesh at a camera.
    pub(super) fn of_mesh(
        &self,
        view: &ViewSpec,
        file: &Path,
        image: &Image,
        camera: &Camera,
    ) -> Loaded<DepthMap> {
        let path = self.file(file);
        let mesh = self.models.mesh(&path)?;
        mesh.depths(camera, image.size()).map_err(|_| {
            InputError::file(&path, format!("{} shows nothing of it; are they in one world?", view.named()))
        })
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
