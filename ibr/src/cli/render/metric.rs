//! What the depths of a virtual view are: millimetres of a rig with a calibration file.

use crate::camera::middlebury::Calibration;
use crate::depth::{DepthMap, Measure};
use crate::pipeline::Rendering;
use crate::scene::{Kind, Scene};

/// The rendering with depths in millimetres, if the scene has the calibration of a rectified rig.
pub(super) fn in_millimetres(mut rendering: Rendering, scene: &Scene) -> Rendering {
    if let Some(calibration) = &scene.calibration
        && let Some(depth) = depth(&rendering.depth, calibration)
    {
        rendering.depth = depth;
    }
    rendering
}

/// Depths f B / (d + offset) from disparities d for a baseline of one; `None` if all are unknown.
fn depth(map: &DepthMap, calibration: &Calibration) -> Option<DepthMap> {
    let Calibration { focal, offset, baseline, .. } = calibration;
    let of = |d: &f32| (focal * baseline / (f64::from(*d) + offset)) as f32;
    DepthMap::new(map.size(), map.data().iter().map(of).collect(), 1.0, Measure::Depth).ok()
}

/// What the numbers in the file of `--depth` are, if one is written.
pub(super) fn depths(scene: &Scene, written: bool) -> Option<String> {
    let text = match (&scene.kind, &scene.calibration) {
        (_, Some(Calibration { focal, baseline, .. })) => {
            format!("in millimetres, from focal length {focal} px and baseline {baseline} mm")
        }
        (Kind::Rectified { .. }, None) => "as disparities in pixels for a baseline of one".into(),
        (Kind::Calibrated { .. }, _) => "in the unit of the cameras".into(),
        (Kind::Uncalibrated { .. }, _) => "as an order without a unit: larger is farther".into(),
    };
    written.then_some(text)
}
