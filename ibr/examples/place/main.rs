//! Where to put cameras: names the views of a scene from which its virtual views have the least predicted
//! error.
//!
//! ```sh
//! cargo run --release -p hybank-ibr --example place -- scene.toml 4
//! ```
//!
//! The scene lists a view for each place. The error of a set of views is the estimate of `hybank-ibr bound`,
//! with weights that are calibrated once on all views; of several virtual views it is the mean.

mod choice;

use choice::Choice;
use hybank_ibr::analysis::Predictor;
use hybank_ibr::pipeline::{Geometry, RenderError, RenderSettings};
use hybank_ibr::scene::{Kind, LoadOptions, Scene, SourceView, load, parse};
use std::error::Error;
use std::path::Path;

/// Error of a virtual view of which a set of views shows nothing: the range of intensities.
const NOTHING_SHOWN: f64 = 255.0;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, count] = &arguments[..] else {
        return Err("usage: place SCENE.toml K".into());
    };
    let path = Path::new(file);
    let spec = parse(&std::fs::read_to_string(path)?, path)?;
    let options = LoadOptions { nearest: Some(spec.view.len()), ..LoadOptions::default() };
    let scene = load(&spec, path, &options)?;
    let count = count.parse()?;
    match &scene.kind {
        Kind::Rectified { views, positions } => {
            choose(&scene, views, positions, views[0].image.size(), count)
        }
        Kind::Calibrated { views, cameras, size } => choose(&scene, views, cameras, *size, count),
        _ => Err("errors are predicted for views with depth; this scene has no cameras".into()),
    }
}

fn choose<P: Geometry>(
    scene: &Scene,
    sources: &[SourceView<P>],
    cameras: &[P],
    size: (usize, usize),
    count: usize,
) -> Result<(), Box<dyn Error>> {
    let settings = RenderSettings { offset: scene.offset, ..RenderSettings::default() };
    let sources: Vec<_> = sources.iter().map(SourceView::view).collect();
    let predictor = Predictor::new(&sources, &settings)?;
    let views = predictor.views();
    let mean = |chosen: &[usize]| {
        let some: Vec<_> = chosen.iter().map(|number| views[*number]).collect();
        let of_view = |camera: &P| match predictor.estimate_from(&some, camera, size) {
            Err(RenderError::NoOverlap { .. }) => Ok(NOTHING_SHOWN),
            other => other,
        };
        let sum = cameras.iter().map(of_view).sum::<Result<f64, RenderError>>()?;
        Ok::<f64, RenderError>(sum / cameras.len() as f64)
    };
    let all = mean(&(0..views.len()).collect::<Vec<_>>())?;
    let Some(choice) = Choice::least(views.len(), count, mean)? else {
        return Err(format!("the scene has {} views to choose from", views.len()).into());
    };
    let names: Vec<&str> = choice.views.iter().map(|view| scene.names[*view].as_str()).collect();
    println!("chosen    {:.2} grey levels, from {}", choice.error, names.join(", "));
    println!("all       {all:.2} grey levels, from {} views", views.len());
    let how = if choice.is_exhaustive { "all" } else { "by exchanges" };
    println!("searched  {} sets, {how}", choice.tried);
    Ok(())
}
