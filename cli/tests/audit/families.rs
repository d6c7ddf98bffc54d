//! The low-pass prototypes of the filter families by their textbook formulas (Lutovac, Tosic and Evans,
//! "Filter Design for Signal Processing", 2001; Orfanidis, "Lecture Notes on Elliptic Filter Design", 2006).

use super::fronts::complement;
use super::real::{Complex, Real, double, pi, power_of_decibels, real, sqrt};
use super::roots::{expand, roots};
use serde_json::Value;

/// Zeros, poles and the gain at s = 0 (a list of one) of the member with edge 1.
pub(crate) fn prototype(filter: &Value) -> [Vec<Complex>; 3] {
    let number = |key: &str| filter[key].as_f64().unwrap_or_else(|| panic!("{key} in {filter}"));
    let order = filter.get("order").map_or(1, |order| order.as_u64().expect("an order") as usize);
    let one = vec![Complex::one()];
    match filter["family"].as_str().expect("a family") {
        "butterworth" => [vec![], (0..order).map(|k| angle(order, k)).collect(), one],
        "rc" => [vec![], vec![-&Complex::one()], one],
        "bessel" => [vec![], bessel(order), one],
        "chebyshev1" => {
            let ripple = power_of_decibels(number("ripple_db")) - real(1.0);
            let dc = if order % 2 == 1 { real(1.0) } else { real(1.0) / sqrt(&(&ripple + real(1.0))) };
            [vec![], chebyshev(order, &sqrt(&ripple)), vec![Complex::real(dc)]]
        }
        "chebyshev2" => {
            let depth = real(1.0) / sqrt(&(power_of_decibels(number("attenuation_db")) - real(1.0)));
            let poles = chebyshev(order, &depth).iter().map(Complex::inverse).collect();
            // cos of the angle is the imaginary part of a point of the circle; the middle one has no zero.
            let upper = (0..order).filter(|k| 2 * k + 1 != order).map(|k| angle(order, k).im);
            [upper.map(|y| Complex::imaginary(real(1.0) / y)).collect(), poles, one]
        }
        "elliptic" => elliptic(order, number("ripple_db"), number("attenuation_db")),
        other => panic!("{other} is no family"),
    }
}

/// Points of the unit circle in the left half-plane: j e^{j (2k+1) pi / 2n}.
fn angle(order: usize, k: usize) -> Complex {
    let phase = pi() * real((2 * k + 1) as f64) / real(2.0 * order as f64);
    &Complex::imaginary(real(1.0)) * &Complex::imaginary(phase).exp()
}

/// The circle of Butterworth's poles pressed to an ellipse with axes sinh and cosh of asinh(1 / ripple) / n.
fn chebyshev(order: usize, ripple: &Real) -> Vec<Complex> {
    let x = real(1.0) / ripple;
    let asinh = (&x + sqrt(&(&x * &x + real(1.0)))).ln() / real(order as f64);
    let (up, down) = (asinh.exp(), (-asinh).exp());
    let (sinh, cosh) = ((&up - &down) * real(0.5), (up + down) * real(0.5));
    (0..order).map(|k| angle(order, k)).map(|p| Complex::new(p.re * &sinh, p.im * &cosh)).collect()
}

/// Roots of the reverse Bessel polynomial, scaled so that their product is 1.
fn bessel(order: usize) -> Vec<Complex> {
    // a_k of s^k is (2n-k)! / (2^(n-k) k! (n-k)!); from the leading 1 each is the one before by a quotient.
    let mut polynomial = vec![Complex::one()];
    for k in (0..order).rev() {
        let (n, k) = (order as f64, k as f64);
        let quotient = real((2.0 * n - k) * (k + 1.0)) / real(2.0 * (n - k));
        let next = polynomial.last().expect("a leading one").times(&quotient);
        polynomial.push(next);
    }
    let root = (polynomial[order].re.ln() / real(order as f64)).exp();
    roots(&polynomial).iter().map(|p| p.times(&(real(1.0) / &root))).collect()
}

/// agm(1, x).
fn mean(x: &Real) -> Real {
    let (mut a, mut b) = (real(1.0), x.clone());
    for _ in 0..20 {
        (a, b) = ((&a + &b) * real(0.5), sqrt(&(&a * &b)));
    }
    a
}

/// theta_2 and theta_3 of pi x / 2 and the nome q, theta_2 over q^(1/4).
fn thetas(q: &Real, x: &Real) -> [Real; 2] {
    let step = Complex::imaginary(pi() * x * real(0.5)).exp();
    let (mut second, mut third) = (real(0.0), real(1.0));
    let mut power = real(1.0); // q^(n^2)
    let mut odd = q.clone(); // q^(2n+1)
    // Until the terms are below the last digit; q is below 0.9 for any filter of use.
    for n in 0..100i64 {
        // q^(n (n+1)) = q^(n^2) q^n.
        let between = &power * (0..n).fold(real(1.0), |product, _| product * q);
        second += real(2.0) * between * step.power(2 * n + 1).re;
        power *= &odd;
        odd = &odd * q * q;
        third += real(2.0) * &power * step.power(2 * n + 2).re;
        if double(&power) < 1e-200 {
            break;
        }
    }
    [second, third]
}

/// |H|^2 = 1 / (1 + eps^2 R^2) with R = C w^odd prod (w^2 - z^2) / (1 - k^2 z^2 w^2) and z = cd(u K, k),
/// u = 1/n, 3/n ..; k follows from the nome, q(k)^n = q(k1). The poles are the roots in the left half-plane.
fn elliptic(order: usize, ripple_db: f64, attenuation_db: f64) -> [Vec<Complex>; 3] {
    let ripple = power_of_decibels(ripple_db) - real(1.0);
    let k1 = sqrt(&(&ripple / (power_of_decibels(attenuation_db) - real(1.0))));
    // q = exp(-pi K' / K) and K(k) = pi / (2 agm(1, k')).
    let q = (-pi() * mean(&complement(&k1)) / (mean(&k1) * real(order as f64))).exp();
    let quarter = sqrt(&sqrt(&q));
    let [second, third] = thetas(&q, &real(0.0));
    let k = &quarter * &quarter * (&second / &third) * (&second / &third);
    let cd = |j: usize| {
        let [above, below] = thetas(&q, &(real((2 * j + 1) as f64) / real(order as f64)));
        &third * above / (&second * below)
    };
    let squares: Vec<Real> = (0..order / 2).map(cd).map(|z| &z * &z).collect();
    let one = real(1.0);
    // R at 1 without C; there R = 1.
    let at_one = squares.iter().fold(one.clone(), |r, z| r * (&one - z) / (&one - &k * &k * z));
    // In x = w^2: eps^2 C^2 x^odd prod (x - z^2)^2 + prod (1 - k^2 z^2 x)^2 = 0.
    let twice =
        |list: Vec<Complex>| -> Vec<Complex> { list.iter().flat_map(|x| [x.clone(), x.clone()]).collect() };
    let mut near = twice(squares.iter().cloned().map(Complex::real).collect());
    near.extend((0..order % 2).map(|_| Complex::zero()));
    let far: Vec<Real> = squares.iter().map(|z| &one / (&k * &k * z)).collect();
    let scale = squares.iter().fold(one.clone(), |product, z| product * &k * &k * z);
    let mut polynomial = expand(Complex::real(&ripple / (&at_one * &at_one)), &near);
    let below =
        expand(Complex::real(&scale * &scale), &twice(far.iter().cloned().map(Complex::real).collect()));
    let shift = polynomial.len() - below.len();
    below.iter().enumerate().for_each(|(j, x)| polynomial[j + shift] = &polynomial[j + shift] + x);
    let poles: Vec<Complex> = roots(&polynomial).iter().map(|x| -&(-x).sqrt()).collect();
    let zeros = far.iter().flat_map(|x| [sqrt(x), -sqrt(x)]).map(Complex::imaginary).collect();
    let dc = if order % 2 == 1 { one } else { one.clone() / sqrt(&(ripple + one)) };
    [zeros, poles, vec![Complex::real(dc)]]
}
