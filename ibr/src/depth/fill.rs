//! Filling unknown depths before propagation: the farther of the neighbours along the row.
//!
//! Depth is mostly unknown where the second sensor of a stereo pair had no view, which is background.

use super::{DepthMap, Measure};

/// Gives every unknown pixel the farther of the nearest known values to its left and right.
///
/// A row without any known value takes those of the nearest row that has one (the upper of two).
/// The map remembers which values are guesses; renderings weigh them less. Returns the number of pixels
/// filled.
pub fn fill_unknown(map: &mut DepthMap) -> usize {
    let unknown = map.unknown();
    if unknown == 0 {
        return 0;
    }
    map.guessed = map.data.iter().map(|v| v.is_nan()).collect();
    let (width, measure) = (map.width, map.measure);
    map.data.chunks_exact_mut(width).for_each(|row| fill_row(row, measure));
    let filled: Vec<bool> = map.data.chunks_exact(width).map(|row| !row[0].is_nan()).collect();
    fill_empty_rows(&filled, &mut map.data);
    unknown
}

fn fill_row(row: &mut [f32], measure: Measure) {
    let mut x = 0;
    while x < row.len() {
        if !row[x].is_nan() {
            x += 1;
            continue;
        }
        let end = row[x..].iter().position(|v| !v.is_nan()).map_or(row.len(), |n| x + n);
        let left = x.checked_sub(1).map(|i| row[i]);
        let right = row.get(end).copied();
        let value = match (left, right) {
            (Some(a), Some(b)) => measure.farther(a, b),
            (a, b) => a.or(b).unwrap_or(f32::NAN),
        };
        row[x..end].fill(value);
        x = end;
    }
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
        assert_eq!(filled(&row, (6, 1), Measure::Depth), (vec![3.0, 3.0, 5.0, 5.0, 5.0, 5.0], 4));
    }

    #[test]
    fn empty_rows_take_the_nearest_full_one() {
        let data = [U, U, 1.0, 2.0, U, U, U, U, 3.0, 4.0];
        let (got, count) = filled(&data, (2, 5), Measure::Depth);
        assert_eq!(got, [1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 3.0, 4.0, 3.0, 4.0]);
        assert_eq!(count, 6);
    }
}
