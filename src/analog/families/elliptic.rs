//! Elliptic (Cauer) filters in closed form.
//!
//! Source: Orfanidis, "Lecture notes on elliptic filter design" (2006), equations for zeros and poles;
//! the degree equation by nomes as in Lutovac, Tosic and Evans, "Filter design for signal processing"
//! (2001).

use super::jacobi::Modulus;
use super::{excess_power, product_of_negatives};
use crate::analog::{Cutoffs, Zpk};
use crate::linalg::Complex;

/// Elliptic: ripple of `ripple_db` up to the cutoff, attenuation of at least `attenuation_db` (>
/// `ripple_db` > 0) beyond the stop-band edge, which follows from order and ripples. An even order has as
/// many zeros as poles.
pub fn elliptic(order: usize, ripple_db: f64, attenuation_db: f64) -> Zpk<Cutoffs> {
    let ripple = excess_power(ripple_db);
    if order == 1 {
        let p = 1.0 / ripple.sqrt();
        return Zpk::new(Vec::new(), vec![Complex::new(-p, 0.0)], p);
    }
    let selectivity = Modulus::new((ripple / excess_power(attenuation_db)).sqrt());
    let modulus = selectivity.with_nome_root(order);
    let quarter = modulus.quarter_period();
    // At j v0 the square of the elliptic rational function is -1/ripple.
    let v0 = quarter * selectivity.swapped().first_kind(1.0 / ripple.sqrt())
        / (order as f64 * selectivity.quarter_period());
    let v = modulus.swapped().functions(v0);

    let (mut zeros, mut poles) = (Vec::new(), Vec::new());
    for j in ((1 - order % 2)..order).step_by(2) {
        let u = modulus.functions(quarter * j as f64 / order as f64);
        let denominator = v.cn * v.cn + (modulus.k * u.sn * v.sn) * (modulus.k * u.sn * v.sn);
        let pole = Complex::new(-u.cn * u.dn * v.sn * v.cn, u.sn * v.dn) / denominator;
        if j == 0 {
            poles.push(Complex::new(pole.re, 0.0));
            continue;
        }
        let zero = Complex::new(0.0, 1.0 / (modulus.k * u.sn));
        zeros.extend([zero, zero.conj()]);
        poles.extend([pole, pole.conj()]);
    }
    let dc = if order.is_multiple_of(2) { 1.0 / (1.0 + ripple).sqrt() } else { 1.0 };
    let gain = dc * product_of_negatives(&poles) / product_of_negatives(&zeros);
    Zpk::new(zeros, poles, gain)
}

/// The shape of elliptic filters: the ripple up to the cutoff, and the stop-band edge over the cutoff.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Selectivity {
    /// Ripple in the pass band, decibels.
    pub ripple_db: f64,
    /// Stop-band edge over the cutoff, above 1.
    pub transition: f64,
}

impl Selectivity {
    /// The least order with an attenuation of at least `attenuation_db` from the stop-band edge on: the
    /// degree equation n = K'(k1) K(k) / (K(k1) K'(k)), k = 1 / `transition`,
    /// k1^2 = (10^(ripple/10) - 1) / (10^(attenuation/10) - 1).
    pub fn order_for(self, attenuation_db: f64) -> usize {
        let selectivity = Modulus::new((excess_power(self.ripple_db) / excess_power(attenuation_db)).sqrt());
        let degree = selectivity.ln_nome() / self.modulus().ln_nome();
        // The attenuation of a whole order has that order, whatever the rounding.
        (degree - 1e-9).ceil().max(1.0) as usize
    }

    /// The attenuation in decibels from the stop-band edge on of the filter of this `order`.
    pub fn attenuation_of(self, order: usize) -> f64 {
        let selectivity = self.modulus().with_nome_power(order).k;
        10.0 * (excess_power(self.ripple_db) / (selectivity * selectivity)).ln_1p() / std::f64::consts::LN_10
    }

    fn modulus(self) -> Modulus {
        Modulus::new(1.0 / self.transition)
    }
}
