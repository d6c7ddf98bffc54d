//! Grey photographs beside coloured ones: their luminance, with the colours of the others.

use super::outliers::Parallax;
use crate::depth::FAR;
use crate::image::Image;
use crate::propagate::{View, Viewpoint};
use rayon::prelude::*;

/// Below this mean value a pixel has no colour to take.
const DARK: f32 = 4.0;

/// The grey photographs of views in colour, `None` for coloured ones and where all are grey. A pixel has the
/// ratio of red, green and blue that the first of the coloured views shows at the point of its depth, and
/// stays grey where none shows that point.
pub fn coloured<P: Viewpoint>(views: &[View<'_, P>]) -> Vec<Option<Image>> {
    let coloured: Vec<usize> = (0..views.len()).filter(|i| views[*i].image.channels() == 3).collect();
    let is_grey = |view: &View<'_, P>| view.image.channels() != 3 && !coloured.is_empty();
    let planes: Vec<Option<Parallax>> =
        views.iter().map(|view| (!is_grey(view)).then(|| Parallax::of(view.map, 0.0))).collect();
    let in_colour = |view: &View<'_, P>| {
        let (width, measure) = (view.map.width(), view.map.measure());
        let maps: Vec<_> = coloured.iter().map(|other| view.camera.map_to(&views[*other].camera)).collect();
        let colour = |p: usize| {
            let depth = view.map.data()[p];
            let shown = coloured.iter().zip(&maps).find_map(|(other, map)| {
                let (u, v, d) = map((p % width) as f64, (p / width) as f64, f64::from(depth.min(FAR)));
                let pixel = planes[*other].as_ref()?.showing([u, v], measure.parallax(d as f32))?;
                Some(views[*other].image.pixel::<3>(pixel))
            });
            let [grey] = view.image.pixel::<1>(p);
            let mean = |colour: &[f32; 3]| colour.iter().sum::<f32>() / 3.0;
            match shown.filter(|colour| mean(colour) >= DARK) {
                Some(colour) => colour.map(|c| c * grey / mean(&colour)),
                None => [grey; 3],
            }
        };
        let values: Vec<[f32; 3]> = (0..view.map.data().len()).into_par_iter().map(colour).collect();
        Image::from_values(view.image.size(), 3, values.into_flattened())
    };
    views.iter().map(|view| is_grey(view).then(|| in_colour(view))).collect()
}
