//! Reading a scene: determine its kind, read its files in parallel, prepare its views.

mod calibrated;
mod complete;
mod goals;
mod keys;
mod left_out;
mod maps;
mod models;
mod rectified;
mod uncalibrated;

pub use complete::complete;
pub use goals::MOST_FRAMES;
pub(crate) use maps::photograph;

use super::prepare::{Preparation, PrepareSettings, prepare};
use super::spec::{SceneKind, SceneSpec, ViewSpec};
use super::unknown::Unknown;
use super::{Kind, Scene};
use crate::files::InputError;
use crate::image::{Image, MOST_PIXELS, read_image};
use goals::Goal;
use hybank_core::messages::{self, Number, Quoted, of_document};
use left_out::LeftOut;
use models::Models;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// How a scene is read.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadOptions {
    /// Leave this view out and render it.
    pub view: Option<String>,
    /// Use only every K-th value of full maps.
    pub depth_step: usize,
    /// What unknown depths are taken for, whatever the scene says.
    pub unknown: Option<Unknown>,
    /// Use only so many views, those nearest to the virtual camera.
    pub nearest: Option<usize>,
    /// Do not correct small errors of the cameras.
    pub keep_cameras: bool,
    /// The most pixels of the virtual view, and of each image and map.
    pub max_pixels: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            view: None,
            depth_step: 1,
            unknown: None,
            nearest: None,
            keep_cameras: false,
            max_pixels: MOST_PIXELS,
        }
    }
}

/// Parses the text of a scene file; `path` appears in messages.
///
/// # Errors
/// [`InputError`] with line, column and the keys known there.
pub fn parse(text: &str, path: &Path) -> Result<SceneSpec, InputError> {
    toml::from_str(text).map_err(|e| {
        let reason = of_document(e.message()) + &keys::hint(e.message());
        let Some(place) = e.span().map(|span| messages::Location::find(text, span)) else {
            return InputError::file(path, reason);
        };
        InputError::content(path, format!(":{}:{}", place.line, place.column), format!("{reason}\n{place}"))
    })
}

/// Reads all files of a scene. Relative paths start in the folder of the scene file `path`.
///
/// # Errors
/// [`InputError`], naming file, view and numbers.
pub fn load(spec: &SceneSpec, path: &Path, options: &LoadOptions) -> Result<Scene, InputError> {
    Loader::new(&complete(spec, path)?, path, options).load(options.view.as_deref())
}

/// The scene for the place of each of some views, which is left out; `with` takes its number among them. The
/// files of cameras are read once.
///
/// # Errors
/// [`InputError`], or what `with` returns.
pub fn each_left_out<E: From<InputError>>(
    spec: &SceneSpec,
    path: &Path,
    options: &LoadOptions,
    views: &[String],
    mut with: impl FnMut(usize, Scene) -> Result<(), E>,
) -> Result<(), E> {
    let spec = complete(spec, path)?;
    let loader = Loader::new(&spec, path, options);
    views.iter().enumerate().try_for_each(|(index, view)| with(index, loader.load(Some(view))?))
}

struct Loader<'a> {
    spec: &'a SceneSpec,
    path: &'a Path,
    folder: &'a Path,
    options: &'a LoadOptions,
    models: Models,
    /// Depths of maps that were looked at before the views were chosen.
    quartiles: Mutex<BTreeMap<PathBuf, Vec<f64>>>,
}

type Loaded<T> = Result<T, InputError>;

/// What was read of a scene.
struct Inputs {
    kind: Kind,
    /// Of each view its number among those that are not left out.
    numbers: Vec<usize>,
    /// Of each view the pixels that show no part of the scene; empty if all do.
    hidden: Vec<Vec<bool>>,
    /// What was decided, for the user.
    notes: Vec<String>,
}

impl<'a> Loader<'a> {
    fn new(spec: &'a SceneSpec, path: &'a Path, options: &'a LoadOptions) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self { spec, path, folder, options, models: Models::default(), quartiles: Mutex::default() }
    }

    /// The scene, for the place of a view if one is left out.
    fn load(&self, left_out: Option<&str>) -> Loaded<Scene> {
        self.different_names()?;
        let left_out = left_out.map(|view| self.left_out(view)).transpose()?;
        let mut views: Vec<&ViewSpec> = self.spec.view.iter().collect();
        let own = match left_out {
            Some(LeftOut::View(index)) => Some((index, views.remove(index))),
            _ => None,
        };
        if views.is_empty() {
            return Err(self.incomplete("there is no view to render from; add [[view]] tables"));
        }
        let goals = self.goals()?;
        let Inputs { mut kind, numbers, hidden, mut notes } = if views.iter().any(|v| v.position.is_some()) {
            self.rectified(&views, own.map(|(_, view)| view), &goals)?
        } else if views.iter().any(|v| v.camera.is_some() || self.source_of(v).is_some()) {
            self.calibrated(&views, left_out.as_ref(), &goals)?
        } else {
            self.uncalibrated(&views, own, &goals)?
        };
        let unknown = self.options.unknown.or(self.spec.unknown).unwrap_or_default();
        let settings = PrepareSettings { unknown, keep_cameras: self.options.keep_cameras, hidden: &hidden };
        let prepared = match &mut kind {
            Kind::Rectified { views, .. } => prepare(views, &settings),
            Kind::Calibrated { views, .. } => prepare(views, &settings),
            Kind::Uncalibrated { .. } => Preparation::default(),
        };
        let Preparation { filled, outliers, faults, notes: changes, .. } = prepared;
        notes.extend(faults.into_iter().chain(changes));
        let names = numbers.iter().map(|number| views[*number].label()).collect();
        Ok(Scene { kind, names, offset: self.offset(&goals)?, filled, outliers, notes })
    }

    /// That the scene file contradicts itself, or what it lacks.
    fn incomplete(&self, reason: impl ToString) -> InputError {
        InputError::file(self.path, reason)
    }

    /// Refuses two views with the same name; images without a name may be used twice.
    fn different_names(&self) -> Loaded<()> {
        let mut seen = std::collections::BTreeSet::new();
        match self.spec.view.iter().filter_map(|v| v.name.as_ref()).find(|name| !seen.insert(*name)) {
            Some(name) => {
                Err(self
                    .incomplete(format!("two views are named \"{}\"; give each its own name", Quoted(name))))
            }
            None => Ok(()),
        }
    }

    /// The keys that a table has; those of another kind of scene are refused instead of ignored.
    fn keys_of_table(&self, named: &str, kind: SceneKind, table: &impl Serialize) -> Loaded<toml::Table> {
        let given = toml::Table::try_from(table).map_err(|e| self.incomplete(e))?;
        match given.keys().find(|key| !kind.has(key)) {
            Some(key) => Err(self.incomplete(format!(
                "{named} has `{key}`, which has no meaning in a {kind} scene; remove it, or give all views the keys of one kind"
            ))),
            None => Ok(given),
        }
    }

    fn finite(&self, value: f64, whose: &str) -> Loaded<f64> {
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.incomplete(format!("{whose}: position = {}: it must be a finite number", Number(value))))
    }

    fn file(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }

    fn image(&self, path: &Path) -> Loaded<Image> {
        read_image(&self.file(path), self.options.max_pixels)
    }

    fn need<T>(&self, value: Option<T>, view: &ViewSpec, key: &str, kind: SceneKind) -> Loaded<T> {
        value.ok_or_else(|| {
            let remedy = match key {
                "depth" | "disparity" => format!("; {key} = \"matched\" finds it from the photographs"),
                _ => String::new(),
            };
            let named = view.named();
            self.incomplete(format!(
                "{named} has no `{key}`, which every view of a {kind} scene needs{remedy}"
            ))
        })
    }
}

/// What `read` makes of each view, or the first error in the order of the views, so that every run reports
/// the same error.
fn each<V: Sync, T: Send>(views: &[V], read: impl Fn(&V) -> Loaded<T> + Sync + Send) -> Loaded<Vec<T>> {
    views.par_iter().map(read).collect::<Vec<_>>().into_iter().collect()
}

#[cfg(test)]
mod tests;
