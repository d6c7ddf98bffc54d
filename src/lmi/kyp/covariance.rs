//! The dual's free parameters: `Zxu, Zuu, Zyx, Zyu, Zyy`; Zxx follows from the Lyapunov equality, one A with
//! many right-hand sides.

use crate::linalg::{self, Mat};

/// Powers `A^(2^k)` until they vanish: 2^60 steps of any stable system are a steady state.
const MAX_POWERS: usize = 60;
/// Norm of a power below which it has no effect on a sum in double precision: it enters squared.
const VANISHED: f64 = 1e-9;

/// Squared Smith iteration with its powers computed once.
#[derive(Debug, Clone)]
pub(super) struct Lyapunov {
    powers: Vec<Mat>,
}

impl Lyapunov {
    pub(super) fn new(a: &Mat) -> Self {
        let mut powers = vec![a.clone()];
        while powers.len() < MAX_POWERS {
            let last = &powers[powers.len() - 1];
            if last.norm() < VANISHED {
                break;
            }
            powers.push(last * last);
        }
        Self { powers }
    }

    /// X with `X - A X A' = q`.
    pub(super) fn forward(&self, q: &Mat) -> Mat {
        self.powers.iter().fold(q.clone(), |x, a| linalg::symmetric_part(&(a * &x * a.transpose())) + x)
    }

    /// P with `P - A' P A = q`.
    pub(super) fn adjoint(&self, q: &Mat) -> Mat {
        self.powers.iter().fold(q.clone(), |x, a| linalg::symmetric_part(&(a.tr_mul(&x) * a)) + x)
    }
}

/// Columns of the Newton matrix formed at a time.
const CHUNK: usize = 64;

/// The linear map from the free parameters to full covariances Z of order n + m + p.
#[derive(Debug, Clone)]
pub(super) struct Covariance {
    a: Mat,
    b: Mat,
    lyapunov: Lyapunov,
    pub(super) n: usize,
    pub(super) m: usize,
    pub(super) p: usize,
    /// (row, column) of each parameter in Z, row >= column within symmetric blocks; the `moving` first ones
    /// move Zxx.
    units: Vec<(usize, usize)>,
    moving: usize,
    /// Zxx of each moving parameter, as columns of scaled lower triangles.
    states: Mat,
}

impl Covariance {
    pub(super) fn new(a: &Mat, b: &Mat, p: usize) -> Self {
        let (n, m) = (a.nrows(), b.ncols());
        let mut units = Vec::new();
        (0..m).for_each(|j| (0..n).for_each(|i| units.push((n + j, i))));
        (0..m).for_each(|j| (j..m).for_each(|i| units.push((n + i, n + j))));
        let moving = units.len();
        (0..n + m).for_each(|j| (0..p).for_each(|i| units.push((n + m + i, j))));
        (0..p).for_each(|j| (j..p).for_each(|i| units.push((n + m + i, n + m + j))));
        let states = Mat::zeros(n * (n + 1) / 2, moving);
        let lyapunov = Lyapunov::new(a);
        let mut map = Self { a: a.clone(), b: b.clone(), lyapunov, n, m, p, units, moving, states };
        for k in 0..moving {
            let mut unit = vec![0.0; map.units.len()];
            unit[k] = 1.0;
            let z = map.expand(&unit);
            pack(&z, n, map.states.column_mut(k).as_mut_slice());
        }
        map
    }

    /// Order of Z.
    pub(super) fn order(&self) -> usize {
        self.n + self.m + self.p
    }

    /// Number of free parameters.
    pub(super) fn len(&self) -> usize {
        self.units.len()
    }

    pub(super) fn lyapunov(&self) -> &Lyapunov {
        &self.lyapunov
    }

    /// Z of the parameters.
    pub(super) fn expand(&self, w: &[f64]) -> Mat {
        let mut z = Mat::zeros(self.order(), self.order());
        for (&(r, c), v) in self.units.iter().zip(w) {
            z[(r, c)] = *v;
            z[(c, r)] = *v;
        }
        let (n, m) = (self.n, self.m);
        let cross = &self.a * z.view((0, n), (n, m)) * self.b.transpose();
        let drive = &cross + cross.transpose() + &self.b * z.view((n, n), (m, m)) * self.b.transpose();
        z.view_mut((0, 0), (n, n)).copy_from(&self.lyapunov.forward(&linalg::symmetric_part(&drive)));
        z
    }

    /// The parameters of a Z.
    pub(super) fn parameters(&self, z: &Mat) -> Vec<f64> {
        self.units.iter().map(|&(r, c)| z[(r, c)]).collect()
    }

    /// The adjoint of [`Covariance::expand`]: `<Z_k, Y>` for every parameter k, Y symmetric.
    pub(super) fn adjoint(&self, y: &Mat) -> Vec<f64> {
        let (n, m) = (self.n, self.m);
        let p = self.lyapunov.adjoint(&y.view((0, 0), (n, n)).into_owned());
        let pb = &p * &self.b;
        let (xu, uu) = (self.a.tr_mul(&pb), self.b.tr_mul(&pb));
        let through = |k: usize, (r, c): (usize, usize)| match (k < self.moving, c < n) {
            (true, true) => xu[(c, r - n)],
            (true, false) => uu[(r - n, c - n)],
            _ => 0.0,
        };
        assert_eq!(uu.shape(), (m, m));
        let value =
            |(k, &(r, c)): (usize, &(usize, usize))| multiplicity(r, c) * (y[(r, c)] + through(k, (r, c)));
        self.units.iter().enumerate().map(value).collect()
    }

    /// [`Covariance::adjoint`] for a Y that is zero where the states meet: nothing runs through Zxx.
    pub(super) fn adjoint_of_outputs(&self, y: &Mat) -> Vec<f64> {
        self.units.iter().map(|&(r, c)| multiplicity(r, c) * y[(r, c)]).collect()
    }

    /// `H_jk = <Z_j, sym(X Z_k S)>` (lower triangle), X the inverse of Z.
    pub(super) fn newton(&self, x: &Mat, s: &Mat) -> Mat {
        let mut h = Mat::zeros(self.len(), self.len());
        let mut first = 0;
        while first < self.moving {
            let last = (first + CHUNK).min(self.moving);
            self.add_moving(&mut h, first..last, x, s);
            first = last;
        }
        // Parameters that leave Zxx alone are unit matrices: four products each.
        for k in self.moving..self.len() {
            for j in k..self.len() {
                h[(j, k)] = unit_pair(self.units[j], self.units[k], x, s);
            }
        }
        h
    }

    fn add_moving(&self, h: &mut Mat, columns: std::ops::Range<usize>, x: &Mat, s: &Mat) {
        let n = self.n;
        let mut packed = Mat::zeros(self.states.nrows(), columns.len());
        for k in columns.clone() {
            let y = linalg::symmetric_part(&(x * self.moved(k) * s));
            pack(&y, n, packed.column_mut(k - columns.start).as_mut_slice());
            for (j, &(r, c)) in self.units.iter().enumerate().skip(columns.start) {
                h[(j, k)] += multiplicity(r, c) * y[(r, c)];
            }
        }
        let rows = self.moving - columns.start;
        let inner = linalg::transposed_product(&self.states, columns.start..self.moving, &packed);
        let mut part = h.view_mut((columns.start, columns.start), (rows, columns.len()));
        part += inner;
    }

    /// Z of the moving parameter k.
    fn moved(&self, k: usize) -> Mat {
        let mut z = Mat::zeros(self.order(), self.order());
        unpack(self.states.column(k).as_slice(), self.n, &mut z);
        let (r, c) = self.units[k];
        z[(r, c)] = 1.0;
        z[(c, r)] = 1.0;
        z
    }
}

fn multiplicity(r: usize, c: usize) -> f64 {
    if r == c { 1.0 } else { 2.0 }
}

/// `tr(E_j X E_k S)` of two symmetric unit matrices.
fn unit_pair((r, c): (usize, usize), (u, v): (usize, usize), x: &Mat, s: &Mat) -> f64 {
    let full = x[(c, u)] * s[(v, r)] + x[(c, v)] * s[(u, r)] + x[(r, u)] * s[(v, c)] + x[(r, v)] * s[(u, c)];
    0.25 * multiplicity(r, c) * multiplicity(u, v) * full
}

/// Lower triangle of the leading n x n block, off-diagonal entries times the root of 2: inner products of
/// packed columns are those of the matrices.
fn pack(z: &Mat, n: usize, to: &mut [f64]) {
    let mut at = 0;
    for j in 0..n {
        for i in j..n {
            to[at] = if i == j { z[(i, j)] } else { std::f64::consts::SQRT_2 * z[(i, j)] };
            at += 1;
        }
    }
}

fn unpack(from: &[f64], n: usize, z: &mut Mat) {
    let mut at = 0;
    for j in 0..n {
        for i in j..n {
            let v = if i == j { from[at] } else { std::f64::consts::FRAC_1_SQRT_2 * from[at] };
            z[(i, j)] = v;
            z[(j, i)] = v;
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(rows: usize, cols: usize, seed: f64) -> Mat {
        Mat::from_fn(rows, cols, |i, j| (seed + 1.7 * i as f64 + 0.9 * (j * (i + 1)) as f64).sin())
    }

    fn example() -> Covariance {
        let a = Mat::from_row_slice(3, 3, &[0.8, 0.5, 0.0, 0.0, -0.6, 0.2, 0.3, 0.0, 0.0]);
        Covariance::new(&a, &wavy(3, 2, 0.4), 2)
    }

    #[test]
    fn every_parameter_keeps_the_lyapunov_equality() {
        let map = example();
        let w: Vec<f64> = (0..map.len()).map(|k| (k as f64).cos()).collect();
        let z = map.expand(&w);
        assert_eq!(map.parameters(&z), w);
        let ab = Mat::from_fn(3, 5, |i, j| if j < 3 { map.a[(i, j)] } else { map.b[(i, j - 3)] });
        let next = &ab * z.view((0, 0), (5, 5)) * ab.transpose();
        assert!((next - z.view((0, 0), (3, 3))).norm() < 1e-13);
    }

    #[test]
    fn adjoint_and_newton_matrix_follow_their_definitions() {
        let map = example();
        let order = map.order();
        let positive = |seed: f64| {
            let f = wavy(order, order + 2, seed);
            &f * f.transpose() + Mat::identity(order, order)
        };
        let (x, s) = (positive(0.1), positive(2.2));
        let unit = |k: usize| {
            let mut w = vec![0.0; map.len()];
            w[k] = 1.0;
            map.expand(&w)
        };
        let image = map.adjoint(&s);
        let h = map.newton(&x, &s);
        for k in 0..map.len() {
            assert!((image[k] - unit(k).dot(&s)).abs() < 1e-11);
            for j in k..map.len() {
                let want = unit(j).dot(&linalg::symmetric_part(&(&x * unit(k) * &s)));
                assert!((h[(j, k)] - want).abs() < 1e-10 * want.abs().max(1.0), "{j} {k}");
            }
        }
    }

    #[test]
    fn both_equations_are_solved_for_slow_poles_and_delay_lines() {
        let slow = Mat::from_row_slice(2, 2, &[0.9999, 1.0, 0.0, 0.9]);
        let delay = Mat::from_fn(7, 7, |i, j| f64::from(u8::from(i == j + 1)));
        for a in [slow, delay, Mat::zeros(3, 3)] {
            let n = a.nrows();
            let q = Mat::from_fn(n, n, |i, j| ((1 + i) * (1 + j)) as f64 + f64::from(u8::from(i == j)));
            let lyapunov = Lyapunov::new(&a);
            let (x, p) = (lyapunov.forward(&q), lyapunov.adjoint(&q));
            assert!((&x - &a * &x * a.transpose() - &q).norm() < 1e-13 * x.norm());
            assert!((&p - a.transpose() * &p * &a - &q).norm() < 1e-13 * p.norm());
        }
    }
}
