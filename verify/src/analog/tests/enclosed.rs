//! The enclosed state equations against the written filter, both in balls of 512 bits.

use nalgebra::DMatrix;
use proptest::prelude::*;

use super::*;
use crate::analog::{Realisation, enclosed};
use crate::arithmetic::{Ball, ComplexBall, LongBall};

fn real(x: f64) -> ComplexBall {
    Ball::from(x).into()
}

fn complex([re, im]: [f64; 2]) -> ComplexBall {
    ComplexBall::new(Ball::from(re), Ball::from(im))
}

/// d + c (s - a)^-1 b, by elimination.
fn response_of(equations: &Realisation<LongBall>, s: ComplexBall) -> ComplexBall {
    let n = equations.order();
    let mut pencil = DMatrix::from_fn(n, n, |i, j| {
        let a = ComplexBall::from(equations.a[(i, j)]);
        if i == j { s - a } else { -a }
    });
    let mut x: Vec<ComplexBall> = equations.b.iter().map(|&b| b.into()).collect();
    for k in 0..n {
        for i in k + 1..n {
            let factor = pencil[(i, k)] / pencil[(k, k)];
            for j in k..n {
                pencil[(i, j)] = pencil[(i, j)] - factor * pencil[(k, j)];
            }
            x[i] = x[i] - factor * x[k];
        }
    }
    for k in (0..n).rev() {
        let rest = (k + 1..n).fold(x[k], |sum, j| sum - pencil[(k, j)] * x[j]);
        x[k] = rest / pencil[(k, k)];
    }
    let c = equations.c.iter().map(|&c| ComplexBall::from(c));
    c.zip(x).fold(equations.d.into(), |sum, (c, x)| sum + c * x)
}

/// num(s) / den(s), by Horner's rule.
fn quotient(num: &[f64], den: &[f64], s: ComplexBall) -> ComplexBall {
    let value = |p: &[f64]| p.iter().fold(real(0.0), |sum, &c| sum * s + real(c));
    value(num) / value(den)
}

/// Whether both balls enclose one number, to 100 digits relative to it.
fn agree(x: ComplexBall, y: ComplexBall) -> bool {
    let apart = x - y;
    let holds_zero = |part: LongBall| part.nearest().abs() <= part.radius();
    let size = y.norm_sqr().nearest().sqrt();
    holds_zero(apart.re) && holds_zero(apart.im) && apart.re.radius() + apart.im.radius() <= 1e-100 * size
}

const FREQUENCIES: [f64; 6] = [1e-6, 1e-3, 0.4, 1.0, 7.0, 1e4];

/// The filter at s = j w is the one in normalised time at j w h.
fn encloses(filter: &FilterSpec, h: f64, exact: impl Fn(ComplexBall) -> ComplexBall) {
    let equations = enclosed(None, filter, Seconds(h)).unwrap();
    for w in FREQUENCIES {
        let s = complex([0.0, w]);
        let found = response_of(&equations, s.scaled(Ball::from(h)));
        assert!(agree(found, exact(s)), "{filter:?} at {w}: {found:?} {:?}", exact(s));
    }
}

fn encloses_polynomials(num: &[f64], den: &[f64], h: f64) {
    encloses(&tf(num, den), h, |s| quotient(num, den, s));
}

#[test]
fn polynomials_with_any_roots_are_enclosed() {
    let eightfold: Vec<f64> = [1, 8, 28, 56, 70, 56, 28, 8, 1].map(f64::from).to_vec();
    encloses_polynomials(&[1.0], &eightfold, 0.3);
    // The same with one coefficient a bit off, and in a unit in which no coefficient is exact.
    let mut off = eightfold.clone();
    off[4] *= 1.0 + f64::EPSILON;
    encloses_polynomials(&[1.0, 0.5], &off, 0.3);
    let scaled: Vec<f64> = eightfold.iter().enumerate().map(|(k, c)| c * 1e5f64.powi(k as i32)).collect();
    encloses_polynomials(&[1e40], &scaled, 1e-5);
    // (s^2 + s + 4)^3 (s + 3)^2, with a double zero and one at the origin.
    let den = [1.0, 9.0, 42.0, 142.0, 345.0, 633.0, 892.0, 816.0, 576.0];
    encloses_polynomials(&[1.0, 4.0, 4.0, 0.0], &den, 1.0);
    // Poles at 1e-9, 1 and 1e9.
    encloses_polynomials(&[2.0], &[1.0, 1e9, 1e9, 1.0], 1.0);
    encloses_polynomials(&[0.25], &[1.0, 1.0, 0.25], 1e-6);
}

/// A Butterworth band-pass of twelve poles, 2 % wide: scipy.signal.butter(6, [0.99, 1.01], "bandpass",
/// analog=True).
#[test]
fn poles_that_are_close_for_their_distance_from_the_axis_are_enclosed() {
    let den = [
        1.0,
        0.07727406610312555,
        6.002385640646056,
        0.3864048264439577,
        15.008942712584222,
        0.7728055099345625,
        20.011913249604362,
        0.7727282293835691,
        15.005941074131128,
        0.3862889165877828,
        5.999985046508925,
        0.07723543679670787,
        0.9994001499800014,
    ];
    let num = [6.400000000000033e-11, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    encloses_polynomials(&num, &den, 1.0);
    // The doubles of the design are as good as doubles can be.
    let filter = realise(&tf(&num, &den), 1.0).unwrap();
    for w in [0.98, 0.99, 0.995, 1.0, 1.004, 1.0101] {
        let exact = quotient(&num, &den, complex([0.0, w]));
        let exact = Complex::new(exact.re.nearest(), exact.im.nearest());
        assert!((response(&filter, w) - exact).norm() < 1e-13, "{w}");
        assert!((realised_response(&filter, w) - exact).norm() < 1e-12, "{w}");
    }
}

#[test]
fn the_other_forms_are_enclosed() {
    // Conjugates that differ by rounding stand for their mean.
    let near = 2.0 + 2f64.powi(-40);
    let poles = [[-1.0, 2.0], [-1.0, -near], [-0.3, 0.0]];
    let mean = Ball::from(0.5) * (Ball::from(2.0) + Ball::from(near));
    encloses(&zpk(&[[-5.0, 1e-13]], &poles, 7.0), 0.3, |s| {
        let pair = ComplexBall::new(Ball::from(-1.0), mean);
        (s - real(-5.0)) / ((s - pair) * (s - pair.conj()) * (s - real(-0.3))) * real(7.0)
    });
    let state = FilterSpec::StateSpace {
        a: vec![vec![-0.3, 2.0], vec![-1.0, -0.1]],
        b: vec![vec![1.0], vec![0.5]],
        c: vec![vec![0.25, 3.0]],
    };
    let by_cramer = |s: ComplexBall| {
        let (p, q) = (s + real(0.3), s + real(0.1));
        let determinant = p * q + real(2.0);
        let (x, y) = ((q + real(1.0)) / determinant, (p.scaled(Ball::from(0.5)) - real(1.0)) / determinant);
        x.scaled(Ball::from(0.25)) + y.scaled(Ball::from(3.0))
    };
    // 0.3, 0.1 and their sums are doubles only in balls.
    encloses(&state, 0.7, by_cramer);
    let cascade = FilterSpec::Cascade { cascade: vec![state, tf(&[3.0, 1.0], &[1.0, 2.0, 2.0])] };
    encloses(&cascade, 1e-3, |s| by_cramer(s) * quotient(&[3.0, 1.0], &[1.0, 2.0, 2.0], s));
}

/// Real roots and conjugate pairs over eighteen decades, as coefficients.
fn coefficients(most: usize) -> impl Strategy<Value = Vec<f64>> {
    let factor = (-9.0..9.0f64, 0.001..1.5f64, any::<bool>()).prop_map(|(decade, angle, pair)| {
        let r = 10f64.powf(decade);
        if pair { vec![1.0, 2.0 * r * angle.sin(), r * r] } else { vec![1.0, r] }
    });
    prop::collection::vec(factor, 1..=most).prop_map(|factors| {
        factors.iter().fold(vec![1.0], |p, q| {
            let mut product = vec![0.0; p.len() + q.len() - 1];
            for (i, x) in p.iter().enumerate() {
                q.iter().enumerate().for_each(|(j, y)| product[i + j] += x * y);
            }
            product
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_polynomials_are_enclosed(num in coefficients(3), den in coefficients(6), h in 1e-3..1e3f64) {
        prop_assume!(num.len() < den.len());
        encloses_polynomials(&num, &den, h);
    }
}
