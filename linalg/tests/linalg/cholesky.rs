use hybank_linalg::{LinalgError, Mat, cholesky};

#[test]
fn cholesky_names_the_failing_pivot() {
    let m = Mat::from_diagonal(&vec![1.0, 2.0, -1.0].into());
    assert_eq!(cholesky(&m), Err(LinalgError::NotPositiveDefinite { pivot: 2 }));
}
