//! The map of the pixels of one row of a view to the virtual image.

use super::super::Frame;
use crate::camera::Relative;
use crate::occlusion::LARGEST_SPACING;
use crate::surfaces::JUMP;

/// Least depth at the virtual camera for which the corners of a tile say where its pixels fall, as a share
/// of the largest one.
const IN_FRONT: f64 = 1e-6;

/// Largest slope of a surface, as a share of its depth.
const SLOPE: f64 = 1.0001 * JUMP as f64;

/// Factor of bounds of distances, which round.
const ROUNDING: f64 = 1.01;

pub(super) struct Reach {
    columns: (f64, f64),
    pub(super) rows: (f64, f64),
    /// Bound of the distance of neighbouring samples.
    pub(super) spacing: f32,
}

impl Reach {
    pub(super) fn meets(&self, frame: &Frame) -> bool {
        let right = frame.width as f64 - 1.0 + frame.margin;
        let (left, end) = (self.columns.0 + frame.offset, self.columns.1 + frame.offset);
        left <= right && end >= -frame.margin && self.rows.0 <= frame.rows.1 && self.rows.1 >= frame.rows.0
    }
}

/// The map of the pixels of one row: A x~ is affine in the column.
pub(super) struct RowMap<'a> {
    map: &'a Relative,
    y: f64,
    start: [f64; 3],
    /// Change of A x~ for a step to the right, and for one down.
    step: [f64; 3],
    down: [f64; 3],
    shift: [f64; 3],
    /// Whether no lens bends the map.
    pub(super) linear: bool,
}

/// A pixel with depth at the virtual camera, without lenses.
pub(super) struct Projection {
    pub(super) at: (f64, f64, f64),
    /// A x~.
    ray: [f64; 3],
    inverse: f64,
}

impl<'a> RowMap<'a> {
    pub(super) fn new(map: &'a Relative, y: usize) -> Self {
        let (a, b, y) = (&map.a, &map.b, y as f64);
        let start = std::array::from_fn(|k| a[(k, 1)] * y + a[(k, 2)]);
        let [step, down] = [0, 1].map(|column| std::array::from_fn(|k| a[(k, column)]));
        Self { map, y, start, step, down, shift: [b.x, b.y, b.z], linear: map.is_linear() }
    }

    /// Position and depth of a pixel, with lenses.
    pub(super) fn bend(&self, x: f64, depth: f32) -> (f64, f64, f64) {
        self.map.map(x, self.y, f64::from(depth))
    }

    /// Where a pixel would fall without lenses.
    #[inline(always)]
    pub(super) fn project(&self, x: f64, depth: f64) -> Projection {
        // Written out: closures over the three coordinates are calls in this innermost loop.
        let ray = [
            self.start[0] + self.step[0] * x,
            self.start[1] + self.step[1] * x,
            self.start[2] + self.step[2] * x,
        ];
        let p =
            [ray[0] * depth + self.shift[0], ray[1] * depth + self.shift[1], ray[2] * depth + self.shift[2]];
        let inverse = 1.0 / p[2];
        Projection { at: (p[0] * inverse, p[1] * inverse, p[2]), ray, inverse }
    }

    /// The displacements of a landing, in virtual pixels, for a step of one pixel to the right and for one
    /// down, on a surface whose depth changes by `slopes` per pixel in these directions.
    ///
    /// With q = A x~ and p = d q + b, dp = d A e + q d' and d(p.x / p.z) = (dp.x - p.x / p.z dp.z) / p.z.
    /// Lenses are left out: they change distances between neighbours by a few per cent.
    #[inline(always)]
    pub(super) fn steps(&self, projection: &Projection, depth: f64, slopes: [f64; 2]) -> [[f64; 2]; 2] {
        [
            self.moved(projection, depth, self.step, slopes[0]),
            self.moved(projection, depth, self.down, slopes[1]),
        ]
    }

    /// The displacement for the change `a` of A x~ and a change of the depth by `slope`.
    #[inline(always)]
    fn moved(&self, projection: &Projection, depth: f64, a: [f64; 3], slope: f64) -> [f64; 2] {
        let Projection { at, ray, inverse } = projection;
        let away = a[2] * depth + ray[2] * slope;
        let across = a[0] * depth + ray[0] * slope - at.0 * away;
        let along = a[1] * depth + ray[1] * slope - at.1 * away;
        [across * inverse, along * inverse]
    }

    /// Bounds of the samples of a tile, if all of it lies in front of the virtual camera and no lens bends
    /// the map.
    pub(super) fn corners(&self, column: usize, depths: &[f32]) -> Option<Reach> {
        let (near, far) =
            depths.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(*d), b.max(*d)));
        let ends = [column as f64, (column + depths.len() - 1) as f64];
        let corners = ends.map(|x| [near, far].map(|d| self.project(x, f64::from(d)).at));
        let all = || corners.iter().flatten();
        let bounds = |of: fn(&(f64, f64, f64)) -> f64| {
            all().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (least, largest) = bounds(|p| p.2);
        // The computed positions round: a millionth of a pixel is more than enough.
        let wide =
            |(low, high): (f64, f64)| (low - 1e-6 * (1.0 + low.abs()), high + 1e-6 * (1.0 + high.abs()));
        (self.linear && largest > 0.0 && least > IN_FRONT * largest).then(|| Reach {
            columns: wide(bounds(|p| p.0)),
            rows: wide(bounds(|p| p.1)),
            spacing: self.largest_spacing(ends, [f64::from(near), f64::from(far)]),
        })
    }

    /// Bound of the distance of neighbouring samples on surfaces whose depth changes by at most a share
    /// [`JUMP`] per pixel, in front of the virtual camera.
    ///
    /// For a step e and a slope s d, with q = A x~, a = A e and p = d q + b, the displacement is
    ///
    /// ```text
    /// d (d (a_k q_3 - a_3 q_k) + a_k b_3 - a_3 b_k + s (q_k b_3 - q_3 b_k)) / p_3^2,   k = 1, 2.
    /// ```
    ///
    /// The numerator without its first factor is bilinear in the column and d, and both d / p_3 and 1 / p_3
    /// are monotone in each, so that their extremes lie at the corners.
    fn largest_spacing(&self, columns: [f64; 2], depths: [f64; 2]) -> f32 {
        let (mut ratio, mut inverse, mut moves) = (0.0_f64, 0.0_f64, [0.0_f64; 4]);
        for (x, d) in columns.into_iter().flat_map(|x| depths.map(|d| (x, d))) {
            let Projection { at, ray: q, inverse: i } = self.project(x, d);
            (ratio, inverse) = (ratio.max(d / at.2), inverse.max(i));
            for (m, (k, a)) in
                moves.iter_mut().zip([(0, self.step), (1, self.step), (0, self.down), (1, self.down)])
            {
                let b = self.shift;
                let level = d * (a[k] * q[2] - a[2] * q[k]) + a[k] * b[2] - a[2] * b[k];
                *m = m.max(level.abs() + SLOPE * (q[k] * b[2] - q[2] * b[k]).abs());
            }
        }
        let square: f64 = moves.iter().map(|m| (m * ratio * inverse).powi(2)).sum();
        (ROUNDING * (square / 2.0).sqrt()) as f32
    }

    /// The same from every pixel, and the number of pixels behind the virtual camera.
    pub(super) fn each(&self, column: usize, depths: &[f32], frame: &Frame) -> (Reach, usize) {
        let (mut behind, mut rows) = (0, (f64::INFINITY, f64::NEG_INFINITY));
        for (x, depth) in (column..).zip(depths).filter(|(_, d)| !d.is_nan()) {
            let (x, depth) = (x as f64, *depth);
            let (u, v, d) =
                if self.linear { self.project(x, f64::from(depth)).at } else { self.bend(x, depth) };
            // NaN: outside the domain of the lens model.
            if d <= 0.0 || u.is_infinite() || v.is_infinite() {
                behind += 1;
            } else if frame.holds(u + frame.offset, v) {
                rows = (rows.0.min(v), rows.1.max(v));
            }
        }
        (Reach { columns: (f64::MIN, f64::MAX), rows, spacing: LARGEST_SPACING }, behind)
    }
}
