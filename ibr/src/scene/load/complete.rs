//! Scenes whose views are listed in files of other programs.

use super::Loaded;
use crate::camera::transforms::read_transforms;
use crate::camera::{CameraList, Frame};
use crate::scene::{SceneSpec, TargetSpec, ViewSpec};
use std::path::Path;

/// The scene with what other files add: the views of its `transforms` file if it lists none, and a virtual
/// view for each of the `cameras` of a list. `path` is the scene file.
///
/// # Errors
/// `InputError` of the file.
pub fn complete(spec: &SceneSpec, path: &Path) -> Loaded<SceneSpec> {
    let mut whole = spec.clone();
    let folder = path.parent().unwrap_or(Path::new(""));
    if let (Some(file), true) = (&spec.transforms, spec.view.is_empty()) {
        whole.view = transforms_views(file, folder, spec)?;
    }
    whole.targets.clear();
    for target in &spec.targets {
        whole.targets.extend(of_all_cameras(target, folder)?);
    }
    for view in whole.view.iter_mut().filter(|view| view.position.is_none()) {
        view.depth = view.depth.take().or_else(|| spec.depth.clone());
    }
    for view in whole.view.iter_mut().filter(|view| view.is_stored()) {
        view.disparity_scale = view.disparity_scale.or(spec.disparity_scale);
        view.depth_scale = view.depth_scale.or(spec.depth_scale);
    }
    Ok(whole)
}

/// The virtual view of a table, or one for each camera of its list.
fn of_all_cameras(target: &TargetSpec, folder: &Path) -> Loaded<Vec<TargetSpec>> {
    let Some(file) = target.cameras.as_ref().filter(|_| target.camera_of.is_none()) else {
        return Ok(vec![target.clone()]);
    };
    let list = CameraList::read(&folder.join(file))?;
    let of =
        |frame: &Frame| TargetSpec { camera_of: Some(frame.image.display().to_string()), ..target.clone() };
    Ok(list.frames.iter().map(of).collect())
}

/// The frames of a file whose depth is known: all, if the scene says where depth comes from; else those with
/// a map. Paths in the file are relative to it.
fn transforms_views(file: &Path, folder: &Path, spec: &SceneSpec) -> Loaded<Vec<ViewSpec>> {
    let all = read_transforms(&folder.join(file))?;
    let beside = file.parent().unwrap_or(Path::new(""));
    let view = |frame: &Frame| {
        if frame.depth.is_none() && spec.depth.is_none() {
            return None;
        }
        Some(ViewSpec {
            name: Some(frame.image.display().to_string()),
            image: beside.join(&frame.image),
            depth: frame.depth.as_ref().map(|depth| beside.join(depth)),
            depth_scale: frame.depth.as_ref().and_then(|d| spec.depth_scale.or(ViewSpec::usual_scale(d))),
            mask: frame.mask.as_ref().map(|mask| beside.join(mask)),
            ..ViewSpec::default()
        })
    };
    let views: Vec<ViewSpec> = all.frames.iter().filter_map(view).collect();
    match all.frames.first() {
        Some(frame) if views.is_empty() => Err(all.without_depth(frame)),
        _ => Ok(views),
    }
}
