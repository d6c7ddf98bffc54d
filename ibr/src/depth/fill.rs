//! Filling unknown depths before propagation.
//!
//! Disparity is mostly unknown where the second camera of a rig had no view, which is background: the
//! farther of the neighbours along the row. A depth map says nothing of a second camera, and programs leave
//! out what they could not match, in the foreground too. There a hole is filled only within one surface.

use super::relief::JUMP;
use super::{DepthMap, Measure};

/// Gives unknown pixels of disparity the farther of the nearest known values to their left and right, and
/// unknown depths the farther of those on both sides, in the row and in the column, if all of these lie on
/// one surface. A side whose opposite one is beyond the border says nothing: it may be far away.
///
/// A row of disparities without any known value takes those of the nearest row that has one (the upper of
/// two). The map remembers which values are guesses; renderings weigh them less. Returns the number of
/// pixels filled.
pub fn fill_unknown(map: &mut DepthMap) -> usize {
    let unknown = map.unknown();
    if unknown == 0 {
        return 0;
    }
    let was_unknown: Vec<bool> = map.data.iter().map(|v| v.is_nan()).collect();
    let mut found = Vec::new();
    for_holes(&map.data, map.width, |p, around| {
        let side = |q: u32| map.data.get(q as usize).copied();
        let value = match map.measure {
            Measure::Disparity => match (side(around[0]), side(around[1])) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            },
            Measure::Depth => of_one_surface(around, side),
        };
        found.extend(value.map(|value| (p as u32, value)));
    });
    found.iter().for_each(|(p, value)| map.data[*p as usize] = *value);
    if map.measure == Measure::Disparity {
        let filled: Vec<bool> = map.data.chunks_exact(map.width).map(|row| !row[0].is_nan()).collect();
        fill_empty_rows(&filled, &mut map.data);
    }
    let filled = |(was_unknown, v): (bool, &f32)| was_unknown && !v.is_nan();
    map.guessed = was_unknown.into_iter().zip(&map.data).map(filled).collect();
    unknown - map.unknown()
}

/// The farther depth of the sides of a hole that has one surface around it.
fn of_one_surface(around: [u32; 4], side: impl Fn(u32) -> Option<f32>) -> Option<f32> {
    let pairs = around.as_chunks().0.iter().filter_map(|[a, b]| Some([side(*a)?, side(*b)?]));
    let (near, far) = pairs.flatten().fold((f32::MAX, 0.0), |(near, far), v| (v.min(near), v.max(far)));
    (far > 0.0 && far - near < JUMP * near).then_some(far)
}

/// Copies rows of nothing from the nearest row of something (the upper of two); `filled` marks those.
pub(crate) fn fill_empty_rows(filled: &[bool], values: &mut [f32]) {
    if filled.iter().all(|filled| *filled) {
        return;
    }
    let full: Vec<usize> = (0..filled.len()).filter(|y| filled[*y]).collect();
    let stride = values.len() / filled.len().max(1);
    for y in (0..filled.len()).filter(|y| !filled[*y]) {
        let after = full.partition_point(|other| *other < y);
        let beside = full[after.saturating_sub(1)..].iter().take(2);
        if let Some(&nearest) = beside.min_by_key(|other| other.abs_diff(y)) {
            values.copy_within(nearest * stride..(nearest + 1) * stride, y * stride);
        }
    }
}

/// In place of the number of a known pixel, where there is none.
pub(crate) const NONE: u32 = u32::MAX;

/// Calls `visit(p, neighbours)` for every unknown pixel with its nearest known pixels to the left,
/// right, above and below.
pub(crate) fn for_holes(depth: &[f32], width: usize, mut visit: impl FnMut(usize, [u32; 4])) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const U: f32 = f32::NAN;

    fn filled(data: &[f32], size: (usize, usize), measure: Measure) -> (Vec<f32>, usize) {
        let mut map = DepthMap::new(size, data.to_vec(), 1.0, measure).unwrap();
        let count = fill_unknown(&mut map);
        (map.data, count)
    }

    #[test]
    fn the_farther_neighbour_wins() {
        let row = [U, 3.0, U, U, 5.0, U];
        assert_eq!(filled(&row, (6, 1), Measure::Disparity), (vec![3.0, 3.0, 3.0, 3.0, 5.0, 5.0], 4));
    }

    /// Depths are filled within one surface, not between two and not at the border.
    #[test]
    fn depths_are_filled_within_a_surface() {
        let (data, count) = filled(&[U, 3.0, U, U, 3.05, U, 5.0], (7, 1), Measure::Depth);
        assert_eq!((&data[1..5], count), (&[3.0, 3.05, 3.05, 3.05][..], 2));
        assert!(data[0].is_nan() && data[5].is_nan());
        // A slanted wall: left of the hole in the second row it is much nearer, and to the right is nothing.
        let wall = [8.0, 9.0, 9.5, 7.0, U, U, 8.1, 9.1, 9.6];
        let (data, count) = filled(&wall, (3, 3), Measure::Depth);
        assert_eq!((&data[3..6], count), (&[7.0, 9.1, 9.6][..], 2));
    }

    #[test]
    fn empty_rows_take_the_nearest_full_one() {
        let data = [U, U, 1.0, 2.0, U, U, U, U, 3.0, 4.0];
        let (got, count) = filled(&data, (2, 5), Measure::Disparity);
        assert_eq!(got, [1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 3.0, 4.0, 3.0, 4.0]);
        assert_eq!(count, 6);
    }
}
