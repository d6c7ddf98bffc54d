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
    fill_empty_rows(map);
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

fn fill_empty_rows(map: &mut DepthMap) {
    let (width, height) = map.size();
    let full: Vec<usize> = (0..height).filter(|y| !map.row(*y)[0].is_nan()).collect();
    for y in (0..height).filter(|y| full.binary_search(y).is_err()) {
        if let Some(&nearest) = full.iter().min_by_key(|other| other.abs_diff(y)) {
            map.data.copy_within(nearest * width..(nearest + 1) * width, y * width);
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
