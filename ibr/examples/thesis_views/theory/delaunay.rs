//! Moments of the Delaunay triangles of a planar Poisson process (R. E. Miles, Math. Biosciences 6, 1970).
//!
//! The typical triangle of a process of density lambda has a circumradius R and angles A, B, C, independent
//! of each other, with the densities
//!
//! ```text
//! p(R) = 2 (pi lambda)^2 R^3 exp(-pi lambda R^2),     8 / (3 pi) sin A sin B sin C   (A + B + C = pi)
//! ```
//!
//! so pi lambda R^2 is a gamma variable of shape 2. The angles of a triangle with three uniform corners on a
//! circle are uniform, and Dyson's integral of the powers of its sides is known; it gives
//!
//! ```text
//! E[(sin A sin B sin C)^a] = 4 pi / (3 8^{a+1})  Gamma(1 + 3 (a + 1) / 2) / Gamma(1 + (a + 1) / 2)^3
//! E[S^a R^{2b}]            = 2^a Gamma(a + b + 2) / (pi lambda)^{a+b}  E[(sin A sin B sin C)^a]
//! ```
//!
//! for the area S = 2 R^2 sin A sin B sin C. There are 2 lambda triangles per unit area.

use std::f64::consts::PI;

/// 2 E\[S c (1/3 - k (1 - k) / 6)\] for density one; the test computes the integral.
const EDGE_ERROR: f64 = 0.43230;

/// A planar Poisson process, whose points are triangulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoissonDelaunay {
    /// Points per unit area.
    pub density: f64,
}

impl PoissonDelaunay {
    /// E\[S^a R^{2b}\] of the typical triangle, S its area and R its circumradius.
    ///
    /// E\[R^2\] = 2 / (pi lambda), E\[S\] = 1 / (2 lambda), E\[S^2\] = 35 / (8 pi^2 lambda^2),
    /// E\[S R^2\] = 3 / (2 pi lambda^2) (thesis Table 4.1).
    pub fn moment(&self, a: u32, b: u32) -> f64 {
        let scale = (PI * self.density).powi((a + b) as i32);
        2.0_f64.powi(a as i32) * gamma_of_half(2 * (a + b) + 4) / scale * sines(a)
    }

    /// E\[S sum l^2\], l the three edges: 12 / (pi lambda^2).
    ///
    /// The sum of squares is 4 R^2 (sin^2 A + sin^2 B + sin^2 C) and the area-weighted mean of the sum of
    /// the sin^2 is 2, as an integration over the uniform angles shows.
    pub fn area_times_squared_edges(&self) -> f64 {
        8.0 * self.moment(1, 1)
    }

    /// Mean over the plane of the squared circumradius: 3 / (pi lambda).
    pub fn mean_squared_radius(&self) -> f64 {
        self.moment(1, 1) / self.moment(1, 0)
    }

    /// Mean over the plane of the error of linear interpolation of f = |x|^2 / 2, sum l^2 / 24 over the
    /// edges of a triangle: 1 / (pi lambda).
    pub fn mean_quadratic_error(&self) -> f64 {
        self.area_times_squared_edges() / self.moment(1, 0) / 24.0
    }

    /// Mean L1 error of linear interpolation beside a straight edge of unit height, per unit of its length:
    /// 0.4323 / sqrt(lambda).
    ///
    /// An edge at the height t cuts a triangle, of heights h1 <= h2 <= h3 over the edge's direction, into a
    /// corner and the rest. With s = (t - h1) / (h2 - h1) and r = (t - h1) / (h3 - h1) the two parts have
    /// the error S (1/3 - s r + 2 s r (s + r) / 3) together. The integral over t, both corners included, is
    ///
    /// ```text
    /// S c (1/3 - k (1 - k) / 6),   c = h3 - h1,   k = (h2 - h1) / c
    /// ```
    ///
    /// and the sum over the 2 lambda triangles per unit area is 2 lambda E\[..\] over the typical triangle
    /// and all directions.
    pub fn edge_error(&self) -> f64 {
        EDGE_ERROR / self.density.sqrt()
    }

    /// Mean length of an edge: 32 / (9 pi sqrt(lambda)).
    pub fn mean_edge(&self) -> f64 {
        32.0 / (9.0 * PI * self.density.sqrt())
    }
}

/// Factor of E\[S^a R^{2b}\] for N shifted copies of one grid instead of a Poisson process, `order` the sum
/// of a and b: prod_{j<order} N / (N + j), the same as that of intervals on the line.
///
/// A cell of the grid is a torus with N independent uniform points. Three of them are a triangle if the
/// circle through them is empty, with probability (1 - pi R^2 / cell)^{N-3} instead of exp(-pi lambda R^2),
/// so pi R^2 / cell is a beta variable of the shapes 2 and N - 2. Circles wider than the cell are neglected.
pub fn superposed_grids(grids: usize, order: u32) -> f64 {
    let n = grids as f64;
    (0..order).map(|j| n / (n + f64::from(j))).product()
}

/// E\[(sin A sin B sin C)^a\] over the angles of the typical triangle.
fn sines(a: u32) -> f64 {
    let m = a + 1;
    let dyson = gamma_of_half(2 + 3 * m) / gamma_of_half(2 + m).powi(3);
    4.0 * PI / 3.0 / 8.0_f64.powi(m as i32) * dyson
}

/// Gamma(n / 2), n >= 1.
fn gamma_of_half(n: u32) -> f64 {
    match n {
        0 => f64::INFINITY,
        1 => PI.sqrt(),
        2 => 1.0,
        _ => (f64::from(n) / 2.0 - 1.0) * gamma_of_half(n - 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_table_of_the_thesis() {
        let lambda = 2.5;
        let p = PoissonDelaunay { density: lambda };
        for (got, want) in [
            (p.moment(0, 1) * lambda, 2.0 / PI),
            (p.moment(0, 2) * lambda * lambda, 6.0 / (PI * PI)),
            (p.moment(1, 0) * lambda, 0.5),
            (p.moment(2, 0) * lambda * lambda, 35.0 / (8.0 * PI * PI)),
            (p.moment(1, 1) * lambda * lambda, 1.5 / PI),
            (p.mean_squared_radius() * lambda, 3.0 / PI),
            (p.area_times_squared_edges() * lambda * lambda, 12.0 / PI),
            (p.mean_quadratic_error() * lambda, 1.0 / PI),
        ] {
            assert!((got / want - 1.0).abs() < 1e-12, "{got} {want}");
        }
    }

    /// The law of R and the angles by sums over a grid: no Dyson integral, no gamma functions.
    #[test]
    fn moments_are_integrals_of_the_law() {
        let lambda: f64 = 0.7;
        let p = PoissonDelaunay { density: lambda };
        let (steps, far) = (4000, 12.0 / (PI * lambda).sqrt());
        let radial = |power: i32| {
            let at = |i: i32| (f64::from(i) + 0.5) * far / f64::from(steps);
            let law = |r: f64| 2.0 * (PI * lambda).powi(2) * r.powi(3) * (-PI * lambda * r * r).exp();
            (0..steps).map(|i| at(i).powi(power) * law(at(i))).sum::<f64>() * far / f64::from(steps)
        };
        let n = 300;
        let angular = |f: &dyn Fn(f64, f64, f64) -> f64| {
            let h = PI / f64::from(n);
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n - i {
                    // Centroids of the small triangles; the upper ones only where they lie inside.
                    for (on, third) in [(true, 1.0 / 3.0), (i + j + 1 < n, 2.0 / 3.0)] {
                        let (a, b) = ((f64::from(i) + third) * h, (f64::from(j) + third) * h);
                        let (x, y, z) = (a.sin(), b.sin(), (PI - a - b).sin());
                        let law = 8.0 / (3.0 * PI) * x * y * z;
                        sum += if on { law * f(x, y, z) * h * h / 2.0 } else { 0.0 };
                    }
                }
            }
            sum
        };
        for (a, b) in [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (3, 1), (2, 2)] {
            let sines = angular(&|x, y, z| (2.0 * x * y * z).powi(a));
            let want = radial(2 * (a + b)) * sines;
            let got = p.moment(a as u32, b as u32);
            assert!((got / want - 1.0).abs() < 2e-4, "E[S^{a} R^{}]: {got} {want}", 2 * b);
        }
        let squares = angular(&|x, y, z| 8.0 * x * y * z * (x * x + y * y + z * z));
        let want = radial(4) * squares;
        assert!((p.area_times_squared_edges() / want - 1.0).abs() < 2e-4, "{want}");
        let want = radial(1) * angular(&|x, y, z| 2.0 * (x + y + z) / 3.0);
        assert!((p.mean_edge() / want - 1.0).abs() < 2e-4, "{want}");
    }

    /// E\[R^3\] is Gamma(7/2) / pi^(3/2), and the rest is an integral over the angles and the directions.
    #[test]
    fn the_error_beside_an_edge() {
        let (n, directions) = (60, 60);
        let (h, mut sum) = (PI / f64::from(n), 0.0);
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            for third in [1.0 / 3.0, 2.0 / 3.0] {
                if third > 0.5 && i + j + 1 >= n {
                    continue;
                }
                let (a, b) = ((f64::from(i) + third) * h, (f64::from(j) + third) * h);
                let c = PI - a - b;
                let product = a.sin() * b.sin() * c.sin();
                // Corners on the unit circle, whose arcs are twice the angles.
                let corners = [0.0, 2.0 * c, 2.0 * c + 2.0 * a];
                for k in 0..directions {
                    let turn = PI * (f64::from(k) + 0.5) / f64::from(directions);
                    let mut heights = corners.map(|corner: f64| (corner - turn).cos());
                    heights.sort_by(f64::total_cmp);
                    let (whole, lower) = (heights[2] - heights[0], heights[1] - heights[0]);
                    let share = lower / whole;
                    let error = 2.0 * product * whole * (1.0 / 3.0 - share * (1.0 - share) / 6.0);
                    sum += 8.0 / (3.0 * PI) * product * h * h / 2.0 * error / f64::from(directions);
                }
            }
        }
        let want = 2.0 * gamma_of_half(7) / PI.powf(1.5) * sum;
        assert!((PoissonDelaunay { density: 4.0 }.edge_error() * 2.0 / want - 1.0).abs() < 1e-3, "{want}");
    }

    /// Two points beside one at the origin, drawn at random; with the chance that the circle is empty as
    /// the weight they are the typical triangle. Circles larger than a cell are never empty.
    #[test]
    fn few_grids_have_smaller_triangles() {
        let n = 10;
        let (mut random, mut sums) = (Random(5), [0.0; 5]);
        for _ in 0..600_000 {
            let mut point = || [1.13 * random.sample(), 1.13 * random.sample()];
            let (p, q) = (point(), point());
            let cross = p[0] * q[1] - p[1] * q[0];
            let (pp, qq) = (p[0] * p[0] + p[1] * p[1], q[0] * q[0] + q[1] * q[1]);
            let side = (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
            let r2 = pp * qq * side / (4.0 * cross * cross);
            let empty = (1.0 - PI * r2).max(0.0).powi(n - 3);
            let area = cross.abs() / 2.0;
            for (sum, term) in sums.iter_mut().zip([1.0, r2, area, area * area, area * r2]) {
                *sum += if empty > 0.0 { empty * term } else { 0.0 };
            }
        }
        let p = PoissonDelaunay { density: f64::from(n) };
        for (sum, (a, b)) in sums[1..].iter().zip([(0, 1), (1, 0), (2, 0), (1, 1)]) {
            let want = p.moment(a, b) * superposed_grids(n as usize, a + b);
            assert!((sum / sums[0] / want - 1.0).abs() < 0.03, "E[S^{a} R^{}]: {sum} {want}", 2 * b);
        }
    }
}
