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

/// A planar Poisson process, whose points are triangulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoissonDelaunay {
    /// Points per unit area.
    pub(crate) density: f64,
}

impl PoissonDelaunay {
    /// E\[S^a R^{2b}\] of the typical triangle, S its area and R its circumradius.
    ///
    /// E\[R^2\] = 2 / (pi lambda), E\[S\] = 1 / (2 lambda), E\[S^2\] = 35 / (8 pi^2 lambda^2),
    /// E\[S R^2\] = 3 / (2 pi lambda^2) (thesis Table 4.1).
    pub(crate) fn moment(&self, a: u32, b: u32) -> f64 {
        let scale = (PI * self.density).powi((a + b) as i32);
        2.0_f64.powi(a as i32) * gamma_of_half(2 * (a + b) + 4) / scale * sines(a)
    }

    /// E\[S sum l^2\], l the three edges: 12 / (pi lambda^2).
    ///
    /// The sum of squares is 4 R^2 (sin^2 A + sin^2 B + sin^2 C) and the area-weighted mean of the sum of
    /// the sin^2 is 2, as an integration over the uniform angles shows.
    pub(crate) fn area_times_squared_edges(&self) -> f64 {
        8.0 * self.moment(1, 1)
    }

    /// Mean over the plane of the squared circumradius: 3 / (pi lambda).
    pub(crate) fn mean_squared_radius(&self) -> f64 {
        self.moment(1, 1) / self.moment(1, 0)
    }

    /// Mean over the plane of the error of linear interpolation of f = |x|^2 / 2, sum l^2 / 24 over the
    /// edges of a triangle: 1 / (pi lambda).
    pub(crate) fn mean_quadratic_error(&self) -> f64 {
        self.area_times_squared_edges() / self.moment(1, 0) / 24.0
    }
}

/// Factor of E\[S^a R^{2b}\] for N shifted copies of one grid instead of a Poisson process, `order` the sum
/// of a and b: prod_{j<order} N / (N + j), the same as that of intervals on the line.
///
/// A cell of the grid is a torus with N independent uniform points. Three of them are a triangle if the
/// circle through them is empty, with probability (1 - pi R^2 / cell)^{N-3} instead of exp(-pi lambda R^2),
/// so pi R^2 / cell is a beta variable of the shapes 2 and N - 2. Circles wider than the cell are neglected.
pub(crate) fn superposed_grids(grids: usize, order: u32) -> f64 {
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
