//! Classification of holes in the plane, and the surface that is continued into each.

use crate::depth::{FAR, NONE, for_holes};
use crate::interpolate::Cover;
use crate::occlusion::DepthTest;

/// For every unknown pixel the known pixel to continue from, [`NONE`] if there is none.
///
/// If the closest known pixel has no counterpart on the other side, the hole is open to the border of the
/// image there, and the closest pixel is continued. Otherwise the hole lies between surfaces, and the
/// closest pixel of the farthest of them is: background that the camera uncovers.
pub(super) fn sources(depth: &[f32], width: usize, test: &DepthTest) -> Vec<u32> {
    let mut sources = vec![NONE; depth.len()];
    for_holes(depth, width, |p, around| {
        let p32 = p as u32;
        let [left, right, above, below] = around.map(|q| p32.abs_diff(q));
        let width = width as u32;
        let distances = [left, right, above / width, below / width];
        let all = around.into_iter().zip(distances).filter(|(q, _)| *q != NONE);
        let closest = |(q, _): (u32, u32)| q;
        let Some(nearest) = all.min_by_key(|(_, distance)| *distance).map(closest) else { return };
        let enclosed = |pair: &[u32]| pair[0] != NONE && pair[1] != NONE;
        if around.chunks_exact(2).any(|pair| pair.contains(&nearest) && !enclosed(pair)) {
            sources[p] = nearest;
            return;
        }
        let is_side = |k: usize| enclosed(&around[k / 2 * 2..k / 2 * 2 + 2]);
        let sides = (0..4).filter(|k| is_side(*k)).map(|k| (around[k], distances[k]));
        let of = |q: u32| f64::from(depth[q as usize]);
        let least = sides.clone().map(|(q, _)| of(q)).fold(f64::MAX, f64::min);
        let most =
            |limit: f64| sides.clone().map(|(q, _)| of(q)).filter(|d| *d < limit).fold(f64::MIN, f64::max);
        let away = |depth: f64| {
            let on_surface = sides.clone().filter(|(q, _)| of(*q) <= depth && !test.hides(of(*q), depth));
            on_surface.map(|(_, distance)| distance).min().unwrap_or(u32::MAX)
        };
        // A sky goes on behind the nearest surface, but seldom behind all that lie between.
        let (farthest, between) = (most(f64::INFINITY), most(f64::from(FAR)));
        let is_sky = farthest >= f64::from(FAR) && test.hides(least, between);
        let far = if is_sky && away(between) <= away(farthest) { between } else { farthest };
        let farthest = sides.filter(|(q, _)| of(*q) <= far && !test.hides(of(*q), far));
        sources[p] = farthest.min_by_key(|(_, distance)| *distance).map_or(NONE, closest);
    });
    sources
}

/// The pixels of cracks, each with the mean of the nearest known pixels around it, weighed by the inverse of
/// their distance; none where nothing is known.
pub(super) fn bridged<const C: usize>(
    depth: &[f32],
    width: usize,
    mask: &[Cover],
    value: impl Fn(usize) -> [f32; C],
) -> Vec<(usize, [f32; C])> {
    let mut bridged = Vec::new();
    for_holes(depth, width, |p, around| {
        if mask[p] != Cover::Crack {
            return;
        }
        let (mut sum, mut total) = ([0.0; C], 0.0);
        for q in around.into_iter().filter(|q| *q != NONE).map(|q| q as usize) {
            let away = q.abs_diff(p);
            let weight = 1.0 / if away < width { away } else { away / width } as f32;
            total += weight;
            sum.iter_mut().zip(value(q)).for_each(|(sum, v)| *sum += weight * v);
        }
        if total > 0.0 {
            bridged.push((p, sum.map(|sum| sum / total)));
        }
    });
    bridged
}

/// A pixel of known depth is seen. A hole is a crack if known pixels of one depth lie on both sides of it
/// in a row or column and no neighbour has another depth, else a disocclusion.
pub(super) fn classify(depth: &[f32], width: usize, test: &DepthTest) -> Vec<Cover> {
    let mut mask = vec![Cover::Seen; depth.len()];
    for_holes(depth, width, |p, around| {
        let enclosed = |a: u32, b: u32| a != NONE && b != NONE;
        let depths = || around.into_iter().filter(|q| *q != NONE).map(|q| f64::from(depth[q as usize]));
        let (near, far) = (depths().fold(f64::MAX, f64::min), depths().fold(f64::MIN, f64::max));
        let both = enclosed(around[0], around[1]) || enclosed(around[2], around[3]);
        let crack = both && !test.hides(near, far);
        mask[p] = if crack { Cover::Crack } else { Cover::Disocclusion };
    });
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    const U: f32 = f32::NAN;

    #[test]
    fn the_farthest_surface_around_is_continued() {
        let depth = [
            U, 1.0, U, //
            2.0, U, 2.0, //
            U, 5.0, U,
        ];
        let test = DepthTest::default();
        let sources = sources(&depth, 3, &test);
        assert_eq!(sources[4], 7);
        assert!(sources[0] == 1 || sources[0] == 3);
        assert_eq!(sources[1], NONE);
        assert_eq!(super::sources(&[U; 4], 2, &test), [NONE; 4]);
    }

    /// Of a slanted surface on both sides the closest pixel is continued, not the one that is a little
    /// deeper.
    #[test]
    fn of_one_surface_the_closest_pixel_is_continued() {
        let test = DepthTest::default();
        let row = [2.0, U, U, U, 4.0, 4.01, 4.02];
        assert_eq!(sources(&row, 7, &test)[1..4], [4; 3]);
        let slanted = [4.0, U, U, U, U, 4.02];
        assert_eq!(sources(&slanted, 6, &test)[1..5], [0, 0, 5, 5]);
    }

    /// A hole beside a pole before ground and sky: the ground below is closer than the sky above.
    #[test]
    fn a_sky_does_not_reach_between_surfaces() {
        let depth = [
            1.0, FAR, FAR, //
            1.0, U, 3.0, //
            1.0, U, 3.0, //
            1.0, U, 3.0, //
            1.0, 9.0, 9.0, //
        ];
        let sources = sources(&depth, 3, &DepthTest::default());
        assert_eq!([sources[7], sources[10]], [13, 13]);
        assert_eq!(sources[4], 1);
        let alone = super::sources(&[1.0, U, U, U, FAR], 5, &DepthTest::default());
        assert_eq!(alone[1..4], [4; 3]);
    }

    /// A hole that is open to the border continues the closest pixel of its row, whatever lies above.
    #[test]
    fn at_the_border_the_closest_pixel_is_continued() {
        let depth = [
            9.0, 9.0, 9.0, 9.0, 9.0, //
            U, U, 2.0, 2.0, 2.0, //
            U, U, 2.0, 2.0, 2.0, //
            U, U, 2.0, 2.0, 2.0, //
        ];
        let sources = sources(&depth, 5, &DepthTest::default());
        assert_eq!([sources[11], sources[16]], [12, 17]);
    }

    #[test]
    fn cracks_lie_within_one_surface() {
        let test = DepthTest::default();
        let kinds = classify(&[1.0, U, 1.01, U, 3.0, U], 6, &test);
        use Cover::{Crack, Disocclusion, Seen};
        assert_eq!(kinds, [Seen, Crack, Seen, Disocclusion, Seen, Disocclusion]);
    }
}
