//! The nearest of many views.

use super::{View, Viewpoint};
use nalgebra::Vector3;
use std::cmp::Ordering;

/// The centres of views in the order of one coordinate. From a centre on, both directions are searched until
/// the coordinate alone is farther away than the nearest one found: of views along a line or around a scene
/// few are looked at.
pub(crate) struct Nearest {
    places: Vec<Place>,
    /// The place of each view.
    place_of: Vec<usize>,
    axis: usize,
}

/// Views with one centre.
struct Place {
    centre: Vector3<f64>,
    /// The lowest of their numbers.
    first: usize,
    count: usize,
}

impl Nearest {
    pub(crate) fn new<P: Viewpoint>(views: &[View<'_, P>]) -> Self {
        let centres: Vec<Vector3<f64>> = views.iter().map(|view| view.camera.centre()).collect();
        let extent = |axis: usize| {
            let (low, high) = centres
                .iter()
                .map(|centre| centre[axis])
                .fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
            high - low
        };
        let axis = (0..3).max_by(|a, b| extent(*a).total_cmp(&extent(*b))).unwrap_or(0);
        let compared = |a: &usize, b: &usize| {
            let coordinates = (0..3).map(|k| (axis + k) % 3);
            let each = coordinates.map(|k| centres[*a][k].total_cmp(&centres[*b][k]));
            each.fold(Ordering::Equal, Ordering::then)
        };
        let mut order: Vec<usize> = (0..views.len()).collect();
        // The order of equal centres is kept, so the first of them is the lowest.
        order.sort_by(compared);
        let mut nearest = Self { places: Vec::new(), place_of: vec![0; views.len()], axis };
        for view in order {
            match nearest.places.last_mut() {
                Some(place) if place.centre == centres[view] => place.count += 1,
                _ => nearest.places.push(Place { centre: centres[view], first: view, count: 1 }),
            }
            nearest.place_of[view] = nearest.places.len() - 1;
        }
        nearest
    }

    /// Of the views before one, by number, the one that is nearest to it; of several the first.
    pub(crate) fn before(&self, view: usize) -> Option<usize> {
        let is_before = |place: &Place| place.first < view;
        if view == 0 { None } else { self.search(self.place_of[view], is_before).map(|(_, first)| first) }
    }

    /// The view that is nearest to another one; the first at its place.
    pub(crate) fn other(&self, view: usize) -> Option<usize> {
        self.search(self.place_of[view], |other| other.first != view).map(|(_, first)| first)
    }

    /// Distance from a view to the nearest other one, infinite if there is none.
    pub(crate) fn distance(&self, view: usize) -> f64 {
        let place = self.place_of[view];
        if self.places[place].count > 1 {
            return 0.0;
        }
        self.search(place, |other| other.first != view).map_or(f64::INFINITY, |(distance, _)| distance)
    }

    /// Distance and first view of the nearest place that is `wanted`.
    fn search(&self, from: usize, wanted: impl Fn(&Place) -> bool) -> Option<(f64, usize)> {
        let here = self.places[from].centre;
        let mut best: Option<(f64, usize)> = None;
        // Looks at a place and says whether those beyond it are too far away.
        let mut look = |at: usize| {
            let place = &self.places[at];
            let apart = place.centre - here;
            let found = (apart.norm(), place.first);
            let is_nearer =
                |best: (f64, usize)| found.0.total_cmp(&best.0).then(found.1.cmp(&best.1)) == Ordering::Less;
            let is_beyond = best.is_some_and(|(least, _)| apart[self.axis].abs() > least);
            if wanted(place) && best.is_none_or(is_nearer) {
                best = Some(found);
            }
            is_beyond
        };
        let (mut left, mut right) = ((0..=from).rev(), from + 1..self.places.len());
        let (mut is_left_done, mut is_right_done) = (false, false);
        while !(is_left_done && is_right_done) {
            is_left_done = is_left_done || left.next().is_none_or(&mut look);
            is_right_done = is_right_done || right.next().is_none_or(&mut look);
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;
    use nalgebra::{Matrix3, Matrix3x4};

    /// By definition, for cameras in a plane, on a sphere, along a line, several at one place.
    #[test]
    fn equal_to_the_definition() {
        type Placing = fn(f64, f64, f64) -> [f64; 3];
        let image = Image::filled(1, 1, 1, 0.0);
        let map = DepthMap::new((1, 1), vec![1.0], 1.0, Measure::Depth).unwrap();
        let part = |i: usize, k: usize| ((i * k + 7) % 101) as f64 / 101.0;
        let places: [Placing; 4] = [
            |a, b, _| [2.0, a, b],
            |a, b, c| [a - 0.5, b - 0.5, c - 0.5].map(|v| v / ((a - 0.5).hypot(b - 0.5).hypot(c - 0.5))),
            |a, _, _| [a, 3.0 * a, -a],
            |a, b, _| [(4.0 * a).round(), (3.0 * b).round(), 0.0],
        ];
        for place in places {
            let camera = |i: usize| {
                let centre = Vector3::from(place(part(i, 37), part(i, 53), part(i, 89)));
                let mut matrix = Matrix3x4::zeros();
                matrix.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
                matrix.set_column(3, &-centre);
                Camera::metric(matrix, false).unwrap()
            };
            let views: Vec<_> =
                (0..90).map(|i| View { image: &image, map: &map, camera: camera(i) }).collect();
            let nearest = Nearest::new(&views);
            for i in 0..views.len() {
                let distance = |other: &usize| views[*other].camera.distance(&views[i].camera);
                let before = (0..i).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                assert_eq!(nearest.before(i), before, "{i}");
                let others = (0..views.len()).filter(|other| *other != i);
                assert_eq!(nearest.distance(i), others.map(|o| distance(&o)).fold(f64::INFINITY, f64::min));
            }
        }
    }
}
