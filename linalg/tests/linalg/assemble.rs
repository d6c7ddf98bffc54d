use hybank_linalg::{Mat, block_diagonal, from_blocks, vstack};

fn numbered(rows: usize, cols: usize, start: f64) -> Mat {
    Mat::from_fn(rows, cols, |i, j| start + (10 * i + j) as f64)
}

#[test]
fn every_entry_of_a_block_matrix_is_where_its_block_is() {
    for (r1, r2, c1, c2) in [(1, 1, 1, 1), (2, 3, 1, 4), (0, 2, 3, 0), (2, 0, 0, 2), (0, 0, 1, 2)] {
        let [a, b, c, d] = [(r1, c1), (r1, c2), (r2, c1), (r2, c2)]
            .map(|(rows, cols)| numbered(rows, cols, 1000.0 * rows as f64 + 100.0 * cols as f64));
        let whole = from_blocks(&[&[&a, &b], &[&c, &d]]);
        assert_eq!(whole.shape(), (r1 + r2, c1 + c2));
        let entry = |i: usize, j: usize| match (i < r1, j < c1) {
            (true, true) => a[(i, j)],
            (true, false) => b[(i, j - c1)],
            (false, true) => c[(i - r1, j)],
            (false, false) => d[(i - r1, j - c1)],
        };
        assert_eq!(whole, Mat::from_fn(r1 + r2, c1 + c2, entry));
    }
}

#[test]
fn a_block_diagonal_matrix_acts_on_each_part_alone() {
    let (a, b, c) = (numbered(2, 1, 1.0), numbered(0, 3, 0.0), numbered(1, 2, 5.0));
    let x = numbered(6, 1, 0.5);
    let parts = [&a * x.rows(0, 1), &b * x.rows(1, 3), &c * x.rows(4, 2)];
    let apart = vstack(&parts.each_ref());
    assert_eq!(block_diagonal(&[&a, &b, &c]) * x, apart);
}
