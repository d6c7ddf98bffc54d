//! Coefficient matrices of a symmetric block: dense, sparse or of low rank.

use crate::linalg::Mat;

/// A symmetric matrix that multiplies one unknown (or stands alone).
#[derive(Debug, Clone, PartialEq)]
pub enum Coefficient {
    /// All entries; must be symmetric.
    Dense(Mat),
    /// (row, column, value): an off-diagonal entry stands for itself and its mirror image and is given
    /// once; repeated entries add up.
    Sparse(Vec<(usize, usize, f64)>),
    /// `sum_r weights[r] vectors[:, r] vectors[:, r]'`.
    LowRank {
        /// n x r.
        vectors: Mat,
        /// r signed weights.
        weights: Vec<f64>,
    },
}

impl Coefficient {
    /// The zero matrix.
    pub fn zero() -> Self {
        Self::Sparse(Vec::new())
    }

    /// The n x n identity.
    pub fn identity(n: usize) -> Self {
        Self::Sparse((0..n).map(|i| (i, i, 1.0)).collect())
    }

    /// `<F, Y> = sum_ab F_ab Y_ab` for any square Y, of which only the symmetric part counts.
    pub(super) fn inner(&self, y: &Mat) -> f64 {
        match self {
            Self::Dense(f) => f.dot(y),
            Self::Sparse(entries) => entries
                .iter()
                .map(|&(a, b, v)| if a == b { v * y[(a, a)] } else { v * (y[(a, b)] + y[(b, a)]) })
                .sum(),
            Self::LowRank { vectors, weights } => {
                let image = y * vectors;
                weights.iter().enumerate().map(|(r, w)| w * vectors.column(r).dot(&image.column(r))).sum()
            }
        }
    }

    /// `to += alpha F`.
    pub(super) fn add_to(&self, alpha: f64, to: &mut Mat) {
        match self {
            Self::Dense(f) => to.zip_apply(f, |t, v| *t += alpha * v),
            Self::Sparse(entries) => {
                for &(a, b, v) in entries {
                    to[(a, b)] += alpha * v;
                    if a != b {
                        to[(b, a)] += alpha * v;
                    }
                }
            }
            Self::LowRank { vectors, weights } => {
                for (r, w) in weights.iter().enumerate() {
                    let u = vectors.column(r);
                    to.ger(alpha * w, &u, &u, 1.0);
                }
            }
        }
    }

    /// `X F Z`.
    pub(super) fn sandwich(&self, x: &Mat, z: &Mat) -> Mat {
        match self {
            Self::Dense(f) => x * (f * z),
            Self::Sparse(entries) => {
                let mut half = Mat::zeros(x.nrows(), x.nrows());
                for &(a, b, v) in entries {
                    half.column_mut(b).axpy(v, &x.column(a), 1.0);
                    if a != b {
                        half.column_mut(a).axpy(v, &x.column(b), 1.0);
                    }
                }
                half * z
            }
            Self::LowRank { vectors, weights } => {
                let mut left = x * vectors;
                for (mut column, w) in left.column_iter_mut().zip(weights) {
                    column *= *w;
                }
                left * (z * vectors).transpose()
            }
        }
    }

    /// `D F D` with a diagonal D.
    pub(super) fn congruence(&self, d: &[f64]) -> Self {
        match self {
            Self::Dense(f) => Self::Dense(Mat::from_fn(f.nrows(), f.ncols(), |i, j| d[i] * f[(i, j)] * d[j])),
            Self::Sparse(entries) => {
                Self::Sparse(entries.iter().map(|&(a, b, v)| (a, b, d[a] * v * d[b])).collect())
            }
            Self::LowRank { vectors, weights } => Self::LowRank {
                vectors: Mat::from_fn(vectors.nrows(), vectors.ncols(), |i, r| d[i] * vectors[(i, r)]),
                weights: weights.clone(),
            },
        }
    }

    /// `alpha F`.
    pub(super) fn scaled(&self, alpha: f64) -> Self {
        match self {
            Self::Dense(f) => Self::Dense(f * alpha),
            Self::Sparse(entries) => {
                Self::Sparse(entries.iter().map(|&(a, b, v)| (a, b, alpha * v)).collect())
            }
            Self::LowRank { vectors, weights } => Self::LowRank {
                vectors: vectors.clone(),
                weights: weights.iter().map(|w| alpha * w).collect(),
            },
        }
    }

    /// Raises `rows[a]` to the largest modulus in row a.
    pub(super) fn raise_row_maxima(&self, rows: &mut [f64]) {
        let mut raise = |a: usize, v: f64| rows[a] = rows[a].max(v.abs());
        match self {
            Self::Dense(f) => {
                f.column_iter().for_each(|c| c.iter().enumerate().for_each(|(a, v)| raise(a, *v)));
            }
            Self::Sparse(entries) => entries.iter().for_each(|&(a, b, v)| {
                raise(a, v);
                raise(b, v);
            }),
            // Diagonal entries bound the row well enough for scaling.
            Self::LowRank { vectors, weights } => {
                for (r, w) in weights.iter().enumerate() {
                    let most = vectors.column(r).amax();
                    vectors.column(r).iter().enumerate().for_each(|(a, u)| raise(a, w * u * most));
                }
            }
        }
    }

    /// Largest modulus of an entry (an upper bound of it for low rank).
    pub(super) fn largest(&self, order: usize) -> f64 {
        let mut rows = vec![0.0; order];
        self.raise_row_maxima(&mut rows);
        rows.into_iter().fold(0.0, f64::max)
    }

    /// Multiplications that an inner product with a full matrix takes.
    pub(super) fn inner_cost(&self, order: usize) -> usize {
        match self {
            Self::Dense(_) => order * order,
            Self::Sparse(entries) => 2 * entries.len(),
            Self::LowRank { weights, .. } => weights.len() * order * order,
        }
    }

    /// Multiplications that `X F Z` takes.
    pub(super) fn sandwich_cost(&self, order: usize) -> usize {
        match self {
            Self::Dense(_) => 2 * order.pow(3),
            Self::Sparse(entries) => 2 * entries.len() * order + order.pow(3),
            Self::LowRank { weights, .. } => 3 * weights.len() * order * order,
        }
    }
}

/// `tr(F X G Z)` entry by entry, for two sparse matrices.
pub(super) fn sparse_product(f: &[(usize, usize, f64)], g: &[(usize, usize, f64)], x: &Mat, z: &Mat) -> f64 {
    let mut sum = 0.0;
    for &(a, b, v) in f {
        for &(c, d, w) in g {
            // tr(e_a e_b' X e_c e_d' Z) = X[b,c] Z[d,a], and the mirror images.
            let mut term = x[(b, c)] * z[(d, a)];
            if c != d {
                term += x[(b, d)] * z[(c, a)];
            }
            if a != b {
                term += x[(a, c)] * z[(d, b)];
                if c != d {
                    term += x[(a, d)] * z[(c, b)];
                }
            }
            sum += v * w * term;
        }
    }
    sum
}
