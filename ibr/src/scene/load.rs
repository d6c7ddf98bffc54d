//! Reading a scene: determine its kind, read its files in parallel, make maps dense.

mod calibrated;
mod complete;
mod goals;
mod models;
mod rectified;
mod uncalibrated;

pub use complete::complete;
pub use goals::MOST_FRAMES;

use super::spec::{SceneSpec, ViewSpec};
use super::{Scene, SceneError};
use crate::depth::{DepthMap, Measure, fill_unknown};
use crate::image::{Image, MOST_PIXELS, read_image_within, read_map_within};
use crate::partial::{Densify, densify};
use goals::Goal;
use models::Models;
use std::path::{Path, PathBuf};

/// How a scene is read.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadOptions {
    /// Leave this view out and render it.
    pub view: Option<String>,
    /// Use only every K-th value of full maps.
    pub depth_step: usize,
    /// How coarse maps are made dense.
    pub densify: Densify,
    /// Whether unknown depths are filled from the farther neighbour in their row.
    pub fill: bool,
    /// The most pixels of the virtual view, and of each image and map.
    pub max_pixels: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { view: None, depth_step: 1, densify: Densify::default(), fill: true, max_pixels: MOST_PIXELS }
    }
}

/// Parses the text of a scene file; `path` appears in messages.
///
/// # Errors
/// [`SceneError::Parse`] with line, column and the keys known there.
pub fn parse(text: &str, path: &Path) -> Result<SceneSpec, SceneError> {
    toml::from_str(text).map_err(|e| {
        let hint = nearest_key(e.message()).map_or(String::new(), |key| format!("\ndid you mean `{key}`?"));
        SceneError::Parse { path: path.into(), reason: e.to_string().trim_end().to_string() + &hint }
    })
}

/// The known key most similar to the unknown key that the parser's message quotes first, if any is similar
/// enough.
fn nearest_key(message: &str) -> Option<&str> {
    let mut quoted = message.strip_prefix("unknown field ")?.split('`').skip(1).step_by(2);
    let unknown = quoted.next()?;
    let likeness = |key: &str| strsim::jaro_winkler(unknown, key);
    quoted.filter(|key| likeness(key) > 0.7).max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
}

/// Reads all files of a scene. Relative paths start in the folder of the scene file `path`.
///
/// # Errors
/// [`SceneError`], naming file, view and numbers.
pub fn load(spec: &SceneSpec, path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let spec = &complete(spec, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    Loader { spec, path, folder, options, models: Models::default() }.load()
}

struct Loader<'a> {
    spec: &'a SceneSpec,
    path: &'a Path,
    folder: &'a Path,
    options: &'a LoadOptions,
    models: Models,
}

type Loaded<T> = Result<T, SceneError>;

impl Loader<'_> {
    fn load(&self) -> Loaded<Scene> {
        self.different_names()?;
        let left_out = self.left_out()?;
        let views: Vec<&ViewSpec> =
            self.spec.view.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, v)| v).collect();
        if views.is_empty() {
            return Err(self.incomplete("there is no view to render from; add [[view]] tables"));
        }
        let goals = self.goals()?;
        let left_out = left_out.map(|i| &self.spec.view[i]);
        let (kind, filled) = if views.iter().any(|v| v.position.is_some()) {
            self.rectified(&views, left_out, &goals)?
        } else if views.iter().any(|v| v.camera.is_some() || self.source_of(v).is_some()) {
            self.calibrated(&views, left_out, &goals)?
        } else {
            (self.uncalibrated(&views, left_out, &goals)?, 0)
        };
        Ok(Scene { kind, offset: self.offset(&goals)?, filled })
    }

    fn incomplete(&self, reason: impl Into<String>) -> SceneError {
        SceneError::Incomplete { path: self.path.into(), reason: reason.into() }
    }

    /// Refuses two views with the same name; images without a name may be used twice.
    fn different_names(&self) -> Loaded<()> {
        let mut seen = std::collections::BTreeSet::new();
        match self.spec.view.iter().filter_map(|v| v.name.as_ref()).find(|name| !seen.insert(*name)) {
            Some(name) => {
                Err(self.incomplete(format!("two views are named {name:?}; give each its own name")))
            }
            None => Ok(()),
        }
    }

    /// Refuses keys of another kind of scene instead of ignoring them.
    fn no_other_kind(&self, view: &ViewSpec, kind: &str, others: &[(&str, bool)]) -> Loaded<()> {
        match others.iter().find(|(_, given)| *given) {
            Some((key, _)) => Err(self.incomplete(format!(
                "view {:?} has `{key}`, which has no meaning in a {kind} scene; remove it, or give all views the keys of one kind",
                view.label()
            ))),
            None => Ok(()),
        }
    }

    fn finite(&self, value: f64, whose: &str) -> Loaded<f64> {
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.incomplete(format!("{whose}: position = {value}: it must be a finite number")))
    }

    /// Index of the view that is left out.
    fn left_out(&self) -> Loaded<Option<usize>> {
        let Some(name) = &self.options.view else { return Ok(None) };
        let found = self.spec.view.iter().position(|v| v.label() == *name);
        found.map(Some).ok_or_else(|| SceneError::NoSuchView {
            path: self.path.into(),
            name: name.clone(),
            known: self.spec.view.iter().map(ViewSpec::label).collect::<Vec<_>>().join(", "),
        })
    }

    fn file(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }

    fn image(&self, path: &Path) -> Loaded<Image> {
        Ok(read_image_within(&self.file(path), self.options.max_pixels)?)
    }

    fn need<T>(&self, value: Option<T>, view: &ViewSpec, key: &str, kind: &str) -> Loaded<T> {
        let reason =
            || format!("view {:?} has no `{key}`, which every view of a {kind} scene needs", view.label());
        value.ok_or_else(|| self.incomplete(reason()))
    }

    /// Image and dense map of a view, and the number of unknown values that were filled.
    fn image_with_map(
        &self,
        view: &ViewSpec,
        map: &Path,
        scale: f64,
        measure: Measure,
    ) -> Loaded<(Image, DepthMap, usize)> {
        let path = self.file(map);
        let image = self.image(&view.image)?;
        let (width, height, stored) = read_map_within(&path, self.options.max_pixels)?;
        let depth_error = |source| SceneError::Depth { view: view.label(), path: path.clone(), source };
        let map = DepthMap::new((width, height), stored, scale, measure).map_err(depth_error)?;
        let map = match view.disparity_offset {
            Some(offset) => map.with_offset(offset).map_err(depth_error)?,
            None => map,
        };
        let given = view.step.unwrap_or(1);
        map.fits(image.size(), given).map_err(depth_error)?;
        let step = if given == 1 { self.options.depth_step } else { given };
        if step == 1 {
            let mut map = map;
            let filled = if self.options.fill { fill_unknown(&mut map) } else { 0 };
            return Ok((image, map, filled));
        }
        let coarse = if given == 1 { map.decimated(step).map_err(depth_error)? } else { map };
        let dense = densify(&coarse, step, &image, &self.options.densify)
            .map_err(|source| SceneError::Partial { view: view.label(), path: path.clone(), source })?;
        Ok((image, dense, coarse.unknown()))
    }
}

/// The values, or the first error in the order of the views, so that every run reports the same error.
fn in_order<T>(results: Vec<Loaded<T>>) -> Loaded<Vec<T>> {
    results.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::uncalibrated::Target;
    use crate::scene::Kind;
    use crate::uncalibrated::Point;

    fn scene(text: &str) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
        write("a.pgm", b"P5 4 2 255\n\x01\x02\x03\x04\x05\x06\x07\x08");
        write("small.pgm", b"P5 2 1 255\n\x01\x02");
        write("d.pgm", b"P5 4 2 255\n\x04\x04\x04\x00\x04\x04\x04\x04");
        write("zero.pgm", b"P5 4 2 255\n\0\0\0\0\0\0\0\0");
        write("t.txt", b"1 2 3 4 5 6\n1 2 - 5 6\n");
        let path = dir.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    fn read(text: &str, options: &LoadOptions) -> Result<Scene, String> {
        let (_dir, path) = scene(text);
        let spec = parse(text, &path).map_err(|e| e.to_string())?;
        load(&spec, &path, options).map_err(|e| e.to_string())
    }

    const RIG: &str = r#"
        [[view]]
        name = "left"
        image = "a.pgm"
        position = 0.0
        disparity = "d.pgm"
        disparity_scale = 4.0
        [[view]]
        name = "right"
        image = "a.pgm"
        position = 1.0
        disparity = "d.pgm"
        [virtual]
        position = 0.5
    "#;

    #[test]
    fn a_rectified_rig_is_read() {
        let read_rig = read(RIG, &LoadOptions::default()).unwrap();
        let Kind::Rectified { views, positions } = read_rig.kind else { panic!("{read_rig:?}") };
        assert_eq!((views.len(), &positions[..], read_rig.filled), (2, &[0.5][..], 2));
        assert_eq!((views[0].disparity.data()[3], views[1].disparity.data()[3]), (1.0, 4.0));
        let without = LoadOptions { view: Some("right".into()), fill: false, ..LoadOptions::default() };
        let Kind::Rectified { views, positions } = read(RIG, &without).unwrap().kind else { panic!() };
        assert_eq!((views.len(), &positions[..]), (1, &[1.0][..]));
        assert!(views[0].disparity.data()[3].is_nan());
    }

    #[test]
    fn paths_have_both_ends() {
        let defaults = LoadOptions::default();
        let path = RIG.to_string() + "to_position = 1.0\nframes = 3\n";
        let Kind::Rectified { positions, .. } = read(&path, &defaults).unwrap().kind else { panic!() };
        assert_eq!(positions, [0.5, 0.75, 1.0]);
        for (keys, words) in [
            ("frames = 3", "no end of the path"),
            ("to_position = 1.0", "how many views"),
            ("to_position = 1.0\nframes = 1", "2 to 9999"),
            ("to_position = nan\nframes = 3", "finite"),
            ("to_colmap_image = \"a\"\nframes = 3", "`to_position`"),
        ] {
            let message = read(&(RIG.to_string() + keys), &defaults).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
        let row = |x: f64| format!("[[5.0, 0.0, 1.5, {x:?}], [0.0, 5.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]");
        let text = format!(
            "[[view]]\nimage = \"a.pgm\"\ncamera = {}\ndepth = \"d.pgm\"\n[virtual]\ncamera = {}\nto_camera = {}\nframes = 5\n",
            row(0.0),
            row(-5.0),
            row(-10.0)
        );
        let Kind::Calibrated { cameras, .. } = read(&text, &defaults).unwrap().kind else { panic!() };
        let columns: Vec<f64> = cameras.iter().map(|c| c.centre().x).collect();
        assert!(
            columns.iter().zip([1.0, 1.25, 1.5, 1.75, 2.0]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{columns:?}"
        );
    }

    #[test]
    fn coarse_maps_are_made_dense() {
        let coarse = LoadOptions { depth_step: 2, ..LoadOptions::default() };
        let Kind::Rectified { views, .. } = read(RIG, &coarse).unwrap().kind else { panic!() };
        assert_eq!(views[0].disparity.size(), (4, 2));
        let text = RIG.replace("disparity = \"d.pgm\"", "disparity = \"small.pgm\"\nstep = 2");
        let Kind::Rectified { views, .. } = read(&text, &LoadOptions::default()).unwrap().kind else {
            panic!()
        };
        assert_eq!(views[1].disparity.data()[0], 1.0);
    }

    #[test]
    fn tracks_and_columns() {
        let text = r#"
            matches = "t.txt"
            [[view]]
            image = "a.pgm"
            [[view]]
            image = "small.pgm"
            [virtual]
            from_tracks = 2
        "#;
        let Kind::Uncalibrated { tracks, targets, size, .. } =
            read(text, &LoadOptions::default()).unwrap().kind
        else {
            panic!()
        };
        assert_eq!(tracks[0], [Some(Point::new(1.0, 2.0)), Some(Point::new(5.0, 6.0))]);
        assert_eq!(targets, [Target::Tracks(vec![Some(Point::new(3.0, 4.0)), None])]);
        assert_eq!(size, (4, 2));
        let outside = text.replace("from_tracks = 2", "from_tracks = 7");
        let message = read(&outside, &LoadOptions::default()).unwrap_err();
        assert!(message.contains("3 columns, numbered from 1"), "{message}");
        // A view without a column takes none that another view names, and no column may be named twice.
        let named = text.replace("image = \"small.pgm\"", "image = \"small.pgm\"\ncolumn = 1");
        let Kind::Uncalibrated { tracks, .. } = read(&named, &LoadOptions::default()).unwrap().kind else {
            panic!()
        };
        assert_eq!(tracks[0], [Some(Point::new(5.0, 6.0)), Some(Point::new(1.0, 2.0))]);
        for twice in
            [named.replace("column = 1", "column = 2"), named.replace("from_tracks = 2", "from_tracks = 1")]
        {
            let message = read(&twice, &LoadOptions::default()).unwrap_err();
            assert!(message.contains("a column of its own"), "{message}");
        }
    }

    #[test]
    fn cameras_and_sizes() {
        let camera = "camera = [[5.0, 0.0, 1.5, 0.0], [0.0, 5.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]";
        let text = format!(
            "[[view]]\nimage = \"a.pgm\"\n{camera}\ndepth = \"d.pgm\"\n[virtual]\n{camera}\nsize = [6, 3]\n"
        );
        let Kind::Calibrated { views, size, .. } = read(&text, &LoadOptions::default()).unwrap().kind else {
            panic!()
        };
        assert_eq!((views[0].depth.data()[0], size), (4.0, (6, 3)));
        let singular = text.replace("[0.0, 0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0, 1.0]");
        let message = read(&singular, &LoadOptions::default()).unwrap_err();
        assert!(message.contains("view \"a.pgm\"") && message.contains("singular"), "{message}");
        let sized = |size: &str, options: &LoadOptions| read(&text.replace("[6, 3]", size), options);
        let defaults = LoadOptions::default();
        assert!(sized("[0, 3]", &defaults).unwrap_err().contains("at least one pixel"));
        let message = sized("[8192, 8192]", &defaults).unwrap_err();
        assert!(message.contains("8192 x 8192") && message.contains("--max-pixels"), "{message}");
        let message = sized("[6, 3]", &LoadOptions { max_pixels: 17, ..defaults.clone() }).unwrap_err();
        assert!(message.contains("limit of 17"), "{message}");
        // More than any address space.
        let boundless = LoadOptions { max_pixels: usize::MAX, ..defaults };
        let message = sized("[4294967296, 2147483648]", &boundless).unwrap_err();
        assert!(message.contains("GB of memory"), "{message}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let fails = |text: &str, words: &[&str]| {
            let message = read(text, &LoadOptions::default()).unwrap_err();
            assert!(words.iter().all(|w| message.contains(w)), "{message}");
        };
        fails(&RIG.replace("disparity_scale", "disparity_scal"), &["scene.toml", "disparity_scal", "line"]);
        fails(&RIG.replacen("disparity = \"d.pgm\"", "", 1), &["\"left\"", "`disparity`"]);
        fails(&RIG.replacen("a.pgm", "missing.pgm", 1), &["missing.pgm"]);
        fails(&RIG.replacen("\"a.pgm\"", "\"small.pgm\"", 1), &["d.pgm", "4 x 2", "2 x 1"]);
        fails(&RIG.replace("d.pgm", "zero.pgm"), &["zero.pgm", "none of the 8 values"]);
        fails(&RIG.replace("4.0", "0.0"), &["the scale is 0"]);
        fails(&RIG.replace("[virtual]\n        position = 0.5", ""), &["[virtual] needs a `position`"]);
        fails("[[view]]\nimage = \"a.pgm\"\n[[view]]\nimage = \"a.pgm\"\n", &["`matches`"]);
        fails("", &["[[view]]"]);
        fails(&RIG.replace("disparity_scale", "disparty_scale"), &["did you mean `disparity_scale`?"]);
        fails(&RIG.replace("\"right\"", "\"left\""), &["two views are named \"left\""]);
        fails(&RIG.replace("position = 1.0", "position = 1.0\ndepth = \"d.pgm\""), &["\"right\"", "`depth`"]);
        fails(&RIG.replace("position = 1.0", "position = nan"), &["\"right\"", "position = NaN"]);
        fails(&RIG.replace("position = 0.5", "position = inf"), &["virtual view", "position = inf"]);
        let options = LoadOptions { view: Some("middle".into()), ..LoadOptions::default() };
        assert!(read(RIG, &options).unwrap_err().contains("the views are left, right"));
    }
}
