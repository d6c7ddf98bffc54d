//! Decompositions and transforms against their definitions, on structured and nasty matrices.
//!
//! They stand outside of the crate so that the generic code of its dependencies is compiled once, not twice.

mod assemble;
mod balance;
mod blocks;
mod cholesky;
mod eigen;
mod fourier;
mod lq;
mod small;
mod svd;

/// Sums of small integers are exact in any order.
#[test]
fn inner_products_of_all_lengths_are_sums() {
    for n in 0..40 {
        let (x, y): (Vec<f64>, Vec<f64>) = (0..n).map(|k| (f64::from(k), f64::from(n - 2 * k))).unzip();
        let sum: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
        assert_eq!(hybank_linalg::dot(&x, &y), sum, "{n}");
    }
}
