//! Sampled hybrid filter banks for tests and benchmarks: realistic, ill-conditioned data with known
//! optima. All channels share one analog filter; the fast period is 1. Uses nalgebra alone, so that
//! it checks the solver without sharing its linear algebra.

#![allow(unreachable_pub, dead_code)]

use nalgebra::{Complex, DMatrix};

type Mat = DMatrix<f64>;
type CMat = DMatrix<Complex<f64>>;

/// A bank with one analog filter (a, b, c) for all channels.
pub struct TestBank {
    /// State matrix of the analog filter.
    pub a: Mat,
    /// Its input column.
    pub b: Mat,
    /// Its output row.
    pub c: Mat,
    /// Delays of the channels in fast periods.
    pub delays: Vec<f64>,
    /// Fast samples per slow period.
    pub ratio: usize,
    /// Latency in fast samples.
    pub latency: usize,
}

/// Companion form of 1 / (descending coefficients, leading 1) with unit gain at zero.
pub fn low_pass(den: &[f64]) -> (Mat, Mat, Mat) {
    let n = den.len() - 1;
    let mut a = Mat::zeros(n, n);
    for i in 0..n {
        a[(0, i)] = -den[i + 1];
        if i > 0 {
            a[(i, i - 1)] = 1.0;
        }
    }
    let mut b = Mat::zeros(n, 1);
    b[0] = 1.0;
    let mut c = Mat::zeros(1, n);
    c[n - 1] = den[n];
    (a, b, c)
}

/// Denominator of a Butterworth filter of even order.
pub fn butterworth(order: usize, cutoff: f64) -> Vec<f64> {
    let mut den = vec![1.0];
    for k in 0..order / 2 {
        let angle = std::f64::consts::PI * (2 * k + 1) as f64 / (2 * order) as f64;
        let factor = [1.0, 2.0 * angle.sin() * cutoff, cutoff * cutoff];
        let mut next = vec![0.0; den.len() + 2];
        for (i, d) in den.iter().enumerate() {
            for (j, f) in factor.iter().enumerate() {
                next[i + j] += d * f;
            }
        }
        den = next;
    }
    den
}

impl TestBank {
    /// Fast system (Ad, Bd, rows of outputs: target, channels), delays split off as integers.
    pub fn fast(&self) -> (Mat, Mat, Mat, Vec<usize>) {
        let n = self.a.nrows();
        let whole: Vec<usize> = self.delays.iter().map(|d| d.floor() as usize).collect();
        let part: Vec<f64> = self.delays.iter().map(|d| d - d.floor()).collect();
        let extra: Vec<usize> = (0..part.len()).filter(|&i| part[i] > 0.0).collect();
        let order = n + extra.len();
        let mut ad = Mat::zeros(order, order);
        ad.view_mut((0, 0), (n, n)).copy_from(&self.a.exp());
        let mut outputs = Mat::zeros(1 + part.len(), order);
        outputs.view_mut((0, 0), (1, n)).copy_from(&self.c);
        let mut rows = vec![(Mat::identity(n, n), 0.0)];
        for (i, d) in part.iter().enumerate() {
            if let Some(e) = extra.iter().position(|&x| x == i) {
                let row = &self.c * (&self.a * (1.0 - d)).exp();
                ad.view_mut((n + e, 0), (1, n)).copy_from(&row);
                outputs[(1 + i, n + e)] = 1.0;
                rows.push((self.c.clone(), *d));
            } else {
                outputs.view_mut((1 + i, 0), (1, n)).copy_from(&self.c);
            }
        }
        let gram = self.input_gram(&rows);
        let e = gram.symmetric_eigen();
        let root = Mat::from_diagonal(&e.eigenvalues.map(|v| v.max(0.0).sqrt()));
        (ad, e.eigenvectors * root, outputs, whole)
    }

    /// The blocked system `(A, B, C_w, D_w, C_h, D_h)`: all delays as states, M fast periods a step.
    pub fn blocked(&self) -> [Mat; 6] {
        let (ad, bd, outputs, whole) = self.fast();
        let (core, inputs, m, channels) = (ad.nrows(), bd.ncols(), self.ratio, self.delays.len());
        let chains: Vec<usize> = std::iter::once(self.latency).chain(whole).collect();
        let order = core + chains.iter().sum::<usize>();
        let (mut a, mut b) = (Mat::zeros(order, order), Mat::zeros(order, inputs));
        let mut c = Mat::zeros(1 + channels, order);
        a.view_mut((0, 0), (core, core)).copy_from(&ad);
        b.view_mut((0, 0), (core, inputs)).copy_from(&bd);
        let mut first = core;
        for (i, length) in chains.iter().enumerate() {
            let row = outputs.row(i).into_owned();
            if *length == 0 {
                c.view_mut((i, 0), (1, core)).copy_from(&row);
                continue;
            }
            a.view_mut((first, 0), (1, core)).copy_from(&row);
            (1..*length).for_each(|k| a[(first + k, first + k - 1)] = 1.0);
            c[(i, first + length - 1)] = 1.0;
            first += length;
        }
        let powers: Vec<Mat> = (0..m).map(|k| a.pow(k as u32)).collect();
        let mut big_b = Mat::zeros(order, m * inputs);
        let (mut cw, mut dw) = (Mat::zeros(m, order), Mat::zeros(m, m * inputs));
        for k in 0..m {
            big_b.view_mut((0, k * inputs), (order, inputs)).copy_from(&(&powers[m - 1 - k] * &b));
            cw.row_mut(k).copy_from(&(c.row(0) * &powers[k]));
            for j in 0..k {
                let markov = c.row(0) * &powers[k - 1 - j] * &b;
                dw.view_mut((k, j * inputs), (1, inputs)).copy_from(&markov);
            }
        }
        let ch = c.rows(1, channels).into_owned();
        [a.pow(m as u32), big_b, cw, dw, ch, Mat::zeros(channels, m * inputs)]
    }

    /// Gram matrix of the one-period input operators.
    fn input_gram(&self, rows: &[(Mat, f64)]) -> Mat {
        let order: usize = rows.iter().map(|(c, _)| c.nrows()).sum();
        let mut gram = Mat::zeros(order, order);
        let mut first = 0;
        for (ca, da) in rows {
            let mut second = 0;
            for (cb, db) in rows {
                let dm = da.max(*db);
                let block = ca
                    * (&self.a * (dm - da)).exp()
                    * self.gramian(1.0 - dm)
                    * (self.a.transpose() * (dm - db)).exp()
                    * cb.transpose();
                gram.view_mut((first, second), block.shape()).copy_from(&block);
                second += cb.nrows();
            }
            first += ca.nrows();
        }
        (&gram + gram.transpose()) * 0.5
    }

    /// `int_0^t e^{As} b b' e^{A's} ds` by Van Loan's block exponential.
    fn gramian(&self, t: f64) -> Mat {
        let n = self.a.nrows();
        let mut big = Mat::zeros(2 * n, 2 * n);
        big.view_mut((0, 0), (n, n)).copy_from(&-&self.a);
        big.view_mut((0, n), (n, n)).copy_from(&(&self.b * self.b.transpose()));
        big.view_mut((n, n), (n, n)).copy_from(&self.a.transpose());
        let e = (big * t).exp();
        e.view((n, n), (n, n)).transpose() * e.view((0, n), (n, n))
    }

    /// `(omega, W, H)` of the blocked system at each of the slow frequencies. The inputs are the aliases
    /// of the fast frequency axis, a unitary change from the blocked inputs.
    pub fn samples(&self, omegas: &[f64]) -> Vec<(f64, CMat, CMat)> {
        let (ad, bd, outputs, whole) = self.fast();
        let (ad, bd, outputs) = (complex(&ad), complex(&bd), complex(&outputs));
        let (order, inputs) = bd.shape();
        let (m, n) = (self.ratio, self.delays.len());
        let at = |omega: f64| {
            let mut w = CMat::zeros(m, m * inputs);
            let mut h = CMat::zeros(n, m * inputs);
            for alias in 0..m {
                let theta = (omega + std::f64::consts::TAU * alias as f64) / m as f64;
                let shift = |k: f64| Complex::from_polar(1.0 / (m as f64).sqrt(), theta * k);
                let resolvent = CMat::identity(order, order) * Complex::from_polar(1.0, theta) - &ad;
                let v = &outputs * resolvent.lu().solve(&bd).expect("no pole on the circle");
                for c in 0..inputs {
                    for p in 0..m {
                        w[(p, alias * inputs + c)] = v[(0, c)] * shift(p as f64 - self.latency as f64);
                    }
                    for i in 0..n {
                        h[(i, alias * inputs + c)] = v[(1 + i, c)] * shift(-(whole[i] as f64));
                    }
                }
            }
            (omega, w, h)
        };
        omegas.iter().map(|omega| at(*omega)).collect()
    }

    /// Numbers of lags of the M phases of filters with `taps` taps.
    pub fn lags(&self, taps: usize) -> Vec<usize> {
        (0..self.ratio).map(|p| (taps + self.ratio - 1 - p) / self.ratio).collect()
    }
}

fn complex(m: &Mat) -> CMat {
    m.map(|x| Complex::new(x, 0.0))
}

/// The thesis example: two channels, delays 1.2 and 0.6, double pole at 0.5 rad/s.
pub fn thesis() -> TestBank {
    let (a, b, c) = low_pass(&[1.0, 1.0, 0.25]);
    TestBank { a, b, c, delays: vec![1.2, 0.6], ratio: 2, latency: 10 }
}

/// Eight channels, each after a Butterworth filter of order 4.
pub fn eight_channels(latency: usize) -> TestBank {
    let (a, b, c) = low_pass(&butterworth(4, 1.8));
    let delays = vec![0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    TestBank { a, b, c, delays, ratio: 8, latency }
}

/// `count` frequencies from 0 to pi, both ends included.
pub fn grid(count: usize) -> Vec<f64> {
    (0..count).map(|l| std::f64::consts::PI * l as f64 / (count - 1).max(1) as f64).collect()
}
