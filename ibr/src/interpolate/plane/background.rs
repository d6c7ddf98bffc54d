//! Classification of holes in the plane, and the surface that is continued into each.

use crate::interpolate::Cover;
use crate::occlusion::DepthTest;

/// The known pixel next to `p` in each of the four directions, as an index; `NONE` where there is none.
const NONE: u32 = u32::MAX;

/// Calls `visit(p, neighbours)` for every unknown pixel with its nearest known pixels to the left,
/// right, above and below.
fn for_holes(depth: &[f32], width: usize, mut visit: impl FnMut(usize, [u32; 4])) {
    let below = nearest_below(depth, width);
    let mut above = vec![NONE; width];
    let mut right = vec![NONE; width];
    for (y, row) in depth.chunks_exact(width).enumerate() {
        let index = |x: usize| (y * width + x) as u32;
        let mut last = NONE;
        for x in (0..width).rev() {
            right[x] = last;
            if !row[x].is_nan() {
                last = index(x);
            }
        }
        let mut left = NONE;
        for x in 0..width {
            if row[x].is_nan() {
                visit(y * width + x, [left, right[x], above[x], below[y * width + x]]);
            } else {
                left = index(x);
                above[x] = left;
            }
        }
    }
}

fn nearest_below(depth: &[f32], width: usize) -> Vec<u32> {
    let mut below = vec![NONE; depth.len()];
    for p in (0..depth.len().saturating_sub(width)).rev() {
        let next = p + width;
        below[p] = if depth[next].is_nan() { below[next] } else { next as u32 };
    }
    below
}

/// Distance between a hole pixel and a pixel in its row or column.
fn distance(p: usize, q: u32, width: usize) -> usize {
    let q = q as usize;
    (p % width).abs_diff(q % width) + (p / width).abs_diff(q / width)
}

/// For every unknown pixel the known pixel to continue from: the farthest in depth of its four neighbours,
/// and of equal depths the closest.
pub(super) fn farthest(depth: &[f32], width: usize) -> Vec<Option<u32>> {
    let mut sources = vec![None; depth.len()];
    for_holes(depth, width, |p, around| {
        let known = around.into_iter().filter(|q| *q != NONE);
        sources[p] = known.min_by(|a, b| {
            let deeper = depth[*b as usize].total_cmp(&depth[*a as usize]);
            deeper.then(distance(p, *a, width).cmp(&distance(p, *b, width)))
        });
    });
    sources
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
    fn the_farthest_of_four_is_continued() {
        let depth = [
            U, 1.0, U, //
            2.0, U, 2.0, //
            U, 5.0, U,
        ];
        let sources = farthest(&depth, 3);
        assert_eq!(sources[4], Some(7));
        assert_eq!(sources[0], Some(3));
        assert_eq!(sources[1], None);
        assert_eq!(farthest(&[U; 4], 2), [None; 4]);
    }

    #[test]
    fn cracks_lie_within_one_surface() {
        let test = DepthTest::default();
        let kinds = classify(&[1.0, U, 1.01, U, 3.0, U], 6, &test);
        use Cover::{Crack, Disocclusion, Seen};
        assert_eq!(kinds, [Seen, Crack, Seen, Disocclusion, Seen, Disocclusion]);
    }
}
