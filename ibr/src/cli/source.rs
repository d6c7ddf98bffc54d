//! The scene of a command: its file, what was typed with it, and the photograph to compare with.

use super::arguments::SceneArguments;
use super::failure::{Failure, PROGRAM, failed, usage};
use super::inputs;
use crate::files;
use crate::image::{Image, read_image};
use crate::pipeline::RenderSettings;
use crate::scene::{self, Kind, LoadOptions, Scene, SceneSpec, TargetSpec, Unknown, ViewSpec};
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use std::path::{Path, PathBuf};

/// A scene file, read but not loaded.
pub(super) struct Source {
    path: PathBuf,
    pub(super) spec: SceneSpec,
}

impl SceneArguments {
    /// Checks that need no file.
    pub(super) fn check(&self) -> Result<(), Failure> {
        match self.depth_step {
            0 => usage("--depth-step 0: the step must be at least 1"),
            _ => Ok(()),
        }
    }

    /// The settings that both commands know; `offset` is that of the scene.
    pub(super) fn settings(&self, offset: f64) -> RenderSettings {
        let offset = self.offset.unwrap_or(offset);
        RenderSettings { offset, keep_exposure: self.keep_exposure, ..RenderSettings::default() }
    }

    /// The photograph to compare with.
    pub(super) fn truth(&self) -> Result<Option<Image>, Failure> {
        let read = |path| read_image(path, self.max_pixels);
        self.truth.as_deref().map(read).transpose().map_err(failed)
    }

    /// Reads the scene file, with the views that other files list; the virtual views are those of a list of
    /// `cameras` if it is given.
    pub(super) fn source(&self, cameras: Option<&Path>) -> Result<Source, Failure> {
        let (path, mut spec) = spec(&self.file)?;
        if let Some(cameras) = cameras {
            let cameras = Some(std::path::absolute(cameras).unwrap_or_else(|_| cameras.into()));
            spec.targets = vec![TargetSpec { cameras, ..TargetSpec::default() }];
        }
        let spec = scene::complete(&spec, &path).map_err(failed)?;
        Ok(Source { path, spec })
    }

    /// How the scene is read.
    pub(super) fn options(&self) -> LoadOptions {
        LoadOptions {
            view: self.view.clone(),
            depth_step: self.depth_step,
            keep_cameras: self.keep_cameras,
            max_pixels: self.max_pixels,
            ..LoadOptions::default()
        }
    }

    /// Loads the scene, and prints what was decided on the way.
    pub(super) fn load(
        &self,
        source: &Source,
        unknown: Option<Unknown>,
        nearest: Option<usize>,
    ) -> Result<Scene, Failure> {
        let options = LoadOptions { unknown, nearest, ..self.options() };
        let scene = scene::load(&source.spec, &source.path, &options).map_err(failed)?;
        inputs::notes(&scene);
        Ok(scene)
    }

    /// Refuses scenes whose errors cannot be predicted, and a photograph of one view for several.
    pub(super) fn refuse_what_has_no_prediction(&self, scene: &Scene) -> Result<(), Failure> {
        match &scene.kind {
            Kind::Uncalibrated { .. } => Err(Failure::Input(format!(
                "{}: errors are predicted for views with depth; the cameras of this scene are unknown",
                Quoted(&self.file)
            ))),
            kind if kind.frames() > 1 && self.truth.is_some() => usage(
                "--truth: there is one photograph, but the scene has several virtual views; give it with --view \
                 NAME, which predicts the place of one view",
            ),
            _ => Ok(()),
        }
    }
}

impl Source {
    /// The virtual views that the scene has.
    pub(super) fn frames(&self, arguments: &SceneArguments) -> usize {
        if arguments.view.is_some() { 1 } else { self.spec.frames().clamp(1, scene::MOST_FRAMES) }
    }

    /// The scene file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The photograph of a view, and its pixels that show no part of the scene.
    pub(super) fn photograph(&self, view: &ViewSpec, most: usize) -> Result<(Image, Vec<bool>), Failure> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        scene::photograph(view, folder, most).map_err(failed)
    }

    /// The scene file, and every file that it names.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let mut files = self.spec.files(self.path.parent().unwrap_or(Path::new("")));
        files.push(self.path.clone());
        files
    }
}

/// The name and the content of a scene file, `-` for standard input.
fn spec(path: &Path) -> Result<(PathBuf, SceneSpec), Failure> {
    let parsed = |text: &str, path: PathBuf| match scene::parse(text, &path) {
        Ok(spec) => Ok((path, spec)),
        Err(error) => Err(failed(error)),
    };
    if is_dash(path) {
        let name = "standard input";
        let text = files::text(std::io::stdin().lock(), name).map_err(failed)?;
        return parsed(&text, PathBuf::from("<stdin>"));
    }
    let folder = if path.is_dir() { Some(path) } else { path.parent().filter(|_| is_list(path)) };
    if let Some(folder) = folder {
        let own = folder.join("scene.toml");
        if !(path.is_dir() && own.is_file()) {
            let scene = scene::describe(&[path.to_owned()], None, folder).map_err(failed)?;
            return Ok((folder.join("<scene>"), scene.spec));
        }
        PROGRAM.say_line(&format!("note: the scene of this folder is {}", Quoted(&own)));
        return spec(&own);
    }
    let text = files::read_scene(path).map_err(failed)?;
    parsed(&text, path.to_owned())
}

/// Whether a file lists cameras of which a scene is made.
fn is_list(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "json")
}
