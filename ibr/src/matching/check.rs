//! What two photographs say of each other: a depth is kept if the photograph in which it was looked for has
//! the same depth there.

use super::Sweep;
use crate::image::Image;
use crate::propagate::Viewpoint;

/// Difference of two depths of one point, in steps.
const TOLERANCE: f32 = 1.0;

/// Makes unknown what no other photograph confirms.
pub(super) fn confirmed<P: Viewpoint>(sweeps: &[Sweep<'_, P>], found: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let one = |sweep: &Sweep<'_, P>, values: &Vec<f32>| {
        let maps: Vec<_> = sweep.others.iter().map(|other| (other, sweep.map_to(&sweeps[*other]))).collect();
        let is_confirmed = |p: usize, value: f32| {
            let at = [p % sweep.grey.width(), p / sweep.grey.width()].map(|v| v as f64);
            maps.iter().any(|(other, map)| {
                let (place, there) = map(at, value);
                pixel(&sweeps[**other].grey, place)
                    .is_some_and(|q| (found[**other][q] - there).abs() <= TOLERANCE * sweeps[**other].unit)
            })
        };
        let kept = |(p, value): (usize, &f32)| if is_confirmed(p, *value) { *value } else { f32::NAN };
        values.iter().enumerate().map(kept).collect()
    };
    sweeps.iter().zip(found).map(|(sweep, values)| one(sweep, values)).collect()
}

/// The pixel at a position.
fn pixel(image: &Image, [x, y]: [f64; 2]) -> Option<usize> {
    let (width, height) = image.size();
    let is_inside = x > -0.5 && y > -0.5 && x < width as f64 - 0.5 && y < height as f64 - 0.5;
    is_inside.then(|| (y + 0.5) as usize * width + (x + 0.5) as usize)
}
