//! Elliptic integrals and Jacobi functions of real argument. Modulus k and complementary modulus k' are
//! stored together, so that no digits are lost for k near 0 or near 1.
//!
//! Sources: Abramowitz and Stegun, chapters 16 and 17; Carlson, "Numerical computation of real or
//! complex elliptic integrals", Numerical Algorithms 10 (1995).

use std::f64::consts::{FRAC_PI_2, PI};

/// Most steps of an iteration that converges quadratically (AGM) or by a factor of 4 per step (Carlson).
const MAX_STEPS: usize = 64;

/// A modulus with its complement, k^2 + k'^2 = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Modulus {
    pub(super) k: f64,
    pub(super) complement: f64,
}

/// sn, cn and dn of one argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jacobi {
    pub(super) sn: f64,
    pub(super) cn: f64,
    pub(super) dn: f64,
}

impl Modulus {
    /// The modulus with the given `k`, 0 < k < 1.
    pub(super) fn new(k: f64) -> Self {
        Self { k, complement: ((1.0 - k) * (1.0 + k)).sqrt() }
    }

    /// k and k' exchanged.
    pub(super) fn swapped(self) -> Self {
        Self { k: self.complement, complement: self.k }
    }

    /// Complete elliptic integral of the first kind K(k), by the arithmetic-geometric mean.
    pub(super) fn quarter_period(self) -> f64 {
        let (mut a, mut b) = (1.0, self.complement);
        for _ in 0..MAX_STEPS {
            if (a - b).abs() <= f64::EPSILON * a {
                break;
            }
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        FRAC_PI_2 / a
    }

    /// Incomplete integral F(phi, k) for tan(phi) = `tangent` >= 0, as Carlson's R_F.
    pub(super) fn first_kind(self, tangent: f64) -> f64 {
        // cos^2, 1 - k^2 sin^2 = cos^2 + k'^2 sin^2, and 1, all over sin^2.
        let cot2 = 1.0 / (tangent * tangent);
        carlson_rf(cot2, cot2 + self.complement * self.complement, cot2 + 1.0)
    }

    /// The modulus whose nome is the `n`-th root of this one's: the degree equation of elliptic filters,
    /// n K'(k1)/K(k1) = ... solved by theta series.
    pub(super) fn with_nome_root(self, n: usize) -> Self {
        Self::of_nome(self.ln_nome() / n as f64)
    }

    /// The modulus whose nome is the `n`-th power of this one's.
    pub(super) fn with_nome_power(self, n: usize) -> Self {
        Self::of_nome(self.ln_nome() * n as f64)
    }

    /// ln q = -pi K'/K.
    pub(super) fn ln_nome(self) -> f64 {
        -PI * self.swapped().quarter_period() / self.quarter_period()
    }

    /// The complementary nome has ln q ln q' = pi^2.
    fn of_nome(ln_q: f64) -> Self {
        if ln_q < -PI { theta_modulus(ln_q) } else { theta_modulus(PI * PI / ln_q).swapped() }
    }

    /// sn, cn, dn at `u`, by descending Landen transformations.
    pub(super) fn functions(self, u: f64) -> Jacobi {
        let mut levels = Vec::with_capacity(8);
        let (mut a, mut b, mut c) = (1.0, self.complement, self.k);
        while levels.len() < MAX_STEPS && c.abs() > f64::EPSILON * a {
            (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
            levels.push((a, c));
        }
        let mut phi = levels.iter().fold(a * u, |phi, _| 2.0 * phi);
        for (a, c) in levels.into_iter().rev() {
            phi = 0.5 * (phi + (c / a * phi.sin()).asin());
        }
        let (sn, cn) = phi.sin_cos();
        Jacobi { sn, cn, dn: self.complement.hypot(self.k * cn) }
    }
}

/// Carlson's R_F(x, y, z): duplication until the arguments agree, then a series of fifth order.
fn carlson_rf(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    for _ in 0..MAX_STEPS {
        let mean = (x + y + z) / 3.0;
        let (dx, dy, dz) = ((mean - x) / mean, (mean - y) / mean, (mean - z) / mean);
        // The remainder of the series is of sixth order: 1e-3 leaves it below 1e-18.
        if dx.abs().max(dy.abs()).max(dz.abs()) < 1e-3 {
            let (e2, e3) = (dx * dy - dz * dz, dx * dy * dz);
            return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / mean.sqrt();
        }
        let lambda = (x * y).sqrt() + (y * z).sqrt() + (z * x).sqrt();
        (x, y, z) = (0.25 * (x + lambda), 0.25 * (y + lambda), 0.25 * (z + lambda));
    }
    1.0 / ((x + y + z) / 3.0).sqrt()
}

/// k = (theta_2 / theta_3)^2 and k' = (theta_4 / theta_3)^2 for the nome e^`ln_q` <= e^-pi, where five
/// terms are beyond double precision.
fn theta_modulus(ln_q: f64) -> Modulus {
    let term = |power: f64| (power * ln_q).exp();
    let (mut theta2, mut theta3, mut theta4) = (0.0, 0.5, 0.5);
    for j in 0..5 {
        let j = f64::from(j);
        theta2 += term((j + 0.5) * (j + 0.5));
        let next = term((j + 1.0) * (j + 1.0));
        theta3 += next;
        theta4 += if j % 2.0 == 0.0 { -next } else { next };
    }
    let squared_ratio = |x: f64| (x / theta3) * (x / theta3);
    Modulus { k: squared_ratio(theta2), complement: squared_ratio(theta4) }
}
