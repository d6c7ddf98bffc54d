//! Segmentwise interpolation (thesis 2.4.2, Fig. 2.6).
//!
//! In each unit square of four depth samples: bilinear if all four belong to one depth segment; otherwise a
//! pixel takes the depth of the closest vertex in its own intensity segment. Pixels without such a vertex
//! are marked and filled from their neighbours.

use super::grid::{Grid, Square, around};
use crate::depth::Measure;
use crate::segment::Segments;

/// Neighbouring disparity samples of one surface differ by at most this many pixels: full maps of whole
/// numbers change by one from pixel to pixel on slanted surfaces.
const DISPARITY_STEP: f32 = 1.0;

/// Neighbouring depth samples of one surface differ by at most this share, less than half of the difference
/// that the depth test takes for two surfaces.
const DEPTH_SHARE: f32 = 0.02;

/// The dense values, in the grid's quantity.
pub(super) fn interpolate(grid: &Grid, segments: &Segments) -> Vec<f32> {
    let surfaces = depth_segments(grid);
    let mut values: Vec<f32> = (0..grid.width * grid.height)
        .map(|p| {
            let square = grid.square(p % grid.width, p / grid.width);
            let one = square.corners.iter().all(|c| surfaces[*c] == surfaces[square.corners[0]]);
            if one { grid.blend(&square) } else { same_segment(grid, segments, &square, p) }
        })
        .collect();
    grow(&mut values, grid.width, |p, q| segments.labels[p] == segments.labels[q]);
    grow(&mut values, grid.width, |_, _| true);
    values
}

/// Depth of the closest vertex in the pixel's own intensity segment, NaN if there is none.
fn same_segment(grid: &Grid, segments: &Segments, square: &Square, pixel: usize) -> f32 {
    let own = segments.labels[pixel];
    let vertices = square.corners.iter().zip(square.distances());
    vertices
        .filter(|(c, _)| segments.labels[grid.pixel(**c)] == own)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(f32::NAN, |(c, _)| grid.values[*c])
}

/// Labels of the 4-connected components of samples that differ little from their neighbours.
fn depth_segments(grid: &Grid) -> Vec<u32> {
    let n = grid.values.len();
    let mut labels = vec![u32::MAX; n];
    let mut stack = Vec::new();
    for start in 0..n {
        if labels[start] != u32::MAX {
            continue;
        }
        labels[start] = start as u32;
        stack.push(start);
        while let Some(from) = stack.pop() {
            for to in around(from, grid.columns, n) {
                let together = one_surface(grid.values[from], grid.values[to], grid.measure);
                if labels[to] == u32::MAX && together {
                    labels[to] = start as u32;
                    stack.push(to);
                }
            }
        }
    }
    labels
}

fn one_surface(a: f32, b: f32, measure: Measure) -> bool {
    match measure {
        Measure::Disparity => (a - b).abs() <= DISPARITY_STEP,
        Measure::Depth => (a - b).abs() <= DEPTH_SHARE * a.min(b),
    }
}

/// Dilation: ring by ring, a marked pixel takes the median of its known 4-neighbours that `may` allows.
fn grow(values: &mut [f32], width: usize, may: impl Fn(usize, usize) -> bool) {
    let length = values.len();
    let mut marked: Vec<usize> = (0..length).filter(|p| values[*p].is_nan()).collect();
    loop {
        // The ring is computed before it is written, so the result does not depend on the order.
        let ring: Vec<(usize, f32)> = marked
            .iter()
            .filter_map(|&p| {
                let known = around(p, width, length).filter(|q| may(p, *q)).map(|q| values[q]);
                median(known.filter(|v| !v.is_nan())).map(|v| (p, v))
            })
            .collect();
        if ring.is_empty() {
            return;
        }
        ring.iter().for_each(|(p, v)| values[*p] = *v);
        marked.retain(|p| values[*p].is_nan());
    }
}

/// The lower median of at most four values.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut sorted = [f32::INFINITY; 4];
    let mut count = 0;
    for (slot, v) in sorted.iter_mut().zip(values) {
        *slot = v;
        count += 1;
    }
    sorted.sort_by(f32::total_cmp);
    (count > 0).then(|| sorted[(count - 1) / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_low() {
        assert_eq!(median([].into_iter()), None);
        assert_eq!(median([3.0].into_iter()), Some(3.0));
        assert_eq!(median([3.0, 1.0].into_iter()), Some(1.0));
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), Some(2.0));
        assert_eq!(median([4.0, 3.0, 1.0, 2.0].into_iter()), Some(2.0));
    }

    #[test]
    fn growth_keeps_to_its_segment_first() {
        let n = f32::NAN;
        let labels = [0, 0, 0, 1, 1, 1];
        let mut values = [5.0, n, n, n, n, n];
        grow(&mut values, 6, |p, q| labels[p] == labels[q]);
        assert!(values[..3].iter().all(|v| *v == 5.0) && values[3..].iter().all(|v| v.is_nan()));
        grow(&mut values, 6, |_, _| true);
        assert_eq!(values, [5.0; 6]);
    }
}
