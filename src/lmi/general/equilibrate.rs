//! Scaling of the data before the iteration: unknowns, rows of every inequality, equalities and cost.

use super::Dual;
use super::problem::{LinearBlock, MatrixBlock, Problem};
use crate::linalg::Mat;

/// The factors, all powers of two: for each unknown, each row of each inequality, each equality, the
/// cost and the constants.
#[derive(Debug, Clone)]
pub(super) struct Scaling {
    unknowns: Vec<f64>,
    matrices: Vec<Vec<f64>>,
    linear: Vec<Vec<f64>>,
    equality: Vec<f64>,
    cost: f64,
    constant: f64,
}

/// Powers of two only: the scaling itself makes no rounding error.
fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { 2f64.powi(x.log2().round().clamp(-500.0, 500.0) as i32) } else { 1.0 }
}

fn inverse_root(x: f64) -> f64 {
    if x > 0.0 { power_of_two(1.0 / x.sqrt()) } else { 1.0 }
}

impl Scaling {
    /// `rounds` rounds of Ruiz's iteration on the coefficients of the unknowns, then one factor each for
    /// cost and constants.
    pub(super) fn new(problem: &Problem, rounds: usize) -> (Self, Problem) {
        let mut scaling = Self {
            unknowns: vec![1.0; problem.unknowns()],
            matrices: problem.matrices.iter().map(|b| vec![1.0; b.order]).collect(),
            linear: problem.linear.iter().map(|b| vec![1.0; b.constant.len()]).collect(),
            equality: vec![1.0; problem.rhs.len()],
            cost: 1.0,
            constant: 1.0,
        };
        let mut scaled = problem.clone();
        for _ in 0..rounds {
            scaling.round(&scaled);
            scaled = scaling.apply(problem);
        }
        if rounds > 0 {
            let cost = scaled.cost.iter().fold(0.0f64, |a, c| a.max(c.abs()));
            scaling.cost = if cost > 0.0 { power_of_two(1.0 / cost) } else { 1.0 };
            let constant = largest_constant(&scaled);
            scaling.constant = if constant > 0.0 { power_of_two(1.0 / constant) } else { 1.0 };
            scaled = scaling.apply(problem);
        }
        (scaling, scaled)
    }

    /// One round: every row and every unknown gets a largest entry nearer to 1.
    fn round(&mut self, scaled: &Problem) {
        let mut unknowns = vec![0.0f64; scaled.unknowns()];
        for (block, d) in scaled.matrices.iter().zip(&mut self.matrices) {
            let mut rows = vec![0.0; block.order];
            for (i, term) in &block.terms {
                unknowns[*i] = unknowns[*i].max(term.largest(block.order));
                term.raise_row_maxima(&mut rows);
            }
            // A congruence scales an entry by two factors, so each takes the fourth root.
            d.iter_mut().zip(rows).for_each(|(d, row)| *d *= inverse_root(row.sqrt()));
        }
        for (block, d) in scaled.linear.iter().zip(&mut self.linear) {
            let mut rows = vec![0.0f64; block.constant.len()];
            for &(row, i, v) in &block.entries {
                unknowns[i] = unknowns[i].max(v.abs());
                rows[row] = rows[row].max(v.abs());
            }
            d.iter_mut().zip(rows).for_each(|(d, row)| *d *= inverse_root(row));
        }
        for (row, d) in self.equality.iter_mut().enumerate() {
            let most = scaled.equality.row(row).amax();
            *d *= inverse_root(most);
            unknowns.iter_mut().enumerate().for_each(|(i, u)| *u = u.max(scaled.equality[(row, i)].abs()));
        }
        self.unknowns.iter_mut().zip(unknowns).for_each(|(d, u)| *d *= inverse_root(u));
    }

    fn apply(&self, problem: &Problem) -> Problem {
        let u = &self.unknowns;
        let matrix = |(block, d): (&MatrixBlock, &Vec<f64>)| MatrixBlock {
            order: block.order,
            constant: block.constant.congruence(d).scaled(self.constant),
            terms: block.terms.iter().map(|(i, t)| (*i, t.congruence(d).scaled(u[*i]))).collect(),
        };
        let linear = |(block, d): (&LinearBlock, &Vec<f64>)| LinearBlock {
            constant: block.constant.iter().zip(d).map(|(c, d)| c * d * self.constant).collect(),
            entries: block.entries.iter().map(|&(r, i, v)| (r, i, d[r] * v * u[i])).collect(),
        };
        Problem {
            cost: problem.cost.iter().zip(u).map(|(c, u)| c * u * self.cost).collect(),
            matrices: problem.matrices.iter().zip(&self.matrices).map(matrix).collect(),
            linear: problem.linear.iter().zip(&self.linear).map(linear).collect(),
            equality: Mat::from_fn(problem.rhs.len(), problem.unknowns(), |r, i| {
                self.equality[r] * problem.equality[(r, i)] * u[i]
            }),
            rhs: problem.rhs.iter().zip(&self.equality).map(|(b, d)| b * d * self.constant).collect(),
        }
    }

    /// Unknowns of the problem as given.
    pub(super) fn x(&self, scaled: &[f64]) -> Vec<f64> {
        scaled.iter().zip(&self.unknowns).map(|(x, u)| x * u / self.constant).collect()
    }

    /// Dual variables of the problem as given.
    pub(super) fn dual(&self, scaled: &Dual) -> Dual {
        let matrix = |(z, d): (&Mat, &Vec<f64>)| {
            Mat::from_fn(z.nrows(), z.ncols(), |i, j| d[i] * z[(i, j)] * d[j] / self.cost)
        };
        let times = |(z, d): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            z.iter().zip(d).map(|(z, d)| z * d / self.cost).collect()
        };
        Dual {
            matrices: scaled.matrices.iter().zip(&self.matrices).map(matrix).collect(),
            vectors: scaled.vectors.iter().zip(&self.linear).map(times).collect(),
            equalities: times((&scaled.equalities, &self.equality)),
        }
    }
}

fn largest_constant(problem: &Problem) -> f64 {
    let matrices = problem.matrices.iter().map(|b| b.constant.largest(b.order));
    let linear = problem.linear.iter().flat_map(|b| b.constant.iter().map(|c| c.abs()));
    matrices.chain(linear).chain(problem.rhs.iter().map(|b| b.abs())).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::Coefficient;
    use super::*;

    #[test]
    fn badly_scaled_rows_and_unknowns_come_near_to_one_and_back_without_rounding() {
        let f = |s: f64| Coefficient::Dense(Mat::from_fn(2, 2, |i, j| s * 10f64.powi(-4 * (i + j) as i32)));
        let problem = Problem::new(vec![1e9, 1e-9])
            .and_then(|p| p.matrix_inequality(2, f(1.0), vec![(0, f(1e9)), (1, f(-1e-9))]))
            .and_then(|p| p.linear_inequalities(vec![1e5], vec![(0, 0, 1e7), (0, 1, 1e-8)]))
            .unwrap();
        let (scaling, scaled) = Scaling::new(&problem, 8);
        let (_, term) = &scaled.matrices[0].terms[0];
        assert!((0.1..10.0).contains(&term.largest(2)));
        let mut rows = [0.0; 2];
        scaled.matrices[0].terms.iter().for_each(|(_, t)| t.raise_row_maxima(&mut rows));
        assert!(rows.iter().all(|r| (0.1..10.0).contains(r)), "{rows:?}");
        let x = scaling.x(&[3.0, 5.0]);
        let there = scaled.matrix_at(0, &[3.0, 5.0]);
        let back = problem.matrix_at(0, &x);
        let d = &scaling.matrices[0];
        for i in 0..2 {
            for j in 0..2 {
                let want = d[i] * back[(i, j)] * d[j] * scaling.constant;
                assert!((there[(i, j)] - want).abs() <= 1e-15 * want.abs());
            }
        }
    }
}
