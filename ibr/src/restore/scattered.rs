//! Scattered depths of several views: which of them are wrong, and what the views show of each other.

use super::outliers::Known;
use super::surface::{from_scattered, nearest};
use crate::depth::DepthMap;
use crate::propagate::{View, Viewpoint};
use rayon::prelude::*;

/// Radius of the ring on which a sample is compared with others, in mean distances of samples.
const RING: f64 = 2.0;

/// The maps of views made dense where their values are scattered, `None` where they are not.
///
/// Every pixel takes the value of its nearest sample at first. By these rough maps the views vote on the
/// samples. What is left, with those samples of the other views that a view shows, gives its surfaces.
pub(crate) fn dense<P: Viewpoint>(views: &[View<'_, P>]) -> Vec<Option<DepthMap>> {
    let is_scattered: Vec<bool> = views.par_iter().map(|view| view.map.is_scattered()).collect();
    if !is_scattered.contains(&true) {
        return vec![None; views.len()];
    }
    let rough: Vec<Option<DepthMap>> =
        views.par_iter().zip(&is_scattered).map(|(view, is)| is.then(|| rough(view))).collect();
    let maps = views.iter().zip(&rough).map(|(view, rough)| rough.as_ref().unwrap_or(view.map));
    let shown: Vec<View<'_, P>> = views.iter().zip(maps).map(|(view, map)| View { map, ..*view }).collect();
    let known = Known::of(&shown);
    let samples: Vec<DepthMap> = (0..views.len())
        .into_par_iter()
        .map(|i| if is_scattered[i] { sound(&known, views[i].map, i) } else { views[i].map.clone() })
        .collect();
    let surface = |i: usize| {
        is_scattered[i].then(|| from_scattered(&shared(&known, &shown, &samples, i), views[i].image))
    };
    (0..views.len()).into_par_iter().map(surface).collect()
}

/// The map with the value of the nearest sample at each pixel.
fn rough<P>(view: &View<'_, P>) -> DepthMap {
    let (map, (found, _)) = (view.map, nearest(view.map.data(), view.image));
    map.with_values(map.size(), found.iter().map(|q| map.data()[*q as usize]).collect())
}

/// The samples of a map without those that are wrong.
fn sound<P: Viewpoint>(known: &Known<'_, P>, map: &DepthMap, index: usize) -> DepthMap {
    let (votes, count) = (known.ballot(index), map.data().len() - map.unknown());
    let ring = (RING * (map.data().len() as f64 / count as f64).sqrt()).ceil() as usize;
    let is_right = |p: usize| !known.is_in_cluster(index, p, ring, &votes);
    let kept = |(p, v): (usize, &f32)| if v.is_nan() || is_right(p) { *v } else { f32::NAN };
    map.with_values(map.size(), map.data().par_iter().enumerate().map(kept).collect())
}

/// The samples of a view, and those of the others that it shows: nothing hides them, and the colours are
/// alike. Of several on one pixel the nearest counts.
fn shared<P: Viewpoint>(
    known: &Known<'_, P>,
    views: &[View<'_, P>],
    samples: &[DepthMap],
    index: usize,
) -> DepthMap {
    let (own, view, plane) = (&samples[index], &views[index], &known.planes[index]);
    let measure = own.measure();
    let mut data = own.data().to_vec();
    for other in &known.voters[index] {
        let (map, from) = (views[*other].camera.map_to(&view.camera), &samples[*other]);
        let is_known = |(q, value): &(usize, &f32)| !value.is_nan() && !from.is_guessed(*q);
        for (q, value) in from.data().iter().enumerate().filter(is_known) {
            let (x, y) = ((q % from.width()) as f64, (q / from.width()) as f64);
            let (u, v, depth) = map(x, y, f64::from(*value));
            let Some(p) = view.image.pixel_at(u, v).filter(|p| own.data()[*p].is_nan()) else { continue };
            let there = measure.parallax(depth as f32);
            let is_hidden = plane.values[p] > there && !plane.agree(there, plane.values[p]);
            let is_nearest = data[p].is_nan() || measure.parallax(data[p]) < there;
            if is_nearest && !is_hidden && known.are_alike([index, *other], [p, q]) {
                data[p] = depth as f32;
            }
        }
    }
    own.with_values(own.size(), data)
}
