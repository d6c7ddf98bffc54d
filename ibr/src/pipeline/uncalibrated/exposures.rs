//! The exposures of photographs without cameras: ratios of colours at the tracks.

use super::surface::colour_at;
use crate::image::Image;
use crate::pipeline::agreement::Comparison;
use crate::pipeline::{Exposure, without_drift};
use crate::uncalibrated::Point;
use rayon::prelude::*;

/// Factors that give photographs the exposure and the white balance of the first one, except for drift.
pub(super) fn factors(images: &[&Image], tracks: &[Vec<Option<Point>>]) -> Vec<Exposure> {
    let mut gains: Vec<Exposure> = vec![[1.0; 3]];
    for j in 1..images.len() {
        let place = |track: &Vec<Option<Point>>, view: usize| track.get(view).copied().flatten();
        let both = |i| tracks.iter().filter_map(move |track| Some([place(track, i)?, place(track, j)?]));
        let i = (0..j).rev().max_by_key(|i: &usize| both(*i).count()).unwrap_or(0);
        let colours = |[p, q]: [Point; 2]| Some([colour_at::<3>(images[i], &p)?, colour_at(images[j], &q)?]);
        let gain =
            Comparison::of_colours(both(i).filter_map(colours).collect(), [images[i], images[j]]).gain();
        gains.push(std::array::from_fn(|c| gains[i][c] / gain[c]));
    }
    without_drift(&gains)
}

/// Photographs with these factors, `None` where they are 1.
pub(super) fn applied(images: &[&Image], factors: &[Exposure]) -> Vec<Option<Image>> {
    let one = |(image, factors): (&&Image, &Exposure)| {
        let is_other = factors.iter().any(|factor| *factor != 1.0);
        is_other.then(|| {
            let (mut image, channels) = ((*image).clone(), image.channels());
            let values = image.data_mut().iter_mut().enumerate();
            values.for_each(|(k, value)| *value *= factors[k % channels] as f32);
            image
        })
    };
    images.par_iter().zip(factors).map(one).collect()
}
