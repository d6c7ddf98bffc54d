//! Order and attenuation of elliptic filters by the degree equation, in doubles: they choose the filter of a
//! signal, and the chosen numbers stand for themselves.

use std::f64::consts::{LN_10, PI};

/// Most steps of the arithmetic-geometric mean, which converges quadratically.
const MAX_STEPS: usize = 64;

/// The shape of elliptic filters: the ripple up to the cutoff, and the stop-band edge over the cutoff.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::analog) struct Selectivity {
    /// Ripple in the pass band, decibels.
    pub(in crate::analog) ripple_db: f64,
    /// Stop-band edge over the cutoff, above 1.
    pub(in crate::analog) transition: f64,
}

impl Selectivity {
    /// The least order with an attenuation of at least `attenuation_db` from the stop-band edge on: the
    /// degree equation n = K'(k1) K(k) / (K(k1) K'(k)), k = 1 / `transition`,
    /// k1^2 = (10^(ripple/10) - 1) / (10^(attenuation/10) - 1).
    pub(in crate::analog) fn order_for(self, attenuation_db: f64) -> usize {
        let selectivity = (excess_power(self.ripple_db) / excess_power(attenuation_db)).sqrt();
        let degree = ln_nome(selectivity) / ln_nome(1.0 / self.transition);
        // The attenuation of a whole order has that order, whatever the rounding.
        (degree - 1e-9).ceil().max(1.0) as usize
    }

    /// The attenuation in decibels from the stop-band edge on of the filter of this `order`.
    pub(in crate::analog) fn attenuation_of(self, order: usize) -> f64 {
        let selectivity = modulus_of_nome(ln_nome(1.0 / self.transition) * order as f64);
        10.0 * (excess_power(self.ripple_db) / (selectivity * selectivity)).ln_1p() / LN_10
    }
}

/// 10^(db/10) - 1 without cancellation for small `db`.
fn excess_power(db: f64) -> f64 {
    (db * LN_10 / 10.0).exp_m1()
}

/// ln q = -pi K'(k) / K(k), by the arithmetic-geometric means of 1 with k and with k'.
fn ln_nome(k: f64) -> f64 {
    -PI * geometric_mean(((1.0 - k) * (1.0 + k)).sqrt()) / geometric_mean(k)
}

/// The arithmetic-geometric mean of 1 and `b`.
fn geometric_mean(mut b: f64) -> f64 {
    let mut a = 1.0;
    for _ in 0..MAX_STEPS {
        if (a - b).abs() <= f64::EPSILON * a {
            break;
        }
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    a
}

/// k for the nome e^`ln_q`. The complementary nome has ln q ln q' = pi^2.
fn modulus_of_nome(ln_q: f64) -> f64 {
    if ln_q < -PI { theta_quotient(ln_q, false) } else { theta_quotient(PI * PI / ln_q, true) }
}

/// (theta_2 / theta_3)^2, or (theta_4 / theta_3)^2 for the `complement`, for the nome e^`ln_q` <= e^-pi,
/// where five terms are beyond double precision.
fn theta_quotient(ln_q: f64, complement: bool) -> f64 {
    let term = |power: f64| (power * ln_q).exp();
    let (mut theta2, mut theta3, mut theta4) = (0.0, 0.5, 0.5);
    for j in 0..5 {
        let j = f64::from(j);
        theta2 += term((j + 0.5) * (j + 0.5));
        let next = term((j + 1.0) * (j + 1.0));
        theta3 += next;
        theta4 += if j % 2.0 == 0.0 { -next } else { next };
    }
    let quotient = if complement { theta4 } else { theta2 } / theta3;
    quotient * quotient
}
