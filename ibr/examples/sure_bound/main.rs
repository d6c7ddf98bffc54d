//! A sure bound of the error of a virtual view, pixel by pixel, for a rectified rig whose surfaces have a
//! bounded second derivative: by the synthetic scene, with the true view beside it.
//!
//! ```text
//! cargo run --release -p hybank-ibr --example sure_bound
//! cargo run --release -p hybank-ibr --example sure_bound -- 80 0.5 0.01    # limits, see `Limits`
//! ```

#[allow(unreachable_pub)]
mod bound;

use bound::{Limits, bounded};
use hybank_ibr::camera::{Camera, CameraError};
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::propagate::RectifiedView;
use hybank_ibr::synthetic::{SyntheticScene, rig_camera, rig_disparity};

const SIZE: (usize, usize) = (240, 180);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given: Vec<f64> = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let limits = match given[..] {
        [curvature, intensity, disparity] => Limits { curvature, intensity, disparity },
        _ => Limits { curvature: 60.0, intensity: 0.5, disparity: 0.01 },
    };
    let (shots, (truth, _)) = ([shot(0.0)?, shot(1.0)?], shot(0.5)?);
    let view = |k: usize| RectifiedView { image: &shots[k].0, map: &shots[k].1, camera: k as f64 };
    // The photographs as they are: a factor for their colours would be an error of intensities.
    let settings = RenderSettings { keep_exposure: true, ..RenderSettings::default() };
    let (rendering, bounds) = bounded(&[view(0), view(1)], 0.5, &settings, &limits)?;
    let pairs = rendering.image.data().iter().zip(truth.data()).map(|(a, b)| (a - b).abs());
    let errors: Vec<f32> = pairs.collect();
    let of_pixels = errors.chunks(rendering.image.channels()).map(|e| e.iter().copied().fold(0.0, f32::max));
    let within = of_pixels.zip(&bounds).filter(|(error, bound)| error <= *bound).count();
    let mean = |values: &[f32]| values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64;
    println!("{limits:?}");
    println!("mean absolute error {:.2} grey levels", mean(&errors));
    println!("mean sure bound     {:.2} grey levels", mean(&bounds));
    println!("{:.2} % of the pixels are within it", 100.0 * within as f64 / bounds.len() as f64);
    Ok(())
}

fn shot(position: f64) -> Result<(Image, DepthMap), CameraError> {
    let (image, depth) =
        SyntheticScene::default().view(&Camera::metric(rig_camera(position, SIZE), false)?, SIZE);
    Ok((image.quantised(), rig_disparity(&depth, SIZE.0)))
}
