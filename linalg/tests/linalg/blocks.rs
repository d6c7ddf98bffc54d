use hybank_linalg::blocks::{Batch, SmallCholesky};
use hybank_linalg::{CMat, Complex};

fn wavy(rows: usize, cols: usize, seed: f64) -> CMat {
    CMat::from_fn(rows, cols, |i, j| {
        let t = seed + 1.7 * i as f64 + 0.9 * j as f64;
        Complex::new(t.sin(), (1.3 * t).cos())
    })
}

#[test]
fn products_agree_with_nalgebra_for_all_sizes_and_adjoints() {
    for n in 1..20 {
        let (a, b) = (wavy(n, n, 0.1), wavy(n, n, 0.7));
        let mut store = Batch::zeros(3, n, n);
        store.set(0, &a);
        store.set(1, &b);
        let mut out = Batch::zeros(1, n, n);
        let (x, y) = (store.block(0), store.block(1));
        let cases = [
            (x.plain(), y.plain(), &a * &b),
            (x.adjoint(), y.plain(), a.adjoint() * &b),
            (x.plain(), y.adjoint(), &a * b.adjoint()),
            (x.adjoint(), y.adjoint(), a.adjoint() * b.adjoint()),
        ];
        for (p, q, want) in cases {
            out.block_mut(0).set_product(2.0, p, q);
            out.block_mut(0).add_product(-1.0, p, q);
            assert!((out.to_matrix(0) - &want).norm() < 1e-12 * want.norm(), "n = {n}");
        }
    }
}

#[test]
fn cholesky_tells_definite_from_indefinite() {
    for n in 1..20 {
        let a = wavy(n, n + 2, 0.3);
        let gram = &a * a.adjoint() + CMat::identity(n, n);
        let mut chol = SmallCholesky::new(n);
        let mut store = Batch::zeros(1, n, n);
        store.set(0, &gram);
        assert!(chol.factor(store.block_mut(0)));
        let mut l = store.to_matrix(0);
        l.fill_upper_triangle(Complex::default(), 1);
        assert!((&l * l.adjoint() - &gram).norm() < 1e-13 * gram.norm());
        store.set(0, &(&gram - CMat::identity(n, n) * Complex::new(gram.trace().re, 0.0)));
        assert!(n == 1 || !chol.factor(store.block_mut(0)));
        store.set(0, &gram.map(|_| Complex::new(f64::NAN, 0.0)));
        assert!(!chol.factor(store.block_mut(0)));
    }
}
