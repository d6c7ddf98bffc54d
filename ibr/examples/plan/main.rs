//! What to spend on, by the synthetic scene: how exact depth must be, how many bits to give intensities and
//! depths, and where to put cameras (thesis 3.7).
//!
//! ```text
//! cargo run --release -p hybank-ibr --example plan
//! ```

// Parts of these are used by `tests/bound` only.
#[allow(dead_code, unreachable_pub, unused_imports)]
mod planner;

use hybank_ibr::analysis::Predictor;
use hybank_ibr::camera::{Camera, CameraError};
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::propagate::RectifiedView;
use hybank_ibr::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use planner::{Candidate, Costs, Placement, RoundingCosts, Wanted, price_of_depth_errors};

const SIZE: (usize, usize) = (160, 120);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut shots = Vec::new();
    for position in [0.0, 0.25, 0.5, 0.75, 1.0] {
        shots.push((position, shot(position)?));
    }
    let view = |k: usize| {
        let (position, (image, disparity)) = &shots[k];
        RectifiedView { image, map: disparity, camera: *position }
    };
    let (views, settings) = ([view(0), view(4)], RenderSettings::default());
    let now = Predictor::new(&views, &settings)?.at(&0.5, views[0].image.size())?;
    println!("estimate with exact depth: {:.2} grey levels", now.totals().estimate);
    for deviation in [0.5, 1.0, 2.0] {
        let price = price_of_depth_errors(&views, 0.5, &settings, &now, deviation)?;
        println!("with errors of {deviation} px: {price:.2}");
    }
    let widest = views[0].map.data().iter().copied().fold(0.0, f32::max);
    let costs = RoundingCosts::new(&views, 0.5, &settings, (255.0, f64::from(widest)), 8)?;
    let best = costs.best(10.0, 1);
    println!("of 10 bits per pixel {:.1} to the intensity, {:.1} to the depth", best.texture, best.depth);
    let candidates = shots.iter().map(|(p, (_, d))| Candidate { position: *p, disparity: d });
    let wanted = shots.iter().map(|(p, (_, d))| Wanted { position: *p, disparity: d });
    let placement =
        Placement::new(&candidates.collect::<Vec<_>>(), &wanted.collect::<Vec<_>>(), Costs::default());
    println!("two cameras of five: places {:?}", placement.searched(2));
    Ok(())
}

fn shot(position: f64) -> Result<(Image, DepthMap), CameraError> {
    let (image, depth) =
        SyntheticScene::default().view(&Camera::metric(rig_camera(position, SIZE), false)?, SIZE);
    let disparity = rig_disparity(&depth, SIZE.0);
    Ok((image, disparity))
}
