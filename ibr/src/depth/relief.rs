//! The shape of a depth map around a pixel: its slopes, and whether a nearer surface ends beside it.

use super::{DepthMap, Measure};

/// A difference of this share of the nearer depth separates two surfaces: the depth test's default sigma.
const JUMP: f32 = 0.05;

/// The surroundings of a pixel of known depth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Relief {
    /// Change of the value per pixel to the right, on the surface of the pixel.
    pub across: f64,
    /// Change of the value per pixel down.
    pub down: f64,
    /// Whether one of the four neighbours lies on a nearer surface. The colour of such a pixel is often
    /// mixed with that of the nearer surface.
    pub behind_edge: bool,
    /// Whether one of the four neighbours lies on a farther surface: the surface of the pixel ends here.
    pub outline: bool,
}

impl DepthMap {
    /// The surroundings of a pixel. Slopes are means over the neighbours on the same surface, and 0 without
    /// any.
    #[inline]
    pub fn relief(&self, x: usize, y: usize) -> Relief {
        let row = self.row(y);
        let here = row[x];
        let side = |at: Option<usize>| at.and_then(|i| row.get(i)).copied().unwrap_or(f32::NAN);
        let beyond = |at: Option<usize>| at.and_then(|i| self.data.get(i)).copied().unwrap_or(f32::NAN);
        let p = y * self.width + x;
        let (left, right) = (side(x.checked_sub(1)), side(Some(x + 1)));
        let (above, below) = (beyond(p.checked_sub(self.width)), beyond(Some(p + self.width)));
        let around = [left, right, above, below];
        Relief {
            across: self.slope(left, here, right),
            down: self.slope(above, here, below),
            behind_edge: around.into_iter().any(|n| self.is_behind(here, n)),
            outline: around.into_iter().any(|n| self.is_behind(n, here)),
        }
    }

    /// Mean of the differences to the neighbours on the surface of `here`; unknown neighbours have none.
    #[inline]
    fn slope(&self, before: f32, here: f32, after: f32) -> f64 {
        let one_surface = |a: f32, b: f32| (a - b).abs() < self.jump(a, b);
        match (one_surface(before, here), one_surface(here, after)) {
            (true, true) => f64::from(after - before) / 2.0,
            (true, false) => f64::from(here - before),
            (false, true) => f64::from(after - here),
            (false, false) => 0.0,
        }
    }

    /// Whether `here` lies behind the surface of a neighbour.
    #[inline]
    fn is_behind(&self, here: f32, neighbour: f32) -> bool {
        let closer = match self.measure {
            Measure::Disparity => neighbour - here,
            Measure::Depth => here - neighbour,
        };
        closer >= self.jump(here, neighbour)
    }

    /// The least difference of two values that separates their surfaces.
    #[inline]
    fn jump(&self, a: f32, b: f32) -> f32 {
        match self.measure {
            // Depth is proportional to 1 / D, so a difference of a share of the nearer depth is the same
            // share of the smaller disparity.
            Measure::Disparity => JUMP * (a.min(b) + self.offset as f32),
            Measure::Depth => JUMP * a.min(b),
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
        let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
        let inner = map.relief(1, 0);
        assert!(near(inner.across, 0.2) && near(inner.down, 0.1) && !inner.behind_edge, "{inner:?}");
        let edge = map.relief(2, 0);
        assert!(near(edge.across, 0.2) && edge.down == 0.0 && !edge.behind_edge, "{edge:?}");
        let far = map.relief(3, 0);
        assert!(far.across == 0.0 && far.behind_edge && !far.outline && edge.outline, "{far:?}");
        assert!(!map.relief(4, 1).behind_edge);
    }

    #[test]
    fn nearer_disparities_are_larger() {
        let map = DepthMap::new((3, 1), vec![4.0, 4.1, 8.0], 1.0, Measure::Disparity).unwrap();
        assert_eq!([0, 1, 2].map(|x| map.relief(x, 0).behind_edge), [false, true, false]);
        assert!((map.relief(1, 0).across - 0.1).abs() < 1e-5);
    }
}
