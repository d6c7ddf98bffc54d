//! Scenes of general cameras: 3 x 4 matrices, COLMAP models or transforms files, and depths.

use super::left_out::LeftOut;
use super::maps::on_its_side;
use super::{Goal, Inputs, Loaded, Loader, each};
use crate::camera::Camera;
use crate::camera::ListedCamera;
use crate::camera::resize::{Size, factors};
use crate::depth::{DepthMap, Measure};
use crate::files::InputError;
use crate::image::{image_size, read_map};
use crate::pipeline::calibrated::QUARTILES;
use crate::pipeline::nearness::{AT_HAND, Placed, choose};
use crate::scene::spec::{MapSource, SceneKind};
use crate::scene::{Kind, ViewSpec};
use hybank_core::messages::Quoted;
use nalgebra::{Matrix3, Matrix3x4, Vector3};
use std::collections::BTreeSet;
use std::sync::PoisonError;

type Matrix = [[f64; 4]; 3];

/// A camera whose calibration was for images of another size than the one at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Resized {
    from: Size,
    to: Size,
}

impl Resized {
    /// The size of another image of the same collection, resized alike.
    fn applied(self, (w, h): Size) -> Size {
        let side = |from: usize, to: usize, side: usize| {
            ((side as f64 * to as f64 / from as f64).round() as usize).max(1)
        };
        (side(self.from.0, self.to.0, w), side(self.from.1, self.to.1, h))
    }
}

/// The images at hand that a camera from a file is compared with: the first, and how it was resized.
#[derive(Clone, Copy)]
struct First {
    size: Size,
    resized: Option<Resized>,
}

impl First {
    /// The size of another image of the same collection, resized alike.
    fn alike(self, listed: Size) -> Size {
        self.resized.map_or(listed, |resized| resized.applied(listed))
    }
}

/// A camera with the size of the image that a file says it is for.
type Sized = (Camera, Option<Size>);

impl Loader<'_> {
    pub(super) fn calibrated(
        &self,
        views: &[&ViewSpec],
        left_out: Option<&LeftOut>,
        goals: &[Goal],
    ) -> Loaded<Inputs> {
        self.a_camera_each()?;
        self.keys_of(views, goals, SceneKind::Calibrated)?;
        let place = |view: &&ViewSpec| {
            let size = image_size(&self.file(&view.image))?;
            let (camera, resized) = self.camera_of(view, size)?;
            Ok((Placed { camera, size }, resized))
        };
        let (placed, resized): (Vec<Placed>, Vec<_>) = each(views, place)?.into_iter().unzip();
        let first = First { size: placed[0].size, resized: resized[0] };
        let (cameras, size) = match left_out {
            Some(place) => self.at_place(place, first, goals)?,
            None => self.cameras(goals, first)?,
        };
        let numbers = self.needed(views, &placed, &cameras, size)?;
        let notes = notes(numbers.iter().filter_map(|number| resized[*number]));
        let views: Vec<&ViewSpec> = numbers.iter().map(|number| views[*number]).collect();
        let chosen: Vec<(&ViewSpec, Camera)> =
            numbers.iter().zip(&views).map(|(number, view)| (*view, placed[*number].camera)).collect();
        let one = |(view, camera): &(&ViewSpec, Camera)| {
            self.read(
                view,
                Measure::Depth,
                |_| Ok(*camera),
                |source, image, camera| match source {
                    MapSource::Mesh(file) => self.of_mesh(view, file, image, camera),
                    _ => self.of_points(view, image, camera),
                },
            )
        };
        let (views, hidden) = self.whole(&views, each(&chosen, one)?, Measure::Depth)?;
        Ok(Inputs { kind: Kind::Calibrated { views, cameras, size }, numbers, hidden, notes })
    }

    /// The numbers of the views that the virtual cameras need.
    fn needed(
        &self,
        views: &[&ViewSpec],
        placed: &[Placed],
        cameras: &[Camera],
        size: Size,
    ) -> Loaded<Vec<usize>> {
        // With one more the weights of the others are known.
        let most = self.options.nearest.map(|nearest| nearest.saturating_add(1));
        if placed.len() <= most.unwrap_or(AT_HAND) {
            return Ok((0..placed.len()).collect());
        }
        let mut needed = BTreeSet::new();
        for camera in cameras {
            let depths = self.depths_before(views, placed, camera)?;
            needed.extend(choose(placed, &Placed { camera: *camera, size }, &depths, most));
        }
        Ok(needed.into_iter().collect())
    }

    /// Depths of the scene before a camera, about: those of the map of the nearest view that has one, or the
    /// distance of the point at which the cameras look.
    fn depths_before(&self, views: &[&ViewSpec], placed: &[Placed], camera: &Camera) -> Loaded<Vec<f64>> {
        let stored = (0..views.len()).filter(|view| views[*view].is_stored() && views[*view].depth.is_some());
        let apart = |view: usize| {
            let other = &placed[view].camera;
            (other.centre() - camera.centre()).norm() * (2.0 - other.axis().dot(&camera.axis()))
        };
        let nearest = stored.min_by(|a, b| apart(*a).total_cmp(&apart(*b)));
        let Some((view, file)) = nearest.and_then(|view| Some((views[view], views[view].depth.as_ref()?)))
        else {
            return Ok(vec![looked_at(placed, camera)]);
        };
        let (path, scale) = (self.file(file), view.depth_scale.unwrap_or(1.0));
        let mut known = self.quartiles.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(depths) = known.get(&path) {
            return Ok(depths.clone());
        }
        let (width, height, values) = read_map(&path, self.options.max_pixels)?;
        let map = DepthMap::new((width, height), values, scale, Measure::Depth)
            .map_err(|e| InputError::file(&path, format!("{}: {e}", view.named())))?;
        let depths: Vec<f64> =
            QUARTILES.iter().filter_map(|share| map.quantile(*share)).map(f64::from).collect();
        known.insert(path, depths.clone());
        Ok(depths)
    }

    /// The camera of the view that is left out, or of an image that the file of cameras lists, and the size
    /// of the virtual view.
    fn at_place(&self, place: &LeftOut, first: First, goals: &[Goal]) -> Loaded<(Vec<Camera>, Size)> {
        let (camera, own) = match place {
            LeftOut::View(index) => {
                let view = &self.spec.view[*index];
                let own = self.image(&view.image)?.size();
                (self.camera_of(view, own)?.0, own)
            }
            LeftOut::Listed(image) => {
                let source = self.common_source().ok_or_else(|| self.no_such_view(image))?;
                let ListedCamera { camera, size } =
                    self.listed_camera(&source, image, first.size, "--view")?;
                let own = first.alike(size);
                (self.scaled((camera, Some(size)), own, "--view")?, own)
            }
        };
        Ok((vec![camera], self.size(goals, own)?))
    }

    /// The virtual cameras and their size.
    fn cameras(&self, goals: &[Goal], first: First) -> Loaded<(Vec<Camera>, Size)> {
        let (_, listed) = self.start_of(&goals[0], first)?;
        let is_alike = goals[0].target.cameras.is_none();
        let own = listed.map_or(first.size, |size| if is_alike { first.alike(size) } else { size });
        let size = self.size(goals, own)?;
        let cameras = self.along(
            goals,
            |goal| self.scaled(self.start_of(goal, first)?, size, &goal.name),
            |goal, from, share| {
                let to = self.scaled(self.end_of_path(goal, first)?, size, &goal.name)?;
                let path = || format!("the path of {}", goal.name);
                from.towards(&to, share).map_err(|source| self.bad_camera(&path(), source))
            },
        )?;
        Ok((cameras, size))
    }

    fn start_of(&self, goal: &Goal, first: First) -> Loaded<Sized> {
        self.wanted(goal.target.camera.as_ref(), goal.target.camera_of.as_deref(), goal, first)
    }

    fn end_of_path(&self, goal: &Goal, first: First) -> Loaded<Sized> {
        let (rows, image) = (goal.target.to_camera.as_ref(), goal.target.to_camera_of.as_deref());
        if rows.is_none() && image.is_none() {
            let name = &goal.name;
            return Err(
                self.incomplete(format!("{name} needs `to_camera` or `to_camera_of` for a path of cameras"))
            );
        }
        self.wanted(rows, image, goal, first)
    }

    fn matrix(&self, rows: &Matrix, which: &str) -> Loaded<Camera> {
        let matrix = Matrix3x4::from_fn(|i, j| rows[i][j]);
        Camera::metric(matrix, self.spec.mirrored).map_err(|source| self.bad_camera(which, source))
    }

    fn bad_camera(&self, which: &str, source: crate::camera::CameraError) -> InputError {
        self.incomplete(format!("{which}: {source}"))
    }

    /// The camera of a view whose image has this size: resized with it where a file has the camera for
    /// another size, or refused.
    fn camera_of(&self, view: &ViewSpec, size: Size) -> Loaded<(Camera, Option<Resized>)> {
        let which = view.named();
        let source = match (&view.camera, self.source_of(view)) {
            (Some(rows), _) => return Ok((self.matrix(rows, &which)?, None)),
            (None, Some(source)) => source,
            (None, None) => return self.need(None, view, "camera", SceneKind::Calibrated),
        };
        let image = view.image.to_string_lossy();
        let ListedCamera { camera, size: from } = self.listed_camera(&source, &image, size, &which)?;
        if factors(from, size).is_none() {
            return Err(self.incomplete(format!(
                "{which}: the image has {} x {} pixels, but {} lists its camera for {} x {}; use the image that was calibrated, or one that was resized by the same factor in both directions{}",
                size.0,
                size.1,
                Quoted(&source.path),
                from.0,
                from.1,
                on_its_side(size, from)
            )));
        }
        let resized = (from != size).then_some(Resized { from, to: size });
        Ok((self.scaled((camera, Some(from)), size, &which)?, resized))
    }

    /// A camera from a file, scaled with its image; as it is, for a window of another shape.
    fn scaled(&self, (camera, from): Sized, size: Size, which: &str) -> Loaded<Camera> {
        match from.filter(|from| *from != size).and_then(|from| factors(from, size)) {
            Some(factors) => camera.resized(factors).map_err(|source| self.bad_camera(which, source)),
            None => Ok(camera),
        }
    }

    /// A virtual camera: a matrix, or the camera of a listed image.
    fn wanted(&self, rows: Option<&Matrix>, image: Option<&str>, goal: &Goal, first: First) -> Loaded<Sized> {
        if let Some(rows) = rows {
            return Ok((self.matrix(rows, &goal.name)?, None));
        }
        match (image, self.source_of_goal(goal)) {
            (Some(image), Some(source)) => {
                let found = self.listed_camera(&source, image, first.size, &goal.name)?;
                Ok((found.camera, Some(found.size)))
            }
            (Some(_), None) => Err(self.incomplete(format!(
                "{} has `camera_of`, which needs `cameras`, or a `colmap` folder or a `transforms` file at the top; give it a `camera` (3 x 4), or name that file",
                goal.name
            ))),
            (None, Some(source)) => Err(self.incomplete(format!(
                "{} needs `camera_of`, an image whose camera it takes, or a `camera` (3 x 4); {}",
                goal.name,
                self.some_names(&source)?
            ))),
            (None, None) => Err(self.incomplete(format!("{} needs a `camera` (3 x 4)", goal.name))),
        }
    }
}

/// The distance of the point that is nearest to the axes of all cameras, along that of one; that of the
/// camera farthest away from it where the axes do not meet before it.
fn looked_at(placed: &[Placed], camera: &Camera) -> f64 {
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for Placed { camera, .. } in placed {
        let across = Matrix3::identity() - camera.axis() * camera.axis().transpose();
        matrix += across;
        right += across * camera.centre();
    }
    let met = matrix.try_inverse().map(|inverse| (inverse * right - camera.centre()).dot(&camera.axis()));
    let widest =
        placed.iter().map(|other| (other.camera.centre() - camera.centre()).norm()).fold(0.0, f64::max);
    met.filter(|depth| *depth > 0.0).unwrap_or(widest)
}

/// What to say of cameras that were resized, each change once.
fn notes(all: impl Iterator<Item = Resized>) -> Vec<String> {
    let mut counts: Vec<(Resized, usize)> = Vec::new();
    for resized in all {
        match counts.iter_mut().find(|(known, _)| *known == resized) {
            Some((_, count)) => *count += 1,
            None => counts.push((resized, 1)),
        }
    }
    let note = |(Resized { from, to }, count): (Resized, usize)| {
        let views = match count {
            1 => "the camera of 1 view is".into(),
            _ => format!("the cameras of {count} views are"),
        };
        format!(
            "{views} scaled from images of {} x {} to {} x {} pixels, the size of the photographs",
            from.0, from.1, to.0, to.1
        )
    };
    counts.into_iter().map(note).collect()
}
