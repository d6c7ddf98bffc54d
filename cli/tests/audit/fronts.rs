//! Front ends as written in a bank file: a numerator and the poles, s in radians per fast period.

use super::families::prototype;
use super::real::{Complex, Real, pi, real, sqrt};
use super::roots::{expand, roots, value};
use serde_json::Value;

/// Poles closer than this share of their size become as far apart as this. The response changes by the same
/// share times the number of poles that coincide. The residues of m of them cancel over 1e40^(m-1), so 72
/// digits of the 192 are left for m = 4.
pub(crate) const SPLIT: f64 = 1e-40;

/// N(s) / prod(s - p).
#[derive(Debug, Clone)]
pub(crate) struct Front {
    /// Descending powers.
    pub(crate) numerator: Vec<Complex>,
    pub(crate) poles: Vec<Complex>,
}

/// The numbers of a list in a file.
pub(crate) fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn pairs(list: &Value) -> Vec<Complex> {
    let list = list.as_array().expect("a list of pairs").iter().map(numbers);
    list.map(|pair| Complex::new(real(pair[0]), real(pair[1]))).collect()
}

fn power(x: &Real, n: usize) -> Real {
    (0..n).fold(real(1.0), |product, _| product * x)
}

impl Front {
    /// The filter of a file whose fast period is `h` seconds.
    pub(crate) fn read(filter: &Value, h: &Real) -> Self {
        let per_second = if let Some(stages) = filter.get("cascade") {
            let stages = stages.as_array().expect("stages").iter().map(|stage| Self::read(stage, h));
            return stages.reduce(|whole, stage| whole.then(&stage)).expect("a stage");
        } else if let Some(num) = filter.get("num") {
            return Self::of_coefficients(&numbers(num), &numbers(&filter["den"]), h);
        } else if let Some(gain) = filter.get("gain") {
            let gain = Complex::real(real(gain.as_f64().expect("a gain")));
            Self { numerator: expand(gain, &pairs(&filter["zeros"])), poles: pairs(&filter["poles"]) }
        } else if filter.get("a").is_some() {
            return Self::of_states(filter, h);
        } else {
            Self::of_family(filter)
        };
        per_second.scaled(h)
    }

    fn of_coefficients(num: &[f64], den: &[f64], h: &Real) -> Self {
        let skip = |list: &[f64]| list.iter().position(|x| *x != 0.0).expect("a polynomial");
        let (num, den) = (&num[skip(num)..], &den[skip(den)..]);
        let over = real(1.0) / real(den[0]);
        let excess = den.len() - num.len();
        let of = |list: &[f64], more: usize| -> Vec<Complex> {
            let times = |(k, x): (usize, &f64)| Complex::real(real(*x) * &over * power(h, k + more));
            list.iter().enumerate().map(times).collect()
        };
        Self { numerator: of(num, excess), poles: roots(&of(den, 0)) }
    }

    /// By the recursion of Faddeev and Le Verrier: (sI - A)^-1 = sum_k s^(n-1-k) B_k / det(sI - A), with
    /// B_0 = I, c_k = -tr(A B_(k-1)) / k and B_k = A B_(k-1) + c_k I.
    fn of_states(filter: &Value, h: &Real) -> Self {
        let matrix = |key: &str| -> Vec<Vec<Real>> {
            let rows = filter[key].as_array().expect("rows").iter().map(numbers);
            rows.map(|row| row.into_iter().map(real).collect()).collect()
        };
        let (a, b, c) = (matrix("a"), matrix("b"), matrix("c"));
        let n = a.len();
        let mut adjugate: Vec<Vec<Real>> =
            (0..n).map(|i| (0..n).map(|j| real(f64::from(u8::from(i == j)))).collect()).collect();
        let (mut num, mut den) = (Vec::new(), vec![Complex::one()]);
        for k in 1..=n {
            let term = |i: usize| (0..n).fold(real(0.0), |sum, j| sum + &adjugate[i][j] * &b[j][0]);
            num.push(Complex::real((0..n).fold(real(0.0), |sum, i| sum + &c[0][i] * term(i)) * power(h, k)));
            let entry =
                |i: usize, j: usize| (0..n).fold(real(0.0), |sum, l| sum + &a[i][l] * &adjugate[l][j]);
            let mut next: Vec<Vec<Real>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
            let trace = (0..n).fold(real(0.0), |sum, i| sum + &next[i][i]);
            let coefficient = -trace / real(k as f64);
            (0..n).for_each(|i| next[i][i] += &coefficient);
            den.push(Complex::real(coefficient * power(h, k)));
            adjugate = next;
        }
        Self { numerator: num, poles: roots(&den) }
    }

    /// Radians per second. A band-pass has s replaced by (s^2 + w1 w2) / (s (w2 - w1)), a low-pass by s / w.
    fn of_family(filter: &Value) -> Self {
        let omega = |x: f64| real(x) * real(2.0) * pi();
        let [mut zeros, mut poles, dc] = prototype(filter);
        let negative = |list: &[Complex]| list.iter().fold(Complex::one(), |product, x| &product * &-x);
        let mut gain = &dc[0] * &negative(&poles).over(&negative(&zeros));
        let excess = poles.len() - zeros.len();
        let scale = if let Some(cutoff) = filter.get("cutoff") {
            omega(cutoff.as_f64().expect("a cutoff"))
        } else {
            let edges: Vec<Real> = numbers(&filter["band"]).into_iter().map(omega).collect();
            let (width, centre) = (&edges[1] - &edges[0], &edges[0] * &edges[1]);
            let unit = &centre / (&width * &width);
            let pass = |list: &[Complex]| -> Vec<Complex> {
                let both = |x: &Complex| {
                    let half = x.times(&real(0.5));
                    let root = (&(&half * &half) - &Complex::real(unit.clone())).sqrt();
                    [&half + &root, &half - &root]
                };
                list.iter().flat_map(both).collect()
            };
            (zeros, poles) = (pass(&zeros), pass(&poles));
            zeros.extend((0..excess).map(|_| Complex::zero()));
            width
        };
        let times = |list: Vec<Complex>| list.into_iter().map(|x| x.times(&scale)).collect::<Vec<_>>();
        gain = gain.times(&power(&scale, excess));
        Self { numerator: expand(gain, &times(zeros)), poles: times(poles) }
    }

    /// G(s / factor): all frequencies times `factor`.
    pub(crate) fn scaled(&self, factor: &Real) -> Self {
        let least = self.poles.len() + 1 - self.numerator.len();
        let numerator = self.numerator.iter().enumerate().map(|(k, x)| x.times(&power(factor, k + least)));
        Self { numerator: numerator.collect(), poles: self.poles.iter().map(|p| p.times(factor)).collect() }
    }

    /// Both in series.
    pub(crate) fn then(&self, other: &Self) -> Self {
        let mut numerator = vec![Complex::zero(); self.numerator.len() + other.numerator.len() - 1];
        for (i, x) in self.numerator.iter().enumerate() {
            for (j, y) in other.numerator.iter().enumerate() {
                numerator[i + j] = &numerator[i + j] + &(x * y);
            }
        }
        Self { numerator, poles: [&self.poles[..], &other.poles].concat() }
    }

    /// With poles that are apart by [`SPLIT`] at least. Both of a conjugate pair move alike.
    pub(crate) fn split(mut self) -> Self {
        for k in 1..self.poles.len() {
            let near = |p: &Complex, q: &Complex| (p - q).size() < SPLIT * p.size();
            let equals = (0..k).filter(|j| near(&self.poles[k], &self.poles[*j])).count();
            assert!(equals < 4, "more poles coincide than the precision allows");
            // Again and again, since a pole may move next to another one that was moved.
            while (0..k).any(|j| near(&self.poles[k], &self.poles[j])) {
                self.poles[k] = self.poles[k].times(&(real(1.0) + real(1.5 * SPLIT)));
            }
        }
        self
    }

    pub(crate) fn at(&self, s: &Complex) -> Complex {
        let below = self.poles.iter().fold(Complex::one(), |product, pole| &product * &(s - pole));
        value(&self.numerator, s).over(&below)
    }

    /// The residue at each pole, all of which are simple.
    pub(crate) fn residues(&self) -> Vec<Complex> {
        let others = |k: usize| {
            let others = self.poles.iter().enumerate().filter(move |(j, _)| *j != k);
            others.fold(Complex::one(), |product, (_, pole)| &product * &(&self.poles[k] - pole))
        };
        (0..self.poles.len()).map(|k| value(&self.numerator, &self.poles[k]).over(&others(k))).collect()
    }

    /// The zeros.
    pub(crate) fn zeros(&self) -> Vec<Complex> {
        let at_zero = self.numerator.iter().rev().take_while(|x| x.is_zero()).count();
        let rest = &self.numerator[..self.numerator.len() - at_zero];
        let mut zeros = if rest.len() > 1 { roots(rest) } else { Vec::new() };
        zeros.extend((0..at_zero).map(|_| Complex::zero()));
        zeros
    }
}

/// sqrt(1 - x^2).
pub(crate) fn complement(x: &Real) -> Real {
    sqrt(&((real(1.0) - x) * (real(1.0) + x)))
}
