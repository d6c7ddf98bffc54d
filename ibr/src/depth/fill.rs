//! Filling unknown depths before propagation.
//!
//! What no camera or matcher found is mostly background: the farther of the neighbours. So a guess hides
//! nothing that is known, and it shows only where nothing else does.

use super::{DepthMap, Measure, Origin};

/// Gives unknown pixels of disparity the farther of the nearest known values to their left and right, since
/// a rig says nothing across its rows, and unknown depths the farthest of the nearest ones in the row and in
/// the column, or of the map where there are none.
///
/// A row of disparities without any known value takes those of the nearest row that has one (the upper of
/// two). The map remembers which values are guesses; renderings weigh them less, and masks show them.
/// Returns the number of pixels filled.
pub fn fill_unknown(map: &mut DepthMap) -> usize {
    let unknown = map.unknown();
    if unknown == 0 {
        return 0;
    }
    let was_unknown: Vec<bool> = map.data.iter().map(|v| v.is_nan()).collect();
    let farthest = map.data.iter().copied().reduce(f32::max);
    let mut found = Vec::new();
    for_holes(&map.data, map.width, |p, around| {
        let known = |q: &u32| map.data.get(*q as usize).copied();
        let value = match map.measure {
            Measure::Disparity => around[..2].iter().filter_map(known).reduce(f32::min),
            Measure::Depth => around.iter().filter_map(known).reduce(f32::max).or(farthest),
        };
        found.extend(value.map(|value| (p as u32, value)));
    });
    found.iter().for_each(|(p, value)| map.data[*p as usize] = *value);
    if map.measure == Measure::Disparity {
        let filled: Vec<bool> = map.data.chunks_exact(map.width).map(|row| !row[0].is_nan()).collect();
        fill_empty_rows(&filled, &mut map.data);
    }
    let origin = |(was_unknown, v): (bool, &f32)| match was_unknown && !v.is_nan() {
        true => Origin::Filled,
        false => Origin::Known,
    };
    map.origins = was_unknown.into_iter().zip(&map.data).map(origin).collect();
    unknown - map.unknown()
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

    /// The farthest of the sides, of those in the column too; where there is none, of the map.
    #[test]
    fn depths_take_the_farthest_around() {
        let (data, count) = filled(&[U, 3.0, U, U, 3.05, U, 5.0], (7, 1), Measure::Depth);
        assert_eq!((data, count), (vec![3.0, 3.0, 3.05, 3.05, 3.05, 5.0, 5.0], 4));
        let wall = [8.0, 9.0, 9.5, 7.0, U, U, 8.1, 9.1, 9.6];
        let (data, count) = filled(&wall, (3, 3), Measure::Depth);
        assert_eq!((&data[3..6], count), (&[7.0, 9.1, 9.6][..], 2));
        let (data, _) = filled(&[U, U, U, U, U, U, U, U, 4.0, 2.0, 6.0, U], (4, 3), Measure::Depth);
        assert_eq!(data[..4], [4.0, 2.0, 6.0, 6.0]);
    }

    #[test]
    fn empty_rows_take_the_nearest_full_one() {
        let data = [U, U, 1.0, 2.0, U, U, U, U, 3.0, 4.0];
        let (got, count) = filled(&data, (2, 5), Measure::Disparity);
        assert_eq!(got, [1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 3.0, 4.0, 3.0, 4.0]);
        assert_eq!(count, 6);
    }
}
