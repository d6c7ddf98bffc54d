//! The shape of a depth map around a pixel: its slopes, and whether a nearer surface ends beside it.

use super::{DepthMap, Measure};
use crate::occlusion::DepthTest;

/// Pixels of a row whose surroundings are found together.
pub(crate) const TILE: usize = 64;

/// What decides which of two values of a map is nearer, and whether they lie on one surface.
#[derive(Clone, Copy)]
struct Scale {
    /// 1 if larger values are nearer, else -1.
    nearer: f32,
    /// Added to a value, it gives a positive number in proportion or inverse proportion to depth.
    offset: f32,
    measure: Measure,
    test: DepthTest,
}

/// The surroundings of some neighbouring pixels, in the order of their columns: arrays of a fixed length,
/// whose loops the compiler turns into vector instructions. The entries of unknown pixels mean nothing.
pub(crate) struct Reliefs {
    /// Change of the value per pixel to the right, on the surface of the pixel: the mean over the
    /// neighbours on it, 0 without any.
    pub(crate) across: [f32; TILE],
    /// The same down.
    pub(crate) down: [f32; TILE],
    /// Whether one of the four neighbours lies on a nearer surface. The colour of such a pixel is often
    /// mixed with that of the nearer surface.
    pub(crate) behind_edge: [bool; TILE],
    /// Whether one of the four neighbours lies on a farther surface: the surface of the pixel ends here.
    pub(crate) outline: [bool; TILE],
}

impl DepthMap {
    /// Whether one of the four neighbours of a pixel lies on a nearer surface.
    pub fn is_behind_edge(&self, x: usize, y: usize) -> bool {
        self.reliefs(x, y, &DepthTest::default()).behind_edge[0]
    }

    /// The surroundings of the pixels of a row from this column on, up to the end of the row or a tile. What
    /// may hide another sample by the depth test lies on another surface.
    pub(crate) fn reliefs(&self, start: usize, y: usize, test: &DepthTest) -> Reliefs {
        // NaN outside the map.
        let tile = |row: Option<usize>, start: usize| {
            let mut values = [f32::NAN; TILE];
            let row = row.filter(|y| *y < self.height).map_or(&[][..], |y| self.row(y));
            let rest = row.get(start..).unwrap_or_default();
            let count = rest.len().min(TILE);
            values[..count].copy_from_slice(&rest[..count]);
            values
        };
        let (here, right) = (tile(Some(y), start), tile(Some(y), start + 1));
        let (above, below) = (tile(y.checked_sub(1), start), tile(Some(y + 1), start));
        let mut left = [f32::NAN; TILE];
        left[1..].copy_from_slice(&here[..TILE - 1]);
        if let Some(before) = start.checked_sub(1) {
            left[0] = self.row(y)[before];
        }
        let (across, down) = ([0.0; TILE], [0.0; TILE]);
        let mut reliefs = Reliefs { across, down, behind_edge: [false; TILE], outline: [false; TILE] };
        let scale = Scale::of(self, test);
        for i in 0..TILE {
            reliefs.across[i] = scale.slope(left[i], here[i], right[i]);
            reliefs.down[i] = scale.slope(above[i], here[i], below[i]);
            for neighbour in [left[i], right[i], above[i], below[i]] {
                let (nearer, jump) = (scale.nearer * (neighbour - here[i]), scale.jump(here[i], neighbour));
                reliefs.behind_edge[i] |= nearer >= jump;
                reliefs.outline[i] |= -nearer >= jump;
            }
        }
        reliefs
    }
}

impl Scale {
    fn of(map: &DepthMap, test: &DepthTest) -> Self {
        let nearer = if map.measure == Measure::Disparity { 1.0 } else { -1.0 };
        Self { nearer, offset: map.offset as f32, measure: map.measure, test: *test }
    }

    /// The least difference of two values that separates their surfaces.
    #[inline(always)]
    fn jump(self, a: f32, b: f32) -> f32 {
        let smaller = (if a < b { a } else { b }) + self.offset;
        match self.measure {
            Measure::Disparity => self.test.jump(smaller),
            Measure::Depth => self.test.sigma(f64::from(smaller)) as f32,
        }
    }

    /// Mean of the differences to the neighbours on the surface of `here`; unknown neighbours have none.
    #[inline(always)]
    fn slope(self, before: f32, here: f32, after: f32) -> f32 {
        let one_surface = |a: f32, b: f32| (a - b).abs() < self.jump(a, b);
        match (one_surface(before, here), one_surface(here, after)) {
            (true, true) => (after - before) / 2.0,
            (true, false) => here - before,
            (false, true) => after - here,
            (false, false) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_stay_on_one_surface() {
        let data = vec![
            10.0,
            10.2,
            10.4,
            20.0,
            20.0, //
            10.1,
            10.3,
            f32::NAN,
            20.0,
            20.0, //
        ];
        let map = DepthMap::new((5, 2), data, 1.0, Measure::Depth).unwrap();
        let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
        let inner = relief(&map, 1, 0);
        assert!(near(inner.0, 0.2) && near(inner.1, 0.1) && !inner.2, "{inner:?}");
        let edge = relief(&map, 2, 0);
        assert!(near(edge.0, 0.2) && edge.1 == 0.0 && !edge.2, "{edge:?}");
        let far = relief(&map, 3, 0);
        assert!(far.0 == 0.0 && far.2 && !far.3 && edge.3, "{far:?}");
        assert!(!map.is_behind_edge(4, 1));
    }

    /// Errors of disparities that the depth test allows for are no edges.
    #[test]
    fn noise_is_no_edge() {
        let data = (0..60).map(|i| 6.0 + [0.0, 0.8, -0.7, 0.3][(i * 7 + i / 20) % 4]).collect();
        let map = DepthMap::new((20, 3), data, 1.0, Measure::Disparity).unwrap();
        let edges = |parallax: f64| {
            let test = DepthTest { parallax, ..DepthTest::default() };
            let row = map.reliefs(0, 1, &test);
            row.behind_edge[..20].iter().filter(|edge| **edge).count()
        };
        assert!(edges(0.0) > 5 && edges(2.0) == 0, "{} {}", edges(0.0), edges(2.0));
    }

    /// Slopes across and down, behind an edge, on an outline.
    fn relief(map: &DepthMap, x: usize, y: usize) -> (f32, f32, bool, bool) {
        let Reliefs { across, down, behind_edge, outline } = map.reliefs(x, y, &DepthTest::default());
        (across[0], down[0], behind_edge[0], outline[0])
    }

    /// A tile has what its pixels have one by one, at the borders of map and tile too.
    #[test]
    fn tiles_have_the_bits_of_single_pixels() {
        let (width, height) = (2 * TILE + 9, 3);
        let value = |i: usize| match i % 11 {
            3 => f32::NAN,
            k => 5.0 + if k > 7 { 4.0 } else { 0.01 * (i % 17) as f32 },
        };
        let data: Vec<f32> = (0..width * height).map(value).collect();
        for measure in [Measure::Depth, Measure::Disparity] {
            let map = DepthMap::new((width, height), data.clone(), 1.0, measure).unwrap();
            for (x, y) in (0..width * height).map(|p| (p % width, p / width)) {
                if !map.row(y)[x].is_nan() {
                    let i = x % TILE;
                    let all = map.reliefs(x - i, y, &DepthTest::default());
                    let of_tile = (all.across[i], all.down[i], all.behind_edge[i], all.outline[i]);
                    assert_eq!(of_tile, relief(&map, x, y), "{measure:?} {x} {y}");
                }
            }
        }
    }

    #[test]
    fn nearer_disparities_are_larger() {
        let map = DepthMap::new((3, 1), vec![4.0, 4.1, 8.0], 1.0, Measure::Disparity).unwrap();
        assert_eq!([0, 1, 2].map(|x| map.is_behind_edge(x, 0)), [false, true, false]);
        assert!((relief(&map, 1, 0).0 - 0.1).abs() < 1e-5);
    }
}
