//! A bound of the error of the row fit that holds surely, from a bound of the second derivative.
//!
//! Let f be the row of the virtual image on one surface. The fit is linear in its samples, with influences
//! h_s whose sum is one, so at column x
//!
//! ```text
//! |J - f| <= |f'| |sum h_s (x_s - x)| + (K / 2) sum |h_s| (|x_s - x| + m_s)^2
//!            + sum |h_s| (E + |f'| m_s) + 255 (|1 - sum h_s| + sum of |h_s| elsewhere)
//! ```
//!
//! K bounds |f''|, E the errors of intensities, and m_s = D |distance to the view| displacements, with D the
//! bound of the errors of disparity. The sums are over the samples of the surface of x; elsewhere are those
//! of other surfaces and the copies that fill holes. Two samples side by side belong to two surfaces if one
//! depth hides the other. By the mean value theorem
//!
//! ```text
//! |f'(x)| <= (|v_b - v_a| + 2 E) / l + K d,   l = x_b - x_a - m_a - m_b
//! ```
//!
//! for any two samples a and b of the surface on both sides of x, d being the distance of x from the farther
//! one, and |f'| <= 255 / w + K w for a piece of w columns. The least of these counts.

use hybank_ibr::sample::Sample;

/// The range of intensities.
pub(super) const RANGE: f64 = 255.0;

/// Pixels to each side of x at which two samples are looked for, to bound the slope.
const SPANS: [f64; 5] = [0.75, 1.5, 3.0, 6.0, 12.0];

/// Columns beyond which the influence of a sample is zero to working precision.
pub(super) const REACH: f64 = 24.0;

/// What is known for sure of a scene and its photographs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// sup |f''| along the rows of the virtual view within one surface, grey levels per pixel squared.
    pub curvature: f64,
    /// Largest error of an intensity, grey levels: noise, rounding, and light that depends on the view.
    pub intensity: f64,
    /// Largest error of a disparity, pixels for a baseline of one.
    pub disparity: f64,
}

/// The samples of one row in the order of their columns, as the bound needs them.
#[derive(Debug, Clone, Default)]
pub(super) struct Row<const C: usize> {
    points: Vec<Point<C>>,
}

#[derive(Debug, Clone, Copy)]
struct Point<const C: usize> {
    x: f64,
    value: [f32; C],
    /// Largest displacement, m_s.
    moved: f64,
    /// Number of its piece of surface within the row.
    piece: usize,
}

impl<const C: usize> Row<C> {
    /// `distance` is that of a view from the virtual one; `parts` tells whether two neighbouring samples lie
    /// on two surfaces.
    pub(super) fn new(
        samples: &[Sample<C>],
        limits: &Limits,
        distance: impl Fn(u16) -> f64,
        parts: impl Fn(&Sample<C>, &Sample<C>) -> bool,
    ) -> Self {
        let mut piece = 0;
        let point = |(k, s): (usize, &Sample<C>)| {
            piece += usize::from(k > 0 && parts(&samples[k - 1], s));
            Point { x: s.x, value: s.value, moved: limits.disparity * distance(s.view), piece }
        };
        Self { points: samples.iter().enumerate().map(point).collect() }
    }

    /// The bound at column x. `influence(k)` is that of sample k; `filled` has the sum of the influences of
    /// the copies that fill holes, and that of their magnitudes.
    pub(super) fn bound(
        &self,
        x: f64,
        limits: &Limits,
        influence: impl Fn(usize) -> f64,
        filled: (f64, f64),
    ) -> f64 {
        let Some(piece) = self.piece_at(x) else { return RANGE };
        let slope = self.slope(x, piece, limits);
        let (mut sum, mut shift, mut own, mut elsewhere) = (filled.0, 0.0, 0.0, filled.1);
        let from = self.points.partition_point(|p| p.x < x - REACH);
        for (k, p) in self.points.iter().enumerate().skip(from).take_while(|(_, p)| p.x <= x + REACH) {
            let h = influence(k);
            sum += h;
            if p.piece != piece {
                elsewhere += h.abs();
                continue;
            }
            let away = p.x - x;
            shift += h * away;
            let bent = limits.curvature / 2.0 * (away.abs() + p.moved).powi(2);
            own += h.abs() * (bent + limits.intensity + slope * p.moved);
        }
        (own + slope * shift.abs() + RANGE * (elsewhere + (1.0 - sum).abs())).min(RANGE)
    }

    /// The piece that holds column x wherever the displacements put its ends; none outside of all pieces.
    fn piece_at(&self, x: f64) -> Option<usize> {
        let right = self.points.partition_point(|p| p.x < x);
        let piece = self.points.get(right)?.piece;
        let points = self.of_piece(piece);
        let (first, last) = (points.first()?, points.last()?);
        (first.x + first.moved <= x && x <= last.x - last.moved).then_some(piece)
    }

    fn of_piece(&self, piece: usize) -> &[Point<C>] {
        let from = self.points.partition_point(|p| p.piece < piece);
        &self.points[from..self.points.partition_point(|p| p.piece <= piece)]
    }

    /// A bound of |f'(x)|.
    fn slope(&self, x: f64, piece: usize, limits: &Limits) -> f64 {
        let points = self.of_piece(piece);
        let (first, last) = (points[0].x, points[points.len() - 1].x);
        let width = (RANGE / limits.curvature).sqrt().min(last - first);
        let general = RANGE / width + limits.curvature * width;
        let near = SPANS.iter().filter_map(|span| secant(points, x, *span, limits));
        near.fold(general, f64::min)
    }
}

/// The bound of the slope by the two samples next to x - span and x + span.
fn secant<const C: usize>(points: &[Point<C>], x: f64, span: f64, limits: &Limits) -> Option<f64> {
    let a = points.get(points.partition_point(|p| p.x <= x - span).checked_sub(1)?)?;
    let b = points.get(points.partition_point(|p| p.x < x + span))?;
    let length = b.x - a.x - a.moved - b.moved;
    let rise = a.value.iter().zip(b.value).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
    let away = (x - a.x + a.moved).max(b.x - x + b.moved);
    (length > 0.0).then(|| (rise + 2.0 * limits.intensity) / length + limits.curvature * away)
}
