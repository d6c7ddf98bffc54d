//! A scene file as written.

use super::unknown::Unknown;
use crate::camera::colmap::model_files;
use hybank_core::messages::Quoted;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// A scene file.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// The views.
    #[serde(default)]
    pub view: Vec<ViewSpec>,
    /// The virtual views, `[virtual]` or several `[[virtual]]`; none is needed if one of the views is left
    /// out and rendered.
    #[serde(rename = "virtual", default, deserialize_with = "one_or_many", serialize_with = "as_written")]
    pub targets: Vec<TargetSpec>,
    /// File of tracks over the views (uncalibrated scenes).
    pub matches: Option<PathBuf>,
    /// Folder of a COLMAP model that holds the cameras of all views.
    pub colmap: Option<PathBuf>,
    /// File of cameras of neural rendering (`transforms.json`); without `[[view]]` tables its frames with
    /// depth are the views.
    pub transforms: Option<PathBuf>,
    /// The `depth` of views that do not say it themselves.
    pub depth: Option<PathBuf>,
    /// Whether the world frame of the cameras is left-handed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirrored: bool,
    /// What unknown depths are taken for.
    pub unknown: Option<Unknown>,
    /// Stored value / scale = disparity, in views that do not say it themselves.
    pub disparity_scale: Option<f64>,
    /// Stored value / scale = depth, in views that do not say it themselves.
    pub depth_scale: Option<f64>,
}

/// A view.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewSpec {
    /// Name; defaults to the image file's.
    pub name: Option<String>,
    /// Image file.
    pub image: PathBuf,
    /// Position along the baseline of a rectified rig, in baselines.
    pub position: Option<f64>,
    /// Disparity map of a rectified rig, or `matched`: it is found from the photographs.
    pub disparity: Option<PathBuf>,
    /// Stored value / scale = disparity in pixels for a baseline of one.
    pub disparity_scale: Option<f64>,
    /// Added to every disparity, it gives a number in inverse proportion to depth: the difference of the
    /// principal points in pixels (Middlebury's `doffs`).
    pub disparity_offset: Option<f64>,
    /// 3 x 4 camera matrix, in pixels.
    pub camera: Option<[[f64; 4]; 3]>,
    /// Depth map of a general rig, or a mesh (`.ply`), or `matched` or `points`: it is found from the
    /// photographs, or is that of the points of the COLMAP model.
    pub depth: Option<PathBuf>,
    /// Image that is black where the photograph shows what is no part of the scene.
    pub mask: Option<PathBuf>,
    /// Stored value / scale = depth.
    pub depth_scale: Option<f64>,
    /// Folder of a COLMAP model that holds the camera of this view.
    pub colmap: Option<PathBuf>,
    /// Pixels from one value of the map to the next, in both directions.
    pub step: Option<usize>,
    /// Column of this view in the tracks, from 1.
    pub column: Option<usize>,
}

/// The virtual view.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetSpec {
    /// Position along the baseline of a rectified rig, in baselines.
    pub position: Option<f64>,
    /// 3 x 4 camera matrix, in pixels.
    pub camera: Option<[[f64; 4]; 3]>,
    /// Cameras of other views than those of the scene: a camera path of nerfstudio, a transforms file or the
    /// folder of a COLMAP model. All of them are rendered, or the one of `camera_of`.
    pub cameras: Option<PathBuf>,
    /// Name of the image of the COLMAP model or transforms file whose camera is used.
    pub camera_of: Option<String>,
    /// Position at the end of a path along the baseline.
    pub to_position: Option<f64>,
    /// Camera at the end of a path.
    pub to_camera: Option<[[f64; 4]; 3]>,
    /// Image of the COLMAP model or transforms file with the camera at the end of a path.
    pub to_camera_of: Option<String>,
    /// Views on the path, both ends included.
    pub frames: Option<usize>,
    /// Width and height in pixels.
    pub size: Option<[usize; 2]>,
    /// Column of the tracks, from 1, that holds the points in the virtual view.
    pub from_tracks: Option<usize>,
    /// Position between the first two views, 0 to 1.
    pub between: Option<f64>,
    /// Position between the first two views at the end of a path.
    pub to_between: Option<f64>,
    /// Added to every column, in pixels.
    pub offset: Option<f64>,
}

/// Where a map comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MapSource<'a> {
    File(&'a Path),
    /// A mesh, or a cloud of points.
    Mesh(&'a Path),
    /// The points of the COLMAP model that has the cameras.
    Points,
    /// The photographs beside this one.
    Matched,
}

impl<'a> MapSource<'a> {
    /// What `depth` or `disparity` says: one of two words, or a file.
    pub(super) fn of(map: &'a Path) -> Self {
        match map.to_str() {
            Some("points") => Self::Points,
            Some("matched") => Self::Matched,
            _ if map.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ply")) => Self::Mesh(map),
            _ => Self::File(map),
        }
    }
}

impl SceneSpec {
    /// Every file that the scene names, and all files of its models, read or not; relative paths start in
    /// `folder`.
    pub fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let images = self.view.iter().map(|view| &view.image);
        let maps = self.view.iter().flat_map(|view| [&view.disparity, &view.depth, &view.mask]);
        let maps = maps.chain([&self.depth]).flatten();
        let maps = maps.filter(|map| matches!(MapSource::of(map), MapSource::File(_) | MapSource::Mesh(_)));
        let cameras = self.targets.iter().map(|target| &target.cameras);
        let lists = [&self.matches, &self.transforms].into_iter().chain(cameras.clone()).flatten();
        let models = self.view.iter().map(|view| &view.colmap).chain([&self.colmap]).chain(cameras).flatten();
        let models = models.flat_map(|model| model_files().map(|file| model.join(file)));
        let files = images.chain(maps).chain(lists).cloned().chain(models);
        files.map(|file| folder.join(file)).collect()
    }

    /// The virtual views of all tables.
    pub(crate) fn frames(&self) -> usize {
        self.targets.iter().map(|table| table.frames.unwrap_or(1)).fold(0, usize::saturating_add)
    }
}

/// The kinds of scenes, as messages call them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SceneKind {
    Rectified,
    Calibrated,
    MatchesOnly,
}

impl fmt::Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rectified => "rectified",
            Self::Calibrated => "calibrated",
            Self::MatchesOnly => "matches-only",
        })
    }
}

impl SceneKind {
    const WITH_DEPTH: [Self; 2] = [Self::Rectified, Self::Calibrated];

    /// Keys that not all kinds of scenes have, whichever table they are in, with the kinds that have them.
    pub(super) const KEYS: [(&[Self], &[&str]); 4] = [
        (&Self::WITH_DEPTH, &["unknown", "mask", "step"]),
        (
            &[Self::Rectified],
            &["disparity", "disparity_scale", "disparity_offset", "position", "to_position"],
        ),
        (
            &[Self::Calibrated],
            &[
                "transforms",
                "mirrored",
                "camera",
                "cameras",
                "camera_of",
                "to_camera",
                "to_camera_of",
                "depth",
                "depth_scale",
                "colmap",
            ],
        ),
        (&[Self::MatchesOnly], &["matches", "column", "from_tracks", "between", "to_between"]),
    ];

    /// Whether a scene of this kind may have a key.
    pub(super) fn has(self, key: &str) -> bool {
        let of_others = |(kinds, keys): &(&[Self], &[&str])| keys.contains(&key) && !kinds.contains(&self);
        !Self::KEYS.iter().any(of_others)
    }
}

impl TargetSpec {
    /// Keys of which a virtual view has one at most.
    pub(super) const EITHER: [[&'static str; 2]; 4] = [
        ["camera", "cameras"],
        ["camera", "camera_of"],
        ["to_camera", "to_camera_of"],
        ["from_tracks", "between"],
    ];

    /// Whether the end of a path is given.
    pub(super) fn has_end(&self) -> bool {
        let cameras = self.to_camera.is_some() || self.to_camera_of.is_some();
        self.to_position.is_some() || self.to_between.is_some() || cameras
    }
}

impl ViewSpec {
    /// Stored numbers per unit of depth in a map with whole numbers, if nothing else is said: thousandths,
    /// as nerfstudio writes them.
    pub(super) fn usual_scale(map: &Path) -> Option<f64> {
        map.extension().is_some_and(|ending| ending == "png").then_some(1000.0)
    }

    /// Whether the numbers of the map are stored in a file.
    pub(super) fn is_stored(&self) -> bool {
        let map = self.depth.as_deref().or(self.disparity.as_deref());
        map.is_none_or(|map| matches!(MapSource::of(map), MapSource::File(_)))
    }

    /// The name, or the image file's.
    pub fn label(&self) -> String {
        self.name.clone().unwrap_or_else(|| self.image.display().to_string())
    }

    /// The view in messages.
    pub(super) fn named(&self) -> String {
        format!("view \"{}\"", Quoted(self.label()))
    }
}

/// One table as `[virtual]`, and several as `[[virtual]]`.
fn as_written<S: Serializer>(targets: &[TargetSpec], serializer: S) -> Result<S::Ok, S::Error> {
    match targets {
        [one] => one.serialize(serializer),
        many => many.serialize(serializer),
    }
}

/// A table, or a list of tables.
fn one_or_many<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<TargetSpec>, D::Error> {
    struct Tables;

    impl<'de> Visitor<'de> for Tables {
        type Value = Vec<TargetSpec>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("a table [virtual], or several [[virtual]]")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            Ok(vec![TargetSpec::deserialize(MapAccessDeserializer::new(map))?])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(seq))
        }
    }

    deserializer.deserialize_any(Tables)
}
